//! The P-k-d tree: a balanced k-d tree over the particles that has no nodes beside them.
//!
//! `build` permutes the particles so that node `n` has children `2n + 1` and `2n + 2`. Invariant: along a node's axis no center
//! in its left subtree lies above its own, none in its right subtree below. The axis is not stored: it follows from the box that
//! the cuts above leave to the node (its widest extent), or from the node's depth (round robin). Coordinates keep all their bits.
//! Regions are grown by the largest radius. Source: Wald, Knoll, Johnson, Usher, Pascucci, Papka 2015, CPU Ray Tracing Large
//! Particle Data with Balanced P-k-d Trees.

use glam::Vec3;
use rayon::prelude::*;

use super::build::{Record, cut};
use super::selection::{RUN, Test, all_bits, shows};
use super::{Hit, box_slack};
use crate::error::{Error, Result};
use crate::math::{Bounds, HIT_ROUNDING, Ray, enter_sphere};
use crate::progress::Progress;

/// Which dimension a node splits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Axis {
    /// The widest extent of the box that is left to the node; of equal ones the first.
    #[default]
    WidestExtent,
    /// x, y, z in turn by depth.
    RoundRobin,
}

/// When a node's own particle is tested.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Order {
    /// Before both children.
    #[default]
    NodeFirst,
    /// After the near child and before the far one: strictly front to back along the axis.
    NearChildFirst,
}

/// How to build and walk.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Options {
    /// Which dimension a node splits.
    pub axis: Axis,
    /// When a node's own particle is tested.
    pub order: Order,
}

/// See the module.
pub struct Pkd {
    center: [Vec<f32>; 3],
    /// Of every node the id.
    ids: Vec<u32>,
    /// One a node, where radii differ; as they were built, `radius_scale` times that is what is seen.
    radii: Vec<f32>,
    max_radius: f32,
    radius_scale: f32,
    centers: Bounds,
    slack: f32,
    options: Options,
    /// Which particles are shown, where that is not all.
    shown: Option<Shown>,
}

/// A bit a node, sixteen a word: whether it is shown itself, and whether anything of its subtree is.
struct Shown {
    own: Vec<u16>,
    any: Vec<u16>,
}

/// Particles in the left subtree of a left-balanced tree of `count`.
fn left_count(count: usize) -> usize {
    if count < 2 {
        return 0;
    }
    let levels = count.ilog2();
    let last_level = count + 1 - (1 << levels);
    let half_level = 1 << (levels - 1);
    half_level - 1 + last_level.min(half_level)
}

impl Options {
    /// The axis that a node of this box and depth splits.
    #[inline(always)]
    fn axis(&self, centers: &Bounds, depth: u32) -> usize {
        match self.axis {
            Axis::RoundRobin => depth as usize % 3,
            Axis::WidestExtent => {
                let extent = centers.max - centers.min;
                if extent.x >= extent.y && extent.x >= extent.z {
                    0
                } else if extent.y >= extent.z {
                    1
                } else {
                    2
                }
            }
        }
    }
}

/// Below this many particles a subtree is sorted by one thread.
const PARALLEL_COUNT: usize = 1 << 14;

impl Pkd {
    /// Builds over `records`, in parallel; `radius` is that of all where the records have none. Fails only when interrupted.
    pub(super) fn build<const N: usize>(
        mut records: Vec<Record<N>>,
        radius: f32,
        options: Options,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let bounds = |bounds: Bounds, record: &Record<N>| bounds.with(record.center());
        let centers =
            records.par_iter().fold(|| Bounds::EMPTY, bounds).reduce(|| Bounds::EMPTY, Bounds::union);
        sort(&mut records, centers, 0, options, progress);
        if progress.cancelled() {
            return Err(Error::Interrupted);
        }
        let order = heap_order(records.len());
        let column =
            |axis: usize| order.par_iter().map(|&at| records[at as usize].coordinates[axis]).collect();
        let radii: Vec<f32> = if N > 3 { column(N - 1) } else { Vec::new() };
        let max_radius = if N > 3 { radii.par_iter().copied().reduce(|| 0.0, f32::max) } else { radius };
        Ok(Self {
            center: [column(0), column(1), column(2)],
            ids: order.par_iter().map(|&at| records[at as usize].id).collect(),
            radii,
            max_radius,
            radius_scale: 1.0,
            centers,
            slack: box_slack(&centers.grown(max_radius)),
            options,
            shown: None,
        })
    }

