//! Sixteen rays of the march side by side: each goes its own way through the bricks, all in the same instructions.
//!
//! Takes sixteen paths and what the march looks up; gives for each what [`super::march`] finds for one ray, bit for bit. A step of all
//! sixteen finds their bricks, sends those in empty ones ahead, and looks up density and light for the others. Sixteen look-ups that do
//! not wait for each other hide the time that memory takes. Where some bricks are finer, each ray has steps of its own length.

use fearless_simd::{f32x16, i32x16, prelude::*, u32x16};
use fearless_simd_macros::simd;
use glam::Vec3;

use super::lit::{LitBricks, Spectrum};
use super::march::DARK;
use super::space::Space;
use super::walk::Path;
use crate::math::exp_minus;
use crate::medium::grid::{BRICK, EDGE, STORED};
use crate::simd::Lanes3;

/// Rays side by side.
pub(super) const RAYS: usize = 16;

/// Sixteen paths. One of length 0 is of no ray.
pub(super) struct Paths {
    start: [[f32; RAYS]; 3],
    direction: [[f32; RAYS]; 3],
    inv_direction: [[f32; RAYS]; 3],
    enter: [f32; RAYS],
    length: [f32; RAYS],
    /// Where on a step its point lies.
    offset: [f32; RAYS],
}

impl Paths {
    pub(super) fn new() -> Self {
        let none = [0.0; RAYS];
        let [start, direction, inv_direction] = [[none; 3], [[1.0; RAYS]; 3], [[1.0; RAYS]; 3]];
        Self { start, direction, inv_direction, enter: none, length: none, offset: none }
    }

    #[inline(always)]
    pub(super) fn set(&mut self, lane: usize, path: &Path, offset: f32) {
        for axis in 0..3 {
            self.start[axis][lane] = path.start[axis];
            self.direction[axis][lane] = path.direction[axis];
            self.inv_direction[axis][lane] = path.inv_direction[axis];
        }
        (self.enter[lane], self.length[lane], self.offset[lane]) = (path.enter, path.length, offset);
    }
}

/// What a step meets.
pub(super) struct Matter<const C: usize> {
    /// Extinction of density 1 over the length of the step, of each color.
    pub(super) extinction: [f32; C],
    /// Whether nothing is absorbed: see [`crate::medium::Emission::additive`].
    pub(super) additive: bool,
}

/// What sixteen rays have gathered, of `C` colors.
pub(super) struct Gathered<const C: usize> {
    pub(super) transmittance: [[f32; RAYS]; C],
    pub(super) scattered: [[f32; RAYS]; C],
    pub(super) depth: [f32; RAYS],
    pub(super) lost: [f32; RAYS],
}

/// What a ray has in each channel; one color stands for all three.
#[inline(always)]
pub(super) fn rgb<const C: usize>(colors: &[[f32; RAYS]; C], lane: usize) -> Vec3 {
    Vec3::new(colors[0][lane], colors[C / 2][lane], colors[C - 1][lane])
}

/// Density and light at the eight corners of sixteen cells: by y and z of the row, in fours as they lie in memory, each of all rays.
/// Where light has one color, the first four are those of both sides along x; else there are four a side.
type Corners = [[[[f32; FOUR]; RAYS]; 2]; 4];
const FOUR: usize = 4;

/// Marches along sixteen paths in steps of one length, parted where bricks are. `V` is one more than the `C` colors; `matter` is that of a step.
#[inline(always)]
pub(super) fn march<S: Simd, L: Spectrum, const C: usize, const V: usize>(
    simd: S,
    paths: &Paths,
    bricks: &LitBricks<L>,
    step: f32,
    matter: &Matter<C>,
) -> Gathered<C> {
    match bricks.is_even() {
        true => march_by::<_, _, C, V, true>(simd, paths, bricks, step, matter),
        false => march_by::<_, _, C, V, false>(simd, paths, bricks, step, matter),
    }
}

