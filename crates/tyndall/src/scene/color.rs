//! From what the user asks to see to a color of every particle.
//!
//! [`resolve`] takes a [`Coloring`] and gives [`ParticleColors`]: one byte a particle that says which of at most 256 colors it has,
//! or three bytes where the particles bring their own. What is a kind and what an amount is decided here; `kinds` and `amounts`
//! turn them into colors.

use rayon::prelude::*;

use super::amounts::by_number;
use super::coloring::{Coloring, Norm, Range, linear};
use super::colormap::Colormap;
use super::element::Elements;
use super::kinds::{by_element, by_type, is_kinds, types};
use super::quantity::{Quantity, unknown};
use super::rgb::Rgb;
use super::statistics::short;
use crate::error::{Error, Result};
use crate::particles::{Attribute, Particles};
use crate::structure::by_node;

/// The color of NaN and of unknown elements, sRGB.
pub const MISSING: [u8; 3] = [128; 3];
/// The color of particles that have nothing to show, sRGB.
const PLAIN: [u8; 3] = [157, 184, 217];

/// The color of every particle.
#[derive(Clone, Debug)]
pub struct ParticleColors {
    store: Store,
    /// What was chosen and guessed, in one line: `color c_pe viridis linear -4.8:-3.1 (1-99 %)`.
    pub description: String,
    /// What a color bar shows; `None` where the colors are not those of a smooth map.
    pub legend: Option<Legend>,
}

/// How a color is read back as a number.
#[derive(Clone, Debug, PartialEq)]
pub struct Legend {
    /// The quantity's name.
    pub label: String,
    /// Its colors.
    pub map: Colormap,
    /// How the numbers are spread over the map.
    pub norm: Norm,
    /// The number of the first color.
    pub low: f64,
    /// The number of the last color.
    pub high: f64,
}

#[derive(Clone, Debug)]
enum Store {
    Constant([f32; 3]),
    /// Linear colors, and the place in them of every particle.
    Palette {
        colors: Vec<[f32; 3]>,
        places: Vec<u8>,
    },
    /// sRGB bytes of every particle, and the linear value of each byte.
    Direct {
        bytes: Vec<[u8; 3]>,
        linear_of_byte: Box<[f32; 256]>,
    },
}

/// Colors as they are held, for a device that holds a copy.
#[cfg(feature = "gpu")]
pub(crate) enum ColorColumn<'a> {
    /// One for all.
    Constant([f32; 3]),
    /// Of each particle a byte: the place of its color.
    Palette { colors: &'a [[f32; 3]], places: &'a [u8] },
    /// Of each particle three bytes, and the linear value of each byte.
    Direct { bytes: &'a [u8], linear_of_byte: &'a [f32; 256] },
}

impl ParticleColors {
    /// The memory that holds the colors.
    #[cfg(feature = "gpu")]
    pub(crate) fn column(&self) -> ColorColumn<'_> {
        match &self.store {
            Store::Constant(color) => ColorColumn::Constant(*color),
            Store::Palette { colors, places } => ColorColumn::Palette { colors, places },
            Store::Direct { bytes, linear_of_byte } => {
                ColorColumn::Direct { bytes: bytes.as_flattened(), linear_of_byte }
            }
        }
    }

    /// The color of particle `id`: linear RGB, 0 to 1.
    #[inline(always)]
    pub fn color(&self, id: usize) -> [f32; 3] {
        match &self.store {
            Store::Constant(color) => *color,
            Store::Palette { colors, places } => colors[places[id] as usize],
            Store::Direct { bytes, linear_of_byte } => bytes[id].map(|byte| linear_of_byte[byte as usize]),
        }
    }

    /// Whether all particles have the same.
    pub fn is_constant(&self) -> bool {
        matches!(self.store, Store::Constant(_))
    }

    /// The same colors, particle `ids[k]` at place `k`.
    pub(super) fn arranged(self, ids: &[u32]) -> Self {
        let store = match self.store {
            Store::Constant(color) => Store::Constant(color),
            Store::Palette { colors, places } => Store::Palette { colors, places: by_node(&places, ids, 0) },
            Store::Direct { bytes, linear_of_byte } => {
                Store::Direct { bytes: by_node(&bytes, ids, MISSING), linear_of_byte }
            }
        };
        Self { store, ..self }
    }

    /// One linear color for all particles.
    pub fn constant(color: [f32; 3]) -> Self {
        let digits = color.map(|value| short(value as f64)).join(" ");
        Self {
            store: Store::Constant(color),
            description: format!("color constant, linear {digits}"),
            legend: None,
        }
    }

    pub(crate) fn palette(colors: Vec<[u8; 3]>, places: Vec<u8>, description: String) -> Self {
        let colors = colors.into_iter().map(linear).collect();
        Self { store: Store::Palette { colors, places }, description, legend: None }
    }

    fn direct(rgb: &Rgb, count: usize) -> Self {
        let (bytes, description) = rgb.bytes(count);
        let linear_of_byte = Box::new(std::array::from_fn(|byte| linear([byte as u8; 3])[0]));
        Self { store: Store::Direct { bytes, linear_of_byte }, description, legend: None }
    }
}

