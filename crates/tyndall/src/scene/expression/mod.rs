//! Expressions over what is known of a particle: `sqrt(vx^2 + vy^2)`, `element == O and z > 2 nm`, `not resname SOL`.
//!
//! `parse.rs` makes a tree of a text without looking at particles, `bound.rs` finds what its names mean in particles and evaluates it for
//! each. `docs/expressions.md` has the grammar. A condition is 1 or 0; what is missing (NaN) fulfills no comparison but `!=`.

mod bound;
mod functions;
mod parse;
mod tokens;

pub(super) use bound::Bound;
use functions::Function;

/// A text that was understood.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Tree {
    Number(f64),
    /// A number and the unit of length that it has, in meters.
    Length(f64, f64),
    /// A word in quotes; with `*` or `?` it stands for all that are like it.
    Word(String),
    /// A quantity, or a word where another side of a comparison has words.
    Name(String),
    Negative(Box<Tree>),
    Not(Box<Tree>),
    Arithmetic(Arithmetic, Box<[Tree; 2]>),
    And(Box<[Tree; 2]>),
    Or(Box<[Tree; 2]>),
    /// Two sides or more, each compared with the next: one comparison less than sides.
    Compared(Vec<Tree>, Vec<Comparison>),
    /// A quantity that has one of some values.
    Among(String, Vec<Wanted>),
    Call(&'static Function, Vec<Tree>),
    /// A number from 0 to 1 for every particle, by a seed.
    Random(u64),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Arithmetic {
    Add,
    Subtract,
    Multiply,
    Divide,
    Remainder,
    Power,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Comparison {
    Less,
    LessOrEqual,
    Greater,
    GreaterOrEqual,
    Equal,
    Unequal,
}

/// A value of a list as it is written, and as a closed interval if it is a number or a range of them.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Wanted {
    pub(super) text: String,
    pub(super) interval: Option<[f64; 2]>,
}

impl Tree {
    /// Reads an expression. The error says what is wrong with it, and where.
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        parse::parse(text)
    }

    /// Whether it is true or false, and no other number.
    pub(super) fn is_condition(&self) -> bool {
        match self {
            Self::Not(_) | Self::And(_) | Self::Or(_) | Self::Compared(..) | Self::Among(..) => true,
            Self::Call(function, given) if function.chooses => given[1..].iter().all(Self::is_condition),
            Self::Call(function, _) => function.is_condition,
            _ => false,
        }
    }

    /// The names in it, each with whether it may be a word instead of a quantity.
    pub(super) fn names(&self) -> Vec<(&str, bool)> {
        match self {
            Self::Number(_) | Self::Length(..) | Self::Word(_) | Self::Random(_) => Vec::new(),
            Self::Name(name) => vec![(name, false)],
            Self::Among(name, _) => vec![(name, false)],
            Self::Negative(inner) | Self::Not(inner) => inner.names(),
            Self::Arithmetic(_, sides) | Self::And(sides) | Self::Or(sides) => {
                sides.iter().flat_map(Self::names).collect()
            }
            Self::Call(_, given) => given.iter().flat_map(Self::names).collect(),
            Self::Compared(sides, _) => {
                let names = sides.iter().map(|side| match side {
                    Self::Name(name) => vec![(name.as_str(), true)],
                    side => side.names(),
                });
                names.flatten().collect()
            }
        }
    }
}

#[cfg(test)]
mod tests;
