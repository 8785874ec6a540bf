//! `build`: the same pictures from a file that opens at once, and words where it does not fit.

use super::{Folder, line_of, png};

/// Renders to pixels.
#[track_caller]
fn pixels(folder: &Folder, line: &str) -> (Vec<u8>, String) {
    let told = folder.render(&format!("{line} -o out.png --device cpu")).fine();
    (png(&folder.path("out.png")).0, told)
}

#[test]
fn pictures_of_what_was_built_are_those_of_the_source() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(300));
    for structure in
        ["bvh", "pkd", "treelets", "treelets --treelet-cut middle --treelet-size 16", "bvh --pack 16"]
    {
        let told = folder.line(&format!("build a.xyz -o a.tyn --structure {structure}")).fine();
        assert!(
            told.contains("a.tyn  300 particles · ") && told.contains("radius of the elements"),
            "{told}"
        );
        for view in
            ["", "--view z --color c_pe --frame-all", "--filter c_pe=10:200 --radius-scale 1.5 --clip x<0.5L"]
        {
            let (expected, _) = pixels(&folder, &format!("a.xyz --structure {structure} {view}"));
            let (found, told) = pixels(&folder, &format!("a.tyn {view}"));
            assert!(!told.contains("not used"), "{told}");
            assert!(found == expected, "{structure} {view}");
        }
    }
    assert_eq!(folder.names(), ["a.tyn", "a.xyz", "out.png"]);
}

#[test]
fn what_does_not_fit_is_built_anew_and_says_why() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(100));
    folder.line("build a.xyz -o a.tyn --radius 0.4").fine();
    for (flags, why) in [
        ("--structure pkd", "(bvh) is not used: pkd is asked for"),
        ("--pack 16", "(bvh) is not used: bvh packed 16 bits is asked for"),
        ("--radius 0.3", "it has radius 0.4, radius 0.3 is asked for"),
    ] {
        let radius = if flags.contains("radius") { "" } else { "--radius 0.4" };
        let (expected, _) = pixels(&folder, &format!("a.xyz {radius} {flags}"));
        let (found, told) = pixels(&folder, &format!("a.tyn {flags}"));
        assert!(told.contains(why), "{told}");
        assert!(found == expected, "{flags}");
    }
    let (expected, _) = pixels(&folder, "a.xyz --radius 0.4 --structure bvh");
    let (found, told) = pixels(&folder, "a.tyn --radius 0.4 --structure bvh");
    assert!(found == expected && !told.contains("not used"), "{told}");
    folder.line("build a.xyz -o each.tyn --pack 8 --structure bvh").fine();
    let (_, told) = pixels(&folder, "each.tyn --radius-scale 2");
    assert!(
        told.contains("packed: centers off") && !told.contains("not used"),
        "a table of radii is exact: {told}"
    );
}

#[test]
fn a_file_is_an_input_like_any_other() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(3) + &line_of(50));
    let told = folder.line("build a.xyz -o b.tyn --fields c_pe").fine();
    assert!(told.contains("note: frame 0 of 2; --frame N for another"), "{told}");
    folder.line("build a.xyz -o a.tyn --frame -1").fine();
    let info = folder.line("info a.tyn").out;
    assert!(info.contains("Tyndall · 1 frame · 50 particles"), "{info}");
    assert!(
        info.contains("columns position · species text · c_pe f") && info.contains("structure bvh"),
        "{info}"
    );
    assert!(info.contains("written by tyndall ") && !info.contains("checksums"), "{info}");
    assert!(folder.line("info a.tyn --check").out.contains("all checksums right"));
    let json = folder.line("info a.tyn --json").out;
    assert!(json.contains("\"species\": \"Cu\"") && json.contains("\"c_pe\": 49.5"), "{json}");
    folder.line("convert a.tyn -o c.xyz").fine();
    folder.line("convert a.xyz -o d.xyz --frame 1").fine();
    assert_eq!(std::fs::read(folder.path("c.xyz")).unwrap(), std::fs::read(folder.path("d.xyz")).unwrap());
    // The attribute of the radii stays.
    assert!(folder.line("info b.tyn").out.contains("columns position · species text · c_pe"));
    folder.line("build a.tyn -o e.tyn --structure pkd --fields c_pe --radius 1").fine();
    assert!(folder.line("info e.tyn").out.contains("columns position · c_pe"));
}

#[test]
fn what_cannot_be_built_says_why_and_writes_nothing() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(3));
    folder.line("build a.xyz -o b.vtp").fails(2, &["-o cannot be 'b.vtp'", ".tyn"]);
    folder.line("build a.xyz -o none/b.tyn").fails(4, &["its folder does not exist"]);
    folder.line("build a.xyz -o b.tyn --structure brute").fails(2, &["brute has nothing to save"]);
    folder
        .line("build a.xyz -o b.tyn --fields speed")
        .fails(2, &["--fields cannot be 'speed'", "species c_pe"]);
    folder.line("build a.xyz -o b.tyn --frame 3").fails(2, &["--frame cannot be '3'"]);
    folder.line("build synthetic:packed?n=4e9 -o b.tyn").fails(4, &["needs"]);
    folder.line("info a.xyz --check").fails(2, &["for .tyn files only"]);
    let told = folder.line("build a.xyz -o b.tyn --dry-run").out;
    assert!(told.contains("dry run: memory ") && told.contains("nothing written"), "{told}");
    assert_eq!(folder.names(), ["a.xyz"]);
    folder.line("build a.xyz -o a.tyn").fine();
    folder.line("build a.tyn -o a.tyn").fails(2, &["this one is being read"]);
}

#[test]
fn damage_is_told_with_file_and_place() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(500));
    folder.line("build a.xyz -o a.tyn").fine();
    let whole = std::fs::read(folder.path("a.tyn")).unwrap();
    folder.file("cut.tyn", &whole[..whole.len() / 2]);
    folder.render("cut.tyn -o out.png").fails(3, &["the file ends early", "cut.tyn"]);
    let mut flipped = whole;
    flipped[4100] ^= 4;
    folder.file("flipped.tyn", &flipped);
    folder
        .line("info flipped.tyn --check")
        .fails(3, &["position.x", "flipped.tyn", "damaged", "build the file anew"]);
    folder.line("convert flipped.tyn -o b.csv").fails(3, &["position.x"]);
    folder.render("flipped.tyn -o out.png").fine();
}
