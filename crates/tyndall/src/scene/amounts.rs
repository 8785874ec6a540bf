//! Colors of amounts: a smooth map over a number of every particle.
//!
//! Defaults by the quantity's name: density and mass are logarithmic in magma, temperature in inferno, components of vectors and
//! charges diverge around zero in coolwarm, else viridis. The range is that of the 1st to the 99th percentile.

use rayon::prelude::*;

use super::color::{Key, Legend, ParticleColors, Scale};
use super::coloring::{MISSING, Mapping, Norm, Range, linear};
use super::colormap::Colormap;
use super::quantity::Quantity;
use super::statistics::{grouped, quantiles, sampled, short};
use crate::error::{Error, Result};
use crate::particles::Particles;

/// Places of colors in a byte, but for that of missing values.
const LEVELS: usize = 255;

/// The extremes of a column.
#[derive(Clone, Copy)]
pub(super) struct Spread {
    pub(super) low: f64,
    pub(super) high: f64,
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

    pub(super) fn of(count: usize, value: impl Fn(usize) -> f64 + Sync) -> Self {
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
pub(super) fn by_number(
    particles: &Particles,
    quantity: &Quantity,
    mapping: &Mapping,
) -> Result<ParticleColors> {
    let &Mapping { ref map, norm, range, missing, below, above } = mapping;
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
    check_logarithm(quantity.label(), &spread, norm, range)?;

    let (mut low, mut high, mut how) =
        limits((particles.len(), |id| quantity.value(id)), &spread, norm, range);
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
    let map = map.clone().map_or_else(|| Colormap::named(name), Ok)?;

    // Spread the numbers over the levels: behind those of the map come below, above and missing.
    let scale = Scale::new(&map, norm, [low, high], below, above);
    let levels = scale.colors.len();
    let place_above = levels + usize::from(below.is_some());
    let place_missing = place_above + usize::from(above.is_some());
    let ends = [low, high].map(|end| norm.spread(end));
    let place = |id: usize| {
        let value = quantity.value(id);
        if value.is_nan() {
            return place_missing as u8;
        }
        if below.is_some() && value < low {
            return levels as u8;
        }
        if above.is_some() && value > high {
            return place_above as u8;
        }
        let t = share(norm.spread(value), ends);
        (t * levels as f64).clamp(0.0, levels as f64 - 1.0) as u8
    };
    let places = (0..particles.len()).into_par_iter().with_min_len(1 << 14).map(place).collect();
    let colors = scale.colors.iter().copied().chain(below).chain(above).chain([missing]).collect();

    let norm_name = if norm == Norm::Log { "log" } else { "linear" };
    let (label, limits) = (quantity.label(), format!("{}:{}", short(low), short(high)));
    let mut description = format!("color {label} {} {norm_name} {limits} ({how})", map.name());
    if norm == Norm::Log && spread.not_positive > 0 {
        let which = if below.is_some() { "the color of those below" } else { "the lowest color" };
        description += &format!(", {} not above 0 have {which}", grouped(spread.not_positive));
    }
    if spread.missing > 0 {
        description += &format!(", {} missing are {}", grouped(spread.missing), shown_missing(missing));
    }
    let mut colors = ParticleColors::palette(colors, places, description);
    colors.legend = Some(Legend {
        label: label.into(),
        unit: quantity.unit().map(str::to_string),
        key: Key::Amounts(scale),
        missing: (spread.missing > 0).then_some(missing),
    });
    Ok(colors)
}

impl Scale {
    /// The levels of a map for numbers between two.
    fn new(
        map: &Colormap,
        norm: Norm,
        [low, high]: [f64; 2],
        below: Option<[u8; 3]>,
        above: Option<[u8; 3]>,
    ) -> Self {
        let levels = LEVELS - usize::from(below.is_some()) - usize::from(above.is_some());
        let color =
            |level: usize| map.at((level as f32 + 0.5) / levels as f32).map(|it| (255.0 * it).round() as u8);
        Self { norm, low, high, colors: (0..levels).map(color).collect(), below, above }
    }

    /// The colors of numbers that are no particles', such as the pixels of a map, and how they are told. Where nobody says, they are
    /// logarithmic in inferno if none is below 0 (zeros and NaN are nothing), else linear in coolwarm around 0.
    ///
    /// Fails with [`Error::Setting`] if there is no logarithm of what is asked for.
    pub fn of_numbers(label: &str, numbers: &[f64], mapping: &Mapping) -> Result<(Self, String)> {
        let &Mapping { ref map, norm, range, below, above, .. } = mapping;
        let spread = Spread::of(numbers.len(), |place| numbers[place]);
        let has_signs = spread.low < 0.0;
        let guessed = match range {
            Range::Given(low, _) if low <= 0.0 => Norm::Linear,
            _ if has_signs || spread.positive_low > spread.high => Norm::Linear,
            _ => Norm::Log,
        };
        let norm = norm.unwrap_or(guessed);
        check_logarithm(label, &spread, norm, range)?;
        let (mut low, mut high, mut how) =
            limits((numbers.len(), |place| numbers[place]), &spread, norm, range);
        let signed = norm == Norm::Linear && low < 0.0 && high > 0.0;
        if signed && !matches!(range, Range::Given(..)) {
            high = high.max(-low);
            low = -high;
            how += ", centered on 0";
        }
        let name = if signed { "coolwarm" } else { "inferno" };
        let map = map.clone().map_or_else(|| Colormap::named(name), Ok)?;
        let norm_name = if norm == Norm::Log { "log" } else { "linear" };
        let text = format!("{label} {} {norm_name} {}:{} ({how})", map.name(), short(low), short(high));
        Ok((Self::new(&map, norm, [low, high], below, above), text))
    }

    /// The linear color of a number; that of NaN is [`MISSING`].
    pub fn color(&self, value: f64) -> [f32; 3] {
        let levels = self.colors.len();
        linear(match (self.below, self.above) {
            _ if value.is_nan() => MISSING,
            (Some(below), _) if value < self.low => below,
            (_, Some(above)) if value > self.high => above,
            _ => self.colors[(self.place(value) * levels as f64).clamp(0.0, levels as f64 - 1.0) as usize],
        })
    }
}

/// Where a number lies between two, 0 and 1, and beyond. A range of one value shows the middle of the map.
#[inline(always)]
fn share(value: f64, [start, end]: [f64; 2]) -> f64 {
    if start < end { (value - start) / (end - start) } else { 0.5 }
}

/// Refuses a logarithm of numbers or limits that have none.
fn check_logarithm(label: &str, spread: &Spread, norm: Norm, range: Range) -> Result<()> {
    if norm != Norm::Log {
        return Ok(());
    }
    if let Range::Given(low, high) = range
        && low <= 0.0
    {
        let allowed = "a logarithm needs a range above 0";
        return Err(Error::setting("--range", format!("{low}:{high}"), allowed));
    }
    if spread.positive_low > spread.high {
        let allowed = format!("{label} has no value above 0: use linear");
        return Err(Error::setting("--norm", "log", allowed));
    }
    Ok(())
}

/// The color of what is missing, in words.
pub(super) fn shown_missing(missing: [u8; 3]) -> String {
    let [red, green, blue] = missing;
    if missing == MISSING { "gray".into() } else { format!("#{red:02x}{green:02x}{blue:02x}") }
}

/// The numbers of the first and last color, and how they were found.
fn limits(
    (count, value): (usize, impl Fn(usize) -> f64 + Sync + Send),
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
        let mut values = sampled(count, |id| Some(value(id)).filter(|value| wanted(*value)));
        if let Some([low, high]) = quantiles(&mut values, [0.01, 0.99]).filter(|[low, high]| low < high) {
            return (low, high, "1-99 %".into());
        }
    }
    (full.0, full.1, "full range".into())
}
