//! From what the user asks to see to a color of every particle.
//!
//! [`resolve`] takes a [`Coloring`] and gives [`ParticleColors`]: one byte a particle that says which of at most 256 colors it has,
//! or three bytes where the particles bring their own. What is a kind and what an amount is decided here; `kinds` and `amounts`
//! turn them into colors.

use rayon::prelude::*;

use super::amounts::by_number;
use super::coloring::{Coloring, MISSING, Mapping, Norm, Range, linear};
use super::colormap::Colormap;
use super::element::Elements;
use super::kinds::{by_element, by_type, is_kinds, types};
use super::quantity::{Quantity, unknown};
use super::rgb::Rgb;
use super::statistics::short;
use crate::error::{Error, Result};
use crate::frozen::Frozen;
use crate::particles::{Attribute, Particles};
use crate::srgb::encoded_from_linear;
use crate::structure::by_node;

/// The color of particles that have nothing to show, sRGB.
const PLAIN: [u8; 3] = [157, 184, 217];

/// The color of every particle.
#[derive(Clone, Debug)]
pub struct ParticleColors {
    store: Store,
    /// What was chosen and guessed, in one line: `color c_pe viridis linear -4.8:-3.1 (1-99 %)`.
    pub description: String,
    /// What a color bar or a list of kinds shows; `None` where colors stand for nothing else.
    pub legend: Option<Legend>,
}

/// How a color is read back. All colors are sRGB bytes.
#[derive(Clone, Debug, PartialEq)]
pub struct Legend {
    /// The quantity's name.
    pub label: String,
    /// Its unit, where the file tells.
    pub unit: Option<String>,
    /// What the colors mean.
    pub key: Key,
    /// The color of particles without a value, where there are any.
    pub missing: Option<[u8; 3]>,
}

/// What colors mean.
#[derive(Clone, Debug, PartialEq)]
pub enum Key {
    /// Numbers.
    Amounts(Scale),
    /// Kinds that there are, by name, in order.
    Kinds(Vec<(String, [u8; 3])>),
}

/// Which numbers colors stand for.
#[derive(Clone, Debug, PartialEq)]
pub struct Scale {
    /// How the numbers are spread over the colors.
    pub norm: Norm,
    /// The number at the beginning of the first color.
    pub low: f64,
    /// The number at the end of the last color; not below `low`.
    pub high: f64,
    /// The colors that particles have, of equal shares of the range.
    pub colors: Vec<[u8; 3]>,
    /// That of numbers below, where it is another one.
    pub below: Option<[u8; 3]>,
    /// That of numbers above, where it is another one.
    pub above: Option<[u8; 3]>,
}

impl Scale {
    /// How far a number is along the colors: 0 at `low`, 1 at `high`, also beyond. In a range of one number all are in the middle.
    pub fn place(&self, number: f64) -> f64 {
        let [low, high, number] = [self.low, self.high, number].map(|it| self.norm.spread(it));
        if low < high { (number - low) / (high - low) } else { 0.5 }
    }
}

