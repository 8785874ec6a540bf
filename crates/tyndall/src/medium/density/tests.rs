//! Densities against brute force in double precision, and what holds for all of them.

use glam::{DVec3, Vec3};

use super::*;
use crate::particles::{Attribute, Columns, Positions, Values};
use crate::random::Stream;

/// Particles of one of four kinds: a cube, a dense core with tails, a plane, a few places.
fn places(seed: u64, count: usize) -> Vec<Vec3> {
    let mut stream = Stream::new(404, seed);
    let place = |_| match seed % 4 {
        0 => stream.cube(),
        1 => stream.normal3() * stream.unit().powi(4) * 0.7,
        2 => Vec3::new(stream.unit(), stream.unit(), 0.25),
        _ => Vec3::new(stream.below(4) as f32, stream.below(3) as f32, stream.below(2) as f32) * 0.4,
    };
    (0..count).map(place).collect()
}

fn particles(places: &[Vec3], attributes: &[(&str, &[f32])]) -> Particles {
    let offsets = [0, 1, 2].map(|axis| places.iter().map(|it| it[axis]).collect());
    let attribute = |&(name, values): &(&str, &[f32])| Attribute::new(name, 1, Values::F32(values.to_vec()));
    let positions = Positions::from_offsets(DVec3::ZERO, offsets);
    let attributes = attributes.iter().map(attribute).collect();
    Particles::new(Columns { positions, attributes, ..Columns::default() }).unwrap()
}

fn settings(smoothing: Smoothing, length: f32, neighbors: u32) -> Settings {
    let lattice = Lattice { origin: Vec3::new(-1.1, -1.0, -0.7), spacing: 0.15, size: [17, 14, 9] };
    let (length, resolution) = (Some(length), Resolution::Lattice(lattice));
    Settings { smoothing, length, neighbors, resolution, ..Settings::default() }
}

/// What a sample should be.
struct Sample {
    density: f64,
    whole: usize,
    used: usize,
    /// Whether a particle lies so near to a length that rounding decides.
    doubtful: bool,
}

/// The definitions, particle by particle.
fn oracle(places: &[Vec3], weights: &[f32], settings: &Settings, at: Vec3) -> Sample {
    let distances: Vec<f64> = places.iter().map(|it| it.as_dvec3().distance(at.as_dvec3())).collect();
    let weigh = |h: f64| -> f64 {
        let weights = distances.iter().zip(weights);
        weights.map(|(d, &w)| f64::from(w) * settings.kernel.shape(d / h)).sum::<f64>()
            * settings.kernel.normalization()
            / h.powi(3)
    };
    let within = |h: f64| distances.iter().filter(|&&it| it <= h).count();
    let near_to = |h: f64| distances.iter().any(|it| (it - h).abs() < 2e-5 * h);
    let (h0, target) = (f64::from(settings.length.unwrap()), settings.neighbors as usize);
    let n0 = within(h0);
    let mut doubtful = near_to(h0);
    if n0 == 0 {
        return Sample { density: 0.0, whole: 0, used: 0, doubtful };
    }
    let mut h = h0;
    if settings.smoothing != Smoothing::Uniform && n0 > target {
        let mut bracket = (0.0, 0, h0, n0);
        let narrow = |bracket: &mut (f64, usize, f64, usize), h: f64, n: usize| {
            *bracket = if n < target { (h, n, bracket.2, bracket.3) } else { (bracket.0, bracket.1, h, n) };
            let share = (target - bracket.1) as f64 / (bracket.3 - bracket.1) as f64;
            (bracket.0.powi(3) + share * (bracket.2.powi(3) - bracket.0.powi(3))).cbrt()
        };
        h = narrow(&mut bracket, h0, n0);
        let passes = if settings.smoothing == Smoothing::TwoPass { 0 } else { 1 + settings.further_passes };
        for pass in 0..passes {
            doubtful |= near_to(h);
            let n = within(h);
            if n == target {
                break;
            }
            let alpha = 1.0 - f64::from(settings.scale) * n as f64 / n0 as f64;
            h = narrow(&mut bracket, h, n) * if pass == 0 && n > target { alpha } else { 1.0 };
        }
        let mut halve = false;
        while within(h) == 0 {
            doubtful |= near_to(h);
            let next = narrow(&mut bracket, h, 0);
            h = if halve { (0.5 * (bracket.0.powi(3) + bracket.2.powi(3))).cbrt() } else { next };
            halve = true;
        }
    }
    if settings.smoothing == Smoothing::Exact && n0 >= target {
        let mut sorted = distances.clone();
        sorted.sort_by(f64::total_cmp);
        h = sorted[target - 1];
        let used = within(h * (1.0 + 1e-6));
        return Sample { density: weigh(h), whole: n0, used, doubtful };
    }
    doubtful |= near_to(h);
    let (density, used) = (weigh(h), within(h));
    Sample { density, whole: n0, used, doubtful }
}

