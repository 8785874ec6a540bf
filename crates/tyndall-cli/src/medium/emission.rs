//! What a medium gives off: how the command line says it, which quantity it is of, and what light that makes.

use std::ops::RangeInclusive;
use std::str::FromStr;

use rayon::prelude::*;
use tyndall::medium::density::Field;
use tyndall::medium::grid::{BRICK, Lattice};
use tyndall::medium::{BlackBody, Emission, Grid};
use tyndall::particles::{Attribute, Particles, Values as Column};
use tyndall::scene::color::{Key, Legend, Scale};
use tyndall::scene::coloring::Coloring;
use tyndall::scene::quantity::{Component, Quantity};
use tyndall::scene::short;
use tyndall::scene::wanted::Wanted;
use tyndall::{Error, Result};
use tyndall_io::read::{Described, is_absent};

use super::args::OpticsName;
use super::looks;
use super::values::Rgb;
use crate::args::Render;
use crate::report::{Failure, Outcome};

/// What the flag says.
const FLAG: &str = "--emission";
/// Attributes that a temperature may be called, best first.
const TEMPERATURES: [&str; 5] = ["temperature", "Temperatures", "temp", "T", "heat"];
/// Share of the mass that is colder than the temperature of luminance 1.
const REFERENCE_SHARE: f64 = 0.99;
/// Kelvins of the hottest hundredth of the mass, where looks of fire have to choose.
const FLAME: f64 = 1700.0;
/// What share of that temperature has luminance 1 in looks of fire, so that the hottest is overexposed, as flames in pictures are.
const FLAME_REFERENCE: f64 = 0.88;
/// Kelvins that looks of fire take for temperatures of fire; what lies outside is scaled.
const OF_FIRE: RangeInclusive<f64> = 1000.0..=6000.0;

/// What is given off.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum EmissionSpec {
    /// Nothing.
    None,
    /// The same radiance everywhere.
    Even([f32; 3]),
    /// Black bodies of the temperature of that name, by default one that is called so, and the temperature of luminance 1.
    BlackBody(Option<String>, Option<f64>),
    /// Flames, of whatever particles: black bodies of a temperature, if there is one, of any scale; else hotter where matter is denser.
    Flames,
    /// A quantity, through a color map.
    Quantity(String),
}

impl FromStr for EmissionSpec {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let text = text.trim();
        if let Some(rest) = text.strip_prefix("blackbody") {
            let wanted =
                "blackbody, blackbody:NAME or blackbody:NAME@KELVINS, with the temperature of luminance 1";
            let bad = || Error::setting(FLAG, text, wanted);
            let rest = match rest.strip_prefix(':') {
                Some(rest) if !rest.is_empty() => rest,
                None if rest.is_empty() => return Ok(Self::BlackBody(None, None)),
                _ => return Err(bad()),
            };
            let (name, reference) = match rest.rsplit_once('@') {
                Some((name, kelvins)) => (name, Some(kelvins.trim().parse().map_err(|_| bad())?)),
                None => (rest, None),
            };
            reference.map(BlackBody::new).transpose()?;
            return if name.is_empty() {
                Err(bad())
            } else {
                Ok(Self::BlackBody(Some(name.into()), reference))
            };
        }
        match (text, text.parse::<Rgb>()) {
            ("", _) => Err(Error::setting(FLAG, text, "blackbody:NAME, a quantity, a number, R,G,B or none")),
            ("none", _) => Ok(Self::None),
            (_, Ok(Rgb(radiance))) => Emission::even(radiance).map(|_| Self::Even(radiance)),
            _ => Ok(Self::Quantity(text.into())),
        }
    }
}

impl EmissionSpec {
    /// What the command line asks for: emission, or where the optics want some the color.
    pub(super) fn of(args: &Render) -> Self {
        match (&args.medium.emission, args.medium.optics) {
            (Some(spec), _) => spec.clone(),
            (None, OpticsName::Scattering) => looks::of(args.look.look).map_or(Self::None, |it| it.emission),
            (None, OpticsName::Absorption) => Self::None,
            (None, _) => match &args.look.color {
                Coloring::Constant(color) => Self::Even(*color),
                Coloring::Attribute { name, component } => Self::Quantity(match component {
                    None => name.clone(),
                    Some(Component::Magnitude) => format!("|{name}|"),
                    Some(Component::Index(place)) => format!("{name}.{place}"),
                }),
                Coloring::Auto | Coloring::Element | Coloring::Type => Self::Even([1.0; 3]),
            },
        }
    }

