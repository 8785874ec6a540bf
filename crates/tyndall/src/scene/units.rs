//! Units of length by name, the unit systems of LAMMPS, and units as somebody says them of a file.
//!
//! Sources: BIPM, SI brochure, 9th edition; IAU 2012 and 2015 resolutions B2 (au, pc); CODATA 2022 (Bohr radius); LAMMPS documentation of
//! `units`.

use std::str::FromStr;

use crate::error::{Error, Result};
use crate::names::nearest;
use crate::particles::{Attribute, Particles};

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
/// Other spellings, without regard to case, and what they mean.
const SPELLINGS: [(&str, &str); 11] = [
    ("A", "Å"),
    // The sign of the unit, which looks like the letter.
    ("\u{212b}", "Å"),
    ("angstrom", "Å"),
    ("angstroms", "Å"),
    ("bohr", "Bohr"),
    ("a0", "Bohr"),
    ("nanometer", "nm"),
    ("nanometre", "nm"),
    ("um", "µm"),
    // The Greek letter instead of the sign.
    ("\u{3bc}m", "µm"),
    ("micron", "µm"),
];

/// A unit system of LAMMPS, its `style`.
#[derive(Debug, PartialEq)]
pub struct Style {
    /// Its name.
    pub name: &'static str,
    /// The units of length, time and velocity; none where these are numbers alone.
    units: Option<[&'static str; 3]>,
}

const STYLES: [Style; 8] = [
    Style { name: "lj", units: None },
    Style { name: "real", units: Some(["Å", "fs", "Å/fs"]) },
    Style { name: "metal", units: Some(["Å", "ps", "Å/ps"]) },
    Style { name: "si", units: Some(["m", "s", "m/s"]) },
    Style { name: "cgs", units: Some(["cm", "s", "cm/s"]) },
    Style { name: "electron", units: Some(["Bohr", "fs", "Bohr/atomic time unit"]) },
    Style { name: "micro", units: Some(["µm", "µs", "µm/µs"]) },
    Style { name: "nano", units: Some(["nm", "ns", "nm/ns"]) },
];

impl Style {
    /// The style of that name.
    pub fn find(name: &str) -> Option<&'static Self> {
        STYLES.iter().find(|it| it.name == name)
    }

    /// The unit of length.
    pub fn length(&self) -> Option<&'static str> {
        self.units.map(|[length, ..]| length)
    }

    /// The unit of time.
    pub fn time(&self) -> Option<&'static str> {
        self.units.map(|[_, time, _]| time)
    }

    /// Gives velocities their unit.
    pub fn tell_velocities(&self, attributes: &mut [Attribute]) {
        for attribute in
            attributes.iter_mut().filter(|it| VELOCITIES.contains(&&*it.name.to_ascii_lowercase()))
        {
            attribute.unit = self.units.map(|[.., velocity]| velocity.to_string());
        }
    }
}

/// Attributes that are velocities.
const VELOCITIES: [&str; 4] = ["vx", "vy", "vz", "velocity"];
/// Units of time that are none, in which a file counts something else.
const COUNTED: [&str; 3] = ["step", "a", "time code"];

/// The units of a file, as somebody says who knows them.
#[derive(Clone, Debug, PartialEq)]
pub struct Units {
    length: Option<String>,
    style: Option<&'static Style>,
}

impl FromStr for Units {
    type Err = Error;

    /// Reads a unit of length, such as `nm` or `ckpc/h`, or the name of a style of LAMMPS.
    fn from_str(text: &str) -> Result<Self> {
        if let Some(style) = STYLES.iter().find(|it| it.name.eq_ignore_ascii_case(text)) {
            return Ok(Self { length: style.length().map(String::from), style: Some(style) });
        }
        let length = spelled(text).filter(|unit| parts(unit).is_some()).ok_or_else(|| {
            let lengths = LENGTHS.iter().map(|(name, _)| *name);
            let names = || lengths.clone().chain(STYLES.iter().map(|it| it.name));
            let list = |names: &mut dyn Iterator<Item = &str>| names.collect::<Vec<_>>().join(" ");
            let meant = nearest(text, names()).map_or(String::new(), |it| format!("; did you mean {it}?"));
            let (lengths, styles) = (list(&mut lengths.clone()), list(&mut STYLES.iter().map(|it| it.name)));
            let allowed = format!("a unit of length ({lengths}) or a style of LAMMPS ({styles}){meant}");
            Error::setting("--units", text, allowed)
        })?;
        Ok(Self { length: Some(length.to_string()), style: None })
    }
}

impl Units {
    /// The unit system of LAMMPS, if it is one.
    pub fn style(&self) -> Option<&'static Style> {
        self.style
    }

    /// The particles in these units, and what these are, in one line: of lengths, and of a unit system those of times and velocities. Numbers stay.
    pub fn name(&self, particles: Particles) -> (Particles, String) {
        let before = (particles.length_unit().map(String::from), particles.time_unit().map(String::from));
        let is_time =
            particles.time().is_some() && before.1.as_deref().is_none_or(|it| !COUNTED.contains(&it));
        let time = match self.style.filter(|_| is_time) {
            Some(style) => style.time().map(String::from),
            None => before.1.clone(),
        };
        let mut text = match (self.style, &self.length) {
            (Some(style), None) => format!("units {}: numbers alone", style.name),
            (Some(style), Some(length)) => format!("units {}: lengths in {length}", style.name),
            (None, length) => format!("lengths in {}", length.as_deref().unwrap_or_default()),
        };
        if let Some(time) = time.as_ref().filter(|_| is_time && self.style.is_some()) {
            text += &format!(", times in {time}");
        }
        let differs = |before: &Option<String>, now: &Option<String>| {
            let same = before.as_ref().zip(now.as_ref()).and_then(|(before, now)| ratio(now, before));
            before.clone().filter(|_| same != Some(1.0))
        };
        let others: Vec<String> =
            differs(&before.0, &self.length).into_iter().chain(differs(&before.1, &time)).collect();
        if !others.is_empty() {
            text += &format!(", in place of {} as the file or its format says", others.join(" and "));
        }
        let mut particles = particles.with_units(self.length.clone(), time);
        if let Some(style) = self.style {
            particles = particles.with_attributes_told(|attributes| style.tell_velocities(attributes));
        }
        (particles, text)
    }
}

