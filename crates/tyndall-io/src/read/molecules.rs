//! What the readers of molecular files have in common: cells, and numbers that ran over their columns.

use tyndall::particles::Values;
use tyndall::{Cell, DVec3};

/// The cell with these edges and a corner at zero, which repeats along all; `None` if an edge has no length or is not finite: there is
/// no cell then, though the format has a place for it.
pub(super) fn cell(vectors: [DVec3; 3]) -> Option<Cell> {
    let is_edge = |it: &DVec3| it.is_finite() && it.length_squared() > 0.0;
    vectors.iter().all(is_edge).then_some(Cell { origin: DVec3::ZERO, vectors, periodic: [true; 3] })
}

/// The cell with edges of these lengths and the angles alpha, beta, gamma between them, in degrees: a along x, b in the plane of x
/// and y. `None` if there is none. Right angles give edges along the axes, exactly.
pub(super) fn cell_of_angles([a, b, c]: [f64; 3], angles: [f64; 3]) -> Option<Cell> {
    let [alpha, beta, gamma] = angles.map(|it| if it == 90.0 { 0.0 } else { it.to_radians().cos() });
    let sine = (1.0 - gamma * gamma).sqrt();
    let along_y = (alpha - beta * gamma) / sine;
    let along_z = (1.0 - beta * beta - along_y * along_y).sqrt();
    cell([
        DVec3::new(a, 0.0, 0.0),
        DVec3::new(b * gamma, b * sine, 0.0),
        DVec3::new(c * beta, c * along_y, c * along_z),
    ])
}

/// Whether a space group has no symmetry: its cell is that of a simulation, or may as well be.
pub(super) fn is_simple(space_group: &str) -> bool {
    let letters: String = space_group.chars().filter(|it| !it.is_whitespace()).collect();
    ["", "?", ".", "P1"].contains(&letters.as_str())
}

/// What is said about the cell of a crystal, which is left out.
pub(super) fn crystal(space_group: &str) -> String {
    format!("the cell is that of a crystal ({space_group}), which holds more than these atoms: left out")
}

/// Numbers of atoms or residues that their columns have no room for beyond `largest`, counted on: after it they begin again at 0 or 1,
/// or are no numbers any more, which `step` follows.
pub(super) fn counted_on(numbers: &[Option<i64>], largest: i64, step: i64) -> Values {
    let (mut before, mut offset, mut last) = (None, 0, 0);
    let counted: Vec<i64> = numbers
        .iter()
        .map(|&number| {
            if before == Some(largest) && (number == Some(0) || number == Some(1)) {
                offset = last + 1 - number.unwrap_or(0);
            }
            before = number.or(before);
            last = number.map_or(last + step, |number| number + offset);
            last
        })
        .collect();
    match counted.iter().map(|&it| i32::try_from(it)).collect() {
        Ok(narrow) => Values::I32(narrow),
        Err(_) => Values::I64(counted),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_and_angles_make_the_edges() {
        let cell = cell_of_angles([2.0, 3.0, 4.0], [90.0; 3]).unwrap();
        assert_eq!(cell.vectors, [2.0 * DVec3::X, 3.0 * DVec3::Y, 4.0 * DVec3::Z]);
        let angles = [70.0, 80.0, 100.0];
        let [a, b, c] = cell_of_angles([2.0, 3.0, 4.0], angles).unwrap().vectors;
        for ((one, other), angle) in [(b, c), (a, c), (a, b)].into_iter().zip(angles) {
            assert!((one.angle_between(other).to_degrees() - angle).abs() < 1e-9, "{angle}");
        }
        for (edge, length) in [a, b, c].into_iter().zip([2.0, 3.0, 4.0]) {
            assert!((edge.length() - length).abs() < 1e-12);
        }
        for (lengths, angles) in
            [([0.0; 3], [90.0; 3]), ([1.0; 3], [10.0, 10.0, 90.0]), ([f64::NAN; 3], [90.0; 3])]
        {
            assert!(cell_of_angles(lengths, angles).is_none(), "{lengths:?} {angles:?}");
        }
    }

    #[test]
    fn numbers_are_counted_on_beyond_their_columns() {
        let counted = |numbers: &[i64], step| {
            let numbers: Vec<Option<i64>> = numbers.iter().map(|&it| (it >= 0).then_some(it)).collect();
            counted_on(&numbers, 99_999, step)
        };
        assert_eq!(counted(&[99_998, 99_999, 0, 1], 1), Values::I32(vec![99_998, 99_999, 100_000, 100_001]));
        assert_eq!(counted(&[99_999, 1, 99_999, 1], 1), Values::I32(vec![99_999, 100_000, 199_998, 199_999]));
        assert_eq!(counted(&[99_999, -1, -1], 1), Values::I32(vec![99_999, 100_000, 100_001]));
        assert_eq!(
            counted(&[99_999, 99_999, 0, 0, 1], 0),
            Values::I32(vec![99_999, 99_999, 100_000, 100_000, 100_001])
        );
        assert_eq!(counted(&[5, 1, 7], 1), Values::I32(vec![5, 1, 7]), "a new chain begins anew");
        assert_eq!(counted(&[1 << 40], 1), Values::I64(vec![1 << 40]));
    }
}
