//! The functions that expressions may call.

use crate::names::nearest;

/// A function of numbers.
#[derive(Debug)]
pub(in crate::scene) struct Function {
    pub(super) name: &'static str,
    /// How many numbers it takes, at least and at most.
    pub(super) takes: [usize; 2],
    /// Whether it is true or false.
    pub(super) is_condition: bool,
    /// Whether it is one of its numbers but the first, by the first.
    pub(super) chooses: bool,
    pub(super) apply: fn(&[f64]) -> f64,
}

/// The most numbers that a function takes.
pub(super) const MOST: usize = 8;

impl PartialEq for Function {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

const fn of_one(name: &'static str, apply: fn(&[f64]) -> f64) -> Function {
    Function { name, takes: [1; 2], is_condition: false, chooses: false, apply }
}

const fn of(name: &'static str, takes: [usize; 2], apply: fn(&[f64]) -> f64) -> Function {
    Function { name, takes, is_condition: false, chooses: false, apply }
}

/// What is missing makes the least and the greatest missing.
fn extreme(given: &[f64], pick: fn(f64, f64) -> f64) -> f64 {
    given
        .iter()
        .copied()
        .reduce(|a, b| if a.is_nan() || b.is_nan() { f64::NAN } else { pick(a, b) })
        .unwrap_or(f64::NAN)
}

static FUNCTIONS: [Function; 24] = [
    of_one("abs", |given| given[0].abs()),
    of_one("sqrt", |given| given[0].sqrt()),
    of_one("exp", |given| given[0].exp()),
    of_one("log", |given| given[0].ln()),
    of_one("log2", |given| given[0].log2()),
    of_one("log10", |given| given[0].log10()),
    of_one("sin", |given| given[0].sin()),
    of_one("cos", |given| given[0].cos()),
    of_one("tan", |given| given[0].tan()),
    of_one("asin", |given| given[0].asin()),
    of_one("acos", |given| given[0].acos()),
    of_one("atan", |given| given[0].atan()),
    of_one("floor", |given| given[0].floor()),
    of_one("ceil", |given| given[0].ceil()),
    of_one("round", |given| given[0].round()),
    of_one("sign", |given| if given[0] == 0.0 { 0.0 } else { given[0].signum() }),
    of_one("degrees", |given| given[0].to_degrees()),
    of_one("radians", |given| given[0].to_radians()),
    of("atan2", [2; 2], |given| given[0].atan2(given[1])),
    of("hypot", [2, MOST], |given| given.iter().map(|it| it * it).sum::<f64>().sqrt()),
    of("min", [2, MOST], |given| extreme(given, f64::min)),
    of("max", [2, MOST], |given| extreme(given, f64::max)),
    Function { chooses: true, ..of("if", [3; 2], |given| if given[0] != 0.0 { given[1] } else { given[2] }) },
    Function { is_condition: true, ..of_one("missing", |given| f64::from(u8::from(given[0].is_nan()))) },
];

impl Function {
    /// The function of that name; the error has the nearest and all others.
    pub(super) fn find(name: &str) -> Result<&'static Self, String> {
        FUNCTIONS.iter().find(|it| it.name == name).ok_or_else(|| {
            let names = || FUNCTIONS.iter().map(|it| it.name).chain(["random"]);
            let meant =
                nearest(name, names()).map_or(String::new(), |meant| format!(" did you mean '{meant}'?"));
            format!("no function '{name}';{meant} there are: {}", names().collect::<Vec<_>>().join(", "))
        })
    }
}