/// The colors of `particles` by `coloring`; a map, a norm and a range replace what is guessed from the quantity's name and values.
///
/// Fails with [`Error::Setting`] if there is no such attribute, no elements or types, or no logarithm of what is asked for.
pub fn resolve(
    particles: &Particles,
    coloring: &Coloring,
    map: Option<&Colormap>,
    norm: Option<Norm>,
    range: Range,
) -> Result<ParticleColors> {
    if let Range::Given(low, high) = range
        && !(low.is_finite() && high.is_finite() && low < high)
    {
        return Err(Error::setting(
            "--range",
            format!("{low}:{high}"),
            "two finite numbers, the first below the second",
        ));
    }
    match coloring {
        Coloring::Constant(color) => Ok(ParticleColors::constant(*color)),
        Coloring::Element => match Elements::find(particles) {
            Some(elements) => Ok(by_element(particles, &elements)),
            None => Err(unknown(particles, "element")),
        },
        Coloring::Type => match types(particles).next() {
            Some(attribute) => Ok(by_type(attribute, map)),
            None => Err(unknown(particles, "type")),
        },
        Coloring::Attribute { name, component } => {
            let attribute = particles.attribute(name).filter(|_| component.is_none());
            if let Some(rgb) = attribute.and_then(Rgb::of_vector) {
                return Ok(ParticleColors::direct(&rgb, particles.len()));
            }
            let quantity = Quantity::find(particles, name, *component)?;
            match quantity.scalar() {
                Some(kinds) if is_kinds(kinds) && map.is_none_or(Colormap::is_list) => {
                    Ok(by_type(kinds, map))
                }
                _ => by_number(particles, &quantity, map, norm, range),
            }
        }
        Coloring::Auto => automatic(particles, map, norm, range),
    }
}

/// The best of what there is: see [`Coloring::Auto`].
fn automatic(
    particles: &Particles,
    map: Option<&Colormap>,
    norm: Option<Norm>,
    range: Range,
) -> Result<ParticleColors> {
    if let Some(elements) = Elements::find(particles) {
        return Ok(by_element(particles, &elements));
    }
    if let Some(attribute) = types(particles).find(|attribute| varies(attribute)) {
        return Ok(by_type(attribute, map));
    }
    if let Some(rgb) = Rgb::find(particles) {
        return Ok(ParticleColors::direct(&rgb, particles.len()));
    }
    for attribute in particles.attributes().iter().filter(|it| it.components == 1 && !it.values.is_discrete())
    {
        let quantity = Quantity::find(particles, &attribute.name, None)?;
        if !quantity.is_component() && !is_geometry(&attribute.name) && varies(attribute) {
            return by_number(particles, &quantity, map, norm, range);
        }
    }
    let mut colors = ParticleColors::constant(linear(PLAIN));
    colors.description = "color plain (no element, type, color or scalar that varies)".into();
    Ok(colors)
}

/// Whether two particles differ in a scalar attribute.
fn varies(attribute: &Attribute) -> bool {
    let first = (0..attribute.values.len()).map(|id| attribute.number(id, 0)).find(|value| !value.is_nan());
    let differs = |id: usize| {
        first.is_some_and(|first| attribute.number(id, 0) < first || attribute.number(id, 0) > first)
    };
    (0..attribute.values.len()).into_par_iter().with_min_len(1 << 14).any(differs)
}

/// Whether a name is that of a size, a place or an orientation, which the picture shows already, or of a number that only tells
/// particles apart.
pub(super) fn is_geometry(name: &str) -> bool {
    const NAMES: &str = "radius diameter pscale width widths r h smoothinglength id ids time x y z xs ys zs xu yu zu nx ny nz \
                         ix iy iz quatw quati quatj quatk";
    NAMES.split_ascii_whitespace().any(|known| known.eq_ignore_ascii_case(name))
}

#[cfg(test)]
mod tests {
    use super::super::kinds::TYPES;
    use super::*;
    use crate::particles::{Columns, Values};
    use glam::DVec3;

