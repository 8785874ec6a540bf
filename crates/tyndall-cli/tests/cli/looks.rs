//! Looks that are traced by paths, lenses, and samples by noise and time.

use super::{Folder, dump, line_of, png};

#[test]
fn every_look_is_a_picture_of_its_own() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(5));
    let mut seen: Vec<(&str, Vec<u8>)> = Vec::new();
    for look in [
        "default",
        "headlight",
        "flat",
        "matte",
        "glossy",
        "metal",
        "glass",
        "water",
        "clay",
        "paper",
        "sand",
        "dust",
    ] {
        let said = folder.render(&format!("a.xyz -o a.png --look {look} --device auto")).fine();
        let is_traced = seen.len() > 2;
        assert_eq!(said.contains(&format!("look {look} by paths of 4 bounces")), is_traced, "{said}");
        let (pixels, ..) = png(&folder.path("a.png"));
        if let Some((other, _)) = seen.iter().find(|(_, before)| *before == pixels) {
            panic!("{look} looks like {other}");
        }
        seen.push((look, pixels));
    }
    // The same again, and with other numbers.
    folder.render("a.xyz -o b.png --look dust --bounces 4 --roughness 1").fine();
    assert!(png(&folder.path("b.png")).0 == seen[11].1);
    folder.render("a.xyz -o b.png --look glass --refraction 1.33 --seed 0").fine();
    assert!(png(&folder.path("b.png")).0 == seen[7].1);
    folder.render("a.xyz -o b.png --method path").fine();
    assert!(png(&folder.path("b.png")).0 == seen[3].1);
}

#[test]
fn a_lens_is_sharp_where_it_is_focused() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(5));
    let view =
        "--eye 20,0.25,-0.5 --look-at 0,0.25,-0.5 --ortho 4 --radius 0.4 --look flat --background white";
    folder.render(&format!("a.xyz -o flat.png {view}")).fine();
    let view = view.replace("--look flat", "--bounces 0");
    // How many pixels differ from those of the nearest sphere without a lens.
    let blurred = |focus: &str| {
        folder.render(&format!("a.xyz -o a.png {view} --aperture 1 --focus {focus}")).fine();
        let ((sharp, ..), (seen, ..)) = (png(&folder.path("flat.png")), png(&folder.path("a.png")));
        let is_white = |pixel: &[u8]| pixel.iter().all(|it| *it > 250);
        sharp.chunks(3).zip(seen.chunks(3)).filter(|(one, other)| is_white(one) != is_white(other)).count()
    };
    let (by_point, by_distance, behind) = (blurred("4,0.25,-0.5"), blurred("16"), blurred("40"));
    assert_eq!(by_point, by_distance);
    assert!(by_point < behind / 2, "{by_point} {behind}");
}

#[test]
fn samples_are_added_until_the_noise_or_the_time_is_reached() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(5));
    let said = folder.line("render --size 48x32 a.xyz -o a.png --look matte --noise 4%").fine();
    let line = said.lines().find(|line| line.contains("noise ")).unwrap();
    let noise: f32 = line.split_whitespace().nth(1).unwrap().parse().unwrap();
    assert!(noise > 0.0 && noise <= 4.0, "{said}");
    assert!(folder.render("a.xyz -o a.png --noise 0.001%").fine().contains("4 to 4 samples"));
    assert!(
        folder.line("render --size 8x8 a.xyz -o a.png --time 0.000001s").fine().contains("16 to 16 samples")
    );
}