    /// See [`super::Structure::intersect`].
    pub fn intersect(&self, ray: &Ray, except: Option<u32>) -> Option<Hit> {
        let mut best = None;
        let mut ray = *ray;
        let t_max = ray.t_max;
        self.walk(&mut ray, |pkd, node, ray| {
            // Equally near hits count too: the smaller id wins. `next_up` lets them through the open interval.
            let within = Ray { t_max: ray.t_max.next_up().min(t_max), ..*ray };
            let t = enter_sphere(&within, pkd.center(node), pkd.radius(node));
            if t < within.t_max && except != Some(node as u32) {
                Hit::keep_nearer(&mut best, t, node as u32, &pkd.ids);
                // Clip the ray to the nearest hit: what is behind it is hidden.
                ray.t_max = best.map_or(ray.t_max, |best: Hit| best.t);
            }
            false
        });
        best
    }

    /// See [`super::Structure::occluded`].
    pub fn occluded(&self, ray: &Ray, except: Option<u32>) -> bool {
        let mut found = false;
        self.walk(&mut { *ray }, |pkd, node, ray| {
            found = enter_sphere(ray, pkd.center(node), pkd.radius(node)) < ray.t_max
                && except != Some(node as u32);
            found
        });
        found
    }

    /// The same particles with radii `scale` times those that were built.
    pub(super) fn scaled(self, scale: f32) -> Self {
        let slack = box_slack(&self.centers.grown(scale * self.max_radius));
        Self { radius_scale: scale, slack, ..self }
    }

    /// Shows the particles that fulfill all tests; without a test all. Returns how many.
    pub(super) fn show(&mut self, tests: &[Test]) -> u64 {
        self.shown = None;
        let count = self.ids.len();
        if tests.is_empty() {
            return count as u64;
        }
        let own = all_bits(count, tests, |node| self.center(node));
        // Children come after their parents.
        let mut any = own.clone();
        for node in (1..count).rev() {
            let parent = (node - 1) / 2;
            any[parent / RUN] |= u16::from(shows(&any, node)) << (parent % RUN);
        }
        let shown = own.par_iter().map(|bits| u64::from(bits.count_ones())).sum();
        self.shown = Some(Shown { own, any });
        shown
    }

    /// Whether anything of the subtree is shown.
    #[inline(always)]
    fn shows_any(&self, node: usize) -> bool {
        self.shown.as_ref().is_none_or(|shown| shows(&shown.any, node))
    }

    /// Whether the node's own particle is shown.
    #[inline(always)]
    pub(super) fn shows(&self, node: u32) -> bool {
        self.shown.as_ref().is_none_or(|shown| shows(&shown.own, node as usize))
    }

    /// See [`super::Structure::sphere`].
    #[inline(always)]
    pub fn sphere(&self, node: u32) -> (Vec3, f32) {
        (self.center(node as usize), self.radius(node as usize))
    }

    /// The ids, by node.
    pub fn ids(&self) -> &[u32] {
        &self.ids
    }

    /// The box of all particles, each as large as the largest.
    pub fn bounds(&self) -> Bounds {
        if self.centers.is_empty() {
            Bounds::EMPTY
        } else {
            self.centers.grown(self.radius_scale * self.max_radius)
        }
    }

    /// Memory that it takes in bytes, without the ids.
    pub fn bytes(&self) -> u64 {
        let columns: usize = self.center.iter().map(|column| size_of_val(&column[..])).sum();
        (columns + size_of_val(&self.radii[..])) as u64
    }

    #[inline(always)]
    fn center(&self, node: usize) -> Vec3 {
        Vec3::new(self.center[0][node], self.center[1][node], self.center[2][node])
    }

    #[inline(always)]
    fn radius(&self, node: usize) -> f32 {
        self.radius_scale * if self.radii.is_empty() { self.max_radius } else { self.radii[node] }
    }

