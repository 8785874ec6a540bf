//! Which particles are ellipsoids or superquadrics, by attributes of their half axes, how they are turned, and their exponents; or by a tensor.
//!
//! Sources: LAMMPS, `compute property/atom`: `shapex` to `shapez` are diameters, `quatw` to `quatk` the quaternion, which turns from the body to the
//! space; OVITO reads dumps of them as `c_shape` and `c_orient`, the latter with w last. LIGGGHTS has half axes in `shapex` to `shapez`, the quaternion in
//! `quat1` to `quat4`, and exponents in `blockiness1` and `blockiness2`, which tell its files from those of LAMMPS.

mod tensor;

use std::str::FromStr;

use glam::{DQuat, DVec3};
use rayon::prelude::*;

use super::quantity::{Component, Quantity, meant_vector};
use super::statistics::{grouped, quantiles, sampled_ids, short};
use crate::error::{Error, Result};
use crate::particles::{Attribute, Particles};
use crate::structure::Spheres;
use crate::structure::shapes::Ellipsoid;
pub(super) use tensor::attributes as tensor_attributes;
pub use tensor::{HalfAxes, Order, Tensor};

/// What says which particles are ellipsoids.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Shaping {
    /// The attributes that LAMMPS has for them, if they are there.
    #[default]
    Auto,
    /// Nothing: all are spheres.
    Spheres,
    /// A vector attribute of half axes, one of quaternions, w first, and one of exponents.
    Given {
        /// Half axes along x, y and z before the particle is turned.
        half_axes: String,
        /// How it is turned; without it, it is not.
        turn: Option<String>,
        /// Exponents n1 and n2: see [`Ellipsoid::exponents`]; without them it is an ellipsoid.
        exponents: Option<String>,
    },
    /// A symmetric tensor, along whose principal axes the half axes are.
    Tensor(Tensor),
}

impl FromStr for Shaping {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        if text.starts_with("tensor:") || text.starts_with("covariance:") {
            return text.parse().map(Self::Tensor);
        }
        let names: Vec<&str> = text.split(',').map(str::trim).collect();
        match names[..] {
            ["auto"] => Ok(Self::Auto),
            ["none"] => Ok(Self::Spheres),
            [half_axes, ref rest @ ..] if rest.len() < 3 && names.iter().all(|name| !name.is_empty()) => {
                let name = |place: usize| rest.get(place).map(|name| name.to_string());
                Ok(Self::Given { half_axes: half_axes.into(), turn: name(0), exponents: name(1) })
            }
            _ => {
                let allowed = "auto, none, tensor:NAME, covariance:NAME, HALF_AXES, HALF_AXES,QUATERNION or HALF_AXES,QUATERNION,EXPONENTS";
                Err(Error::setting("--ellipsoids", text, allowed))
            }
        }
    }
}

/// Ellipsoids to be drawn in place of all spheres: what has no half axes is one with those of its sphere, what has a tensor of 0 is none.
#[derive(Clone, Debug)]
pub struct Ellipsoids {
    /// At most one for each particle, in their order.
    pub ellipsoids: Vec<Ellipsoid>,
    /// How far most of them reach, for a camera that frames them.
    pub reach: f32,
    /// How they were found, in one line.
    pub description: String,
}

/// What LAMMPS calls diameters.
const SHAPES: [[&str; 3]; 2] = [["shapex", "shapey", "shapez"], ["c_shape[1]", "c_shape[2]", "c_shape[3]"]];
/// What it calls quaternions, here with w first.
const TURNS: [[&str; 4]; 4] = [
    ["quatw", "quati", "quatj", "quatk"],
    ["quat1", "quat2", "quat3", "quat4"],
    ["c_quat[1]", "c_quat[2]", "c_quat[3]", "c_quat[4]"],
    ["c_orient[4]", "c_orient[1]", "c_orient[2]", "c_orient[3]"],
];
/// What LIGGGHTS calls exponents; where they are, `shapex` to `shapez` are half axes.
const EXPONENTS: [&str; 2] = ["blockiness1", "blockiness2"];
/// No half axis is a smaller share of the longest: flatter ones would be lost to rounding.
const FLATTEST: f64 = 1e-3;
/// Ellipsoids that are looked at for how far they reach.
const SAMPLES: usize = 10_000;