#[test]
fn what_a_look_has_not_is_refused() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(5));
    for (words, parts) in [
        ("--look flat --bounces 2", ["--bounces", "other than headlight, flat and toon"]),
        ("--look headlight --aperture 1", ["--aperture", "other than headlight, flat and toon"]),
        ("--look metal --refraction 1.5", ["--refraction", "glossy, glass or water"]),
        ("--look glass --roughness 0.5", ["--roughness", "--look matte"]),
        ("--roughness 0.5", ["--roughness", "--look matte"]),
        ("--look metal --roughness 0", ["--roughness", "between 0.02 and 1"]),
        ("--look water --refraction 0.9", ["--refraction", "above 1"]),
        ("--look matte --device gpu", ["--device", "this look"]),
        ("--look toon --device gpu", ["--device", "--look toon"]),
        ("--look toon --bounces 1", ["--bounces", "other than headlight, flat and toon"]),
        ("--aperture 1 --focus 0", ["--focus", "distance greater than 0"]),
        ("--aperture 1 --eye 9,9,9 --look-at 0,0,0 --focus 20,20,20", ["--focus", "in front of the eye"]),
        ("--noise 0.6@3", ["position noise", "--noise 1%"]),
        ("--noise 0%", ["--noise", "more than 0%"]),
        ("--time soon", ["--time", "30s"]),
        ("--mode medium --noise 1%", ["--noise", "for spheres"]),
        ("--mode medium --time 1s", ["--time", "for spheres"]),
    ] {
        folder.render(&format!("a.xyz -o a.png {words}")).fails(2, &parts);
    }
}

#[test]
fn opacity_is_a_number_an_attribute_or_an_expression() {
    let folder = Folder::new();
    folder.file("a.dump", dump("id type x y z share", 4.0, &["1 1 0 0 0 0.25", "2 2 3 0 0 1"]));
    let render = |rest: &str| {
        let view = "--radius 1 --ortho 0.1 --look-at 0,0,0 --look flat --color #fff --background black";
        folder.render(&format!("a.dump -o a.png {view} {rest}"))
    };
    // A quarter and a half of linear white as sRGB.
    for (opacity, grey) in
        [("share", 137), ("if(type==1,0.25,1)", 137), ("0.5", 188), ("max(share,0.5)", 188)]
    {
        render(&format!("--opacity {opacity}")).fine();
        let (pixels, ..) = png(&folder.path("a.png"));
        assert!(pixels.iter().all(|&it| it == grey), "{opacity}: {}", pixels[0]);
    }
    let range = "0 (not seen) to 1 (opaque)";
    for (opacity, told) in [
        ("1.5", range),
        ("-0.1", range),
        ("8*share", range),
        ("shara", "share"),
        ("share+", "share+"),
        ("0.5 --culling confidence", "off or certified with --opacity"),
    ] {
        render(&format!("--opacity {opacity}")).fails(2, &[told]);
    }
}

#[test]
fn a_shutter_blurs_what_moves() {
    let folder = Folder::new();
    folder.file("a.dump", dump("id type x y z vx vy vz", 4.0, &["1 1 0 0 0 10 0 0"]));
    let render = |rest: &str| {
        let view =
            "--radius 0.4 --view -z --ortho 3 --look-at 0,0,0 --look flat --color #fff --background black";
        folder.render(&format!("a.dump -o a.png --samples 16 {view} {rest}"))
    };
    // Pixels that are neither black nor white, and those that are not black.
    let blurred = || {
        let (pixels, ..) = png(&folder.path("a.png"));
        let count = |is: fn(u8) -> bool| pixels.chunks(3).filter(|pixel| is(pixel[0])).count();
        (count(|it| it > 0 && it < 255), count(|it| it > 0))
    };
    render("").fine();
    let sharp = blurred();
    render("--shutter 0").fine();
    assert_eq!(blurred(), sharp);
    render("--shutter 0.1").fine();
    let (between, all) = blurred();
    assert!(between > 2 * sharp.0 && all > sharp.1 * 3 / 2, "{between} of {all}, {sharp:?}");
    render("--shutter 0.1 --velocity w").fails(2, &["--velocity", "the file has: v"]);
    render("--shutter -1").fails(2, &["--shutter", "0 or more"]);
    render("--shutter 0.1 --structure pkd").fails(2, &["--shutter", "bvh"]);
    render("--shutter 0.1 --arrows v").fails(2, &["--shutter", "arrows"]);
    render("--shutter 0.1 --layers normal").fails(2, &["--layers", "--shutter"]);
}
