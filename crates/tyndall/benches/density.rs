//! How fast densities are estimated: `density/<smoothing>/<law>`, in samples of the lattice a second.

use divan::Bencher;
use divan::counter::ItemsCount;
use tyndall::medium::density::{Resolution, Settings, Smoothing, estimate};
use tyndall::synthetic;

fn main() {
    divan::main();
}

const LAWS: [&str; 3] = ["smoke?n=1e5", "uniform?n=1e5", "clustered?n=1e5"];

fn density(bencher: Bencher, law: &str, smoothing: Smoothing) {
    let particles = synthetic::generate(law, &()).expect("a known law");
    let settings = Settings { smoothing, resolution: Resolution::Samples(96), ..Settings::default() };
    let volume = estimate(&particles, &settings, &()).expect("nobody interrupts");
    bencher
        .counter(ItemsCount::new(volume.density.lattice().sample_count()))
        .bench(|| estimate(&particles, &settings, &()).expect("nobody interrupts"));
}

#[divan::bench(args = LAWS, sample_count = 10)]
fn uniform(bencher: Bencher, law: &str) {
    density(bencher, law, Smoothing::Uniform);
}

#[divan::bench(args = LAWS, sample_count = 10)]
fn two_pass(bencher: Bencher, law: &str) {
    density(bencher, law, Smoothing::TwoPass);
}

#[divan::bench(args = LAWS, sample_count = 10)]
fn three_pass(bencher: Bencher, law: &str) {
    density(bencher, law, Smoothing::ThreePass);
}

#[divan::bench(args = LAWS, sample_count = 10)]
fn exact(bencher: Bencher, law: &str) {
    density(bencher, law, Smoothing::Exact);
}

#[divan::bench(args = LAWS, sample_count = 10)]
fn scatter(bencher: Bencher, law: &str) {
    density(bencher, law, Smoothing::Scatter);
}
