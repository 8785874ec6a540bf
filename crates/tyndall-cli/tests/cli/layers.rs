//! Several sources of particles in one picture.

use std::fmt::Write as _;

use super::{Folder, line_of, png};

const SMALL: &str = "--size 48x32 --samples 4 --look flat --background black --eye 2,-9,0 --look-at 2,0,0";

fn pixels(folder: &Folder, name: &str) -> Vec<u8> {
    png(&folder.path(name)).0
}

/// How many pixels of a picture have a color, of RGB in a picture without alpha.
fn count(folder: &Folder, name: &str, wanted: [u8; 3]) -> usize {
    pixels(folder, name).as_chunks::<3>().0.iter().filter(|it| **it == wanted).count()
}

/// Extended XYZ of particles on a line along z, each frame one unit further along x.
fn frames(count: usize) -> String {
    let mut text = String::new();
    for frame in 0..count {
        writeln!(text, "2\nProperties=species:S:1:pos:R:3\nC {frame} 0 1\nC {frame} 0 -1").unwrap();
    }
    text
}

#[test]
fn each_layer_has_its_own_colors_radii_and_choice() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(5));
    folder.file("b.xyz", frames(1));
    let layer = "b.xyz --color lime --radius 0.4 --select 'z > 0'";
    let mut words: Vec<&str> = "render a.xyz -o a.png --color red --radius 0.3".split(' ').collect();
    words.extend(SMALL.split(' '));
    words.extend(["--layer", layer]);
    let said = folder.run(&words).fine();
    assert!(
        said.contains("layer b.xyz: 2 particles")
            && said.contains("radius 0.4 given, color constant")
            && said.contains("shown: 1 of 2"),
        "{said}"
    );
    let [red, green] = [[255, 0, 0], [0, 255, 0]].map(|color| count(&folder, "a.png", color));
    assert!(red > 20 && green > 3, "{red} red and {green} green pixels");

    // The same from a scene, and again from the picture.
    folder.run(&[&words[..], &["--save-scene", "s.toml"]].concat()).fine();
    let text = std::fs::read_to_string(folder.path("s.toml")).unwrap();
    assert!(text.contains("[[layer]]\nfiles = [\"b.xyz\"]\nselect = [\"z > 0\"]\n"), "{text}");
    folder.line("render s.toml -o b.png").fine();
    folder.line("render --again a.png -o c.png").fine();
    let (wanted, _, texts) = png(&folder.path("a.png"));
    assert!(wanted == pixels(&folder, "b.png") && wanted == pixels(&folder, "c.png"));
    let inputs = &texts.iter().find(|(name, _)| name == "Inputs").unwrap().1;
    assert!(inputs.contains("a.xyz (") && inputs.contains("b.xyz ("), "{inputs}");
    let scene = "[particles]\nfiles = 'a.xyz'\n[look]\ncolor = 'red'\nradius = 0.3\nlook = 'flat'\n\
                 [[layer]]\nfiles = 'b.xyz'\ncolor = 'lime'\nradius = 0.4\nselect = 'z > 0'\n\
                 [picture]\nsize = [48, 32]\nsamples = 4\nbackground = 'black'\noutput = 'd.png'\n\
                 [camera]\neye = [2, -9, 0]\nlook-at = [2, 0, 0]\n";
    folder.file("t.toml", scene);
    folder.line("render t.toml").fine();
    assert!(wanted == pixels(&folder, "d.png"));

    // All structures show the same.
    for structure in ["pkd", "treelets", "brute"] {
        folder.run(&[&words[..], &["--structure", structure, "-o", "e.png"]].concat()).fine();
        assert!(wanted == pixels(&folder, "e.png"), "{structure}");
    }
}

