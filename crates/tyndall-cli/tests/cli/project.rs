//! Projections: numbers in files, pictures of them, and what is refused.

use super::{Folder, png};

/// A hundred particles of mass 1 to 100 and temperature 7.
fn masses(folder: &Folder) {
    let mut rows = String::from("x,y,z,mass,temperature\n");
    for k in 0..100 {
        rows += &format!("{},{},{},{},7\n", k % 5, k / 5 % 5, k / 25, k + 1);
    }
    folder.file("a.csv", &rows);
}

/// The numbers of a `.npy` of doubles.
fn numbers(folder: &Folder, name: &str, count: usize) -> Vec<f64> {
    let bytes = std::fs::read(folder.path(name)).unwrap();
    let values = bytes[bytes.len() - 8 * count..].chunks(8);
    values.map(|it| f64::from_le_bytes(it.try_into().unwrap())).collect()
}

#[test]
fn the_map_has_the_mass_of_the_particles() {
    let folder = Folder::new();
    masses(&folder);
    let words = "a.csv --mode project --axis z --ortho 40 --unit Msun/pc^2 -o a.npy";
    let said = folder.render(words).fine();
    for part in [
        "column density of mass, integral of rho dl in Msun/pc^2",
        "(100.00 %)",
        "inferno log",
        "5050 of 5050",
    ] {
        assert!(said.contains(part), "'{part}' is not in: {said}");
    }
    let map = numbers(&folder, "a.npy", 48 * 32);
    let pixel = 40.0 / 32.0;
    let mass = map.iter().sum::<f64>() * pixel * pixel;
    assert!((mass / 5050.0 - 1.0).abs() < 1e-6, "{mass}");
    let beside = std::fs::read_to_string(folder.path("a.npy.json")).unwrap();
    assert!(beside.contains("\"unit\": \"Msun/pc^2\"") && beside.contains("Command"), "{beside}");

    folder.render(&format!("{words} --threads 1 --exact-kernel -o b.npy")).fine();
    assert_eq!(
        numbers(&folder, "b.npy", 48 * 32),
        map,
        "threads change nothing, and kernels are exact anyway"
    );
    folder.render(&words.replace("a.npy", "a.fits")).fine();
    assert!(std::fs::read(folder.path("a.fits")).unwrap().starts_with(b"SIMPLE"));
}

#[test]
fn the_mean_of_a_constant_is_that_constant() {
    let folder = Folder::new();
    masses(&folder);
    let words = "a.csv --mode project --view z --quantity temperature";
    let said = folder.render(&format!("{words} --weight mass -o a.npy")).fine();
    assert!(said.contains("mean of temperature weighted by mass"), "{said}");
    let map = numbers(&folder, "a.npy", 48 * 32);
    assert!(map.iter().all(|it| it.is_nan() || (it - 7.0).abs() < 1e-12));
    assert!(map.iter().filter(|it| it.is_finite()).count() > 300);
    let said = folder.render(&format!("{words} -o a.exr -v")).fine();
    assert!(said.contains("line integral of temperature") && said.contains("volumes: "), "{said}");
}

#[test]
fn pictures_of_maps_are_on_black_in_inferno() {
    let folder = Folder::new();
    masses(&folder);
    folder.render("a.csv --mode project --view z --ortho 40 -o a.png --bits 16").fine();
    let (pixels, color, texts) = png(&folder.path("a.png"));
    assert_eq!((color, &pixels[..6]), (png::ColorType::Rgb, &[0; 6][..]));
    assert!(pixels.iter().any(|it| *it > 200));
    assert!(texts.iter().any(|(key, text)| key == "Guesses" && text.contains("column density of mass")));
    folder
        .render("synthetic:clustered?n=2000 --mode project -o c.png --alpha --range 1:2 --cmap gray")
        .fine();
    assert_eq!(png(&folder.path("c.png")).1, png::ColorType::Rgba);
    folder.render("synthetic:clustered?n=2000 --mode project -o a.%d.png --orbit 90 --frame-count 2").fine();
    assert!(folder.path("a.1.png").exists());
    let ran = folder.render("synthetic:clustered?n=2000 --mode project -o d.png --dry-run");
    assert!(ran.code == 0 && ran.out.contains("nothing written"), "{ran:?}");
}

#[test]
fn projections_that_cannot_be_say_why() {
    let folder = Folder::new();
    masses(&folder);
    for (words, part) in [
        ("--quantity temprature", "did you mean 'temperature'?"),
        ("--weight mas", "did you mean 'mass'?"),
        ("--fov 40", "parallel rays"),
        ("--replicate 2", "--replicate"),
        ("--background sky", "--background"),
        ("--range 0:1 --norm log", "a logarithm needs"),
    ] {
        folder.render(&format!("a.csv --mode project {words} -o a.png")).fails(2, &[part]);
    }
    let past = "a.csv --mode project --eye 0,0,50 --look-at 900,0,0 --ortho 1 -o a.png";
    folder.render(past).fails(3, &["nothing of the particles is in the map"]);
    folder.render("a.csv -o a.npy").fails(2, &[".png .jpg .exr"]);
    assert_eq!(folder.names(), ["a.csv"]);
}
