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
fn samples_are_added_until_the_noise_or_the_time_is_reached() {
    let folder = Folder::new();
    let reached = |words: &str| {
        let said = folder.line(&format!("render --size 48x32 {CLOUD} -o a.exr {words}")).fine();
        let line = said.lines().find(|line| line.starts_with("noise ")).unwrap().to_string();
        let word = |place: usize| line.split_whitespace().nth(place).unwrap().parse::<f32>();
        (word(1).unwrap_or(f32::INFINITY), word(3).unwrap_or(0.0), line.clone())
    };
    for (words, most) in [("--noise 0.2@2,0.5%", 0.5), ("--method path --noise 4%", 4.0)] {
        let (noise, least, line) = reached(words);
        assert!(noise > 0.0 && noise <= most && least >= 8.0, "{words}: {line}");
    }
    let (noise, _, line) = reached("--noise 0.0001% --samples 8");
    assert!(noise.is_finite() && line.contains("8 to 8 samples"), "{line}");
    let said = folder.render(&format!("{CLOUD} -o a.exr --cache photons --photons 3000 --noise 20%")).fine();
    let passes = said.lines().find(|line| line.starts_with("photons: ")).unwrap();
    let passes: u32 = passes.split_whitespace().nth(1).unwrap().parse().unwrap();
    assert!((2..=64).contains(&passes), "{said}");
    assert!(reached("--method path --time 0.000001s").2.contains("noise unknown, 1 to 1 samples"));
}

#[test]
fn a_denoised_picture_is_smoother_and_as_bright() {
    let folder = Folder::new();
    let roughness = |name: &str| {
        let (pixels, ..) = png(&folder.path(name));
        let value = |place: usize| f64::from(pixels[3 * place]);
        (0..48 * 32 - 2).map(|it| (value(it) - 2.0 * value(it + 1) + value(it + 2)).abs()).sum::<f64>()
    };
    let near = format!("{CLOUD} --eye 14,8,30 --look-at 12,8,0 --fov 6 --method path");
    folder.render(&format!("{near} -o noisy.png")).fine();
    let said = folder.render(&format!("{near} -o smooth.png --denoise -v")).fine();
    assert!(said.contains("denoised:"), "{said}");
    let (noisy, smooth) = (roughness("noisy.png"), roughness("smooth.png"));
    assert!(noisy > 1.5 * smooth, "{noisy} {smooth}");
    let (noisy, smooth) = (brightness(&folder, "noisy.png"), brightness(&folder, "smooth.png"));
    assert!((smooth / noisy - 1.0).abs() < 0.03, "{noisy} {smooth}");
    let text = folder.render(&format!("{near} -o a.png --denoise --time 0.000001s")).fine();
    assert!(text.contains("not denoised"), "{text}");
    folder.render(&format!("{near} -o a.png --denoise --samples 1")).fails(2, &["--samples", "at least 2"]);
    folder.render(&format!("{CLOUD} -o a.png --denoise --show density")).fails(2, &["--denoise", "of light"]);
}

#[test]
fn an_orbit_lights_the_medium_once() {
    let folder = Folder::new();
    let said = folder.render(&format!("{CLOUD} -o a.%d.png --orbit 90 --frame-count 3 -v")).fine();
    assert_eq!(said.matches("light:").count(), 1, "{said}");
    assert_eq!(folder.names(), ["a.0.png", "a.1.png", "a.2.png"]);
}

/// A ball of particles around a place, as a file of its own.
fn ball(x: f64) -> String {
    let place = |number: u32| {
        let share = |of: f64| (f64::from(number) * of).fract() - 0.5;
        [share(0.754_877_666), share(0.569_840_291), share(0.381_966_011)]
    };
    let inside = (0..1500).map(place).filter(|it| it.iter().map(|it| it * it).sum::<f64>() < 0.25);
    let lines: Vec<String> =
        inside.map(|[a, b, c]| format!("A {} {} {}\n", 4.0 * a + x, 4.0 * b, 4.0 * c)).collect();
    format!("{}\n\n{}", lines.len(), lines.concat())
}

