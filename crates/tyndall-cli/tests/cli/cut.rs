//! What is cut: caps where they are, in the color that is said, and what does not go with it.

use super::{Folder, line_of, png};

/// Three spheres in a row, from above.
const VIEW: &str = "--view z --ortho 2 --look-at 1,0.25,-0.5 --radius 0.45 --look flat --color #808080";

#[test]
fn cut_surfaces_are_as_large_as_they_are_in_the_color_that_is_said() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(3));
    let count = |name: &str, words: &str, color: [u8; 3]| {
        let told =
            folder.line(&format!("render --size 96x64 --samples 4 a.xyz -o {name} {VIEW} {words}")).fine();
        assert!(told.contains("cut: ") || words.is_empty(), "{told}");
        png(&folder.path(name)).0.chunks_exact(3).filter(|pixel| **pixel == color).count() as f64
    };
    // Discs of three spheres cut through their middles, at 32 pixels a unit of length.
    let disc = std::f64::consts::PI * (0.45 * 32.0_f64).powi(2);
    let red = [255, 0, 0];
    let whole = count("whole.png", "--cut z<-0.5 --cap red", red);
    assert!((whole / (3.0 * disc) - 1.0).abs() < 0.1, "{whole} {disc}");
    let half = count("half.png", "--cut z<-0.5 --cut x<1 --cap #ff0000", red);
    assert!((half / (1.5 * disc) - 1.0).abs() < 0.1, "{half} {disc}");
    let small = count("small.png", "--cut z<-0.86 --cap red", red);
    assert!((small / (3.0 * disc * (1.0 - 0.64)) - 1.0).abs() < 0.2, "{small} {disc}");
    // In the color of the particles nothing tells caps, seen from above, from them.
    let [caps, none] = ["--cut z<-0.5", ""].map(|words| count("same.png", words, [0x80; 3]));
    assert!(caps > 2.5 * disc && caps == none, "{caps} {none}");
    // With the names of the flags in a scene.
    folder.file("a.toml", "[selection]\ncut = [\"z<-0.5\", \"x<1\"]\ncap = \"red\"\n");
    folder.line(&format!("render --size 96x64 --samples 4 a.toml a.xyz -o scene.png {VIEW}")).fine();
    assert_eq!(png(&folder.path("scene.png")).0, png(&folder.path("half.png")).0);
}

#[test]
fn what_is_shown_fills_the_picture_where_that_is_asked_for() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(9));
    folder.file("b.xyz", line_of(2));
    folder.line("build a.xyz -o a.tyn --radius 0.5").fine();
    let picture = |name: &str, words: &str| {
        let words =
            format!("render --size 48x32 --samples 4 -o {name} --look flat --color gray --view y {words}");
        let told = folder.line(&words).fine();
        (told, png(&folder.path(name)).0)
    };
    let (_, all) = picture("all.png", "a.xyz --radius 0.5 --select x<2");
    let (told, shown) = picture("shown.png", "a.xyz --radius 0.5 --select x<2 --frame-shown");
    assert!(told.contains("framed on what is shown"), "{told}");
    let (_, alone) = picture("alone.png", "b.xyz --radius 0.5");
    let differing =
        |one: &[u8], other: &[u8]| one.iter().zip(other).filter(|(a, b)| a.abs_diff(**b) > 64).count();
    assert!(differing(&shown, &alone) < 30 && differing(&all, &shown) > 300);
    let (_, of_cut) = picture("cut.png", "a.xyz --radius 0.5 --cut x<1.49 --frame-shown");
    assert!(differing(&of_cut, &alone) < 30);
    assert_eq!(picture("saved.png", "a.tyn --select x<2 --frame-shown").1, shown);
    // The camera is that of the first frame, also where its picture is there already.
    folder.file("s.xyz", line_of(9) + &line_of(5).replace("Cu 1.0", "Cu 1.9"));
    let frames = |words: &str| {
        let words = format!("s.xyz --radius 0.5 --select x<2 --frame-shown {words}");
        folder
            .line(&format!("render --size 48x32 --samples 4 --look flat --color gray --view y {words}"))
            .fine();
    };
    frames("-o s.%d.png --frames :");
    frames("-o own.png --frame 1");
    let second = png(&folder.path("s.1.png")).0;
    assert!(differing(&second, &png(&folder.path("own.png")).0) > 100);
    std::fs::remove_file(folder.path("s.1.png")).unwrap();
    frames("-o s.%d.png --frames : --skip-existing");
    assert_eq!(png(&folder.path("s.1.png")).0, second);
    assert_eq!(png(&folder.path("s.0.png")).0, shown);
}

#[test]
fn what_does_not_go_with_cuts_is_refused_before_the_work() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(3));
    for (words, parts) in [
        ("--cut w<3", ["--cut cannot be 'w<3'", "z<0.5L"]),
        ("--cut z<1 --cap redd", ["--cap cannot be 'redd'", "did you mean 'red'?"]),
        ("--cap red", ["--cut", "not provided"]),
        ("--cut z<1 --mode medium", ["--cut", "--clip"]),
        ("--cut z<1 --mode project", ["--cut", "--clip"]),
        ("--cut z<1 --device gpu", ["--device", "--cut"]),
        ("--cut z<1 --culling confidence", ["--culling", "--cut"]),
        ("--cut z<1 --certified coverage", ["--certified", "--cut"]),
    ] {
        folder.render(&format!("a.xyz -o a.png {words}")).fails(2, &parts);
    }
    folder.render("a.xyz -o a.png --cut z<-3").fails(3, &["--cut 'z<-3' leaves", "x -1.4..3.4"]);
    assert_eq!(folder.names(), ["a.xyz"]);
}
