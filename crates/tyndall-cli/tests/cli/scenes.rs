//! Scene files, and pictures that are made again by what is written in them.

use super::{Folder, line_of, png};

const SMALL: &str = "[picture]\nsize = [24, 16]\nsamples = 4\n[look]\nlook = 'flat'\n";

/// The pixels of a picture.
fn pixels(folder: &Folder, name: &str) -> Vec<u8> {
    png(&folder.path(name)).0
}

#[test]
fn a_scene_says_what_flags_say() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path("in")).unwrap();
    folder.file("in/a.xyz", line_of(6));
    let words =
        "--color c_pe --range 0:4 --view -y --filter c_pe=1: --clip x<4 --background black --look flat";
    folder.line(&format!("render in/a.xyz -o a.png --size 24x16 --samples 4 {words}")).fine();
    let scene = "[particles]\nfiles = 'a.xyz'\n[picture]\nsize = [24, 16]\nsamples = 4\nbackground = 'black'\noutput = 'b.png'\n\
                 [camera]\nview = '-y'\n[selection]\nfilter = ['c_pe=1:']\nslice = 'x<4'\n\
                 [look]\ncolor = 'c_pe'\nrange = [0, 4]\nlook = 'flat'\n";
    folder.file("in/s.toml", scene);
    // Names of files are relative to the scene.
    folder.line("render in/s.toml").fine();
    let wanted = pixels(&folder, "a.png");
    assert!(wanted == pixels(&folder, "in/b.png"));

    // What the command line says counts more, also where it excludes what the scene says.
    folder.line("render in/a.xyz -o c.png --size 24x16 --samples 4 --color c_pe --range 0:4 --eye 1,-9,0 --look-at 2,0,0 --filter c_pe=2: --clip x<4 --background none --look flat").fine();
    folder.line("render in/s.toml -o d.png --eye 1,-9,0 --look-at 2,0,0 --filter c_pe=2: --alpha").fine();
    assert!(pixels(&folder, "c.png") == pixels(&folder, "d.png"));
    // A later scene counts more than an earlier one; files take the place of files.
    folder.file("more.toml", "[look]\ncolor = 'red'\n");
    folder.line("render in/s.toml more.toml -o e.png").fine();
    assert!(wanted != pixels(&folder, "e.png"));
    folder.file("b.xyz", line_of(3));
    assert!(folder.line("render in/s.toml b.xyz -o f.png").fine().contains("3 particles"));
}

#[test]
fn a_saved_scene_renders_the_same_picture() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path("in")).unwrap();
    folder.file("in/a.xyz", line_of(5));
    let all = "--color c_pe --range -1:1e1 --eye 1.50,-12,3 --look-at 2,0,0 --fov 20 --filter c_pe=0.5: --select x<4 --samples 16 --background #102030";
    let saved = "--save-scene in/s.toml --seed 7 --threads 1";
    folder.line(&format!("render in/a.xyz -o in/a.png --size 24x16 {all} {saved}")).fine();
    let text = std::fs::read_to_string(folder.path("in/s.toml")).unwrap();
    for line in [
        "files = [\"a.xyz\"]",
        "output = \"a.png\"",
        "size = [24, 16]",
        "seed = 7",
        "range = \"-1:1e1\"",
        "fov = 20",
    ] {
        assert!(text.lines().any(|it| it == line), "{line} is not in {text}");
    }
    assert!(!text.contains("threads") && !text.contains("cmap"), "{text}");
    let wanted = pixels(&folder, "in/a.png");
    folder.line("render in/s.toml -o b.png").fine();
    assert!(wanted == pixels(&folder, "b.png"));
    folder.line("render in/s.toml -o b.png --save-scene t.toml").fine();
    folder.line("render t.toml -o c.png").fine();
    assert!(wanted == pixels(&folder, "c.png"));
    folder.line("render in/a.xyz -o b.png --save-scene a.txt").fails(2, &["--save-scene", ".toml"]);
}