    fn particles(count: usize, attributes: Vec<Attribute>) -> Particles {
        let mut columns = Columns::default();
        columns.positions.extend(&vec![DVec3::ZERO; count]);
        columns.attributes = attributes;
        Particles::new(columns).unwrap()
    }

    fn floats(name: &str, values: &[f32]) -> Attribute {
        Attribute::new(name, 1, Values::F32(values.to_vec()))
    }

    fn words(name: &str, words: &[&str]) -> Attribute {
        let mut names: Vec<String> = Vec::new();
        let mut code = |word: &&str| {
            let place = names.iter().position(|name| name == word);
            place.unwrap_or_else(|| {
                names.push(word.to_string());
                names.len() - 1
            }) as u32
        };
        let codes = words.iter().map(&mut code).collect();
        Attribute::new(name, 1, Values::Text { codes, names })
    }

    fn colors(particles: &Particles, coloring: &str) -> ParticleColors {
        resolve(particles, &coloring.parse().unwrap(), None, None, Range::Auto).unwrap()
    }

    /// The slow way: the map at the number's place in the range.
    fn expected(map: &str, t: f32) -> [f32; 3] {
        let map = Colormap::named(map).unwrap();
        linear(map.at(((t * 255.0).floor().min(254.0) + 0.5) / 255.0).map(|it| (255.0 * it).round() as u8))
    }

    #[test]
    fn numbers_take_the_color_at_their_place_in_the_range() {
        let values: Vec<f32> = (0..=1000).map(|k| k as f32).collect();
        let it = particles(1001, vec![floats("c_pe", &values)]);
        let found = colors(&it, "c_pe");
        assert_eq!(found.description, "color c_pe viridis linear 10:990 (1-99 %)");
        for id in [0, 10, 11, 333, 500, 990, 1000] {
            let t = ((id as f32 - 10.0) / 980.0).clamp(0.0, 1.0);
            assert_eq!(found.color(id), expected("viridis", t), "{id}");
        }
        let full = resolve(&it, &"c_pe".parse().unwrap(), None, None, Range::Full).unwrap();
        assert_eq!(full.color(250), expected("viridis", 0.25));
        assert_eq!(full.legend.map(|legend| (legend.low, legend.high)), Some((0.0, 1000.0)));
        let map = Colormap::named("gray").unwrap();
        let given =
            resolve(&it, &"c_pe".parse().unwrap(), Some(&map), Some(Norm::Log), Range::Given(1.0, 100.0))
                .unwrap();
        assert_eq!(given.color(10), expected("gray", 0.5));
        let wanted = "color c_pe gray log 1:100 (given), 1 not above 0 have the lowest color";
        assert_eq!(given.description, wanted);
        assert_eq!(given.color(0), expected("gray", 0.0));
    }

    #[test]
    fn missing_infinite_and_constant_values_have_stated_colors() {
        let it = particles(5, vec![floats("s", &[f32::NAN, 0.0, 1.0, f32::INFINITY, f32::NEG_INFINITY])]);
        let found = colors(&it, "s");
        assert!(found.description.ends_with("0:1 (1-99 %), 1 missing are gray"), "{}", found.description);
        assert_eq!(found.color(0), linear(MISSING));
        assert_eq!((found.color(3), found.color(4)), (found.color(2), found.color(1)));
        let constant = colors(&particles(2, vec![floats("s", &[3.5; 2])]), "s");
        assert_eq!(constant.color(1), expected("viridis", 0.5));
        assert!(constant.description.contains("3.5:3.5 (one value)"));
        assert!(
            colors(&particles(2, vec![floats("s", &[f32::NAN; 2])]), "s").description.contains("no finite")
        );
        assert!(colors(&particles(0, vec![floats("s", &[])]), "s").description.contains("no finite"));
    }

    #[test]
    fn mostly_equal_values_show_the_full_range() {
        let mut values = [0.0; 1000];
        values[7] = 2.0;
        let found = colors(&particles(1000, vec![floats("damage", &values)]), "damage");
        assert!(found.description.ends_with("0:2 (full range)"), "{}", found.description);
    }

    #[test]
    fn names_decide_the_look() {
        let look = |name: &str, values: &[f32]| {
            colors(&particles(values.len(), vec![floats(name, values)]), name).description
        };
        assert_eq!(look("Densities", &[1.0, 100.0]), "color Densities magma log 1:100 (1-99 %)");
        assert_eq!(look("Temperature", &[1.0, 1e7]), "color Temperature inferno log 1:1e7 (1-99 %)");
        assert_eq!(look("Rhop", &[990.0, 1010.0]), "color Rhop magma linear 990:1010 (1-99 %)");
        assert_eq!(look("mass", &[0.0, 1000.0]), "color mass magma linear 0:1000 (1-99 %)");
        assert_eq!(look("q", &[-1.0, 3.0]), "color q coolwarm linear -3:3 (1-99 %, centered on 0)");
        assert_eq!(look("q", &[1.0, 3.0]), "color q viridis linear 1:3 (1-99 %)");
        let it = particles(2, vec![floats("vx", &[-2.0, 1.0]), floats("vy", &[0.0; 2])]);
        assert_eq!(colors(&it, "vx").description, "color vx coolwarm linear -2:2 (1-99 %, centered on 0)");
        assert_eq!(colors(&it, "v").description, "color |v| viridis linear 1:2 (1-99 %)");
    }

