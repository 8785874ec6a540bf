//! Pictures: their names, pixels, and what is written beside them.

use super::{Folder, dump, line_of, png};

#[test]
fn a_picture_is_made_and_every_guess_is_said_once() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(9));
    let said = folder.render("a.xyz -o a.png --color c_pe --device cpu").fine();
    let lines: Vec<&str> = said.lines().collect();
    assert_eq!(lines.len(), 2, "{said}");
    for part in [
        "tyndall: bvh, cpu ",
        "9 particles",
        "van der Waals",
        "color c_pe viridis linear 0.5:8.5",
        "framed on all",
    ] {
        assert!(lines[0].contains(part), "{part} is not in {}", lines[0]);
    }
    assert!(lines[1].starts_with("a.png  ") && lines[1].ends_with(" s"), "{said}");
    assert_eq!(folder.names(), ["a.png", "a.xyz"]);
}

#[test]
fn metadata_say_how_a_picture_came_about() {
    let folder = Folder::new();
    folder.file("in put.xyz", line_of(9));
    let words = [
        "render",
        "in put.xyz",
        "-o",
        "a.png",
        "--size",
        "32x32",
        "--samples",
        "4",
        "--seed",
        "7",
        "-q",
        "--dpi",
        "300",
    ];
    folder.run(&words).fine();
    let texts = png(&folder.path("a.png")).2;
    let text = |key: &str| {
        let found = texts.iter().find(|(name, _)| name == key);
        found.unwrap_or_else(|| panic!("no {key} in {texts:?}")).1.as_str()
    };
    assert!(text("Software").starts_with("Tyndall 0."));
    assert_eq!(
        text("Command"),
        "tyndall render 'in put.xyz' -o a.png --size 32x32 --samples 4 --seed 7 -q --dpi 300"
    );
    assert_eq!(text("Seed"), "7");
    assert!(text("Inputs").starts_with("in put.xyz (") && text("Inputs").contains("bytes, changed 20"));
    assert!(text("Settings").contains("32x32") && text("Guesses").contains("van der Waals"));
    assert!(text("Frame").starts_with("0 of 1"));
    folder.run(&[&["render", "in put.xyz", "-o", "a.exr"], &words[4..]].concat()).fine();
    let exr = std::fs::read(folder.path("a.exr")).unwrap();
    for part in ["Tyndall 0.", "van der Waals", "depth", "in put.xyz ("] {
        assert!(exr.windows(part.len()).any(|window| window == part.as_bytes()), "{part}");
    }
}

#[test]
fn pictures_are_numbered_by_their_frames() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(4).repeat(6));
    folder.render("a.xyz -o all.%03d.png -q").fine();
    folder.render("a.xyz -o some.##.png -q --frames 1:6:2").fine();
    folder.render("a.xyz -o last.$F4.png -q --frame -1").fine();
    folder.render("a.xyz -o one.png -q --frames -2:-1").fine();
    let said = folder.render("a.xyz -o first.png").fine();
    assert!(said.contains("note: frame 0 of 6"), "{said}");
    let all = (0..6).map(|k| format!("all.{k:03}.png")).collect::<Vec<_>>();
    let rest = ["first.png", "last.0005.png", "one.png", "some.01.png", "some.03.png", "some.05.png"];
    let mut wanted: Vec<String> =
        all.into_iter().chain(rest.map(String::from)).chain(["a.xyz".into()]).collect();
    wanted.sort();
    assert_eq!(folder.names(), wanted);
    folder.render("a.xyz -o two.png --frames :2").fails(2, &["-o cannot be 'two.png'", "2 pictures", "%04d"]);
}

#[test]
fn an_orbit_turns_around_one_frame_or_over_all() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(4).repeat(2));
    folder.render("a.xyz -o turn.%d.png -q --frame 0 --orbit 180 --frame-count 3").fine();
    folder.render("a.xyz -o over.%d.png -q --orbit -90").fine();
    let pixels = |name: &str| png(&folder.path(name)).0;
    assert_ne!(pixels("turn.0.png"), pixels("turn.1.png"));
    assert_ne!(pixels("turn.1.png"), pixels("turn.2.png"));
    assert_ne!(pixels("over.0.png"), pixels("over.1.png"));
    assert_eq!(pixels("over.0.png"), pixels("turn.0.png"));
    assert_eq!(folder.names().len(), 6);
}

