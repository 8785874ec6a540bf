//! Streamed densities against those of all particles in memory.

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

use glam::{DVec3, Vec3};

use super::*;
use crate::medium::Grid;
use crate::medium::density::{Resolution, Weight, estimate};
use crate::particles::{Attribute, Columns, Particles, Positions, Values};
use crate::random::Stream;
use crate::source::Source;

/// Particles in memory that pretend not to be, and count how many of them were read.
struct Hidden {
    places: Vec<Vec3>,
    read: AtomicU64,
}

impl Source for Hidden {
    fn len(&self) -> u64 {
        self.places.len() as u64
    }

    fn read(&self, range: Range<u64>, into: &mut Vec<Vec3>) -> Result<()> {
        self.read.fetch_add(range.end - range.start, Ordering::Relaxed);
        into.clear();
        into.extend_from_slice(&self.places[range.start as usize..range.end as usize]);
        Ok(())
    }
}

impl Carrier for Hidden {
    fn part(&self, range: Range<u64>) -> Result<(Vec<Vec3>, Particles)> {
        let places = &self.places[range.start as usize..range.end as usize];
        let centers = places.iter().copied().filter(|it| it.is_finite()).collect();
        self.read.fetch_add(range.end - range.start, Ordering::Relaxed);
        Ok((centers, particles(places, range.start)))
    }
}

/// With masses and a vector, by where they are.
fn particles(places: &[Vec3], first: u64) -> Particles {
    let offsets = [0, 1, 2].map(|axis| places.iter().map(|it| it[axis]).collect());
    let positions = Positions::from_offsets(DVec3::ZERO, offsets);
    let masses = places.iter().map(|it| (it.x - 3.0 * it.y).abs()).collect();
    let flow = places.iter().flat_map(|it| [it.z, it.x * it.y, 1.0 - it.x]).collect();
    let attributes =
        vec![Attribute::new("m", 1, Values::F32(masses)), Attribute::new("flow", 3, Values::F32(flow))];
    Particles::new(Columns { positions, attributes, ..Columns::default() }).unwrap().numbered_from(first)
}

/// Particles of one of four kinds: a cube, a dense core with tails, a plane, a few places. Some are lost.
fn hidden(seed: u64, count: usize) -> Hidden {
    let mut stream = Stream::new(407, seed);
    let place = |k: usize| match seed % 4 {
        _ if k % 100 == 77 => Vec3::NAN,
        0 => stream.cube() + 9.0,
        1 => stream.normal3() * stream.unit().powi(3),
        2 => Vec3::new(stream.unit(), stream.unit(), 0.25),
        _ => Vec3::new(stream.below(4) as f32, stream.below(3) as f32, stream.below(2) as f32) * 0.4,
    };
    Hidden { places: (0..count).map(place).collect(), read: AtomicU64::new(0) }
}

fn in_memory(hidden: &Hidden) -> Particles {
    particles(&hidden.places, 0)
}

/// The bits of all that a density and the fields beside it are, also between samples.
fn bits(volume: &Volume) -> (Lattice, Option<u32>, Vec<[u32; 2]>) {
    let (lattice, [x, y, z]) = (volume.density.lattice(), volume.density.size());
    let grids = std::iter::once(&volume.density).chain(volume.fields.iter().map(|it| &it.product));
    let value = |grid: &Grid, place: u32| {
        let sample = [place % x, place / x % y, place / (x * y)];
        let between = lattice.position(sample) + 0.375 * lattice.spacing;
        [grid.value(sample[0], sample[1], sample[2]), grid.density(between)].map(f32::to_bits)
    };
    let values = grids.flat_map(|grid| (0..x * y * z).map(move |place| value(grid, place)));
    (lattice, volume.length.map(f32::to_bits), values.collect())
}

