//! `convert`: files out of files, and the words when that cannot be.

use tyndall_io::{Options, Sequence, write};

use super::{Folder, line_of};

#[test]
fn frames_go_into_one_file_or_into_many() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(3) + &line_of(5));
    let told = folder.line("convert a.xyz -o b.dump").fine();
    assert!(told.contains("b.dump  8 particles · 2 frames"), "{told}");
    folder.line("convert b.dump -o c.%03d.ply --fields c_pe").fine();
    assert_eq!(folder.names(), ["a.xyz", "b.dump", "c.000.ply", "c.001.ply"]);
    let info = folder.line("info c.001.ply").out;
    assert!(info.contains("5 particles") && info.contains("c_pe") && !info.contains("type"), "{info}");
    let told = folder.line("convert a.xyz -o d.csv").fine();
    assert!(told.contains("note: frame 0 of 2; --frame N for another, -o NAME.%04d.EXT for all"), "{told}");
    assert!(
        folder
            .line("convert a.xyz -o d.csv --frame 1 --skip-existing")
            .fine()
            .contains("d.csv is there already")
    );
    assert!(folder.line("info d.csv").out.contains("3 particles"));
    folder.line("convert a.xyz -o e.xyz --frames -1:").fine();
    assert!(folder.line("info e.xyz").out.contains("1 frame · 5 particles"));
}

#[test]
fn only_what_is_selected_is_converted() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(3) + &line_of(5));
    let told = folder.line("convert a.xyz -o b.dump --clip x<3.5 --select index>0").fine();
    assert!(
        told.contains("kept: 2 of 3 particles (index>0; x<3.5)") && told.contains("5 particles"),
        "{told}"
    );
    let expected = "0 of 3 particles are left — the selection 'index>2' keeps none (index has 0, 1, 2)";
    folder.line("convert a.xyz -o c.xyz --select index>2").fails(3, &[expected]);
    assert_eq!(folder.names(), ["a.xyz", "b.dump"]);
}

#[test]
fn what_cannot_be_converted_says_why_and_writes_nothing() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(3) + &line_of(5));
    folder.line("convert a.xyz -o b.doc").fails(2, &["-o cannot be 'b.doc'", "known: .xyz .dump .csv"]);
    folder.line("convert a.xyz -o a.xyz").fails(2, &["this one is being read"]);
    folder
        .line("convert a.xyz -o b.csv --fields speed")
        .fails(2, &["--fields cannot be 'speed'", "species c_pe"]);
    folder.line("convert a.xyz -o b.csv --frame 7").fails(2, &["--frame cannot be '7'"]);
    folder.line("convert a.xyz -o b.ply --frames 0:2").fails(2, &["holds one frame, not 2"]);
    folder.line("convert none.xyz -o b.csv").fails(3, &["none.xyz"]);
    folder.line("convert a.xyz -o none/b.csv").fails(4, &["its folder does not exist"]);
    folder.file("c.csv", "x,y,z\n0,0,0\nnan,1,1\n");
    folder.line("convert c.csv -o b.csv --on-bad error").fails(3, &["1 of 2 particles cannot be drawn"]);
    assert_eq!(folder.names(), ["a.xyz", "c.csv"]);
}

#[test]
fn only_the_fields_that_are_written_are_read() {
    let folder = Folder::new();
    let rows: String = (0..50).map(|k| format!("Cu {k} 0.5 -1 {k}e-1 {} 7 {}\n", k % 3, 50 - k)).collect();
    let text = format!("50\nProperties=species:S:1:pos:R:3:q:R:1:kind:I:1:radius:R:1:w:R:1\n{rows}");
    folder.file("a.xyz", &text);
    // What is no number is found where it is looked at.
    folder.file("b.xyz", text.replace(" 7 20\n", " 7 half\n"));
    folder.line("convert b.xyz -o b.csv").fails(3, &["'half'"]);
    // As a file is written whose attributes are all read.
    let all = Sequence::open(&[folder.path("a.xyz")], &Options::default(), &()).unwrap();
    let bytes = |name: &str| std::fs::read(folder.path(name)).unwrap();
    for name in ["a.csv", "a.npz", "a.prt", "a.dump", "a.xyz", "a.ply", "a.bgeo"] {
        // Names are in the order that was asked for, and in any case.
        for fields in ["kind,Q", "species", "radius"] {
            let names: Vec<String> = fields.split(',').map(String::from).collect();
            let path = folder.path(&format!("all-{name}"));
            let frame = |_| all.frame(0, &()).map(|it| it.particles);
            write::particles::particles(&path, Some(&names), 1, frame).unwrap();
            folder.line(&format!("convert b.xyz -o some-{name} --fields {fields}")).fine();
            assert!(bytes(&format!("some-{name}")) == bytes(&format!("all-{name}")), "{name} {fields}");
        }
    }
    let told = folder.line("convert b.xyz -o b.csv --fields species --select kind==1 --filter q=1:3").fine();
    assert!(told.contains("kept: 7 of 50 particles (q=1:3; kind==1)"), "{told}");
    folder.line("convert b.xyz -o b.csv --fields w").fails(3, &["'half'"]);
    folder.line("convert b.xyz -o b.csv --fields q,speed").fails(3, &["'half'"]);
    folder.line("build b.xyz -o b.tyn --fields q").fine();
    let info = folder.line("info b.tyn").out;
    assert!(info.contains("· q f32") && !info.contains("kind"), "{info}");
}

