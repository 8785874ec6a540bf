//! Regular tracking: the column of a ray, the integral of the density along it, exact to rounding, brick by brick and cell by cell.
//!
//! Takes rays, gives columns, the transmittance that follows from them, and the places where a column is reached. Along a ray the
//! trilinear field of a cell is a cubic polynomial: Simpson's rule integrates it without error, Newton's method finds where the
//! integral has a value. Where light is only added, density times radiance is of degree six: four points of Gauss do the same.
//! Invariant: columns never fall along a ray.

use glam::Vec3;

use super::free_path::{Tracker, chances, pick};
use super::walk::{Brick, Path, Step};
use crate::math::Ray;

/// Places between 0 and 1 and weights of the rule of Gauss and Legendre that integrates degree seven exactly.
const GAUSS: [[f32; 2]; 4] = [
    [0.069_431_84, 0.173_927_42],
    [0.330_009_5, 0.326_072_58],
    [0.669_990_52, 0.326_072_58],
    [0.930_568_16, 0.173_927_42],
];

/// A ray's way through a medium, integrated.
#[derive(Default)]
pub(super) struct Crossing {
    path: Path,
    /// The bricks that hold any density, and the column before each.
    bricks: Vec<(Step, f32)>,
    /// The whole ray's column.
    pub(super) column: f32,
}

/// Where following a path ended.
pub(super) enum Reached {
    /// Where its column has the wanted value.
    At { distance: f32 },
    /// At its end, with that column.
    End { column: f32 },
}

