//! Lines around what stands before something else.
//!
//! An edge lies between two neighboring places, half a place from each. It is one where depth jumps from one particle to another, or where
//! surfaces of two particles cut each other at an angle. A line is what lies in the discs around the edges, each as wide as the line is there. The disc that a place is
//! deepest in is that of least power, the squared distance less the squared radius, which is a sum over the axes.

use rayon::prelude::*;

use super::fine::Fine;
use super::nearest::nearest;

/// Cosine of the least angle at which surfaces that cut each other have a line: 30 degrees.
const CREASE: f32 = 0.866;
/// The widest line around a particle, in its radius: of what is small on the picture enough is left to be seen.
const WIDEST: f32 = 1.0 / 3.0;
/// By how much the nearest edge is nearer than the silhouette, in places, on average over its directions: edges lie on both sides of it.
const BIAS: f32 = 0.17;
/// No edge. Far beyond all powers, which stand in the upper half in squares of quarters of a place; in the lower one stands the edge's place.
const NONE: u64 = 1 << 62;

/// How far edges are looked for around a place, for lines of `width` places.
pub(super) fn reach(width: f32) -> i32 {
    (0.5 * width + 1.0).ceil() as i32
}

/// How much of each place lines of `width` places cover, 0 to 1, and the depth of what the line is of. `jump` is in widths.
pub(super) fn coverage(fine: &Fine, width: f32, jump: f32) -> Vec<[f32; 2]> {
    let edges = Edges { fine, width, least_jump: jump * width };
    // Edges lie half a place to the right of theirs, or below.
    let on_place = |offset: i32| ((4 * offset).pow(2) as u64) << 32;
    let behind = |offset: i32| ((4 * offset + 2).pow(2) as u64) << 32;
    let right = edges.discs(1, 0, [&behind, &on_place]);
    let below = edges.discs(0, 1, [&on_place, &behind]);
    right
        .into_par_iter()
        .zip(below)
        .map(|(right, below)| if below[0] > right[0] { below } else { right })
        .collect()
}

/// Half the width of the line at an edge, in places, and the depth of what is in front.
type Edge = Option<[f32; 2]>;

/// Where edges are.
struct Edges<'a> {
    fine: &'a Fine<'a>,
    /// In places.
    width: f32,
    /// In edges of a place at the depth of what is in front.
    least_jump: f32,
}

impl Edges<'_> {
    /// How much of each place lies in the discs around edges between places and the next ones across or down, and the depth of what these are of. `costs` are
    /// squared distances of edges in quarters of a place, in the upper half.
    fn discs(&self, across: usize, down: usize, costs: [&(dyn Fn(i32) -> u64 + Sync); 2]) -> Vec<[f32; 2]> {
        let width = self.fine.width();
        let height = self.fine.depth.len() / width;
        let edge = |place: usize| -> Edge {
            let has_next = place % width + across < width && place / width + down < height;
            if has_next { self.between(place, place + across + down * width) } else { None }
        };
        let edges: Vec<Edge> = (0..width * height).into_par_iter().map(edge).collect();
        let square = |half: f32| (16.0 * half * half).round() as u64;
        let widest = square(0.5 * self.width);
        // How much less than the widest disc's the squared radius is.
        let lack = |half: f32| widest - square(half).min(widest);
        let key =
            |(place, edge): (usize, &Edge)| edge.map_or(NONE, |[half, _]| lack(half) << 32 | place as u64);
        let seeds: Vec<u64> = edges.par_iter().enumerate().map(key).collect();
        let covered = |key: u64| {
            let Some([half, depth]) =
                edges.get(key as u32 as usize).copied().flatten().filter(|_| key < NONE)
            else {
                return [0.0; 2];
            };
            let distance = 0.25 * (((key >> 32) - lack(half)) as f32).sqrt();
            // Of a place that the line's side goes through, a part.
            [(half - (distance + BIAS) + 0.5).clamp(0.0, 1.0), depth]
        };
        nearest(&seeds, width, reach(self.width), costs).into_par_iter().map(covered).collect()
    }

    /// The edge between two places, if there is one.
    fn between(&self, one: usize, other: usize) -> Edge {
        let Fine { depth, node, .. } = self.fine;
        let (near, far) = if depth[one] <= depth[other] { (one, other) } else { (other, one) };
        let (front, back) = (depth[near], depth[far]);
        if front == f32::INFINITY || back < f32::INFINITY && node[near] == node[far] {
            return None;
        }
        let place = self.fine.edge_at(front);
        let least = self.least_jump * place;
        let surface = self.fine.touched(near);
        let mut radius = surface.size;
        if back - front <= least {
            let other = self.fine.touched(far);
            radius = radius.min(other.size);
            // Caps of two particles part where these cut each other.
            let is_even = surface.normal.dot(other.normal) >= CREASE && !(surface.is_cap && other.is_cap);
            if radius <= least || is_even {
                return None;
            }
        }
        Some([0.5 * self.width.min(WIDEST * radius / place), front])
    }
}