#[test]
fn a_frame_that_fails_does_not_stop_the_others() {
    let folder = Folder::new();
    let (good, bad) = (line_of(4), line_of(4).replace("2.0 0.25", "oops 0.25"));
    folder.file("a.xyz", &good);
    folder.file("b.xyz", &bad);
    folder.file("c.xyz", &good);
    let ran = folder.render("a.xyz b.xyz c.xyz -o out.%d.png");
    assert_eq!(ran.code, 6, "{ran:?}");
    assert!(ran.err.contains("error[E-partial]: 1 of 3 pictures failed, 2 were written"), "{ran:?}");
    assert!(ran.err.contains("error[E-format]") && ran.err.contains("b.xyz"), "{ran:?}");
    assert_eq!(folder.names(), ["a.xyz", "b.xyz", "c.xyz", "out.0.png", "out.2.png"]);
    assert_eq!(folder.render("b.xyz b.xyz -o out.%d.png").code, 3);
}

#[test]
fn what_is_there_can_be_left() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(4).repeat(3));
    folder.file("o.1.png", "mine");
    let said = folder.render("a.xyz -o o.%d.png --skip-existing").fine();
    assert!(said.contains("note: 1 picture there already"), "{said}");
    assert_eq!(std::fs::read(folder.path("o.1.png")).unwrap(), b"mine");
    let before = std::fs::read(folder.path("o.2.png")).unwrap();
    std::fs::remove_file(folder.path("o.2.png")).unwrap();
    folder.render("a.xyz -o o.%d.png --skip-existing").fine();
    assert_eq!(std::fs::read(folder.path("o.2.png")).unwrap(), before);
}

#[test]
fn a_fixed_range_is_that_of_the_first_frame() {
    let folder = Folder::new();
    let later = line_of(4).replace(".5\n", "9.5\n");
    folder.file("a.xyz", line_of(4) + &later);
    let ranges = |words: &str| -> Vec<String> {
        folder.render(&format!("a.xyz -o o.%d.png -q --color c_pe --range full {words}")).fine();
        let guesses =
            |name: &str| png(&folder.path(name)).2.into_iter().find(|(key, _)| key == "Guesses").unwrap().1;
        let range =
            |name: &str| guesses(name).lines().find(|line| line.starts_with("color")).unwrap().to_string();
        vec![range("o.0.png"), range("o.1.png")]
    };
    let (free, fixed) = (ranges(""), ranges("--fixed-range"));
    assert!(free[0].contains("0.5:3.5") && free[1].contains("9.5:39.5"), "{free:?}");
    assert!(fixed[1].contains("0.5:3.5"), "{fixed:?}");
}

#[test]
fn the_background_can_be_a_color_or_nothing() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(4));
    let corner = |words: &str| {
        folder.render(&format!("a.xyz -o a.png -q {words}")).fine();
        let (pixels, kind, _) = png(&folder.path("a.png"));
        pixels[..kind.samples()].to_vec()
    };
    assert_eq!(corner(""), [255, 255, 255]);
    assert_eq!(corner("--background #123456"), [0x12, 0x34, 0x56]);
    assert_eq!(corner("--background none"), [0, 0, 0, 0]);
    assert_eq!(corner("--alpha"), [0, 0, 0, 0]);
    assert_eq!(corner("--bits 16 --background black"), [0, 0, 0]);
}

