//! The lattice of a periodic cell: which image of the cell a point lies in, and how near the images of two points come.

use glam::{DMat3, DVec3};

use crate::error::{Error, Result};
use crate::particles::Cell;

/// See the module.
pub(crate) struct Lattice {
    origin: DVec3,
    vectors: [DVec3; 3],
    periodic: [bool; 3],
    /// Coordinates along the edges, counted in edges, of a vector.
    fractions: DMat3,
    /// Short vectors that make the same lattice as the edges that repeat, and coordinates along them; the others are zero.
    short: [DVec3; 3],
    short_fractions: DMat3,
}

/// Edges are dependent where their volume is so small beside the product of their lengths.
const FLAT: f64 = 1e-9;

impl Lattice {
    /// Of a cell; `setting` has the value `name`. Fails with [`Error::Setting`] if the cell does not repeat at all, or its edges
    /// span no volume.
    pub(crate) fn new(cell: &Cell, setting: &str, name: &str) -> Result<Self> {
        let Cell { origin, vectors, periodic } = *cell;
        let refuse = |allowed: &str| Err(Error::setting(setting, name, allowed));
        let edges: Vec<DVec3> = (0..3).filter(|&axis| periodic[axis]).map(|axis| vectors[axis]).collect();
        if edges.is_empty() {
            return refuse("left out for this file: its cell repeats along none of its edges");
        }
        let edge = completed(&edges);
        if !origin.is_finite() || !edges.iter().all(|it| it.is_finite()) || edge.is_none() {
            return refuse("left out for this file: the edges of its cell span no volume");
        }
        // An edge that does not repeat may have no length, as in two dimensions.
        let fractions = inverse(vectors).or_else(|| {
            let mut others = complement(&edges).into_iter();
            let all = [0, 1, 2].map(|axis| match periodic[axis] {
                true => vectors[axis],
                false => others.next().unwrap_or_default(),
            });
            inverse(all)
        });
        let short = reduced(edges);
        match (fractions, completed(&short)) {
            (Some(fractions), Some(short_fractions)) => {
                let short = std::array::from_fn(|at| short.get(at).copied().unwrap_or(DVec3::ZERO));
                Ok(Self { origin, vectors, periodic, fractions, short, short_fractions })
            }
            _ => refuse("left out for this file: the edges of its cell span no volume"),
        }
    }

    /// The image of the cell that a point lies in, counted in edges; 0 along edges that do not repeat.
    pub(super) fn image(&self, point: DVec3) -> DVec3 {
        self.only_periodic((self.fractions * (point - self.origin)).floor())
    }

    /// Of a vector that leads from a point to an image of it, how many edges that are.
    pub(super) fn edges(&self, shift: DVec3) -> DVec3 {
        self.only_periodic((self.fractions * shift).round())
    }

    /// The cell's corner.
    pub(super) fn origin(&self) -> DVec3 {
        self.origin
    }

    /// Along which edges it repeats.
    pub(super) fn periodic(&self) -> [bool; 3] {
        self.periodic
    }

    /// What makes coordinates along the edges, counted in edges, of a vector.
    pub(super) fn fractions(&self) -> DMat3 {
        self.fractions
    }

    /// Without those along edges that do not repeat.
    pub(super) fn only_periodic(&self, edges: DVec3) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|axis| if self.periodic[axis] { edges[axis] } else { 0.0 }))
    }

    /// The vector that so many edges are.
    pub(super) fn shift(&self, edges: DVec3) -> DVec3 {
        (0..3).filter(|&axis| edges[axis] != 0.0).map(|axis| edges[axis] * self.vectors[axis]).sum()
    }

    /// The shortest of the vectors that lead from a point to the images of another, of which `offset` is one.
    pub(crate) fn nearest(&self, offset: DVec3) -> DVec3 {
        let whole = (self.short_fractions * offset).round();
        let near = offset - (0..3).map(|at| whole[at] * self.short[at]).sum::<DVec3>();
        // Rounding finds a near one; along short vectors the nearest is at most one step away.
        let mut best = near;
        let steps = [0.0, -1.0, 1.0];
        for x in steps {
            for y in steps {
                for z in steps {
                    let other = near + x * self.short[0] + y * self.short[1] + z * self.short[2];
                    if other.length_squared() < best.length_squared() {
                        best = other;
                    }
                }
            }
        }
        best
    }
}

/// What turns a vector into coordinates along these three; none if they span no volume.
fn inverse(vectors: [DVec3; 3]) -> Option<DMat3> {
    let [a, b, c] = vectors;
    let matrix = DMat3::from_cols(a, b, c);
    let most = a.length() * b.length() * c.length();
    (most.is_finite() && matrix.determinant().abs() > FLAT * most).then(|| matrix.inverse())
}

/// The same along one to three vectors, and others across them.
fn completed(vectors: &[DVec3]) -> Option<DMat3> {
    let mut all = vectors.iter().copied().chain(complement(vectors));
    inverse(std::array::from_fn(|_| all.next().unwrap_or_default()))
}

/// Unit vectors across one to three vectors, as many as are missing to three.
fn complement(vectors: &[DVec3]) -> Vec<DVec3> {
    match vectors {
        [one] if one.length_squared() > 0.0 => {
            let (other, third) = one.normalize().any_orthonormal_pair();
            vec![other, third]
        }
        [one, other] => vec![one.cross(*other).normalize_or_zero()],
        _ => Vec::new(),
    }
}