#[derive(Clone, Debug)]
enum Store {
    Constant([f32; 3]),
    /// Linear colors, and the place in them of every particle.
    Palette {
        colors: Vec<[f32; 3]>,
        places: Frozen<u8>,
    },
    /// sRGB bytes of every particle, and the linear value of each byte.
    Direct {
        bytes: Frozen<[u8; 3]>,
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
            Store::Palette { colors, places } => {
                Store::Palette { colors, places: by_node(&places, ids, 0).into() }
            }
            Store::Direct { bytes, linear_of_byte } => {
                Store::Direct { bytes: by_node(&bytes, ids, MISSING).into(), linear_of_byte }
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
        Self { store: Store::Palette { colors, places: places.into() }, description, legend: None }
    }

    /// Those of several sources, each with the number of its particles, one after the other. More than 256 colors are rounded to sRGB bytes; the
    /// legend is the first that there is.
    pub(super) fn joined(parts: &[(Self, usize)]) -> Self {
        let legend = parts.iter().find_map(|(it, _)| it.legend.clone());
        let texts: Vec<&str> = parts.iter().map(|(it, _)| it.description.as_str()).collect();
        let description = texts.join("; ");
        let count = parts.iter().map(|(_, count)| count).sum();
        let palettes: Option<Vec<&[[f32; 3]]>> = parts.iter().map(|(it, _)| it.store.palette()).collect();
        let palettes = palettes.filter(|all| all.iter().map(|it| it.len()).sum::<usize>() <= 256);
        if let Some(palettes) = palettes {
            let mut places: Vec<u8> = Vec::with_capacity(count);
            let mut first = 0;
            for ((part, count), palette) in parts.iter().zip(&palettes) {
                match &part.store {
                    Store::Palette { places: own, .. } => places.extend(own.iter().map(|it| first + it)),
                    _ => places.resize(places.len() + count, first),
                }
                first = first.wrapping_add(palette.len() as u8);
            }
            let colors = palettes.concat();
            let store = match colors[..] {
                [] => Store::Constant(linear(PLAIN)),
                [color] => Store::Constant(color),
                _ => Store::Palette { colors, places: places.into() },
            };
            return Self { store, description, legend };
        }
        let mut bytes = Vec::with_capacity(count);
        for (part, count) in parts {
            let byte = |value: f32| (255.0 * encoded_from_linear(value)).round() as u8;
            bytes.par_extend((0..*count).into_par_iter().map(|id| match &part.store {
                Store::Direct { bytes, .. } => bytes[id],
                _ => part.color(id).map(byte),
            }));
        }
        Self { store: Store::direct(bytes), description, legend }
    }

    fn direct(rgb: &Rgb, count: usize) -> Self {
        let (bytes, description) = rgb.bytes(count);
        Self { store: Store::direct(bytes), description, legend: None }
    }
}

impl Store {
    fn direct(bytes: Vec<[u8; 3]>) -> Self {
        let linear_of_byte = Box::new(std::array::from_fn(|byte| linear([byte as u8; 3])[0]));
        Self::Direct { bytes: bytes.into(), linear_of_byte }
    }

    /// The colors that there are, if they are few.
    fn palette(&self) -> Option<&[[f32; 3]]> {
        match self {
            Self::Constant(color) => Some(std::slice::from_ref(color)),
            Self::Palette { colors, .. } => Some(colors),
            Self::Direct { .. } => None,
        }
    }
}

/// The colors of `particles` by `coloring`.
///
/// Fails with [`Error::Setting`] if there is no such attribute, no elements or types, or no logarithm of what is asked for.
pub fn resolve(particles: &Particles, coloring: &Coloring, mapping: &Mapping) -> Result<ParticleColors> {
    if let Range::Given(low, high) = mapping.range
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
            Some(elements) => Ok(by_element(particles, &elements, mapping)),
            None => Err(unknown(particles, "element")),
        },
        Coloring::Type => match types(particles).next() {
            Some(attribute) => Ok(by_type(attribute, mapping)),
            None => Err(unknown(particles, "type")),
        },
        Coloring::Attribute { name, component } => {
            let attribute = particles.attribute(name).filter(|_| component.is_none());
            if let Some(rgb) = attribute.and_then(Rgb::of_vector) {
                return Ok(ParticleColors::direct(&rgb, particles.len()));
            }
            let quantity = Quantity::find(particles, name, *component)?;
            match quantity.scalar() {
                Some(kinds) if is_kinds(kinds) && mapping.map.as_ref().is_none_or(Colormap::is_list) => {
                    Ok(by_type(kinds, mapping))
                }
                _ => by_number(particles, &quantity, mapping),
            }
        }
        Coloring::Auto => automatic(particles, mapping),
    }
}

