//! The tile sample buffer: primary visibility of many rays at once, in one walk of the hierarchy.
//!
//! A tile is 8 x 8 blocks, a block is sixteen rays side by side: sixteen samples of a pixel, or four of 2 x 2 pixels, or one of
//! 4 x 4. The walk goes front to back; it skips what starts behind the deepest ray of all blocks that it touches, projects the
//! sixteen particles of a leaf at once, and tests a particle against the sixteen rays of each block it touches in one step.
//! Result: the same depth and id, bit for bit, that a ray each would find. Boxes and particles are grown by the rounding of the
//! hit formula before anything is skipped (see `math::HIT_ROUNDING`).

use fearless_simd::{f32x8, f32x16, mask32x16, prelude::*, u32x16};
use fearless_simd_macros::simd;
use glam::Vec3;

use super::Pass;
use crate::math::{Bounds, HIT_ROUNDING, Ray};
use crate::scene::camera::View;
use crate::simd::{Ball, Lanes3, Reach, enter_sphere, grown};
use crate::structure::bvh::{Bvh, LEAF, Place, push_sorted};

/// Blocks along a tile's edge, blocks in a tile, rays in a block.
pub(super) const EDGE: usize = 8;
pub(super) const BLOCKS: usize = EDGE * EDGE;
pub(super) const RAYS: usize = 16;

/// A quarter of a tile has its own deepest ray, so that a see-through corner keeps only itself open.
pub(super) const QUADS: usize = 4;
const QUAD_BLOCKS: usize = BLOCKS / QUADS;

/// Where block (x, y) is stored: the blocks of a quad lie side by side.
#[inline(always)]
pub(super) fn block_at(x: usize, y: usize) -> usize {
    ((y / 4) * 2 + x / 4) * QUAD_BLOCKS + (y % 4) * 4 + x % 4
}

/// The rays of a tile and what each has met so far.
pub(super) struct Tile {
    /// By block and axis: the rays' origins (orthographic) or directions (perspective); the other is the view's.
    pub(super) varying: [[[f32; RAYS]; 3]; BLOCKS],
    /// Distance to what the ray met; infinite where it met nothing.
    pub(super) depth: [[f32; RAYS]; BLOCKS],
    /// The node of what it met; meaningless where it met nothing.
    pub(super) node: [[u32; RAYS]; BLOCKS],
    /// The deepest ray of each block and of each quad.
    pub(super) block_depth: [f32; BLOCKS],
    quad_depth: [f32; QUADS],
    /// The node of the first particle of the image that is drawn, and how many nodes an image has: all where there is one.
    pub(super) first_node: u32,
    pub(super) image_nodes: u32,
}

impl Tile {
    pub(super) fn new() -> Box<Self> {
        Box::new(Self {
            varying: [[[0.0; RAYS]; 3]; BLOCKS],
            depth: [[f32::INFINITY; RAYS]; BLOCKS],
            node: [[0; RAYS]; BLOCKS],
            block_depth: [f32::INFINITY; BLOCKS],
            quad_depth: [f32::INFINITY; QUADS],
            first_node: 0,
            image_nodes: u32::MAX,
        })
    }

    /// Forgets what the rays have met.
    pub(super) fn clear(&mut self) {
        self.depth = [[f32::INFINITY; RAYS]; BLOCKS];
        self.block_depth = [f32::INFINITY; BLOCKS];
        self.quad_depth = [f32::INFINITY; QUADS];
    }

    /// The ray of a block and lane.
    #[inline(always)]
    pub(super) fn ray(&self, view: &View, block: usize, lane: usize) -> Ray {
        let varying = Vec3::from_array(std::array::from_fn(|axis| self.varying[block][axis][lane]));
        let (origin, direction) =
            if view.perspective { (view.eye, varying) } else { (varying, view.forward) };
        Ray { origin, direction, t_min: 0.0, t_max: f32::INFINITY }
    }

    /// Whether something that starts at depth `near` can matter to one of the quads.
    #[inline(always)]
    pub(super) fn is_open(&self, near: f32, quads: u8) -> bool {
        (0..QUADS).any(|quad| quads >> quad & 1 == 1 && near <= self.quad_depth[quad])
    }

