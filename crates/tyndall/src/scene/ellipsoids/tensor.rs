//! Symmetric tensors of particles as ellipsoids: half axes along the principal axes, by the eigenvalues.
//!
//! A tensor is an attribute of six or nine numbers, or as many scalars. Nine are row by row, of which the symmetric part counts; six are
//! `xx yy zz xy xz yz`, as LAMMPS, OVITO and PDB have them, or in Voigt's order `xx yy zz yz xz xy`, as ASE has them. Stress, virial and gyration tensors and
//! the displacement parameters `U` of crystals (`ANISOU`) are such tensors.

use std::str::FromStr;

use glam::{DMat3, DQuat, DVec3};
use rayon::prelude::*;

use super::{Ellipsoids, FLATTEST, SAMPLES, many, told};
use crate::error::{Error, Result};
use crate::names::nearest;
use crate::particles::{Attribute, Particles};
use crate::scene::arrows::usual_radius;
use crate::scene::statistics::{quantiles, sampled_ids, short};
use crate::structure::Spheres;
use crate::structure::shapes::Ellipsoid;

/// A tensor attribute, and what half axes are by it.
#[derive(Clone, Debug, PartialEq)]
pub struct Tensor {
    /// The attribute, or the stem of scalars such as `stress_xx` or `c_stress[1]`.
    pub name: String,
    /// What half axes are.
    pub half_axes: HalfAxes,
    /// How six numbers follow each other where their names do not tell.
    pub order: Order,
}

/// What half axes are, up to a scale.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HalfAxes {
    /// Absolute values of the eigenvalues: of stress.
    Eigenvalues,
    /// Their roots: of the covariance of places, such as displacement parameters and gyration tensors. Negative ones count as 0.
    Roots,
}

/// How the six numbers of a symmetric tensor follow each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Order {
    /// xx yy zz xy xz yz.
    #[default]
    Rows,
    /// xx yy zz yz xz xy.
    Voigt,
}

impl HalfAxes {
    /// The word before the name.
    fn word(self) -> &'static str {
        match self {
            Self::Eigenvalues => "tensor",
            Self::Roots => "covariance",
        }
    }

    fn of(self, eigenvalues: DVec3) -> DVec3 {
        match self {
            Self::Eigenvalues => eigenvalues.abs(),
            Self::Roots => DVec3::from(eigenvalues.to_array().map(|value| value.max(0.0).sqrt())),
        }
    }
}

impl FromStr for Tensor {
    type Err = Error;

    /// Reads `tensor:NAME` or `covariance:NAME`, either with `@voigt` behind it.
    fn from_str(text: &str) -> Result<Self> {
        let kinds = [HalfAxes::Eigenvalues, HalfAxes::Roots];
        let parts = kinds.iter().find_map(|kind| {
            let name = text.strip_prefix(kind.word())?.strip_prefix(':')?.trim();
            Some((*kind, name))
        });
        let named = parts.map(|(half_axes, name)| match name.strip_suffix("@voigt") {
            Some(name) => (half_axes, name, Order::Voigt),
            None => (half_axes, name, Order::Rows),
        });
        match named {
            Some((half_axes, name, order)) if !name.is_empty() => {
                Ok(Self { name: name.into(), half_axes, order })
            }
            _ => {
                let allowed = "tensor:NAME or covariance:NAME, with @voigt behind it if six numbers are xx yy zz yz xz xy";
                Err(Error::setting("--ellipsoids", text, allowed))
            }
        }
    }
}