/// The best of what there is: see [`Coloring::Auto`].
fn automatic(particles: &Particles, mapping: &Mapping) -> Result<ParticleColors> {
    if let Some(elements) = Elements::find(particles) {
        return Ok(by_element(particles, &elements, mapping));
    }
    if let Some(attribute) = types(particles).find(|attribute| varies(attribute)) {
        return Ok(by_type(attribute, mapping));
    }
    if let Some(rgb) = Rgb::find(particles) {
        return Ok(ParticleColors::direct(&rgb, particles.len()));
    }
    for attribute in particles.attributes().iter().filter(|it| it.components == 1 && !it.values.is_discrete())
    {
        let quantity = Quantity::find(particles, &attribute.name, None)?;
        if !quantity.is_component() && !is_geometry(&attribute.name) && varies(attribute) {
            return by_number(particles, &quantity, mapping);
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
        resolve(particles, &coloring.parse().unwrap(), &Mapping::default()).unwrap()
    }

    fn scale(colors: &ParticleColors) -> Scale {
        match &colors.legend {
            Some(Legend { key: Key::Amounts(scale), .. }) => scale.clone(),
            other => panic!("{other:?}"),
        }
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
        let mapping = Mapping { range: Range::Full, ..Mapping::default() };
        let full = resolve(&it, &"c_pe".parse().unwrap(), &mapping).unwrap();
        assert_eq!(full.color(250), expected("viridis", 0.25));
        let scale = scale(&full);
        assert_eq!((scale.low, scale.high, scale.place(250.0)), (0.0, 1000.0, 0.25));
        assert_eq!(linear(scale.colors[(0.25 * 255.0) as usize]), full.color(250));
        let map = Some(Colormap::named("gray").unwrap());
        let (norm, range) = (Some(Norm::Log), Range::Given(1.0, 100.0));
        let mapping = Mapping { map, norm, range, ..Mapping::default() };
        let given = resolve(&it, &"c_pe".parse().unwrap(), &mapping).unwrap();
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
    fn numbers_out_of_range_have_the_colors_that_are_given() {
        let values = [f32::NEG_INFINITY, 0.0, 1.0, 2.0, 3.0, 4.0, f32::NAN];
        let mut attribute = floats("s", &values);
        attribute.unit = Some("K".into());
        let it = particles(values.len(), vec![attribute]);
        let [missing, low, high] = [[1, 2, 3], [4, 5, 6], [7, 8, 9]];
        let range = Range::Given(1.0, 3.0);
        let (below, above) = (Some(low), Some(high));
        let mapping = Mapping { range, missing, below, above, ..Mapping::default() };
        let found = resolve(&it, &"s".parse().unwrap(), &mapping).unwrap();
        let own = scale(&found);
        let wanted = [low, low, own.colors[0], own.colors[126], own.colors[252], high, missing].map(linear);
        assert_eq!(own.colors.len(), 253, "two of 255 levels are for what is out of range");
        for (id, wanted) in wanted.into_iter().enumerate() {
            assert_eq!(found.color(id), wanted, "{}", values[id]);
        }
        assert_eq!((own.below, own.above), (below, above));
        let legend = found.legend.unwrap();
        assert_eq!((legend.unit.as_deref(), legend.missing), (Some("K"), Some(missing)));
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
        let named = |name: &str, color| (name.to_string(), color);
        let key = |colors: &ParticleColors| colors.legend.clone().map(|it| it.key);
        let kinds = Key::Kinds(vec![named("gas", TYPES[0]), named("solid", TYPES[1])]);
        assert_eq!(key(&phase), Some(kinds));
        let mapping = Mapping { map: Some(Colormap::named("Set1").unwrap()), ..Mapping::default() };
        let listed = resolve(&it, &"phase".parse().unwrap(), &mapping).unwrap();
        let first = mapping.map.as_ref().unwrap().colors()[0];
        assert_eq!(listed.color(1), linear(first));
        let few = particles(3, vec![Attribute::new("type", 1, Values::I32(vec![7, -1, 7]))]);
        let kinds = Key::Kinds(vec![named("-1", TYPES[11]), named("7", TYPES[7])]);
        assert_eq!(key(&colors(&few, "type")), Some(kinds));
        let many: Vec<String> = (0..13).map(|k| format!("kind {k}")).collect();
        let many = words("phase", &many.iter().map(String::as_str).collect::<Vec<_>>());
        assert!(
            colors(&particles(13, vec![many]), "phase").description.ends_with("13 kinds share 12 colors")
        );
        let elements = colors(&particles(3, vec![words("species", &["O", "C", "?"])]), "element");
        assert_eq!((elements.color(0), elements.color(2)), (linear([0xff, 0x0d, 0x0d]), linear(MISSING)));
        let legend = elements.legend.unwrap();
        let symbols = Key::Kinds(vec![named("C", [0x90; 3]), named("O", [0xff, 0x0d, 0x0d])]);
        assert_eq!((legend.label.as_str(), legend.key, legend.missing), ("element", symbols, Some(MISSING)));
    }

    #[test]
    fn what_cannot_be_shown_is_refused() {
        let it = particles(2, vec![floats("s", &[-1.0, 0.0])]);
        let refused = |coloring: &str, norm, range| {
            let mapping = Mapping { norm, range, ..Mapping::default() };
            resolve(&it, &coloring.parse().unwrap(), &mapping).unwrap_err().to_string()
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
