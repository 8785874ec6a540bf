//! Parts of pictures, layers, pictures for two eyes, JPEG, and pictures in bands.

use super::{Folder, line_of, png};
use std::collections::BTreeMap;
use std::path::Path;

/// The channels of an EXR by their names, its size, and where it lies.
fn exr_of(path: &Path) -> (BTreeMap<String, Vec<f32>>, [usize; 2], [i32; 2]) {
    let image = exr::prelude::read_all_flat_layers_from_file(path).unwrap();
    let layer = &image.layer_data[0];
    let channels = layer.channel_data.list.iter();
    let channels = channels.map(|it| (it.name.to_string(), it.sample_data.values_as_f32().collect()));
    let at = layer.attributes.layer_position;
    (channels.collect(), [layer.size.x(), layer.size.y()], [at.x(), at.y()])
}

const WORDS: &str = "--color c_pe --range 0:6 --radius 0.4 --seed 2";

#[test]
fn a_crop_is_a_part_of_the_picture() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(6));
    folder.render(&format!("a.xyz -o a.png {WORDS}")).fine();
    folder.render(&format!("a.xyz -o b.png {WORDS} --crop 9,11,30,7")).fine();
    let ((whole, ..), (part, ..)) = (png(&folder.path("a.png")), png(&folder.path("b.png")));
    let rows = (11..18).flat_map(|row| &whole[3 * (48 * row + 9)..3 * (48 * row + 39)]);
    assert!(rows.eq(&part));
    folder.render(&format!("a.xyz -o b.exr {WORDS} --crop 9,11,30,7")).fine();
    let (_, size, at) = exr_of(&folder.path("b.exr"));
    assert_eq!((size, at), ([30, 7], [9, 11]));
    folder.render("a.xyz -o c.png --crop 40,0,9,1").fails(2, &["--crop", "48x32"]);

    let medium = "synthetic:cloud1?n=500 --mode medium --grid 12 --cache single --samples 1";
    folder.render(&format!("{medium} -o m.png")).fine();
    folder.render(&format!("{medium} -o n.png --crop 0,8,48,16")).fine();
    let ((whole, ..), (part, ..)) = (png(&folder.path("m.png")), png(&folder.path("n.png")));
    assert!(whole[3 * 48 * 8..3 * 48 * 24] == part);
}

#[test]
fn an_exr_has_the_layers_that_are_asked_for() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(6));
    let layers = "--layers beauty,depth,id,normal,position,albedo,direct,ambient,value";
    folder.render(&format!("a.xyz -o a.exr {WORDS} {layers} --background none")).fine();
    folder.render(&format!("a.xyz -o b.exr {WORDS} --aov beauty,alpha --background none")).fine();
    folder.render(&format!("a.xyz -o c.exr {WORDS} --look flat --background none")).fine();
    let [(a, ..), (b, ..), (flat, ..)] = ["a.exr", "b.exr", "c.exr"].map(|name| exr_of(&folder.path(name)));
    assert_eq!(b.keys().map(String::as_str).collect::<Vec<_>>(), ["A", "B", "G", "R"]);
    assert!(["A", "B", "G", "R"].iter().all(|name| a[*name] == b[*name]));
    let mut seen = 0;
    for at in 0..48 * 32 {
        for name in ["R", "G", "B"] {
            let of = |layer: &str| a[&format!("{layer}.{name}")][at];
            assert!((of("direct") + of("ambient") - a[name][at]).abs() < 1e-5, "{name} of {at}");
            assert_eq!(of("albedo"), flat[name][at]);
        }
        let id = a["id"][at];
        let vector = |layer: &str| ["X", "Y", "Z"].map(|axis| f64::from(a[&format!("{layer}.{axis}")][at]));
        if id < 0.0 {
            assert!(a["value"][at].is_nan() && vector("normal") == [0.0; 3]);
            continue;
        }
        seen += 1;
        assert_eq!(a["value"][at], id + 0.5);
        let (position, normal) = (vector("position"), vector("normal"));
        for (axis, center) in [f64::from(id), 0.25, -0.5].into_iter().enumerate() {
            assert!((position[axis] - center - 0.4 * normal[axis]).abs() < 1e-4, "{position:?} {normal:?}");
        }
    }
    assert!(seen > 100, "{seen}");
    assert!(a["direct.R"] != a["ambient.R"]);

    folder.render("a.xyz -o a.png --layers normal").fails(2, &["--layers is for .exr"]);
    folder.render("a.xyz -o a.exr --layers value --color red").fails(2, &["--color ATTRIBUTE"]);
    folder
        .render("a.xyz -o a.exr --layers direct --look flat")
        .fails(2, &["other than headlight, flat and toon"]);
    folder.render("a.xyz -o a.exr --layers transmittance").fails(2, &["--layers cannot be 'transmittance'"]);
    folder.render("synthetic:cloud1?n=500 --mode medium -o a.exr --layers normal").fails(2, &["--layers"]);
}

