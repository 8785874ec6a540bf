//! What is drawn over pictures of spheres: lines.

use super::{Folder, line_of, png};

/// Three spheres in a row, the middle one before the others.
const VIEW: &str = "--view y --ortho 4 --look-at 1,0.25,-0.5 --radius 0.45 --look flat --color #808080";

/// How many pixels are of a color.
fn count(folder: &Folder, name: &str, color: [u8; 3]) -> usize {
    png(&folder.path(name)).0.chunks_exact(3).filter(|pixel| **pixel == color).count()
}

#[test]
fn lines_are_drawn_as_wide_and_in_the_color_that_is_said() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(3));
    let picture = |name: &str, words: &str| {
        folder.line(&format!("render --size 96x64 --samples 4 a.xyz -o {name} {VIEW} {words}")).fine();
        png(&folder.path(name)).0
    };
    let plain = picture("plain.png", "");
    assert_eq!(picture("none.png", "--outline 0"), plain);
    assert_ne!(picture("thin.png", "--outline"), plain);
    picture("wide.png", "--outline 60 --outline-color red");
    picture("wider.png", "--outline 100 --outline-color red");
    let [wide, wider] = ["wide.png", "wider.png"].map(|name| count(&folder, name, [255, 0, 0]));
    assert!(wide > 150 && wider > wide * 4 / 3, "{wide} {wider}");
    // A part is that of the whole.
    let whole = picture("whole.png", "--outline 60 --look default");
    let part = picture("part.png", "--outline 60 --look default --crop 20,10,40,30");
    for (row, part) in part.chunks_exact(40 * 3).enumerate() {
        assert_eq!(*part, whole[((row + 10) * 96 + 20) * 3..][..40 * 3], "{row}");
    }
    // With the names of the flags in a scene.
    folder.file("a.toml", "[illustration]\noutline = 60\noutline-color = \"red\"\n");
    picture("scene.png", "a.toml");
    assert_eq!(png(&folder.path("scene.png")).0, png(&folder.path("wide.png")).0);
}

#[test]
fn what_cannot_be_drawn_is_refused_before_the_work() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(3));
    for (words, parts) in [
        ("--outline=-1", ["--outline", "at most 100"]),
        ("--outline 2 --outline-jump -1", ["--outline-jump", "0 or more"]),
        ("--outline-color red", ["--outline-color", "give --outline too"]),
        ("--outline 2 --aperture 1", ["--outline", "--aperture"]),
        ("--outline 2 --mode medium", ["--outline", "for spheres"]),
        ("--outline 2 --mode project", ["--outline", "for spheres"]),
    ] {
        folder.render(&format!("a.xyz -o a.png {words}")).fails(2, &parts);
    }
}
