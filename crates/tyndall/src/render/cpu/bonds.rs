//! Bonds in the tile sample buffer and in shadows: what `tiles` and `shadows` do for particles, with cylinders at the leaves.
//!
//! A leaf of their hierarchy holds sixteen balls around bonds, which are projected at once; a bond is tested against sixteen rays in one
//! step, with the steps of [`crate::structure::bonds::enter_cylinder`].

use fearless_simd::{f32x16, mask32x16, prelude::*, u32x16};
use fearless_simd_macros::simd;
use glam::Vec3;

use super::hits::PACKETS;
use super::lighting::Surfaces;
use super::shadows::{self, Light, Span};
use super::tiles::{self, BLOCKS, Beam, EDGE, Entry, Tile, block_at};
use crate::scene::camera::View;
use crate::simd::{Ball, Lanes3, grown};
use crate::structure::bonds::{Bonds, Cylinder, LEAST_SPEED};
use crate::structure::bvh::LEAF;

/// Finds which rays of the tile meet a bond before what they have met so far; nodes count from `first_node`. `stack` is scratch.
#[simd]
pub(super) fn walk<S: Simd>(
    simd: S,
    (bonds, first_node): (&Bonds, u32),
    view: &View,
    beam: &Beam,
    tile: &mut Tile,
    stack: &mut Vec<Entry>,
) {
    let bvh = bonds.bvh();
    stack.clear();
    stack.extend(bvh.root().map(Entry::of_all));
    while let Some(entry) = stack.pop() {
        if !tile.is_open(entry.near, entry.open) {
            continue;
        }
        if entry.place.level > 0 {
            tiles::push_children(simd, bvh, entry.place, beam, tile, stack, None);
        } else {
            draw_leaf(simd, (bonds, first_node), entry.place.index as usize, view, beam, tile);
        }
    }
}

#[simd]
fn draw_leaf<S: Simd>(
    simd: S,
    (bonds, first_node): (&Bonds, u32),
    leaf: usize,
    view: &View,
    beam: &Beam,
    tile: &mut Tile,
) {
    let bvh = bonds.bvh();
    let center = bvh.centers(simd, leaf).minus(Lanes3::splat(simd, beam.eye));
    let ball = Ball(grown(simd, bvh.radii(simd, leaf), center, beam.spread));
    let shadow = tiles::project(simd, beam, center, ball);
    let [_, open] = shadow.touched_quads(simd, tile);
    let mut kept = (open[0] | open[1] | open[2] | open[3]) & bvh.shown(leaf);
    if kept == 0 {
        return;
    }
    let near = shadow.near.to_array();
    let ranges = shadow.ranges(simd);
    while kept != 0 {
        let lane = kept.trailing_zeros() as usize;
        kept &= kept - 1;
        let range = |place: u32| (ranges[lane] >> (3 * place)) as usize % EDGE;
        let (x_low, x_high, y_low, y_high) = (range(0), range(1), range(2), range(3));
        let bond = bonds.at((leaf * LEAF + lane) as u32);
        let cylinder = bonds.cylinder(bond);
        for y in y_low..=y_high {
            for x in x_low..=x_high {
                let block = block_at(x, y);
                if near[lane] <= tile.block_depth[block] {
                    test(simd, view, (cylinder, first_node + 2 * bond), block, tile);
                }
            }
        }
    }
    tile.update_quads(simd);
}

/// Tests a bond, whose first half has this node, against the sixteen rays of a block. Of equally near things particles come first, and
/// then bonds of smaller number.
#[simd]
fn test<S: Simd>(simd: S, view: &View, (cylinder, node): (&Cylinder, u32), block: usize, tile: &mut Tile) {
    let varying = Lanes3::load(simd, &tile.varying[block]);
    let (to_middle, direction) = if view.perspective {
        (Lanes3::splat(simd, cylinder.middle - view.eye), varying)
    } else {
        (Lanes3::splat(simd, cylinder.middle).minus(varying), Lanes3::splat(simd, view.forward))
    };
    let (t, along, meets) = enter_cylinder(simd, to_middle, direction, cylinder);
    let zero = f32x16::splat(simd, 0.0);
    let nodes = along.simd_gt(zero).select(u32x16::splat(simd, node + 1), u32x16::splat(simd, node));
    let depth = f32x16::load_array_ref(simd, &tile.depth[block]);
    let before = u32x16::load_array_ref(simd, &tile.node[block]);
    let enters = meets & zero.simd_lt(t);
    let wins = enters & (t.simd_lt(depth) | (t.simd_eq(depth) & nodes.simd_lt(before)));
    let depth = wins.select(t, depth);
    depth.store_array(&mut tile.depth[block]);
    wins.select(nodes, before).store_array(&mut tile.node[block]);
    tile.block_depth[block] = depth.reduce_max();
}