    /// Tests the particle at `node` against the sixteen rays of `block` and keeps what is nearer; equally near, the smaller id.
    /// Without a branch on what it finds, so that tests overlap.
    #[simd]
    fn test<S: Simd>(&mut self, simd: S, bvh: &Bvh, view: &View, block: usize, sphere: &Sphere) {
        let varying = Lanes3::load(simd, &self.varying[block]);
        let (to_center, direction) = if view.perspective {
            (Lanes3::splat(simd, sphere.center - view.eye), varying)
        } else {
            (Lanes3::splat(simd, sphere.center).minus(varying), Lanes3::splat(simd, view.forward))
        };
        let radius_sq = f32x16::splat(simd, sphere.radius * sphere.radius);
        let (t, meets) = enter_sphere(simd, to_center, direction, radius_sq);
        let depth = f32x16::load_array_ref(simd, &self.depth[block]);
        let enters = meets & f32x16::splat(simd, 0.0).simd_lt(t);
        let mut wins = enters & t.simd_lt(depth);
        let ties = (enters & t.simd_eq(depth)).to_bitmask();
        if ties != 0 {
            let won = self.smaller_ids(bvh, block, ties, sphere.node);
            wins |= mask32x16::from_bitmask(simd, won);
        }
        let depth = wins.select(t, depth);
        depth.store_array(&mut self.depth[block]);
        let old = u32x16::load_array_ref(simd, &self.node[block]);
        wins.select(u32x16::splat(simd, sphere.node), old).store_array(&mut self.node[block]);
        self.block_depth[block] = depth.reduce_max();
    }

    /// Which of the rays of a block in the mask, that met something just as near, meet the particle at `node` instead: that of an earlier
    /// image, and within an image the smaller id. Rare, but for particles at one place.
    #[cold]
    #[inline(never)]
    fn smaller_ids(&self, bvh: &Bvh, block: usize, ties: u64, node: u32) -> u64 {
        let id = |node: u32| (node / self.image_nodes, bvh.ids()[(node % self.image_nodes) as usize]);
        let smaller = |lane: &usize| ties >> lane & 1 == 1 && id(node) < id(self.node[block][*lane]);
        (0..RAYS).filter(smaller).fold(0, |mask, lane| mask | 1 << lane)
    }

    #[simd]
    pub(super) fn update_quads<S: Simd>(&mut self, simd: S) {
        for quad in 0..QUADS {
            let blocks = &self.block_depth[quad * QUAD_BLOCKS..][..QUAD_BLOCKS];
            self.quad_depth[quad] = f32x16::from_slice(simd, blocks).reduce_max();
        }
    }
}

/// A particle that is tested.
struct Sphere {
    center: Vec3,
    radius: f32,
    node: u32,
}

/// A tile's part of space: axes on which boxes are projected, in units of blocks from the tile's middle.
///
/// Along `across[k]` a point `p` measured from the eye lies at `dot(p, across[k]) - shift[k]`, divided by its distance in
/// front of the eye where the view has perspective.
#[derive(Clone, Copy)]
pub(super) struct Beam {
    pub(super) eye: Vec3,
    across: [Vec3; 2],
    shift: [f32; 2],
    /// Depth along the tile's middle ray: never more than the distance along any of its rays.
    along: Vec3,
    forward: Vec3,
    pub(super) perspective: bool,
    /// Largest distance from the eye at which a ray starts, in each coordinate.
    pub(super) spread: f32,
    /// Pixels along the edge of a block, if rays go through the centers of pixels only.
    centers: Option<f32>,
}

impl Beam {
    /// The beam of the pass' tile whose upper left corner is pixel (x, y).
    pub(super) fn new(pass: &Pass, x: f32, y: f32) -> Self {
        let view = &pass.view;
        let block_px = pass.block_px as f32;
        let centers = pass.centered.then_some(block_px);
        let scale = 1.0 / (view.pixel * block_px);
        let half = 0.5 * EDGE as f32 * block_px;
        let middle_u = view.left + (x + half) * view.pixel;
        let middle_v = view.top - (y + half) * view.pixel;
        let (right, down) = (view.right * scale, -view.up * scale);
        let shift = [middle_u * scale, -middle_v * scale];
        let reach = middle_u.abs() + middle_v.abs() + 2.0 * half * view.pixel;
        if view.perspective {
            let along = (view.forward + view.right * middle_u + view.up * middle_v).normalize();
            let across = [right - shift[0] * view.forward, down - shift[1] * view.forward];
            Self {
                eye: view.eye,
                across,
                shift: [0.0; 2],
                along,
                forward: view.forward,
                perspective: true,
                spread: 0.0,
                centers,
            }
        } else {
            let across = [right, down];
            Self {
                eye: view.eye,
                across,
                shift,
                along: view.forward,
                forward: view.forward,
                perspective: false,
                spread: reach,
                centers,
            }
        }
    }
}