#[test]
fn a_streamed_density_is_that_of_all_in_memory() {
    let gathers = [Smoothing::ThreePass, Smoothing::Exact, Smoothing::TwoPass, Smoothing::Uniform];
    for seed in 0..12_u64 {
        let mut stream = Stream::new(408, seed);
        let hidden = hidden(seed, [1, 40, 700, 3000][stream.below(4)]);
        let settings = Settings {
            smoothing: gathers[seed as usize / 4],
            kernel: Kernel::NAMES[seed as usize % 3].1,
            neighbors: 1 + stream.below(40) as u32,
            length: [None, Some(0.3)][stream.below(2)],
            resolution: [Resolution::Samples(13), Resolution::Automatic][usize::from(seed == 1)],
            finer: Some(seed as u32 % 3),
            weight: [Weight::One, Weight::Automatic, Weight::Attribute("mass".into())][stream.below(3)]
                .clone(),
            fields: [vec![], vec!["flow".to_string(), "m".into()]][stream.below(2)].clone(),
            ..Settings::default()
        };
        let whole = estimate(&in_memory(&hidden), &settings, &());
        for at_once in [hidden.len(), hidden.len() / 2 + 100] {
            let streamed = stream_by(&hidden, &settings, at_once, &());
            match (&whole, streamed) {
                (Ok(whole), Ok((streamed, lost))) => {
                    assert!(bits(whole) == bits(&streamed), "seed {seed}, {at_once} at once");
                    assert_eq!(whole.statistics, streamed.statistics, "seed {seed}");
                    let names = |volume: &Volume| {
                        volume.fields.iter().map(|it| (it.name.clone(), it.component)).collect::<Vec<_>>()
                    };
                    assert_eq!(names(whole), names(&streamed), "seed {seed}");
                    assert_eq!(lost, hidden.len() / 100 + u64::from(hidden.len() % 100 > 77), "seed {seed}");
                }
                (Err(whole), Err(streamed)) => assert_eq!(whole.to_string(), streamed.to_string()),
                (Ok(_), Err(error)) => {
                    let is_memory = matches!(error, Error::Memory { .. }) && at_once < hidden.len();
                    assert!(is_memory, "seed {seed}: {error}");
                }
                (Err(error), Ok(_)) => panic!("seed {seed}: {error}"),
            }
        }
    }
}

#[test]
fn few_particles_are_held_at_once_and_each_is_gathered_a_few_times() {
    let hidden = hidden(0, 20_000);
    let settings = Settings {
        neighbors: 8,
        length: Some(0.1),
        resolution: Resolution::Samples(33),
        ..Settings::default()
    };
    let whole = estimate(&in_memory(&hidden), &settings, &()).unwrap();
    let (streamed, _) = stream_by(&hidden, &settings, 3000, &()).unwrap();
    assert!(bits(&whole) == bits(&streamed));
    let readings = hidden.read.load(Ordering::Relaxed) / hidden.len();
    assert!((8..40).contains(&readings), "{readings} readings");
    let altered = Settings { neighbors: 9, ..settings };
    assert!(bits(&whole) != bits(&stream_by(&hidden, &altered, 3000, &()).unwrap().0));
}

#[test]
fn what_must_be_in_memory_is_refused() {
    let hidden = hidden(0, 500);
    let refuses = |what: &str, settings: Settings| {
        let error = stream(&hidden, &settings, &()).err().unwrap();
        assert!(matches!(error, Error::Setting { .. }) && error.to_string().contains(what), "{error}");
    };
    refuses("scatter", Settings { smoothing: Smoothing::Scatter, ..Settings::default() });
    refuses("heat", Settings { fields: vec!["heat".into()], ..Settings::default() });
    refuses("hat", Settings { weight: Weight::Attribute("hat".into()), ..Settings::default() });
    refuses("components", Settings { weight: Weight::Attribute("flow".into()), ..Settings::default() });
    refuses("neighbors", Settings { neighbors: 0, ..Settings::default() });
    let none = Hidden { places: vec![Vec3::NAN; 3], read: AtomicU64::new(0) };
    assert!(stream(&none, &Settings::default(), &()).is_err());
    let wide = Settings { length: Some(50.0), resolution: Resolution::Samples(40), ..Settings::default() };
    let error = stream_by(&hidden, &wide, 100, &()).err().unwrap().to_string();
    assert!(error.contains("495 particles within 50 of a brick"), "{error}");
    let small = Settings { memory_bytes: Some(1 << 10), ..Settings::default() };
    assert!(matches!(stream(&hidden, &small, &()), Err(Error::Memory { .. })));
    let (lattice, bytes) = plan_stream(&hidden, &Settings::default(), &()).unwrap();
    let volume = stream(&hidden, &Settings::default(), &()).unwrap().0;
    assert_eq!((lattice, bytes), (volume.density.lattice(), volume.peak_bytes));
}