#[test]
fn threads_and_structures_do_not_change_a_pixel_but_seeds_do() {
    let folder = Folder::new();
    let pixels = |words: &str| {
        folder.render(&format!("synthetic:uniform?n=3000 -o a.png -q {words}")).fine();
        png(&folder.path("a.png")).0
    };
    let one = pixels("--threads 1");
    assert_eq!(one, pixels("--threads 2"));
    for structure in [
        "brute",
        "pkd",
        "pkd --pkd-axis round-robin",
        "pkd --pkd-order near",
        "treelets",
        "treelets --treelet-size 1000 --treelet-cut middle",
    ] {
        assert_eq!(one, pixels(&format!("--structure {structure}")), "{structure}");
    }
    assert_ne!(one, pixels("--seed 1"));
    for different in
        ["--look headlight", "--look flat", "--view z", "--view -x", "--ortho auto", "--radius-scale 2"]
    {
        assert_ne!(one, pixels(different), "{different}");
    }
    let given = pixels("--eye -3,0.5,0.5 --look-at 0.5,0.5,0.5 --up 0,0,1 --ortho 1.5");
    // The eye stands elsewhere along the same line: but for rounding the picture is the same.
    let differing = |other: &[u8]| given.iter().zip(other).filter(|(a, b)| a != b).count();
    let framed = pixels("--view -x --look-at 0.5,0.5,0.5 --ortho 1.5");
    assert!(1000 * differing(&framed) < given.len(), "{} of {}", differing(&framed), given.len());
    assert!(10 * differing(&one) > given.len(), "another view differs");
}

#[test]
fn what_does_not_fit_the_memory_is_read_in_parts_and_looks_the_same() {
    let folder = Folder::new();
    let rendered = |words: &str| {
        let ran = folder.render(&format!("synthetic:packed?n=1e6 -o a.png {words}"));
        (png(&folder.path("a.png")).0, ran)
    };
    let (whole, told) = rendered("");
    assert!(!told.err.contains("in parts"), "{told:?}");
    // 39 bytes a particle would do for the whole, 38 for parts.
    let (parts, told) = rendered("--memory 38900000");
    assert!(told.err.contains("read in parts"), "{told:?}");
    assert!(whole == parts, "the same picture");
    let render = |words: &str| folder.render(&format!("synthetic:nozzle?n=1e6 -o b.png {words}"));
    render("--memory 10M").fails(4, &["needs", "10.0 MiB are available"]);
    render("--memory 38900000").fails(2, &["--color", "one for all"]);
    render("--memory many").fails(2, &["--memory", "16G"]);

    // What is dropped is told in parts as well.
    let mut header = "{'descr': '<f4', 'fortran_order': False, 'shape': (1000000, 3), }".to_string();
    header += &" ".repeat(117 - header.len());
    let mut array = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    array.extend(header.bytes().chain([b'\n']));
    let row = |k: u32| [if k == 999_999 { f32::NAN } else { k as f32 }, (k % 1000) as f32, (k % 77) as f32];
    array.extend((0..1_000_000).flat_map(row).flat_map(f32::to_le_bytes));
    folder.file("a.npy", array);
    let render =
        |words: &str| folder.render(&format!("a.npy --radius 500 -o c.png --memory 38900000 {words}"));
    let told = render("");
    assert_eq!(told.code, 0, "{told:?}");
    assert!(told.err.contains("dropped 1 of 1,000,000 particles (NaN positions)"), "{told:?}");
    render("--on-bad error").fails(3, &["cannot draw 1 of 1,000,000 particles"]);
}

#[test]
fn a_dry_run_tells_the_cost_and_writes_nothing() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(50).repeat(3));
    for input in ["a.xyz", "synthetic:nozzle"] {
        let ran = folder.render(&format!("{input} -o a.%d.png --dry-run"));
        assert_eq!(ran.code, 0, "{ran:?}");
        assert!(
            ran.out.contains("memory ") && ran.out.contains("iB") && ran.out.contains("about "),
            "{ran:?}"
        );
    }
    assert_eq!(folder.names(), ["a.xyz"]);
}

#[test]
fn completions_and_manual_know_every_flag() {
    let folder = Folder::new();
    for words in ["completions bash", "completions zsh", "completions fish", "man render"] {
        let ran = folder.line(words);
        assert_eq!(ran.code, 0, "{ran:?}");
        for flag in ["radius-scale", "skip-existing", "pkd-order"] {
            let found = ran.out.contains(flag) || ran.out.contains(&flag.replace('-', "\\-"));
            assert!(found, "{words} does not know {flag}");
        }
    }
    assert!(folder.line("man").out.contains("tyndall"));
    assert!(folder.line("--version").out.starts_with("tyndall 0."));
    assert!(folder.line("render --help").out.contains("--samples"));
}