impl Beam {
    /// As an image sees it that is moved by `shift`.
    pub(super) fn moved_back(&self, shift: Vec3) -> Self {
        // Where rays start in parallel, each start is rounded once more.
        let rounded = if self.perspective { Vec3::ZERO } else { self.eye.abs() + shift.abs() };
        Self { eye: self.eye - shift, spread: self.spread + rounded.max_element(), ..*self }
    }
}

/// Where the box starts, measured along the beam; none if no ray of the tile can meet it, or all of them have met something nearer.
#[inline(always)]
pub(super) fn open_from<S: Simd>(simd: S, beam: &Beam, tile: &Tile, bounds: &Bounds) -> Option<f32> {
    let center = bounds.center() - beam.eye;
    let half = 0.5 * bounds.extent();
    let farthest = (center.abs() + half + bounds.center().abs()).max_element();
    let margin = 2.0 * HIT_ROUNDING * (farthest + beam.spread);
    let center: Lanes3<f32x8<S>> = Lanes3::splat(simd, center);
    let shadow = project(simd, beam, center, Lanes3::splat(simd, half + margin));
    let [_, open] = shadow.touched_quads(simd, tile);
    let is_open = open.iter().any(|quad| quad & 1 == 1);
    is_open.then(|| shadow.near.to_array()[0])
}

/// What projected boxes or particles cover: a range of blocks across, down, and where they start.
pub(super) struct Shadow<V> {
    low: [V; 2],
    high: [V; 2],
    pub(super) near: V,
    /// Where they end along the view's axis; at or below zero they lie behind the eye.
    far: V,
}

/// Projects things at `center`, measured from the eye.
#[inline(always)]
pub(super) fn project<S: Simd, V: SimdFloat<S, Element = f32>>(
    simd: S,
    beam: &Beam,
    center: Lanes3<V>,
    thing: impl Reach<S, V>,
) -> Shadow<V> {
    let near = center.along(simd, beam.along) - thing.reach(simd, beam.along);
    let middle_x = center.along(simd, beam.across[0]) - V::simd_from(simd, beam.shift[0]);
    let middle_y = center.along(simd, beam.across[1]) - V::simd_from(simd, beam.shift[1]);
    let (reach_x, reach_y) = (thing.reach(simd, beam.across[0]), thing.reach(simd, beam.across[1]));
    let mut low = [middle_x - reach_x, middle_y - reach_y];
    let mut high = [middle_x + reach_x, middle_y + reach_y];
    if !beam.perspective {
        return Shadow { low, high, near, far: V::simd_from(simd, 1.0) };
    }
    // Perspective: the sides that face the axis are divided by the far end, the others by the near one.
    let middle = center.along(simd, beam.forward);
    let reach = thing.reach(simd, beam.forward);
    let (front, back) = (middle - reach, middle + reach);
    let zero = V::simd_from(simd, 0.0);
    let in_front = front.simd_gt(zero);
    for k in 0..2 {
        let by_low = low[k].simd_ge(zero).select(back, front);
        low[k] = in_front.select(low[k] / by_low, V::simd_from(simd, f32::NEG_INFINITY));
        let by_high = high[k].simd_ge(zero).select(front, back);
        high[k] = in_front.select(high[k] / by_high, V::simd_from(simd, f32::INFINITY));
    }
    Shadow { low, high, near, far: back }
}