/// How many samples of the grid differ from brute force, of how many that are not doubtful.
fn differing(places: &[Vec3], weights: &[f32], settings: &Settings, volume: &Volume) -> (usize, usize) {
    let Resolution::Lattice(lattice) = settings.resolution else { panic!("a lattice") };
    let (mut differing, mut sure) = (0, 0);
    for place in 0..lattice.sample_count() as u32 {
        let [x, y, _] = lattice.size;
        let sample = [place % x, place / x % y, place / (x * y)];
        let wanted = oracle(places, weights, settings, lattice.position(sample));
        let found = f64::from(volume.density.value(sample[0], sample[1], sample[2]));
        sure += usize::from(!wanted.doubtful);
        let differs = (found - wanted.density).abs() > 2e-3 * wanted.density.abs() + 1e-5;
        differing += usize::from(!wanted.doubtful && differs);
    }
    (differing, sure)
}

#[test]
fn densities_are_those_of_brute_force() {
    let kinds = Smoothing::NAMES.iter().filter(|(_, it)| *it != Smoothing::Scatter);
    for (name, smoothing) in kinds {
        for seed in 0..8 {
            let mut stream = Stream::new(9, seed);
            let count = 1 + stream.below(900);
            let places = places(seed, count);
            let weights: Vec<f32> = (0..count).map(|_| stream.range(0.5, 2.0)).collect();
            let cloud = particles(&places, &[("mass", &weights)]);
            let neighbors = 1 + stream.below(50) as u32;
            let mut settings = settings(*smoothing, stream.range(0.2, 1.2), neighbors);
            settings.kernel = Kernel::NAMES[seed as usize % 3].1;
            if *smoothing == Smoothing::ThreePass {
                settings.further_passes = seed as u32 % 3;
                settings.scale = [0.0, 0.3][seed as usize / 4];
            }
            let volume = estimate(&cloud, &settings, &()).unwrap();
            let (differing, sure) = differing(&places, &weights, &settings, &volume);
            // On few places many distances are equal, and all lengths that follow from them doubtful.
            assert!(sure > if seed % 4 == 3 { 0 } else { 1900 }, "{name} seed {seed}: {sure}");
            assert!(differing <= sure / 500, "{name} seed {seed}: {differing} of {sure} differ");
        }
    }
}

#[test]
fn a_changed_weight_raises_the_alarm() {
    let places = places(0, 300);
    let mut weights = vec![1.0; 300];
    let settings = settings(Smoothing::ThreePass, 0.6, 20);
    let volume = estimate(&particles(&places, &[("mass", &weights)]), &settings, &()).unwrap();
    assert_eq!(differing(&places, &weights, &settings, &volume).0, 0);
    weights[7] = 3.0;
    assert!(differing(&places, &weights, &settings, &volume).0 > 0);
}

