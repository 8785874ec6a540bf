//! What the command line says in place of a file: elements and units.

use super::{Folder, dump, png};

/// A dump of two types of particles that touch.
fn types() -> String {
    dump("id type x y z", 8.0, &["1 1 2 2 2", "2 2 4 2 2", "3 2 2 4 2", "4 3 6 6 6"])
}

fn text(folder: &Folder, name: &str) -> String {
    std::fs::read_to_string(folder.path(name)).unwrap()
}

#[test]
fn elements_of_types_are_those_of_colors_radii_bonds_and_files() {
    let folder = Folder::new();
    folder.file("a.dump", types());
    folder.file(
        "told.dump",
        dump("id type x y z element", 8.0, &["1 1 2 2 2 Cu", "2 2 4 2 2 Zr", "3 2 2 4 2 Zr", "4 3 6 6 6 O"]),
    );
    let same = "--bonds --color element";
    let said = folder.render(&format!("a.dump -o a.png --elements Cu,Zr,O {same}")).fine();
    assert!(said.contains("elements by type: 1 Cu, 2 Zr, 3 O"), "{said}");
    assert!(said.contains("radius of the elements of element, van der Waals"), "{said}");
    folder.render(&format!("told.dump -o told.png {same}")).fine();
    folder.render("a.dump -o types.png --color type").fine();
    let pixels = |name: &str| png(&folder.path(name)).0;
    assert!(pixels("a.png") == pixels("told.png") && pixels("a.png") != pixels("types.png"));

    // Files of other programs have symbols, and the choice goes by them.
    let said = folder
        .run(&["convert", "a.dump", "-o", "a.xyz", "--elements", "1=Cu,3=O", "--select", "element != O"])
        .fine();
    let warning = "warning: 1 of 3 types have no element, --elements 1=Cu,3=O does not name them: 2";
    assert!(said.contains(warning) && said.contains("elements by type: 1 Cu, 3 O"), "{said}");
    let rows: Vec<String> = text(&folder, "a.xyz")
        .lines()
        .skip(2)
        .map(|row| row.split(' ').next().unwrap().to_string())
        .collect();
    assert_eq!(rows, ["Cu", "X", "X"]);
    folder.line("convert a.dump -o b.xyz --elements Cu,Zr,O --fields id").fine();
    assert!(text(&folder, "b.xyz").contains("Properties=pos:R:3:id:I:1"), "{}", text(&folder, "b.xyz"));

    // What is built has them, and its radii; these cannot be told anew.
    folder.line("build a.dump -o a.tyn --elements Cu,Zr,O").fine();
    let info = folder.line("info a.tyn").out;
    assert!(info.contains("element text") && info.contains("elements by type: 1 Cu, 2 Zr, 3 O"), "{info}");
    folder.render(&format!("a.tyn -o built.png {same}")).fine();
    assert!(pixels("built.png") == pixels("a.png"));
    folder
        .render("a.tyn -o b.png --elements O,O,O")
        .fails(2, &["--elements cannot be 'O,O,O'", "tyndall build"]);

    let info = folder.line("info a.dump --elements Cu,Zr").out;
    assert!(info.contains("element text") && info.contains("given: elements by type: 1 Cu, 2 Zr"), "{info}");
}

#[test]
fn elements_go_through_scenes_pictures_and_layers() {
    let folder = Folder::new();
    folder.file("a.dump", types());
    folder.render("a.dump -o a.png --elements 1=Cu,2=Zr,3=O --save-scene s.toml").fine();
    assert!(text(&folder, "s.toml").contains("[reading]\nelements = "), "{}", text(&folder, "s.toml"));
    folder.line("render s.toml -o b.png").fine();
    folder.line("render --again a.png -o c.png").fine();
    folder.file("t.toml", "[particles]\nfiles = 'a.dump'\n[reading]\nelements = ['Cu', 'Zr', 'O']\n");
    folder.render("t.toml -o d.png").fine();
    let pixels = |name: &str| png(&folder.path(name)).0;
    let wanted = pixels("a.png");
    assert!(["b.png", "c.png", "d.png"].iter().all(|name| pixels(name) == wanted));
    let said = folder.run(&[
        "render",
        "a.dump",
        "-o",
        "e.png",
        "--size",
        "48x32",
        "--samples",
        "4",
        "--layer",
        "a.dump --elements Cu,Zr,O",
    ]);
    assert!(said.fine().contains("layer a.dump: 4 particles, coordinates: x y z, elements by type: 1 Cu"));
}

