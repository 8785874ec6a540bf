//! The way of a ray through a grid: its bricks, and the cells in them, in the order in which the ray meets them.
//!
//! All is in units of the lattice, with distances along the ray in world units: a ray is cut to the medium's box first, so that
//! a camera far away costs no digits. Whole numbers are kept as floats, so that all three axes are one register. Source: J. Amanatides, A. Woo, "A fast voxel traversal algorithm", Eurographics 1987.

use glam::{Vec3A, Vec4, Vec4Swizzles};

use crate::math::{Bounds, Ray};
use crate::medium::Medium;
use crate::medium::grid::{BRICK, EDGE, Grid, Piece, STORED};

/// A ray within the medium's box.
#[derive(Clone, Copy, Default)]
pub(super) struct Path {
    /// Where it enters, in lattice units.
    pub(super) start: Vec3A,
    /// Its way in lattice units per unit length.
    pub(super) direction: Vec3A,
    pub(super) inv_direction: Vec3A,
    /// Distance along the ray at which it enters.
    pub(super) enter: f32,
    /// How far it goes inside.
    pub(super) length: f32,
}

impl Path {
    /// The part of `ray` inside the medium; `None` if it misses it.
    #[inline(always)]
    pub(super) fn new(medium: &Medium, ray: &Ray) -> Option<Self> {
        Self::within(&medium.bounds(), medium.density(), ray)
    }

    /// The part of `ray` inside a box, in units of the lattice of `grid`; `None` if it misses the box.
    #[inline(always)]
    pub(super) fn within(bounds: &Bounds, grid: &Grid, ray: &Ray) -> Option<Self> {
        let [enter, leave] = bounds.clip(ray)?;
        let inv_spacing = 1.0 / grid.spacing();
        Some(Self {
            start: Vec3A::from((ray.origin + enter * ray.direction - grid.origin()) * inv_spacing),
            direction: Vec3A::from(ray.direction * inv_spacing),
            inv_direction: Vec3A::from(ray.inv_direction() * grid.spacing()),
            enter,
            length: leave - enter,
        })
    }

    /// The point at a distance from where the path enters.
    #[inline(always)]
    pub(super) fn at(&self, distance: f32) -> Vec3A {
        self.start + distance * self.direction
    }

    /// How far along the path it leaves the box between two corners in which it is, in lattice units.
    #[inline(always)]
    pub(super) fn leave(&self, low: Vec3A, high: Vec3A) -> f32 {
        let forward = self.inv_direction.cmpgt(Vec3A::ZERO);
        ((Vec3A::select(forward, high, low) - self.start) * self.inv_direction).min_element()
    }

    /// The bricks that the path meets, the finest there are.
    #[inline(always)]
    pub(super) fn bricks<'a>(&'a self, grid: &'a Grid) -> Bricks<'a> {
        let high = grid.bricks().map(|count| (count - 1) as f32);
        let steps = Steps::new(self, [0.0, self.length], BRICK as f32, [Vec3A::ZERO, Vec3A::from(high)]);
        Bricks { path: self, grid, steps, parts: None }
    }

    /// The same in units of a lattice with so many samples for one, from a place in it.
    #[inline(always)]
    fn finer(&self, parts: f32, first: Vec3A) -> Self {
        Self {
            start: parts * self.start - first,
            direction: parts * self.direction,
            inv_direction: self.inv_direction / parts,
            ..*self
        }
    }
}

/// A brick as look-ups need it.
pub(super) struct Brick<'a> {
    samples: &'a [f32; STORED],
    /// Its samples in a spacing of the lattice. What follows is in units of its own spacing.
    parts: f32,
    /// Coordinates of its first sample.
    first: Vec3A,
    /// The last place, from its first sample, at which look-ups do not clamp.
    limit: Vec3A,
}

/// The last cell of a brick along an axis.
const LAST_CELL: Vec3A = Vec3A::splat((BRICK - 1) as f32);

