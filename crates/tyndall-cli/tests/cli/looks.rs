//! Looks that are traced by paths, lenses, and samples by noise and time.

use super::medium::hdr;
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
    // Of a part, of each eye, and of each band.
    for (words, pictures) in [("--crop 3,4,40,20", 1), ("--stereo anaglyph", 2), ("--memory 300k", 4)] {
        let said = folder
            .line(&format!("render --size 48x128 a.xyz -o b.png --look matte --noise 4% {words}"))
            .fine();
        assert_eq!(said.matches("noise ").count(), pictures, "{words}: {said}");
    }
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
        ("--noise 0.6@3,1%", ["position noise", "--noise 1%"]),
        ("--denoise", ["--denoise", "--mode medium"]),
        ("--noise 1%,2%", ["--noise", "one of each kind"]),
        ("--mode medium --show density --noise 1%", ["--noise", "pictures of light"]),
    ] {
        folder.render(&format!("a.xyz -o a.png {words}")).fails(2, &parts);
    }
}

#[test]
fn an_image_lights_spheres_and_is_seen_behind_them() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(1));
    // 128 * 2^(127 - 136) = 0.25, which is 137 in sRGB; four times that is white.
    folder.file("even.hdr", hdr([128, 128, 128, 127]));
    let render = |name: &str, rest: &str| {
        folder.render(&format!("a.xyz -o {name} --ortho 3 --radius 1 --color #fff {rest}")).fine()
    };
    let is_all = |name: &str, level: u8| {
        let (pixels, kind, _) = png(&folder.path(name));
        assert!(kind == png::ColorType::Rgb, "{name} is opaque");
        assert!(pixels.iter().all(|it| it.abs_diff(level) <= 1), "{name}: {:?}", pixels.iter().min());
    };
    let said = render("a.png", "--light image:even.hdr --background sky");
    assert!(
        said.contains("look default by paths of 4 bounces · lit by an image of mean radiance 0.25"),
        "{said}"
    );
    is_all("a.png", 137);
    render("b.png", "--light image:2:even.hdr --exposure 1 --look clay --roughness 0 --background white");
    is_all("b.png", 255);
    // As a sky of the same radiance, and again from what the picture says of itself.
    let said = render("c.png", "--light sky:0.1,0.1,0.1 --background sky");
    let told = "note: the mean radiance of the light is 0.1; --exposure 2.6 makes it 0.6";
    assert!(said.contains(told) && said.contains("light all around of mean radiance 0.1"), "{said}");
    render("d.png", "--light sky:0.25 --background sky --look glass");
    is_all("d.png", 137);
    folder.line("render --again a.png -o e.png").fine();
    assert!(png(&folder.path("e.png")).0 == png(&folder.path("a.png")).0);
    for (words, code, parts) in [
        ("--light image:no.hdr", 3, ["no.hdr", "No such file"]),
        ("--look flat --light sky:1", 2, ["--light", "other than headlight, flat and toon"]),
        ("--light sun:0,0,-1", 2, ["--light cannot be 'sun'", "image:FILE or sky:RADIANCE for spheres"]),
        ("--light sky:1 --light sky:2", 2, ["--light", "one image or sky"]),
        ("--light sky:-1", 2, ["radiance", "not negative"]),
        ("--background sky", 2, ["--background", "--light image:FILE"]),
        ("--exposure 1", 2, ["--exposure", "--light image:FILE"]),
        ("--light sky:1 --device gpu", 2, ["--device", "--light"]),
        ("--light sky:1 --background sky --depth-cue", 2, ["--depth-cue", "--background sky"]),
        ("--light sky:1 --layers direct -o f.exr", 2, ["--layers", "without --light"]),
    ] {
        let output = if words.contains("-o") { "" } else { "-o f.png" };
        folder.render(&format!("a.xyz {words} {output}")).fails(code, &parts);
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
    render("--motion-blur 0.5").fails(2, &["--motion-blur", "times of the file", "--shutter TIME"]);
}

#[test]
fn motion_blur_is_a_share_of_the_time_between_frames() {
    let folder = Folder::new();
    folder.file("a.csv", "x,y,z,vx,vy,vz\n0,0,0,10,0,0\n");
    let render = |name: &str, rest: &str| {
        let view =
            "--radius 0.4 --view -z --ortho 3 --look-at 0,0,0 --look flat --color #fff --background black";
        folder.render(&format!("a.csv -o {name} {view} {rest}"))
    };
    let pixels = |name: &str| png(&folder.path(name)).0;
    render("a.png", "--shutter 0.02").fine();
    render("b.png", "--motion-blur 0.5 --fps 25 --velocity v").fine();
    render("c.png", "--motion-blur 0.25 --fps 25").fine();
    assert!(pixels("a.png") == pixels("b.png") && pixels("a.png") != pixels("c.png"));
    render("d.png", "--motion-blur 0.48").fine();
    assert!(pixels("a.png") == pixels("d.png"), "24 frames a second");
    render("e.png", "--motion-blur -1").fails(2, &["--motion-blur", "0 or more"]);
    render("e.png", "--motion-blur 1 --fps 0").fails(2, &["--fps", "above 0"]);
    render("e.png", "--motion-blur 1 --shutter 1").fails(2, &["--motion-blur", "--shutter"]);
    render("e.png", "--motion-blur 1 --mode medium").fails(2, &["--motion-blur is for spheres"]);
    render("e.png", "--velocity v").fails(2, &["--shutter"]);
}
