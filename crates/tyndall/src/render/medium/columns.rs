//! How much medium lies between every sample of a lattice and a light without extent: by columns along the light, each of which
//! hands its sum from plane to plane, instead of one march a sample.
//!
//! Columns of a distant light are parallel and cross the planes of the lattice's samples (`parallel.rs`); those of a light at a point
//! spread from it in six pyramids, one a face of a cube around it. A sample looks between four columns, so that shadows stay as
//! sharp as the lattice.

mod parallel;

use glam::{UVec3, Vec3};
use rayon::prelude::*;

use super::field::{Field, sample};
use crate::medium::grid::Lattice;

/// Where light without extent comes from.
#[derive(Clone, Copy, Debug)]
pub(super) enum Source {
    /// From far away, travelling along this direction of unit length.
    Distant(Vec3),
    /// From this point.
    Near(Vec3),
}

/// The integral of `density` between each of its samples and the source.
pub(super) fn thickness(density: &Field, source: Source) -> Field {
    let lattice = density.lattice;
    let position = match source {
        Source::Distant(along) => return parallel::thickness(density, along),
        Source::Near(position) => position,
    };
    let bundles: Vec<Bundle> = (0..6).filter_map(|face| Bundle::pyramid(density, position, face)).collect();
    let look_up = |at: Vec3| {
        let offset = at - position;
        let axis = offset.abs().max_position();
        let ahead = offset[axis] >= 0.0;
        let bundle = bundles.iter().find(|it| it.axis == axis && (it.sign > 0.0) == ahead);
        bundle.map_or(0.0, |bundle| bundle.look_up(at))
    };
    let value = |place: usize| look_up(lattice.position(sample(&lattice, place)));
    let values = (0..lattice.sample_count() as usize).into_par_iter().with_min_len(4096).map(value).collect();
    Field { lattice, values }
}

/// Columns from a light through one face of a cube around it.
struct Bundle {
    position: Vec3,
    /// The axis across the planes, and whether light goes along or against it.
    axis: usize,
    sign: f32,
    /// Distance of planes.
    spacing: f32,
    /// The slopes of the first column, and the distance of the first plane from the light.
    first: Vec3,
    /// Difference of neighbors' slopes.
    step: f32,
    /// Columns across and up, and planes.
    size: [usize; 3],
    /// The sums: columns across fastest, then columns up, then planes.
    sums: Vec<f32>,
}

impl Bundle {
    /// Columns from a point through one face of a cube around it; `None` if the lattice does not reach there.
    fn pyramid(density: &Field, position: Vec3, face: usize) -> Option<Self> {
        let Lattice { origin, spacing, size } = density.lattice;
        let (axis, sign) = (face / 2, if face.is_multiple_of(2) { 1.0 } else { -1.0 });
        let last = origin + spacing * (UVec3::from_array(size) - UVec3::ONE).as_vec3();
        let ends = [origin[axis], last[axis]].map(|end| sign * (end - position[axis]));
        let (near, far) = (ends[0].min(ends[1]).max(0.0), ends[0].max(ends[1]));
        if far <= 0.0 {
            return None;
        }
        // Slopes under which the lattice is seen: the extremes are on its nearest plane, where all are allowed if it is too near.
        let seen = |axis: usize| {
            let (low, high) = (origin[axis] - position[axis], last[axis] - position[axis]);
            let nearest = near.max(1e-3 * spacing);
            let low = if low < 0.0 { low / nearest } else { low / far };
            let high = if high > 0.0 { high / nearest } else { high / far };
            (low.clamp(-1.0, 1.0), high.clamp(-1.0, 1.0))
        };
        let [a, b] = across(axis);
        let ((low_a, high_a), (low_b, high_b)) = (seen(a), seen(b));
        if low_a >= high_a || low_b >= high_b {
            return None;
        }
        let step = (spacing / far).min(0.5);
        let count = |low: f32, high: f32| ((high - low) / step).ceil() as usize + 2;
        // One plane before the lattice, so that sums begin at 0; never before the light.
        let start = (near / spacing).floor() * spacing;
        let planes = ((far - start) / spacing).ceil() as usize + 2;
        let bundle = Self {
            position,
            axis,
            sign,
            spacing,
            first: Vec3::new(low_a, low_b, start),
            step,
            size: [count(low_a, high_a), count(low_b, high_b), planes],
            sums: Vec::new(),
        };
        Some(bundle.filled(density))
    }