/// Whether an attribute of that name may be looked at.
pub(super) fn is_named(name: &str) -> bool {
    SHAPES.iter().flatten().chain(TURNS.iter().flatten()).chain(&EXPONENTS).any(|known| *known == name)
}

/// Finds ellipsoids, which would be these spheres otherwise; without any half axes there are none. All are scaled as radii are, and by
/// `scale`: by 1 without it, of a tensor so that most are as long as spheres.
///
/// Fails with [`Error::Setting`] if an attribute is asked for that is not there.
pub fn find(spheres: Spheres, shaping: &Shaping, scale: Option<f32>) -> Result<Option<Ellipsoids>> {
    let particles = spheres.particles;
    let (half_axes, turn, exponents, factor, by): Found = match shaping {
        Shaping::Spheres => return Ok(None),
        Shaping::Tensor(tensor) => return tensor::find(spheres, tensor, scale).map(Some),
        Shaping::Auto => {
            let Some(axes) = SHAPES.iter().find_map(|names| scalars(particles, names)) else {
                return Ok(None);
            };
            let turn = TURNS.iter().find_map(|names| scalars(particles, names)).unwrap_or_default();
            let exponents = scalars(particles, &EXPONENTS).unwrap_or_default();
            let all = axes.iter().chain(turn.first()).chain(exponents.first());
            let by = all.map(|it| it.name.as_str()).collect::<Vec<_>>().join(" ");
            let (factor, what) = if exponents.is_empty() { (0.5, "diameters") } else { (1.0, "half axes") };
            (own(axes), own(turn), own(exponents), factor, format!("{what} {by}"))
        }
        Shaping::Given { half_axes, turn, exponents } => {
            let more = turn.iter().chain(exponents).map(|name| format!(" {name}")).collect::<String>();
            let given = |name: &Option<String>, count| {
                name.as_ref().map_or(Ok(Vec::new()), |name| vector(particles, name, count))
            };
            let axes = vector(particles, half_axes, 3)?;
            (axes, given(turn, 4)?, given(exponents, 2)?, 1.0, format!("half axes {half_axes}{more}"))
        }
    };
    let factor = factor * f64::from(spheres.radius_scale) * f64::from(scale.unwrap_or(1.0));
    let ellipsoid = |id: usize| {
        let number = |columns: &[Column], place: usize| columns.get(place).map_or(0.0, |it| it.value(id));
        let axes = factor * DVec3::from([0, 1, 2].map(|place| number(&half_axes, place)));
        let is_shaped = axes.is_finite() && axes.min_element() >= 0.0 && axes.max_element() > 0.0;
        let axes = match is_shaped {
            true => axes.max(DVec3::splat(FLATTEST * axes.max_element())),
            false => DVec3::splat(f64::from(spheres.radius(id))),
        };
        let [w, x, y, z] = [0, 1, 2, 3].map(|place| number(&turn, place));
        let turn = DQuat::from_xyzw(x, y, z, w);
        let is_turned = turn.is_finite() && turn.length() > 1e-9;
        let turn = if is_turned { turn.normalize() } else { DQuat::IDENTITY };
        let exponents = match (is_shaped, &exponents[..]) {
            (true, [one, other]) => [one, other].map(|it| it.value(id).clamp(1.0, Ellipsoid::MOST_EXPONENT)),
            _ => Ellipsoid::ROUND,
        };
        let exponents = if exponents.iter().any(|it| it.is_nan()) { Ellipsoid::ROUND } else { exponents };
        (Ellipsoid { particle: id as u32, half_axes: axes, turn, exponents }, is_shaped)
    };
    let found: Vec<(Ellipsoid, bool)> = (0..particles.len()).into_par_iter().map(ellipsoid).collect();
    let shaped = found.iter().filter(|(_, is_shaped)| *is_shaped).count();
    if shaped == 0 && *shaping == Shaping::Auto {
        return Ok(None);
    }
    let thing = if exponents.is_empty() { "ellipsoid" } else { "superquadric" };
    let mut description = format!("{} by {by}", many(shaped, thing));
    if shaped < found.len() {
        description += &format!(", {}", many(found.len() - shaped, "sphere"));
    }
    Ok(Some(told(found.into_iter().map(|(ellipsoid, _)| ellipsoid).collect(), description)))
}