#[test]
fn an_exr_has_the_attributes_that_are_asked_for() {
    let folder = Folder::new();
    let row = |it: usize| format!("C {it} 0 0 {} {} {} -1\n", 10 * it, it + 1, it * it);
    let rows: String = (0..4).map(row).collect();
    folder.file("a.xyz", format!("4\nProperties=species:S:1:pos:R:3:q:R:1:velo:R:3\n{rows}"));
    folder.render("a.xyz -o a.exr --radius 0.4 --look flat --layers id,q,velo,velo.y,x,q*2,q,id").fine();
    let (channels, ..) = exr_of(&folder.path("a.exr"));
    let names: Vec<&str> = channels.keys().map(String::as_str).collect();
    assert_eq!(names, ["A", "B", "G", "R", "id", "q", "q*2", "velo.X", "velo.Y", "velo.Z", "velo.y", "x"]);
    let mut seen = [0; 4];
    for (at, id) in channels["id"].iter().enumerate() {
        let of = |name: &str| channels[name][at];
        if *id < 0.0 {
            assert!(of("q").is_nan() && of("velo.Z").is_nan());
            continue;
        }
        seen[*id as usize] += 1;
        assert_eq!([of("q"), of("q*2"), of("x")], [10.0 * id, 20.0 * id, *id]);
        assert_eq!(["velo.X", "velo.Y", "velo.Z", "velo.y"].map(of), [id + 1.0, id * id, -1.0, id * id]);
    }
    assert!(seen.iter().all(|pixels| *pixels > 5), "{seen:?}");
    let wrong = |layers: &str, what: &[&str]| {
        folder.render(&format!("a.xyz -o b.exr --layers {layers}")).fails(2, what);
    };
    wrong("nromal", &["--layers cannot be 'nromal'", "no attribute", "the layer 'normal'?"]);
    wrong("velq", &["did you mean 'velo'?", "available: "]);
    wrong("species", &["stands for words"]);
}

#[test]
fn two_eyes_see_from_two_sides() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(5));
    let camera = "--eye 2,-9,0 --look-at 2,0,0 --radius 0.4";
    folder.render(&format!("a.xyz -o a.exr {camera} --stereo side-by-side --layers depth,position")).fine();
    let (channels, size, _) = exr_of(&folder.path("a.exr"));
    assert_eq!(size, [96, 32]);
    // What is met in both pictures at one place is where the camera looks; the left eye sees more of the left sides.
    let mean = |eye: usize| {
        let seen = (0..96 * 32).filter(|at| (at % 96) / 48 == eye && channels["depth"][*at] < f32::INFINITY);
        let x: Vec<f64> = seen.map(|at| f64::from(channels["position.X"][at])).collect();
        x.iter().sum::<f64>() / x.len() as f64
    };
    assert!(mean(0) < mean(1), "{} {}", mean(0), mean(1));
    folder.render(&format!("a.xyz -o b.png {camera} --stereo anaglyph --eye-separation 0.5")).fine();
    let (pixels, ..) = png(&folder.path("b.png"));
    assert_eq!(pixels.len(), 48 * 32 * 3);
    assert!(pixels.chunks(3).any(|it| it[0] < it[1]) && pixels.chunks(3).any(|it| it[0] > it[1]));
    folder.render("a.xyz -o c.png --stereo anaglyph --ortho auto").fails(2, &["stereo"]);
    folder.render("a.xyz -o c.png --eye-separation 1").fails(2, &["--stereo"]);
}

#[test]
fn a_jpeg_is_opaque() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(4));
    folder.render("a.xyz -o a.jpg").fine();
    folder.render("a.xyz -o b.jpeg --quality 20").fine();
    let [fine, poor] = ["a.jpg", "b.jpeg"].map(|name| std::fs::read(folder.path(name)).unwrap());
    assert!(fine.starts_with(&[0xff, 0xd8]) && poor.len() < fine.len());
    folder.render("a.xyz -o c.jpg --alpha").fails(2, &["cannot be transparent"]);
    folder.render("a.xyz -o c.jpg --quality 0").fails(2, &["--quality"]);
}

#[test]
fn a_picture_that_is_too_large_for_the_memory_is_written_in_bands() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(6));
    let over = "--title Line --title-at top --bar --bar-at left --scalebar 2 --scalebar-at bottom --axes --axes-at bottom-right";
    for words in ["--look flat --background none", "--bits 16", "--look toon --depth-cue", over] {
        let words = format!("--size 300x211 --samples 4 {WORDS} {words}");
        folder.line(&format!("render a.xyz -o a.png {words}")).fine();
        folder.line(&format!("render a.xyz -o b.png {words} --memory 2M")).fine();
        assert!(png(&folder.path("a.png")).0 == png(&folder.path("b.png")).0, "{words}");
    }
    let past = "--size 300x211 --samples 1 --eye 0,9,0 --look-at 0,99,0 --memory 2M";
    folder.line(&format!("render a.xyz -o c.png {past}")).fails(3, &["E-view"]);
    folder.line(&format!("render a.xyz -o c.exr --size 300x211 {WORDS} --memory 2M")).fails(4, &["memory"]);
    assert_eq!(folder.names(), ["a.png", "a.xyz", "b.png"]);
}
