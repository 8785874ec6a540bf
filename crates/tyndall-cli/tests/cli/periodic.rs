//! Periodic boxes: particles put elsewhere, and images without copies.

use super::{Folder, dump, png};

/// Three particles in a cell of edge 4, and the same copied so often along each edge.
fn rows([x, y, z]: [u32; 3]) -> Vec<String> {
    let mut rows = Vec::new();
    for image in 0..x * y * z {
        let shift = [image % x, image / x % y, image / x / y].map(|it| 4.0 * f64::from(it));
        for (kind, place) in [(1, [0.5, 1.0, 1.5]), (2, [2.0, 2.5, 0.5]), (3, [3.5, 0.25, 3.0])] {
            let [x, y, z] = [0, 1, 2].map(|axis| place[axis] + shift[axis]);
            rows.push(format!("{} {kind} {x} {y} {z}", rows.len() + 1));
        }
    }
    rows
}

fn file(images: [u32; 3], cell: f64) -> String {
    let rows = rows(images);
    dump("id type x y z", cell, &rows.iter().map(String::as_str).collect::<Vec<_>>())
}

#[test]
fn images_look_like_copies() {
    let folder = Folder::new();
    folder.file("one.dump", file([1; 3], 4.0));
    folder.file("copied.dump", file([3, 2, 2], 12.0));
    folder.file("doubled.dump", file([2; 3], 8.0));
    let view =
        "--radius 0.75 --color type --look headlight --eye 30,-20,25 --look-at 5,4,4 --filter type=1,3";
    folder.render(&format!("copied.dump -o copied.png {view}")).fine();
    let expected = png(&folder.path("copied.png")).0;
    folder.line("build one.dump -o one.tyn --radius 0.75").fine();
    for words in [
        "one.dump",
        "one.dump --structure pkd",
        "one.dump --structure treelets",
        "one.tyn",
        "one.dump --culling off",
    ] {
        let told = folder.render(&format!("{words} -o images.png {view} --replicate 3,2,2")).fine();
        assert!(told.contains("3 particles · in 3×2×2 periodic images"), "{told}");
        assert!(!told.contains("not used"), "{told}");
        let (pixels, _, texts) = png(&folder.path("images.png"));
        assert!(pixels == expected, "{words}");
        assert!(texts.iter().any(|(key, text)| key == "Guesses" && text.contains("3×2×2 periodic images")));
        assert!(texts.iter().any(|(key, text)| key == "Command" && text.contains("--replicate 3,2,2")));
    }
    folder.render(&format!("one.dump -o one.png {view} --replicate 1")).fine();
    assert!(png(&folder.path("one.png")).0 != expected, "one image is not all");
    // The camera frames all images: the same as that of copies in a cell of their size.
    let automatic = "--radius 0.75 --color type --look headlight --frame-all";
    folder.render(&format!("doubled.dump -o doubled.png {automatic}")).fine();
    folder.render(&format!("one.dump -o images.png {automatic} --replicate 2")).fine();
    let [copied, images] = ["doubled.png", "images.png"].map(|name| png(&folder.path(name)).0);
    let differing = copied.iter().zip(&images).filter(|(a, b)| a.abs_diff(**b) > 8).count();
    assert!(differing * 50 < copied.len(), "{differing} of {}", copied.len());
}

#[test]
fn images_that_cannot_be_are_refused() {
    let folder = Folder::new();
    folder.file("one.dump", file([1; 3], 4.0));
    folder.file("slab.dump", file([1; 3], 4.0).replace("pp pp pp", "pp pp ff"));
    folder.file("points.csv", "x,y,z\n0,0,0\n1,1,1\n");
    for (words, parts) in [
        ("points.csv --replicate 2", ["--replicate cannot be '2,2,2'", "this one has none"]),
        ("slab.dump --replicate 2", ["--replicate", "1 along the third edge"]),
        ("one.dump --replicate 2 --device gpu", ["--device cannot be 'gpu'", "auto or cpu with --replicate"]),
        (
            "one.dump --replicate 2 --culling confidence",
            ["--culling cannot be 'confidence'", "off or certified"],
        ),
        ("one.dump --replicate 2000", ["--replicate", "at most 1,048,576"]),
    ] {
        folder.render(&format!("{words} -o a.png")).fails(2, &parts);
    }
    for words in ["one.dump --replicate 0 -o a.png", "one.dump --replicate 2 --mode medium -o a.png"] {
        assert_eq!(folder.render(words).code, 2, "{words}");
    }
    assert!(!folder.path("a.png").exists());
    folder.render("slab.dump --replicate 2,2,1 -o a.png").fine();
}