/// So many things, in words.
fn many(count: usize, thing: &str) -> String {
    format!("{} {thing}{}", grouped(count), if count == 1 { "" } else { "s" })
}

/// What was found, with how far it reaches.
fn told(ellipsoids: Vec<Ellipsoid>, mut description: String) -> Ellipsoids {
    let mut reaches: Vec<f64> =
        sampled_ids(ellipsoids.len(), SAMPLES).map(|id| ellipsoids[id].reach()).collect();
    let reach = quantiles(&mut reaches, [0.99]).map_or(0.0, |[reach]| reach);
    description += &format!(", up to {} from the center", short(reach));
    Ellipsoids { ellipsoids, reach: reach as f32, description }
}

/// Half axes, quaternions, exponents, what the first are multiplied with, and all in words.
type Found<'a> = (Vec<Column<'a>>, Vec<Column<'a>>, Vec<Column<'a>>, f64, String);

/// Numbers of the particles.
enum Column<'a> {
    Own(&'a Attribute),
    Part(Quantity<'a>),
}

impl Column<'_> {
    fn value(&self, id: usize) -> f64 {
        match self {
            Self::Own(attribute) => attribute.number(id, 0),
            Self::Part(quantity) => quantity.value(id),
        }
    }
}

/// The attributes of these names, of a number a particle each.
fn scalars<'a>(particles: &'a Particles, names: &[&str]) -> Option<Vec<&'a Attribute>> {
    names.iter().map(|name| particles.attribute(name).filter(|it| it.components == 1)).collect()
}

fn own(attributes: Vec<&Attribute>) -> Vec<Column<'_>> {
    attributes.into_iter().map(Column::Own).collect()
}