#[test]
fn frames_of_what_stands_still_are_one_picture() {
    let folder = Folder::new();
    folder.file("a.0.xyz", ball(0.3));
    folder.file("a.1.xyz", ball(0.3));
    for words in [
        "",
        "--cache photons --photons 3000",
        "--noise 0.5@3,2% --density-noise 0.3@2",
        "--method path --samples 4 --denoise",
    ] {
        folder.render(&format!("a.#.xyz --mode medium --grid 16 {words} -o b.%d.png")).fine();
        let pixels = |number: u32| png(&folder.path(&format!("b.{number}.png"))).0;
        assert!(pixels(0).iter().any(|&it| it > 60), "{words}");
        assert_eq!(pixels(0), pixels(1), "{words}");
    }
}

#[test]
fn brightness_does_not_jump_where_a_particle_strays() {
    let folder = Folder::new();
    for number in 0..3 {
        let strayed = format!("A {} 0 0\n", 5.0 + 0.7 * f64::from(number));
        let ball = ball(0.0);
        let (count, lines) = ball.split_once("\n\n").unwrap();
        let count = count.parse::<u32>().unwrap() + 1;
        let name = format!("a.{number}.xyz");
        folder.file(&name, format!("{count}\n\n{lines}{strayed}"));
    }
    let words = "--mode medium --grid 14 --eye 1,-20,4 --look-at 0,0,0";
    folder.render(&format!("a.#.xyz {words} -o b.%d.png")).fine();
    let all = [0, 1, 2].map(|number| brightness(&folder, &format!("b.{number}.png")));
    assert!(all[0] > 1.0 && all.iter().all(|it| (it / all[0] - 1.0).abs() < 0.002), "{all:?}");
}

#[test]
fn lights_and_noise_stay_where_they_are_while_particles_move() {
    let folder = Folder::new();
    folder.file("a.0.xyz", ball(0.0));
    folder.file("a.1.xyz", ball(5.0));
    // What is guessed on the first frame is given, so that the second one is the same by itself.
    let words = "--mode medium --voxel 0.25 --h0 1 --extinction 0.05 --eye 2,-20,4 --look-at 2,0,0 \
        --light point:2.5,-3,2:9 --density-noise 0.9@1 --noise-scale 1.5";
    folder.render(&format!("a.#.xyz {words} -o b.%d.png")).fine();
    folder.render(&format!("a.1.xyz {words} -o alone.png")).fine();
    let (together, alone) = (png(&folder.path("b.1.png")).0, png(&folder.path("alone.png")).0);
    let difference: f64 =
        together.iter().zip(&alone).map(|(a, b)| (f64::from(*a) - f64::from(*b)).abs()).sum();
    let mean: f64 = alone.iter().map(|&it| f64::from(it)).sum();
    assert!(mean > 0.0 && difference < 0.05 * mean, "{difference} of {mean}");
}

/// A ball of particles with ids and velocities at a place, as a frame of a dump.
fn numbered_ball(x: f64) -> String {
    let ball = ball(x);
    let lines: Vec<String> = ball
        .lines()
        .skip(2)
        .enumerate()
        .map(|(id, line)| format!("{} {} 5 0 0\n", id + 1, line.trim_start_matches("A ")))
        .collect();
    let columns = "id x y z vx vy vz";
    let bounds = "-20 20\n".repeat(3);
    format!(
        "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n{}\nITEM: BOX BOUNDS ff ff ff\n{bounds}ITEM: ATOMS {columns}\n{}",
        lines.len(),
        lines.concat()
    )
}