#[test]
fn statistics_count_what_brute_force_counts() {
    let places = places(1, 700);
    let weights = vec![1.0; places.len()];
    for (name, smoothing) in Smoothing::NAMES.iter().filter(|(_, it)| *it != Smoothing::Scatter) {
        let settings = settings(*smoothing, 0.5, 24);
        let volume = estimate(&particles(&places, &[]), &settings, &()).unwrap();
        let Resolution::Lattice(lattice) = settings.resolution else { panic!("a lattice") };
        let mut wanted = Statistics::default();
        for place in 0..lattice.sample_count() as u32 {
            let [x, y, _] = lattice.size;
            let at = lattice.position([place % x, place / x % y, place / (x * y)]);
            let sample = oracle(&places, &weights, &settings, at);
            wanted.add(sample.whole as u32, sample.used as u32, 24);
        }
        let [found, wanted] = [volume.statistics, wanted];
        for (found, wanted) in [(found.touched, wanted.touched), (found.full, wanted.full)] {
            assert_eq!(found.samples(), wanted.samples(), "{name}");
            assert!((found.mean() - wanted.mean()).abs() < 0.02, "{name}: {found:?} for {wanted:?}");
            assert!(
                (found.deviation() - wanted.deviation()).abs() < 0.05,
                "{name}: {found:?} for {wanted:?}"
            );
        }
        if *smoothing == Smoothing::Exact {
            assert_eq!((found.full.mean(), found.full.deviation()), (24.0, 0.0));
        }
    }
}

/// What is left of mass that should be conserved: rounded distances count where a kernel is steep.
const ROUNDING: f64 = 1e-4;

#[test]
fn the_scatter_conserves_mass() {
    for seed in 0..16 {
        let mut stream = Stream::new(77, seed);
        let count = 1 + stream.below(800);
        let places = places(seed, count);
        let masses: Vec<f32> = (0..count).map(|_| stream.range(0.0, 3.0)).collect();
        let lengths: Vec<f32> = (0..count).map(|_| (2.0 * stream.unit() - 1.0).max(0.0)).collect();
        let all = [("mass", &masses[..]), ("h", &lengths[..])];
        let mass: f64 = masses.iter().map(|&it| f64::from(it)).sum();
        for attributes in [&all[..1], &all[..]] {
            let finest = if seed == 0 { Resolution::Automatic } else { Resolution::Voxel(0.11) };
            for resolution in [Resolution::Samples(9), Resolution::Samples(30), finest] {
                let kernel = Kernel::NAMES[seed as usize % 3].1;
                let settings = Settings {
                    smoothing: Smoothing::Scatter,
                    resolution,
                    kernel,
                    neighbors: 16,
                    ..Settings::default()
                };
                // A single particle reaches nowhere, so that no lattice follows from it.
                let Ok(volume) = estimate(&particles(&places, attributes), &settings, &()) else {
                    assert!(count == 1 || seed % 4 == 3, "seed {seed}");
                    continue;
                };
                let found = volume.density.mass();
                assert!(
                    (found - mass).abs() <= ROUNDING * mass,
                    "seed {seed} {resolution:?}: {found} for {mass}"
                );
            }
        }
    }
}

#[test]
fn the_scatter_spreads_one_particle_as_its_kernel_says() {
    let lattice = Lattice { origin: Vec3::splat(-2.0), spacing: 0.1, size: [41; 3] };
    let mut settings = settings(Smoothing::Scatter, 1.0, 32);
    settings.resolution = Resolution::Lattice(lattice);
    let at = Vec3::new(0.03, -0.02, 0.01);
    let volume =
        estimate(&particles(&[at, Vec3::splat(9.0)], &[("h", &[1.5, 1.0])]), &settings, &()).unwrap();
    assert!(volume.notes.iter().any(|it| it.contains("1 particles lie outside")), "{:?}", volume.notes);
    for sample in [[20, 20, 20], [10, 20, 20], [20, 31, 24], [20, 20, 36]] {
        let q = f64::from(lattice.position(sample).distance(at)) / 1.5;
        let wanted = settings.kernel.normalization() * settings.kernel.shape(q) / 1.5_f64.powi(3);
        let found = f64::from(volume.density.value(sample[0], sample[1], sample[2]));
        assert!((found - wanted).abs() < 1e-3 * wanted + 1e-6, "{sample:?}: {found} for {wanted}");
    }
}