#[test]
fn culling_by_confidence_is_told_and_can_be_told_to_cull_nothing() {
    let folder = Folder::new();
    let knobs = "--culling confidence --vc 16 --ks 3 --di yes";
    let said = folder.render(&format!("synthetic:packed?n=3e4 -o a.png {knobs} --c-occ 2")).fine();
    assert!(
        said.contains("culling by confidence (vc 16, C_occ 2, ci 128, spp 4, dq yes, di yes, ks 3"),
        "{said}"
    );
    let (pixels, _, texts) = png(&folder.path("a.png"));
    assert!(texts.iter().any(|(key, text)| key == "Settings" && text.contains("lossy")), "{texts:?}");
    folder.render("synthetic:packed?n=3e4 -o b.png --culling off").fine();
    assert_eq!(pixels, png(&folder.path("b.png")).0);
    let bad = |knob: &str, parts: &[&str]| {
        folder
            .render(&format!("synthetic:packed?n=500 -o a.png --culling confidence {knob}"))
            .fails(2, parts);
    };
    bad("--ks 4", &["kernel-size", "'4'", "odd"]);
    bad("--spp 3", &["frame-samples", "'3'", "1, 4 or 16"]);
    bad("--vc 5000", &["voxel-count", "'5000'", "1 to 4096"]);
}

#[test]
fn a_bench_prints_a_table() {
    let folder = Folder::new();
    let ran = folder.line("bench --n 500 --size 40x30 --sets packed -q --structure pkd");
    assert_eq!(ran.code, 0, "{ran:?}");
    assert_eq!(ran.out.lines().filter(|line| line.starts_with("| packed")).count(), 2, "{ran:?}");
    assert!(ran.out.contains("Msamples/s") && ran.err.is_empty(), "{ran:?}");
}

#[test]
fn packing_is_told_with_its_error() {
    let folder = Folder::new();
    let said = folder.render("synthetic:packed?n=3e4 -o a.png --pack 11 -v").fine();
    for part in [
        "bvh packed 11 bits",
        "packed: centers off by at most ",
        " of a radius), g(r) by ",
        "packing: x, y, z",
    ] {
        assert_eq!(said.matches(part).count(), 1, "{part} in {said}");
    }
    let texts = png(&folder.path("a.png")).2;
    assert!(
        texts.iter().any(|(key, text)| key == "Guesses" && text.contains("packed: centers off by at most "))
    );
    let said = folder.render("synthetic:packed?n=3e4 -o b.png --pack exact").fine();
    assert!(!said.contains("packed:"), "{said}");
    folder.render("a.xyz -o a.png --pack 16 --structure pkd").fails(2, &["--pack is for --structure bvh"]);
    folder.render("a.xyz -o a.png --treelet-size 15").fails(2, &["--treelet-size", "16"]);
    folder.render("a.xyz -o a.png --pack 12").fails(2, &["--pack", "12", "exact, 16, 11, 8"]);
}

#[test]
fn what_is_not_shown_is_as_if_it_were_not_there() {
    let folder = Folder::new();
    let all = line_of(9);
    folder.file("all.xyz", &all);
    let rows: Vec<&str> = all.lines().collect();
    folder.file("some.xyz", format!("3\n{}\n{}\n", rows[1], rows[4..7].join("\n")));
    let camera = "--eye 4,-30,9 --look-at 4,0,0 --radius 0.7 --color orange";
    folder.render(&format!("some.xyz -o some.png {camera}")).fine();
    let expected = png(&folder.path("some.png")).0;
    for (name, selection) in [
        ("a.png", &["--filter", "c_pe=2.5:4.5"][..]),
        ("b.png", &["--filter", "c_pe=2:", "--filter", "x=:4", "--structure", "pkd"]),
        ("c.png", &["--clip", "x<4", "--slice", "x > 2"]),
        ("f.png", &["--select", "element == Cu and 2 <= c_pe < 5"]),
        ("g.png", &["--select", "x > 1", "--select", "index 0:4", "--structure", "pkd"]),
        ("d.png", &["--clip", "box 1.9,-1,-1 4.1,1,1", "--filter", "element=Cu"]),
        ("e.png", &["--clip", "x<0.5L", "--filter", "x=2:", "--pack", "16"]),
    ] {
        let line = format!("render --size 48x32 --samples 4 all.xyz -o {name} {camera}");
        let words: Vec<&str> = line.split_whitespace().chain(selection.iter().copied()).collect();
        let said = folder.run(&words).fine();
        assert!(said.contains("shown: 3 of 9 particles ("), "{said}");
        let (pixels, _, texts) = png(&folder.path(name));
        assert!(pixels == expected, "{selection:?}");
        assert!(texts.iter().any(|(key, text)| key == "Guesses" && text.contains("shown: 3 of 9")));
    }
    folder.render(&format!("all.xyz -o all.png {camera}")).fine();
    assert!(png(&folder.path("all.png")).0 != expected, "the others can be seen");
    // A medium of the same.
    let medium = "--mode medium --grid 24 --smoothing uniform --h0 1.2 --eye 4,-30,9 --look-at 4,0,0";
    folder.render(&format!("some.xyz -o thin.png {medium}")).fine();
    let said = folder.render(&format!("all.xyz -o kept.png {medium} --select c_pe>=2 --clip x<4")).fine();
    assert!(said.contains("kept: 3 of 9 particles (c_pe>=2; x<4)"), "{said}");
    assert!(png(&folder.path("kept.png")).0 == png(&folder.path("thin.png")).0, "the others add nothing");
}