#[test]
fn a_layer_of_one_frame_stays_and_others_go_along() {
    let folder = Folder::new();
    folder.file("a.xyz", frames(3));
    folder.file("b.xyz", line_of(5));
    let render = |more: &[&str]| {
        let words = ["render", "a.xyz", "-o", "p.%d.png", "--color", "red", "--radius", "0.3"];
        let small: Vec<&str> = SMALL.split(' ').collect();
        folder.run(&[&words[..], &small, more].concat())
    };
    render(&["--layer", "b.xyz --color blue --radius 0.2"]).fine();
    let first = count(&folder, "p.0.png", [0, 0, 255]);
    assert!(first > 5 && count(&folder, "p.2.png", [0, 0, 255]) > 5);
    assert!(pixels(&folder, "p.0.png") != pixels(&folder, "p.2.png"));
    folder.file("c.xyz", frames(2));
    render(&["--layer", "c.xyz"]).fails(2, &["--layer", "c.xyz", "2 frames", "which has 3"]);
}

#[test]
fn spheres_stand_in_smoke_whichever_is_named_first() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(2));
    let smoke = "synthetic:clustered?n=300";
    let of_picture = "--size 24x16 --samples 2 --seed 3 --grid 16";
    let render = |words: &str, layer: &str, name: &str| {
        let words: Vec<&str> = words.split(' ').chain(of_picture.split(' ')).collect();
        folder.run(&[&["render"][..], &words, &["--layer", layer, "-o", name]].concat())
    };
    let said = render("a.xyz --radius 0.3 --color red", &format!("{smoke} --mode medium"), "a.png").fine();
    assert!(said.contains("300 particles") && said.contains("layer a.xyz: 2 particles"), "{said}");
    render(&format!("{smoke} --mode medium"), "a.xyz --radius 0.3 --color red", "b.png").fine();
    assert!(pixels(&folder, "a.png") == pixels(&folder, "b.png"));
    render(&format!("{smoke} --mode medium --method reference"), "a.xyz --radius 0.3", "c.png").fine();

    let brute = format!("{smoke} --mode medium --cache off --photons 1000 --samples 1");
    render(&brute, "a.xyz --radius 0.3", "e.png").fine();

    let refused = |words: &str, layer: &str, parts: &[&str]| render(words, layer, "d.png").fails(2, parts);
    refused("a.xyz --look metal", &format!("{smoke} --look smoke"), &["a --look other than matte", "medium"]);
    refused(&format!("{smoke} --mode medium"), &format!("{smoke} --look fire"), &["one layer", "medium"]);
    refused(&format!("{smoke} --mode medium --show density"), "a.xyz", &["--show", "spheres and a medium"]);
    refused("a.xyz --mode project", "a.xyz", &["map of numbers has no layers"]);
}

#[test]
fn what_is_no_layer_is_refused() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(2));
    let refused = |layer: &str, parts: &[&str]| {
        folder.run(&["render", "a.xyz", "-o", "a.png", "--layer", layer]).fails(2, parts);
    };
    refused("a.xyz --size 10x10", &["--layer 'a.xyz --size 10x10'", "--size is of the whole picture"]);
    refused("a.xyz --colr red", &["--colr", "--color"]);
    refused("a.xyz --select 'x > 0", &["quotation mark"]);
    refused("", &["--layer ''", "FILE"]);
    let fails = |layer: &str, parts: &[&str]| {
        folder.run(&["render", "a.xyz", "-o", "a.png", "--layer", layer]).fails(3, parts);
    };
    fails("a.xyz --select 'x > 10'", &["0 of 2 particles are shown", "x"]);
    fails("b.xyz", &["b.xyz"]);
    folder
        .run(&["render", "a.xyz", "-o", "a.png", "--replicate", "2", "--layer", "a.xyz"])
        .fails(2, &["--replicate"]);

    for (text, parts) in [
        ("[[layer]]\ncolor = 'red'", &["a layer needs files", "line 4"][..]),
        ("[[layer]]\nfiles = 'a.xyz'\nsize = [1, 1]", &["'size' is of the whole picture", "line 4"]),
        ("[[layer]]\nfiles = 'a.xyz'\nradios = 1", &["did you mean 'radius'?", "line 4"]),
    ] {
        folder.file("s.toml", format!("[particles]\nfiles = 'a.xyz'\n\n{text}\n"));
        folder.line("render s.toml -o a.png").fails(3, parts);
    }
}