#[test]
fn fields_are_weighted_means() {
    let places = places(0, 500);
    let masses: Vec<f32> = places.iter().map(|it| 1.5 + it.x).collect();
    let temperatures: Vec<f32> = places.iter().map(|it| 300.0 + 100.0 * it.y).collect();
    let constant = vec![-7.0; places.len()];
    let cloud = particles(&places, &[("mass", &masses), ("t", &temperatures), ("constant", &constant)]);
    for (name, smoothing) in Smoothing::NAMES {
        let mut settings = settings(smoothing, 0.5, 20);
        settings.fields = vec!["t".into(), "constant".into()];
        let volume = estimate(&cloud, &settings, &()).unwrap();
        let [temperature, constant] = &volume.fields[..] else { panic!("two fields") };
        for at in [Vec3::ZERO, Vec3::new(0.3, -0.4, 0.2), Vec3::new(-0.5, 0.5, 0.1)] {
            let mean = temperature.mean(&volume.density, at).unwrap();
            assert!((mean - 300.0 - 100.0 * at.y).abs() < 25.0, "{name} at {at}: {mean}");
            let mean = constant.mean(&volume.density, at).unwrap();
            assert!((mean + 7.0).abs() < 1e-3, "{name} at {at}: {mean}");
        }
        assert_eq!(temperature.mean(&volume.density, Vec3::splat(50.0)), None);
    }
}

#[test]
fn threads_change_nothing() {
    let places = places(1, 3000);
    let cloud = particles(&places, &[]);
    for (name, smoothing) in Smoothing::NAMES {
        let settings = settings(smoothing, 0.5, 20);
        let by = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let volume = pool.install(|| estimate(&cloud, &settings, &())).unwrap();
            let [x, y, z] = volume.density.size();
            let samples =
                (0..x * y * z).map(|place| volume.density.value(place % x, place / x % y, place / (x * y)));
            (samples.map(f32::to_bits).collect::<Vec<_>>(), volume.statistics)
        };
        assert!(by(1) == by(3), "{name}");
    }
}

#[test]
fn few_particles_have_a_density() {
    for (name, smoothing) in Smoothing::NAMES {
        for places in [vec![Vec3::ZERO], vec![Vec3::ONE; 100], (0..5).map(|k| Vec3::X * k as f32).collect()] {
            let mut settings = settings(smoothing, 2.0, 64);
            settings.resolution = Resolution::Voxel(0.25);
            let volume = estimate(&particles(&places, &[]), &settings, &()).unwrap();
            let (mass, count) = (volume.density.mass(), places.len() as f64);
            assert!(volume.density.max().is_finite() && volume.density.max() > 0.0, "{name}");
            // With N* at one place adaptive lengths are as short as the distance from it: no mass is conserved.
            if places.len() < 64 {
                assert!((mass / count - 1.0).abs() < 0.02, "{name}: {mass} of {count}");
            }
        }
    }
}

#[test]
fn a_length_larger_than_the_scene_meets_every_particle() {
    let places = places(0, 200);
    for smoothing in [Smoothing::Uniform, Smoothing::ThreePass, Smoothing::Exact] {
        let volume = estimate(&particles(&places, &[]), &settings(smoothing, 1e4, 300), &()).unwrap();
        let used = volume.statistics.touched;
        assert_eq!((used.samples(), used.mean(), used.deviation()), (17 * 14 * 9, 200.0, 0.0));
        assert!(volume.notes.iter().any(|it| it.contains("larger than the scene")), "{:?}", volume.notes);
    }
}

