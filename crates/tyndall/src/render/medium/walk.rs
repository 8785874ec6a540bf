//! The way of a ray through a grid: its bricks, and the cells in them, in the order in which the ray meets them.
//!
//! All is in units of the lattice, with distances along the ray in world units: a ray is cut to the medium's box first, so that
//! a camera far away costs no digits. Source: J. Amanatides, A. Woo, "A fast voxel traversal algorithm", Eurographics 1987.

use glam::Vec3;

use crate::math::Ray;
use crate::medium::Medium;
use crate::medium::grid::{BRICK, EDGE, Grid, STORED};

/// A ray within the medium's box.
#[derive(Clone, Copy)]
pub(super) struct Path {
    /// Where it enters, in lattice units.
    start: Vec3,
    /// Its way in lattice units per unit length.
    direction: Vec3,
    inv_direction: Vec3,
    /// Distance along the ray at which it enters.
    pub(super) enter: f32,
    /// How far it goes inside.
    pub(super) length: f32,
}

impl Path {
    /// The part of `ray` inside the medium; `None` if it misses it.
    #[inline(always)]
    pub(super) fn new(medium: &Medium, ray: &Ray) -> Option<Self> {
        let grid = medium.density();
        let [enter, leave] = medium.bounds().clip(ray)?;
        let inv_spacing = 1.0 / grid.spacing();
        Some(Self {
            start: (ray.origin + enter * ray.direction - grid.origin()) * inv_spacing,
            direction: ray.direction * inv_spacing,
            inv_direction: ray.inv_direction() * grid.spacing(),
            enter,
            length: leave - enter,
        })
    }

    /// The point at a distance from where the path enters.
    #[inline(always)]
    pub(super) fn at(&self, distance: f32) -> Vec3 {
        self.start + distance * self.direction
    }

    /// The bricks that the path meets.
    #[inline(always)]
    pub(super) fn bricks(&self, grid: &Grid) -> Steps {
        let high = grid.bricks().map(|count| count as i32 - 1);
        Steps::new(self, [0.0, self.length], BRICK as f32, [[0; 3], high])
    }
}

/// A brick as look-ups need it.
pub(super) struct Brick<'a> {
    samples: &'a [f32; STORED],
    /// Lattice coordinates of its first sample.
    first: Vec3,
    /// The last place, from its first sample, at which look-ups do not clamp.
    limit: Vec3,
    /// The first and the last cell, counted from its first sample; -1 is the border before the lattice.
    cells: [[i32; 3]; 2],
}

impl<'a> Brick<'a> {
    #[inline(always)]
    pub(super) fn new(grid: &'a Grid, brick: [u32; 3]) -> Self {
        let first = brick.map(|it| (it * BRICK) as i32);
        let last = std::array::from_fn(|axis| (grid.size()[axis] as i32 - 1 - first[axis]).min(BRICK as i32));
        Self {
            samples: grid.brick_samples(brick),
            first: Vec3::from(first.map(|it| it as f32)),
            limit: Vec3::from(last.map(|it: i32| it as f32)),
            cells: [first.map(|it| -i32::from(it == 0)), last.map(|it| it.min(BRICK as i32 - 1))],
        }
    }

    /// The field at a point of the lattice inside the brick.
    #[inline(always)]
    pub(super) fn density(&self, at: Vec3) -> f32 {
        let place = (at - self.first).max(Vec3::ZERO).min(self.limit);
        let cell = [place.x, place.y, place.z].map(|it| (it as i32).min(BRICK as i32 - 1));
        let fraction = place - Vec3::from(cell.map(|it| it as f32));
        interpolate(&self.corners(cell), fraction)
    }

    /// The cells that `path` meets between two distances within the brick.
    #[inline(always)]
    pub(super) fn steps(&self, path: &Path, between: [f32; 2]) -> Steps {
        let inside = Path { start: path.start - self.first, ..*path };
        Steps::new(&inside, between, 1.0, self.cells)
    }

