//! How fast densities are estimated: `density/<smoothing>/<law>`, in samples of the lattice a second.

use divan::Bencher;
use divan::counter::ItemsCount;
use tyndall::medium::density::{Resolution, Settings, Smoothing, estimate};
use tyndall::random::Stream;
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

/// Trilinear look-ups at random points of the box, as photons make them.
#[divan::bench(sample_count = 20)]
fn look_up(bencher: Bencher) {
    let particles = synthetic::generate("smoke?n=1e5", &()).expect("a known law");
    let settings = Settings { resolution: Resolution::Samples(256), ..Settings::default() };
    let grid = estimate(&particles, &settings, &()).expect("nobody interrupts").density;
    let bounds = grid.bounds();
    let mut stream = Stream::new(1, 0);
    let points: Vec<_> =
        (0..1 << 16).map(|_| bounds.center() + 0.5 * bounds.extent() * stream.cube()).collect();
    let sum = || points.iter().map(|&at| grid.density(at)).sum::<f32>();
    bencher.counter(ItemsCount::new(points.len())).bench(sum);
}
