//! Periodic images of a structure, without copies: every image is the same particles, seen from elsewhere.
//!
//! [`Replicas`] says which images there are. A structure that is replicated gives every particle of every image a node of its own, image
//! after image, in the order in which copies would stand; a walk looks at one image after the other, nearest first, with rays that
//! are moved by what the image is moved, back. So a hit is that of copied particles, bit for bit, where moving rounds nothing.

use glam::{DVec3, Vec3};

use super::Hit;
use crate::error::{Error, Result};
use crate::math::{Bounds, HIT_ROUNDING, Ray};
use crate::particles::Cell;

/// Which periodic images there are: so many along each edge of the cell, the first of which is what the file has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Replicas {
    counts: [u32; 3],
    edges: [DVec3; 3],
}

/// More images than anyone can tell apart in a picture: a box of a hundred along each edge.
const MOST: u64 = 1 << 20;

impl Replicas {
    /// So many along each edge of `cell`. Fails with [`Error::Setting`] if the cell does not repeat so.
    pub fn new(cell: Option<&Cell>, counts: [u32; 3]) -> Result<Self> {
        let refuse = |allowed: &str| {
            let text = counts.map(|it| it.to_string()).join(",");
            Err(Error::setting("--replicate", text, allowed))
        };
        let all = counts.iter().map(|&it| u64::from(it)).try_fold(1, u64::checked_mul);
        if !all.is_some_and(|all| (1..=MOST).contains(&all)) {
            return refuse("at least 1 along each edge, and at most 1,048,576 in all");
        }
        let Some(cell) = cell else {
            return refuse(
                "for files that have a cell: this one has none — extended XYZ (Lattice=), LAMMPS dumps and GRO have one",
            );
        };
        for axis in (0..3).filter(|&axis| counts[axis] > 1) {
            let edge = cell.vectors[axis];
            if !cell.periodic[axis] || !edge.is_finite() || edge.length_squared() == 0.0 {
                let edge = ["first", "second", "third"][axis];
                return refuse(&format!("1 along the {edge} edge of the cell, which does not repeat there"));
            }
        }
        Ok(Self { counts, edges: cell.vectors })
    }

    /// How many there are along each edge.
    pub fn counts(&self) -> [u32; 3] {
        self.counts
    }

    /// How many there are.
    pub fn count(&self) -> u32 {
        self.counts.iter().product()
    }

    /// By how much the image at this place, counted from 0 along each edge, is moved.
    pub fn shift(&self, place: [u32; 3]) -> DVec3 {
        (0..3).map(|axis| f64::from(place[axis]) * self.edges[axis]).sum()
    }

    /// By how much the outermost images are moved.
    pub fn corners(&self) -> Vec<DVec3> {
        self.corners_of([0; 3], self.counts)
    }

    /// The same of a block of images, from `low` up to, and without, `high`.
    fn corners_of(&self, low: [u32; 3], high: [u32; 3]) -> Vec<DVec3> {
        let last = high.map(|it| it - 1);
        let corner = |at: usize| -> [u32; 3] {
            std::array::from_fn(|axis| if at >> axis & 1 == 1 { last[axis] } else { low[axis] })
        };
        let is_new = |at: &usize| (0..3).all(|axis| at >> axis & 1 == 0 || low[axis] < last[axis]);
        (0..8).filter(is_new).map(|at| self.shift(corner(at))).collect()
    }
}

/// One of the images.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Replica {
    /// Counted from 0.
    pub(crate) number: u32,
    /// By how much it is moved.
    pub(crate) shift: Vec3,
    /// The node of its first particle.
    pub(crate) first_node: u32,
}

/// A block of images: what their shifts span, and the image or the two halves that it is made of. The first half follows the block.
#[derive(Clone)]
struct Block {
    span: Bounds,
    content: Content,
}

#[derive(Clone)]
enum Content {
    One(Replica),
    Two { second: u32 },
}

/// The images of a structure, in blocks that are halved until they are single images.
#[derive(Clone)]
pub(crate) struct ReplicaTree {
    blocks: Vec<Block>,
    /// By image.
    shifts: Vec<Vec3>,
    /// Nodes of one image.
    pub(crate) nodes: u32,
}

/// Blocks that wait during a walk: more than halvings make single images of [`MOST`].
const STACK: usize = 32;

/// Who goes through the images.
pub(crate) trait Visitor {
    /// How far what is in the box is; none if it cannot matter any more.
    fn near(&self, bounds: &Bounds) -> Option<f32>;

