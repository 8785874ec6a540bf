//! Radii that somebody asks for, in place of those that are guessed (see [`super::automatic`]).

use std::fmt;
use std::str::FromStr;

use rayon::prelude::*;

use super::meaning::Meaning;
use crate::error::{Error, Result};
use crate::particles::{Attribute, Particles, Radii, Values};

/// The radii of particles, as users write them.
#[derive(Clone, Debug, PartialEq)]
pub enum Size {
    /// One for all: above 0.
    Uniform(f32),
    /// Each its own: an attribute or an expression, as colors are written.
    Each(String),
}

impl Size {
    /// The radii where they are one for all, and a line that says so, as [`super::automatic::radii`] does.
    pub fn uniform(&self) -> Option<(Radii, String)> {
        match self {
            Self::Uniform(radius) => Some((Radii::Uniform(*radius), format!("radius {self} given"))),
            Self::Each(_) => None,
        }
    }

    /// What each particle's is, where they are not one for all.
    pub fn quantity(&self) -> Option<&str> {
        match self {
            Self::Uniform(_) => None,
            Self::Each(text) => Some(text),
        }
    }

    /// The particles with a radius for each, if that is what this says. Those whose radius is missing, infinite or negative are left out, and counted by
    /// [`Particles::dropped`]. The radii are of an attribute, which is added where the text is not the name of one.
    ///
    /// Fails with [`Error::Setting`] if there is no such quantity, or it stands for words.
    pub fn apply(&self, particles: Particles) -> Result<Particles> {
        let Some(text) = self.quantity() else { return Ok(particles) };
        let quantity = Meaning::number(&particles, "--radius", text)?;
        let is_itself = |it: &Attribute| it.components == 1 && it.name == text;
        if let Some(attribute) = particles.attributes().iter().position(is_itself) {
            return Ok(particles.sized(Radii::PerParticle { attribute, scale: 1.0 }));
        }
        let ids = (0..particles.len()).into_par_iter().with_min_len(1 << 14);
        let values = Values::F32(ids.map(|id| quantity.value(id) as f32).collect());
        let attribute = particles.attributes().len();
        let particles = particles.with_attribute(Attribute::new(text, 1, values))?;
        Ok(particles.sized(Radii::PerParticle { attribute, scale: 1.0 }))
    }
}

impl FromStr for Size {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let text = text.trim();
        match text.parse::<f32>() {
            Ok(radius) if radius.is_finite() && radius > 0.0 => Ok(Self::Uniform(radius)),
            Err(_) if !text.is_empty() => Ok(Self::Each(text.into())),
            _ => Err(Error::setting(
                "--radius",
                text,
                "a number greater than 0, an attribute or an expression",
            )),
        }
    }
}

impl fmt::Display for Size {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Uniform(radius) => write!(f, "{}", super::short((*radius).into())),
            Self::Each(text) => f.write_str(text),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::particles::{Columns, Dropped, Positions};
    use glam::DVec3;

    fn particles() -> Particles {
        let mut positions = Positions::default();
        positions.extend(&[DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z]);
        let d = Values::F64(vec![2.0, -1.0, f64::NAN, 0.5]);
        let (names, codes) = (vec!["a".into(), "b".into()], vec![0, 1, 0, 1]);
        let attributes = vec![
            Attribute::new("d", 1, d),
            Attribute::new("word", 1, Values::Text { codes, names }),
            Attribute::new("v", 2, Values::F32(vec![3.0, 4.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0])),
        ];
        Particles::new(Columns { positions, attributes, ..Columns::default() }).unwrap()
    }

    fn radii(text: &str) -> (Vec<f32>, Dropped) {
        let sized = text.parse::<Size>().unwrap().apply(particles()).unwrap();
        let radii = sized.radii().unwrap();
        ((0..sized.len()).map(|id| sized.radius(radii, id)).collect(), sized.dropped())
    }

    #[test]
    fn each_has_its_own() {
        let dropped = |radius| Dropped { radius, ..Dropped::default() };
        assert_eq!(radii("d"), (vec![2.0, 0.5], dropped(2)));
        assert_eq!(radii("abs(d) / 2"), (vec![1.0, 0.5, 0.25], dropped(1)));
        assert_eq!(radii("|v|"), (vec![5.0, 0.0, 1.0, 1.0], dropped(0)));
        assert_eq!(radii("if(word == a, 1, 3)"), (vec![1.0, 3.0, 1.0, 3.0], dropped(0)));
        let sized = Size::Each("d".into()).apply(particles()).unwrap();
        assert_eq!(
            (sized.attributes().len(), sized.place(1)),
            (3, 3),
            "no copy; places in the file are kept"
        );
    }

    #[test]
    fn what_is_no_size_is_refused() {
        for text in ["0", "-1", "inf", "nan", "", " "] {
            assert!(text.parse::<Size>().is_err(), "{text}");
        }
        let error = |text: &str| Size::Each(text.into()).apply(particles()).unwrap_err().to_string();
        assert!(error("word").contains("--radius") && error("word").contains("words"));
        assert!(error("radios").contains("--radius"));
        assert_eq!("0.25".parse::<Size>().unwrap(), Size::Uniform(0.25));
        assert_eq!(Size::Uniform(0.25).apply(particles()).unwrap().radii(), None);
    }
}
