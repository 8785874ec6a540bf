//! An expression in particles: its names are found once, its value for every particle.

use super::functions::{Function, MOST};
use super::{Arithmetic, Comparison, Tree, Wanted};
use crate::error::Error;
use crate::particles::{Attribute, Particles};
use crate::random::{hash, unit_f64};
use crate::scene::meaning::{Meaning, Words};
use crate::scene::quantity::Quantity;
use crate::scene::units::meters;

/// See the module.
#[derive(Clone, Debug)]
pub(in crate::scene) struct Bound<'a> {
    particles: &'a Particles,
    root: Node<'a>,
}

#[derive(Clone, Debug)]
enum Node<'a> {
    Number(f64),
    Quantity(Box<Quantity<'a>>),
    Random(u64),
    Negative(Box<Node<'a>>),
    Not(Box<Node<'a>>),
    Arithmetic(Arithmetic, Box<[Node<'a>; 2]>),
    Compared(Comparison, Box<[Node<'a>; 2]>),
    And(Vec<Node<'a>>),
    Or(Vec<Node<'a>>),
    /// Whether a value of an attribute is one of those that are flagged.
    Word(&'a Attribute, Vec<bool>),
    /// Whether a number lies in one of these closed intervals.
    Within(Box<Node<'a>>, Vec<[f64; 2]>),
    Call(&'static Function, Vec<Node<'a>>),
}

/// What a side of a comparison is.
enum Side<'a> {
    Number(Node<'a>),
    Words(String, Words<'a>),
    /// One word, or a name that means no quantity, with what is said about that.
    Word(String, Option<String>),
}

impl<'a> Bound<'a> {
    /// Finds what the names mean. The error says which of them means nothing.
    pub(in crate::scene) fn new(tree: &Tree, particles: &'a Particles) -> Result<Self, String> {
        Ok(Self { particles, root: Binder(particles).node(tree)? })
    }

    /// The value for particle `id`; of a condition 1 or 0.
    #[inline]
    pub(in crate::scene) fn value(&self, id: usize) -> f64 {
        self.root.value(self.particles, id)
    }
}

impl Node<'_> {
    fn value(&self, particles: &Particles, id: usize) -> f64 {
        let of = |node: &Node| node.value(particles, id);
        let is = |node: &Node| of(node) != 0.0;
        let condition = |is: bool| f64::from(u8::from(is));
        match self {
            Self::Number(value) => *value,
            Self::Quantity(quantity) => quantity.value(id),
            Self::Random(seed) => unit_f64(hash(*seed, particles.place(id), 0)),
            Self::Negative(inner) => -of(inner),
            Self::Not(inner) => condition(!is(inner)),
            Self::Arithmetic(operator, sides) => {
                let [a, b] = [of(&sides[0]), of(&sides[1])];
                match operator {
                    Arithmetic::Add => a + b,
                    Arithmetic::Subtract => a - b,
                    Arithmetic::Multiply => a * b,
                    Arithmetic::Divide => a / b,
                    Arithmetic::Remainder => a.rem_euclid(b),
                    Arithmetic::Power => a.powf(b),
                }
            }
            Self::Compared(comparison, sides) => {
                let [a, b] = [of(&sides[0]), of(&sides[1])];
                condition(match comparison {
                    Comparison::Less => a < b,
                    Comparison::LessOrEqual => a <= b,
                    Comparison::Greater => a > b,
                    Comparison::GreaterOrEqual => a >= b,
                    Comparison::Equal => a == b,
                    Comparison::Unequal => a != b,
                })
            }
            Self::And(parts) => condition(parts.iter().all(is)),
            Self::Or(parts) => condition(parts.iter().any(is)),
            Self::Word(attribute, wanted) => {
                condition(wanted.get(attribute.number(id, 0) as usize).is_some_and(|&it| it))
            }
            Self::Within(number, intervals) => {
                let number = of(number);
                condition(intervals.iter().any(|[low, high]| (*low..=*high).contains(&number)))
            }
            Self::Call(function, given) => {
                let mut values = [0.0; MOST];
                values.iter_mut().zip(given).for_each(|(value, node)| *value = of(node));
                (function.apply)(&values[..given.len()])
            }
        }
    }
}

/// Finds names in particles.
struct Binder<'a>(&'a Particles);

impl<'a> Binder<'a> {
    fn node(&self, tree: &Tree) -> Result<Node<'a>, String> {
        let boxed = |tree: &Tree| self.node(tree).map(Box::new);
        let both = |sides: &[Tree; 2]| Ok::<_, String>([self.node(&sides[0])?, self.node(&sides[1])?]);
        Ok(match tree {
            Tree::Number(value) => Node::Number(*value),
            Tree::Length(value, meters) => Node::Number(value * meters / self.file_meters()?),
            Tree::Random(seed) => Node::Random(*seed),
            Tree::Word(word) => return Err(format!("the word '{word}' is not compared with anything")),
            Tree::Name(name) => match self.side(tree)? {
                Side::Number(node) => node,
                Side::Words(..) => {
                    return Err(format!("{name} has words: compare it, as in {name} == 'word'"));
                }
                Side::Word(_, why) => return Err(why.unwrap_or_default()),
            },
            Tree::Negative(inner) => Node::Negative(boxed(inner)?),
            Tree::Not(inner) => Node::Not(boxed(inner)?),
            Tree::Arithmetic(operator, sides) => Node::Arithmetic(*operator, Box::new(both(sides)?)),
            Tree::And(sides) => Node::And(both(sides)?.into()),
            Tree::Or(sides) => Node::Or(both(sides)?.into()),
            Tree::Compared(sides, comparisons) => {
                let pairs = sides.windows(2).zip(comparisons);
                let mut parts = pairs
                    .map(|(pair, comparison)| self.compared(&pair[0], *comparison, &pair[1]))
                    .collect::<Result<Vec<_>, _>>()?;
                if parts.len() == 1 { parts.remove(0) } else { Node::And(parts) }
            }
            Tree::Among(name, wanted) => self.among(name, wanted)?,
            Tree::Call(function, given) => {
                Node::Call(function, given.iter().map(|tree| self.node(tree)).collect::<Result<_, _>>()?)
            }
        })
    }

    /// How many meters the file's unit has.
    fn file_meters(&self) -> Result<f64, String> {
        let unit = self
            .0
            .length_unit()
            .ok_or("the file does not say its unit of length: leave the unit out, or say it with --units")?;
        meters(unit)
            .ok_or_else(|| format!("the file's unit of length, {unit}, is not known: leave the unit out"))
    }

    fn side(&self, tree: &Tree) -> Result<Side<'a>, String> {
        match tree {
            Tree::Word(word) => Ok(Side::Word(word.clone(), None)),
            Tree::Name(name) => match Meaning::of(self.0, name) {
                Ok(Meaning::Number(quantity)) => Ok(Side::Number(Node::Quantity(Box::new(quantity)))),
                Ok(Meaning::Word(words)) => Ok(Side::Words(name.clone(), words)),
                Err(Error::Setting { allowed, .. }) => Ok(Side::Word(name.clone(), Some(allowed))),
                Err(error) => Err(error.to_string()),
            },
            _ => self.node(tree).map(Side::Number),
        }
    }

    fn compared(&self, left: &Tree, comparison: Comparison, right: &Tree) -> Result<Node<'a>, String> {
        let word_of = |(name, words): (String, Words<'a>), word: &str| {
            let (attribute, wanted) = words.wanted(&name, [word])?;
            let is = Node::Word(attribute, wanted);
            match comparison {
                Comparison::Equal => Ok(is),
                Comparison::Unequal => Ok(Node::Not(Box::new(is))),
                _ => Err(format!("{name} has words, which are equal (==) or not (!=)")),
            }
        };
        match (self.side(left)?, self.side(right)?) {
            (Side::Number(left), Side::Number(right)) => {
                Ok(Node::Compared(comparison, Box::new([left, right])))
            }
            (Side::Words(name, words), Side::Word(word, _))
            | (Side::Word(word, _), Side::Words(name, words)) => word_of((name, words), &word),
            // One of the words of the first may be called like an attribute.
            (Side::Words(name, words), Side::Words(word, _)) => word_of((name, words), &word),
            (Side::Word(_, Some(why)), _) | (_, Side::Word(_, Some(why))) => Err(why),
            (Side::Word(word, None), _) | (_, Side::Word(word, None)) => {
                Err(format!("'{word}' is compared with what has no words"))
            }
            (Side::Words(name, _), _) | (_, Side::Words(name, _)) => {
                Err(format!("{name} has words, and is compared with a number"))
            }
        }
    }

    fn among(&self, name: &str, wanted: &[Wanted]) -> Result<Node<'a>, String> {
        match self.side(&Tree::Name(name.into()))? {
            Side::Words(name, words) => {
                let (attribute, wanted) = words.wanted(&name, wanted.iter().map(|it| it.text.as_str()))?;
                Ok(Node::Word(attribute, wanted))
            }
            Side::Number(node) => {
                let interval = |it: &Wanted| {
                    it.interval.ok_or_else(|| format!("'{}' is no number, and {name} has numbers", it.text))
                };
                Ok(Node::Within(Box::new(node), wanted.iter().map(interval).collect::<Result<_, _>>()?))
            }
            Side::Word(_, why) => Err(why.unwrap_or_default()),
        }
    }
}
