//! Lines around what stands before something else.
//!
//! An edge lies between two neighboring places, half a place from each. It is one where depth jumps from one particle to another, or where
//! surfaces of two particles cut each other at an angle. A line is what is nearer to an edge than half its width.

use rayon::prelude::*;

use super::fine::Fine;
use super::nearest::nearest;

/// Cosine of the least angle at which surfaces that cut each other have a line: 30 degrees.
const CREASE: f32 = 0.866;
/// By how much the nearest edge is nearer than the silhouette, in places, on average over its directions: edges lie on both sides of it.
const BIAS: f32 = 0.17;
/// No edge. Far beyond all squared distances, which stand in the upper half; in the lower one stands what the edge belongs to.
const NONE: u64 = 1 << 62;

/// How far edges are looked for around a place, for lines of `width` places.
pub(super) fn reach(width: f32) -> i32 {
    (0.5 * width + 1.0).ceil() as i32
}

/// How much of each place lines of `width` places cover, 0 to 1, and the depth of what the nearest one is of. `jump` is in widths.
pub(super) fn coverage(fine: &Fine, width: f32, jump: f32) -> Vec<[f32; 2]> {
    let edges = Edges { fine, least_jump: jump * width };
    let reach = reach(width);
    // Distances are whole in halves of a place: edges lie half a place to the right of theirs, or below.
    let on_place = |offset: i32| ((2 * offset).pow(2) as u64) << 32;
    let behind = |offset: i32| ((2 * offset + 1).pow(2) as u64) << 32;
    let right = nearest(&edges.toward(1, 0), fine.width(), reach, [&behind, &on_place]);
    let below = nearest(&edges.toward(0, 1), fine.width(), reach, [&on_place, &behind]);
    let covered = |key: u64| {
        let distance = 0.5 * ((key >> 32) as f32).sqrt();
        // Of a place that the line's side goes through, a part.
        let share = (0.5 * width - (distance + BIAS) + 0.5).clamp(0.0, 1.0);
        [share, f32::from_bits(key as u32)]
    };
    right.into_par_iter().zip(below).map(|(right, below)| covered(right.min(below))).collect()
}

/// Where edges are.
struct Edges<'a> {
    fine: &'a Fine<'a>,
    /// In edges of a place at the depth of what is in front.
    least_jump: f32,
}

impl Edges<'_> {
    /// By place: the key of the edge between it and the next one across or down.
    fn toward(&self, across: usize, down: usize) -> Vec<u64> {
        let width = self.fine.width();
        let height = self.fine.depth.len() / width;
        let key = |place: usize| {
            let has_next = place % width + across < width && place / width + down < height;
            let front = if has_next { self.between(place, place + across + down * width) } else { None };
            front.map_or(NONE, |depth| u64::from(depth.to_bits()))
        };
        (0..width * height).into_par_iter().map(key).collect()
    }

    /// The depth of what is in front, if there is an edge between two places.
    fn between(&self, one: usize, other: usize) -> Option<f32> {
        let Fine { depth, node, .. } = self.fine;
        let (front, back) = (depth[one].min(depth[other]), depth[one].max(depth[other]));
        if front == f32::INFINITY || back < f32::INFINITY && node[one] == node[other] {
            return None;
        }
        let least = self.least_jump * self.fine.edge_at(front);
        (back - front > least || self.is_crease([one, other], least)).then_some(front)
    }

    /// Whether what two places show is larger than `least` and meets at an angle.
    fn is_crease(&self, places: [usize; 2], least: f32) -> bool {
        let [(one, radius), (other, of_other)] = places.map(|place| self.fine.surface(place));
        radius.min(of_other) > least && one.dot(other) < CREASE
    }
}