#[test]
fn files_are_named_by_patterns() {
    let folder = Folder::new();
    for number in [8, 9, 10, 101] {
        folder.file(&format!("run.{number:04}.xyz"), line_of(number % 7 + 1));
    }
    folder.file("run.x.xyz", line_of(2));
    let look = ["--size", "24x16", "--samples", "1", "--look", "flat"];
    let run = |words: &[&str]| folder.run(&[&["render"], words, &look].concat());
    let made = |words: &[&str]| {
        run(words).fine();
        let mut names = folder.names();
        names.retain(|name| name.ends_with(".png"));
        names.iter().for_each(|name| std::fs::remove_file(folder.path(name)).unwrap());
        names
    };
    for pattern in ["run.####.xyz", "run.%04d.xyz", "run.$F4.xyz"] {
        // Pictures are called by the numbers of the files.
        assert_eq!(made(&[pattern, "-o", "a.%d.png", "--frames", "9:101"]), ["a.10.png", "a.9.png"]);
    }
    let [one, all] = [&["--frame", "101"][..], &[][..]];
    assert_eq!(
        made(&[&["run.####.xyz", "-o", "a.##.png"], all].concat()),
        ["a.08.png", "a.09.png", "a.10.png", "a.101.png"]
    );
    assert_eq!(made(&[&["run.####.xyz", "-o", "a.png"], one].concat()), ["a.png"]);
    // Others are frames from 0, in the order of the numbers in their names.
    assert_eq!(made(&["run.0*.xyz", "-o", "a.%d.png"]), ["a.0.png", "a.1.png", "a.2.png", "a.3.png"]);
    let told = folder.run(&["info", "run.[01]*.xyz"]).out;
    assert!(told.contains("4 frames in 4 files"), "{told}");
    run(&["run.####.xyz", "-o", "a.png", "--frame", "50"])
        .fails(2, &["no file has this number; they are from 8 to 101"]);
    run(&["ran.####.xyz", "-o", "a.png"]).fails(3, &["ran.####.xyz", "no file has such a name"]);
    run(&["ran.*", "-o", "a.png"]).fails(3, &["no file has such a name"]);
}

