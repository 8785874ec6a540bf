//! What is said when something is wrong: one line that says what, where, why and what to try; and the exit code.

use super::{Folder, dump, line_of};

#[test]
fn an_unknown_format_names_what_was_seen() {
    let folder = Folder::new();
    folder.file("foo.dat", "1 2 3 4 5 6 7\n1 2 3 4 5 6 7\n");
    let parts =
        ["error[E-format]", "cannot tell the format of 'foo.dat' (text, 7 columns, no header)", "--columns"];
    folder.line("info foo.dat").fails(3, &parts);
    folder.render("foo.dat -o a.png").fails(3, &parts);
    let garbage: Vec<u8> = (0..9999_u32).map(|k| (k.wrapping_mul(2654435761) >> 13) as u8).collect();
    folder.file("garbage.bin", garbage);
    folder.line("info garbage.bin").fails(3, &["cannot tell the format of 'garbage.bin' (binary"]);
    folder.file("empty.xyz", "");
    folder.line("info empty.xyz").fails(3, &["the file is empty", "empty.xyz"]);
    folder.line("info --format doc foo.dat").fails(2, &["format cannot be 'doc'", "xyz"]);
    let help = folder.line("convert --help").out;
    for name in ["tyn", "lammps-binary", "usda", "csv"] {
        assert!(help.split_whitespace().any(|it| it == name), "{name}: {help}");
    }
    assert!(!folder.path("a.png").exists());
}

#[test]
fn a_missing_attribute_names_the_nearest() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(5));
    let parts = ["no attribute 'c_e'", "did you mean 'c_pe'", "available: species, c_pe"];
    folder.render("a.xyz -o a.png --color c_e").fails(2, &parts);
    folder
        .render("a.xyz -o a.png --color c_pe --cmap viridi")
        .fails(2, &["--cmap", "viridi", "did you mean 'viridis'"]);
}

#[test]
fn coordinates_that_look_scaled_are_told_and_can_be_changed() {
    let folder = Folder::new();
    let rows: Vec<String> = (0..10).map(|k| format!("{k} 0.{k} 0.{k} 0.5")).collect();
    let rows: Vec<&str> = rows.iter().map(String::as_str).collect();
    folder.file("a.dump", dump("id x y z", 40.0, &rows));
    let ran = folder.render("a.dump -o a.png");
    assert!(ran.err.contains("warning: coordinates look scaled (0..1)"), "{ran:?}");
    assert!(ran.err.contains("--coords scaled"), "{ran:?}");
    let json = folder.line("info --json --coords scaled a.dump").out;
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    let max = json["bounds"]["max"][0].as_f64().unwrap();
    assert!((max - 36.0).abs() < 1e-5, "{max}");
}

#[test]
fn a_truncated_file_gives_its_whole_frames_or_fails() {
    let folder = Folder::new();
    let frame = dump("id x y z", 4.0, &["1 1 2 3", "2 3 2 1"]);
    folder.file("a.dump", format!("{frame}{}", &frame[..frame.len() - 12]));
    let said = folder.render("a.dump -o a.png").fine();
    assert!(
        said.contains(
            "warning: a.dump ends inside frame 2 of ≥2 — 1 whole frames read (use --strict to fail)"
        ),
        "{said}"
    );
    folder.render("a.dump -o b.png --strict").fails(3, &["ends inside frame 2", "--strict"]);
    folder.file("b.dump", &frame[..frame.len() - 12]);
    folder.line("info b.dump").fails(3, &["b.dump"]);
}

