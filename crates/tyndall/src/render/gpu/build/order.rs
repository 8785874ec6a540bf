//! In which order particles become leaves: along a Hilbert curve, the large ones apart.
//!
//! A run of sixteen along the curve is compact, and so is a run of runs; a Morton code, which jumps, makes boxes twice as large. Particles
//! that are large beside a leaf would inflate the boxes of their neighbors: each power of two of their radius beyond that has a curve
//! of its own.

use glam::Vec3;

use crate::random::Stream;
use crate::structure::Spheres;
use crate::structure::bvh::LEAF;

/// Bits of a coordinate on the curve.
pub(in crate::render::gpu) const CURVE_BITS: u32 = 20;
/// Curves, by radius: as many as the bits left in a key of 64 can tell.
pub(super) const CLASSES: u32 = 16;
/// Particles that decide where the lattice lies.
const SAMPLE: usize = 1 << 14;
/// So many of them count as outliers at either end of an axis: one in so many.
const OUTLIERS: usize = 64;
/// The lattice goes beyond the others by so many times their extent, if there is anything.
const MARGIN: f32 = 8.0;
/// A radius is large beyond so many times the usual width of a leaf.
const GIANT: f32 = 2.0;

/// The lattice of the curve: cubes of one size, of which the outermost go on without end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::render::gpu) struct Order {
    /// Its corner.
    pub(in crate::render::gpu) low: Vec3,
    /// One over the edge of a cell.
    pub(in crate::render::gpu) inv_edge: f32,
    /// Larger radii have curves of their own.
    pub(in crate::render::gpu) giant: f32,
}

impl Order {
    /// Of a sample: single particles far out may lie in one cell, but must not make the cells of all others large.
    pub(super) fn of(spheres: Spheres) -> Self {
        let count = spheres.len();
        let mut stream = Stream::new(1, 0);
        let mut sample: [Vec<f32>; 3] = Default::default();
        for k in 0..count.min(SAMPLE) {
            let id = if count <= SAMPLE { k } else { stream.below(count) };
            let center = spheres.center(id);
            sample.iter_mut().zip(center.to_array()).for_each(|(axis, at)| axis.push(at));
        }
        sample.iter_mut().for_each(|axis| axis.sort_unstable_by(f32::total_cmp));
        let Some(last) = sample[0].len().checked_sub(1) else {
            return Self { low: Vec3::ZERO, inv_edge: 0.0, giant: 0.0 };
        };
        let outliers = sample[0].len() / OUTLIERS;
        let at = |place: usize| Vec3::new(sample[0][place], sample[1][place], sample[2][place]);
        let (inner_low, inner_high) = (at(outliers), at(last - outliers));
        let inner = Some((inner_high - inner_low).max_element()).filter(|&inner| inner > 0.0);
        let inner = inner.unwrap_or((at(last) - at(0)).max_element());
        // What lies close by the sample's ends is not to fall out of the lattice.
        let beyond = inner / OUTLIERS as f32;
        let low = (at(0) - beyond).max(inner_low - MARGIN * inner);
        let high = (at(last) + beyond).min(inner_high + MARGIN * inner);
        let width = (high - low).max_element();
        let cells = (1 << CURVE_BITS) as f32;
        let inv_edge = if width > 0.0 { (cells / width).min(f32::MAX) } else { 0.0 };
        Self { low, inv_edge, giant: GIANT * inner * (LEAF as f32 / count as f32).cbrt() }
    }
}

#[cfg(test)]
impl Order {
    /// By what a particle is sorted: twin of `key_of` in encode.wgsl.
    pub(in crate::render::gpu) fn key(&self, center: Vec3, radius: f32) -> u64 {
        let last = ((1 << CURVE_BITS) - 1) as f32;
        let cell = ((center - self.low) * self.inv_edge).clamp(Vec3::ZERO, Vec3::splat(last));
        let mut class = 0;
        let mut least = self.giant;
        while class < CLASSES - 1 && radius > least {
            class += 1;
            least *= 2.0;
        }
        u64::from(class) << (3 * CURVE_BITS) | crate::curve::hilbert(cell.as_uvec3().to_array(), CURVE_BITS)
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::particles::{Columns, Particles, Positions, Radii};

    fn order_of(columns: [Vec<f32>; 3]) -> Order {
        let positions = Positions::from_offsets(DVec3::ZERO, columns);
        let particles = Particles::new(Columns { positions, ..Columns::default() }).unwrap();
        Order::of(Spheres { particles: &particles, radii: &Radii::Uniform(1.0), radius_scale: 1.0 })
    }

    #[test]
    fn single_particles_far_out_do_not_make_cells_large() {
        let mut stream = Stream::new(3, 0);
        let mut columns: [Vec<f32>; 3] =
            std::array::from_fn(|_| (0..10_000).map(|_| stream.unit()).collect());
        let usual = order_of(columns.clone());
        let edge = 1.0 / usual.inv_edge * (1 << CURVE_BITS) as f32;
        assert!((1.0..1.1).contains(&edge), "{edge}");
        columns[1][77] = 1e9;
        columns[2][78] = -1e12;
        let with_outliers = order_of(columns);
        let ratio = usual.inv_edge / with_outliers.inv_edge;
        assert!((1.0..20.0).contains(&ratio), "{ratio}");
        assert!((with_outliers.giant / usual.giant - 1.0).abs() < 0.01, "{}", with_outliers.giant);
        assert!(with_outliers.key(Vec3::new(0.5, 1e9, 0.5), 0.0) != with_outliers.key(Vec3::splat(0.5), 0.0));
    }

    #[test]
    fn nothing_and_points_that_coincide_have_an_order() {
        let nothing = order_of(Default::default());
        assert_eq!(nothing.inv_edge, 0.0);
        let equal = order_of(std::array::from_fn(|_| vec![0.25; 100]));
        assert_eq!(equal.key(Vec3::splat(0.25), 0.0), 0);
        for scale in [1e-38, 1e30] {
            let line = order_of([vec![0.0, scale], vec![0.0; 2], vec![0.0; 2]]);
            assert!(line.inv_edge.is_finite() && line.inv_edge > 0.0, "{line:?}");
            assert!(line.key(Vec3::X * scale, 0.0) > line.key(Vec3::ZERO, 0.0));
        }
    }

    #[test]
    fn large_radii_are_sorted_apart_by_powers_of_two() {
        let order = Order { low: Vec3::ZERO, inv_edge: 1.0, giant: 0.5 };
        let class = |radius| order.key(Vec3::ZERO, radius) >> 60;
        assert_eq!([0.0, 0.5, 0.51, 1.0, 1.1, 7.9, 1e30].map(class), [0, 0, 1, 1, 2, 4, 15]);
    }
}
