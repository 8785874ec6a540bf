//! Units of length by name.
//!
//! Sources: BIPM, SI brochure, 9th edition; IAU 2012 and 2015 resolutions B2 (au, pc); CODATA 2022 (Bohr radius).

/// Names, and meters.
const LENGTHS: [(&str, f64); 15] = [
    ("Å", 1e-10),
    ("angstrom", 1e-10),
    ("Bohr", 5.291_772_105_44e-11),
    ("pm", 1e-12),
    ("nm", 1e-9),
    ("um", 1e-6),
    ("µm", 1e-6),
    ("mm", 1e-3),
    ("cm", 1e-2),
    ("m", 1.0),
    ("km", 1e3),
    ("au", 1.495_978_707e11),
    ("pc", 3.085_677_581_491_367e16),
    ("kpc", 3.085_677_581_491_367e19),
    ("Mpc", 3.085_677_581_491_367e22),
];

/// The unit of length of that name, in meters.
pub fn meters(unit: &str) -> Option<f64> {
    LENGTHS.iter().find(|(name, _)| *name == unit).map(|&(_, meters)| meters)
}

/// How many of the unit `from` one of the unit `wanted` is; comoving units (`ckpc`) and those with `/h` become units like them alone.
/// `None` where it cannot be said.
pub fn ratio(wanted: &str, from: &str) -> Option<f64> {
    if wanted == from {
        return Some(1.0);
    }
    // What follows the unit and what precedes it has to be the same on both sides.
    let parts = |unit: &str| {
        let (name, is_over_h) = unit.strip_suffix("/h").map_or((unit, false), |name| (name, true));
        let plain = meters(name).map(|meters| (meters, false, is_over_h));
        plain.or_else(|| {
            let comoving = name.strip_prefix('c').filter(|it| it.ends_with("pc"))?;
            Some((meters(comoving)?, true, is_over_h))
        })
    };
    let ((wanted, a, b), (from, c, d)) = (parts(wanted)?, parts(from)?);
    ((a, b) == (c, d)).then(|| wanted / from)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_become_units_of_their_kind() {
        let near =
            |found: Option<f64>, wanted: f64| found.is_some_and(|it| (it / wanted - 1.0).abs() < 1e-12);
        assert!(
            near(ratio("nm", "Å"), 10.0)
                && near(ratio("cMpc/h", "ckpc/h"), 1e3)
                && near(ratio("Mpc", "kpc"), 1e3)
        );
        assert!(near(ratio("sigma", "sigma"), 1.0));
        for (wanted, from) in [("Mpc", "ckpc"), ("ckpc", "ckpc/h"), ("nm", "sigma"), ("cm/h", "cm")] {
            assert_eq!(ratio(wanted, from), None, "{wanted} of {from}");
        }
    }
}