/// The same; `EVEN` says that no brick is parted.
#[simd]
fn march_by<S: Simd, L: Spectrum, const C: usize, const V: usize, const EVEN: bool>(
    simd: S,
    paths: &Paths,
    bricks: &LitBricks<L>,
    step: f32,
    matter: &Matter<C>,
) -> Gathered<C> {
    const { assert!(V == C + 1 && (2 * V).is_multiple_of(FOUR) && size_of::<L::Sample>() == V * size_of::<f32>()) };
    let (zero, one) = (f32x16::splat(simd, 0.0), f32x16::splat(simd, 1.0));
    let (start, direction) = (Lanes3::load(simd, &paths.start), Lanes3::load(simd, &paths.direction));
    let inv_direction = Lanes3::load(simd, &paths.inv_direction);
    let offset = f32x16::load_array_ref(simd, &paths.offset);
    let (enter, length) =
        (f32x16::load_array_ref(simd, &paths.enter), f32x16::load_array_ref(simd, &paths.length));

    let mut corners: Corners = [[[[0.0; FOUR]; RAYS]; 2]; 4];
    let (mut transmittance, mut scattered) = ([f32x16::splat(simd, 1.0); C], [zero; C]);
    let (mut depth, mut lost_in_all) = (zero, zero);
    // Steps that are done or crossed, parts of the present one, and what share of it each is.
    let (mut number, mut part, mut share) = (zero, zero, one);
    let mut on_the_way = zero.simd_lt(length);
    loop {
        if !EVEN {
            let begins = on_the_way & part.simd_eq(zero);
            if begins.to_bitmask() != 0 {
                let middle = (number + f32x16::splat(simd, 0.5)) * f32x16::splat(simd, step);
                let place = start.plus(direction.times(begins.select(middle, zero)));
                let brick = floor(place.times(f32x16::splat(simd, 1.0 / BRICK as f32)));
                share = begins.select(bricks.space.shares(simd, brick), share);
            }
        }
        let inside = if EVEN { offset } else { share * (part + offset) };
        let distance = (number + inside) * f32x16::splat(simd, step);
        on_the_way &= distance.simd_lt(length);
        if on_the_way.to_bitmask() == 0 {
            break;
        }
        let before = number;
        if EVEN {
            number += one;
        } else {
            part += one;
            let ends = (part * share).simd_ge(one);
            number = ends.select(number + one, number);
            part = ends.select(zero, part);
        }
        // Rays that are through stay where they began: their distance may be no number.
        let distance = on_the_way.select(distance, zero);
        let place = start.plus(direction.times(distance));
        let brick = floor(place.times(f32x16::splat(simd, 1.0 / BRICK as f32)));
        let (number_of, entries) = bricks.space.entries(simd, brick);
        let filled = on_the_way & entries.simd_ge(zero);
        if (on_the_way & !filled).to_bitmask() != 0 {
            let end = leave(simd, (start, inv_direction), brick, -entries);
            let margin = if EVEN { offset } else { one };
            let ahead = (end / f32x16::splat(simd, step) - margin).ceil();
            let jumps = !filled & ahead.simd_gt(before);
            number = jumps.select(ahead.max(number), number);
            part = jumps.select(zero, part);
        }
        let left = filled.to_bitmask() as u32;
        if left == 0 {
            continue;
        }

        let last = bricks.last;
        let inside = Lanes3 {
            x: place.x.max(zero).min(f32x16::splat(simd, last.x)),
            y: place.y.max(zero).min(f32x16::splat(simd, last.y)),
            z: place.z.max(zero).min(f32x16::splat(simd, last.z)),
        };
        let (number_of, inside) = match EVEN {
            true => (number_of, inside),
            false => bricks.parts(simd, inside, &number_of, left),
        };
        let cell = floor(inside);
        let fraction = inside.minus(cell);
        let first = floor(inside.times(f32x16::splat(simd, 1.0 / BRICK as f32)))
            .times(f32x16::splat(simd, BRICK as f32));
        let at = cell.minus(first);
        // Exact in floats.
        let at =
            at.x + at.y * f32x16::splat(simd, EDGE as f32) + at.z * f32x16::splat(simd, (EDGE * EDGE) as f32);
        let at = at.to_int::<u32x16<S>>().to_array();
        collect::<L, V>(bricks, &number_of, &at, left, &mut corners);
        let values: [_; V] = interpolate(simd, &corners, fraction);

        let density = values[0];
        let holds = filled & density.simd_gt(zero);
        let (mut most, mut lost_here) = (zero, zero);
        for color in 0..C {
            let density = if EVEN { density } else { share * density };
            let thickness = f32x16::splat(simd, matter.extinction[color]) * density;
            let mut lost = thickness;
            if !matter.additive {
                let rest = f32x16::load_array(simd, exponentials(thickness.to_array()));
                let through = transmittance[color] * rest;
                lost = transmittance[color] - through;
                transmittance[color] = holds.select(through, transmittance[color]);
            }
            let lost = holds.select(lost, zero);
            scattered[color] += lost * holds.select(values[1 + color], zero);
            most = most.max(transmittance[color]);
            lost_here += lost;
        }
        if C == 1 {
            lost_here *= f32x16::splat(simd, 3.0);
        }
        depth += lost_here * (enter + distance);
        lost_in_all += lost_here;
        on_the_way &= most.simd_ge(f32x16::splat(simd, DARK));
    }
    let mut gathered = Gathered {
        transmittance: [[0.0; RAYS]; C],
        scattered: [[0.0; RAYS]; C],
        depth: depth.to_array(),
        lost: lost_in_all.to_array(),
    };
    for color in 0..C {
        transmittance[color].store_array(&mut gathered.transmittance[color]);
        scattered[color].store_array(&mut gathered.scattered[color]);
    }
    gathered
}

