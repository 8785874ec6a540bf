//! Cameras of USD stages.

use super::*;

/// A camera in a rig that moves along x by 1 a time code from 101 on, with a lens, one from above, whose rays are parallel, and one that is skewed.
const SHOT: &str = r#"#usda 1.0
(
    metersPerUnit = 0.01
    startTimeCode = 101
    upAxis = "Y"
)

def Xform "world"
{
    double3 xformOp:translate.timeSamples = {
        101: (0, 0, 0),
        111: (10, 0, 0),
    }
    uniform token[] xformOpOrder = ["xformOp:translate"]

    def Camera "cam"
    {
        float focalLength = 36
        float focusDistance = 20
        float fStop = 0.5
        float horizontalAperture = 24
        double3 xformOp:translate = (2, 0, 20)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
}

def Camera "plan"
{
    float horizontalAperture = 80
    token projection = "orthographic"
    float xformOp:rotateX = -90
    double3 xformOp:translate = (2, 9, 0)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]
}
"#;

const WORDS: &str = "--size 48x32 --samples 1 --look flat --radius 0.6 -q";

/// Files that are numbered, and one of three frames.
fn folder() -> Folder {
    let folder = Folder::new();
    folder.file("shot.usda", SHOT);
    folder.file("s.0102.xyz", line_of(5));
    folder.file("s.0105.xyz", line_of(5));
    folder.file("all.xyz", line_of(5).repeat(3));
    folder
}

/// The words that say what the camera of the rig is when it is at x.
fn seen_from(x: f64) -> String {
    format!(
        "--eye {x},0,20 --look-at {x},0,0 --up 0,1,0 --horizontal-fov {}",
        2.0 * (12_f64 / 36.0).atan().to_degrees()
    )
}

#[test]
fn pictures_are_seen_by_the_camera_of_a_stage_at_their_time() {
    let folder = folder();
    let pixels = |name: &str| png(&folder.path(name)).0;
    let render = |words: &str| folder.line(&format!("render {words} {WORDS}"));
    for (name, x) in [("x1", 3.0), ("x4", 6.0), ("x0", 2.0), ("x2", 4.0)] {
        render(&format!("s.0102.xyz -o {name}.png {}", seen_from(x))).fine();
    }
    assert!(pixels("x1.png") != pixels("x4.png") && pixels("x0.png") != pixels("x2.png"));
    // Numbers of files are time codes.
    render("s.####.xyz -o n.####.png --camera shot.usda:/world/cam").fine();
    assert!(pixels("n.0102.png") == pixels("x1.png") && pixels("n.0105.png") == pixels("x4.png"));
    // Frames of one file count from the start of the stage, and so do pictures of one frame.
    render("all.xyz -o f.%d.png --camera shot.usda:/world/cam").fine();
    render("all.xyz -o g.%d.png --frame 0 --frame-count 3 --camera shot.usda:world/cam").fine();
    render("s.####.xyz -o h.%d.png --frame 102 --frame-count 4 --camera shot.usda:world/cam").fine();
    for name in ["f", "g"] {
        assert!(pixels(&format!("{name}.0.png")) == pixels("x0.png"), "{name}");
        assert!(pixels(&format!("{name}.2.png")) == pixels("x2.png"), "{name}");
    }
    assert!(pixels("h.0.png") == pixels("x1.png") && pixels("h.3.png") == pixels("x4.png"));
    // Parallel rays.
    render("all.xyz -o plan.png --camera shot.usda:/plan").fine();
    let plan = format!("--eye 2,9,0 --look-at 2,0,0 --up 0,0,-1 --ortho {}", 8.0 / 1.5);
    render(&format!("all.xyz -o wanted.png {plan}")).fine();
    assert!(pixels("plan.png") == pixels("wanted.png"));
    let map = "all.xyz -o a.png --size 24x16 --mode project -q --camera shot.usda:/plan";
    folder.line(&format!("render {map}")).fine();
}