impl<'a> Brick<'a> {
    #[inline(always)]
    pub(super) fn new(grid: &'a Grid, brick: Piece) -> Self {
        let (samples, Piece { at, level }) = grid.piece_samples(brick);
        let parts = (1 << level) as f32;
        let first = Vec3A::from(at.map(|it| (it * BRICK) as f32));
        let last = parts * Vec3A::from(grid.size().map(|size| (size - 1) as f32));
        Self { samples, parts, first, limit: (last - first).min(LAST_CELL + 1.0) }
    }

    /// The field at a point of the lattice inside the brick.
    #[inline(always)]
    pub(super) fn density(&self, at: Vec3A) -> f32 {
        let place = (self.parts * at - self.first).max(Vec3A::ZERO).min(self.limit);
        let cell = place.floor().min(LAST_CELL);
        self.cell(cell).interpolate(place - cell)
    }

    /// The cells that `path` meets between two distances within the brick.
    #[inline(always)]
    pub(super) fn steps(&self, path: &Path, between: [f32; 2]) -> Steps {
        let inside = path.finer(self.parts, self.first);
        // The border before the lattice is a cell of its own, -1, and so is the one behind its last sample.
        let low = Vec3A::select(self.first.cmpeq(Vec3A::ZERO), Vec3A::NEG_ONE, Vec3A::ZERO);
        Steps::new(&inside, between, 1.0, [low, self.limit.min(LAST_CELL)])
    }

    /// The field at two distances along `path` in one cell.
    #[inline(always)]
    pub(super) fn pair(&self, path: &Path, cell: Vec3A, distances: [f32; 2]) -> [f32; 2] {
        let cell = cell.max(Vec3A::ZERO);
        let (corners, limit) = (self.cell(cell), (self.limit - cell).min(Vec3A::ONE));
        let Path { start, direction, .. } = path.finer(self.parts, self.first);
        let start = start - cell;
        let field =
            |distance: f32| corners.interpolate((start + distance * direction).max(Vec3A::ZERO).min(limit));
        [field(distances[0]), field(distances[1])]
    }

    /// The samples at the corners of a cell.
    #[inline(always)]
    fn cell(&self, cell: Vec3A) -> Corners {
        const Y: usize = EDGE;
        const Z: usize = EDGE * EDGE;
        // Exact in floats. The bound changes nothing: it shows the compiler that no index lies outside.
        let at = cell.dot(Vec3A::new(1.0, Y as f32, Z as f32)) as usize;
        let at = at.min(STORED - 1 - Z - Y - 1);
        let samples = self.samples;
        Corners {
            low: Vec4::new(samples[at], samples[at + Y], samples[at + Z], samples[at + Z + Y]),
            high: Vec4::new(
                samples[at + 1],
                samples[at + Y + 1],
                samples[at + Z + 1],
                samples[at + Z + Y + 1],
            ),
        }
    }
}

/// The corners of a cell on its low and high side of x; on each side by y, then by z.
struct Corners {
    low: Vec4,
    high: Vec4,
}

impl Corners {
    /// Trilinear, with the steps of [`crate::medium::grid::trilinear`].
    #[inline(always)]
    fn interpolate(&self, fraction: Vec3A) -> f32 {
        let by_x = self.low + fraction.x * (self.high - self.low);
        let (low, high) = (by_x.xz(), by_x.yw());
        let by_y = low + fraction.y * (high - low);
        by_y.x + fraction.z * (by_y.y - by_y.x)
    }
}

/// A piece of a path: which brick or cell, and the distances between which the path is in it.
#[derive(Clone, Copy)]
pub(super) struct Step {
    /// Whole numbers.
    pub(super) at: Vec3A,
    pub(super) from: f32,
    pub(super) to: f32,
    /// The level of a brick.
    level: u32,
}

