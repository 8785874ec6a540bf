//! `convert`: files out of files, and the words when that cannot be.

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