#[test]
fn a_medium_of_a_scene_is_saved_too() {
    let folder = Folder::new();
    folder.file("block.raw", [1.0_f32; 64].iter().flat_map(|it| it.to_le_bytes()).collect::<Vec<u8>>());
    let scene = "[grid]\nfile = 'block.raw'\nsize = [4, 4, 4]\nsample = 'f32'\nspacing = 0.1\n[medium]\nextinction = [1, 2, 3.5]\n\
                 [[light]]\nkind = 'sun'\nalong = [0, -1, -1]\nirradiance = 2\n";
    folder.file("s.toml", scene);
    folder.render("s.toml -o a.png --save-scene t.toml").fine();
    folder.line("render t.toml -o b.png").fine();
    assert!(pixels(&folder, "a.png") == pixels(&folder, "b.png"));
    std::fs::remove_file(folder.path("s.toml")).unwrap();
    folder.line("render --again a.png -o c.png").fine();
    assert!(pixels(&folder, "a.png") == pixels(&folder, "c.png"));
}

#[test]
fn what_a_scene_says_wrong_has_a_line() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(2));
    let start = "[particles]\nfiles = ['a.xyz']\n";
    for (text, parts) in [
        ("[camera]\neyes = 1\n", ["[camera] has no key 'eyes', did you mean 'eye'?", "s.toml: line 4"]),
        ("[picture]\n\nsize = '5'\n", ["size cannot be '5'", "s.toml: line 5"]),
        ("[picture]\nsamples = 0\n", ["samples", "s.toml: line 4"]),
        ("[look]\ncmap = 'viridsi'\n", ["did you mean 'viridis'?", "s.toml: line 4"]),
        (
            "[[camera]]\nat = 1\n[[camera]]\nat = 2\nfov = 200\n",
            ["camera cannot be 'at=2 fov=200'", "s.toml: line 5"],
        ),
        ("[camera]\nview = 'x'\neye = [1, 2, 3]\n", ["cannot be used with", "s.toml: line"]),
    ] {
        folder.file("s.toml", format!("{start}{text}"));
        folder.line("render s.toml -o a.png").fails(3, &parts);
    }
    folder.file("s.toml", "[look]\ncolor = 'red'\n");
    folder.line("render s.toml -o a.png").fails(3, &["neither [grid] nor [particles]", "s.toml"]);
    folder.file("s.toml", start);
    folder.line("render s.toml").fails(2, &["--output"]);
    folder.line("render no.toml -o a.png").fails(3, &["no.toml"]);
}

#[test]
fn a_picture_is_made_again_by_what_is_written_in_it() {
    let folder = Folder::new();
    folder.file("a.xyz", [line_of(4), line_of(5), line_of(6)].concat());
    folder.file("s.toml", format!("[particles]\nfiles = ['a.xyz']\n{SMALL}"));
    folder.line("render s.toml -o a.%d.png --color c_pe --fixed-range --orbit 90 --seed 3").fine();
    let wanted = pixels(&folder, "a.2.png");
    // The third picture: its camera and colors follow from the first.
    std::fs::remove_file(folder.path("s.toml")).unwrap();
    folder.line("render --again a.2.png -o b.png").fine();
    assert!(wanted == pixels(&folder, "b.png"));
    assert_eq!(folder.names(), ["a.0.png", "a.1.png", "a.2.png", "a.xyz", "b.png"]);
    // One that was made again knows all that, too; and an EXR does.
    folder.line("render --again b.png -o c.exr").fine();
    folder.line("render --again c.exr -o c.png").fine();
    assert!(wanted == pixels(&folder, "c.png"));
    folder.line("render --again b.png -o d.jpg --quality 100").fine();
    folder.line("render --again d.jpg -o d.png").fine();
    assert!(wanted == pixels(&folder, "d.png"));
    // Flags count before what they were; without -o it is the same file.
    folder.line("render --again a.2.png --background black").fine();
    assert!(wanted != pixels(&folder, "a.2.png"));

    // Files that are not what they were are told, unless others take their place.
    folder.file("a.xyz", [line_of(4), line_of(5), line_of(7)].concat());
    assert!(
        folder
            .line("render --again b.png -o e.png")
            .fine()
            .contains("'a.xyz' is not what the picture was made of")
    );
    assert!(!folder.line("render --again b.png a.xyz -o e.png").fine().contains("is not what"));
    folder.line("render --again b.png -o e.png --frames :2").fails(2, &["a.2.png is none of the pictures"]);
    folder.line("render --again a.xyz -o e.png").fails(3, &["neither a PNG, an EXR nor a JPEG"]);
    folder.file("empty.png", std::fs::read(folder.path("b.png")).unwrap().split_at(60).0);
    folder.line("render --again empty.png -o e.png").fails(3, &["empty.png"]);
}