impl Tracker<'_> {
    /// The column of `ray`: the integral of the density along it, exact to rounding.
    pub fn column(&self, ray: &Ray) -> f32 {
        let Some(path) = Path::new(self.medium, ray) else { return 0.0 };
        match self.advance(&path, f32::INFINITY) {
            Reached::End { column } => column,
            Reached::At { .. } => f32::INFINITY,
        }
    }

    /// RGB share of the light that goes through along `ray`, exact to rounding.
    pub fn transmittance(&self, ray: &Ray) -> Vec3 {
        self.through(self.column(ray))
    }

    /// RGB share of the light that goes through a column.
    #[inline(always)]
    pub(super) fn through(&self, column: f32) -> Vec3 {
        if self.is_grey {
            return Vec3::splat((-self.greatest * column).exp());
        }
        Vec3::from_array((-self.extinction * column).to_array().map(f32::exp))
    }

    /// The light that a medium adds along `ray` where nothing absorbs it: the integral of extinction times radiance.
    pub(super) fn added(&self, ray: &Ray) -> Vec3 {
        let (Some(emission), Some(path)) = (self.medium.emission(), Path::new(self.medium, ray)) else {
            return Vec3::ZERO;
        };
        let grid = self.medium.density();
        let mut sum = Vec3::ZERO;
        for step in path.bricks(grid).filter(|step| !self.is_empty(step)) {
            let density = Brick::new(grid, step.brick());
            let even = emission.one_radiance().unwrap_or(Vec3::ONE);
            let glow = [0, 1, 2].map(|it| emission.channel(it).map(|grid| Brick::new(grid, step.brick())));
            for cell in density.steps(&path, [step.from, step.to]) {
                let length = cell.to - cell.from;
                for [share, weight] in GAUSS {
                    let at = path.at(cell.from + share * length);
                    let of_channel = |glow: &Option<Brick>| glow.as_ref().map_or(1.0, |it| it.density(at));
                    let radiance = even * Vec3::from(glow.each_ref().map(of_channel));
                    sum += weight * length * density.density(at) * radiance;
                }
            }
        }
        Vec3::from(self.medium.optics().extinction) * sum
    }

    /// Integrates along `ray`, and keeps what [`Tracker::forced`] needs.
    pub(super) fn cross(&self, ray: &Ray, crossing: &mut Crossing) {
        crossing.bricks.clear();
        crossing.column = 0.0;
        let Some(path) = Path::new(self.medium, ray) else { return };
        crossing.path = path;
        for step in path.bricks(self.medium.density()) {
            if self.is_empty(&step) {
                continue;
            }
            crossing.bricks.push((step, crossing.column));
            if let Reached::End { column } = self.in_brick(&path, &step, crossing.column, f32::INFINITY) {
                crossing.column = column;
            }
        }
    }

    /// A distance along a ray at which light interacts, given that it does before it leaves, and its weight; for two random
    /// numbers in [0, 1). The ray's column must not be 0.
    pub(super) fn forced(&self, crossing: &Crossing, random: [f32; 2]) -> (f32, Vec3) {
        let met = Vec3::ONE - self.through(crossing.column);
        let chance = chances(met);
        let channel = if self.is_grey { 0 } else { pick(chance, random[1]) };
        let target = -(-random[0] * met[channel]).ln_1p() / self.extinction[channel];
        let weight = if self.is_grey {
            met
        } else {
            let density = self.extinction * self.through(target);
            density / (chance * density / met.max(Vec3::splat(f32::MIN_POSITIVE))).element_sum()
        };
        let place = crossing.bricks.partition_point(|(_, column)| *column <= target).max(1) - 1;
        let (step, column) = &crossing.bricks[place];
        let distance = match self.in_brick(&crossing.path, step, *column, target) {
            Reached::At { distance } => distance,
            // The target lies in the brick, but for rounding.
            Reached::End { .. } => step.to,
        };
        (crossing.path.enter + distance, weight)
    }

    /// Follows `path` until its column is `target`, or to its end.
    pub(super) fn advance(&self, path: &Path, target: f32) -> Reached {
        let mut sum = 0.0;
        for step in path.bricks(self.medium.density()) {
            if self.is_empty(&step) {
                continue;
            }
            match self.in_brick(path, &step, sum, target) {
                Reached::End { column } => sum = column,
                reached @ Reached::At { .. } => return reached,
            }
        }
        Reached::End { column: sum }
    }

    /// Whether there is no density in a brick.
    #[inline(always)]
    fn is_empty(&self, step: &Step) -> bool {
        self.medium.density().piece_range(step.brick()).max == 0.0
    }

    /// Follows `path` through a brick, from the column that it has there, until it is `target` or to the brick's end.
    #[inline(always)]
    fn in_brick(&self, path: &Path, step: &Step, column: f32, target: f32) -> Reached {
        let Step { from, to, .. } = *step;
        let (grid, brick) = (self.medium.density(), step.brick());
        let range = grid.piece_range(brick);
        // A brick of one density is one cell.
        if range.min == range.max {
            let added = range.max * (to - from);
            if column + added >= target {
                return Reached::At { distance: (from + (target - column) / range.max).min(to) };
            }
            return Reached::End { column: column + added };
        }
        let samples = Brick::new(grid, brick);
        let mut column = column;
        let mut near = samples.density(path.at(from));
        for cell in samples.steps(path, [from, to]) {
            let length = cell.to - cell.from;
            // Along a ray the field of a cell is a cubic: three points integrate it exactly (Simpson's rule).
            let [center, far] = samples.pair(path, cell.at, [cell.from + 0.5 * length, cell.to]);
            let added = length / 6.0 * (near + 4.0 * center + far);
            if column + added >= target && added > 0.0 {
                let [quarter, _] = samples.pair(path, cell.at, [cell.from + 0.25 * length; 2]);
                let share = solve([near, quarter, center, far], (target - column) / length);
                return Reached::At { distance: cell.from + share * length };
            }
            column += added;
            near = far;
        }
        Reached::End { column }
    }
}

/// The place in [0, 1] up to which the cubic with those values at 0, 1/4, 1/2 and 1, none negative between, integrates to
/// `target`: Newton's method, kept within the interval where the integral crosses it.
fn solve([near, quarter, center, far]: [f32; 4], target: f32) -> f32 {
    let (end, middle, first) = (far - near, center - near, quarter - near);
    let linear = (64.0 * first - 24.0 * middle + 2.0 * end) / 6.0;
    let square = 8.0 * middle - end - 3.0 * linear;
    let cube = end - linear - square;
    let value = |x: f32| near + x * (linear + x * (square + x * cube));
    let integral = |x: f32| x * (near + x * (linear / 2.0 + x * (square / 3.0 + x * cube / 4.0)));
    let (mut low, mut high) = (0.0, 1.0);
    let mean = near / 6.0 + center * (4.0 / 6.0) + far / 6.0;
    let mut x = (target / mean).clamp(0.0, 1.0);
    for _ in 0..32 {
        let error = integral(x) - target;
        if error > 0.0 {
            high = x
        } else {
            low = x
        }
        let slope = value(x);
        let newton = x - error / slope;
        let next = if slope > 0.0 && newton > low && newton < high { newton } else { 0.5 * (low + high) };
        if (next - x).abs() < 1e-6 {
            return next;
        }
        x = next;
    }
    x
}