#[test]
fn bad_particles_are_dropped_and_counted_or_stop_the_work() {
    let folder = Folder::new();
    folder.file("a.csv", "x,y,z,radius\n0,0,0,1\nnan,0,0,1\n1,1,1,-2\n2,0,1,0.5\n");
    let said = folder.render("a.csv -o a.png").fine();
    let warning = "warning: dropped 2 of 4 particles (1 NaN positions, 1 radius < 0); --on-bad error to stop";
    assert_eq!(said.matches(warning).count(), 1, "{said}");
    folder
        .render("a.csv -o b.png --on-bad error")
        .fails(3, &["2 of 4 particles cannot be drawn", "--on-bad drop"]);
    folder.file("none.csv", "x,y,z\nnan,0,0\nnan,1,1\n");
    folder.render("none.csv -o b.png").fails(3, &["0 particles", "all 2 of the frame were dropped"]);
    assert!(!folder.path("b.png").exists());
}

#[test]
fn far_outliers_do_not_ruin_the_frame_unless_wanted() {
    let folder = Folder::new();
    let mut rows = String::from("x,y,z\n");
    for k in 0..3000 {
        rows += &format!("{},{},{}\n", k % 15, k / 15 % 15, k / 225);
    }
    folder.file("a.csv", rows + "1e6,1e6,1e6\n");
    let said = folder.render("a.csv -o a.png").fine();
    assert!(
        said.contains("warning: 0.03332 % of particles lie") && said.contains("(--frame-all to see all)"),
        "{said}"
    );
    let said = folder.render("a.csv -o a.png --frame-all --radius 1e5").fine();
    assert!(!said.contains("warning") && said.contains("framed on all particles"), "{said}");
}

#[test]
fn a_blank_picture_is_an_error_and_not_a_file() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(5));
    let past = folder.render("a.xyz -o a.png --eye 0,50,0 --look-at 0,90,0");
    past.fails(3, &["0 of 5 particles are in view — ", "x -1.4..5.4"]);
    folder.render("a.xyz -o a.png --radius 1e-9").fails(3, &["no sample met one", "--radius"]);
    folder.render("synthetic:uniform?n=0 -o a.png").fails(3, &["0 particles"]);
    assert_eq!(folder.names(), ["a.xyz"]);
}

#[test]
fn a_selection_that_shows_nothing_says_why() {
    let folder = Folder::new();
    folder.file("a.dump", dump("id type x y z", 9.0, &["1 1 1 2 3", "2 2 3 2 1", "3 1 5 5 5"]));
    let render = |selection: &[&str]| folder.run(&[&["render", "a.dump", "-o", "a.png"], selection].concat());
    render(&["--filter", "type=9"])
        .fails(3, &["0 of 3 particles are shown — the filter 'type=9' keeps none (type has 1, 2)"]);
    render(&["--filter", "x=6:"]).fails(3, &["the filter 'x=6:' keeps none (x has 1, 3, 5)"]);
    render(&["--filter", "type=1", "--clip", "z<0.1L"]).fails(3, &["the clip 'z<0.1L' keeps none"]);
    render(&["--filter", "type=2", "--clip", "x>4"])
        .fails(3, &["each filter and clip keeps some particles, but together"]);
    render(&["--filter", "typ=1"])
        .fails(2, &["no attribute 'typ'; did you mean 'type'? available: id, type, x, y, z"]);
    render(&["--filter", "type"]).fails(2, &["there is no '='", "type=1,3"]);
    render(&["--clip", "w<3"]).fails(2, &["z<0.5L", "plane X,Y,Z NX,NY,NZ"]);
    render(&["--select", "type == 9"])
        .fails(3, &["0 of 3 particles are shown — the selection 'type == 9' keeps none (type has 1, 2)"]);
    render(&["--select", "type == 2 and x > 4"])
        .fails(3, &["the selection 'type == 2 and x > 4' keeps none (type has 1, 2; x has 1, 3, 5)"]);
    render(&["--select", "typ == 1"]).fails(2, &["--select cannot be 'typ == 1'", "did you mean 'type'?"]);
    render(&["--select", "type == 1 and"]).fails(2, &["a number or a name is missing at the end"]);
    render(&["--color", "x * sqr(x)"]).fails(2, &["--color cannot be 'x * sqr(x)'", "did you mean 'sqrt'?"]);
    render(&["--select", "type == 9", "--mode", "medium"])
        .fails(3, &["0 of 3 particles are left — the selection"]);
    render(&["--filter", "type=1", "--eye", "0,0,50", "--look-at", "0,0,90"])
        .fails(3, &["0 of 2 shown of 3 particles are in view"]);
    let streamed =
        "render synthetic:packed?n=1e6 -o a.png --memory 33800000 --size 64x64 --filter x=0:1 --pack 16";
    folder.line(streamed).fails(2, &["do not fit the memory", "--clip is possible"]);
    assert_eq!(folder.names(), ["a.dump"]);
}

