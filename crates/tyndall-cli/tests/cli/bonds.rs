//! Bonds: of files and by distance, in pictures, in words, and refused where they cannot be.

use super::{Folder, dump, png};

/// Two molecules of two atoms in a cell of edge 8; the second lies across a face.
const DATA: &str = "made up\n\n4 atoms\n2 bonds\n1 atom types\n\n0 8 xlo xhi\n0 8 ylo yhi\n0 8 zlo zhi\n\nMasses\n\n1 12.011\n\n\
    Atoms # bond\n\n1 1 1 2 4 4\n2 1 1 4 4 4\n3 2 1 7.5 4 6\n4 2 1 0.5 4 6\n\nBonds\n\n1 1 1 2\n2 1 3 4\n";
const VIEW: &str = "--eye 4,-30,5 --look-at 4,4,5 --up 0,0,1 --ortho 10 --radius 0.2 --look flat --color mol --background white";

/// The columns of a picture of 48 x 32 pixels whose pixels in these rows are not white.
fn drawn(folder: &Folder, name: &str, rows: std::ops::Range<usize>) -> Vec<usize> {
    let (pixels, kind, _) = png(&folder.path(name));
    let size = kind.samples();
    let is_drawn = |x: usize, y: usize| pixels[(y * 48 + x) * size..][..3].iter().any(|it| *it < 250);
    (0..48).filter(|&x| rows.clone().any(|y| is_drawn(x, y))).collect()
}

#[test]
fn bonds_of_the_file_join_and_never_stretch_over_the_cell() {
    let folder = Folder::new();
    folder.file("a.data", DATA);
    assert!(folder.line("info a.data").out.contains("\nbonds 2\n"));
    assert!(folder.line("info a.data --json").out.contains("\"bonds\": 2"));
    folder.render(&format!("a.data -o without.png {VIEW}")).fine();
    let said = folder.render(&format!("a.data -o with.png {VIEW} --bonds --bond-radius 0.3")).fine();
    assert!(said.contains("2 bonds of the file, radius 0.3"), "{said}");
    let (_, _, texts) = png(&folder.path("with.png"));
    assert!(texts.iter().any(|(key, text)| key == "Guesses" && text.contains("2 bonds of the file")));
    // Height 10 in 32 rows, so 3.2 pixels a unit: z = 4 in row 19, z = 6 in row 13; x = 2, 4 in columns 17, 24.
    let middle =
        |name: &str| drawn(&folder, name, 18..21).into_iter().filter(|x| (19..=21).contains(x)).count();
    assert_eq!((middle("without.png"), middle("with.png")), (0, 3));
    // Across the face two stubs reach out, and nothing lies between x = 1.5 and x = 6.5.
    let upper = drawn(&folder, "with.png", 12..15);
    assert!(!upper.iter().any(|x| (17..=31).contains(x)), "{upper:?}");
    assert!(upper.len() > drawn(&folder, "without.png", 12..15).len(), "{upper:?}");

    // By distance the same bonds; so with images, in which the stubs meet.
    let said = folder.render(&format!("a.data -o same.png {VIEW} --bonds 2.1 --bond-radius 0.3")).fine();
    assert!(said.contains("2 bonds by distances up to 2.1"), "{said}");
    assert!(png(&folder.path("same.png")).0 == png(&folder.path("with.png")).0);
    for structure in ["pkd", "treelets", "brute"] {
        folder
            .render(&format!(
                "a.data -o same.png {VIEW} --bonds file --bond-radius 0.3 --structure {structure}"
            ))
            .fine();
        assert!(png(&folder.path("same.png")).0 == png(&folder.path("with.png")).0, "{structure}");
    }
    // Built ones are kept, with the structure and without.
    folder.line("build a.data -o b.tyn --radius 0.2").fine();
    assert!(folder.line("info b.tyn --check").out.contains("\nbonds 2\n"));
    for structure in ["", "--structure pkd"] {
        let look = VIEW.replace("--radius 0.2 ", "");
        let said =
            folder.render(&format!("b.tyn -o same.png {look} --bonds --bond-radius 0.3 {structure}")).fine();
        assert!(said.contains("2 bonds of the file"), "{said}");
        assert!(png(&folder.path("same.png")).0 == png(&folder.path("with.png")).0, "{structure}");
    }
    folder.render(&format!("a.data -o images.png {VIEW} --bonds --bond-radius 0.3 --replicate 2,1,1")).fine();
    let upper = drawn(&folder, "images.png", 12..15);
    assert!((36..=38).all(|x| upper.contains(&x)), "{upper:?}");
}

#[test]
fn bonds_are_found_by_elements_and_hinted_at() {
    let folder = Folder::new();
    folder.file("a.xyz", "3\nwater\nO 0 0 0\nH 0.96 0 0\nH -0.24 0.93 0\n");
    let said = folder.render("a.xyz -o a.png --bonds").fine();
    assert!(said.contains("2 bonds by the elements, up to 1.2 × the sum of covalent radii"), "{said}");
    assert!(
        said.contains("note: bonds lie within the spheres where these touch; --radius-scale 0.25"),
        "{said}"
    );
    let said = folder.render("a.xyz -o a.png --bonds elements --radius-scale 0.25").fine();
    assert!(!said.contains("lie within"), "{said}");
    // Bonds are lost on the way to formats that have none, which is said.
    folder.file("a.data", DATA);
    assert!(folder.line("convert a.data -o b.dump").fine().contains("bonds are left out"));
    let said = folder.line("info a.data --wrap molecules").out;
    assert!(said.contains("molecules by mol and bonds, whole, in the cell"), "{said}");
}

#[test]
fn bonds_that_cannot_be_are_refused() {
    let folder = Folder::new();
    folder.file("a.dump", dump("id type x y z", 4.0, &["1 1 0.5 1 1", "2 1 1.5 1 1"]));
    folder.file("a.data", DATA);
    for (words, parts) in [
        ("a.dump -o a.png --bonds", ["--bonds cannot be 'auto'", "a distance, as in --bonds 1.8"]),
        ("a.dump -o a.png --bonds file", ["--bonds", "the file has no bonds"]),
        ("a.data -o a.png --bonds --culling confidence", ["--culling", "off or certified with --bonds"]),
        ("a.data -o a.png --bonds --device gpu", ["--device cannot be 'gpu'", "auto or cpu with --bonds"]),
    ] {
        folder.render(words).fails(2, &parts);
    }
    for words in [
        "-o a.png --bonds a.data",
        "a.data -o a.png --bond-radius 1",
        "a.data -o a.png --bonds --mode medium",
        "a.data -o a.png --bonds -1",
    ] {
        assert_eq!(folder.render(words).code, 2, "{words}");
    }
    assert!(!folder.path("a.png").exists());
}
