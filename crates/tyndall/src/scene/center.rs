//! Where the middle of what is looked at lies, as users write it.

use std::fmt;
use std::str::FromStr;

use glam::DVec3;

use super::select::{Filter, Selectable, present};
use super::{grouped, short, viewpoint};
use crate::error::{Error, Result};
use crate::particles::Particles;
use crate::periodic::{Placement, center};

/// A center.
#[derive(Clone, Debug, PartialEq)]
pub enum Center {
    /// A point, in the coordinates of the file.
    Point(DVec3),
    /// The densest place: see [`center::densest`].
    Densest,
    /// The middle of the particles for which a condition is true: see [`center::middle`].
    Of(Filter),
}

impl FromStr for Center {
    type Err = Error;

    /// Reads `X,Y,Z`, `densest` or a condition.
    fn from_str(text: &str) -> Result<Self> {
        let text = text.trim();
        if let Some(point) = viewpoint::point(text) {
            return Ok(Self::Point(point));
        }
        if text.eq_ignore_ascii_case("densest") {
            return Ok(Self::Densest);
        }
        Filter::condition(text).map(Self::Of).map_err(|_| {
            let allowed = "a point X,Y,Z, densest, or a condition such as 'id == 12' or 'element == Fe', of what it is true for";
            Error::setting("--center", text, allowed)
        })
    }
}

impl fmt::Display for Center {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Point(point) => write!(f, "{}", written(*point)),
            Self::Densest => f.write_str("densest"),
            Self::Of(condition) => condition.fmt(f),
        }
    }
}

fn written(point: DVec3) -> String {
    point.to_array().map(short).join(",")
}

impl Center {
    /// The condition that particles in the middle fulfill, if that is what this says.
    pub fn condition(&self) -> Option<&Filter> {
        match self {
            Self::Of(condition) => Some(condition),
            Self::Point(_) | Self::Densest => None,
        }
    }

    /// The particles measured from the center, and around it: see [`center::around`]. Returns too where it was, and what was done, in one line.
    ///
    /// Fails with [`Error::Setting`] if there is no such center, and as [`crate::periodic::place`] does.
    pub fn place(&self, particles: Particles, placement: Placement) -> Result<(Particles, String)> {
        let (point, text) = match self {
            Self::Point(point) => (*point, String::new()),
            Self::Densest => {
                let point = center::densest(&particles);
                let point =
                    point.ok_or_else(|| Error::setting("--center", self, "X,Y,Z: there are no particles"))?;
                (point, ", the densest place".into())
            }
            Self::Of(condition) => {
                let flags = Selectable::of(&particles, condition).and_then(|it| it.flags(condition));
                let flags = flags.map_err(|error| match error {
                    Error::Setting { allowed, .. } => Error::setting("--center", self, allowed),
                    other => other,
                })?;
                let ids: Vec<u32> = (0..flags.len() as u32).filter(|&id| flags[id as usize]).collect();
                let point = center::middle(&particles, &ids).ok_or_else(|| {
                    let there_are = present(&particles, condition.quantity());
                    Error::setting("--center", self, format!("true for some particles ({there_are})"))
                })?;
                (point, format!(", the middle of {} with {condition}", grouped(ids.len())))
            }
        };
        let (particles, placed) = center::around(particles, point, placement)?;
        let placed = placed.map_or(String::new(), |text| format!(", {text}"));
        Ok((particles, format!("measured from {}{text}{placed}", written(point))))
    }
}