#[test]
fn more_than_the_memory_is_refused_before_the_work() {
    let folder = Folder::new();
    let free = std::fs::read_to_string("/proc/meminfo").unwrap_or_default();
    let free = free.lines().find_map(|line| line.strip_prefix("MemAvailable:")?.trim().strip_suffix(" kB"));
    match free.and_then(|free| free.trim().parse::<u64>().ok()) {
        Some(kib) if kib < 90 << 20 => {}
        _ => return println!("skipped: more than 90 GiB are free, or the system does not tell"),
    }
    for more in ["--dry-run", "-q"] {
        let ran = folder.render(&format!("synthetic:uniform?n=4e9 -o a.png {more}"));
        ran.fails(4, &["error[E-memory]", "4,000,000,000 particles needs", "GiB", "are available — "]);
    }
    for (more, hint) in [("", "try --pack 16, "), ("--pack 16", "try --pack 8, "), ("--pack 8", "try fewer ")]
    {
        let ran = folder.render(&format!("synthetic:uniform?n=1e5 -o a.png --memory 1M {more}"));
        ran.fails(4, &["error[E-memory]", hint]);
    }
    folder.line("info synthetic:uniform?n=4e9").fails(4, &["error[E-memory]"]);
    folder.line("bench --n 3.9e9 -q").fails(4, &["error[E-memory]"]);
    folder.render("synthetic:uniform?n=1e12 -o a.png --dry-run").fails(2, &["n cannot be '1000000000000'"]);
}

#[test]
fn hostile_headers_fail_in_little_memory() {
    let folder = Folder::new();
    let huge = 1_u64 << 60;
    let npy = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({huge}, 3), }}");
    let mut npy_bytes = b"\x93NUMPY\x01\x00".to_vec();
    npy_bytes.extend((npy.len() as u16).to_le_bytes());
    npy_bytes.extend(npy.as_bytes());
    let mut bgeo = b"BgeoV\0\0\0\x05".to_vec();
    bgeo.extend([0x7f; 64]);
    let ply = |kind: &str| {
        format!(
            "ply\nformat {kind} 1.0\nelement vertex {huge}\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 3\n"
        )
    };
    let dump = dump("id x y z", 1.0, &["1 0 0 0"]).replace("ATOMS\n1\n", &format!("ATOMS\n{huge}\n"));
    for (name, content) in [
        ("a.xyz", format!("{huge}\ncomment\nO 0 0 0\n").into_bytes()),
        ("a.dump", dump.into_bytes()),
        ("text.ply", ply("ascii").into_bytes()),
        ("binary.ply", ply("binary_little_endian").into_bytes()),
        ("a.npy", npy_bytes),
        ("a.bgeo", bgeo),
    ] {
        folder.file(name, content);
        let ran = folder.line(&format!("info {name}"));
        ran.fails(3, &[name]);
    }
}

#[test]
fn files_that_are_not_there_and_pictures_that_cannot_be() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(3));
    folder.line("info nothing.xyz").fails(3, &["error[E-io]", "nothing.xyz"]);
    // Refused before the reading: the input is not even looked at.
    folder.render("nothing.xyz -o a.tga").fails(2, &["-o cannot be 'a.tga'", "known: .png .jpg .exr"]);
    folder.render("nothing.xyz -o none/a.png").fails(4, &["none/a.png", "create it first"]);
    folder.render("a.xyz -o .").fails(2, &["-o cannot be"]);
    assert_eq!(folder.names(), ["a.xyz"]);
}

