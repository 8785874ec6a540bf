//! What pictures of a medium will cost, roughly: by counts, from rates measured on two cores of a server (BENCHMARKS.md).

use tyndall::medium::density::{Settings, Smoothing};
use tyndall::medium::grid::Lattice;
use tyndall::render::medium::march;
use tyndall::render::medium::photons::STORED_BYTES;

/// What is asked for.
pub(crate) struct Work {
    pub(crate) lattice: Lattice,
    /// Of the density: at one time, and what it leaves.
    pub(crate) density_bytes: u64,
    pub(crate) density_secs: f64,
    pub(crate) picture: march::Settings,
    pub(crate) is_reference: bool,
    /// Photons to emit.
    pub(crate) photons: u64,
}

/// Samples of the lattice that a thread fills in a second, where particles are about as many as samples that they reach.
const DENSITY_RATES: [(Smoothing, f64); 5] = [
    (Smoothing::Uniform, 8.0e6),
    (Smoothing::TwoPass, 4.0e6),
    (Smoothing::ThreePass, 4.0e6),
    (Smoothing::Exact, 1.5e6),
    (Smoothing::Scatter, 1.2e6),
];
/// Bytes of the sample of a lattice: density, lit brick, transmittance and its sums.
const SAMPLE_BYTES: u64 = 40;
/// Bytes of a pixel: sums, means, the image and the file's channels.
const PIXEL_BYTES: u64 = 200;
/// Seconds of a thread for the cache by sweeps, and for each sample of the lattice beside it.
const LIGHT_SECS: [f64; 2] = [0.6, 6e-8];
/// Seconds of a thread a step of the march, a sample of the path tracer, a photon.
const STEP_SECS: f64 = 1.2e-8;
const PATH_SECS: f64 = 4e-6;
const PHOTON_SECS: f64 = 6e-7;
/// Scatterings that are stored of a photon.
const SCATTERINGS: u64 = 2;

/// Seconds that a density takes on so many threads.
pub(crate) fn density_seconds(settings: &Settings, lattice: &Lattice, threads: usize) -> f64 {
    let rate = DENSITY_RATES.iter().find(|(smoothing, _)| *smoothing == settings.smoothing);
    lattice.sample_count() as f64 / rate.map_or(1e6, |(_, rate)| *rate) / threads as f64
}

impl Work {
    /// The most memory at one time.
    pub(crate) fn memory_bytes(&self) -> u64 {
        let march::Settings { width, height, .. } = self.picture;
        let light = SAMPLE_BYTES * self.lattice.sample_count() + SCATTERINGS * STORED_BYTES * self.photons;
        let light = if self.is_reference { 4 * self.lattice.sample_count() } else { light };
        self.density_bytes.max(light) + PIXEL_BYTES * u64::from(width) * u64::from(height)
    }

    /// Seconds of the first picture, and of each further one of the same medium in the same light.
    pub(crate) fn seconds(&self, threads: usize) -> [f64; 2] {
        let march::Settings { width, height, samples, step, .. } = self.picture;
        let rays = f64::from(width) * f64::from(height) * f64::from(samples);
        let across = f64::from(self.lattice.size.into_iter().max().unwrap_or(1));
        // About half of the rays meet the medium, each in half of its length.
        let picture = match self.is_reference {
            true => PATH_SECS * rays,
            false => 0.25 * STEP_SECS * rays * across / f64::from(step),
        };
        let [fixed, each] = LIGHT_SECS;
        let light = fixed + each * self.lattice.sample_count() as f64 + PHOTON_SECS * self.photons as f64;
        let light = if self.is_reference { 0.0 } else { light };
        let threads = threads as f64;
        [self.density_secs + (light + picture) / threads, picture / threads]
    }
}