/// The components of a vector.
fn vector<'a>(particles: &'a Particles, name: &str, count: usize) -> Result<Vec<Column<'a>>> {
    let own = particles.attribute(name).filter(|it| it.components == count);
    let part = |place| Quantity::of_name(particles, name, Some(Component::Index(place))).map(Column::Part);
    let found = (0..count).map(|place| if own.is_some() || count <= 3 { part(place) } else { None });
    found.collect::<Option<Vec<_>>>().ok_or_else(|| {
        let meant = meant_vector(particles, name);
        Error::setting("--ellipsoids", name, format!("an attribute of {count} numbers a particle{meant}"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::particles::{Columns, Positions, Radii, Values};

    fn particles(names: &[(&str, [f32; 2])]) -> Particles {
        let mut positions = Positions::around(DVec3::ZERO);
        positions.extend(&[DVec3::ZERO, DVec3::X * 5.0]);
        let attributes =
            names.iter().map(|(name, values)| Attribute::new(*name, 1, Values::F32(values.to_vec())));
        Particles::new(Columns { positions, attributes: attributes.collect(), ..Columns::default() }).unwrap()
    }

    #[test]
    fn diameters_and_quaternions_of_lammps_are_found() {
        let half = std::f32::consts::FRAC_1_SQRT_2;
        let particles = particles(&[
            ("shapex", [4.0, 0.0]),
            ("shapey", [2.0, 0.0]),
            ("shapez", [1.0, 0.0]),
            ("quatw", [half, 1.0]),
            ("quati", [0.0, 0.0]),
            ("quatj", [0.0, 0.0]),
            ("quatk", [half, 0.0]),
        ]);
        let radii = Radii::Uniform(0.25);
        let spheres = Spheres { particles: &particles, radii: &radii, radius_scale: 2.0 };
        let found = find(spheres, &Shaping::Auto, None).unwrap().unwrap();
        assert_eq!(
            found.description,
            "1 ellipsoid by diameters shapex shapey shapez quatw, 1 sphere, up to 4 from the center"
        );
        let [one, other] = found.ellipsoids[..] else { panic!("two") };
        assert_eq!((one.half_axes, one.particle), (DVec3::new(4.0, 2.0, 1.0), 0));
        assert!((one.turn * DVec3::X).abs_diff_eq(DVec3::Y, 1e-6), "turned by a quarter about z");
        assert_eq!((other.half_axes, other.turn), (DVec3::splat(0.5), DQuat::IDENTITY));
        assert!(find(spheres, &Shaping::Spheres, None).unwrap().is_none());
    }

    #[test]
    fn superquadrics_of_liggghts_are_found() {
        let particles = particles(&[
            ("shapex", [4.0, 1.0]),
            ("shapey", [2.0, 1.0]),
            ("shapez", [1.0, 1.0]),
            ("quat1", [0.0, 1.0]),
            ("quat2", [0.0, 0.0]),
            ("quat3", [1.0, 0.0]),
            ("quat4", [0.0, 0.0]),
            ("blockiness1", [8.0, 2.0]),
            ("blockiness2", [3.0, 2.0]),
        ]);
        let spheres = Spheres { particles: &particles, radii: &Radii::Uniform(1.0), radius_scale: 1.0 };
        let found = find(spheres, &Shaping::Auto, None).unwrap().unwrap();
        assert!(
            found
                .description
                .starts_with("2 superquadrics by half axes shapex shapey shapez quat1 blockiness1")
        );
        let [one, other] = found.ellipsoids[..] else { panic!("two") };
        assert_eq!((one.half_axes, one.exponents), (DVec3::new(4.0, 2.0, 1.0), [8.0, 3.0]));
        assert!((one.turn * DVec3::X).abs_diff_eq(DVec3::NEG_X, 1e-6), "half a turn about y");
        assert_eq!(other.exponents, Ellipsoid::ROUND);
    }

    #[test]
    fn attributes_are_named_or_refused() {
        let particles = particles(&[("ax", [1.0, 2.0]), ("ay", [1.0, 1.0]), ("az", [0.0, 1.0])]);
        let spheres = Spheres { particles: &particles, radii: &Radii::Uniform(1.0), radius_scale: 1.0 };
        assert!(find(spheres, &Shaping::Auto, None).unwrap().is_none());
        let found = find(spheres, &"a".parse().unwrap(), None).unwrap().unwrap();
        assert_eq!(found.ellipsoids[0].half_axes, DVec3::new(1.0, 1.0, 1e-3), "flat, but not lost");
        let said = |text: &str| find(spheres, &text.parse().unwrap(), None).unwrap_err().to_string();
        assert!(said("aa").contains("3 numbers a particle; did you mean 'a'?"), "{}", said("aa"));
        assert!(
            said("a,q").contains("--ellipsoids cannot be 'q' — an attribute of 4 numbers"),
            "{}",
            said("a,q")
        );
        let doubled = find(spheres, &"a".parse().unwrap(), Some(2.0)).unwrap().unwrap();
        assert_eq!(doubled.ellipsoids[1].half_axes, DVec3::new(4.0, 2.0, 2.0));
        for bad in ["", "a,b,c,d", "a,", ",b", "tensor:", "covariance:@voigt"] {
            assert!(bad.parse::<Shaping>().is_err(), "{bad}");
        }
    }
}
