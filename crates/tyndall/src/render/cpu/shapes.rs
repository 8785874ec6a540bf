//! Shapes in the tile sample buffer and in shadows: what `tiles` and `shadows` do for particles, with shapes at the leaves.
//!
//! A leaf of their hierarchy holds sixteen balls around shapes or parts of them, which are projected at once; a shape is tested against sixteen
//! rays in one step, by [`crate::structure::shapes::Shape::enter`].

use fearless_simd::{f32x16, prelude::*, u32x16};
use fearless_simd_macros::simd;
use glam::Vec3;

use super::hits::PACKETS;
use super::lighting::Surfaces;
use super::shadows::{self, Light, Span};
use super::tiles::{self, BLOCKS, Beam, EDGE, Entry, Tile, block_at};
use crate::scene::camera::View;
use crate::simd::{Ball, Lanes3, grown};
use crate::structure::bvh::LEAF;
use crate::structure::shapes::number::{Entry as Met, Line};
use crate::structure::shapes::{Shape, Shapes};

/// Finds which rays of the tile meet a shape before what they have met so far; nodes count from `first_node`. `stack` is scratch.
#[simd]
pub(super) fn walk<S: Simd>(
    simd: S,
    (shapes, first_node): (&Shapes, u32),
    view: &View,
    beam: &Beam,
    tile: &mut Tile,
    stack: &mut Vec<Entry>,
) {
    let bvh = shapes.bvh();
    stack.clear();
    stack.extend(bvh.root().map(Entry::of_all));
    while let Some(entry) = stack.pop() {
        if !tile.is_open(entry.near, entry.open) {
            continue;
        }
        if entry.place.level > 0 {
            tiles::push_children(simd, bvh, entry.place, beam, tile, stack, None);
        } else {
            draw_leaf(simd, (shapes, first_node), entry.place.index as usize, view, beam, tile);
        }
    }
}

#[simd]
fn draw_leaf<S: Simd>(
    simd: S,
    (shapes, first_node): (&Shapes, u32),
    leaf: usize,
    view: &View,
    beam: &Beam,
    tile: &mut Tile,
) {
    let bvh = shapes.bvh();
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
        let number = shapes.at((leaf * LEAF + lane) as u32);
        let shape = shapes.shape(number);
        for y in y_low..=y_high {
            for x in x_low..=x_high {
                let block = block_at(x, y);
                if near[lane] <= tile.block_depth[block] {
                    test(simd, view, (shape, first_node + 2 * number), block, tile);
                }
            }
        }
    }
    tile.update_quads(simd);
}

/// Tests a shape, whose first half has this node, against the sixteen rays of a block. Of equally near things particles come first, and
/// then shapes of smaller number.
#[simd]
fn test<S: Simd>(simd: S, view: &View, (shape, node): (&Shape, u32), block: usize, tile: &mut Tile) {
    let varying = Lanes3::load(simd, &tile.varying[block]);
    let line = if view.perspective {
        Line { origin: Lanes3::splat(simd, view.eye).into(), direction: varying.into() }
    } else {
        Line { origin: varying.into(), direction: Lanes3::splat(simd, view.forward).into() }
    };
    let Met { t, is_second, meets } = shape.enter(&line);
    let nodes = is_second.select(u32x16::splat(simd, node + 1), u32x16::splat(simd, node));
    let depth = f32x16::load_array_ref(simd, &tile.depth[block]);
    let before = u32x16::load_array_ref(simd, &tile.node[block]);
    let enters = meets & f32x16::splat(simd, 0.0).simd_lt(t);
    let wins = enters & (t.simd_lt(depth) | (t.simd_eq(depth) & nodes.simd_lt(before)));
    let depth = wins.select(t, depth);
    depth.store_array(&mut tile.depth[block]);
    wins.select(nodes, before).store_array(&mut tile.node[block]);
    tile.block_depth[block] = depth.reduce_max();
}

/// Clears the lanes of surfaces that do not see past every shape in direction `toward`; nodes of shapes count from `first_node`.
#[simd]
pub(super) fn shadow<S: Simd>(
    simd: S,
    (shapes, first_node): (&Shapes, u32),
    toward: Vec3,
    surfaces: Surfaces,
    lanes: &mut [u16; PACKETS],
    stack: &mut Vec<shadows::Entry>,
) {
    for (packet, lanes) in lanes.iter_mut().enumerate().filter(|(_, lanes)| **lanes != 0) {
        let points = shadows::Points { position: &surfaces.position[packet], on: &surfaces.on[packet] };
        *lanes = unoccluded(simd, (shapes, first_node), toward, &points, u32::from(*lanes), stack) as u16;
    }
}

/// Which of the points in the bit mask `lit` see past every shape.
#[simd]
fn unoccluded<S: Simd>(
    simd: S,
    (shapes, first_node): (&Shapes, u32),
    toward: Vec3,
    points: &shadows::Points,
    mut lit: u32,
    stack: &mut Vec<shadows::Entry>,
) -> u32 {
    let bvh = shapes.bvh();
    let Some(root) = bvh.root() else { return lit };
    let one = lit.trailing_zeros() as usize;
    let origin = Vec3::new(points.position[0][one], points.position[1][one], points.position[2][one]);
    let offset = Lanes3::load(simd, points.position).minus(Lanes3::splat(simd, origin));
    let light = Light::new(toward, origin, shadows::farthest(simd, &offset, lit));
    let projected = light.project(simd, offset);
    let span = Span::of(simd, &projected, lit);
    stack.clear();
    stack.push(shadows::Entry::of_all(root, lit));
    let mut last = None;
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
        let origin = Lanes3::load(simd, points.position).into();
        let line = Line { origin, direction: Lanes3::splat(simd, toward).into() };
        let on = u32x16::load_array_ref(simd, points.on);
        while kept != 0 {
            let lane = kept.trailing_zeros() as usize;
            kept &= kept - 1;
            let number = shapes.at((leaf * LEAF + lane) as u32);
            // Balls of a shape lie side by side: what did not hide these points once does not.
            if last.replace(number) == Some(number) {
                continue;
            }
            let Met { t, meets, .. } = shapes.shape(number).enter(&line);
            let node = first_node.wrapping_add(2 * number);
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
