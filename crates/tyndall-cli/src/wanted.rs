//! Which attributes are read: those that are written, or of particles that are spread over space what weighs them, how far they reach, and
//! what is asked for beside.

use tyndall::medium::density::{DENSITY_NAMES, LENGTH_NAMES, MASS_NAMES, Smoothing, Weight};
use tyndall::scene::coloring::Coloring;
use tyndall::scene::select::Filter;
use tyndall::scene::wanted::Wanted;

use crate::args::Selection;
use crate::medium::args::Density;

/// For the attributes of these names alone, of particles for which `filters` hold; all if none are named.
pub(crate) fn of_fields(fields: Option<&[String]>, filters: Vec<Filter>) -> Option<Wanted> {
    let one_of = fields?.iter().map(|name| vec![name.clone()]).collect();
    Some(Wanted { coloring: Coloring::Constant([0.0; 3]), filters, one_of, ..Wanted::default() })
}

/// For a density of the selected particles.
pub(crate) fn of_density(density: &Density, selection: &Selection) -> Wanted {
    let settings = density.settings(None);
    let mut wanted = Wanted {
        coloring: Coloring::Constant([0.0; 3]),
        filters: selection.all_filters(),
        ..Wanted::default()
    };
    match settings.weight {
        Weight::One => {}
        Weight::Automatic => wanted.optional.extend(MASS_NAMES.map(String::from)),
        Weight::Attribute(name) if name == "mass" => {
            wanted.one_of.push(MASS_NAMES.map(String::from).to_vec())
        }
        Weight::Attribute(name) => wanted.quantities.push(name),
    }
    if settings.smoothing == Smoothing::Scatter {
        wanted.optional.extend(LENGTH_NAMES.map(String::from));
    }
    wanted
}

/// For a map of `quantity`, or without one of the density.
pub(crate) fn of_map(density: &Density, selection: &Selection, quantity: Option<&str>) -> Wanted {
    let mut wanted = of_density(density, selection);
    wanted.optional.extend(LENGTH_NAMES.map(String::from));
    if let Some(quantity) = quantity {
        wanted.quantities.push(quantity.into());
        wanted.optional.extend(DENSITY_NAMES.map(String::from));
    }
    wanted
}
