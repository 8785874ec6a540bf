//! What is drawn over pictures of spheres: lines, rims, and what fades with depth.

use super::{Folder, line_of, png};

/// Three spheres in a row, the middle one before the others.
const VIEW: &str = "--view y --ortho 2 --look-at 1,0.25,-0.5 --radius 0.45 --look flat --color #808080";

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
    picture("wide.png", "--outline 40 --outline-color red");
    picture("wider.png", "--outline 80 --outline-color red");
    let [wide, wider] = ["wide.png", "wider.png"].map(|name| count(&folder, name, [255, 0, 0]));
    assert!(wide > 150 && wider > wide * 4 / 3, "{wide} {wider}");
    // A part is that of the whole.
    let whole = picture("whole.png", "--outline 60 --look default");
    let part = picture("part.png", "--outline 60 --look default --crop 20,10,40,30");
    for (row, part) in part.chunks_exact(40 * 3).enumerate() {
        assert_eq!(*part, whole[((row + 10) * 96 + 20) * 3..][..40 * 3], "{row}");
    }
    // A look brings its own.
    assert_ne!(picture("toon.png", "--look toon"), picture("bare.png", "--look toon --outline 0"));
    assert_eq!(picture("toon.png", "--look toon"), picture("same.png", "--look toon --outline"));
    // With the names of the flags in a scene.
    folder.file("a.toml", "[illustration]\noutline = 40\noutline-color = \"red\"\n");
    picture("scene.png", "a.toml");
    assert_eq!(png(&folder.path("scene.png")).0, png(&folder.path("wide.png")).0);
}

#[test]
fn what_is_far_away_fades_into_the_background() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(3));
    // Along the row: the nearest at 20 - 2 - 0.45 from the eye, the middle one 1 behind.
    let view = "--eye 20,0.25,3.5 --look-at 1,0.25,-0.5 --ortho 4 --radius 0.45 --look flat --color #808080 --background white";
    let picture = |name: &str, words: &str| {
        folder.line(&format!("render --size 96x64 --samples 4 a.xyz -o {name} {view} {words}")).fine();
        png(&folder.path(name)).0
    };
    let plain = picture("plain.png", "");
    assert_eq!(picture("none.png", "--depth-cue 0 --halo 0"), plain);
    let gray = plain.iter().filter(|it| **it == 0x80).count();
    assert!(gray > 600, "{gray}");
    // All of what is further away than 3 is gone, and all halves are there.
    assert!(picture("gone.png", "--depth-cue 1 --depth-range 1:3").iter().all(|&it| it == 255));
    let half = picture("half.png", "--depth-cue 0.5 --depth-range 1:3");
    // Half of white and of 0x80, which is 0.2159 of it: 0.608, encoded 0.801.
    assert!(half.iter().all(|&it| it == 255 || it.abs_diff(204) <= 1 || it > 204));
    assert!(half.iter().filter(|it| it.abs_diff(204) <= 1).count() >= gray);
    let clear = picture("clear.png", "--depth-cue 0.5 --depth-range 1:3 --background none");
    assert!(clear.chunks_exact(4).filter(|pixel| pixel[3].abs_diff(128) <= 1).count() >= gray / 3);
    assert_ne!(picture("rims.png", "--halo 60 --halo-color black"), plain);
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
        ("--halo --opacity 0.5", ["--halo", "--opacity"]),
        ("--look toon --shutter 1", ["toon", "--shutter"]),
        ("--halo=-1", ["--halo", "at most 100"]),
        ("--halo-color red", ["--halo", "not provided"]),
        ("--depth-cue 2", ["--depth-cue", "0 (none) to 1"]),
        ("--depth-cue --depth-range 9:2", ["--depth-range", "the first is smaller"]),
        ("--depth-cue --depth-range 9", ["--depth-range", "such as 20:55.5"]),
        ("--depth-range 2:9", ["--depth-range", "give one of them too"]),
        ("--depth-cue --aperture 1", ["--depth-cue", "--aperture"]),
        ("--halo 2 --mode project", ["--halo", "for spheres"]),
        ("--outline 2 --mode medium", ["--outline", "for spheres"]),
        ("--outline 2 --mode project", ["--outline", "for spheres"]),
    ] {
        folder.render(&format!("a.xyz -o a.png {words}")).fails(2, &parts);
    }
}