#[test]
fn bad_values_are_refused_in_one_line() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(3));
    for (words, parts) in [
        ("--size 800", &["--size cannot be '800'", "WIDTHxHEIGHT"][..]),
        ("--size 0x10", &["--size cannot be '0x10'"]),
        ("--samples 0", &["--samples"]),
        ("--range 3:1", &["--range cannot be '3:1'", "first below"]),
        ("--range a", &["--range cannot be 'a'"]),
        ("--eye 1,2", &["--eye cannot be '1,2'", "X,Y,Z"]),
        ("--fov 180", &["--fov cannot be '180'", "between 0 and 180"]),
        ("--fov 30 --ortho 5", &["--fov", "--ortho"]),
        ("--ortho -5", &["--ortho"]),
        ("--radius -1", &["--radius"]),
        ("--view w", &["--view cannot be 'w'", "known: x y z"]),
        ("--color #12", &["--color cannot be '#12'"]),
        ("--cmap jett", &["--cmap cannot be 'jett'", "did you mean 'jet'"]),
        ("--norm cubic", &["--norm cannot be 'cubic'"]),
        ("--background c_pe", &["--background cannot be 'c_pe'"]),
        ("--bits 12", &["--bits", "8, 16"]),
        ("--frame 1", &["--frame cannot be '1'", "only frame 0"]),
        ("--frames 5:", &["--frames takes no frame"]),
        ("--frames 1:2:0", &["--frames cannot be '1:2:0'"]),
        ("--orbit 90", &["--orbit needs several pictures", "--frame-count"]),
        ("--orbit 90 --frame-count 3", &["-o cannot be 'a.png'", "%04d"]),
        ("--eye 1,1,1 --look-at 1,1,1", &["look-at cannot be"]),
        ("--eye 1,1,9 --look-at 1,1,1 --up 0,0,1", &["up cannot be"]),
        ("--sampels 3", &["--sampels", "--samples"]),
        ("--color c_pe --log --range -1:1", &["a logarithm needs a range above 0"]),
    ] {
        folder.render(&format!("a.xyz -o a.png {words}")).fails(2, parts);
    }
    assert_eq!(folder.names(), ["a.xyz"]);
}

#[test]
fn no_verb_is_explained() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(3));
    folder.line("a.xyz").fails(2, &["no viewer yet", "tyndall render a.xyz -o picture.png"]);
    folder.line("rendr").fails(2, &["'rendr' is neither a verb nor a file", "render"]);
    assert_eq!(folder.run(&[]).code, 2);
}

#[test]
fn quiet_says_errors_only() {
    let folder = Folder::new();
    folder.file("a.csv", "x,y,z,radius\n0,0,0,1\nnan,0,0,1\n");
    assert_eq!(folder.render("a.csv -o a.png -q").fine(), "");
    folder.render("a.csv -o a.png -q --color q").fails(2, &["no attribute 'q'"]);
}

#[test]
fn flags_of_other_programs_name_those_of_this_one() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(5));
    for (flag, parts) in [
        ("--ao", ["there is no --ao", "default look"]),
        ("--vmin 3", ["there is no --vmin", "--range LOW:HIGH"]),
        ("--width=800", ["there is no --width", "--size WIDTHxHEIGHT"]),
        ("--mode emission", ["'emission'", "--mode medium --optics emission"]),
        ("--colour c_pe", ["--colour", "'--color'"]),
    ] {
        folder.render(&format!("a.xyz -o a.png {flag}")).fails(2, &parts);
    }
    let said = folder.render("a.xyz -o a.png --quux");
    assert!(said.err.contains("'--quux'") && !said.err.contains("tip"), "{said:?}");
    let layer = ["render", "a.xyz", "-o", "a.png", "--layer", "a.xyz --palette hot"];
    folder.run(&layer).fails(2, &["--layer", "--cmap NAME"]);
}