/// The name of a unit that may be spelled otherwise; itself where it is known as it is.
fn spelled(unit: &str) -> Option<&str> {
    let other = SPELLINGS.iter().find(|(name, _)| name.eq_ignore_ascii_case(unit)).map(|(_, meant)| *meant);
    other.or_else(|| (!unit.is_empty()).then_some(unit))
}

/// The unit of length of that name in any of its spellings, and how many meters it has.
pub(super) fn known(unit: &str) -> Option<(&'static str, f64)> {
    let name = spelled(unit)?;
    LENGTHS.iter().find(|(known, _)| *known == name).copied()
}

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
    let ((wanted, a, b), (from, c, d)) = (parts(wanted)?, parts(from)?);
    ((a, b) == (c, d)).then(|| wanted / from)
}

/// The meters of a unit, whether it is comoving, and whether it is over h.
fn parts(unit: &str) -> Option<(f64, bool, bool)> {
    let (name, is_over_h) = unit.strip_suffix("/h").map_or((unit, false), |name| (name, true));
    let plain = meters(name).map(|meters| (meters, false, is_over_h));
    plain.or_else(|| {
        let comoving = name.strip_prefix('c').filter(|it| it.ends_with("pc"))?;
        Some((meters(comoving)?, true, is_over_h))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::particles::{Columns, Values};

    /// A particle with a time and a velocity, of a file with these units.
    fn particles(length: Option<&str>, time: Option<&str>) -> Particles {
        let mut columns = Columns { time: Some(0.5), ..Columns::default() };
        columns.positions.extend(&[glam::DVec3::ZERO]);
        columns.attributes = ["vx", "q"].map(|it| Attribute::new(it, 1, Values::F32(vec![1.0]))).to_vec();
        (columns.length_unit, columns.time_unit) = (length.map(String::from), time.map(String::from));
        Particles::new(columns).unwrap()
    }

    /// Units of length, time and velocity, and what is said.
    fn named(units: &str, particles: Particles) -> (String, String) {
        let (particles, text) = units.parse::<Units>().unwrap().name(particles);
        let velocity = particles.attributes()[0].unit.clone();
        assert_eq!(particles.attributes()[1].unit, None);
        let all = [particles.length_unit(), particles.time_unit(), velocity.as_deref()];
        (all.map(|it| it.unwrap_or("-")).join(" "), text)
    }

    #[test]
    fn units_are_told_of_files_that_do_not_say_them() {
        let bare = || particles(None, None);
        assert_eq!(named("nm", bare()), ("nm - -".into(), "lengths in nm".into()));
        assert_eq!(
            named("metal", bare()),
            ("Å ps Å/ps".into(), "units metal: lengths in Å, times in ps".into())
        );
        assert_eq!(named("LJ", bare()), ("- - -".into(), "units lj: numbers alone".into()));
        for (spelled, meant) in [
            ("A", "Å"),
            ("\u{212b}", "Å"),
            ("Angstrom", "Å"),
            ("bohr", "Bohr"),
            ("um", "µm"),
            ("cMpc/h", "cMpc/h"),
        ] {
            assert_eq!(named(spelled, bare()).0, format!("{meant} - -"));
        }
        for style in &STYLES {
            assert!(style.length().is_none_or(|it| meters(it).is_some()), "{}", style.name);
        }
    }

    #[test]
    fn what_the_file_says_gives_way_and_that_is_said() {
        let (units, text) = named("nm", particles(Some("Å"), Some("ps")));
        assert_eq!(units, "nm ps -");
        assert_eq!(text, "lengths in nm, in place of Å as the file or its format says");
        let (units, text) = named("real", particles(Some("nm"), Some("ps")));
        assert_eq!(units, "Å fs Å/fs");
        assert!(
            text.ends_with("times in fs, in place of nm and ps as the file or its format says"),
            "{text}"
        );
        assert_eq!(named("A", particles(Some("angstrom"), None)).1, "lengths in Å");
        assert_eq!(named("lj", particles(Some("Å"), Some("ps"))).0, "- - -");
        // A number of a step is no time.
        assert_eq!(
            named("metal", particles(Some("Å"), Some("step"))),
            ("Å step Å/ps".into(), "units metal: lengths in Å".into())
        );
    }

    #[test]
    fn what_is_no_unit_says_which_there_are() {
        for (text, part) in [
            ("metall", "did you mean metal?"),
            ("furlong", "kpc Mpc) or a style"),
            ("", "lj real"),
            ("c/h", "Bohr"),
        ] {
            let message = text.parse::<Units>().unwrap_err().to_string();
            assert!(message.contains(part) && message.contains("--units cannot be"), "{message}");
        }
    }

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