/// How the names of a tensor's scalars end, nine or six of them, and whether the names tell which is which.
const ENDS: [(&[&str], bool); 16] = [
    (&["xx", "xy", "xz", "yx", "yy", "yz", "zx", "zy", "zz"], true),
    (&["_xx", "_xy", "_xz", "_yx", "_yy", "_yz", "_zx", "_zy", "_zz"], true),
    (&[".xx", ".xy", ".xz", ".yx", ".yy", ".yz", ".zx", ".zy", ".zz"], true),
    (&["11", "12", "13", "21", "22", "23", "31", "32", "33"], true),
    (&["[1]", "[2]", "[3]", "[4]", "[5]", "[6]", "[7]", "[8]", "[9]"], false),
    (&[":0", ":1", ":2", ":3", ":4", ":5", ":6", ":7", ":8"], false),
    (&["_0", "_1", "_2", "_3", "_4", "_5", "_6", "_7", "_8"], false),
    (&[".0", ".1", ".2", ".3", ".4", ".5", ".6", ".7", ".8"], false),
    (&["xx", "yy", "zz", "xy", "xz", "yz"], true),
    (&["_xx", "_yy", "_zz", "_xy", "_xz", "_yz"], true),
    (&[".xx", ".yy", ".zz", ".xy", ".xz", ".yz"], true),
    (&["11", "22", "33", "12", "13", "23"], true),
    (&["[1]", "[2]", "[3]", "[4]", "[5]", "[6]"], false),
    (&[":0", ":1", ":2", ":3", ":4", ":5"], false),
    (&["_0", "_1", "_2", "_3", "_4", "_5"], false),
    (&[".0", ".1", ".2", ".3", ".4", ".5"], false),
];

/// Where the numbers of tensors come from.
struct Numbers<'a> {
    /// Attributes and the places in them: nine or six.
    parts: Vec<(&'a Attribute, usize)>,
    /// Whether their names tell which is which.
    are_named: bool,
}

/// The scalars of the tensor `name`.
fn scalars<'a>(particles: &'a Particles, name: &str) -> Option<Numbers<'a>> {
    ENDS.iter().find_map(|&(ends, are_named)| {
        let scalar = |end: &&str| {
            let found = particles.attribute(&format!("{name}{end}")).filter(|it| it.components == 1);
            found.map(|attribute| (attribute, 0))
        };
        Some(Numbers { parts: ends.iter().map(scalar).collect::<Option<_>>()?, are_named })
    })
}

fn numbers<'a>(particles: &'a Particles, name: &str) -> Option<Numbers<'a>> {
    let own = particles.attribute(name).filter(|it| [6, 9].contains(&it.components));
    let of_own = |it: &'a Attribute| Numbers {
        parts: (0..it.components).map(|place| (it, place)).collect(),
        are_named: false,
    };
    own.map(of_own).or_else(|| scalars(particles, name))
}

/// The attributes that the tensor called `name` is made of, if there is one.
pub(in crate::scene) fn attributes<'a>(particles: &'a Particles, name: &str) -> Option<Vec<&'a Attribute>> {
    Some(numbers(particles, name)?.parts.into_iter().map(|(attribute, _)| attribute).collect())
}

/// The names of all tensors.
fn tensors(particles: &Particles) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for attribute in particles.attributes() {
        let name = attribute.name.as_str();
        let own = [6, 9].contains(&attribute.components).then_some(name);
        let stems = || ENDS.iter().filter_map(|(ends, _)| name.strip_suffix(ends[0]));
        let is_tensor = |stem: &&str| !stem.is_empty() && scalars(particles, stem).is_some();
        // Without what separates it from its ends.
        let stem = || stems().filter(is_tensor).min_by_key(|stem| stem.len());
        names.extend(own.or_else(stem).filter(|name| !names.contains(name)));
    }
    names
}

impl Numbers<'_> {
    /// The symmetric part of the tensor of particle `id`.
    fn of(&self, id: usize, order: Order) -> DMat3 {
        let number = |place: usize| self.parts.get(place).map_or(0.0, |(it, part)| it.number(id, *part));
        if self.parts.len() == 9 {
            let rows = DMat3::from_cols_array(&[0, 1, 2, 3, 4, 5, 6, 7, 8].map(number));
            return 0.5 * (rows + rows.transpose());
        }
        let [xx, yy, zz, mut xy, xz, mut yz] = [0, 1, 2, 3, 4, 5].map(number);
        if order == Order::Voigt && !self.are_named {
            (xy, yz) = (yz, xy);
        }
        DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz])
    }
}