    /// Calls `test` for every node whose region the ray crosses, near before far, until it returns true.
    /// `test` may shorten the ray.
    #[inline(always)]
    fn walk(&self, ray: &mut Ray, mut test: impl FnMut(&Self, usize, &mut Ray) -> bool) {
        if self.ids.is_empty() {
            return;
        }
        let inv_direction = ray.inv_direction();
        let farthest = (self.centers.center() - ray.origin).abs() + self.centers.extent();
        let margin = self.radius_scale * self.max_radius * (1.0 + HIT_ROUNDING)
            + HIT_ROUNDING * farthest.max_element()
            + self.slack;

        let grown = self.centers.grown(margin);
        let (to_min, to_max) =
            ((grown.min - ray.origin) * inv_direction, (grown.max - ray.origin) * inv_direction);
        let root = Region {
            node: 0,
            depth: 0,
            t_near: to_min.min(to_max).max_element(),
            t_far: to_min.max(to_max).min_element(),
            centers: self.centers,
            test_only: false,
        };
        let mut stack: Vec<Region> = Vec::with_capacity(64);
        stack.push(root);
        while let Some(region) = stack.pop() {
            let node = region.node;
            if region.t_near > region.t_far || region.t_near > ray.t_max || region.t_far < ray.t_min {
                continue;
            }
            let child = 2 * node + 1;
            let is_leaf = child >= self.ids.len();
            if (region.test_only || is_leaf || self.options.order == Order::NodeFirst)
                && self.shows(node as u32)
                && test(self, node, ray)
            {
                return;
            }
            if region.test_only || is_leaf {
                continue;
            }
            let axis = self.options.axis(&region.centers, region.depth);
            let split = self.center[axis][node];
            let t_split = (split - ray.origin[axis]) * inv_direction[axis];
            let t_margin = (margin * inv_direction[axis]).abs();

            // The near side ends a margin behind the plane, the far side begins a margin before it.
            let near_is_left = inv_direction[axis] >= 0.0;
            let mut left = Region { node: child, depth: region.depth + 1, ..region };
            left.centers.max[axis] = split;
            let mut right = Region { node: child + 1, depth: region.depth + 1, ..region };
            right.centers.min[axis] = split;
            let (mut near, mut far) = if near_is_left { (left, right) } else { (right, left) };
            near.t_far = near.t_far.min(t_split + t_margin);
            far.t_near = far.t_near.max(t_split - t_margin);
            // The last one pushed is walked first.
            let exists = |side: &Region| side.node < self.ids.len() && self.shows_any(side.node);
            stack.extend(Some(far).filter(exists));
            if self.options.order == Order::NearChildFirst {
                stack.push(Region { test_only: true, ..region });
            }
            stack.extend(Some(near).filter(exists));
        }
    }
}

/// A subtree that is still to be walked.
#[derive(Clone, Copy)]
struct Region {
    node: usize,
    depth: u32,
    /// Where along the ray its particles can be met.
    t_near: f32,
    t_far: f32,
    /// The box that the cuts above leave to its centers.
    centers: Bounds,
    /// Whether only the node's own particle is left to test.
    test_only: bool,
}

/// Sorts the records in order: left subtree, node, right subtree.
fn sort<const N: usize>(
    records: &mut [Record<N>],
    centers: Bounds,
    depth: u32,
    options: Options,
    progress: &dyn Progress,
) {
    if records.len() < 2 || progress.cancelled() {
        return;
    }
    let axis = options.axis(&centers, depth);
    let middle = left_count(records.len());
    cut(records, axis, middle);
    let split = records[middle].coordinates[axis];
    let (left, rest) = records.split_at_mut(middle);
    let right = &mut rest[1..];
    let (mut left_centers, mut right_centers) = (centers, centers);
    left_centers.max[axis] = split;
    right_centers.min[axis] = split;
    let count = left.len() + right.len() + 1;
    if count > PARALLEL_COUNT {
        rayon::join(
            || sort(left, left_centers, depth + 1, options, progress),
            || sort(right, right_centers, depth + 1, options, progress),
        );
    } else {
        sort(left, left_centers, depth + 1, options, progress);
        sort(right, right_centers, depth + 1, options, progress);
        if count > PARALLEL_COUNT / 2 {
            progress.advance(count as u64);
        }
    }
}

/// For every node of a left-balanced tree of `count`, the place of its particle when all are sorted in order.
fn heap_order(count: usize) -> Vec<u32> {
    let mut order = Vec::with_capacity(count);
    // The stretches of particles under the nodes of one level, from left to right.
    let mut level = if count > 0 { vec![(0u32, count as u32)] } else { Vec::new() };
    while !level.is_empty() {
        let middle = |(first, count): (u32, u32)| first + left_count(count as usize) as u32;
        order.par_extend(level.par_iter().map(|&stretch| middle(stretch)));
        level = level
            .par_iter()
            .flat_map_iter(|&(first, count)| {
                let middle = middle((first, count));
                [(first, middle - first), (middle + 1, first + count - middle - 1)]
            })
            .filter(|&(_, count)| count > 0)
            .collect();
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn left_subtrees_are_balanced_and_filled_from_the_left() {
        let expected = [0, 0, 1, 1, 2, 3, 3, 3, 4, 5, 6, 7, 7, 7, 7, 7, 8];
        for (count, left) in expected.into_iter().enumerate() {
            assert_eq!(left_count(count), left, "{count} particles");
        }
    }

    #[test]
    fn heap_order_visits_every_particle_once() {
        for count in [0, 1, 2, 3, 4, 7, 8, 100, 1023, 1024] {
            let mut order = heap_order(count);
            if count == 4 {
                assert_eq!(order, [2, 1, 3, 0]);
            }
            order.sort_unstable();
            assert!(order.into_iter().eq(0..count as u32), "{count} particles");
        }
    }
}
