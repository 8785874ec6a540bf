//! All points of a film tile that look for a light in one direction, answered in one walk by bounds on both sides.
//!
//! The points are projected along the direction, sixteen a packet, and packets have the rectangle that they span. The walk goes once
//! through what lies between the points and the light, in the order of the light's rays; each subtree carries the packets that it can
//! shadow. A particle against the sixteen points of a packet is a disc in two dimensions: a point well inside the disc and well
//! before the sphere is surely shadowed, one well outside surely not. `Well` is by more than the rounding of the hit formula
//! and of the projection; only between the two does [`crate::math::enter_sphere`] decide. So the answer is that of a ray each,
//! bit for bit.

use fearless_simd::{f32x16, mask32x16, prelude::*, u32x16};
use fearless_simd_macros::simd;
use glam::Vec3;

use super::hits::PACKETS;
use super::shadows::{Light, Span, under};
use super::tiles::RAYS;
use crate::math::HIT_ROUNDING;
use crate::render::certified::Counts;
use crate::simd::{Ball, Lanes3, enter_sphere, grown};
use crate::structure::bvh::{Bvh, LEAF, Place, WIDTH, push_sorted};

/// Points by packet: where they are in space and in the light's coordinates, and the nodes of the particles on which they lie.
#[derive(Clone, Copy)]
pub(super) struct Points<'a> {
    pub(super) position: &'a [[[f32; RAYS]; 3]; PACKETS],
    pub(super) at: &'a [[[f32; RAYS]; 3]; PACKETS],
    pub(super) on: &'a [[u32; RAYS]; PACKETS],
}

/// What the points of each packet that are still lit span: a rectangle across the direction, and the depth of the first along it;
/// infinite where none is left.
pub(super) struct Spans {
    middle: [[f32; PACKETS]; 2],
    half: [[f32; PACKETS]; 2],
    first: [f32; PACKETS],
    /// The corners of the rectangle of all packets.
    pub(super) low: [f32; 2],
    pub(super) high: [f32; 2],
    /// How many times the packets' rectangles would fill that of all.
    pub(super) overlap: f32,
}

impl Spans {
    /// Of the points in the masks `lit`.
    #[inline(always)]
    pub(super) fn of<S: Simd>(simd: S, at: &[[[f32; RAYS]; 3]; PACKETS], lit: &[u16; PACKETS]) -> Self {
        let mut spans = Self {
            middle: [[0.0; PACKETS]; 2],
            half: [[0.0; PACKETS]; 2],
            first: [f32::INFINITY; PACKETS],
            low: [f32::INFINITY; 2],
            high: [f32::NEG_INFINITY; 2],
            overlap: 0.0,
        };
        let (above, below) = (f32x16::splat(simd, f32::INFINITY), f32x16::splat(simd, f32::NEG_INFINITY));
        let mut area = 0.0;
        for packet in 0..PACKETS {
            if lit[packet] == 0 {
                continue;
            }
            let lanes = mask32x16::from_bitmask(simd, u64::from(lit[packet]));
            let at = Lanes3::load(simd, &at[packet]);
            let low = [lanes.select(at.x, above).reduce_min(), lanes.select(at.y, above).reduce_min()];
            let high = [lanes.select(at.x, below).reduce_max(), lanes.select(at.y, below).reduce_max()];
            for axis in 0..2 {
                let (low, high) = (low[axis], high[axis]);
                spans.middle[axis][packet] = 0.5 * (low + high);
                spans.half[axis][packet] = 0.5 * (high - low);
                spans.low[axis] = spans.low[axis].min(low);
                spans.high[axis] = spans.high[axis].max(high);
            }
            area += 4.0 * spans.half[0][packet] * spans.half[1][packet];
            spans.first[packet] = lanes.select(at.z, above).reduce_min();
        }
        let all = (spans.high[0] - spans.low[0]) * (spans.high[1] - spans.low[1]);
        spans.overlap = area / all.max(f32::MIN_POSITIVE);
        spans
    }

    /// Which of the packets in the mask something at (x, y) that reaches so far to both sides, and up to `top`, can shadow.
    #[inline(always)]
    fn under<S: Simd>(&self, simd: S, packets: u64, [x, y]: [f32; 2], reach: [f32; 2], top: f32) -> u64 {
        let mut under = 0;
        for group in 0..PACKETS / RAYS {
            if packets >> (group * RAYS) & 0xffff == 0 {
                continue;
            }
            let off_x = (sixteen(simd, &self.middle[0], group) - f32x16::splat(simd, x)).abs();
            let off_y = (sixteen(simd, &self.middle[1], group) - f32x16::splat(simd, y)).abs();
            let meets = off_x.simd_le(sixteen(simd, &self.half[0], group) + f32x16::splat(simd, reach[0]))
                & off_y.simd_le(sixteen(simd, &self.half[1], group) + f32x16::splat(simd, reach[1]))
                & sixteen(simd, &self.first, group).simd_le(f32x16::splat(simd, top));
            under |= meets.to_bitmask() << (group * RAYS);
        }
        under & packets
    }