/// [`crate::structure::bonds::enter_cylinder`] on lanes: where rays enter, how far along the cylinder that is from its middle, and which
/// rays enter at all, also before they start.
#[inline(always)]
fn enter_cylinder<S: Simd>(
    simd: S,
    to_middle: Lanes3<f32x16<S>>,
    direction: Lanes3<f32x16<S>>,
    cylinder: &Cylinder,
) -> (f32x16<S>, f32x16<S>, mask32x16<S>) {
    let zero = f32x16::splat(simd, 0.0);
    let least = f32x16::splat(simd, LEAST_SPEED);
    let axis = Lanes3::splat(simd, cylinder.axis);
    let closest = to_middle.dot(direction);
    let start = direction.times(closest).minus(to_middle);
    let (start_along, speed_along) = (start.dot(axis), direction.dot(axis));
    let start_across = start.minus(axis.times(start_along));
    let speed_across = direction.minus(axis.times(speed_along));
    // The stretch within the endless cylinder.
    let speed_sq = speed_across.dot(speed_across).max(least);
    let nearest = -start_across.dot(speed_across) / speed_sq;
    let off = start_across.plus(speed_across.times(nearest));
    let radius_sq = f32x16::splat(simd, cylinder.radius * cylinder.radius);
    let half_chord_sq = (radius_sq - off.dot(off)) / speed_sq;
    let half_chord = half_chord_sq.max(zero).sqrt();
    // The stretch between the ends.
    let is_across = speed_along.abs().simd_lt(least);
    let inverse = f32x16::splat(simd, 1.0) / is_across.select(least, speed_along);
    let half_length = f32x16::splat(simd, cylinder.half_length);
    let one = (-half_length - start_along) * inverse;
    let other = (half_length - start_along) * inverse;
    let enter = (nearest - half_chord).max(one.min(other));
    let leave = (nearest + half_chord).min(one.max(other));
    let meets = half_chord_sq.simd_gt(zero) & enter.simd_lt(leave);
    (closest + enter, start_along + enter * speed_along, meets)
}

/// Clears the lanes of surfaces that do not see past every bond in direction `toward`; nodes of bonds count from `first_node`.
#[simd]
pub(super) fn shadow<S: Simd>(
    simd: S,
    (bonds, first_node): (&Bonds, u32),
    toward: Vec3,
    surfaces: Surfaces,
    lanes: &mut [u16; PACKETS],
    stack: &mut Vec<shadows::Entry>,
) {
    for (packet, lanes) in lanes.iter_mut().enumerate().filter(|(_, lanes)| **lanes != 0) {
        let points = shadows::Points { position: &surfaces.position[packet], on: &surfaces.on[packet] };
        *lanes = unoccluded(simd, (bonds, first_node), toward, &points, u32::from(*lanes), stack) as u16;
    }
}

/// Which of the points in the bit mask `lit` see past every bond.
#[simd]
fn unoccluded<S: Simd>(
    simd: S,
    (bonds, first_node): (&Bonds, u32),
    toward: Vec3,
    points: &shadows::Points,
    mut lit: u32,
    stack: &mut Vec<shadows::Entry>,
) -> u32 {
    let bvh = bonds.bvh();
    let Some(root) = bvh.root() else { return lit };
    let one = lit.trailing_zeros() as usize;
    let origin = Vec3::new(points.position[0][one], points.position[1][one], points.position[2][one]);
    let offset = Lanes3::load(simd, points.position).minus(Lanes3::splat(simd, origin));
    let light = Light::new(toward, origin, shadows::farthest(simd, &offset, lit));
    let projected = light.project(simd, offset);
    let span = Span::of(simd, &projected, lit);
    stack.clear();
    stack.push(shadows::Entry::of_all(root, lit));
    while let Some(entry) = stack.pop() {
        let lanes = entry.lanes & lit;
        if lanes == 0 {
            continue;
        }
        if entry.place.level > 0 {
            shadows::push_children(simd, bvh, entry.place, &light, &span, &projected, lanes, stack);
            continue;
        }
        let leaf = entry.place.index as usize;
        let center = bvh.centers(simd, leaf).minus(Lanes3::splat(simd, light.origin));
        let ball = Ball(grown(simd, bvh.radii(simd, leaf), center, light.spread));
        let meets = span.meets(simd, &light.project(simd, center), &light.reach(simd, ball));
        let mut kept = meets & bvh.shown(leaf);
        let direction = Lanes3::splat(simd, toward);
        let start = Lanes3::load(simd, points.position);
        let on = u32x16::load_array_ref(simd, points.on);
        while kept != 0 {
            let lane = kept.trailing_zeros() as usize;
            kept &= kept - 1;
            let bond = bonds.at((leaf * LEAF + lane) as u32);
            let cylinder = bonds.cylinder(bond);
            let to_middle = Lanes3::splat(simd, cylinder.middle).minus(start);
            let (t, _, meets) = enter_cylinder(simd, to_middle, direction, cylinder);
            let node = first_node.wrapping_add(2 * bond);
            let is_own =
                on.simd_eq(u32x16::splat(simd, node)) | on.simd_eq(u32x16::splat(simd, node.wrapping_add(1)));
            let met = meets & f32x16::splat(simd, 0.0).simd_lt(t) & !is_own;
            lit &= !(met.to_bitmask() as u32);
        }
        if lit == 0 {
            return 0;
        }
    }
    lit
}

impl Tile {
    /// Takes note of how deep the rays are, which were set one by one.
    #[simd]
    pub(super) fn update_depths<S: Simd>(&mut self, simd: S) {
        for block in 0..BLOCKS {
            self.block_depth[block] = f32x16::load_array_ref(simd, &self.depth[block]).reduce_max();
        }
        self.update_quads(simd);
    }
}
