//! The sites of a crystal lattice inside a body, counted, so that site `k` is found without visiting those before it.
//!
//! A body is a span of heights over every point of a plane; a lattice is columns of sites over that plane. The table holds
//! one line a column, not one a site. Also here: balls of lattice sites, for drops.

use std::ops::Range;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::random::unit_f32;

/// Sites of a cell, in edges of the cell: simple, body-centered and face-centered cubic. All lie a quarter edge or more from
/// the cell's upper faces and as far from its lower ones, so that a block ends the same way on every side.
pub(super) const SIMPLE: &[DVec3] = &[DVec3::splat(0.5)];
pub(super) const BODY_CENTERED: &[DVec3] = &[DVec3::splat(0.25), DVec3::splat(0.75)];
pub(super) const FACE_CENTERED: &[DVec3] = &[
    DVec3::new(0.25, 0.25, 0.25),
    DVec3::new(0.75, 0.75, 0.25),
    DVec3::new(0.75, 0.25, 0.75),
    DVec3::new(0.25, 0.75, 0.75),
];

/// An unbounded lattice, and how much of its plane counts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    /// Edge of a cell.
    pub(super) edge: f64,
    /// Corner of the first cell.
    pub(super) corner: DVec3,
    /// Cells along x and y.
    pub(super) cells: [usize; 2],
    /// Sites of a cell.
    pub(super) basis: &'static [DVec3],
}

/// The sites of a [`Frame`] inside a body.
pub(super) struct Lattice {
    frame: Frame,
    /// For each column the number of sites before it, and its lowest layer of cells.
    columns: Vec<(u64, i64)>,
    total: u64,
}

impl Frame {
    fn columns(&self) -> usize {
        self.cells[0] * self.cells[1] * self.basis.len()
    }

    /// Site of the layer 0 in a column: cells in y, then in x, the sites of a cell before all.
    fn foot(&self, column: usize) -> DVec3 {
        let (cell, site) = (column / self.basis.len(), column % self.basis.len());
        let (x, y) = (cell / self.cells[1], cell % self.cells[1]);
        self.corner + self.edge * (DVec3::new(x as f64, y as f64, 0.0) + self.basis[site])
    }

    /// Layers of a column that lie in the span of heights over it.
    fn layers(&self, column: usize, span: &impl Fn(f64, f64) -> Range<f64>) -> Range<i64> {
        let foot = self.foot(column);
        let Range { start, end } = span(foot.x, foot.y);
        let layer = |height: f64| ((height - foot.z) / self.edge).ceil() as i64;
        let bottom = layer(start);
        bottom..layer(end).max(bottom)
    }

    /// How many sites a body has.
    pub(super) fn count(&self, span: impl Fn(f64, f64) -> Range<f64> + Sync) -> u64 {
        let sites = |column| {
            let layers = self.layers(column, &span);
            (layers.end - layers.start) as u64
        };
        (0..self.columns()).into_par_iter().with_min_len(1024).map(sites).sum()
    }
}

impl Lattice {
    /// The sites of a body: `span` gives the heights that belong to it over a point (x, y), an empty range for none.
    pub(super) fn new(frame: Frame, span: impl Fn(f64, f64) -> Range<f64> + Sync) -> Self {
        let layers: Vec<Range<i64>> = (0..frame.columns())
            .into_par_iter()
            .with_min_len(1024)
            .map(|column| frame.layers(column, &span))
            .collect();
        let mut total = 0;
        let columns = layers.into_iter().map(|layers| {
            let before = total;
            total += (layers.end - layers.start) as u64;
            (before, layers.start)
        });
        Self { columns: columns.collect(), frame, total }
    }

    /// How many sites there are.
    pub(super) fn total(&self) -> u64 {
        self.total
    }

    /// Site `k`, below [`Lattice::total`].
    pub(super) fn site(&self, k: u64) -> DVec3 {
        let column = self.column(k);
        self.in_column(column, self.frame.foot(column), k)
    }

    /// The sites of a range, one after the other: only the first is looked for.
    pub(super) fn sites(&self, range: Range<u64>) -> impl Iterator<Item = DVec3> {
        let mut column = self.column(range.start);
        let mut foot = self.frame.foot(column);
        range.map(move |k| {
            while self.columns.get(column + 1).is_some_and(|&(before, _)| before <= k) {
                column += 1;
                foot = self.frame.foot(column);
            }
            self.in_column(column, foot, k)
        })
    }

    /// The column of site `k`.
    fn column(&self, k: u64) -> usize {
        self.columns.partition_point(|&(before, _)| before <= k) - 1
    }

    fn in_column(&self, column: usize, foot: DVec3, k: u64) -> DVec3 {
        let (before, bottom) = self.columns[column];
        let layer = bottom + (k - before) as i64;
        foot + DVec3::Z * (self.frame.edge * layer as f64)
    }

    /// Site of particle `k` of `count`, which is at most [`Lattice::total`]: sites too many stay empty at even distances.
    pub(super) fn site_of(&self, k: u64, count: u64) -> DVec3 {
        self.site((u128::from(k) * u128::from(self.total) / u128::from(count)) as u64)
    }
}