#[test]
fn particles_become_grids_of_voxels() {
    let folder = Folder::new();
    // A block of particles that move along x at twice their height.
    let mut rows = "1000\nProperties=pos:R:3:w:R:1:vel:R:3\n".to_string();
    for k in 0..1000 {
        let at = [k % 10, k / 10 % 10, k / 100].map(|it| 0.5 * f64::from(it));
        rows += &format!("{} {} {} 2 {} 0 1\n", at[0], at[1], at[2], 2.0 * at[2]);
    }
    folder.file("a.xyz", &rows);
    let told = folder.line("convert a.xyz -o a.vdb --field density,w,vel --voxel 0.25").fine();
    assert!(told.contains("1,000 particles · grid") && told.contains("voxels of 0.25"), "{told}");
    assert!(!told.contains("found by"), "{told}");
    let info = folder.line("info a.vdb").out;
    assert!(info.starts_with("OpenVDB 224 · 3 grids\ndensity float · fog volume · "), "{info}");
    assert!(info.contains("\nvel vec3s · ") && info.contains("active voxels of 0.25 · x "), "{info}");
    let json = folder.line("info a.vdb --json").out;
    assert!(json.contains("\"name\": \"density\"") && json.contains("\"scale\""), "{json}");

    // Grids to grids: the same again, some of them, in fewer bits.
    folder.line("convert a.vdb -o b.vdb").fine();
    assert_eq!(std::fs::read(folder.path("a.vdb")).unwrap(), std::fs::read(folder.path("b.vdb")).unwrap());
    folder.line("convert a.vdb -o c.vdb --fields w --half").fine();
    let info = folder.line("info c.vdb").out;
    assert!(info.contains("1 grid\nw float as half · "), "{info}");
    folder.line("convert a.vdb -o a.vdb").fails(2, &["this one is being read"]);
    folder
        .line("convert a.vdb -o d.vdb --fields rho")
        .fails(2, &["'rho'", "density (float), w (float), vel"]);
    folder.line("convert a.vdb -o d.csv").fails(3, &["a.vdb", "has no particles", "[grid]"]);

    // The picture of the grid is about that of the particles.
    let view = "--eye 9,7,5 --look-at 2,2,2 --up 0,0,1 --extinction 0.5 --light sun:1,-1,-1:3 --size 64x48";
    folder.line(&format!("render a.xyz -o a.png --mode medium --voxel 0.25 {view}")).fine();
    let told = folder.line(&format!("render a.vdb -o b.png {view}")).fine();
    assert!(told.contains("density: grid 'density' of density (float), w (float), vel (vec3s)"), "{told}");
    let [a, b] = ["a.png", "b.png"].map(|name| super::png(&folder.path(name)).0);
    let apart = a.iter().zip(&b).map(|(a, b)| u64::from(a.abs_diff(*b))).sum::<u64>() as f64 / a.len() as f64;
    assert!(apart < 0.5 && a.iter().any(|it| *it > 60), "{apart}");
    folder.line("render a.vdb -o w.png --dataset w --size 32x24").fine();
    folder.line("render a.vdb -o w.png --dataset vel --size 32x24").fails(3, &["of vectors"]);

    // Numbered files, and frames of them.
    folder.file("s.xyz", line_of(30) + &line_of(50));
    folder.line("convert s.xyz -o s.%02d.vdb").fine();
    assert!(folder.path("s.00.vdb").exists() && folder.path("s.01.vdb").exists());
    folder.line("render s.00.vdb s.01.vdb -o s.%d.png --size 32x24").fine();
    assert!(folder.path("s.1.png").exists());
}

#[test]
fn what_becomes_no_grid_says_why() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(30) + &line_of(50));
    folder
        .line("convert a.xyz -o a.vdb --field density,c_pc")
        .fails(2, &["--fields cannot be 'c_pc'", "did you mean 'c_pe'?", "density species c_pe"]);
    folder.line("convert a.xyz -o a.vdb --field density,density").fails(2, &["each grid once"]);
    folder.line("convert a.xyz -o a.vdb --voxel none").fails(2, &["--voxel cannot be 'none'", "auto"]);
    folder.line("convert a.xyz -o a.csv --half").fails(2, &["--half", "-o NAME.vdb"]);
    folder.line("convert a.xyz -o a.vdb --frames 0:2").fails(2, &["holds one frame, not 2"]);
    folder.line("convert a.xyz -o none/a.vdb").fails(4, &["its folder does not exist"]);
    folder.line("convert a.xyz -o a.vdb --voxel 1e-9").fails(2, &["grid"]);
    assert_eq!(folder.names(), ["a.xyz"]);
    let told = folder.line("convert a.xyz -o a.vdb --voxel auto").fine();
    assert!(told.contains("found by the smoothing lengths") && told.contains("note: frame 0 of 2"), "{told}");
}