#[test]
fn noise_goes_with_the_particles_of_a_sequence() {
    let folder = Folder::new();
    // By whole voxels and cells of the motion's lattice, so that densities are the same but for rounding.
    folder.file("a.0.dump", numbered_ball(0.0));
    folder.file("a.1.dump", numbered_ball(5.0));
    let words = "--mode medium --voxel 0.25 --h0 1 --extinction 0.05 --ortho 6 --light sky:1 \
        --density-noise 0.9@1 --noise-scale 1.25";
    let at = |x: f64| format!("--eye {x},-20,0 --look-at {x},0,0");
    let pixels = |name: &str| png(&folder.path(name)).0;
    let difference = |one: &[u8], other: &[u8]| {
        let sum: f64 = one.iter().zip(other).map(|(a, b)| (f64::from(*a) - f64::from(*b)).abs()).sum();
        sum / one.iter().map(|&it| f64::from(it)).sum::<f64>()
    };
    folder.render(&format!("a.0.dump {words} {} -o first.png", at(0.0))).fine();
    let first = pixels("first.png");
    assert!(brightness(&folder, "first.png") > 1.0);
    let moved = |how: &str, wanted: &str| {
        // A picture by itself is the one of the sequence.
        let said = folder.render(&format!("a.#.dump {words} {} --frame 1 {how} -o b.png", at(5.0))).fine();
        assert!(said.contains(wanted), "{how}: {said}");
        difference(&first, &pixels("b.png"))
    };
    let standing = moved("--noise-motion none", "noise stands in space");
    let by_ids = moved("", "noise goes with the particles, by id");
    let by_velocity = "--noise-motion velocity --noise-frame-time 1";
    let by_velocities = moved(by_velocity, "noise goes with the particles, by velocity");
    assert!(by_ids < 0.1 * standing && by_velocities < 0.1 * standing, "{by_ids} {by_velocities} {standing}");

    folder.render(&format!("a.#.dump {words} {} -o c.%d.png", at(5.0))).fine();
    folder.render(&format!("a.#.dump {words} {} --frame 0 -o alone.png", at(5.0))).fine();
    assert_eq!(pixels("c.0.png"), pixels("alone.png"));
    for (how, wanted) in [
        ("--noise-motion velocity", "--noise-frame-time"),
        ("--noise-motion id:idd", "did you mean 'id'?"),
        ("--noise-motion velocity:w", "the file has: v"),
        ("--noise-motion by-id", "did you mean 'id'?"),
        ("--noise-life 1", "2..=10000"),
    ] {
        folder.render(&format!("a.#.dump {words} {how} -o no.%d.png")).fails(2, &[wanted]);
    }
    folder.render("a.#.dump --mode medium --noise-motion id -o no.%d.png").fails(2, &["give --noise"]);
}

const SMOKE: &str = "synthetic:smoke?n=3000 --mode medium --grid 16 --up 0,1,0";

#[test]
fn matter_glows_by_its_temperature_a_quantity_or_evenly() {
    let folder = Folder::new();
    let fire = format!("{SMOKE} --light sky:0 --emission");
    let said = folder.render(&format!("{fire} blackbody:temperature -o fire.png")).fine();
    for part in [
        "optics scattering and emission",
        "k per ",
        "black body of temperature",
        "has luminance 1",
        "albedo 0.3",
    ] {
        assert!(said.contains(part), "'{part}' is not in: {said}");
    }
    let (pixels, _, texts) = png(&folder.path("fire.png"));
    let sum = |channel: usize| pixels[channel..].iter().step_by(3).map(|it| u64::from(*it)).sum::<u64>();
    assert!(
        sum(0) > 500 && sum(0) > 2 * sum(1) && sum(1) >= sum(2),
        "fire is red: {} {} {}",
        sum(0),
        sum(1),
        sum(2)
    );
    assert!(texts.iter().any(|(key, text)| key == "Guesses" && text.contains("black body of temperature")));
    folder.render(&format!("{fire} blackbody -o same.png")).fine();
    assert_eq!(png(&folder.path("same.png")).0, pixels, "it finds the temperature itself");
    let said = folder.render(&format!("{fire} 2*age --cmap viridis -o age.png")).fine();
    assert!(said.contains("emission 2*age viridis"), "{said}");
    let bar = "--bar --bar-file bar.svg --size 200x150 --annotation-color #00ff00";
    let said = folder.render(&format!("{fire} 2*age -o bar.png {bar}")).fine();
    assert!(!said.contains("stand for no numbers"), "{said}");
    let svg = std::fs::read_to_string(folder.path("bar.svg")).unwrap();
    assert!(svg.contains("2*age"), "{svg}");
    assert!(png(&folder.path("bar.png")).0.chunks(3).any(|it| it == [0, 255, 0]), "texts in that color");
    folder
        .render(&format!("{fire} 1 -o b.png --bar"))
        .fails(2, &["--bar is for colors that stand for numbers"]);
    let said = folder.render(&format!("{fire} 1,0.5,0.25 --emission-scale 2 -o even.png")).fine();
    assert!(said.contains("emission 1,0.5,0.25 · emission times 2"), "{said}");
}