    /// Asks a reader for what it is of.
    pub(super) fn want(&self, wanted: &mut Wanted) {
        match self {
            Self::None | Self::Even(_) => {}
            Self::BlackBody(None, _) | Self::Flames => {
                wanted.one_of.push(TEMPERATURES.map(String::from).to_vec())
            }
            Self::BlackBody(Some(name), _) | Self::Quantity(name) => wanted.quantities.push(name.clone()),
        }
    }

    /// The particles with the quantity that it is of as an attribute, and that attribute's name; `None` if it is of none.
    pub(super) fn prepare(&self, particles: Particles) -> Result<(Particles, Option<String>)> {
        let (name, numbers) = {
            let Some(quantity) = self.quantity(&particles)? else { return Ok((particles, None)) };
            let ids = (0..particles.len()).into_par_iter();
            match quantity.scalar() {
                Some(attribute) => (attribute.name.clone(), None),
                None => {
                    let numbers: Vec<f32> = ids.map(|id| quantity.value(id) as f32).collect();
                    (quantity.label().to_string(), Some(numbers))
                }
            }
        };
        let Some(numbers) = numbers else { return Ok((particles, Some(name))) };
        let attribute = Attribute::new(name.clone(), 1, Column::F32(numbers));
        Ok((particles.with_attribute(attribute)?, Some(name)))
    }

    /// The quantity of the particles that it is of; `None` if it is of none.
    fn quantity<'a>(&self, particles: &'a Particles) -> Result<Option<Quantity<'a>>> {
        let (name, is_temperature) = match self {
            Self::None | Self::Even(_) => return Ok(None),
            Self::BlackBody(Some(name), _) => (name.as_str(), true),
            Self::BlackBody(None, _) | Self::Flames => {
                let known = TEMPERATURES.iter().find(|&&name| particles.attribute(name).is_some());
                match (known, self) {
                    (None, Self::Flames) => return Ok(None),
                    (known, _) => (*known.unwrap_or(&TEMPERATURES[0]), true),
                }
            }
            Self::Quantity(name) => (name.as_str(), false),
        };
        let quantity = find(particles, FLAG, name)?;
        let ids = (0..particles.len()).into_par_iter().filter(|_| is_temperature);
        if let Some(id) = ids.clone().find_first(|&id| quantity.value(id) < 0.0) {
            let value = format!("{} (particle {})", short(quantity.value(id)), particles.place(id));
            return Err(Error::setting(format!("{FLAG} {name}"), value, "kelvins of at least 0"));
        }
        Ok(Some(quantity))
    }

    /// Whether it is of a quantity that each particle has.
    pub(super) fn is_of_particles(&self) -> bool {
        !self.names().is_empty()
    }

    /// Whether its colors stand for numbers.
    pub(super) fn is_mapped(&self) -> bool {
        matches!(self, Self::Quantity(_))
    }

    /// What the quantity that it is of may be called, best first; nothing if it is of none.
    fn names(&self) -> Vec<&str> {
        match self {
            Self::None | Self::Even(_) => Vec::new(),
            Self::Flames | Self::BlackBody(None, _) => TEMPERATURES.to_vec(),
            Self::BlackBody(Some(name), _) | Self::Quantity(name) => vec![name],
        }
    }

    /// The grid that it is of, from a file of grids; `load` reads the first of some names that is there.
    pub(super) fn of_grids(
        &self,
        load: impl FnOnce(&[&str]) -> Outcome<Described>,
    ) -> Outcome<Option<Values>> {
        let names = self.names();
        if names.is_empty() {
            return Ok(None);
        }
        match load(&names) {
            Ok(Described { grid, name, .. }) => Ok(Some(Values::Own(name, grid))),
            Err(Failure::Library(error)) if is_absent(&error) => match self.of_density() {
                None => Err(of_flag(FLAG, error).into()),
                values => Ok(values),
            },
            Err(error) => Err(error),
        }
    }

    /// What it is of where neither particles nor grids have the quantity that it wants.
    pub(super) fn of_density(&self) -> Option<Values> {
        (*self == Self::Flames).then_some(Values::Density)
    }
}