impl<V> Shadow<V> {
    /// Which lanes touch each quad, as one bit mask a quad; and of those the ones in front of which it is still open.
    #[inline(always)]
    pub(super) fn touched_quads<S: Simd>(&self, simd: S, tile: &Tile) -> [[u32; QUADS]; 2]
    where
        V: SimdFloat<S, Element = f32>,
    {
        let zero = V::simd_from(simd, 0.0);
        let edge = V::simd_from(simd, 0.5 * EDGE as f32);
        let inside_x = self.low[0].simd_le(edge) & self.high[0].simd_ge(-edge);
        let inside_y = self.low[1].simd_le(edge) & self.high[1].simd_ge(-edge);
        let touches = inside_x & inside_y & self.far.simd_gt(zero);
        let across = [self.low[0].simd_le(zero), self.high[0].simd_ge(zero)];
        let down = [self.low[1].simd_le(zero), self.high[1].simd_ge(zero)];
        let mut quads = [[0; QUADS]; 2];
        for quad in 0..QUADS {
            let in_front = self.near.simd_le(V::simd_from(simd, tile.quad_depth[quad]));
            let touched = touches & across[quad % 2] & down[quad / 2];
            quads[0][quad] = touched.to_bitmask() as u32;
            quads[1][quad] = (touched & in_front).to_bitmask() as u32;
        }
        quads
    }
}

impl<S: Simd> Shadow<f32x16<S>> {
    /// The blocks that each lane covers: the first and the last across, the first and the last down, three bits each.
    #[inline(always)]
    pub(super) fn ranges(&self, simd: S) -> [u32; LEAF] {
        let zero = f32x16::splat(simd, 0.0);
        let last = f32x16::splat(simd, (EDGE - 1) as f32);
        let half = 0.5 * EDGE as f32;
        let mut code = zero;
        for (place, edge) in [self.low[0], self.high[0], self.low[1], self.high[1]].into_iter().enumerate() {
            let block = (edge + half).max(zero).min(last).floor();
            code = block.mul_add(f32x16::splat(simd, (1 << (3 * place)) as f32), code);
        }
        // A sum of this size has its whole number in the lowest bits.
        let bits = (code + f32x16::splat(simd, (1 << 23) as f32)).to_array();
        let mut ranges = [0; LEAF];
        for (range, bits) in ranges.iter_mut().zip(bits) {
            *range = bits.to_bits();
        }
        const { assert!(EDGE == 8) };
        ranges
    }

    /// Which lanes hold the center of a pixel, of which there are `block_px` along the edge of a block.
    #[inline(always)]
    fn holds_centers(&self, simd: S, block_px: f32) -> u32 {
        let px = f32x16::splat(simd, block_px);
        // Pixel centers lie at whole numbers and a half, counted from the tile's middle, which is a corner of pixels.
        let half = f32x16::splat(simd, -0.5);
        let first = |low: f32x16<S>| low.mul_add(px, half).ceil();
        let last = |high: f32x16<S>| high.mul_add(px, half).floor();
        let across = first(self.low[0]).simd_le(last(self.high[0]));
        let down = first(self.low[1]).simd_le(last(self.high[1]));
        (across & down).to_bitmask() as u32
    }
}

/// A subtree that touches the tile, and where it starts.
#[derive(Clone, Copy)]
pub(super) struct Entry {
    pub(super) near: f32,
    pub(super) place: Place,
    /// The quads that it touches, and those of them that were open in front of it when it was met.
    pub(super) touched: u8,
    pub(super) open: u8,
}

impl Entry {
    /// Everything.
    pub(super) fn of_all(place: Place) -> Self {
        Self { near: 0.0, place, touched: 0b1111, open: 0b1111 }
    }
}

/// What a walk went through, for the next one of the same tile: every particle that touches the tile is in one of the leaves
/// that were drawn or in one of the subtrees behind. So the next walk needs no node but those that are no longer behind.
#[derive(Default)]
pub(super) struct Memory {
    /// In the order in which they were drawn.
    pub(super) leaves: Vec<Entry>,
    /// What lay behind every ray that it touches.
    pub(super) behind: Vec<Entry>,
}

/// Finds what every ray of the tile meets, and remembers what it went through if a memory is given. `stack` is scratch.
#[simd]
pub(super) fn walk<S: Simd>(
    simd: S,
    bvh: &Bvh,
    view: &View,
    beam: &Beam,
    tile: &mut Tile,
    stack: &mut Vec<Entry>,
    mut memory: Option<&mut Memory>,
) {
    stack.clear();
    match memory.as_deref_mut() {
        // The leaves of the walk before, in its order; then what is no longer hidden behind them.
        Some(memory) if !(memory.leaves.is_empty() && memory.behind.is_empty()) => {
            let entries = memory.behind.drain(..).chain(memory.leaves.drain(..).rev());
            stack.extend(entries.map(|entry| Entry { open: entry.touched, ..entry }));
        }
        _ => stack.extend(bvh.root().map(Entry::of_all)),
    }
    while let Some(entry) = stack.pop() {
        if !tile.is_open(entry.near, entry.open) {
            if let Some(memory) = memory.as_deref_mut() {
                memory.behind.push(entry);
            }
        } else if entry.place.level == 0 {
            draw_leaf(simd, bvh, entry.place.index as usize, view, beam, tile);
            if let Some(memory) = memory.as_deref_mut() {
                memory.leaves.push(entry);
            }
        } else {
            push_children(simd, bvh, entry.place, beam, tile, stack, memory.as_deref_mut());
        }
    }
}