/// The largest size for which `holds`, to 1e-6 of it, found from `guess` outward. `holds` must be true of small sizes and false
/// of large ones; where it changes back and forth between, any change from true to false may be found.
pub(super) fn largest(guess: f64, holds: impl Fn(f64) -> bool) -> f64 {
    let (mut low, mut high) = (guess, guess);
    while !holds(low) {
        low *= 0.97;
    }
    if low == guess {
        while holds(high * 1.03) {
            high *= 1.03;
        }
        (low, high) = (high, high * 1.03);
    } else {
        high = low / 0.97;
    }
    while high - low > 1e-6 * low {
        let middle = 0.5 * (low + high);
        if holds(middle) { low = middle } else { high = middle }
    }
    low
}

/// The `count` sites of a lattice of density 1 (one site a unit of volume) that are nearest to a point between the sites,
/// nearest first: every first part of the list is a ball too.
pub(super) fn ball(count: usize, basis: &[DVec3]) -> Vec<Vec3> {
    let edge = (basis.len() as f64).cbrt();
    let radius = (count as f64 * 3.0 / (4.0 * std::f64::consts::PI)).cbrt() + 2.0;
    let reach = (radius / edge).ceil() as i64;
    // Off all symmetry axes, so that small balls are not all the same few shapes.
    let center = DVec3::new(0.29, 0.17, 0.41);
    let mut sites = Vec::new();
    for x in -reach..=reach {
        for y in -reach..=reach {
            for z in -reach..=reach {
                let cell = DVec3::new(x as f64, y as f64, z as f64);
                sites.extend(basis.iter().map(|site| edge * (cell + *site - center)));
            }
        }
    }
    sites.retain(|site| site.length() <= radius);
    sites.sort_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
    sites.truncate(count);
    sites.into_iter().map(|site| site.as_vec3()).collect()
}

/// Point `k` of a sequence whose neighbors in number fill the unit cube without clumps and gaps.
///
/// Multiples of the inverse powers of the number with x^4 = x + 1, which generalizes the golden ratio (M. Roberts 2018),
/// as fractions of 2^64, so that they are exact for every `k`.
pub(super) fn even(k: u64) -> [f32; 3] {
    const INVERSE_POWERS: [u64; 3] = [0xd1b5_4a32_d192_ed03, 0xabc9_8388_fb8f_ac03, 0x8cb9_2ba7_2f3d_8dd7];
    INVERSE_POWERS.map(|fraction| unit_f32((k.wrapping_mul(fraction) >> 32) as u32))
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME: Frame =
        Frame { edge: 0.1, corner: DVec3::new(-1.0, -1.0, 0.0), cells: [20, 20], basis: FACE_CENTERED };

    fn dome(x: f64, y: f64) -> Range<f64> {
        let height = (1.0 - x * x - y * y).max(0.0).sqrt();
        -height..height
    }

    #[test]
    fn all_sites_of_the_body_come_once_and_no_others() {
        let lattice = Lattice::new(FRAME, dome);
        let mut wanted = Vec::new();
        for (x, y, z) in (0..20).flat_map(|x| (0..20).flat_map(move |y| (-11..11).map(move |z| (x, y, z)))) {
            for site in FACE_CENTERED {
                let point = FRAME.corner + 0.1 * (DVec3::new(x as f64, y as f64, z as f64) + *site);
                if dome(point.x, point.y).contains(&point.z) {
                    wanted.push(point);
                }
            }
        }
        assert_eq!(lattice.total(), FRAME.count(dome));
        assert_eq!(lattice.total(), wanted.len() as u64);
        // Sites are multiples of a quarter edge, 0.025: as whole numbers they can be sorted and compared.
        let sorted = |mut sites: Vec<DVec3>| {
            sites.sort_by_key(|site| (site / 0.025).round().as_ivec3().to_array());
            sites
        };
        let found: Vec<DVec3> = (0..lattice.total()).map(|k| lattice.site(k)).collect();
        for first in [0, 1, 77, lattice.total() - 5, lattice.total()] {
            assert!(lattice.sites(first..lattice.total()).eq(found[first as usize..].iter().copied()));
        }
        let found = sorted(found);
        assert!(found.iter().zip(&sorted(wanted)).all(|(a, b)| a.distance(*b) < 1e-9));
    }

    #[test]
    fn the_largest_size_is_found_from_either_side() {
        for guess in [0.01, 0.9, 1.0, 1.1, 40.0] {
            let size = largest(guess, |it| it <= 1.0);
            assert!(size <= 1.0 && size > 1.0 - 3e-6, "{guess} gave {size}");
        }
    }

    #[test]
    fn balls_have_density_one() {
        for basis in [SIMPLE, BODY_CENTERED, FACE_CENTERED] {
            let sites = ball(3000, basis);
            let radius = sites[2999].length();
            assert_eq!(sites.len(), 3000);
            assert!((4.19 * radius.powi(3) / 3000.0 - 1.0).abs() < 0.05, "radius {radius}");
        }
        assert!(ball(0, SIMPLE).is_empty());
    }

    #[test]
    fn even_points_keep_their_distance() {
        let points: Vec<Vec3> = (0..1000).map(|k| Vec3::from_array(even(k + (1 << 40)))).collect();
        let apart = |k: usize| points[..k].iter().map(|it| it.distance(points[k])).fold(1.0, f32::min);
        let nearest = (1..1000).map(apart).fold(1.0, f32::min);
        // A tenth is the edge of a point's share of the cube; independent points come as near as 0.01.
        assert!(nearest > 0.05, "{nearest}");
    }
}