/// A quantity of the particles as the command line writes it; what is wrong is said of `flag`.
pub(crate) fn find<'a>(particles: &'a Particles, flag: &str, text: &str) -> Result<Quantity<'a>> {
    let found = match text.parse()? {
        Coloring::Attribute { name, component } => Quantity::find(particles, &name, component),
        _ => Quantity::find(particles, text, None),
    };
    found.map_err(|error| of_flag(flag, error))
}

/// The same, said of a flag.
fn of_flag(flag: &str, error: Error) -> Error {
    match error {
        Error::Setting { value, allowed, .. } => Error::setting(flag, value, allowed),
        error => error,
    }
}

/// A quantity on the lattice of a density.
pub(super) enum Values {
    /// Of particles: its products with the density.
    Means(Field),
    /// Of a file: a grid of its own, and its name.
    Own(String, Grid),
    /// The root of the density itself.
    Density,
}

impl Values {
    /// What they are called; `None` if they are of the density itself.
    fn name(&self) -> Option<&str> {
        match self {
            Self::Means(field) => Some(&field.name),
            Self::Own(name, _) => Some(name),
            Self::Density => None,
        }
    }

    /// At a sample at which the density is not 0.
    fn at(&self, density: &Grid, sample: [u32; 3]) -> f64 {
        let [i, j, k] = sample;
        match self {
            Self::Means(field) => f64::from(field.product.value(i, j, k)) / f64::from(density.value(i, j, k)),
            Self::Own(_, grid) => f64::from(grid.density(density.lattice().position(sample))),
            Self::Density => f64::from(density.value(i, j, k)).sqrt(),
        }
    }

    /// Values and densities of the samples with density.
    fn weighted(&self, density: &Grid) -> Vec<(f64, f64)> {
        let lattice = density.lattice();
        let of_brick = |number: usize| {
            let filled = density.brick_range(lattice.brick(number)).max > 0.0;
            let samples = filled.then(|| samples(lattice, lattice.brick(number)));
            let pair = |[i, j, k]: [u32; 3]| {
                let weight = f64::from(density.value(i, j, k));
                (weight > 0.0).then(|| (self.at(density, [i, j, k]), weight))
            };
            samples.into_iter().flatten().filter_map(pair).collect::<Vec<_>>()
        };
        (0..lattice.brick_count()).into_par_iter().flat_map_iter(of_brick).collect()
    }
}

/// The samples of a brick that are in the lattice.
fn samples(lattice: Lattice, brick: [u32; 3]) -> impl Iterator<Item = [u32; 3]> {
    let all =
        (0..BRICK.pow(3)).map(move |place| [place % BRICK, place / BRICK % BRICK, place / (BRICK * BRICK)]);
    let at = all.map(move |place| std::array::from_fn(|axis| brick[axis] * BRICK + place[axis]));
    at.filter(move |at: &[u32; 3]| (0..3).all(|axis| at[axis] < lattice.size[axis]))
}

/// How a quantity becomes light: found on the first frame, and kept.
#[derive(Clone)]
pub(super) enum Source {
    Even([f32; 3]),
    /// Of numbers times a factor.
    BlackBody(BlackBody, f64),
    /// Of a quantity of that name, through colors.
    Map(String, Box<Scale>),
}

impl Source {
    /// What the emission of a first frame is to be, and how it is told; `None` if there is none.
    pub(super) fn of(
        args: &Render,
        spec: &EmissionSpec,
        density: &Grid,
        values: Option<&Values>,
    ) -> Outcome<Option<(Self, String)>> {
        let name = values.and_then(Values::name);
        let weighted = values.map(|values| values.weighted(density));
        Self::of_numbers(args, spec, name, weighted)
    }

