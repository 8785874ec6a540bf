//! Particles as a medium: pictures, what is said of them, scene files, and what is refused.

use super::{Folder, png};

const CLOUD: &str = "synthetic:cloud2?n=4000 --mode medium --grid 32 --up 0,1,0";

/// Mean of the pixels' brightness.
fn brightness(folder: &Folder, name: &str) -> f64 {
    let (pixels, ..) = png(&folder.path(name));
    pixels.iter().map(|&it| f64::from(it)).sum::<f64>() / pixels.len() as f64
}

#[test]
fn particles_become_a_lit_medium_on_black() {
    let folder = Folder::new();
    let said = folder.render(&format!("{CLOUD} -o a.png -v")).fine();
    for part in [
        "three-pass",
        "N* 64",
        "extinction",
        "median column is 6 thick",
        "cache by sweeps",
        "lit by a sun",
        "particles used by grid points",
        "density:",
        "light:",
        "picture:",
    ] {
        assert!(said.contains(part), "'{part}' is not in: {said}");
    }
    let (pixels, color, texts) = png(&folder.path("a.png"));
    assert_eq!((color, &pixels[..3]), (png::ColorType::Rgb, &[0, 0, 0][..]));
    assert!(pixels.iter().any(|&it| it > 100), "something is bright");
    assert!(texts.iter().any(|(key, text)| key == "Guesses" && text.contains("extinction")));

    folder.render(&format!("{CLOUD} -o again.png")).fine();
    assert_eq!(png(&folder.path("again.png")).0, pixels, "same seed, same picture");
    folder.render(&format!("{CLOUD} -o clear.png --background none")).fine();
    assert_eq!(png(&folder.path("clear.png")).1, png::ColorType::Rgba);
}

#[test]
fn every_way_to_find_light_gives_nearly_the_same_picture() {
    let folder = Folder::new();
    let light = "--light sun:0.5,-1,-0.3:3 --light sky:0.3 --extinction 0.02";
    folder.render(&format!("{CLOUD} {light} -o sweeps.png")).fine();
    let wanted = brightness(&folder, "sweeps.png");
    for how in
        ["--cache photons --photons 30000", "--cache off --photons 20000", "--method reference --samples 16"]
    {
        folder.render(&format!("{CLOUD} {light} {how} -o other.png")).fine();
        let found = brightness(&folder, "other.png");
        assert!((found / wanted - 1.0).abs() < 0.05, "{how}: {found} {wanted}");
    }
    folder.render(&format!("{CLOUD} {light} --cache single -o single.png")).fine();
    assert!(brightness(&folder, "single.png") < 0.9 * wanted);
}

#[test]
fn what_is_shown_and_how_it_is_made_can_be_chosen() {
    let folder = Folder::new();
    for (name, words) in [
        ("density", "--show density --smoothing scatter --kernel wendland"),
        ("photons", "--show photons --photons 20000 --free-path exact"),
        ("noise", "--noise 0.5@3 --density-noise 0.4@3 --noise-scale 2 --smoothing uniform --h0 2"),
        ("forward", "--g 0.6 --albedo 0.9,0.8,0.7 --smoothing exact --neighbors 32"),
        ("ortho", "--ortho auto --view x --exposure 1 --smoothing two-pass"),
    ] {
        folder.render(&format!("{CLOUD} {words} -o {name}.png")).fine();
        assert!(brightness(&folder, &format!("{name}.png")) > 0.5, "{name}");
    }
    folder.render(&format!("{CLOUD} -o a.exr")).fine();
    assert!(std::fs::metadata(folder.path("a.exr")).unwrap().len() > 1000);
}

#[test]
fn an_orbit_lights_the_medium_once() {
    let folder = Folder::new();
    let said = folder.render(&format!("{CLOUD} -o a.%d.png --orbit 90 --frame-count 3 -v")).fine();
    assert_eq!(said.matches("light:").count(), 1, "{said}");
    assert_eq!(folder.names(), ["a.0.png", "a.1.png", "a.2.png"]);
}

const SCENE: &str = "
[grid]
file = 'block.raw'
size = [4, 4, 4]
sample = 'f32'
spacing = 0.5
[medium]
extinction = 2.0
albedo = 1
[[light]]
kind = 'sky'
radiance = 0.25
[camera]
view = 'z'
horizontal_fov = 30
[picture]
background = 'sky'
";

#[test]
fn a_scene_file_has_a_grid_in_place_of_particles() {
    let folder = Folder::new();
    let block: Vec<u8> = [1.0_f32; 64].iter().flat_map(|it| it.to_le_bytes()).collect();
    folder.file("block.raw", block);
    folder.file("a.toml", SCENE);
    let said = folder.render("a.toml -o a.png").fine();
    assert!(said.contains("grid 4x4x4") && said.contains("extinction 2 given"), "{said}");
    // Without absorption the block is invisible in a uniform sky: 0.25 is 137 in sRGB.
    let (pixels, ..) = png(&folder.path("a.png"));
    assert!(pixels.iter().all(|&it| it.abs_diff(137) <= 2), "{:?}", pixels.iter().max());

    // The command line counts more than the scene.
    let said = folder.render("a.toml -o b.png --extinction 3 --background black").fine();
    assert!(said.contains("extinction 3 given"), "{said}");
    assert_eq!(png(&folder.path("b.png")).0[0], 0);

    folder.file("particles.toml", "[particles]\nfiles = ['synthetic:packed?n=50']\n[look]\nlook = 'flat'\n");
    assert!(folder.render("particles.toml -o c.png").fine().contains("50 particles"));
}

#[test]
fn scenes_that_make_no_sense_say_why() {
    let folder = Folder::new();
    for (text, part) in [
        ("[medium]\nalbedo = 1", "neither [grid] nor [particles]"),
        (&SCENE.replace("sample = 'f32'", "sampel = 'f32'"), "sampel"),
        (&SCENE.replace("albedo", "albdeo"), "--albdeo"),
        (&SCENE.replace("'sky'\nradiance", "'moon'\nradiance"), "no light is called 'moon'"),
        ("[grid\n", "line 1"),
    ] {
        folder.file("a.toml", text);
        folder.render("a.toml -o a.png").fails(3, &[part]);
    }
    folder.file("a.toml", SCENE);
    folder.render("a.toml -o a.png").fails(3, &["block.raw"]);
}

#[test]
fn a_medium_that_cannot_be_is_refused() {
    let folder = Folder::new();
    for (words, part) in [
        ("--albedo 1.5", "albedo"),
        ("--g 1", "g cannot be '1'"),
        ("--extinction=-2", "extinction"),
        ("--noise 99@3", "noise"),
        ("--noise 1@0", "noise"),
        ("--light sky:-1", "radiance"),
        ("--light sun:0,0,0:1", "direction"),
        ("--weight nothing", "nothing"),
        ("--dry-run", "--dry-run is for spheres"),
    ] {
        folder.render(&format!("{CLOUD} {words} -o a.png")).fails(2, &[part]);
    }
    folder.render(&format!("{CLOUD} --voxel 1e-7 -o a.png")).fails(2, &["grid"]);
    folder
        .render(&format!("{CLOUD} --eye 0,0,500 --look-at 0,0,900 -o a.png"))
        .fails(3, &["nothing of the medium"]);
    folder.render("synthetic:packed?n=9 --background sky -o a.png").fails(2, &["--background", "medium"]);
    assert!(!folder.path("a.png").exists());
}
