//! Which particles are near: particles sorted into cells, and a hierarchy of boxes over the cells.
//!
//! Takes positions, gives the particles within a distance of a box as columns ready for lanes ([`Cells::collect`]). Particles
//! stand in the order of a Hilbert curve; sixteen neighbors along it are a cell, eight cells a node, eight nodes the next, so that
//! the tree has no pointers and cells are as small as the particles are dense.
//!
//! Invariant: a box holds all centers below it; what would fill the last cell and the last node of a level is infinitely far away.

mod collect;

use glam::Vec3;
use rayon::prelude::*;

pub(super) use self::collect::{Candidates, Counted, Radius, Reach, Region, Within};
use crate::curve::hilbert;
use crate::math::Bounds;
use crate::particles::Positions;

/// Particles in a cell.
pub(super) const CELL: usize = 16;
/// Children of a node.
const WIDTH: usize = 8;
/// Bits of a coordinate on the curve.
const CURVE_BITS: u32 = 16;
/// A value of each particle, cell by cell.
pub(super) type Column = Vec<[f32; CELL]>;

/// The curve along which the particles in a box are sorted.
#[derive(Clone, Copy)]
pub(super) struct Curve {
    first: Vec3,
    /// Its cells over a length.
    scale: f32,
}

impl Curve {
    /// Cells along an axis.
    pub(super) const CELLS: u32 = 1 << CURVE_BITS;

    /// Through a box.
    pub(super) fn through(bounds: Bounds) -> Self {
        let longest = bounds.extent().max_element().max(f32::MIN_POSITIVE);
        Self { first: bounds.min, scale: (Self::CELLS - 1) as f32 / longest }
    }

    /// Its cell around a point of the box.
    #[inline(always)]
    pub(super) fn cell(&self, at: Vec3) -> [u32; 3] {
        ((at - self.first) * self.scale).as_uvec3().to_array()
    }

    /// Where it reaches a cell.
    pub(super) fn place(cell: [u32; 3]) -> u64 {
        hilbert(cell, CURVE_BITS)
    }

    /// The edge of its cells.
    pub(super) fn edge(&self) -> f32 {
        1.0 / self.scale
    }
}

/// The boxes of eight children.
#[derive(Clone, Copy)]
struct Node {
    center: [[f32; WIDTH]; 3],
    half: [[f32; WIDTH]; 3],
}

/// Particles sorted into cells. See the module.
pub(super) struct Cells {
    count: usize,
    centers: Vec<[[f32; CELL]; 3]>,
    ids: Vec<[u32; CELL]>,
    /// From the parents of cells up to the root.
    levels: Vec<Vec<Node>>,
    bounds: Bounds,
}

impl Cells {
    /// Sorts positions into cells.
    pub(super) fn new(positions: &Positions) -> Self {
        let bounds = (0..positions.len())
            .into_par_iter()
            .with_min_len(1 << 14)
            .fold(|| Bounds::EMPTY, |bounds, id| bounds.with(positions.offset(id)))
            .reduce(|| Bounds::EMPTY, Bounds::union);
        Self::within(bounds, positions.len(), |id| positions.offset(id))
    }

    /// Sorts `count` particles among others: `bounds` is the box of all.
    pub(super) fn within(bounds: Bounds, count: usize, position: impl Fn(usize) -> Vec3 + Sync) -> Self {
        let curve = Curve::through(bounds);
        let mut order: Vec<(u64, u32)> = (0..count)
            .into_par_iter()
            .map(|id| (Curve::place(curve.cell(position(id))), id as u32))
            .collect();
        order.par_sort_unstable();

        let cell = |sorted: &[(u64, u32)]| {
            let mut center = [[f32::INFINITY; CELL]; 3];
            let mut ids = [u32::MAX; CELL];
            for (lane, &(_, id)) in sorted.iter().enumerate() {
                let offset = position(id as usize);
                (0..3).for_each(|axis| center[axis][lane] = offset[axis]);
                ids[lane] = id;
            }
            (center, ids)
        };
        let (centers, ids): (Vec<_>, Vec<_>) = order.par_chunks(CELL).map(cell).unzip();
        drop(order);
        let mut cells = Self { count, centers, ids, levels: Vec::new(), bounds };
        cells.build();
        cells
    }

    /// Makes the levels.
    fn build(&mut self) {
        let of_cell = |center: &[[f32; CELL]; 3]| {
            let places = (0..CELL).map(|lane| Vec3::new(center[0][lane], center[1][lane], center[2][lane]));
            places.filter(|it| it.is_finite()).fold(Bounds::EMPTY, Bounds::with)
        };
        let mut boxes: Vec<Bounds> = self.centers.par_iter().map(of_cell).collect();
        while !boxes.is_empty() {
            self.levels.push(boxes.par_chunks(WIDTH).map(Node::of).collect());
            if boxes.len() <= WIDTH {
                break;
            }
            let union = |chunk: &[Bounds]| chunk.iter().copied().fold(Bounds::EMPTY, Bounds::union);
            boxes = boxes.par_chunks(WIDTH).map(union).collect();
        }
    }

    /// How many particles there are.
    pub(super) fn len(&self) -> usize {
        self.count
    }