    /// The same of numbers with their weights, which are those of `name`, or of the density.
    fn of_numbers(
        args: &Render,
        spec: &EmissionSpec,
        name: Option<&str>,
        weighted: Option<Vec<(f64, f64)>>,
    ) -> Outcome<Option<(Self, String)>> {
        let Some(mut weighted) = weighted else {
            return Ok(match spec {
                EmissionSpec::Even(radiance) => {
                    Some((Self::Even(*radiance), format!("emission {}", super::shown(*radiance))))
                }
                _ => None,
            });
        };
        if matches!(spec, EmissionSpec::BlackBody(..) | EmissionSpec::Flames) {
            return Self::black_body(spec, name, &mut weighted).map(Some);
        }
        let numbers: Vec<f64> = weighted.iter().map(|(value, _)| *value).collect();
        let name = name.unwrap_or_default();
        let (scale, text) = Scale::of_numbers(name, &numbers, &args.look.mapping())?;
        Ok(Some((Self::Map(name.into(), Box::new(scale)), format!("emission {text}"))))
    }

    /// Black bodies of numbers with their weights, and how they are told.
    fn black_body(
        spec: &EmissionSpec,
        name: Option<&str>,
        weighted: &mut [(f64, f64)],
    ) -> Outcome<(Self, String)> {
        let (factor, reference, how) = match spec {
            EmissionSpec::BlackBody(_, Some(kelvins)) => (1.0, *kelvins, "given".to_string()),
            EmissionSpec::Flames => {
                let found = quantile(weighted);
                let is_scaled = found > 0.0 && (name.is_none() || !OF_FIRE.contains(&found));
                let factor = if is_scaled { FLAME / found } else { 1.0 };
                let hottest = factor * found;
                let how = format!("99 % of the mass is colder than {} K", short(hottest));
                (factor, FLAME_REFERENCE * hottest, how)
            }
            _ => (1.0, quantile(weighted), "99 % of the mass is colder".to_string()),
        };
        let times = if factor == 1.0 { String::new() } else { format!(" times {}", short(factor)) };
        let kelvins = short(reference);
        let name = name.unwrap_or("the root of the density");
        let body = BlackBody::new(reference).map_err(|_| {
            let hint = "temperatures of 500 K and more glow: are these kelvins? (--emission blackbody:NAME@KELVINS, or \"blackbody:1000*NAME\")";
            Error::setting(format!("{FLAG} blackbody:{name}"), format!("{kelvins} K at most"), hint)
        })?;
        let text = format!("black body of {name}{times}: {kelvins} K has luminance 1 ({how})");
        Ok((Self::BlackBody(body, factor), text))
    }

    /// What colors mean, where they stand for a quantity; its unit is that of the particles.
    pub(super) fn legend(&self, particles: Option<&Particles>) -> Option<Legend> {
        let Self::Map(name, scale) = self else { return None };
        let quantity = particles.and_then(|particles| Quantity::find(particles, name, None).ok());
        let unit = quantity.and_then(|it| it.unit().map(String::from));
        Some(Legend { label: name.clone(), unit, key: Key::Amounts((**scale).clone()), missing: None })
    }

    /// The radiance where the quantity has a value.
    fn radiance(&self, value: f64) -> [f32; 3] {
        match self {
            Self::BlackBody(body, factor) => body.radiance(factor * value),
            Self::Map(_, scale) => scale.color(value),
            Self::Even(radiance) => *radiance,
        }
    }

    /// The emission of a density.
    pub(super) fn emission(
        &self,
        args: &Render,
        density: &Grid,
        values: Option<&Values>,
    ) -> Outcome<Emission> {
        let scale = args.medium.emission_scale;
        let emission = match (self, values) {
            (Self::Even(radiance), _) => Emission::even(radiance.map(|it| scale * it))?,
            (_, None) => Emission::even([0.0; 3])?,
            (source, Some(values)) => Emission::of(density, |sample| {
                source.radiance(values.at(density, sample)).map(|it| scale * it)
            }),
        };
        Ok(if args.medium.optics == OpticsName::Emission { emission.additive() } else { emission })
    }
}