#[test]
fn optics_are_chosen_by_name() {
    let folder = Folder::new();
    let mut means = Vec::new();
    for (words, part) in [
        ("--optics absorption", "dL/ds = -k L"),
        ("--optics emission", "dL/ds = k B,"),
        ("--optics emission --method reference --samples 1", "path tracer"),
        ("--optics emission-absorption --color temperature", "emission temperature inferno log"),
        (
            "--optics emission-absorption --emission blackbody:temperature@1100",
            "1100 K has luminance 1 (given)",
        ),
    ] {
        let said = folder.render(&format!("{SMOKE} {words} -o a.png")).fine();
        assert!(said.contains(part), "'{part}' is not in: {said}");
        means.push(brightness(&folder, "a.png"));
    }
    // What absorbs darkens the white behind it; what only emits is the same for march and path tracer.
    assert!(means[0] > 150.0 && means[0] < 254.0, "{means:?}");
    assert!((means[1] / means[2] - 1.0).abs() < 0.02, "{means:?}");
}

#[test]
fn looks_are_defaults_by_name() {
    let folder = Folder::new();
    let smoke = "synthetic:smoke?n=2000 --grid 16 --samples 1 --up 0,1,0";
    for (look, thickness) in [
        ("smoke", "5"),
        ("cloud", "20"),
        ("steam", "2.5"),
        ("dust", "4"),
        ("fire", "2"),
        ("explosion", "12"),
        ("nebula", "1"),
        ("spray", "1.5"),
        ("foam", "12"),
    ] {
        let said = folder.render(&format!("{smoke} --mode medium --look {look} -o {look}.png")).fine();
        let wanted = format!("the median column is {thickness} thick · look {look} · albedo ");
        assert!(said.contains(&wanted), "{said}");
        assert!(brightness(&folder, &format!("{look}.png")) > 1.0, "{look}");
    }
    let said =
        folder.render(&format!("{smoke} --look fire --albedo 0.9 --g 0.5 --emission none -o b.png")).fine();
    assert!(said.contains("albedo 0.9, g 0.5") && !said.contains("black body"), "{said}");
    let said = folder.render("synthetic:packed?n=900 --grid 16 --look fire --samples 1 -o c.png").fine();
    assert!(said.contains("black body of the root of the density times "), "{said}");
    folder
        .render("synthetic:packed?n=9 --look fire --emission blackbody -o a.png")
        .fails(2, &["no attribute 'temperature'"]);
    folder
        .render("synthetic:packed?n=9 --mode medium --look metal -o a.png")
        .fails(2, &["for spheres", "dust, smoke"]);
    folder.render(&format!("{smoke} --mode project --look fire -o a.png")).fails(2, &["--look"]);
}

#[test]
fn emission_that_cannot_be_says_why() {
    let folder = Folder::new();
    for (words, part) in [
        ("--emission blackbody:temprature", "did you mean 'temperature'?"),
        ("--emission ages", "did you mean 'age'?"),
        ("--emission blackbody:age", "are these kelvins?"),
        ("--emission blackbody:temperature@20", "from 500 to 1e9"),
        ("--emission blackbody:age-2", "kelvins of at least 0"),
        ("--emission-scale 0", "--emission-scale"),
        ("--optics absorption --emission 1", "emits nothing"),
        ("--optics emission --albedo 0.5", "scatters nothing"),
    ] {
        folder.render(&format!("{SMOKE} {words} -o a.png")).fails(2, &[part]);
    }
    let cold = format!("{CLOUD} --emission blackbody -o a.png");
    folder.render(&cold).fails(2, &["no attribute 'temperature'", "available: "]);
}