impl Step {
    /// The brick.
    #[inline(always)]
    pub(super) fn brick(&self) -> Piece {
        Piece { at: self.at.to_array().map(|it| it as u32), level: self.level }
    }
}

/// The bricks of a path, in order: those of the lattice, or their parts.
pub(super) struct Bricks<'a> {
    path: &'a Path,
    grid: &'a Grid,
    steps: Steps,
    /// Those of the present brick, and their level.
    parts: Option<(Steps, u32)>,
}

impl Iterator for Bricks<'_> {
    type Item = Step;

    #[inline(always)]
    fn next(&mut self) -> Option<Step> {
        loop {
            if let Some((steps, level)) = &mut self.parts {
                if let Some(step) = steps.next() {
                    return Some(Step { level: *level, ..step });
                }
                self.parts = None;
            }
            let step = self.steps.next()?;
            if self.grid.is_even() {
                return Some(step);
            }
            let brick = step.brick().at;
            match self.grid.level(brick) {
                0 => return Some(step),
                level => self.parts = Some((self.parts_of(brick, level, [step.from, step.to]), level)),
            }
        }
    }
}

impl Bricks<'_> {
    /// The parts of a brick between two distances.
    fn parts_of(&self, brick: [u32; 3], level: u32, between: [f32; 2]) -> Steps {
        let end: [u32; 3] = std::array::from_fn(|axis| {
            // Behind the last sample of the lattice there are no parts.
            let last = ((self.grid.size()[axis] - 1) << level) / BRICK;
            (((brick[axis] + 1) << level) - 1).min(last)
        });
        let [low, high] = [brick.map(|it| it << level), end].map(|it| Vec3A::from(it.map(|it| it as f32)));
        Steps::new(&self.path.finer((1 << level) as f32, Vec3A::ZERO), between, BRICK as f32, [low, high])
    }
}

/// The bricks or cells of a path, in order.
pub(super) struct Steps {
    at: Vec3A,
    /// One way or the other along each axis.
    way: Vec3A,
    range: [Vec3A; 2],
    /// Distance of the next boundary on each axis, and from one to the next.
    next: Vec3A,
    delta: Vec3A,
    from: f32,
    end: f32,
}

impl Steps {
    /// Boxes of `edge` along a path between two distances, those from `range[0]` to `range[1]`; the outermost have no far side.
    #[inline(always)]
    fn new(path: &Path, between: [f32; 2], edge: f32, range: [Vec3A; 2]) -> Self {
        let at = (path.at(between[0]) / edge).floor().clamp(range[0], range[1]);
        let forward = path.inv_direction.cmpgt(Vec3A::ZERO);
        let side = at + Vec3A::select(forward, Vec3A::ONE, Vec3A::ZERO);
        Self {
            at,
            way: Vec3A::select(forward, Vec3A::ONE, Vec3A::NEG_ONE),
            range,
            next: (edge * side - path.start) * path.inv_direction,
            delta: edge * path.inv_direction.abs(),
            from: between[0],
            end: between[1],
        }
    }
}

impl Iterator for Steps {
    type Item = Step;

    #[inline(always)]
    fn next(&mut self) -> Option<Step> {
        if self.from >= self.end {
            return None;
        }
        // Past the outermost boxes, whose far sides do not count, the place stays.
        let at = self.at.max(self.range[0]).min(self.range[1]);
        let nearest = self.next.min_element();
        // Rounding may put a boundary before the last one: the piece is then empty.
        let from = self.from;
        self.from = if nearest < self.end { nearest.max(from) } else { self.end };
        // An edge or a corner crosses several sides at once.
        let crosses = self.next.cmpeq(Vec3A::splat(nearest));
        self.at += Vec3A::select(crosses, self.way, Vec3A::ZERO);
        self.next += Vec3A::select(crosses, self.delta, Vec3A::ZERO);
        Some(Step { at, from, to: self.from, level: 0 })
    }
}
