//! What holds for every law.

use std::sync::atomic::{AtomicU64, Ordering};

use super::*;

pub(super) fn generated(specification: &str) -> Particles {
    println!("{specification}");
    generate(specification, &()).unwrap()
}

/// The distance to the nearest other particle, for those that have one within `reach`, sorted.
pub(super) fn neighbor_distances(particles: &Particles, reach: f32) -> Vec<f32> {
    let cell = |position: Vec3| (position / reach).floor().as_ivec3();
    let mut cells = std::collections::HashMap::<glam::IVec3, Vec<Vec3>>::new();
    let positions: Vec<Vec3> = (0..particles.len()).map(|id| particles.positions().offset(id)).collect();
    for &position in &positions {
        cells.entry(cell(position)).or_default().push(position);
    }
    let nearest = |id: usize| {
        let around = (0..27).map(|k| glam::IVec3::new(k / 9 - 1, k / 3 % 3 - 1, k % 3 - 1));
        let others = around.filter_map(|offset| cells.get(&(cell(positions[id]) + offset))).flatten();
        let distances = others.map(|other| other.distance(positions[id])).filter(|&it| it > 0.0);
        distances.min_by(f32::total_cmp).filter(|&it| it < reach)
    };
    let mut distances: Vec<f32> = (0..positions.len()).into_par_iter().filter_map(nearest).collect();
    assert!(2 * distances.len() > positions.len(), "most have a neighbor within reach");
    distances.sort_by(f32::total_cmp);
    distances
}

fn in_threads(threads: usize, specification: &str) -> Particles {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| generated(specification))
}

/// Whether the two agree in every bit.
fn same(a: &Particles, b: &Particles) -> bool {
    let bits = |it: &Particles| {
        it.positions().offsets().map(|column| column.iter().map(|it| it.to_bits()).collect::<Vec<_>>())
    };
    bits(a) == bits(b) && a.attributes() == b.attributes() && a.radii() == b.radii()
}

#[test]
fn every_law_gives_exactly_the_count_asked_for() {
    for name in NAMES {
        for count in [0, 1, 2, 17, 1000, 20_003] {
            let particles = generated(&format!("{name}?n={count}&seed=5"));
            assert_eq!(particles.len(), count, "{name}");
            assert_eq!(particles.dropped().total(), 0, "{name}");
            for attribute in particles.attributes() {
                let finite = (0..count).all(|id| attribute.number(id, 0).is_finite());
                assert!(finite, "{name}: {}", attribute.name);
            }
        }
    }
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    for name in NAMES {
        let specification = format!("{name}?n=70000&seed=8");
        assert!(same(&in_threads(1, &specification), &in_threads(2, &specification)), "{name}");
    }
}

#[test]
fn another_seed_gives_another_cloud() {
    for name in NAMES {
        let [a, b] = [1, 2].map(|seed| generated(&format!("{name}?n=1000&seed={seed}")));
        assert!(!same(&a, &b), "{name}");
        let moved = (0..1000).filter(|&id| a.positions().offset(id) != b.positions().offset(id)).count();
        assert!(moved > 500, "{name}: {moved} of 1000 particles differ");
    }
}

#[test]
fn the_seed_is_the_count_unless_given() {
    assert!(same(&generated("nozzle?n=1000"), &generated("nozzle?n=1e3&seed=1000")));
}

#[test]
fn laws_tell_units_attributes_and_cells() {
    let told = |name: &str| {
        let particles = generated(&format!("{name}?n=10"));
        let names: Vec<String> = particles.attributes().iter().map(|it| it.name.clone()).collect();
        (names.join(" "), particles.length_unit().map(String::from), particles.cell().is_some())
    };
    let unit = |unit: &str| Some(unit.to_string());
    for name in ["uniform", "packed", "clustered"] {
        assert_eq!(told(name), (String::new(), None, true), "{name}");
    }
    assert_eq!(told("nozzle"), ("speed age".into(), unit("mm"), false));
    assert_eq!(told("virion"), ("element chain".into(), unit("Å"), false));
    assert_eq!(told("fluid"), ("speed density".into(), unit("m"), false));
    assert_eq!(told("ablation"), ("potential energy speed".into(), unit("sigma"), true));
    assert_eq!(told("cloud1"), ("density age".into(), None, true));
    assert_eq!(told("smoke"), ("density age temperature".into(), None, true));
}

#[test]
fn a_radius_replaces_that_of_the_law() {
    for name in NAMES {
        let particles = generated(&format!("{name}?n=3&radius=0.25"));
        assert_eq!(particles.radii(), Some(&Radii::Uniform(0.25)), "{name}");
        let radii = generated(&format!("{name}?n=1000"));
        let radii: Vec<f32> = (0..1000).map(|id| radii.radius(radii.radii().unwrap(), id)).collect();
        assert!(radii.iter().all(|it| *it > 0.0 && it.is_finite()), "{name}");
    }
}

struct Counting {
    done: AtomicU64,
    limit: u64,
}

impl Progress for Counting {
    fn begin(&self, stage: &str, total: Option<u64>, unit: &'static str) {
        assert_eq!((stage, total, unit), ("generate", Some(300_000), "particles"));
    }
    fn advance(&self, amount: u64) {
        self.done.fetch_add(amount, Ordering::Relaxed);
    }
    fn cancelled(&self) -> bool {
        self.done.load(Ordering::Relaxed) >= self.limit
    }
}

#[test]
fn progress_adds_up_and_can_stop_the_work() {
    let patient = Counting { done: AtomicU64::new(0), limit: u64::MAX };
    assert_eq!(generate("uniform?n=3e5", &patient).unwrap().len(), 300_000);
    assert_eq!(patient.done.into_inner(), 300_000);
    let hasty = Counting { done: AtomicU64::new(0), limit: 1 };
    assert!(matches!(generate("uniform?n=3e5", &hasty), Err(Error::Interrupted)));
}