/// Finds the ellipsoids of a tensor; a tensor that is 0 has none, and where it is not finite a particle is its sphere.
///
/// Fails with [`Error::Setting`] if there is no such tensor.
pub(super) fn find(spheres: Spheres, tensor: &Tensor, scale: Option<f32>) -> Result<Ellipsoids> {
    let particles = spheres.particles;
    let Tensor { name, half_axes, order } = tensor;
    let numbers = numbers(particles, name).ok_or_else(|| {
        let all = tensors(particles);
        let there = match all[..] {
            [] => "the file has none".to_string(),
            _ => format!("the file has: {}", all.join(", ")),
        };
        let meant = nearest(name, all).map_or(String::new(), |it| format!("; did you mean '{it}'?"));
        let allowed = format!("a tensor attribute of 6 or 9 numbers — {there}{meant}");
        Error::setting("--ellipsoids", name, allowed)
    })?;
    let principal = |id: usize| {
        let tensor = numbers.of(id, *order);
        let is_finite = tensor.is_finite();
        is_finite.then(|| principal_axes(tensor))
    };
    let lengths = sampled_ids(particles.len(), SAMPLES).filter_map(principal);
    let lengths = lengths.map(|(eigenvalues, _)| half_axes.of(eigenvalues).max_element());
    let mut lengths: Vec<f64> = lengths.filter(|it| *it > 0.0).collect();
    let usual = quantiles(&mut lengths, [MOST]).map(|[usual]| usual);
    let scale = match (scale, usual) {
        (Some(scale), _) => f64::from(spheres.radius_scale) * f64::from(scale),
        (None, Some(usual)) => usual_radius(spheres) / usual,
        (None, None) => 1.0,
    };
    let shape = |id: usize| match principal(id) {
        None => Shape::Sphere(Ellipsoid {
            particle: id as u32,
            half_axes: DVec3::splat(f64::from(spheres.radius(id))),
            turn: DQuat::IDENTITY,
            exponents: Ellipsoid::ROUND,
        }),
        Some((eigenvalues, turn)) => {
            let axes = scale * half_axes.of(eigenvalues);
            let longest = axes.max_element();
            if !(longest > 0.0 && longest.is_finite()) {
                return Shape::Nothing;
            }
            let axes = axes.max(DVec3::splat(FLATTEST * longest));
            Shape::Own(Ellipsoid { particle: id as u32, half_axes: axes, turn, exponents: Ellipsoid::ROUND })
        }
    };
    let found: Vec<Shape> = (0..particles.len()).into_par_iter().map(shape).collect();
    let count = |is: fn(&Shape) -> bool| found.iter().filter(|it| is(it)).count();
    let (own, none) = (count(|it| matches!(it, Shape::Own(_))), count(|it| matches!(it, Shape::Nothing)));
    let what = match half_axes {
        HalfAxes::Eigenvalues => "its eigenvalues",
        HalfAxes::Roots => "the roots of its eigenvalues",
    };
    let order = match (numbers.parts.len(), numbers.are_named, order) {
        (9, ..) | (_, true, _) => "",
        (.., Order::Rows) => " (xx yy zz xy xz yz)",
        (.., Order::Voigt) => " (xx yy zz yz xz xy)",
    };
    let mut description = format!(
        "{} by the {} {name}{order}, half axes {what} times {}",
        many(own, "ellipsoid"),
        half_axes.word(),
        short(scale)
    );
    if own + none < found.len() {
        description += &format!(", {}", many(found.len() - own - none, "sphere"));
    }
    if none > 0 {
        description += &format!(", {} left out whose tensor is 0", many(none, "particle"));
    }
    let ellipsoids = found.into_iter().filter_map(|shape| match shape {
        Shape::Own(ellipsoid) | Shape::Sphere(ellipsoid) => Some(ellipsoid),
        Shape::Nothing => None,
    });
    Ok(told(ellipsoids.collect(), description))
}

/// The share of ellipsoids that are not longer than what decides the scale: a few large tensors shall not make all others dots.
const MOST: f64 = 0.95;

