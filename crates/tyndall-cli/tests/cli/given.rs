//! What the command line says in place of a file: elements, units, and which atoms a trajectory has.

use std::fmt::Write as _;

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

/// Three molecules of water in a GRO file.
fn water() -> String {
    let mut text = "Water\n    9\n".to_string();
    for atom in 0..9 {
        let (molecule, name) = (atom / 3, ["OW", "HW1", "HW2"][atom % 3]);
        let x = molecule as f64 + 0.1 * (atom % 3) as f64;
        writeln!(text, "{:5}SOL  {name:>5}{:5}{x:8.3}{:8.3}{:8.3}", molecule + 1, atom + 1, 1.0, 1.0)
            .unwrap();
    }
    text + "3.0 3.0 3.0\n"
}

/// A TRR file of one frame with so many atoms on a line along x.
fn trr(count: i32) -> Vec<u8> {
    let mut file = Vec::new();
    let whole = |file: &mut Vec<u8>, number: i32| file.extend(number.to_be_bytes());
    [1993, 13, 12].iter().for_each(|&number| whole(&mut file, number));
    file.extend(b"GMX_trn_file");
    // Sizes of blocks: box, positions, and others that are not there; then atoms, step and a number; time and lambda.
    let sizes = [0, 0, 36, 0, 0, 0, 0, 12 * count, 0, 0, count, 0, 0];
    sizes.iter().for_each(|&number| whole(&mut file, number));
    let numbers = [0.0f32; 2].into_iter().chain([3.0, 0.0, 0.0, 0.0, 3.0, 0.0, 0.0, 0.0, 3.0]);
    let places = (0..count).flat_map(|atom| [0.25 * atom as f32, 1.0, 1.0]);
    file.extend(numbers.chain(places).flat_map(f32::to_be_bytes));
    file
}

#[test]
fn a_trajectory_of_some_atoms_has_their_names_by_an_index_file() {
    let folder = Folder::new();
    folder.file("conf.gro", water());
    folder.file("traj.trr", trr(3));
    folder
        .file("index.ndx", "[ System ]\n1 2 3 4 5 6 7 8 9\n[ Oxygen ]\n1 4\n7\n[ Hydrogen ]\n2 3 5\n6 8 9\n");
    folder.line("convert conf.gro traj.trr -o a.xyz").fails(
        3,
        &[
            "conf.gro has 9 particles, traj.trr frame 0 has 3",
            "the trajectory may hold a subset: pass --index FILE.ndx",
        ],
    );
    folder.line("convert conf.gro traj.trr -o a.csv --index index.ndx --fields resid,name,id").fine();
    let rows = "x [nm],y [nm],z [nm],resid,name,id\n0,1,1,1,OW,1\n0.25,1,1,2,OW,4\n0.5,1,1,3,OW,7\n";
    assert_eq!(text(&folder, "a.csv"), rows);
    let info = folder.line("info conf.gro traj.trr --index index.ndx:1").out;
    assert!(
        info.contains("guessed: from conf.gro, group Oxygen of index.ndx: resid resname name id"),
        "{info}"
    );
    let said = folder.render("conf.gro traj.trr -o a.png --index index.ndx:Oxygen --color element").fine();
    assert!(said.contains("group Oxygen of index.ndx") && said.contains("color elements of name"), "{said}");

    // Scenes have the file beside them; a layer has one of its own.
    std::fs::create_dir(folder.path("in")).unwrap();
    folder
        .render("conf.gro traj.trr -o b.png --index index.ndx:Oxygen --color element --save-scene in/s.toml")
        .fine();
    assert!(text(&folder, "in/s.toml").contains("/index.ndx:Oxygen\"\n"), "{}", text(&folder, "in/s.toml"));
    folder.line("render in/s.toml -o c.png").fine();
    folder.line("render --again a.png -o d.png").fine();
    let pixels = |name: &str| png(&folder.path(name)).0;
    assert!(["b.png", "c.png", "d.png"].iter().all(|name| pixels(name) == pixels("a.png")));
    let layer = "conf.gro traj.trr --index index.ndx:1";
    let said = folder
        .run(&["render", "conf.gro", "-o", "e.png", "--size", "48x32", "--samples", "4", "--layer", layer])
        .fine();
    assert!(said.contains("group Oxygen"), "{said}");

    folder.file("other.ndx", "[ Far ]\n1 2 12\n[ Twice ]\n1 2 1\n[ Two ]\n1 2\n");
    folder.file("bad.ndx", "[ A ]\n1 x\n");
    for (words, code, parts) in [
        (
            "conf.gro traj.trr --index index.ndx:Hydrogen",
            3,
            ["group Hydrogen of index.ndx has 6 particles", "index.ndx:GROUP"],
        ),
        ("conf.gro traj.trr --index index.ndx:Protein", 2, ["--index cannot be 'Protein'", "1 Oxygen (3)"]),
        ("conf.gro traj.trr --index other.ndx", 2, ["several have 3 atoms", "0 Far (3), 1 Twice (3)"]),
        (
            "conf.gro traj.trr --index other.ndx:Far",
            3,
            ["atom 12 is not there: conf.gro has 9", "other.ndx: group Far"],
        ),
        ("conf.gro traj.trr --index other.ndx:Twice", 3, ["atom 1 stands twice", "group Twice"]),
        ("conf.gro traj.trr --index bad.ndx", 3, ["found 'x'", "bad.ndx: line 2"]),
        ("conf.gro traj.trr --index none.ndx:A", 3, ["none.ndx", "No such file"]),
        ("traj.trr conf.gro --index index.ndx", 2, ["--index cannot be", "in this order: conf.gro traj.xtc"]),
        ("conf.gro --index index.ndx:Oxygen", 2, ["--index cannot be", "--select"]),
    ] {
        folder.line(&format!("info {words}")).fails(code, &parts);
    }
}