/// Pushes the children that can matter, the nearest last; remembers those that lie behind.
#[simd]
pub(super) fn push_children<S: Simd>(
    simd: S,
    bvh: &Bvh,
    place: Place,
    beam: &Beam,
    tile: &Tile,
    stack: &mut Vec<Entry>,
    memory: Option<&mut Memory>,
) {
    let margin = HIT_ROUNDING * beam.spread + bvh.slack;
    let (center, half) = bvh.node(place).decode(simd, beam.eye, margin);
    let shadow = project(simd, beam, center, half);
    let [touched, open] = shadow.touched_quads(simd, tile);
    let existing = bvh.shown_children(place);
    let mut kept = (open[0] | open[1] | open[2] | open[3]) & existing;
    let near = shadow.near.to_array();
    let remembers = memory.is_some();
    if let Some(memory) = memory {
        let mut behind = (touched[0] | touched[1] | touched[2] | touched[3]) & existing & !kept;
        while behind != 0 {
            let child = behind.trailing_zeros() as usize;
            behind &= behind - 1;
            let place = bvh.child(place, child);
            memory.behind.push(Entry {
                near: near[child],
                place,
                touched: of_child(&touched, child),
                open: 0,
            });
        }
    }
    let first = stack.len();
    while kept != 0 {
        let child = kept.trailing_zeros() as usize;
        kept &= kept - 1;
        let open = of_child(&open, child);
        let touched = if remembers { of_child(&touched, child) } else { open };
        let entry = Entry { near: near[child], place: bvh.child(place, child), touched, open };
        push_sorted(stack, first, entry, |entry| entry.near);
    }
}

/// The quads that have the bit of `child` set.
#[inline(always)]
fn of_child(quads: &[u32; QUADS], child: usize) -> u8 {
    let mut mask = 0;
    for (quad, bits) in quads.iter().enumerate() {
        mask |= (bits >> child & 1) << quad;
    }
    mask as u8
}

/// Draws the particles of a leaf into the tile.
#[simd]
fn draw_leaf<S: Simd>(simd: S, bvh: &Bvh, leaf: usize, view: &View, beam: &Beam, tile: &mut Tile) {
    // Project the sixteen particles at once.
    let radius = bvh.radii(simd, leaf);
    let centers = bvh.centers(simd, leaf);
    let center = centers.minus(Lanes3::splat(simd, beam.eye));
    let shadow = project(simd, beam, center, Ball(grown(simd, radius, center, beam.spread)));
    let [_, open] = shadow.touched_quads(simd, tile);
    let mut kept = (open[0] | open[1] | open[2] | open[3]) & bvh.shown(leaf);
    if let Some(block_px) = beam.centers {
        kept &= shadow.holds_centers(simd, block_px);
    }
    if kept == 0 {
        return;
    }
    let first_node = tile.first_node + (leaf * LEAF) as u32;
    let near = shadow.near.to_array();
    let ranges = shadow.ranges(simd);
    let (centers, radii) = (centers.to_arrays(), radius.to_array());
    while kept != 0 {
        let lane = kept.trailing_zeros() as usize;
        kept &= kept - 1;
        let range = |place: u32| (ranges[lane] >> (3 * place)) as usize % EDGE;
        let (x_low, x_high, y_low, y_high) = (range(0), range(1), range(2), range(3));
        let sphere = Sphere {
            center: Vec3::new(centers[0][lane], centers[1][lane], centers[2][lane]),
            radius: radii[lane],
            node: first_node + lane as u32,
        };
        for y in y_low..=y_high {
            for x in x_low..=x_high {
                let block = block_at(x, y);
                if near[lane] <= tile.block_depth[block] {
                    tile.test(simd, bvh, view, block, &sphere);
                }
            }
        }
    }
    tile.update_quads(simd);
    const { assert!(LEAF == RAYS) };
}