#[test]
fn elements_that_cannot_be_told_say_why() {
    let folder = Folder::new();
    folder.file("a.dump", types());
    folder.file("b.csv", "x,y,z,q\n0,0,0,1\n1,0,0,2\n");
    for (words, parts) in [
        ("a.dump --elements Cu,Xx", ["'Xx'", "symbols of elements"]),
        ("a.dump --elements A=Cu", ["'type' are numbers: 1, 2, 3", "words"]),
        ("b.csv --elements Cu", ["no whole numbers or words are types", "the file has: q"]),
    ] {
        folder.render(&format!("{words} -o a.png")).fails(2, &parts);
        folder.line(&format!("info {words}")).fails(2, &parts);
        folder.line(&format!("convert {words} -o a.xyz")).fails(2, &parts);
    }
    assert!(!folder.path("a.png").exists() && !folder.path("a.xyz").exists());
}

#[test]
fn units_make_bars_radii_and_lengths_possible() {
    let folder = Folder::new();
    folder.file("a.dump", dump("id type element x y z vx", 8.0, &["1 1 Cu 2 2 2 0", "2 1 Cu 6 2 2 1"]));
    let wide = "a.dump -o a.png --ortho auto --scalebar 0.4nm";
    folder.render(wide).fails(2, &["--scalebar cannot be '0.4 nm'", "a number alone", "--units nm"]);
    folder
        .line("convert a.dump -o a.xyz --select x>0.4nm")
        .fails(2, &["leave the unit out, or say it with --units"]);

    let said = folder.render(&format!("{wide} --units A")).fine();
    assert!(said.contains("lengths in Å") && said.contains("scale bar 0.4 nm"), "{said}");
    assert!(said.contains("van der Waals × 1, in Å ·"), "{said}");
    let said = folder.render("a.dump -o b.png --scalebar 2 --units nm").fine();
    assert!(said.contains("× 1, in nm ·") && said.contains("scale bar 2 nm"), "{said}");
    folder.line("convert a.dump -o a.csv --select x>0.4nm --units metal").fine();
    assert_eq!(text(&folder, "a.csv"), "x [Å],y [Å],z [Å],id,type,element,vx [Å/ps]\n6,2,2,2,1,Cu,1\n");
    let info = folder.line("info a.dump").out;
    assert!(info.contains("note: no length unit in the file (set --units Å)"), "{info}");
    let info = folder.line("info a.dump --units lj").out;
    assert!(info.contains("given: units lj: numbers alone") && !info.contains("note:"), "{info}");

    // The file's own unit gives way, in a line.
    folder.file("a.xyz", "1\nTime=2.0\nCu 0 0 0\n");
    let said = folder.render("a.xyz -o c.png --units nm").fine();
    assert!(said.contains("lengths in nm, in place of Å as the file or its format says"), "{said}");
    folder.render("a.xyz -o c.png --units metall").fails(2, &["--units", "did you mean metal?"]);
    folder.line("build a.dump -o a.tyn --units metal").fine();
    assert!(folder.line("info a.tyn").out.contains("Å pp pp pp"), "{}", folder.line("info a.tyn").out);
    let info = folder.line("info a.tyn --units pm").out;
    assert!(info.contains("8×8×8 pm") && info.contains("given: lengths in pm, in place of Å"), "{info}");

    // Layers, scenes and pictures keep them.
    folder
        .run(&[
            "render",
            "a.dump",
            "-o",
            "d.png",
            "--size",
            "48x32",
            "--samples",
            "4",
            "--units",
            "real",
            "--save-scene",
            "s.toml",
            "--layer",
            "a.dump --units nm",
        ])
        .fine();
    let scene = text(&folder, "s.toml");
    assert!(scene.contains("[reading]\nunits = \"real\"") && scene.contains("units = \"nm\""), "{scene}");
    let said = folder.line("render --again d.png -o e.png").fine();
    assert!(said.contains("units real: lengths in Å") && said.contains("lengths in nm"), "{said}");
}