impl Space {
    /// [`Space::entry`] of bricks, as it is kept: their numbers, or minus how far the next one is; also as floats.
    #[inline(always)]
    fn entries<S: Simd>(&self, simd: S, brick: Lanes3<f32x16<S>>) -> ([i32; RAYS], f32x16<S>) {
        let places = self.places(simd, brick);
        let mut numbers = [0; RAYS];
        for lane in 0..RAYS {
            numbers[lane] = self.entries[places[lane] as usize];
        }
        (numbers, i32x16::load_array(simd, numbers).to_float())
    }

    /// [`Space::share`] of bricks.
    #[inline(always)]
    fn shares<S: Simd>(&self, simd: S, brick: Lanes3<f32x16<S>>) -> f32x16<S> {
        let places = self.places(simd, brick);
        let mut shares = [1.0; RAYS];
        for lane in 0..RAYS {
            shares[lane] = self.shares[places[lane] as usize];
        }
        f32x16::load_array(simd, shares)
    }

    /// The places of bricks among the entries.
    #[inline(always)]
    fn places<S: Simd>(&self, simd: S, brick: Lanes3<f32x16<S>>) -> [u32; RAYS] {
        let margin = self.margin as f32;
        let whole = |it: f32x16<S>| it.to_int::<u32x16<S>>();
        let x = whole(within(simd, brick.x, margin, self.last.x));
        let y = whole(within(simd, brick.y, margin, self.last.y));
        let z = whole(within(simd, brick.z, margin, self.last.z));
        let [width, height, _] = self.size.map(|it| u32x16::splat(simd, it as u32));
        ((z * height + y) * width + x).to_array()
    }
}

impl<L: Spectrum> LitBricks<L> {
    /// The numbers of the parts in which places are, in bricks of numbers that count in the lanes of the mask, and the places in units of the parts' spacings.
    #[inline(always)]
    fn parts<S: Simd>(
        &self,
        simd: S,
        place: Lanes3<f32x16<S>>,
        numbers: &[i32; RAYS],
        mut left: u32,
    ) -> ([i32; RAYS], Lanes3<f32x16<S>>) {
        let (mut along, mut first) = ([1.0; RAYS], [0; RAYS]);
        while left != 0 {
            let lane = left.trailing_zeros() as usize;
            left &= left - 1;
            let parts = self.parts[numbers[lane] as usize];
            (along[lane], first[lane]) = (parts.along, parts.first as i32);
        }
        let along = f32x16::load_array(simd, along);
        let in_bricks = f32x16::splat(simd, 1.0 / BRICK as f32);
        let corner = floor(place.times(in_bricks)).times(along);
        let place = place.times(along);
        let part = floor(place.times(in_bricks)).minus(corner);
        // Exact in floats.
        let number = part.x + part.y * along + part.z * (along * along);
        let number = i32x16::load_array(simd, first) + number.to_int::<i32x16<S>>();
        (number.to_array(), place)
    }
}

/// Counted from the first brick of the margin, and between the first and the last.
#[inline(always)]
fn within<S: Simd>(simd: S, brick: f32x16<S>, margin: f32, last: f32) -> f32x16<S> {
    let from_margin = brick + f32x16::splat(simd, margin);
    from_margin.max(f32x16::splat(simd, 0.0)).min(f32x16::splat(simd, last))
}

/// [`Space::leave`] on lanes.
#[inline(always)]
fn leave<S: Simd>(
    simd: S,
    (start, inv_direction): (Lanes3<f32x16<S>>, Lanes3<f32x16<S>>),
    brick: Lanes3<f32x16<S>>,
    away: f32x16<S>,
) -> f32x16<S> {
    leave_axis(simd, brick.x, away, start.x, inv_direction.x)
        .min(leave_axis(simd, brick.y, away, start.y, inv_direction.y))
        .min(leave_axis(simd, brick.z, away, start.z, inv_direction.z))
}