    #[test]
    fn automatic_takes_the_best_there_is() {
        let mut attributes =
            vec![floats("vx", &[1.0, 2.0]), floats("vy", &[1.0, 2.0]), floats("radius", &[1.0, 2.0])];
        let auto = |attributes: &[Attribute]| colors(&particles(2, attributes.to_vec()), "auto").description;
        assert!(auto(&attributes).starts_with("color plain"));
        attributes.push(floats("one", &[1.0, 1.0]));
        attributes.push(floats("c_pe", &[-4.0, -3.0]));
        attributes.push(floats("c_cn", &[4.0, 3.0]));
        assert_eq!(auto(&attributes), "color c_pe viridis linear -4:-3 (1-99 %)");
        attributes.push(Attribute::new("Color", 3, Values::U8(vec![9; 6])));
        assert_eq!(auto(&attributes), "color Color as it is (sRGB, 8 bit)");
        attributes.push(Attribute::new("type", 1, Values::I32(vec![1, 1])));
        assert_eq!(auto(&attributes), "color Color as it is (sRGB, 8 bit)");
        attributes.push(Attribute::new("typeid", 1, Values::I32(vec![1, 2])));
        assert_eq!(auto(&attributes), "color typeid 12 colors");
        attributes.push(words("element", &["Au", "X"]));
        assert_eq!(auto(&attributes), "color elements of element (Jmol), 50 % unknown are gray");
    }

    #[test]
    fn kinds_have_distinct_colors_that_do_not_depend_on_their_order() {
        let it = particles(
            3,
            vec![
                words("phase", &["solid", "gas", "solid"]),
                Attribute::new("k", 1, Values::I32(vec![-1, 11, 5])),
            ],
        );
        let phase = colors(&it, "phase");
        assert_eq!((phase.color(1), phase.color(0)), (linear(TYPES[0]), linear(TYPES[1])));
        // The numbers span more than there are colors: they are amounts.
        assert!(colors(&it, "k").description.contains("viridis"));
        let map = Colormap::named("Set1").unwrap();
        let listed = resolve(&it, &"phase".parse().unwrap(), Some(&map), None, Range::Auto).unwrap();
        assert_eq!(listed.color(1), linear(map.colors()[0]));
        let many: Vec<String> = (0..13).map(|k| format!("kind {k}")).collect();
        let many = words("phase", &many.iter().map(String::as_str).collect::<Vec<_>>());
        assert!(
            colors(&particles(13, vec![many]), "phase").description.ends_with("13 kinds share 12 colors")
        );
        let elements = colors(&particles(3, vec![words("species", &["O", "C", "?"])]), "element");
        assert_eq!((elements.color(0), elements.color(2)), (linear([0xff, 0x0d, 0x0d]), linear(MISSING)));
    }

    #[test]
    fn what_cannot_be_shown_is_refused() {
        let it = particles(2, vec![floats("s", &[-1.0, 0.0])]);
        let refused = |coloring: &str, norm, range| {
            resolve(&it, &coloring.parse().unwrap(), None, norm, range).unwrap_err().to_string()
        };
        assert!(refused("s", Some(Norm::Log), Range::Auto).contains("no value above 0"));
        assert!(refused("s", Some(Norm::Log), Range::Given(-1.0, 1.0)).contains("above 0"));
        assert!(refused("s", None, Range::Given(1.0, 1.0)).contains("the first below"));
        assert!(refused("s", None, Range::Given(f64::NAN, 1.0)).contains("finite"));
        assert!(refused("element", None, Range::Auto).contains("available: s, x, y, z"));
        assert!(refused("type", None, Range::Auto).contains("no attribute 'type'"));
    }

    #[test]
    fn own_colors_are_kept_to_the_bit() {
        let it = particles(1, vec![Attribute::new("Cd", 3, Values::U8(vec![0, 128, 255]))]);
        assert_eq!(colors(&it, "cd").color(0), linear([0, 128, 255]));
        assert_eq!(colors(&it, "orange").color(0), linear([255, 165, 0]));
    }
}
