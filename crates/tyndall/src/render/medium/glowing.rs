//! Matter that gives off light, as a source of photons.
//!
//! Takes a medium with emission, gives photons that start anywhere in it in any direction: on average each place gives off
//! 4 pi times extinction, the share that absorbs, and the radiance of thick matter. A brick is drawn by the most that it may give
//! off, a place in it evenly; the power says what is given off there.

use std::f32::consts::PI;

use glam::Vec3;

use crate::medium::grid::{BRICK, Grid};
use crate::medium::light::Emission as Start;
use crate::medium::{Emission, Medium};
use crate::random::Stream;

/// See the module.
pub(super) struct Glowing<'a> {
    medium: &'a Medium,
    emission: &'a Emission,
    /// Bricks that may give off light, the most that each may, and the sums up to each.
    bricks: Vec<([u32; 3], f64)>,
    sums: Vec<f64>,
    power: Vec3,
}

impl<'a> Glowing<'a> {
    /// `None` if the medium gives off no light.
    pub(super) fn new(medium: &'a Medium) -> Option<Self> {
        let emission = medium.emission()?;
        let grid = medium.density();
        let factor = factor(medium);
        let (mut bricks, mut sums) = (Vec::new(), Vec::new());
        let (mut total, mut power) = (0.0, Vec3::ZERO);
        for number in 0..grid.lattice().brick_count() {
            let brick = grid.lattice().brick(number);
            let most = grid.brick_range(brick).max * (factor * emission.brick_max(brick)).element_sum();
            let extent = grid.brick_bounds(brick).extent();
            if most > 0.0 {
                total += f64::from(most * extent.element_product());
                bricks.push((brick, f64::from(most)));
                sums.push(total);
                power += factor * of_brick(grid, emission, brick);
            }
        }
        let power = 4.0 * PI * power;
        (power != Vec3::ZERO).then_some(Self { medium, emission, bricks, sums, power })
    }

    /// RGB power of all, by the samples.
    pub(super) fn power(&self) -> Vec3 {
        self.power
    }

    /// A photon, with the power that it has if it is the only one.
    pub(super) fn emit(&self, stream: &mut Stream) -> Start {
        let total = self.sums.last().copied().unwrap_or_default();
        let target = stream.unit_f64() * total;
        let number = self.sums.partition_point(|sum| *sum <= target).min(self.bricks.len() - 1);
        let (brick, most) = self.bricks[number];
        let grid = self.medium.density();
        let bounds = grid.brick_bounds(brick);
        let share = Vec3::new(stream.unit(), stream.unit(), stream.unit());
        let origin = bounds.min + share * bounds.extent();
        let given_off = grid.density(origin) * factor(self.medium) * self.emission.radiance(origin);
        let power = 4.0 * PI * (total / most) as f32 * given_off;
        Start { origin, direction: stream.direction(), power }
    }
}

/// Radiance that density 1 adds over length 1 where thick matter has radiance 1.
fn factor(medium: &Medium) -> Vec3 {
    Vec3::from(medium.optics().extinction) * medium.emitting_share()
}

/// The integral of density times radiance over a brick, by its samples.
fn of_brick(grid: &Grid, emission: &Emission, brick: [u32; 3]) -> Vec3 {
    let first = brick.map(|it| it * BRICK);
    let end: [u32; 3] = std::array::from_fn(|axis| (first[axis] + BRICK).min(grid.size()[axis]));
    let mut sum = Vec3::ZERO;
    for k in first[2]..end[2] {
        for j in first[1]..end[1] {
            for i in first[0]..end[0] {
                let density = grid.value(i, j, k);
                if density > 0.0 {
                    sum += density * emission.sample([i, j, k]);
                }
            }
        }
    }
    grid.spacing().powi(3) * sum
}