#[test]
fn frames_in_pieces_are_put_together() {
    let folder = Folder::new();
    let rows: Vec<String> = (0..9).map(|id| format!("{id} {}.5 {} 0.25", id % 4, id % 3)).collect();
    let rows: Vec<&str> = rows.iter().map(String::as_str).collect();
    let at = |step: usize, rows: &[&str]| {
        dump("id x y z", 8.0, rows).replace("TIMESTEP\n100\n", &format!("TIMESTEP\n{step}\n"))
    };
    for step in [5, 10, 200] {
        for (place, rows) in [&rows[..4], &rows[4..]].into_iter().enumerate() {
            folder.file(&format!("run.{step}.{place}.dump"), at(step, rows));
        }
        folder.file(&format!("whole.{step}.dump"), at(step, &rows));
    }
    let told = folder.run(&["info", "run.5.%.dump"]).out;
    assert!(told.contains("LAMMPS dump, 2 pieces (text) · 1 frame in 2 files · 9 particles"), "{told}");
    let told = folder.run(&["info", "run.*.%.dump", "--frame", "2"]).out;
    assert!(told.contains("3 frames in 6 files") && told.contains("time 200 (step)"), "{told}");
    // Numbers of steps stay those of frames.
    folder.run(&["convert", "run.$F.%.dump", "-o", "a.%d.xyz", "--frames", "10:"]).fine();
    for step in [10, 200] {
        folder.run(&["convert", &format!("whole.{step}.dump"), "-o", &format!("b.{step}.xyz")]).fine();
        let text = |name: &str| std::fs::read_to_string(folder.path(&format!("{name}.{step}.xyz"))).unwrap();
        assert_eq!(text("a"), text("b"));
    }
    for (from, to) in [("run.5.%.dump", "a.png"), ("whole.5.dump", "b.png")] {
        folder.run(&["render", from, "-o", to, "--size", "24x16", "--samples", "1", "--look", "flat"]).fine();
    }
    assert!(png(&folder.path("a.png")).0 == png(&folder.path("b.png")).0);
    assert!(folder.run(&["build", "run.5.%.dump", "-o", "a.tyn"]).fine().contains("9 particles"));
    folder
        .run(&["convert", "run.5.%.dump", "-o", "run.5.1.dump"])
        .fails(2, &["another file: this one is being read"]);
    std::fs::remove_file(folder.path("run.10.0.dump")).unwrap();
    folder.run(&["info", "run.*.%.dump"]).fails(3, &["run.10.0.dump", "this piece is missing"]);
    folder.run(&["info", "ran.%"]).fails(3, &["ran.%", "no file has such a name"]);
}

#[test]
fn cameras_are_pictures_or_a_way() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(5).repeat(3));
    let run = |words: &[&str]| {
        folder.run(
            &[&["render", "a.xyz", "--size", "32x24", "--samples", "1", "--look", "flat", "-q"], words]
                .concat(),
        )
    };
    let pixels = |name: &str| png(&folder.path(name)).0;
    run(&["-o", "front.png", "--eye", "2,-20,3", "--look-at", "2,0,0", "--ortho", "8"]).fine();
    run(&["-o", "top.png", "--eye", "3,0,30", "--look-at", "3,0,0", "--up", "0,1,0", "--ortho", "6"]).fine();
    let front = "eye=2,-20,3 look-at=2,0,0 ortho=8";
    let top = "eye=3,0,30 look-at=3,0,0 up=0,1,0 ortho=6";
    // Many cameras, one reading.
    run(&["-o", "c.%d.png", "--frame", "0", "--camera", front, "--camera", top]).fine();
    assert!(pixels("c.0.png") == pixels("front.png") && pixels("c.1.png") == pixels("top.png"));
    assert!(pixels("front.png") != pixels("top.png"));
    // A way from one to the other, through one frame and with all of them.
    let [from, to] = [format!("at=0 {front}"), format!("at=2 move=straight {top}")];
    let way = ["--camera", &from, "--camera", &to];
    run(&[&["-o", "w.%d.png", "--frame", "0"], &way[..]].concat()).fine();
    run(&[&["-o", "v.%d.png"], &way[..]].concat()).fine();
    for name in ["w", "v"] {
        assert!(pixels(&format!("{name}.0.png")) == pixels("front.png"));
        assert!(pixels(&format!("{name}.2.png")) == pixels("top.png"));
        assert!(![pixels("front.png"), pixels("top.png")].contains(&pixels(&format!("{name}.1.png"))));
    }
    // The same in a scene file.
    let scene = "[particles]\nfiles = ['a.xyz']\n[[camera]]\nat = 0\neye = [2, -20, 3]\nlook-at = [2, 0, 0]\northo = 8\n\
                 [[camera]]\nat = 2\neye = [3, 0, 30]\nlook-at = [3, 0, 0]\nup = [0, 1, 0]\northo = 6\n";
    folder.file("scene.toml", scene);
    folder
        .render("scene.toml -o s.%d.png --size 32x24 --samples 1 --look flat --frame 0 --frame-count 3 -q")
        .fine();
    assert!(pixels("s.0.png") == pixels("front.png") && pixels("s.2.png") == pixels("top.png"));
    run(&["-o", "x.png", "--camera", front, "--camera", top])
        .fails(2, &["2 pictures need a number in the name"]);
    run(&["-o", "x.%d.png", "--camera", front, "--camera", top])
        .fails(2, &["several --camera are pictures of one frame"]);
    run(&["-o", "x.png", "--camera", "eye=1,2"]).fails(2, &["'1,2' is no point X,Y,Z"]);
    run(&["-o", "x.png", "--camera", &to, "--camera", &from]).fails(2, &["later than the one before it"]);
    run(&["-o", "x.%d.png", "--frame-count", "3"]).fails(2, &["--frame-count is for a camera that moves"]);
}