    /// The depth of the first of all points along the direction.
    pub(super) fn nearest(&self) -> f32 {
        self.first.iter().copied().fold(f32::INFINITY, f32::min)
    }

    /// Of one packet.
    #[inline(always)]
    fn of_packet(&self, packet: usize) -> Span {
        Span {
            middle: [self.middle[0][packet], self.middle[1][packet]],
            half: [self.half[0][packet], self.half[1][packet]],
            first: self.first[packet],
        }
    }
}

/// What sixteen packets side by side have of a column.
#[inline(always)]
fn sixteen<S: Simd>(simd: S, column: &[f32; PACKETS], group: usize) -> f32x16<S> {
    f32x16::from_slice(simd, &column[group * RAYS..(group + 1) * RAYS])
}

/// So few packets are looked at one by one, and their points too: where these lie far apart, most subtrees pass between them.
const FEW: u32 = 16;

/// A subtree that is still to be walked, for the packets in the mask.
#[derive(Clone, Copy)]
pub(super) struct Entry {
    /// Of its middle along the direction.
    depth: f32,
    place: Place,
    packets: u64,
}

/// Clears the bits in `lit` of all points that do not see past every particle. `stack` is scratch.
#[simd]
#[expect(clippy::too_many_arguments, reason = "one walk, cut where it is readable")]
pub(super) fn shadow<S: Simd>(
    simd: S,
    bvh: &Bvh,
    light: &Light,
    points: Points,
    mut spans: Spans,
    lit: &mut [u16; PACKETS],
    stack: &mut Vec<Entry>,
    counts: &mut Counts,
) {
    let Some(root) = bvh.root() else { return };
    let packets = (0..PACKETS).filter(|&packet| lit[packet] != 0).fold(0, |mask, packet| mask | 1 << packet);
    stack.clear();
    stack.push(Entry { depth: 0.0, place: root, packets });
    while let Some(entry) = stack.pop() {
        if entry.place.level > 0 {
            push_children(simd, bvh, &entry, light, points, &spans, lit, stack);
        } else {
            shadow_of_leaf(simd, bvh, &entry, light, points, &mut spans, lit, counts);
        }
    }
}

/// Pushes the children that can shadow a packet, the first along the direction last.
#[simd]
#[expect(clippy::too_many_arguments, reason = "one walk, cut where it is readable")]
fn push_children<S: Simd>(
    simd: S,
    bvh: &Bvh,
    entry: &Entry,
    light: &Light,
    points: Points,
    spans: &Spans,
    lit: &[u16; PACKETS],
    stack: &mut Vec<Entry>,
) {
    let margin = HIT_ROUNDING * light.spread + bvh.slack;
    let (center, half) = bvh.node(entry.place).decode(simd, light.origin, margin);
    let center = light.project(simd, center);
    let reach = light.reach(simd, half);
    let (x, y, z) = (center.x.to_array(), center.y.to_array(), center.z.to_array());
    let (reach_x, reach_y) = (reach.x.to_array(), reach.y.to_array());
    let tops = (center.z + reach.z).to_array();
    let shown = bvh.shown_children(entry.place);
    let mut packets_of = [0; WIDTH];
    if entry.packets.count_ones() <= FEW {
        let mut left = entry.packets;
        while left != 0 {
            let packet = left.trailing_zeros() as usize;
            left &= left - 1;
            let mut kept = spans.of_packet(packet).meets(simd, &center, &reach) & shown;
            let at = Lanes3::load(simd, &points.at[packet]);
            while kept != 0 {
                let child = kept.trailing_zeros() as usize;
                kept &= kept - 1;
                let (place, reach) = ([x[child], y[child]], [reach_x[child], reach_y[child]]);
                let under = under(simd, &at, place, reach, tops[child]) & u32::from(lit[packet]);
                packets_of[child] |= u64::from(under != 0) << packet;
            }
        }
    } else {
        for child in (0..WIDTH).filter(|child| shown >> child & 1 == 1) {
            let (place, reach) = ([x[child], y[child]], [reach_x[child], reach_y[child]]);
            packets_of[child] = spans.under(simd, entry.packets, place, reach, tops[child]);
        }
    }
    let first = stack.len();
    for (child, packets) in packets_of.into_iter().enumerate().filter(|&(_, packets)| packets != 0) {
        let entry = Entry { depth: z[child], place: bvh.child(entry.place, child), packets };
        push_sorted(stack, first, entry, |entry| entry.depth);
    }
}

