//! The text that names a synthetic cloud: `NAME?KEY=VALUE&KEY=VALUE`, into a law's name, a count, a seed and a radius.
//!
//! Invariant of what comes out: the name is one of [`NAMES`], the count is below 2^32 - 1.

use super::{KEYS, NAMES};
use crate::error::{Error, Result};
use crate::names::nearest;

/// What a specification says, with its defaults filled in.
#[derive(Debug, PartialEq)]
pub(super) struct Specification {
    pub(super) name: &'static str,
    pub(super) count: u64,
    pub(super) seed: u64,
    /// In place of the law's radius.
    pub(super) radius: Option<f32>,
}

impl Specification {
    pub(super) fn parse(text: &str) -> Result<Self> {
        let (name, parameters) = text.split_once('?').unwrap_or((text, ""));
        let name = known(name, &NAMES).map_err(|allowed| Error::setting("synthetic", name, allowed))?;
        let mut given: [Option<&str>; 3] = [None; 3];
        for parameter in parameters.split('&').filter(|it| !it.is_empty()) {
            let (key, value) = parameter.split_once('=').unwrap_or((parameter, ""));
            let key = known(key, &KEYS).map_err(|allowed| Error::setting("synthetic key", key, allowed))?;
            let slot = KEYS.iter().position(|&it| it == key).expect("it is known");
            if given[slot].replace(value).is_some() {
                return Err(Error::setting(key, value, "give it once"));
            }
        }
        let count = match given[0] {
            Some(text) => whole("n", text)?,
            None => default_count(name),
        };
        if count >= u64::from(u32::MAX) {
            return Err(Error::setting("n", count, "at most 2^32 - 2 particles in one layer"));
        }
        let seed = given[1].map_or(Ok(count), |text| whole("seed", text))?;
        let radius = given[2].map(length).transpose()?;
        Ok(Self { name, count, seed, radius })
    }
}

/// The counts of the published sets; a million for the others.
fn default_count(name: &str) -> u64 {
    match name {
        "nozzle" => 1_550_333,
        "virion" => 14_566_669,
        "fluid" => 29_999_997,
        "ablation" => 48_000_000,
        "cloud1" => 500_000,
        "cloud2" => 50_000,
        "smoke" => 326_752,
        _ => 1_000_000,
    }
}

/// The word as it stands in the list, or what is allowed instead.
fn known(word: &str, list: &[&'static str]) -> std::result::Result<&'static str, String> {
    if let Some(&found) = list.iter().find(|&&it| it == word) {
        return Ok(found);
    }
    let allowed = format!("one of {}", list.join(", "));
    Err(nearest(word, list.iter().copied())
        .map_or(allowed.clone(), |it| format!("did you mean '{it}'? {allowed}")))
}

/// A whole number, also written as `1e7`, `2.5e6` or `1_000_000`.
fn whole(key: &str, text: &str) -> Result<u64> {
    let digits = text.replace('_', "");
    let exponential = || {
        let number: f64 = digits.parse().ok()?;
        // Up to 2^53 every whole number is a float exactly.
        let fits = (0.0..=9_007_199_254_740_992.0).contains(&number) && number.fract() == 0.0;
        fits.then_some(number as u64)
    };
    let number = digits.parse().ok().or_else(exponential);
    number
        .ok_or_else(|| Error::setting(key, text, "a whole number from 0, such as 1000000, 1_000_000 or 1e6"))
}

/// A radius: finite, not negative.
fn length(text: &str) -> Result<f32> {
    let number: Option<f32> = text.parse().ok();
    let usable = number.filter(|it| (0.0..f32::INFINITY).contains(it));
    usable.ok_or_else(|| Error::setting("radius", text, "a number from 0 in the law's unit of length"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(text: &str) -> String {
        Specification::parse(text).unwrap_err().to_string()
    }

    #[test]
    fn counts_are_read_in_every_notation() {
        for (text, count) in [
            ("uniform", 1_000_000),
            ("nozzle?", 1_550_333),
            ("uniform?n=0", 0),
            ("uniform?n=1e7", 10_000_000),
            ("uniform?n=2.5e6&seed=3", 2_500_000),
            ("uniform?n=1_000_003", 1_000_003),
        ] {
            assert_eq!(Specification::parse(text).unwrap().count, count, "{text}");
        }
    }

    #[test]
    fn the_seed_is_the_count_unless_given() {
        let plain = Specification::parse("smoke?n=17").unwrap();
        assert_eq!(plain, Specification { name: "smoke", count: 17, seed: 17, radius: None });
        let all = Specification::parse("smoke?radius=0.5&seed=18446744073709551615&n=2").unwrap();
        assert_eq!(all, Specification { name: "smoke", count: 2, seed: u64::MAX, radius: Some(0.5) });
    }

    #[test]
    fn mistakes_are_explained() {
        assert!(message("nozle").contains("did you mean 'nozzle'"));
        assert!(message("cloud3").contains("did you mean 'cloud1'"));
        assert!(
            message("galaxy").contains("uniform, packed, clustered") && !message("galaxy").contains("mean")
        );
        assert!(message("fluid?sed=3").contains("did you mean 'seed'"));
        assert!(message("fluid?colour=3").contains("one of n, seed, radius"));
        for bad in
            ["?n=3", "fluid?n=-1", "fluid?n=1.5", "fluid?n=", "fluid?n", "fluid?n=1e30", "fluid?n=4294967295"]
        {
            assert!(Specification::parse(bad).is_err(), "{bad}");
        }
        for bad in
            ["fluid?radius=-1", "fluid?radius=inf", "fluid?radius=NaN", "fluid?n=1&n=2", "fluid?seed=x", ""]
        {
            assert!(Specification::parse(bad).is_err(), "{bad}");
        }
    }
}
