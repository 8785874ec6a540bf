//! Single rays, one asked after the other on every thread: how fast a structure answers where no rays go together.

use std::time::Instant;

use rayon::prelude::*;
use tyndall::Vec3;
use tyndall::math::{Bounds, Ray};
use tyndall::random::Stream;
use tyndall::scene::camera::View;
use tyndall::structure::Structure;

use super::median;

/// Rays that share nothing, so many.
pub(super) const INCOHERENT: u64 = 1 << 18;
/// Rays that a thread takes at a time, at least.
const LEAST_SHARE: usize = 256;
/// How often each set of rays is asked; the median counts.
const RUNS: usize = 3;

/// The rays through the centers of all pixels, row by row.
pub(crate) fn coherent(view: &View, width: u32, height: u32) -> Vec<Ray> {
    let row = |y: u32| (0..width).map(move |x| view.ray(x as f32 + 0.5, y as f32 + 0.5));
    (0..height).flat_map(row).collect()
}

/// From random points around a box to random points in it; of the unit cube the law of `benches/embree/spheres.cpp`.
pub(crate) fn incoherent(bounds: &Bounds, count: u64) -> Vec<Ray> {
    let (center, extent) = (bounds.center(), bounds.extent());
    let ray = |number| {
        let mut stream = Stream::new(1, number);
        let origin = center + 2.0 * extent.max_element() * stream.direction();
        let target = bounds.min + extent * Vec3::new(stream.unit(), stream.unit(), stream.unit());
        Ray { origin, direction: (target - origin).normalize(), t_min: 0.0, t_max: f32::INFINITY }
    };
    (0..count).map(ray).collect()
}

/// Rays answered in a microsecond by all threads, so millions in a second.
pub(crate) fn rate(structure: &Structure, rays: &[Ray]) -> f64 {
    let secs = || {
        let start = Instant::now();
        let rays = rays.par_iter().with_min_len(LEAST_SHARE);
        // What is counted is not wanted, but has to be found.
        std::hint::black_box(rays.filter(|ray| structure.intersect(ray, None).is_some()).count());
        start.elapsed().as_secs_f64()
    };
    1e-6 * rays.len() as f64 / median((0..RUNS).map(|_| secs()).collect())
}