#[test]
fn a_grid_glows_by_a_temperature_beside_it() {
    let folder = Folder::new();
    folder.line("convert synthetic:smoke?n=3000 -o a.vdb --grid 16 --fields density,temperature").fine();
    let words = "--light sky:0 --eye 10,8,60 --look-at 10,8,8 --emission blackbody:temperature";
    let said = folder.render(&format!("a.vdb --up 0,1,0 {words} -o grid.png")).fine();
    assert!(said.contains("black body of temperature"), "{said}");
    folder.render(&format!("{SMOKE} {words} -o particles.png")).fine();
    let ratio = brightness(&folder, "grid.png") / brightness(&folder, "particles.png");
    assert!((0.8..1.25).contains(&ratio), "{ratio}");
    folder
        .render("a.vdb --emission blackbody:heat -o a.png")
        .fails(2, &["--emission cannot be 'heat'", "density", "temperature"]);

    let said = folder.render("a.vdb --look fire -o fire.png").fine();
    assert!(said.contains("black body of temperature"), "{said}");
    folder.line("convert synthetic:smoke?n=3000 -o b.vdb --grid 16 --fields density").fine();
    let said = folder.render("b.vdb --look fire -o fire.png").fine();
    assert!(said.contains("black body of the root of the density"), "{said}");
}