/// Short vectors that make the same lattice. Source: Semaev, a 3-dimensional lattice reduction algorithm, 2001: each is replaced by the
/// shortest of what it differs from it by the others.
fn reduced(mut vectors: Vec<DVec3>) -> Vec<DVec3> {
    let count = vectors.len();
    // The lengths fall with each step; where they do no more, rounding is all that is left.
    for _ in 0..1000 {
        let before = vectors.clone();
        for at in 0..count {
            for other in (0..count).filter(|&other| other != at) {
                let by = vectors[other];
                let times = (vectors[at].dot(by) / by.length_squared()).round();
                shorten(&mut vectors[at], times * by);
            }
            if count == 3 {
                let (one, other) = (vectors[(at + 1) % 3], vectors[(at + 2) % 3]);
                for by in [one + other, one - other, -one - other, other - one] {
                    shorten(&mut vectors[at], by);
                }
            }
        }
        if vectors == before {
            break;
        }
    }
    vectors
}

/// Takes `by` away if that makes the vector shorter, by more than rounding.
fn shorten(vector: &mut DVec3, by: DVec3) {
    let shorter = *vector - by;
    if shorter.length_squared() < vector.length_squared() * (1.0 - 1e-12) {
        *vector = shorter;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    /// Cells of all kinds: cubic, triclinic, so skewed that edges are far from the shortest, repeating along some edges only, flat.
    fn cells(seed: u64) -> Cell {
        let mut stream = Stream::new(seed, 3);
        let mut vector = || stream.cube().as_dvec3();
        let [a, b, c] = [vector(), vector(), vector()];
        let vectors = match seed % 4 {
            0 => [3.0 * DVec3::X, 4.0 * DVec3::Y, 5.0 * DVec3::Z],
            1 => [a + 2.0 * DVec3::X, b + 2.0 * DVec3::Y, c + 2.0 * DVec3::Z],
            2 => [3.0 * DVec3::X, 4.0 * DVec3::Y + 1.5 * DVec3::X, 5.0 * DVec3::Z + 2.4 * DVec3::Y],
            _ => [
                2.0 * DVec3::X,
                3.0 * DVec3::Y + 4.1 * DVec3::X,
                2.5 * DVec3::Z - 5.0 * DVec3::X + 4.0 * DVec3::Y,
            ],
        };
        let periodic = [[true; 3], [true, false, true], [true, true, false], [false, false, true]];
        Cell { origin: vector(), vectors, periodic: periodic[(seed / 4) as usize % 4] }
    }

    #[test]
    fn the_nearest_image_is_that_of_a_search_over_all() {
        for seed in 0..200 {
            let cell = cells(seed);
            let lattice = Lattice::new(&cell, "--wrap", "atoms").unwrap();
            let mut stream = Stream::new(900 + seed, 3);
            for _ in 0..20 {
                let offset = 6.0 * stream.cube().as_dvec3();
                let range = |axis: usize| if cell.periodic[axis] { -9..=9 } else { 0..=0 };
                let mut best = f64::INFINITY;
                for x in range(0) {
                    for y in range(1) {
                        for z in range(2) {
                            let edges = DVec3::new(x.into(), y.into(), z.into());
                            best = best.min((offset + lattice.shift(edges)).length());
                        }
                    }
                }
                let found = lattice.nearest(offset);
                assert!(
                    found.length() < best + 1e-9,
                    "seed {seed}: {} is longer than {best}",
                    found.length()
                );
                let edges = lattice.edges(found - offset);
                assert!(found.abs_diff_eq(offset + lattice.shift(edges), 1e-9), "seed {seed}: no image");
            }
        }
    }

    #[test]
    fn every_point_lies_in_one_image_of_the_cell() {
        for seed in 0..200 {
            let cell = cells(seed);
            let lattice = Lattice::new(&cell, "--wrap", "atoms").unwrap();
            let mut stream = Stream::new(1900 + seed, 3);
            let fraction = 0.5 + 0.5 * stream.cube().as_dvec3();
            let mut edges = (4.0 * stream.cube().as_dvec3()).round();
            for axis in 0..3 {
                if !cell.periodic[axis] {
                    edges[axis] = 0.0;
                }
            }
            let inside = cell.origin + (0..3).map(|at| fraction[at] * cell.vectors[at]).sum::<DVec3>();
            assert_eq!(lattice.image(inside + lattice.shift(edges)), edges, "seed {seed}");
        }
    }

    #[test]
    fn an_edge_that_does_not_repeat_may_have_no_length() {
        let flat = Cell {
            origin: DVec3::ZERO,
            vectors: [2.0 * DVec3::X, 3.0 * DVec3::Y + DVec3::X, DVec3::ZERO],
            periodic: [true, true, false],
        };
        let lattice = Lattice::new(&flat, "--wrap", "atoms").unwrap();
        assert_eq!(lattice.image(DVec3::new(2.5, 3.5, 7.0)), DVec3::new(0.0, 1.0, 0.0));
        assert!(lattice.nearest(DVec3::new(1.9, 0.1, 7.0)).abs_diff_eq(DVec3::new(-0.1, 0.1, 7.0), 1e-12));
        for vectors in [[DVec3::X, DVec3::X, DVec3::Z], [DVec3::X, DVec3::Y, DVec3::splat(f64::NAN)]] {
            assert!(Lattice::new(&Cell { vectors, periodic: [true; 3], ..flat }, "--wrap", "atoms").is_err());
        }
        assert!(Lattice::new(&Cell { periodic: [false; 3], ..flat }, "--wrap", "atoms").is_err());
    }
}