#[test]
fn the_lens_of_a_stage_is_that_of_looks_by_paths() {
    let folder = folder();
    let pixels = |name: &str| png(&folder.path(name)).0;
    let words = "s.0102.xyz --size 24x16 --samples 8 --radius 0.6";
    let stage = "--camera shot.usda:/world/cam";
    let lens = "--aperture 3.6";
    folder.line(&format!("render {words} -o a.png --look matte {stage}")).fine();
    folder.line(&format!("render {words} -o b.png --look matte {} {lens}", seen_from(2.0))).fine();
    folder.line(&format!("render {words} -o c.png --look matte {stage} --aperture 0.01")).fine();
    assert!(pixels("a.png") == pixels("b.png") && pixels("a.png") != pixels("c.png"));
    let said = folder.line(&format!("render {words} -o d.png {stage}")).fine();
    assert!(said.contains("the fStop of the camera is left out"), "{said}");
    assert!(said.contains("camera /world/cam of shot.usda"), "{said}");
    let said = folder.line(&format!("render {words} -o d.png {stage} --aperture 0.01")).fine();
    assert!(!said.contains("fStop"), "{said}");
}

#[test]
fn scenes_and_pictures_remember_the_stage() {
    let folder = folder();
    let pixels = |name: &str| png(&folder.path(name)).0;
    std::fs::create_dir(folder.path("sub")).unwrap();
    std::fs::copy(folder.path("shot.usda"), folder.path("sub/shot.usda")).unwrap();
    let line =
        format!("render all.xyz -o a.%d.png {WORDS} --camera sub/shot.usda:/world/cam --save-scene a.toml");
    folder.line(&line).fine();
    let saved = std::fs::read_to_string(folder.path("a.toml")).unwrap();
    assert!(saved.contains("camera = [\"sub/shot.usda:/world/cam\"]"), "{saved}");
    folder.line("render a.toml -o b.%d.png -q").fine();
    let table = "[particles]\nfiles = ['../all.xyz']\n[[camera]]\nfile = 'shot.usda'\nprim = '/world/cam'\n";
    folder.file("sub/c.toml", table);
    folder.line(&format!("render sub/c.toml -o c.%d.png {WORDS}")).fine();
    for name in ["b.2.png", "c.2.png"] {
        assert!(pixels(name) == pixels("a.2.png"), "{name}");
    }
    folder.line("render --again a.2.png -o d.png -q").fine();
    assert!(pixels("d.png") == pixels("a.2.png"));
    // What it was made of is told where it has changed.
    folder.file("sub/shot.usda", SHOT.replace("(2, 0, 20)", "(2, 0.5, 20)"));
    let said = folder.line("render --again a.2.png -o d.png").fine();
    assert!(said.contains("'sub/shot.usda' is not what the picture was made of"), "{said}");
    assert!(pixels("d.png") != pixels("a.2.png"));
    folder.file(
        "d.toml",
        "[particles]\nfiles = ['all.xyz']\n[[camera]]\nfile = 'shot.usda'\neye = [1, 2, 3]\n",
    );
    folder.line("render d.toml -o x.png").fails(3, &["a camera of a file has no 'eye'", "d.toml: line 3"]);
}

#[test]
fn what_no_stage_has_is_told() {
    let folder = folder();
    folder.file("binary.usd", b"PXR-USDC\0\0\x08");
    let fails = |words: &str, code: i32, what: &[&str]| {
        folder.line(&format!("render all.xyz -o x.png {WORDS} --camera {words}")).fails(code, what);
    };
    fails("shot.usda", 3, &["there are 2 cameras: /world/cam, /plan", "FILE:/world/cam"]);
    fails("shot.usda:/cam", 3, &["there is no camera '/cam'", "there is: /world/cam, /plan"]);
    fails("binary.usd", 3, &["binary USD", "usdcat"]);
    fails("missing.usda", 3, &["missing.usda"]);
    fails("shot.usda:/plan --eye 1,2,3", 2, &["--eye is not for the camera of shot.usda"]);
    fails("shot.usda:/plan --camera eye=1,2,3", 2, &["another --camera"]);
    fails("shot.usda:/plan --orbit 90", 2, &["--orbit"]);
    fails("shot.abc", 2, &["--camera cannot be 'shot.abc'", "FILE.usda:/PATH"]);
    let perspective = ["projection cannot be 'perspective'"];
    folder
        .line("render all.xyz -o x.png --size 24x16 --mode project -q --camera shot.usda:/world/cam")
        .fails(2, &perspective);
}
