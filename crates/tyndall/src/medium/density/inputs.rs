//! What an estimate takes, checked: the settings, and which attributes weigh, reach and come along.

use super::automatic::{LONGEST, SHORTEST};
use super::finer;
use super::{LENGTH_NAMES, MASS_NAMES, Settings, Smoothing, Weight};
use crate::error::{Error, Result};
use crate::names::nearest;
use crate::particles::{Attribute, Particles};

/// Refuses what no density can be made of.
pub(super) fn check(count: u64, settings: &Settings) -> Result<()> {
    if count == 0 {
        return Err(Error::setting("particles", 0, "at least one: there is nothing to make a density of"));
    }
    if let Some(length) = settings.length
        && !(SHORTEST..LONGEST).contains(&length)
    {
        return Err(Error::setting("smoothing length", length, "a length above 0, from 1e-12 to 1e12"));
    }
    if settings.neighbors == 0 || settings.neighbors > 1 << 20 {
        return Err(Error::setting("neighbors", settings.neighbors, "from 1 to 2^20; 64 is usual"));
    }
    if !(0.0..1.0).contains(&settings.scale) {
        return Err(Error::setting("scale factor", settings.scale, "at least 0 and below 1; 0 is best"));
    }
    if settings.further_passes > 16 {
        return Err(Error::setting("further passes", settings.further_passes, "from 0 to 16"));
    }
    finer::check(settings)
}

/// The attribute that weighs the particles; `None`: each weighs 1.
pub(super) fn weight_attribute<'a>(
    particles: &'a Particles,
    weight: &Weight,
    notes: &mut Vec<String>,
) -> Result<Option<&'a Attribute>> {
    let attribute = match weight {
        Weight::One => None,
        Weight::Automatic => {
            let found = MASS_NAMES.iter().find_map(|&name| exactly(particles, name));
            found.inspect(|it| notes.push(format!("particles are weighted by their '{}'", it.name)))
        }
        Weight::Attribute(name) if name == "mass" => {
            match MASS_NAMES.iter().find_map(|&name| exactly(particles, name)) {
                Some(mass) => Some(mass),
                None => Some(scalar(particles, name)?),
            }
        }
        Weight::Attribute(name) => Some(scalar(particles, name)?),
    };
    attribute.map_or(Ok(None), |it| at_least_zero(particles, it).map(Some))
}

/// The attribute that holds the particles' lengths, if the scatter has one.
pub(super) fn length_attribute<'a>(
    particles: &'a Particles,
    settings: &Settings,
) -> Result<Option<&'a Attribute>> {
    if settings.smoothing != Smoothing::Scatter {
        return Ok(None);
    }
    let attribute = any_length_attribute(particles, settings)?;
    attribute.map_or(Ok(None), |it| at_least_zero(particles, it).map(Some))
}

/// The attribute that holds the particles' lengths, if there is one, whatever numbers it has.
pub(super) fn any_length_attribute<'a>(
    particles: &'a Particles,
    settings: &Settings,
) -> Result<Option<&'a Attribute>> {
    match &settings.particle_length {
        Some(name) => scalar(particles, name).map(Some),
        None => Ok(LENGTH_NAMES.iter().find_map(|&name| exactly(particles, name))),
    }
}

/// The attribute of one component that has exactly this name: a single letter means little in another case.
fn exactly<'a>(particles: &'a Particles, name: &str) -> Option<&'a Attribute> {
    particles.attribute(name).filter(|it| it.name == name && it.components == 1)
}

fn scalar<'a>(particles: &'a Particles, name: &str) -> Result<&'a Attribute> {
    let attribute = particles.attribute(name).ok_or_else(|| no_attribute(particles, name))?;
    match attribute.components {
        1 => Ok(attribute),
        components => {
            Err(Error::setting(name, format!("{components} components"), "an attribute of one component"))
        }
    }
}

fn no_attribute(particles: &Particles, name: &str) -> Error {
    let names: Vec<&str> = particles.attributes().iter().map(|it| &it.name[..]).collect();
    let meant = nearest(name, names.iter().copied());
    let meant = meant.map_or(String::new(), |it| format!("did you mean '{it}'? "));
    Error::setting("attribute", name, format!("{meant}the particles have: {}", names.join(", ")))
}

fn at_least_zero<'a>(particles: &Particles, attribute: &'a Attribute) -> Result<&'a Attribute> {
    let bad = |&id: &usize| !(0.0..f64::from(LONGEST)).contains(&attribute.number(id, 0));
    match (0..particles.len()).find(bad) {
        None => Ok(attribute),
        Some(id) => {
            let value = format!("{} (particle {})", attribute.number(id, 0), particles.place(id));
            Err(Error::setting(&attribute.name, value, "a number of at least 0 for every particle"))
        }
    }
}

/// The components of the attributes that come along.
pub(super) fn fields<'a>(particles: &'a Particles, names: &[String]) -> Result<Vec<(&'a Attribute, usize)>> {
    let mut fields = Vec::new();
    for name in names {
        let attribute = particles.attribute(name).ok_or_else(|| no_attribute(particles, name))?;
        let numbers = 0..particles.len() * attribute.components;
        if let Some(place) = numbers.into_iter().find(|&place| !attribute.values.number(place).is_finite()) {
            let value = format!(
                "{} (particle {})",
                attribute.values.number(place),
                particles.place(place / attribute.components)
            );
            return Err(Error::setting(name, value, "a finite number for every particle"));
        }
        fields.extend((0..attribute.components).map(|component| (attribute, component)));
    }
    Ok(fields)
}