#[test]
fn weights_of_zero_leave_an_empty_grid() {
    let places = places(0, 200);
    let settings = settings(Smoothing::ThreePass, 0.5, 20);
    let volume = estimate(&particles(&places, &[("mass", &[0.0; 200])]), &settings, &()).unwrap();
    assert_eq!((volume.density.max(), volume.density.stored_bricks()[0]), (0.0, 0));
    assert!(volume.statistics.touched.samples() > 0);
}

#[test]
fn what_makes_no_density_is_refused() {
    let places = places(0, 100);
    let cloud = particles(&places, &[("bad", &[f32::NAN; 100]), ("negative", &[-1.0; 100])]);
    let good = settings(Smoothing::ThreePass, 0.5, 20);
    let refuses = |what: &str, settings: Settings| {
        let error = estimate(&cloud, &settings, &()).err();
        assert!(matches!(error, Some(Error::Setting { .. })), "{what}: {error:?}");
    };
    refuses("length", Settings { length: Some(0.0), ..good.clone() });
    refuses("length", Settings { length: Some(f32::NAN), ..good.clone() });
    refuses("neighbors", Settings { neighbors: 0, ..good.clone() });
    refuses("scale", Settings { scale: 1.0, ..good.clone() });
    refuses("passes", Settings { further_passes: 17, ..good.clone() });
    refuses("voxel", Settings { resolution: Resolution::Voxel(0.0), ..good.clone() });
    refuses("samples", Settings { resolution: Resolution::Samples(1), ..good.clone() });
    for name in ["bad", "negative", "absent"] {
        refuses(name, Settings { weight: Weight::Attribute(name.into()), ..good.clone() });
        let scatter = Settings { smoothing: Smoothing::Scatter, ..good.clone() };
        refuses(name, Settings { particle_length: Some(name.into()), ..scatter });
    }
    refuses("field", Settings { fields: vec!["absent".into()], ..good.clone() });
    refuses("field", Settings { fields: vec!["bad".into()], ..good.clone() });
    let at_one_place = particles(&[Vec3::ONE; 100], &[]);
    assert!(estimate(&at_one_place, &Settings::default(), &()).is_err());
    assert!(estimate(&particles(&[], &[]), &good, &()).is_err());
}

#[test]
fn a_grid_beyond_memory_is_refused_and_one_that_fits_is_named() {
    let places = places(0, 1000);
    let cloud = particles(&places, &[]);
    let settings = |samples, memory_bytes| Settings {
        length: Some(0.05),
        resolution: Resolution::Samples(samples),
        memory_bytes: Some(memory_bytes),
        ..Settings::default()
    };
    let error = estimate(&cloud, &settings(5000, 100 << 20), &()).err().unwrap();
    let Error::Memory { needed_bytes, available_bytes, hint, .. } = &error else { panic!("{error}") };
    assert!(needed_bytes > available_bytes, "{error}");
    let samples: u32 = hint.split_whitespace().find_map(|it| it.parse().ok()).unwrap();
    let volume = estimate(&cloud, &settings(samples, 100 << 20), &()).unwrap();
    assert!(
        volume.peak_bytes <= 100 << 20 && volume.density.size().contains(&samples),
        "{}",
        volume.peak_bytes
    );
    let few = estimate(&cloud, &settings(50, 1000), &()).err().unwrap();
    assert!(matches!(few, Error::Memory { .. }), "{few}");
}

