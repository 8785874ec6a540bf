//! What the caller knows better than a file, said of the particles that were read from it.

use tyndall::{Particles, Result};

use super::Options;

/// Particles that are as the caller says.
pub(crate) struct Told {
    pub(crate) particles: Particles,
    /// What was said in place of the file, one line each.
    pub(crate) given: Vec<String>,
    pub(crate) warnings: Vec<String>,
}

/// The particles as `options` have them.
pub(crate) fn told(mut particles: Particles, options: &Options) -> Result<Told> {
    let (mut given, mut warnings) = (Vec::new(), Vec::new());
    if let Some(elements) = &options.elements {
        let named = elements.name(particles)?;
        particles = named.particles;
        given.push(named.description);
        warnings.extend(named.warning);
    }
    if let Some(units) = &options.units {
        let (in_units, text) = units.name(particles);
        particles = in_units;
        given.push(text);
    }
    Ok(Told { particles, given, warnings })
}

/// The options, with which what they say can be said of the particles: its attributes are wanted, too.
pub(super) fn with_wanted(options: &Options) -> Options {
    let wanted = match &options.elements {
        Some(_) => options.wanted.clone().map(|wanted| wanted.with_types()),
        None => options.wanted.clone(),
    };
    Options { wanted, ..options.clone() }
}
