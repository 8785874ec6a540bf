//! From what the user asks to see to a color of every particle.
//!
//! [`resolve`] takes a [`Coloring`] and gives [`ParticleColors`]: one byte a particle that says which of at most 256 colors it has,
//! or three bytes where the particles bring their own. Defaults by the attribute's name: density and mass are logarithmic in
//! magma, temperature in inferno, components of velocities and charges diverge around zero in coolwarm, else viridis.

use rayon::prelude::*;

use super::coloring::{Coloring, Norm, Range, linear};
use super::colormap::Colormap;
use super::element::{Element, Elements};
use super::quantity::{Quantity, unknown};
use super::rgb::Rgb;
use super::statistics::{grouped, quantiles, sampled, short};
use crate::error::{Error, Result};
use crate::particles::{Attribute, Particles, Values};

/// Levels of a smooth map over the particles; the place after the last is for missing values.
const LEVELS: usize = 255;
/// The color of NaN and of unknown elements, sRGB.
pub const MISSING: [u8; 3] = [128; 3];
/// The color of particles that have nothing to show, sRGB.
const PLAIN: [u8; 3] = [157, 184, 217];
/// Twelve colors that color-blind people tell apart, neighbors most. Source: M. Krzywinski, mk.bcgsc.ca/colorblind, 12 colors.
const TYPES: [[u8; 3]; 12] = [
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
const TYPE_NAMES: [&str; 12] = [
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

impl ParticleColors {
    /// The color of particle `id`: linear RGB, 0 to 1.
    #[inline(always)]
    pub fn color(&self, id: usize) -> [f32; 3] {
        match &self.store {
            Store::Constant(color) => *color,
            Store::Palette { colors, places } => colors[places[id] as usize],
            Store::Direct { bytes, linear_of_byte } => bytes[id].map(|byte| linear_of_byte[byte as usize]),
        }
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

    fn palette(colors: Vec<[u8; 3]>, places: Vec<u8>, description: String) -> Self {
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

fn by_element(particles: &Particles, elements: &Elements) -> ParticleColors {
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
    let colors = present.iter().map(|element| element.color()).chain([MISSING]).collect();
    let mut description = format!("color elements of {} (Jmol)", attribute.name);
    if elements.known < 1.0 {
        description += &format!(", {} % unknown are gray", short(100.0 * (1.0 - elements.known)));
    }
    ParticleColors::palette(colors, places, description)
}

/// The discrete attributes that sort particles into kinds.
fn types(particles: &Particles) -> impl Iterator<Item = &Attribute> {
    TYPE_NAMES.iter().filter_map(|name| particles.attribute(name)).filter(|it| is_scalar_discrete(it))
}

fn is_scalar_discrete(attribute: &Attribute) -> bool {
    attribute.components == 1 && attribute.values.is_discrete()
}

/// Whether a discrete attribute holds kinds rather than amounts: by its name, by being words, or by having few values.
fn is_kinds(attribute: &Attribute) -> bool {
    let named = TYPE_NAMES.iter().any(|name| name.eq_ignore_ascii_case(&attribute.name));
    let text = matches!(attribute.values, Values::Text { .. });
    is_scalar_discrete(attribute)
        && (named || text || {
            let spread = Spread::of(attribute.values.len(), |id| attribute.number(id, 0));
            spread.high - spread.low < TYPES.len() as f64
        })
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
fn is_geometry(name: &str) -> bool {
    const NAMES: [&str; 30] = [
        "radius",
        "diameter",
        "pscale",
        "width",
        "widths",
        "r",
        "id",
        "ids",
        "time",
        "x",
        "y",
        "z",
        "xs",
        "ys",
        "zs",
        "xu",
        "yu",
        "zu",
        "nx",
        "ny",
        "nz",
        "ix",
        "iy",
        "iz",
        "quatw",
        "quati",
        "quatj",
        "quatk",
        "smoothinglength",
        "h",
    ];
    NAMES.iter().any(|known| known.eq_ignore_ascii_case(name))
}

/// Words count by their alphabetical order, integers by themselves, so that a kind keeps its color from frame to frame.
fn by_type(attribute: &Attribute, map: Option<&Colormap>) -> ParticleColors {
    let own = Colormap::of_list("12 colors", TYPES.to_vec());
    let map = map.filter(|map| map.is_list()).unwrap_or(&own);
    let colors = map.colors().len() as i64;
    let place_of_code: Option<Vec<i64>> = match &attribute.values {
        Values::Text { names, .. } => {
            let mut sorted: Vec<&String> = names.iter().collect();
            sorted.sort_unstable();
            Some(names.iter().map(|name| sorted.partition_point(|other| *other < name) as i64).collect())
        }
        _ => None,
    };
    let place = |id: usize| {
        let value = attribute.number(id, 0) as i64;
        let place = place_of_code.as_ref().map_or(value, |places| places[value as usize]);
        place.rem_euclid(colors) as u8
    };
    let places = (0..attribute.values.len()).into_par_iter().with_min_len(1 << 14).map(place).collect();
    let description = format!("color {} {}", attribute.name, map.name());
    ParticleColors::palette(map.colors().to_vec(), places, description)
}

/// The extremes of a column.
#[derive(Clone, Copy)]
struct Spread {
    low: f64,
    high: f64,
    /// The smallest above zero; infinity if there is none.
    positive_low: f64,
    /// How many are NaN.
    missing: usize,
    /// How many are zero or less.
    not_positive: usize,
}

impl Spread {
    const NONE: Self = Self {
        low: f64::INFINITY,
        high: f64::NEG_INFINITY,
        positive_low: f64::INFINITY,
        missing: 0,
        not_positive: 0,
    };

    fn of(count: usize, value: impl Fn(usize) -> f64 + Sync) -> Self {
        let ids = (0..count).into_par_iter().with_min_len(1 << 14);
        ids.fold(|| Self::NONE, |spread, id| spread.with(value(id))).reduce(|| Self::NONE, Self::and)
    }

    /// Infinite values take the first or last color, but do not stretch the range.
    fn with(mut self, value: f64) -> Self {
        if value.is_nan() {
            self.missing += 1;
            return self;
        }
        self.not_positive += usize::from(value <= 0.0);
        if value.is_finite() {
            self.low = self.low.min(value);
            self.high = self.high.max(value);
            if value > 0.0 {
                self.positive_low = self.positive_low.min(value);
            }
        }
        self
    }

    fn and(self, other: Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
            positive_low: self.positive_low.min(other.positive_low),
            missing: self.missing + other.missing,
            not_positive: self.not_positive + other.not_positive,
        }
    }
}

/// How a quantity is shown if nobody says otherwise.
enum Look {
    /// Over orders of magnitude, in the map of that name.
    Log(&'static str),
    /// On both sides of zero.
    Signed,
    Plain,
}

fn look(quantity: &Quantity) -> Look {
    let name = quantity.label().to_ascii_lowercase();
    let has = |parts: &[&str]| parts.iter().any(|part| name.contains(part));
    let charge = matches!(name.as_str(), "q" | "charge" | "charges" | "partial_charge");
    if quantity.is_component() || charge {
        Look::Signed
    } else if has(&["temperature"]) || name == "temp" {
        Look::Log("inferno")
    } else if has(&["densit", "rho", "mass"]) && !has(&["fraction"]) {
        Look::Log("magma")
    } else {
        Look::Plain
    }
}

/// A smooth map over a number of every particle.
fn by_number(
    particles: &Particles,
    quantity: &Quantity,
    map: Option<&Colormap>,
    norm: Option<Norm>,
    range: Range,
) -> Result<ParticleColors> {
    let spread = Spread::of(particles.len(), |id| quantity.value(id));
    let look = look(quantity);

    // The norm: logarithmic by name only where the values span a factor of ten, all above zero.
    let by_name = |low: f64, high: f64| match look {
        Look::Log(_) if low > 0.0 && high >= 10.0 * low && spread.not_positive == 0 => Norm::Log,
        _ => Norm::Linear,
    };
    let guessed = match range {
        Range::Given(low, high) => by_name(low, high),
        _ => by_name(spread.low, spread.high),
    };
    let norm = norm.unwrap_or(guessed);
    if norm == Norm::Log {
        if let Range::Given(low, high) = range
            && low <= 0.0
        {
            return Err(Error::setting(
                "--range",
                format!("{low}:{high}"),
                "a logarithm needs a range above 0",
            ));
        }
        if spread.positive_low > spread.high {
            let allowed = format!("{} has no value above 0: use linear", quantity.label());
            return Err(Error::setting("--norm", "log", allowed));
        }
    }

    let (mut low, mut high, mut how) = limits(particles, quantity, &spread, norm, range);
    let signed = matches!(look, Look::Signed) && norm == Norm::Linear && low < 0.0 && high > 0.0;
    if signed && !matches!(range, Range::Given(..)) {
        high = high.max(-low);
        low = -high;
        how += ", centered on 0";
    }
    let name = match look {
        Look::Log(name) => name,
        Look::Signed if signed => "coolwarm",
        _ => "viridis",
    };
    let map = map.cloned().map_or_else(|| Colormap::named(name), Ok)?;

    // Spread the numbers over the levels.
    let scaled = |value: f64| match norm {
        Norm::Linear => value,
        Norm::Log => value.max(f64::MIN_POSITIVE).ln(),
    };
    let (start, end) = (scaled(low), scaled(high));
    let place = |id: usize| {
        let value = quantity.value(id);
        if value.is_nan() {
            return LEVELS as u8;
        }
        // A range of one value shows the middle of the map.
        let t = if start < end { (scaled(value) - start) / (end - start) } else { 0.5 };
        (t * LEVELS as f64).clamp(0.0, LEVELS as f64 - 1.0) as u8
    };
    let places = (0..particles.len()).into_par_iter().with_min_len(1 << 14).map(place).collect();
    let level_color =
        |level: usize| map.at((level as f32 + 0.5) / LEVELS as f32).map(|it| (255.0 * it).round() as u8);
    let colors = (0..LEVELS).map(level_color).chain([MISSING]).collect();

    let norm_name = if norm == Norm::Log { "log" } else { "linear" };
    let (label, limits) = (quantity.label(), format!("{}:{}", short(low), short(high)));
    let mut description = format!("color {label} {} {norm_name} {limits} ({how})", map.name());
    if norm == Norm::Log && spread.not_positive > 0 {
        description += &format!(", {} not above 0 have the lowest color", grouped(spread.not_positive));
    }
    if spread.missing > 0 {
        description += &format!(", {} missing are gray", grouped(spread.missing));
    }
    let mut colors = ParticleColors::palette(colors, places, description);
    colors.legend = Some(Legend { label: label.into(), map, norm, low, high });
    Ok(colors)
}

/// The numbers of the first and last color, and how they were found.
fn limits(
    particles: &Particles,
    quantity: &Quantity,
    spread: &Spread,
    norm: Norm,
    range: Range,
) -> (f64, f64, String) {
    if let Range::Given(low, high) = range {
        return (low, high, "given".into());
    }
    let full = (if norm == Norm::Log { spread.positive_low } else { spread.low }, spread.high);
    if full.0 > full.1 {
        return (0.0, 1.0, "no finite value".into());
    }
    if full.0 == full.1 {
        return (full.0, full.1, "one value".into());
    }
    if range == Range::Auto {
        let wanted = |value: f64| value.is_finite() && (norm == Norm::Linear || value > 0.0);
        let mut values =
            sampled(particles.len(), |id| Some(quantity.value(id)).filter(|value| wanted(*value)));
        if let Some([low, high]) = quantiles(&mut values, [0.01, 0.99]).filter(|[low, high]| low < high) {
            return (low, high, "1-99 %".into());
        }
    }
    (full.0, full.1, "full range".into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::particles::Columns;
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
