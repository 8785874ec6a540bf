//! Colors of kinds: chemical elements, types, words. Each kind has a color of its own, or shares one where there are more.

use rayon::prelude::*;

use super::amounts::{Spread, shown_missing};
use super::color::{Key, Legend, ParticleColors};
use super::coloring::Mapping;
use super::colormap::Colormap;
use super::element::{Element, Elements};
use super::statistics::short;
use crate::particles::{Attribute, Particles, View};

/// Twelve colors that color-blind people tell apart. Source: M. Krzywinski's 12-color palette, mk.bcgsc.ca/colorblind; reordered, so
/// that the first ones are blue, orange and green.
pub(super) const TYPES: [[u8; 3]; 12] = [
    [0x00, 0x8d, 0xf9],
    [0xff, 0x6e, 0x3a],
    [0x00, 0x9f, 0x81],
    [0xff, 0xc3, 0x3b],
    [0x84, 0x00, 0xcd],
    [0xff, 0x5a, 0xaf],
    [0x00, 0xc2, 0xf9],
    [0xe2, 0x01, 0x34],
    [0x00, 0xfc, 0xcf],
    [0x9f, 0x01, 0x62],
    [0xff, 0xb2, 0xfd],
    [0xa4, 0x01, 0x22],
];
/// Names of discrete attributes that sort particles into kinds, best first.
pub(super) const TYPE_NAMES: [&str; 12] = [
    "type",
    "types",
    "typeid",
    "type_id",
    "atom_type",
    "atomtype",
    "ptype",
    "particletype",
    "species",
    "material",
    "classification",
    "kind",
];

/// By Jmol's colors; what is no element has the color of what is missing.
pub(super) fn by_element(particles: &Particles, elements: &Elements, mapping: &Mapping) -> ParticleColors {
    let attribute = &particles.attributes()[elements.attribute];
    // Places by the order of the values would not fit a byte where names are many: several names are one element.
    let mut present: Vec<Element> = elements.by_value.iter().flatten().copied().collect();
    present.sort_unstable();
    present.dedup();
    let missing = present.len();
    let place = |element: &Option<Element>| {
        element.map_or(missing, |it| present.partition_point(|known| *known < it))
    };
    let place_of_value: Vec<u8> = elements.by_value.iter().map(|element| place(element) as u8).collect();
    let place =
        |id: usize| place_of_value.get(attribute.number(id, 0) as usize).copied().unwrap_or(missing as u8);
    let places = (0..particles.len()).into_par_iter().with_min_len(1 << 14).map(place).collect();
    let colors = present.iter().map(|element| element.color()).chain([mapping.missing]).collect();
    let mut description = format!("color elements of {} (Jmol)", attribute.name);
    if elements.known < 1.0 {
        let share = short(100.0 * (1.0 - elements.known));
        description += &format!(", {share} % unknown are {}", shown_missing(mapping.missing));
    }
    let kinds = present.iter().map(|it| (it.symbol().to_string(), it.color())).collect();
    let mut colors = ParticleColors::palette(colors, places, description);
    colors.legend = Some(Legend {
        label: "element".into(),
        unit: None,
        key: Key::Kinds(kinds),
        missing: (elements.known < 1.0).then_some(mapping.missing),
    });
    colors
}

/// The discrete attributes that sort particles into kinds.
pub(super) fn types(particles: &Particles) -> impl Iterator<Item = &Attribute> {
    TYPE_NAMES.iter().filter_map(|name| particles.attribute(name)).filter(|it| is_scalar_discrete(it))
}

fn is_scalar_discrete(attribute: &Attribute) -> bool {
    attribute.components == 1 && attribute.values.is_discrete()
}

/// Whether a discrete attribute holds kinds rather than amounts: by its name, by being words, or by having few values.
pub(super) fn is_kinds(attribute: &Attribute) -> bool {
    let named = TYPE_NAMES.iter().any(|name| name.eq_ignore_ascii_case(&attribute.name));
    let text = matches!(attribute.values.view(), View::Text { .. });
    is_scalar_discrete(attribute)
        && (named || text || {
            let spread = Spread::of(attribute.values.len(), |id| attribute.number(id, 0));
            spread.high - spread.low < TYPES.len() as f64
        })
}

/// Words count by their alphabetical order, integers by themselves, so that a kind keeps its color from frame to frame.
pub(super) fn by_type(attribute: &Attribute, mapping: &Mapping) -> ParticleColors {
    let own = Colormap::of_list("12 colors", TYPES.to_vec());
    let map = mapping.map.as_ref().filter(|map| map.is_list()).unwrap_or(&own);
    let colors = map.colors().len() as i64;
    let place_of_code: Option<Vec<i64>> = match attribute.values.view() {
        View::Text { names, .. } => {
            let mut sorted: Vec<&String> = names.iter().collect();
            sorted.sort_unstable();
            Some(names.iter().map(|name| sorted.partition_point(|other| *other < name) as i64).collect())
        }
        _ => None,
    };
    let place_of = |value: i64| {
        let places = place_of_code.as_ref();
        places.map_or(value, |it| it.get(value as usize).copied().unwrap_or(value))
    };
    let place = |id: usize| place_of(attribute.number(id, 0) as i64).rem_euclid(colors) as u8;
    let places = (0..attribute.values.len()).into_par_iter().with_min_len(1 << 14).map(place).collect();
    let mut description = format!("color {} {}", attribute.name, map.name());
    if let Some(words) = place_of_code.as_ref().filter(|words| words.len() as i64 > colors) {
        description += &format!(", {} kinds share {colors} colors", words.len());
    }
    let name = |value: i64| match attribute.values.view() {
        View::Text { names, .. } => names.get(value as usize).cloned().unwrap_or_default(),
        _ => value.to_string(),
    };
    let mut kinds: Vec<(i64, i64)> =
        present(attribute).into_iter().map(|value| (place_of(value), value)).collect();
    kinds.sort_unstable();
    let color = |place: i64| map.colors()[place.rem_euclid(colors) as usize];
    let kinds = kinds.into_iter().map(|(place, value)| (name(value), color(place))).collect();
    let mut colors = ParticleColors::palette(map.colors().to_vec(), places, description);
    let label = attribute.name.clone();
    colors.legend = Some(Legend { label, unit: None, key: Key::Kinds(kinds), missing: None });
    colors
}

/// The most kinds that are told.
pub(super) const MOST: usize = 1000;

/// The values of a discrete attribute that there are, in order; where there are very many, some of them.
pub(super) fn present(attribute: &Attribute) -> Vec<i64> {
    let with = |mut found: Vec<i64>, value: i64| {
        if let Err(place) = found.binary_search(&value)
            && found.len() < MOST
        {
            found.insert(place, value);
        }
        found
    };
    let ids = (0..attribute.values.len()).into_par_iter().with_min_len(1 << 14);
    let values = ids.map(|id| attribute.number(id, 0) as i64);
    values.fold(Vec::new, with).reduce(Vec::new, |one, other| other.into_iter().fold(one, with))
}