#[test]
fn a_damaged_temperature_is_not_passed_over() {
    let folder = Folder::new();
    let image = |name: &str, temperatures: usize| {
        let array = |name: &str, count: usize| {
            format!("<DataArray type='Float32' Name='{name}'>{}</DataArray>", "1 ".repeat(count))
        };
        let arrays = [array("density", 64), array(name, temperatures)].concat();
        format!(
            "<VTKFile type='ImageData'><ImageData WholeExtent='0 3 0 3 0 3' Origin='0 0 0' Spacing='1 1 1'>\
             <Piece Extent='0 3 0 3 0 3'><PointData>{arrays}</PointData></Piece></ImageData></VTKFile>"
        )
    };
    folder.file("a.toml", "[grid]\nfile = 'a.vti'\narray = 'density'\n");
    let render = |name: &str, count: usize, words: &str| {
        folder.file("a.vti", image(name, count));
        folder.render(&format!("a.toml --look fire --samples 1 --size 16x16 {words} -o a.png"))
    };
    let said = render("heat", 64, "").fine();
    assert!(said.contains("black body of heat times 1700"), "{said}");
    render("heat", 63, "").fails(3, &["a.vti", "heat"]);
    let said = render("speed", 64, "").fine();
    assert!(said.contains("black body of the root of the density"), "{said}");
    render("speed", 64, "--emission blackbody")
        .fails(2, &["--emission cannot be 'temperature, Temperatures", "density, speed"]);
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
fn a_grid_file_may_say_itself_where_its_samples_lie() {
    let folder = Folder::new();
    let samples = "1 ".repeat(48);
    let dx = "object 1 class gridpositions counts 3 4 4\norigin 0 0 0\ndelta 0.5 0 0\ndelta 0 0.5 0\ndelta 0 0 0.5\n\
        object 3 class array type float rank 0 items 48 data follows\n";
    folder.file("block.dx", format!("{dx}{samples}\n"));
    let vti = format!(
        "<VTKFile type='ImageData'><ImageData WholeExtent='0 2 0 3 0 3' Spacing='0.5 0.5 0.5'><Piece Extent='0 2 0 3 0 3'>\
         <PointData><DataArray type='Float32' Name='rho'>{samples}</DataArray></PointData></Piece></ImageData></VTKFile>"
    );
    folder.file("block.vti", vti);
    let scene = |table: &str| {
        let start = SCENE.find("[medium]").unwrap();
        format!("[grid]\n{table}\n{}", &SCENE[start..])
    };
    for (table, part) in
        [("file = 'block.dx'", "grid 3x4x4"), ("file = 'block.vti'\narray = 'rho'", "array 'rho'")]
    {
        folder.file("a.toml", scene(table));
        let said = folder.render("a.toml -o a.png").fine();
        assert!(said.contains(part), "{said}");
    }
    for (table, code, part) in [
        ("file = 'block.dx'\nspacing = 1", 3, "size and spacing"),
        ("file = 'block.vti'\narray = 'T'", 2, "scalars of the file: rho"),
    ] {
        folder.file("a.toml", scene(table));
        folder.render("a.toml -o a.png").fails(code, &[part]);
    }
    folder.render("block.dx -o a.png").fails(3, &["no particles", "[grid]"]);
}

#[test]
fn scenes_that_make_no_sense_say_why() {
    let folder = Folder::new();
    for (text, part) in [
        ("[medium]\nalbedo = 1", "neither [grid] nor [particles]"),
        (&SCENE.replace("sample = 'f32'", "sampel = 'f32'"), "sampel"),
        (&SCENE.replace("albedo", "albdeo"), "did you mean 'albedo'?"),
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
        ("--h0 0", "--h0"),
        ("--h0 nan", "--h0"),
        ("--gather-radius 0", "--gather-radius"),
        ("--cache photons --photon-passes 0", "--photon-passes"),
        ("--correction-scale 1", "scale"),
        ("--g=-1", "g cannot be '-1'"),
        ("--albedo=-0.1", "albedo"),
        ("--method reference --noise 0.5@2", "knows no noise"),
        ("--light image:", "image:FILE"),
        ("--light image:-1:sky.hdr", "at least 0"),
    ] {
        folder.render(&format!("{CLOUD} {words} -o a.png")).fails(2, &[part]);
    }
    folder.render(&format!("{CLOUD} --voxel 1e-7 -o a.png")).fails(2, &["grid"]);
    folder
        .render(&format!("{CLOUD} --eye 0,0,500 --look-at 0,0,900 -o a.png"))
        .fails(3, &["nothing of the medium"]);
    folder
        .render("synthetic:packed?n=9 --background sky -o a.png")
        .fails(2, &["--background", "--light image"]);
    assert!(!folder.path("a.png").exists());
}

#[test]
fn what_is_odd_but_possible_is_defined() {
    let folder = Folder::new();
    // One length for a cloud that is smaller: every grid point meets every particle.
    let said = folder
        .render("synthetic:cloud2?n=500 --mode medium --grid 16 --smoothing uniform --h0 300 -o a.png -v")
        .fine();
    assert!(said.contains("larger than the scene"), "{said}");
    folder.render(&format!("{CLOUD} --light point:0,0,0:90 --light sky:0.1 -o inside.png")).fine();
    assert!(brightness(&folder, "inside.png") > 1.0);
    let mut rows = String::from("x,y,z,mass\n");
    for k in 0..200 {
        rows += &format!("{},{},{},0\n", k % 6, k / 6 % 6, k / 36);
    }
    folder.file("weightless.csv", &rows);
    folder
        .render("weightless.csv --mode medium -o b.png")
        .fails(3, &["density is 0 everywhere", "--weight one"]);
    folder.file("one.csv", "x,y,z\n1,2,3\n");
    folder.render("one.csv --mode medium --h0 0.5 --grid 16 -o c.png").fine();
    folder.render("one.csv --mode medium --grid 16 -o d.png").fails(2, &["smoothing length"]);
    folder.render("synthetic:cloud2?n=0 --mode medium -o d.png").fails(2, &["particle"]);
}

#[test]
fn what_does_not_fit_the_memory_says_what_would() {
    let folder = Folder::new();
    for more in ["", " --dry-run"] {
        folder
            .render(&format!("{CLOUD} --grid 900 --memory 60M -o a.png{more}"))
            .fails(4, &["x900 samples needs", "are available", "samples along the longest axis fits"]);
    }
    let photons = format!("{CLOUD} --cache photons --photons 2e6 --memory 30M -o a.png");
    folder.render(&photons).fails(4, &["scatterings of 2000000 photons", "--photons ", "--photon-passes"]);
    folder.render(&photons.replace("2e6", "2e4 --photon-passes 3")).fine();
    assert_eq!(folder.names(), ["a.png"]);
}

#[test]
fn a_dry_run_says_what_it_would_take_and_writes_nothing() {
    let folder = Folder::new();
    let ran = folder.render(&format!("{CLOUD} -o a.%d.png --orbit 90 --frame-count 5 --dry-run"));
    assert_eq!(ran.code, 0, "{ran:?}");
    for part in [
        "dry run: grid 32x",
        "memory at most",
        "time without reading about",
        "for 5 views",
        "nothing written",
    ] {
        assert!(ran.out.contains(part), "'{part}' is not in: {ran:?}");
    }
    folder.file("block.raw", [0_u8; 256]);
    folder.file("a.toml", SCENE);
    assert!(folder.render("a.toml -o a.png --dry-run").out.contains("dry run: grid 4x4x4"));
    assert_eq!(folder.names(), ["a.toml", "block.raw"]);
}

#[test]
fn a_frame_of_a_medium_that_fails_does_not_stop_the_others() {
    let folder = Folder::new();
    let good = |shift: usize| {
        let row = |k: usize| format!("{},{},{}\n", k % 5 + shift, k / 5 % 5, k / 25);
        String::from("x,y,z\n") + &(0..125).map(row).collect::<String>()
    };
    folder.file("a.csv", good(0));
    folder.file("b.csv", good(0).replace("3,2,1", "3,2,oops"));
    folder.file("c.csv", good(1));
    let flags = "--mode medium --grid 16 --size 32x24 --samples 1";
    let ran = folder.render(&format!("a.csv b.csv c.csv {flags} -o out.%d.png --statistics s.%d.json"));
    assert_eq!(ran.code, 6, "{ran:?}");
    assert!(ran.err.contains("error[E-partial]: 1 of 3 pictures failed, 2 were written"), "{ran:?}");
    let made = ["out.0.png", "out.2.png", "s.0.json", "s.2.json"];
    assert_eq!(folder.names()[3..], made);
    // The camera of the first frame is kept, so that the second picture is not the first.
    assert_ne!(png(&folder.path("out.0.png")).0, png(&folder.path("out.2.png")).0);

    let said = folder.render(&format!("a.csv b.csv c.csv {flags} -o out.%d.png --skip-existing"));
    assert!(said.err.contains("note: 2 pictures there already") && said.code == 6, "{said:?}");
    assert_eq!(folder.render(&format!("b.csv b.csv {flags} -o bad.%d.png")).code, 3);
    folder
        .render(&format!("a.csv c.csv {flags} -o out.%d.png --statistics s.json"))
        .fails(2, &["--statistics", "%04d"]);
}

#[test]
fn statistics_of_the_density_are_told_as_json() {
    let folder = Folder::new();
    folder.render(&format!("{CLOUD} --neighbors 40 --further-passes 2 -o a.png --statistics s.json")).fine();
    let text = std::fs::read_to_string(folder.path("s.json")).unwrap();
    let it: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(
        (&it["smoothing"], &it["neighbors"], &it["particles"]),
        (&"three-pass".into(), &40.into(), &4000.into())
    );
    assert_eq!((&it["further_passes"], &it["grid"]["size"][0]), (&2.into(), &32.into()));
    let full = &it["used"]["full"];
    let [mean, deviation, ratio] = ["mean", "deviation", "ratio"].map(|key| full[key].as_f64().unwrap());
    assert!((mean / 40.0 - 1.0).abs() < 0.1 && (deviation / mean - ratio).abs() < 1e-9, "{full}");
    assert!(it["used"]["touched"]["points"].as_u64() > full["points"].as_u64());
    assert!(it["h0"].as_f64() > Some(0.0) && it["grid"]["mass"].as_f64() > Some(0.0));
}

/// A Radiance picture of 64 x 32 pixels, `light` all over.
pub(super) fn hdr(light: [u8; 4]) -> Vec<u8> {
    [b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 32 +X 64\n", &light.repeat(64 * 32)[..]].concat()
}

#[test]
fn a_picture_of_the_sky_is_a_light() {
    let folder = Folder::new();
    folder.file("block.raw", [1.0_f32; 64].iter().flat_map(|it| it.to_le_bytes()).collect::<Vec<u8>>());
    // 128 * 2^(127 - 136) = 0.25.
    folder.file("even.hdr", hdr([128, 128, 128, 127]));
    let image = SCENE.replace("kind = 'sky'\nradiance = 0.25", "kind = 'image'\nfile = 'even.hdr'");
    folder.file("a.toml", &image);
    // Balls of photons are as wide as a fourth of the block, and reach from its border inward only, where more light was scattered before.
    for (more, most) in
        [("", 1.0), ("--method reference --samples 64", 1.0), ("--cache photons --photons 20000", 2.0)]
    {
        folder.render(&format!("a.toml -o a.png {more}")).fine();
        let found = brightness(&folder, "a.png");
        // Without absorption the block is invisible in it: 0.25 is 137 in sRGB.
        assert!((found - 137.0).abs() < most, "{more}: {found}");
    }
    folder.render("a.toml -o b.png --light image:3:even.hdr").fine();
    assert!(brightness(&folder, "b.png") > 200.0, "four times the light");
    folder.render("a.toml -o c.png --light image:no.hdr").fails(3, &["no.hdr"]);
    folder.file("bad.hdr", "P6");
    folder
        .render("a.toml -o c.png --light image:bad.hdr")
        .fails(3, &["bad.hdr", "neither an EXR nor an HDR"]);
}

#[test]
fn particles_beyond_the_memory_are_read_in_parts_for_the_same_picture() {
    let folder = Folder::new();
    let many =
        "synthetic:cloud2?n=8e4 --mode medium --grid 32 --up 0,1,0 --size 64x48 --samples 1 --cache single";
    folder.render(&format!("{many} -o whole.png")).fine();
    let said = folder.render(&format!("{many} --memory 4M -o parts.png -v")).fine();
    for part in ["read in parts", "80,000 particles", "readings of the source"] {
        assert!(said.contains(part), "'{part}' is not in: {said}");
    }
    assert_eq!(png(&folder.path("parts.png")).0, png(&folder.path("whole.png")).0);
    for more in [
        "--clip x>0.1L",
        "--weight age",
        "--emission blackbody:5000*age",
        "--emission age --select age<0.5 --clip y>0 --select index>100",
    ] {
        folder.render(&format!("{many} -o whole.png {more}")).fine();
        let said = folder.render(&format!("{many} --memory 4M -o parts.png -v {more}")).fine();
        assert!(said.contains("read in parts"), "{said}");
        assert_eq!(png(&folder.path("parts.png")).0, png(&folder.path("whole.png")).0, "{more}");
    }
    for (more, said) in [("--smoothing scatter", "do not fit the memory"), ("--weight hue", "hue")] {
        folder.render(&format!("{many} --memory 4M -o no.png {more}")).fails(2, &[said]);
    }
    // A table of places and masses, of which no cell is known.
    let mut header = "{'descr': '<f4', 'fortran_order': False, 'shape': (20000, 5), }".to_string();
    header += &" ".repeat(117 - header.len());
    let mut bytes = [b"\x93NUMPY\x01\x00\x76\x00", header.as_bytes(), b"\n"].concat();
    for k in 0..20_000_u32 {
        let at = |step: u32| (k.wrapping_mul(step) % 997) as f32 / 997.0;
        [at(17), at(229), at(613), 1.0, at(71)].iter().for_each(|it| bytes.extend(it.to_le_bytes()));
    }
    folder.file("table.npy", bytes);
    let table = "table.npy --mode medium --grid 16 --size 32x24 --samples 1 --cache single";
    folder.render(&format!("{table} -o no.png --memory 0.5M --clip x>0.1L")).fails(2, &["not in L"]);
    let dry = folder.render(&format!("{many} --memory 4M -o no.png --dry-run"));
    assert!(dry.fine().contains("80,000 particles"));
}

#[test]
fn a_dense_core_is_sampled_finer_than_its_tail() {
    let folder = Folder::new();
    let cloud = "synthetic:clustered?n=20000 --mode medium --grid 24 --size 64x48 --samples 1 --cache single";
    let said = folder.render(&format!("{cloud} --finer 2 -o finer.png --statistics finer.json -v")).fine();
    assert!(said.contains("of them finer") && said.contains("finer bricks: "), "{said}");
    let statistics = std::fs::read_to_string(folder.path("finer.json")).unwrap();
    let levels =
        serde_json::from_str::<serde_json::Value>(&statistics).unwrap()["grid"]["bricks"]["finer"].clone();
    assert!(levels[1].as_u64() > Some(0) && levels[2] == 0, "{levels}");
    let said = folder.render(&format!("{cloud} -o even.png -v")).fine();
    assert!(!said.contains("finer"), "{said}");
    assert_ne!(png(&folder.path("finer.png")).0, png(&folder.path("even.png")).0);
    folder.render(&format!("{cloud} --finer 4 -o no.png")).fails(2, &["--finer", "3"]);
    folder
        .render(&format!("{cloud} --finer 1 --smoothing scatter -o no.png"))
        .fails(2, &["finer", "take a gather"]);
}