#[test]
fn particles_are_folded_made_whole_and_unfolded() {
    let folder = Folder::new();
    let rows = ["1 7 4.5 1 1 0 0 0", "2 7 3.5 1 1 0 0 0", "3 8 1 -0.5 1 0 2 0"];
    folder.file("a.dump", dump("id mol x y z ix iy iz", 4.0, &rows));
    let table = |words: &str| {
        let said = folder.line(&format!("convert a.dump -o out.csv {words}")).fine();
        let text = std::fs::read_to_string(folder.path("out.csv")).unwrap();
        (said, text.lines().skip(1).map(str::to_string).collect::<Vec<_>>())
    };
    let (_, stored) = table("");
    assert_eq!(stored, ["4.5,1,1,1,7,0,0,0", "3.5,1,1,2,7,0,0,0", "1,-0.5,1,3,8,0,2,0"]);
    let (said, atoms) = table("--wrap atoms");
    assert!(said.contains("in the cell: 2 of 3 moved"), "{said}");
    assert_eq!(atoms, ["0.5,1,1,1,7,1,0,0", "3.5,1,1,2,7,0,0,0", "1,3.5,1,3,8,0,1,0"]);
    let (said, molecules) = table("--wrap molecules");
    assert!(said.contains("molecules by mol, whole, in the cell: "), "{said}");
    assert_eq!(molecules, ["0.5,1,1,1,7,1,0,0", "-0.5,1,1,2,7,1,0,0", "1,3.5,1,3,8,0,1,0"]);
    let (_, unfolded) = table("--unwrap");
    assert_eq!(unfolded, ["4.5,1,1,1,7,0,0,0", "3.5,1,1,2,7,0,0,0", "1,7.5,1,3,8,0,0,0"]);

    let info = folder.line("info a.dump --wrap atoms").out;
    assert!(
        info.contains("bounds x 0.5..3.5") && info.contains("positions in the cell: 2 of 3 moved"),
        "{info}"
    );
    let json = folder.line("info a.dump --unwrap --json").out;
    assert!(json.contains("\"unwrapped by ix iy iz: 1 of 3 moved\""), "{json}");
    folder.line("build a.dump -o a.tyn --wrap atoms").fine();
    assert!(folder.line("info a.tyn").out.contains("bounds x 0.5..3.5"));
    // The structure that was saved has particles elsewhere.
    folder.line("build a.dump -o b.tyn").fine();
    let view = "--radius 0.5 --view z --color mol --frame-all";
    let picture = |words: &str| {
        let told = folder.render(&format!("{words} -o p.png {view}")).fine();
        (told, png(&folder.path("p.png")).0)
    };
    let (told, wrapped) = picture("b.tyn --wrap atoms");
    assert!(told.contains("is not used: its particles are to be elsewhere"), "{told}");
    assert!(wrapped == picture("a.dump --wrap atoms").1 && wrapped == picture("a.tyn --wrap none").1);
    assert!(wrapped != picture("a.dump").1);
}

#[test]
fn boxes_that_say_too_little_are_refused_with_a_way_out() {
    let folder = Folder::new();
    folder.file("points.csv", "x,y,z\n0,0,0\n1,1,1\n");
    folder.file("one.dump", file([1; 3], 4.0));
    for (words, parts) in [
        ("info points.csv --wrap atoms", ["--wrap cannot be 'atoms'", "it has no cell"]),
        ("convert points.csv -o a.xyz --unwrap", ["--unwrap", "it has no cell"]),
        ("info one.dump --unwrap", ["--unwrap", "no image flags ix iy iz — --wrap molecules"]),
        (
            "build one.dump -o a.tyn --wrap molecules",
            ["--wrap cannot be 'molecules'", "neither molecules (mol), residues (resid) nor bonds"],
        ),
    ] {
        folder.line(words).fails(2, &parts);
    }
    assert_eq!(folder.line("info one.dump --unwrap --wrap atoms").code, 2);
}

#[test]
fn a_center_is_the_zero_of_what_stands_around_it() {
    let folder = Folder::new();
    folder.file("a.dump", file([1; 3], 4.0));
    // Three in the middle of nothing, and the same in the middle of their box.
    let centered = ["1 1 -1.5 0 -1.5", "2 2 0 1.5 1.5", "3 3 1.5 -0.75 0"];
    folder.file("b.dump", dump("id type x y z", 4.0, &centered));
    let view = "--radius 0.5 --color type --look headlight --ortho 5 --size 64x48 --samples 4";
    let told = folder.render(&format!("a.dump -o a.png {view} --center 2,1,3")).fine();
    assert!(told.contains("measured from 2,1,3, in the cell: 1 of 3 moved"), "{told}");
    folder.render(&format!("b.dump -o b.png {view} --look-at 0,0,0 --frame-all")).fine();
    let [a, b] = ["a.png", "b.png"].map(|name| png(&folder.path(name)).0);
    assert!(a == b, "the camera looks at the center");

    folder.line("convert a.dump -o c.xyz --center 2,1,3").fine();
    let text = std::fs::read_to_string(folder.path("c.xyz")).unwrap();
    let rows: Vec<Vec<f64>> = text
        .lines()
        .skip(2)
        .map(|row| row.split_whitespace().filter_map(|it| it.parse().ok()).collect())
        .collect();
    for (row, expected) in rows.iter().zip([[-1.5, 0.0, -1.5], [0.0, 1.5, 1.5], [1.5, -0.75, 0.0]]) {
        assert!(expected.iter().all(|it| row.contains(it)), "{row:?}");
    }
    let told = folder.line("info a.dump --center type==2").out;
    assert!(told.contains("positions measured from 2,2.5,0.5, the middle of 1 with type==2"), "{told}");
    let told = folder.line("info a.dump --center densest").out;
    assert!(told.contains("the densest place"), "{told}");

    folder.render("a.dump -o d.png --center type==9").fails(2, &["--center", "type has 1, 2, 3"]);
    folder.render("a.dump -o d.png --center 1,2").fails(2, &["--center", "X,Y,Z, densest"]);
    folder.render("a.dump -o d.png --center 0,0,0 --mesh a.stl").fails(2, &["--center", "--mesh"]);
    folder.render("a.dump -o d.png --center 0,0,0 --layer b.dump").fails(2, &["--center", "--layer"]);
    let layer = ["render", "a.dump", "-o", "d.png", "--layer", "b.dump --center 0,0,0"];
    folder.run(&layer).fails(2, &["--center is of the whole picture"]);
}