    /// Looks at an image.
    fn look(&mut self, replica: Replica);
}

impl ReplicaTree {
    /// Of `particles` particles. Fails with [`Error::Setting`] if nodes of all images are more than can be counted.
    pub(super) fn new(replicas: &Replicas, particles: usize) -> Result<Self> {
        let count = replicas.count();
        // With room for one more image, nodes that are counted from another image's first never look like those of this one.
        if (u64::from(count) + 1) * particles as u64 > 1 << 32 {
            let text = replicas.counts.map(|it| it.to_string()).join(",");
            let most = ((1_u64 << 32) / particles as u64).saturating_sub(1);
            let allowed = format!("at most {most} images of so many particles: 2^32 in all");
            return Err(Error::setting("--replicate", text, allowed));
        }
        let shifts = vec![Vec3::ZERO; count as usize];
        let mut tree = Self { blocks: Vec::new(), shifts, nodes: particles as u32 };
        tree.halve(replicas, [0; 3], replicas.counts);
        Ok(tree)
    }

    /// Adds the block of images from `low` up to, and without, `high`.
    fn halve(&mut self, replicas: &Replicas, low: [u32; 3], high: [u32; 3]) {
        let shifts = replicas.corners_of(low, high);
        let span = shifts.iter().fold(Bounds::EMPTY, |span, shift| span.with(shift.as_vec3()));
        let length = |axis: usize| f64::from(high[axis] - low[axis] - 1) * replicas.edges[axis].length();
        let widest = (1..3).fold(0, |widest, axis| if length(axis) > length(widest) { axis } else { widest });
        if (0..3).all(|axis| high[axis] - low[axis] == 1) {
            let [x, y, _] = replicas.counts;
            let number = low[0] + x * (low[1] + y * low[2]);
            self.shifts[number as usize] = span.min;
            let replica = Replica { number, shift: span.min, first_node: number * self.nodes };
            self.blocks.push(Block { span, content: Content::One(replica) });
            return;
        }
        let place = self.blocks.len();
        self.blocks.push(Block { span, content: Content::Two { second: 0 } });
        let middle = low[widest] + (high[widest] - low[widest]) / 2;
        let cut = |mut corner: [u32; 3]| {
            corner[widest] = middle;
            corner
        };
        self.halve(replicas, low, cut(high));
        self.blocks[place].content = Content::Two { second: self.blocks.len() as u32 };
        self.halve(replicas, cut(low), high);
    }

    /// Shows the visitor the images of what lies within `bounds`, nearest first, but those that it says cannot matter.
    #[inline(always)]
    pub(crate) fn visit(&self, bounds: &Bounds, visitor: &mut impl Visitor) {
        if bounds.is_empty() {
            return;
        }
        let around =
            |block: &Block| Bounds { min: bounds.min + block.span.min, max: bounds.max + block.span.max };
        let mut stack = [0_u32; STACK];
        let mut height = 1;
        while height > 0 {
            height -= 1;
            let place = stack[height];
            let block = &self.blocks[place as usize];
            // Asked again: what was found since may hide it.
            if visitor.near(&around(block)).is_none() {
                continue;
            }
            match block.content {
                Content::One(replica) => visitor.look(replica),
                Content::Two { second } => {
                    let halves = [place + 1, second];
                    let [one, other] = halves.map(|half| visitor.near(&around(&self.blocks[half as usize])));
                    let is_swapped = matches!((one, other), (Some(one), Some(other)) if other < one);
                    let order = if is_swapped { [0, 1] } else { [1, 0] };
                    for half in order {
                        if [one, other][half].is_some() {
                            stack[height] = halves[half];
                            height += 1;
                        }
                    }
                }
            }
        }
    }

    /// The box of the images of what is in a box.
    pub(super) fn around(&self, bounds: &Bounds) -> Bounds {
        let span = self.blocks.first().map_or(Bounds { min: Vec3::ZERO, max: Vec3::ZERO }, |all| all.span);
        Bounds { min: bounds.min + span.min, max: bounds.max + span.max }
    }

    /// How many images there are.
    pub(crate) fn count(&self) -> u32 {
        self.shifts.len() as u32
    }

    /// Whether a ray meets anything in any image of what lies within `bounds`; `ask` says so of one, with a ray that was moved back.
    pub(super) fn meets_any(
        &self,
        bounds: &Bounds,
        ray: &Ray,
        ask: impl FnMut(&Ray, Replica) -> bool,
    ) -> bool {
        let mut any = Any { ray, ask, is_met: false };
        self.visit(bounds, &mut any);
        any.is_met
    }