    /// The box of the centers, and of those among which they are.
    pub(super) fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// The centers, cell by cell, as columns.
    pub(super) fn centers(&self) -> &[[[f32; CELL]; 3]] {
        &self.centers
    }

    /// The particles' ids, cell by cell; `u32::MAX` where there is none.
    pub(super) fn ids(&self) -> &[[u32; CELL]] {
        &self.ids
    }

    /// A column of a value of each particle; NaN where there is none.
    pub(super) fn column(&self, value: impl Fn(usize) -> f32 + Sync) -> Column {
        let of = |id: u32| if id == u32::MAX { f32::NAN } else { value(id as usize) };
        self.ids.par_iter().map(|ids| ids.map(of)).collect()
    }

    /// Memory it takes, in bytes.
    pub(super) fn bytes(count: usize) -> u64 {
        // Coordinates and id; an eighth of a node for each cell, and for each eighth cell, and so on.
        (count * 16 + count.div_ceil(CELL) * size_of::<Node>() / (WIDTH - 1)) as u64
    }

    /// The most memory that making it takes, in bytes: the sorted keys, and what is made of them.
    pub(super) fn bytes_to_make(count: usize) -> u64 {
        16 * count as u64 + Self::bytes(count)
    }
}

impl Node {
    fn of(children: &[Bounds]) -> Self {
        let mut node = Self { center: [[f32::INFINITY; WIDTH]; 3], half: [[0.0; WIDTH]; 3] };
        for (child, bounds) in children.iter().enumerate() {
            let center = bounds.center();
            let half = (bounds.max - center).max(center - bounds.min);
            for axis in 0..3 {
                node.center[axis][child] = center[axis];
                node.half[axis][child] = half[axis];
            }
        }
        node
    }
}

#[cfg(test)]
mod tests {
    use fearless_simd::{Level, dispatch};
    use glam::DVec3;

    use super::*;
    use crate::random::Stream;

    fn cloud(stream: &mut Stream, count: usize, kind: u64) -> Positions {
        let place = |k: usize, stream: &mut Stream| match kind % 4 {
            0 => stream.cube(),
            1 => Vec3::new(stream.unit().powi(8), stream.unit().powi(5), 0.0),
            2 => Vec3::X * (k / 3) as f32,
            _ => Vec3::ONE,
        };
        let mut offsets: [Vec<f32>; 3] = Default::default();
        for k in 0..count {
            let place = place(k, stream);
            (0..3).for_each(|axis| offsets[axis].push(place[axis]));
        }
        Positions::from_offsets(DVec3::ZERO, offsets)
    }

    #[test]
    fn what_is_found_is_what_brute_force_finds() {
        for seed in 0..200 {
            let mut stream = Stream::new(11, seed);
            let count = [0, 1, 2, 15, 16, 17, 128, 129, 1500][stream.below(9)];
            let positions = cloud(&mut stream, count, seed);
            let cells = Cells::new(&positions);
            let radius = stream.range(0.0, 0.7);
            let region = Region { center: stream.cube(), half: 0.3 * stream.cube().abs() };
            let number = cells.column(|id| id as f32);
            let own: Vec<f32> = (0..count).map(|_| stream.range(0.0, 0.5)).collect();
            let reach = cells.reach(&cells.column(|id| own[id]));
            let columns: [&[[f32; CELL]]; 2] = [&number, &number];
            let mut found = [Candidates::default(), Candidates::default(), Candidates::default()];
            dispatch!(Level::new(), simd => {
                cells.collect(simd, region, &Within(radius), columns, &mut found[0]);
                cells.collect(simd, region, &Counted(radius), columns, &mut found[1]);
                cells.collect(simd, region, &reach, columns, &mut found[2]);
            });
            let [all, shell, reaching] = found.map(|it| {
                let ids: Vec<usize> = it.values()[0].iter().map(|&id| id as usize).collect();
                for (place, &id) in ids.iter().enumerate() {
                    let center = Vec3::from_array(it.center().map(|column| column[place]));
                    assert!(center.abs_diff_eq(positions.offset(id) - region.center, 1e-6), "seed {seed}");
                }
                (ids, it.everywhere)
            });
            let mut everywhere = 0;
            for (id, &own) in own.iter().enumerate() {
                let apart = (positions.offset(id) - region.center).abs();
                let near = (apart - region.half).max(Vec3::ZERO).length();
                let far = (apart + region.half).length();
                let found_once = |ids: &[usize]| ids.iter().filter(|&&it| it == id).count() == 1;
                for (ids, limit) in [(&all.0, radius), (&reaching.0, own)] {
                    if near < limit - 1e-5 {
                        assert!(found_once(ids), "seed {seed} particle {id}");
                    } else if near > limit + 1e-5 {
                        assert!(!ids.contains(&id), "seed {seed} particle {id}");
                    }
                }
                everywhere += usize::from(far < radius - 1e-5);
                if near < radius - 1e-5 && far > radius + 1e-5 {
                    assert!(found_once(&shell.0), "seed {seed} particle {id}");
                }
            }
            assert_eq!(all.0.len(), shell.0.len() + shell.1 as usize, "seed {seed}");
            assert!(shell.1 as usize >= everywhere, "seed {seed}");
        }
    }
}
