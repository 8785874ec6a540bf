//! How fast structures are built: `build/<structure>/<law>`, in particles a second.

use divan::Bencher;
use divan::counter::ItemsCount;
use tyndall::structure::{Kind, Structure, pkd};
use tyndall::synthetic;

fn main() {
    divan::main();
}

const LAWS: [&str; 3] = ["packed?n=1e6", "uniform?n=1e6", "clustered?n=1e6"];

fn build(bencher: Bencher, law: &str, kind: Kind) {
    let particles = synthetic::generate(law, &()).expect("a known law");
    let radii = particles.radii().expect("synthetic particles have a radius").clone();
    bencher.counter(ItemsCount::new(particles.len())).with_inputs(|| particles.clone()).bench_values(
        |particles| Structure::build(kind, particles, &radii, 1.0, &()).expect("nobody interrupts"),
    );
}

#[divan::bench(args = LAWS, sample_count = 10)]
fn bvh(bencher: Bencher, law: &str) {
    build(bencher, law, Kind::default());
}

#[divan::bench(args = LAWS, sample_count = 10)]
fn pkd(bencher: Bencher, law: &str) {
    build(bencher, law, Kind::Pkd(pkd::Options::default()));
}
