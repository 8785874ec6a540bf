//! What a name means in particles: a number of each, or a word.

use super::element::{Element, Elements, is_of_symbols};
use super::kinds::types;
use super::quantity::{Quantity, named, unknown};
use crate::error::{self, Error};
use crate::names::nearest;
use crate::particles::{Attribute, Particles, View};

/// More values than this are not listed one by one.
pub(super) const LISTED: usize = 12;

/// What a name means.
pub(super) enum Meaning<'a> {
    Number(Quantity<'a>),
    Word(Words<'a>),
}

/// A word of every particle.
pub(super) struct Words<'a> {
    attribute: &'a Attribute,
    /// By the attribute's value; none where it says none.
    by_value: Vec<Option<&'a str>>,
    are_elements: bool,
}

impl<'a> Meaning<'a> {
    /// Of an attribute, `v.x`, `|v|`, `x`, `type`, `element`, or an expression. Fails as [`Quantity::find`] does.
    pub(super) fn of(particles: &'a Particles, name: &str) -> error::Result<Self> {
        let (plain, component) = named(name);
        let attribute = particles.attribute(plain).filter(|_| component.is_none());
        let attribute = match plain.to_ascii_lowercase().as_str() {
            "element" if attribute.is_none() => {
                let elements = Elements::find(particles).ok_or_else(|| unknown(particles, name))?;
                return Ok(Self::Word(Words::of_elements(particles, &elements)));
            }
            "type" if component.is_none() => attribute.or_else(|| types(particles).next()),
            _ => attribute,
        };
        match attribute.filter(|it| it.components == 1) {
            Some(attribute) => match attribute.values.view() {
                View::Text { names, .. } => {
                    let by_value = names.iter().map(|name| Some(name.as_str())).collect();
                    Ok(Self::Word(Words {
                        attribute,
                        by_value,
                        are_elements: is_of_symbols(&attribute.name),
                    }))
                }
                _ => Quantity::find(particles, &attribute.name, None).map(Self::Number),
            },
            None => Quantity::find(particles, plain, component).map(Self::Number),
        }
    }

    /// The number of every particle that the text of a setting stands for. Fails as [`Quantity::find`] does, and if it stands for words, about that setting.
    pub(super) fn number(particles: &'a Particles, setting: &str, text: &str) -> error::Result<Quantity<'a>> {
        match Self::of(particles, text) {
            Ok(Self::Number(quantity)) => Ok(quantity),
            Ok(Self::Word(_)) => Err(Error::setting(setting, text, "a number: it stands for words")),
            Err(Error::Setting { value, allowed, .. }) => Err(Error::setting(setting, value, allowed)),
            Err(other) => Err(other),
        }
    }
}

impl<'a> Words<'a> {
    /// Elements by their symbols; unknown ones have none.
    fn of_elements(particles: &'a Particles, elements: &Elements) -> Self {
        let symbol = |element: &Option<Element>| element.map(Element::symbol);
        Self {
            attribute: &particles.attributes()[elements.attribute],
            by_value: elements.by_value.iter().map(symbol).collect(),
            are_elements: true,
        }
    }

    /// The words that there are, in order.
    pub(super) fn list(&self) -> Vec<&'a str> {
        let mut words: Vec<&str> = self.by_value.iter().copied().flatten().collect();
        words.sort_unstable();
        words.dedup();
        words
    }

    /// Of a particle its word's place in [`Words::list`], or NaN.
    pub(super) fn places(&self) -> impl Fn(usize) -> f64 + use<'a> {
        let words = self.list();
        let place =
            |word: &Option<&str>| word.map_or(f64::NAN, |word| words.partition_point(|it| *it < word) as f64);
        let places: Vec<f64> = self.by_value.iter().map(place).collect();
        let attribute = self.attribute;
        move |id| places.get(attribute.number(id, 0) as usize).copied().unwrap_or(f64::NAN)
    }

    /// The attribute, and which of its values mean one of these words; `*` and `?` stand for any letters and for one. The error says
    /// which words there are.
    pub(super) fn wanted<'b>(
        &self,
        name: &str,
        wanted: impl IntoIterator<Item = &'b str>,
    ) -> Result<(&'a Attribute, Vec<bool>), String> {
        let mut flags = vec![false; self.by_value.len()];
        for text in wanted {
            let found = self.like(text).ok_or_else(|| no_word(text, name, &self.list()))?;
            flags.iter_mut().zip(found).for_each(|(flag, found)| *flag |= found);
        }
        Ok((self.attribute, flags))
    }

    /// Which values mean a word: exactly, else in any case; none where the word cannot be meant.
    fn like(&self, text: &str) -> Option<Vec<bool>> {
        let flags = |is: &dyn Fn(&str) -> bool| -> Vec<bool> {
            self.by_value.iter().map(|it| it.is_some_and(is)).collect()
        };
        if text.contains(['*', '?']) {
            return Some(flags(&|word| matches(text.as_bytes(), word.as_bytes())));
        }
        let exact = flags(&|word| word == text);
        if exact.contains(&true) {
            return Some(exact);
        }
        let similar = flags(&|word| word.eq_ignore_ascii_case(text));
        // An element may be absent: that is no mistake.
        let is_known = similar.contains(&true) || (self.are_elements && Element::from_symbol(text).is_some());
        is_known.then_some(similar)
    }
}

/// Whether a word is like a pattern with `*` and `?`.
fn matches(pattern: &[u8], word: &[u8]) -> bool {
    let (mut at, mut place) = (0, 0);
    // Where to go on if what follows the last star does not fit.
    let mut star: Option<(usize, usize)> = None;
    while place < word.len() {
        match pattern.get(at) {
            Some(b'*') => {
                star = Some((at + 1, place));
                at += 1;
            }
            Some(&letter) if letter == b'?' || letter == word[place] => (at, place) = (at + 1, place + 1),
            _ => match star {
                Some((after, from)) => {
                    star = Some((after, from + 1));
                    (at, place) = (after, from + 1);
                }
                None => return false,
            },
        }
    }
    pattern[at..].iter().all(|&letter| letter == b'*')
}

/// What is said about a word that is none of a quantity's.
pub(super) fn no_word(text: &str, quantity: &str, words: &[&str]) -> String {
    let meant = nearest(text, words.iter().copied());
    let meant = meant.map_or(String::new(), |it| format!(" did you mean '{it}'?"));
    format!("no '{text}' in {quantity};{meant} it has: {}", list(words))
}

/// The first of some words.
pub(super) fn list(words: &[&str]) -> String {
    let more = if words.len() > LISTED { ", ..." } else { "" };
    format!("{}{more}", words[..words.len().min(LISTED)].join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stars_stand_for_any_letters() {
        for (pattern, word, is) in [
            ("H*", "HB1", true),
            ("H*", "H", true),
            ("*B?", "HB1", true),
            ("*B?", "HB", false),
            ("?", "", false),
            ("*", "", true),
            ("a*b*c", "axxbxbc", true),
            ("a*b*c", "axxbxb", false),
            ("CA", "CAB", false),
        ] {
            assert_eq!(matches(pattern.as_bytes(), word.as_bytes()), is, "{pattern} {word}");
        }
    }
}