#[inline(always)]
fn leave_axis<S: Simd>(
    simd: S,
    brick: f32x16<S>,
    away: f32x16<S>,
    start: f32x16<S>,
    inv_direction: f32x16<S>,
) -> f32x16<S> {
    let (edge, one) = (f32x16::splat(simd, BRICK as f32), f32x16::splat(simd, 1.0));
    let forward = inv_direction.simd_gt(f32x16::splat(simd, 0.0));
    let side = forward.select(edge * (brick + away), edge * (brick - (away - one)));
    (side - start) * inv_direction
}

#[inline(always)]
fn floor<S: Simd>(at: Lanes3<f32x16<S>>) -> Lanes3<f32x16<S>> {
    Lanes3 { x: at.x.floor(), y: at.y.floor(), z: at.z.floor() }
}

/// Fetches the corners of the cells of the lanes in the mask, which lie at `at` in their bricks.
#[inline(always)]
fn collect<L: Spectrum, const V: usize>(
    bricks: &LitBricks<L>,
    numbers: &[i32; RAYS],
    at: &[u32; RAYS],
    mut left: u32,
    corners: &mut Corners,
) {
    let samples: &[f32] = bytemuck::cast_slice(&bricks.samples);
    while left != 0 {
        let lane = left.trailing_zeros() as usize;
        left &= left - 1;
        let first = (numbers[lane] as usize * STORED + at[lane] as usize) * V;
        let cell = &samples[first..first + (EDGE * EDGE + EDGE + 2) * V];
        for (row, from) in [0, EDGE, EDGE * EDGE, EDGE * EDGE + EDGE].into_iter().enumerate() {
            let (from, _) = cell[from * V..][..2 * V].as_chunks::<FOUR>();
            for (fours, from) in corners[row].iter_mut().zip(from) {
                fours[lane] = *from;
            }
        }
    }
}

/// Trilinear, along z, y and x in turn.
#[inline(always)]
fn interpolate<S: Simd, const V: usize>(
    simd: S,
    corners: &Corners,
    fraction: Lanes3<f32x16<S>>,
) -> [f32x16<S>; V] {
    let mut values = [f32x16::splat(simd, 0.0); V];
    let [a, b, c, d] = corners;
    for (four, (((a, b), c), d)) in a.iter().zip(b).zip(c).zip(d).take(2 * V / FOUR).enumerate() {
        let mut mixed = [f32x16::splat(simd, 0.0); FOUR];
        let (a, b, c, d) = (turned(simd, a), turned(simd, b), turned(simd, c), turned(simd, d));
        for place in 0..FOUR {
            let (low, high) = (
                a[place] + fraction.z * (c[place] - a[place]),
                b[place] + fraction.z * (d[place] - b[place]),
            );
            mixed[place] = low + fraction.y * (high - low);
        }
        for (place, mixed) in mixed.into_iter().enumerate() {
            let (side, value) = ((four * FOUR + place) / V, (four * FOUR + place) % V);
            values[value] = match side {
                0 => mixed,
                _ => values[value] + fraction.x * (mixed - values[value]),
            };
        }
    }
    values
}

/// The first of each four, the second, and so on.
#[inline(always)]
fn turned<S: Simd>(simd: S, fours: &[[f32; FOUR]; RAYS]) -> [f32x16<S>; FOUR] {
    let flat = fours.as_flattened();
    let [a, b, c, d] = [
        f32x16::from_slice(simd, &flat[..RAYS]),
        f32x16::from_slice(simd, &flat[RAYS..2 * RAYS]),
        f32x16::from_slice(simd, &flat[2 * RAYS..3 * RAYS]),
        f32x16::from_slice(simd, &flat[3 * RAYS..]),
    ];
    let (even_low, odd_low) = a.deinterleave(b);
    let (even_high, odd_high) = c.deinterleave(d);
    let (first, third) = even_low.deinterleave(even_high);
    let (second, fourth) = odd_low.deinterleave(odd_high);
    [first, second, third, fourth]
}

/// [`exp_minus`] of sixteen numbers.
#[inline(always)]
fn exponentials(mut numbers: [f32; RAYS]) -> [f32; RAYS] {
    for number in &mut numbers {
        *number = exp_minus(*number);
    }
    numbers
}