#[test]
fn all_frames_become_a_movie() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(4).repeat(5));
    let said = folder.render("a.xyz -o all.gif --samples 1 --fps 10").fine();
    assert!(
        said.contains("all.gif  picture 5") && said.contains("all.gif  5 pictures, 10 a second"),
        "{said}"
    );
    let said = folder.render("a.xyz -o all.mp4 --samples 1 --size 33x20 --encoder built-in").fine();
    assert!(said.contains("34x20") && said.contains("encoder built in"), "{said}");
    folder.render("a.xyz -o turn.webp --alpha --samples 1 --frame 2 --orbit 360 --frame-count 3 -q").fine();
    assert_eq!(folder.names(), ["a.xyz", "all.gif", "all.mp4", "turn.webp"]);
    let bytes = std::fs::read(folder.path("all.mp4")).unwrap();
    let text = String::from_utf8_lossy(&bytes);
    assert!(text.contains("Command: tyndall render --size 48x32") && !text.contains("Frame: "));
    // What is there is left.
    let said = folder.render("a.xyz -o all.gif --skip-existing").fine();
    assert!(said.contains("5 pictures there already"), "{said}");
}

#[test]
fn movies_that_cannot_be_are_refused_before_the_reading() {
    let folder = Folder::new();
    for (words, text) in [
        ("none.xyz -o a.%04d.mp4", "a movie is one file"),
        ("none.xyz -o a.mp4 --alpha", "no transparency"),
        ("none.xyz -o a.gif --fps 60", "at most 50"),
        ("none.xyz -o a.mp4 --fps -3", "--fps"),
        ("none.xyz -o a.mp4 --size 16384x16384", "no level of H.264"),
    ] {
        folder.render(words).fails(2, &[text]);
    }
    assert!(folder.names().is_empty());
}

#[test]
fn a_radius_is_a_number_an_attribute_or_an_expression() {
    let folder = Folder::new();
    folder.file("a.csv", "x,y,z,size,kind\n0,0,0,2,1\n4,0,0,1,2\n0,4,0,-1,2\n0,0,4,nan,1\n");
    // The same radii by the name that is known.
    folder.file("b.csv", "x,y,z,radius,kind\n0,0,0,1,1\n4,0,0,0.5,2\n");
    let view = "--eye 20,15,10 --look-at 1,1,1 --color kind --look flat --samples 4";
    let expected = folder.render(&format!("b.csv -o b.png {view}")).fine();
    assert!(expected.contains("radius radius"), "{expected}");
    let said = folder.render(&format!("a.csv -o a.png {view} --radius size/2")).fine();
    let warning =
        "warning: dropped 2 of 4 particles without a radius of 0 or more by size/2; --on-bad error to stop";
    assert!(
        said.contains(warning) && said.contains("2 particles") && said.contains("radius size/2"),
        "{said}"
    );
    assert!(png(&folder.path("a.png")).0 == png(&folder.path("b.png")).0);
    // In layers, saved, and with a scale.
    folder.line("build a.csv -o a.tyn --radius size/2 --fields kind").fine();
    for words in ["a.tyn", "a.csv --radius size --radius-scale 0.5", "a.csv --radius size/2 --layer b.csv"] {
        folder.render(&format!("{words} -o c.png {view}")).fine();
        assert!(png(&folder.path("c.png")).0 == png(&folder.path("b.png")).0, "{words}");
    }
    let said = folder.render(&format!("a.tyn -o c.png {view} --radius if(kind==1,0.5,0.25)")).fine();
    assert!(said.contains("not used: radius if(kind==1,0.5,0.25) is asked for"), "{said}");
    folder
        .render("a.csv -o d.png --radius size --on-bad error")
        .fails(2, &["2 of 4 particles", "--on-bad drop"]);
    folder.render("a.csv -o d.png --radius siz").fails(2, &["--radius", "did you mean 'size'"]);
    folder.render("a.csv -o d.png --radius 0").fails(2, &["--radius", "greater than 0"]);
}