#[test]
fn work_can_be_interrupted() {
    struct Stop;
    impl Progress for Stop {
        fn begin(&self, _: &str, _: Option<u64>, _: &'static str) {}
        fn advance(&self, _: u64) {}
        fn cancelled(&self) -> bool {
            true
        }
    }
    let cloud = particles(&places(0, 100), &[]);
    assert!(matches!(estimate(&cloud, &Settings::default(), &Stop), Err(Error::Interrupted)));
}

/// The middle of the dense ball, within a brick of [`settings`]' lattice.
const CORE: Vec3 = Vec3::new(0.45, -0.1, 0.0);

/// A dense ball in a thin one.
fn core_and_tail(count: usize) -> Vec<Vec3> {
    let mut stream = Stream::new(31, 4);
    let place = |k: usize| {
        let (radius, center) = if k.is_multiple_of(2) { (0.2, CORE) } else { (0.9, Vec3::ZERO) };
        center + radius * stream.unit().cbrt() * stream.direction()
    };
    (0..count).map(place).collect()
}

#[test]
fn finer_bricks_are_where_lengths_are_short_and_right_there() {
    let places = core_and_tail(4000);
    let cloud = particles(&places, &[]);
    let even = settings(Smoothing::ThreePass, 0.5, 32);
    let finer = Settings { finer: Some(3), ..even.clone() };
    let [even, finer] = [even, finer].map(|settings| (estimate(&cloud, &settings, &()).unwrap(), settings));
    assert!(even.0.density.levels()[1..] == [0; 3] && finer.0.density.levels()[0] > 0);
    assert!(finer.0.notes.iter().any(|it| it.contains("finer bricks")), "{:?}", finer.0.notes);
    let brick = |at: Vec3| finer.0.density.cell_point(at).unwrap().cell.map(|it| it / 8);
    assert_eq!(finer.0.density.level(brick(CORE)), 3);
    // Along a line through the core, against the definition.
    let weights = vec![1.0; places.len()];
    let mut errors = [0.0_f64; 2];
    let mut greatest = 0.0_f64;
    for step in 0..60 {
        let at = CORE + Vec3::new(0.25 * (step as f32 / 30.0 - 1.0), 0.01, -0.007);
        let wanted = oracle(&places, &weights, &finer.1, at).density;
        greatest = greatest.max(wanted);
        for (error, volume) in errors.iter_mut().zip([&finer.0, &even.0]) {
            *error += (f64::from(volume.density.density(at)) - wanted).abs() / 60.0;
        }
    }
    assert!(errors[0] < 0.06 * greatest && errors[0] < 0.4 * errors[1], "{errors:?} of {greatest}");
    // The lattice's own samples hold what the finer ones do.
    let density = &finer.0.density;
    let [x, y, z] = density.size();
    let sum: f64 =
        (0..x * y * z).map(|place| f64::from(density.value(place % x, place / x % y, place / (x * y)))).sum();
    let mass = sum * f64::from(density.spacing()).powi(3);
    assert!((mass / density.mass() - 1.0).abs() < 0.1, "{mass} {}", density.mass());
}

#[test]
fn bricks_are_parted_by_themselves_only_where_the_lattice_is_automatic_and_memory_allows() {
    let cloud = particles(&core_and_tail(3000), &[]);
    let levels = |settings: Settings| estimate(&cloud, &settings, &()).unwrap().density.levels();
    let coarse = settings(Smoothing::ThreePass, 0.5, 20);
    assert_eq!(levels(coarse.clone())[1..], [0; 3]);
    let unlimited = levels(Settings { finer: Some(2), ..coarse.clone() });
    assert!(unlimited[2] > 0 && unlimited[3] == 0, "{unlimited:?}");
    let limited = levels(Settings { finer: Some(2), memory_bytes: Some(1 << 20), ..coarse.clone() });
    assert_eq!(limited[1..], [0; 3]);
    let refused = |settings: Settings| estimate(&cloud, &settings, &()).err().unwrap().to_string();
    assert!(refused(Settings { finer: Some(4), ..coarse.clone() }).contains("from 0 to 3"));
    let scatter = Settings { finer: Some(1), smoothing: Smoothing::Scatter, ..coarse };
    assert!(refused(scatter).contains("take a gather"));
}