/// What a particle is.
enum Shape {
    Own(Ellipsoid),
    Sphere(Ellipsoid),
    Nothing,
}

/// More sweeps than any tensor needs: the off-diagonal shrinks at least quadratically from the third one on.
const SWEEPS: usize = 32;

/// Eigenvalues of a symmetric matrix of finite numbers, and the rotation that turns x, y and z to their eigenvectors. Source: Jacobi's method; G. Golub, C.
/// Van Loan, "Matrix Computations", 4th ed., section 8.5.
fn principal_axes(matrix: DMat3) -> (DVec3, DQuat) {
    let (mut rest, mut axes) = (matrix, DMat3::IDENTITY);
    for _ in 0..SWEEPS {
        let mut is_done = true;
        for [p, q] in [[0, 1], [0, 2], [1, 2]] {
            let off = rest.col(q)[p];
            let diagonal = rest.col(p)[p].abs() + rest.col(q)[q].abs();
            if diagonal + off.abs() == diagonal {
                continue;
            }
            is_done = false;
            let ratio = (rest.col(q)[q] - rest.col(p)[p]) / (2.0 * off);
            let tangent = ratio.signum() / (ratio.abs() + (ratio * ratio + 1.0).sqrt());
            let cosine = 1.0 / (tangent * tangent + 1.0).sqrt();
            let sine = tangent * cosine;
            let mut turn = DMat3::IDENTITY;
            turn.col_mut(p)[p] = cosine;
            turn.col_mut(q)[q] = cosine;
            turn.col_mut(q)[p] = sine;
            turn.col_mut(p)[q] = -sine;
            rest = turn.transpose() * rest * turn;
            // What is meant to vanish does, whatever rounding says.
            rest.col_mut(q)[p] = 0.0;
            rest.col_mut(p)[q] = 0.0;
            axes *= turn;
        }
        if is_done {
            break;
        }
    }
    let eigenvalues = DVec3::from([0, 1, 2].map(|axis| rest.col(axis)[axis]));
    (eigenvalues, DQuat::from_mat3(&axes).normalize())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::particles::{Columns, Positions, Radii, Values};
    use crate::random::Stream;

    fn particles(attributes: Vec<Attribute>) -> Particles {
        let mut positions = Positions::around(DVec3::ZERO);
        positions.extend(&[DVec3::ZERO, DVec3::X * 5.0, DVec3::Y * 5.0]);
        Particles::new(Columns { positions, attributes, ..Columns::default() }).unwrap()
    }

    fn own(name: &str, numbers: &[f32]) -> Attribute {
        Attribute::new(name, numbers.len() / 3, Values::F32(numbers.to_vec()))
    }

    fn found(particles: &Particles, text: &str, scale: Option<f32>) -> Result<Ellipsoids> {
        let spheres = Spheres { particles, radii: &Radii::Uniform(0.5), radius_scale: 1.0 };
        find(spheres, &text.parse()?, scale)
    }

    /// The tensor with the eigenvalues of an ellipsoid's half axes.
    fn rebuilt(ellipsoid: &Ellipsoid) -> DMat3 {
        let axes = DMat3::from_quat(ellipsoid.turn);
        axes * DMat3::from_diagonal(ellipsoid.half_axes) * axes.transpose()
    }

    #[test]
    fn eigenvalues_and_axes_make_up_the_matrix() {
        let mut stream = Stream::new(5, 0);
        for turn in 0..2000 {
            let mut number = || 2.0 * f64::from(stream.unit()) - 1.0;
            let scale = 10.0_f64.powf(30.0 * number());
            let [a, b, c, d, e, f] = [(); 6].map(|()| number() * scale);
            let matrix = match turn % 5 {
                0 => DMat3::from_cols_array(&[a, b, c, b, d, e, c, e, f]),
                1 => DMat3::from_diagonal(DVec3::new(a, b, c)),
                // Equal eigenvalues, one of them alone, and none.
                2 => DMat3::from_diagonal(DVec3::splat(a)),
                3 => {
                    let axis = DVec3::new(a, b, c).normalize();
                    d * DMat3::from_cols(axis.x * axis, axis.y * axis, axis.z * axis)
                }
                _ => DMat3::ZERO,
            };
            let (eigenvalues, turn) = principal_axes(matrix);
            let axes = DMat3::from_quat(turn);
            let again = axes * DMat3::from_diagonal(eigenvalues) * axes.transpose();
            let largest = matrix.to_cols_array().map(f64::abs).into_iter().fold(0.0, f64::max);
            assert!(again.abs_diff_eq(matrix, 1e-13 * largest), "{matrix} {again}");
        }
    }

    #[test]
    fn six_and_nine_numbers_and_scalars_are_the_same_tensor() {
        let six = [3.0, 2.0, 4.0, 0.5, -0.25, 0.75];
        let [xx, yy, zz, xy, xz, yz] = six;
        let voigt = [xx, yy, zz, yz, xz, xy];
        // Only the symmetric part counts.
        let nine = [xx, xy + 1.0, xz, xy - 1.0, yy, yz + 2.0, xz, yz - 2.0, zz];
        let mut attributes =
            vec![own("six", &six.repeat(3)), own("nine", &nine.repeat(3)), own("voigt", &voigt.repeat(3))];
        for (end, value) in ["xx", "yy", "zz", "xy", "xz", "yz"].into_iter().zip(six) {
            attributes.push(own(&format!("p_{end}"), &[value; 3]));
        }
        for (place, value) in (1..).zip(six) {
            attributes.push(own(&format!("c_s[{place}]"), &[value; 3]));
        }
        let particles = particles(attributes);
        let expected = DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz].map(f64::from));
        for text in
            ["tensor:six", "tensor:NINE", "tensor:voigt@voigt", "tensor:p", "tensor:p@voigt", "tensor:c_s"]
        {
            let found = found(&particles, text, Some(1.0)).unwrap();
            assert!(rebuilt(&found.ellipsoids[1]).abs_diff_eq(expected, 1e-6), "{text}");
        }
        // Twice the roots, of which the squares make up four times the tensor.
        let root = rebuilt(&found(&particles, "covariance:six", Some(2.0)).unwrap().ellipsoids[0]);
        assert!((root * root).abs_diff_eq(4.0 * expected, 1e-5));
        let said = |text: &str| found(&particles, text, None).unwrap_err().to_string();
        assert!(
            said("tensor:pq").contains("the file has: six, nine, voigt, p, c_s; did you mean 'p'?"),
            "{}",
            said("tensor:pq")
        );
        for bad in ["tensor:", "covariance:@voigt", "tensor", "stress:six"] {
            assert!(bad.parse::<Tensor>().is_err(), "{bad}");
        }
    }

    #[test]
    fn the_usual_ellipsoid_is_as_long_as_a_sphere_and_nothing_has_none() {
        let zero = [0.0; 6];
        let given = [8.0, -4.0, 0.0, 0.0, 0.0, 0.0];
        let lacks = [f32::NAN; 6];
        let particles = particles(vec![own("s", &[given, zero, lacks].concat())]);
        let auto = found(&particles, "tensor:s", None).unwrap();
        let told = "1 ellipsoid by the tensor s (xx yy zz xy xz yz), half axes its eigenvalues times 0.0625, 1 sphere, 1 particle left out whose tensor is 0, up to 0.5 from the center";
        assert_eq!(auto.description, told);
        let [one, other] = auto.ellipsoids[..] else { panic!("two") };
        assert_eq!((one.half_axes, one.particle), (DVec3::new(0.5, 0.25, 5e-4), 0));
        assert_eq!((other.half_axes, other.particle), (DVec3::splat(0.5), 2));
        // What is negative is no square.
        let roots = found(&particles, "covariance:s", Some(1.0)).unwrap();
        let root = 8.0_f64.sqrt();
        assert!(roots.ellipsoids[0].half_axes.abs_diff_eq(DVec3::new(root, 1e-3 * root, 1e-3 * root), 1e-12));
    }
}