#[test]
fn up_is_an_axis_or_a_direction() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(5));
    let pixels = |flags: &str| {
        folder.render(&format!("a.xyz -o a.png --look flat --samples 1 {flags}")).fine();
        png(&folder.path("a.png")).0
    };
    assert!(pixels("--up y") == pixels("--up 0,1,0") && pixels("--up -x") == pixels("--up -2,0,0"));
    assert!(pixels("--camera up=y") == pixels("--camera up=0,1,0") && pixels("") == pixels("--up z"));
    assert!(pixels("--up y") != pixels("--up z"));
    folder.render("a.xyz -o b.png --up w").fails(2, &["--up", "an axis such as z or -y"]);
}

#[test]
fn a_sequence_is_framed_on_its_first_frame_or_on_all() {
    let folder = Folder::new();
    let frame = |scale: f64| {
        let row = |k: u32| {
            let [x, y, z] = [k & 1, k >> 1 & 1, k >> 2].map(|bit| scale * (2.0 * f64::from(bit) - 1.0));
            format!("H {x} {y} {z} {}\n", scale * f64::from(k))
        };
        let rows: String = (0..8).map(row).collect();
        format!("8\nProperties=species:S:1:pos:R:3:q:R:1\n{rows}")
    };
    let frames: Vec<String> = [1.0, 2.0, 5.0].map(frame).to_vec();
    folder.file("a.xyz", frames.concat());
    folder.file("last.xyz", &frames[2]);
    let view = "--radius 0.5 --color q --look flat --samples 4";
    let warning = "warning: later frames reach out of the picture, which is framed on the first one (--frame-sequence to see all)";
    let said = folder.render(&format!("a.xyz -o a.%d.png {view}")).err;
    assert_eq!(said.matches(warning).count(), 1, "{said}");
    for quiet in
        ["--frame-shown --select index<1", "--eye 40,0,0", "--look-at 1,0,0", "--ortho 2", "--frames 0"]
    {
        let said = folder.render(&format!("a.xyz -o quiet.%d.png {view} {quiet}")).err;
        assert!(!said.contains("reach out"), "{said}");
    }
    // What is largest comes last, so that the frame of all is that of the last, whichever frames are asked for.
    folder.render(&format!("last.xyz -o last.png {view} --frame-all")).fine();
    let last = png(&folder.path("last.png")).0;
    let mut whole = Vec::new();
    for frames in ["", "--frames 2:", "--frame-shown", "--structure pkd"] {
        let line = format!("a.xyz -o b.%d.png {view} --frame-sequence --range 0:35 {frames}");
        let said = folder.render(&line).fine();
        assert!(said.contains("framed on the whole sequence"), "{said}");
        whole.push(png(&folder.path("b.2.png")).0);
    }
    assert!(whole.iter().all(|it| *it == whole[0]), "the runs agree");
    let said = folder.render(&format!("a.xyz -o b.%d.png {view} --frame-sequence --fixed-range")).fine();
    assert!(said.contains("(of the whole sequence)"), "{said}");
    let found = png(&folder.path("b.2.png")).0;
    assert_eq!(found.len(), last.len());
    let other =
        found.chunks(3).zip(last.chunks(3)).filter(|(a, b)| (*a == [255; 3]) != (*b == [255; 3])).count();
    assert!(other < last.len() / 3 / 100, "{other} pixels are framed otherwise");

    for mode in ["medium --grid 16", "project"] {
        let line = format!("a.xyz -o c.%d.png --mode {mode} --size 32x24");
        assert!(folder.render(&line).err.contains(warning), "{mode}");
        let said = folder.render(&format!("{line} --frame-sequence")).fine();
        assert!(said.contains("framed on the whole sequence") && !said.contains("reach out"), "{said}");
    }
}