/// Clears the bits of points in the shadow of a particle of the leaf.
#[simd]
#[expect(clippy::too_many_arguments, reason = "one walk, cut where it is readable")]
fn shadow_of_leaf<S: Simd>(
    simd: S,
    bvh: &Bvh,
    entry: &Entry,
    light: &Light,
    points: Points,
    spans: &mut Spans,
    lit: &mut [u16; PACKETS],
    counts: &mut Counts,
) {
    // Discs in the light's coordinates: no smaller and no larger than the formula can take them for.
    let leaf = entry.place.index as usize;
    let radius = bvh.radii(simd, leaf);
    let centers = bvh.centers(simd, leaf);
    let offset = centers.minus(Lanes3::splat(simd, light.origin));
    let outer = grown(simd, radius, offset, light.spread);
    let margin = outer - radius;
    let inner = (radius - margin).max(f32x16::splat(simd, 0.0));
    let center = light.project(simd, offset);
    let least = f32x16::splat(simd, f32::MIN_POSITIVE);
    let discs = Discs {
        center: center.to_arrays(),
        inner_sq: (inner * inner - least).to_array(),
        outer_sq: (outer * outer + least).to_array(),
        margin: margin.to_array(),
    };
    let reach = light.reach(simd, Ball(outer));
    let shown = bvh.shown(leaf);

    let mut packets = entry.packets;
    while packets != 0 {
        let packet = packets.trailing_zeros() as usize;
        packets &= packets - 1;
        if lit[packet] == 0 {
            continue;
        }
        let mut kept = spans.of_packet(packet).meets(simd, &center, &reach) & shown;
        if kept == 0 {
            continue;
        }
        let mut left = lit[packet];
        let at = Lanes3::load(simd, &points.at[packet]);
        let on = u32x16::load_array_ref(simd, &points.on[packet]);
        while kept != 0 {
            let lane = kept.trailing_zeros() as usize;
            kept &= kept - 1;
            let (sure, open) = discs.shadow(simd, lane, &at);
            let open = open & left;
            if open == 0 {
                continue;
            }
            let node = (leaf * LEAF + lane) as u32;
            let other = !on.simd_eq(u32x16::splat(simd, node)).to_bitmask() as u16;
            let mut shadowed = sure & other;
            counts.surely_shadowed += u64::from((shadowed & left).count_ones());
            let undecided = open & other & !sure;
            if undecided != 0 {
                counts.traced += u64::from(undecided.count_ones());
                shadowed |= undecided & exact(simd, bvh.sphere(node), light.toward, &points.position[packet]);
            }
            left &= !shadowed;
            if left == 0 {
                break;
            }
        }
        if left != lit[packet] {
            lit[packet] = left;
            if left == 0 {
                spans.first[packet] = f32::INFINITY;
            }
        }
    }
}

/// The particles of a leaf across the direction, with squares of radii that are surely too small and surely too large.
struct Discs {
    center: [[f32; LEAF]; 3],
    inner_sq: [f32; LEAF],
    outer_sq: [f32; LEAF],
    /// What the rounding of the hit formula can change.
    margin: [f32; LEAF],
}

impl Discs {
    /// Which points particle `lane` surely shadows, and which it does not surely leave lit.
    #[inline(always)]
    fn shadow<S: Simd>(&self, simd: S, lane: usize, at: &Lanes3<f32x16<S>>) -> (u16, u16) {
        let off_x = at.x - f32x16::splat(simd, self.center[0][lane]);
        let off_y = at.y - f32x16::splat(simd, self.center[1][lane]);
        // From the point on to the sphere's middle.
        let ahead = f32x16::splat(simd, self.center[2][lane]) - at.z;
        let off_sq = off_y.mul_add(off_y, off_x * off_x);
        let distance_sq = ahead.mul_add(ahead, off_sq);
        let inner_sq = f32x16::splat(simd, self.inner_sq[lane]);
        let outer_sq = f32x16::splat(simd, self.outer_sq[lane]);
        let margin = f32x16::splat(simd, self.margin[lane]);
        let open = off_sq.simd_lt(outer_sq) & distance_sq.simd_gt(inner_sq) & ahead.simd_gt(-margin);
        // Outside the sphere, and its middle ahead: the ray that passes so near enters.
        let sure = off_sq.simd_lt(inner_sq) & distance_sq.simd_gt(outer_sq) & ahead.simd_gt(margin);
        (sure.to_bitmask() as u16, open.to_bitmask() as u16)
    }
}

/// Which of the points a sphere shadows, by the formula of a ray.
#[simd]
fn exact<S: Simd>(simd: S, (center, radius): (Vec3, f32), toward: Vec3, position: &[[f32; RAYS]; 3]) -> u16 {
    let to_center = Lanes3::splat(simd, center).minus(Lanes3::load(simd, position));
    let radius_sq = f32x16::splat(simd, radius * radius);
    let (t, meets) = enter_sphere(simd, to_center, Lanes3::splat(simd, toward), radius_sq);
    (meets & f32x16::splat(simd, 0.0).simd_lt(t)).to_bitmask() as u16
}