    /// The field at two distances along `path` in one cell.
    #[inline(always)]
    pub(super) fn pair(&self, path: &Path, cell: [i32; 3], distances: [f32; 2]) -> [f32; 2] {
        let cell = cell.map(|it| it.max(0));
        let corners = self.corners(cell);
        let base = Vec3::from(cell.map(|it| it as f32));
        let limit = (self.limit - base).min(Vec3::ONE);
        let fraction = |distance: f32| (path.at(distance) - self.first - base).max(Vec3::ZERO).min(limit);
        [interpolate(&corners, fraction(distances[0])), interpolate(&corners, fraction(distances[1]))]
    }

    #[inline(always)]
    fn corners(&self, cell: [i32; 3]) -> [f32; 8] {
        // The masks change nothing: they show the compiler that no index lies outside.
        let [x, y, z] = cell.map(|it| it as usize & (BRICK as usize - 1));
        let at = (z * EDGE + y) * EDGE + x;
        let (y, z) = (EDGE, EDGE * EDGE);
        let samples = self.samples;
        [
            samples[at],
            samples[at + 1],
            samples[at + y],
            samples[at + y + 1],
            samples[at + z],
            samples[at + z + 1],
            samples[at + z + y],
            samples[at + z + y + 1],
        ]
    }
}

/// Trilinear, with the corners numbered like [`Grid::corners`].
#[inline(always)]
fn interpolate(corners: &[f32; 8], fraction: Vec3) -> f32 {
    crate::medium::grid::trilinear(corners, fraction)
}

/// A piece of a path: which brick or cell, and the distances between which the path is in it.
#[derive(Clone, Copy)]
pub(super) struct Step {
    pub(super) at: [i32; 3],
    pub(super) from: f32,
    pub(super) to: f32,
}

/// The bricks or cells of a path, in order.
pub(super) struct Steps {
    at: [i32; 3],
    /// Distance of the next boundary on each axis, and from one to the next.
    next: [f32; 3],
    delta: [f32; 3],
    way: [i32; 3],
    /// Boundaries left on each axis.
    left: [i32; 3],
    from: f32,
    end: f32,
}

impl Steps {
    /// Boxes of `edge` along a path between two distances, those from `range[0]` to `range[1]`; the outermost have no far side.
    #[inline(always)]
    fn new(path: &Path, between: [f32; 2], edge: f32, range: [[i32; 3]; 2]) -> Self {
        let (start, inverse) = (path.at(between[0]).to_array(), path.inv_direction.to_array());
        let origin = path.start.to_array();
        let mut steps = Self {
            at: [0; 3],
            next: [f32::INFINITY; 3],
            delta: [0.0; 3],
            way: [1; 3],
            left: [0; 3],
            from: between[0],
            end: between[1],
        };
        for axis in 0..3 {
            let [low, high] = [range[0][axis], range[1][axis]];
            let at = ((start[axis] / edge).floor() as i32).clamp(low, high);
            let forward = inverse[axis] > 0.0;
            steps.at[axis] = at;
            steps.way[axis] = if forward { 1 } else { -1 };
            steps.left[axis] = if forward { high - at } else { at - low };
            steps.delta[axis] = edge * inverse[axis].abs();
            let side = edge * (at + i32::from(forward)) as f32;
            if steps.left[axis] > 0 {
                steps.next[axis] = (side - origin[axis]) * inverse[axis];
            }
        }
        steps
    }
}

impl Iterator for Steps {
    type Item = Step;

    #[inline(always)]
    fn next(&mut self) -> Option<Step> {
        if self.from >= self.end {
            return None;
        }
        let at = self.at;
        let axis = if self.next[0] < self.next[1] {
            if self.next[0] < self.next[2] { 0 } else { 2 }
        } else if self.next[1] < self.next[2] {
            1
        } else {
            2
        };
        // Rounding may put a boundary before the last one: the piece is then empty.
        let from = self.from;
        let to = self.next[axis].max(from).min(self.end);
        self.from = to;
        self.at[axis] += self.way[axis];
        self.left[axis] -= 1;
        self.next[axis] =
            if self.left[axis] > 0 { self.next[axis] + self.delta[axis] } else { f32::INFINITY };
        Some(Step { at, from, to })
    }
}