/// The radiance that each sphere of a layer gives off, and how that is told; `None` if none is asked for.
pub(crate) fn of_spheres(args: &Render, particles: &Particles) -> Outcome<Option<(Vec<[f32; 3]>, String)>> {
    let Some(spec) = &args.medium.emission else { return Ok(None) };
    let quantity = spec.quantity(particles)?;
    let ids = 0..particles.len();
    let weighted = quantity.as_ref().map(|it| ids.clone().map(|id| (it.value(id), 1.0)).collect());
    let name = quantity.as_ref().map(Quantity::label);
    let Some((source, text)) = Source::of_numbers(args, spec, name, weighted)? else { return Ok(None) };
    let radiance = |id: usize| {
        let value = quantity.as_ref().map_or(0.0, |it| it.value(id));
        source.radiance(value).map(|it| args.medium.emission_scale * it)
    };
    Ok(Some((ids.map(radiance).collect(), text)))
}

/// The value below which a share of all weight lies.
fn quantile(weighted: &mut [(f64, f64)]) -> f64 {
    weighted.par_sort_unstable_by(|(a, _), (b, _)| a.total_cmp(b));
    let total: f64 = weighted.iter().map(|(_, weight)| weight).sum();
    let mut sum = 0.0;
    let reached = weighted.iter().find(|(_, weight)| {
        sum += weight;
        sum >= REFERENCE_SHARE * total
    });
    reached.or(weighted.last()).map_or(0.0, |(value, _)| *value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn emission_is_read_as_it_is_written() {
        let read = |text: &str| text.parse::<EmissionSpec>();
        let body = |name: &str, reference| EmissionSpec::BlackBody(Some(name.into()), reference);
        assert_eq!(read("blackbody").unwrap(), EmissionSpec::BlackBody(None, None));
        assert_eq!(read("blackbody:T").unwrap(), body("T", None));
        assert_eq!(read("blackbody:1000*T@1500").unwrap(), body("1000*T", Some(1500.0)));
        assert_eq!(read("2,1,0.5").unwrap(), EmissionSpec::Even([2.0, 1.0, 0.5]));
        assert_eq!(read("|v|").unwrap(), EmissionSpec::Quantity("|v|".into()));
        assert_eq!(read("none").unwrap(), EmissionSpec::None);
        for bad in ["", "blackbody:", "blackbody:T@x", "blackbody:@900", "blackbodyT", "blackbody:T@20", "-1"]
        {
            assert!(read(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn the_quantile_is_of_the_weight() {
        let mut weighted = [(3.0, 97.0), (9.0, 0.5), (5.0, 2.5)];
        assert_eq!(quantile(&mut weighted), 5.0);
        assert_eq!(quantile(&mut []), 0.0);
    }

    #[test]
    fn flames_are_as_hot_as_fire_on_any_scale() {
        let flames = &EmissionSpec::Flames;
        let told = |spec: &EmissionSpec, name: Option<&str>, kelvins: f64| {
            let mut weighted = [(0.5 * kelvins, 98.0), (kelvins, 2.0)];
            let (source, text) = Source::black_body(spec, name, &mut weighted)?;
            let reference = if spec == flames { FLAME_REFERENCE } else { 1.0 };
            let [r, g, b] = source.radiance(reference * kelvins);
            let luminance = 0.2126 * r + 0.7152 * g + 0.0722 * b;
            assert!((luminance - 1.0).abs() < 0.01, "{luminance}");
            Outcome::Ok(text)
        };
        let text = told(flames, Some("temperature"), 0.85).unwrap();
        assert_eq!(
            text,
            "black body of temperature times 2000: 1496 K has luminance 1 (99 % of the mass is colder than 1700 K)"
        );
        assert!(told(flames, Some("temperature"), 2000.0).unwrap().contains("temperature: 1760 K"));
        assert!(told(flames, None, 2000.0).unwrap().contains("density times 0.85: 1496 K"));
        assert!(told(&EmissionSpec::BlackBody(None, None), Some("T"), 0.85).is_err());
        assert!(told(flames, Some("temperature"), 0.0).is_err());
    }
}