    /// Calls `ask` for every image of what lies within `bounds` that may hold the place of a ray at distance `t`, with a ray that was moved back.
    pub(super) fn each_at(&self, bounds: &Bounds, (ray, t): (&Ray, f32), ask: impl FnMut(&Ray, Replica)) {
        let around = Ray { t_min: t.next_down(), t_max: t.next_up(), ..*ray };
        self.visit(bounds, &mut Each { ray, around, ask });
    }

    /// By how much an image is moved.
    #[inline(always)]
    pub(crate) fn shift(&self, image: u32) -> Vec3 {
        self.shifts[image as usize]
    }

    /// The node of the same particle in the structure, and by how much the image at `node` is moved.
    #[inline(always)]
    pub(crate) fn locate(&self, node: u32) -> (u32, Vec3) {
        (node % self.nodes, self.shifts[(node / self.nodes) as usize])
    }
}

/// What lies within the box may be entered where the ray enters it, grown by the rounding of the hit formula; none if it misses it.
#[inline(always)]
fn enters(ray: &Ray, bounds: &Bounds) -> Option<f32> {
    let farthest = bounds.min.abs().max(bounds.max.abs()) + ray.origin.abs();
    let grown = bounds.grown(HIT_ROUNDING * farthest.max_element());
    grown.clip(ray).map(|[enter, _]| enter)
}

/// Finds the nearest of what a ray meets in images; `ask` finds it in one, with a ray that was moved back.
pub(super) struct Nearest<'a, F> {
    replicas: &'a ReplicaTree,
    ray: &'a Ray,
    ask: F,
    /// With the node in the image that it is of.
    best: Option<Hit>,
}

impl<'a, F: FnMut(&Ray, Replica) -> Option<Hit>> Nearest<'a, F> {
    pub(super) fn new(replicas: &'a ReplicaTree, ray: &'a Ray, ask: F) -> Self {
        Self { replicas, ray, ask, best: None }
    }

    pub(super) fn found(mut self, bounds: &Bounds) -> Option<Hit> {
        self.replicas.visit(bounds, &mut self);
        self.best
    }

    /// The part of the ray that may still hold the nearest, or one as near.
    #[inline(always)]
    fn left(&self) -> Ray {
        let t_max = self.best.map_or(self.ray.t_max, |best| best.t.next_up().min(self.ray.t_max));
        Ray { t_max, ..*self.ray }
    }
}

impl<F: FnMut(&Ray, Replica) -> Option<Hit>> Visitor for Nearest<'_, F> {
    #[inline(always)]
    fn near(&self, bounds: &Bounds) -> Option<f32> {
        enters(&self.left(), bounds)
    }

    #[inline(always)]
    fn look(&mut self, replica: Replica) {
        let left = self.left();
        let moved = Ray { origin: left.origin - replica.shift, ..left };
        if let Some(hit) = (self.ask)(&moved, replica) {
            let hit = Hit { node: replica.first_node + hit.node, ..hit };
            // Of equally near ones that of the earlier image, as copies would stand; within one, the structure has decided.
            if self.best.is_none_or(|best| hit.t < best.t || hit.node < best.node) {
                self.best = Some(hit);
            }
        }
    }
}

/// Asks every image that may hold a place on a ray.
struct Each<'a, F> {
    ray: &'a Ray,
    /// The ray close to the place alone.
    around: Ray,
    ask: F,
}

impl<F: FnMut(&Ray, Replica)> Visitor for Each<'_, F> {
    #[inline(always)]
    fn near(&self, bounds: &Bounds) -> Option<f32> {
        enters(&self.around, bounds)
    }

    #[inline(always)]
    fn look(&mut self, replica: Replica) {
        (self.ask)(&Ray { origin: self.ray.origin - replica.shift, ..*self.ray }, replica);
    }
}

/// Finds whether a ray meets anything in images.
struct Any<'a, F> {
    ray: &'a Ray,
    ask: F,
    is_met: bool,
}

impl<F: FnMut(&Ray, Replica) -> bool> Visitor for Any<'_, F> {
    #[inline(always)]
    fn near(&self, bounds: &Bounds) -> Option<f32> {
        if self.is_met { None } else { enters(self.ray, bounds) }
    }

    #[inline(always)]
    fn look(&mut self, replica: Replica) {
        let moved = Ray { origin: self.ray.origin - replica.shift, ..*self.ray };
        self.is_met |= (self.ask)(&moved, replica);
    }
}