    /// Where column (u, v) crosses the plane at `depth`.
    #[inline(always)]
    fn crossing(&self, column: [f32; 2], depth: f32) -> Vec3 {
        let [a, b] = across(self.axis);
        let mut at = self.position;
        at[self.axis] += self.sign * depth;
        at[a] += column[0] * depth;
        at[b] += column[1] * depth;
        at
    }

    /// The column through a point, and the depth of its plane.
    #[inline(always)]
    fn place(&self, at: Vec3) -> ([f32; 2], f32) {
        let [a, b] = across(self.axis);
        let offset = at - self.position;
        let depth = self.sign * offset[self.axis];
        let inv = if depth > 0.0 { 1.0 / depth } else { 0.0 };
        ([offset[a] * inv, offset[b] * inv], depth)
    }

    /// How long a column is between two planes.
    fn length(&self, [u, v]: [f32; 2]) -> f32 {
        self.spacing * (1.0 + u * u + v * v).sqrt()
    }

    /// Sums the density along the columns, plane by plane.
    fn filled(mut self, density: &Field) -> Self {
        let [width, height, planes] = self.size;
        let bounds = density.lattice.bounds();
        let value = |at: Vec3| {
            let inside = at.cmpge(bounds.min).all() && at.cmple(bounds.max).all();
            if inside { density.value(at) } else { 0.0 }
        };
        let rows: Vec<Vec<f32>> = (0..height)
            .into_par_iter()
            .map(|v| {
                let mut sums = vec![0.0; planes * width];
                let mut before = vec![0.0; width];
                for plane in 0..planes {
                    let depth = self.first.z + plane as f32 * self.spacing;
                    let (done, left) = sums.split_at_mut(plane * width);
                    for u in 0..width {
                        let column =
                            [self.first.x + u as f32 * self.step, self.first.y + v as f32 * self.step];
                        let here = value(self.crossing(column, depth));
                        if plane > 0 {
                            let added = 0.5 * self.length(column) * (before[u] + here);
                            left[u] = done[(plane - 1) * width + u] + added;
                        }
                        before[u] = here;
                    }
                }
                sums
            })
            .collect();
        self.sums = vec![0.0; width * height * planes];
        self.sums.par_chunks_mut(width * height).enumerate().for_each(|(plane, sums)| {
            for (row, of_row) in sums.chunks_exact_mut(width).zip(&rows) {
                row.copy_from_slice(&of_row[plane * width..][..width]);
            }
        });
        self
    }

    /// The sum up to a point, between the columns and planes around it.
    #[inline(always)]
    fn look_up(&self, at: Vec3) -> f32 {
        let [width, height, planes] = self.size;
        let ([u, v], depth) = self.place(at);
        let split = |place: f32, count: usize| {
            let place = place.clamp(0.0, (count - 1) as f32);
            let first = (place as usize).min(count.saturating_sub(2));
            (first, place - first as f32)
        };
        let (i, x) = split((u - self.first.x) / self.step, width);
        let (j, y) = split((v - self.first.y) / self.step, height);
        let (k, z) = split((depth - self.first.z) / self.spacing, planes);
        let right = usize::from(width > 1);
        let up = if height > 1 { width } else { 0 };
        let mix = |a: f32, b: f32, t: f32| a + t * (b - a);
        let plane = |k: usize| {
            let at = (k * height + j) * width + i;
            let row = |at: usize| mix(self.sums[at], self.sums[at + right], x);
            mix(row(at), row(at + up), y)
        };
        if z == 0.0 { plane(k) } else { mix(plane(k), plane((k + 1).min(planes - 1)), z) }
    }
}

/// The two other axes.
#[inline(always)]
fn across(axis: usize) -> [usize; 2] {
    [(axis + 1) % 3, (axis + 2) % 3]
}
