//! The smoothing lengths of SWIFT, as radii of kernels.
//!
//! SWIFT's h is that of a Gaussian of the same width: its kernels end at gamma h, where gamma depends on the kernel and on the dimensions of
//! space (W. Dehnen, H. Aly, MNRAS 425, 2012, table 1). Takes the columns of a snapshot, adds one of gamma h where that is wanted.

use tyndall::Result;
use tyndall::particles::{Attribute, Values};
use tyndall::scene::wanted::Wanted;

use super::tree::Tree;
use crate::read::sections::{self, Column};

/// Kernels by their names in snapshots, and gamma in one, two and three dimensions.
const KERNELS: [(&str, [f64; 3]); 6] = [
    ("Cubic spline (M4)", [1.732051, 1.778002, 1.825742]),
    ("Quartic spline (M5)", [1.936492, 1.977173, 2.018932]),
    ("Quintic spline (M6)", [2.121321, 2.158131, 2.195775]),
    ("Wendland C2", [1.620185, 1.897367, 1.936492]),
    // There are none of these in one dimension.
    ("Wendland C4", [f64::NAN, 2.171239, 2.207940]),
    ("Wendland C6", [f64::NAN, 2.415230, 2.449490]),
];
/// The names that h may have: in snapshots, and in initial conditions.
const NAMES: [&str; 2] = ["SmoothingLengths", "SmoothingLength"];
/// What gamma h is called: the first of [`tyndall::medium::density::LENGTH_NAMES`].
const SUPPORT: &str = tyndall::medium::density::LENGTH_NAMES[0];

/// How far kernels reach.
pub(super) struct Support {
    /// The column of h.
    of: &'static str,
    gamma: f64,
    /// Whether h is wanted itself, and the radii.
    keeps: bool,
    adds: bool,
    convention: String,
}

impl Support {
    /// Of a snapshot with some columns; `None` if none is h, or if there is no kernel of the name that it says.
    pub(super) fn of(tree: &Tree, columns: &[Column]) -> Result<Option<Self>> {
        let Some(of) = NAMES.into_iter().find(|name| columns.iter().any(|it| it.name == *name)) else {
            return Ok(None);
        };
        let scheme = match tree.group("HydroScheme")? {
            Some(scheme) => Some(scheme.attributes()?),
            None => None,
        };
        let said = scheme.as_ref().and_then(|it| it.text("Kernel function"));
        let dimension = scheme.as_ref().and_then(|it| it.number("Dimension")).unwrap_or(3.0);
        Ok(gamma(said.as_deref(), dimension).map(|(kernel, gamma)| {
            let known = if said.is_some() { "" } else { ", as the file does not say another" };
            let convention =
                format!("{SUPPORT} is {gamma} times {of}: where the kernel, {kernel}, ends{known}");
            Self { of, gamma, keeps: true, adds: true, convention }
        }))
    }

    /// Which of the columns have to be read.
    pub(super) fn flags(&mut self, columns: &[Column], wanted: Option<&Wanted>) -> Vec<bool> {
        let mut offered = columns.to_vec();
        offered.push(Column::new(SUPPORT, 1));
        let mut flags = sections::flags(&offered, wanted);
        self.adds = flags.pop().unwrap_or(false);
        if let Some(place) = columns.iter().position(|it| it.name == self.of) {
            self.keeps = flags[place];
            flags[place] |= self.adds;
        }
        flags
    }

    /// Adds the radii, if they are wanted. Says what they are.
    pub(super) fn add(self, attributes: &mut Vec<Attribute>) -> Option<String> {
        let place = attributes.iter().position(|it| it.name == self.of)?;
        if !self.adds {
            return None;
        }
        let lengths = &attributes[place];
        let values = match &lengths.values {
            Values::F32(lengths) => Values::F32(lengths.iter().map(|it| it * self.gamma as f32).collect()),
            other => Values::F64((0..other.len()).map(|id| other.number(id) * self.gamma).collect()),
        };
        let unit = lengths.unit.clone();
        if !self.keeps {
            attributes.remove(place);
        }
        attributes.push(Attribute { unit, ..Attribute::new(SUPPORT, 1, values) });
        Some(self.convention)
    }
}

/// A kernel and its gamma; cubic splines, SWIFT's usual ones, where nothing is said.
fn gamma(kernel: Option<&str>, dimension: f64) -> Option<(&'static str, f64)> {
    let (name, _) = KERNELS[0];
    let (name, gamma) = KERNELS.into_iter().find(|it| it.0 == kernel.unwrap_or(name))?;
    let gamma = *gamma.get((dimension as usize).checked_sub(1)?)?;
    (!gamma.is_nan()).then_some((name, gamma))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The second moment of a kernel along an axis, in units of its radius squared, in three dimensions.
    fn moment(shape: impl Fn(f64) -> f64) -> f64 {
        let sum = |power: i32| {
            let at = |k: u32| (f64::from(k) + 0.5) / 1e4;
            (0..10_000).map(|k| shape(at(k)) * at(k).powi(power)).sum::<f64>()
        };
        sum(4) / sum(2) / 3.0
    }

    #[test]
    fn a_kernel_ends_where_its_width_is_that_of_the_gaussian() {
        // h is twice the standard deviation along an axis.
        let cubic = |x: f64| (1.0 - x).powi(3) - 4.0 * (0.5 - x).max(0.0).powi(3);
        let c2 = |x: f64| (1.0 - x).powi(4) * (1.0 + 4.0 * x);
        let c6 = |x: f64| (1.0 - x).powi(8) * (1.0 + 8.0 * x + 25.0 * x * x + 32.0 * x.powi(3));
        let found = |name| gamma(Some(name), 3.0).unwrap().1;
        for (name, moment) in
            [("Cubic spline (M4)", moment(cubic)), ("Wendland C2", moment(c2)), ("Wendland C6", moment(c6))]
        {
            let wanted = 0.5 / moment.sqrt();
            assert!((found(name) / wanted - 1.0).abs() < 1e-5, "{name}: {} {wanted}", found(name));
        }
        assert_eq!(gamma(None, 3.0), Some(("Cubic spline (M4)", 1.825742)));
        assert_eq!(gamma(Some("Wendland C2"), 2.0), Some(("Wendland C2", 1.897367)));
        for (kernel, dimension) in [("Wendland C4", 1.0), ("boxcar", 3.0), ("Wendland C2", 0.0)] {
            assert_eq!(gamma(Some(kernel), dimension), None);
        }
    }
}
