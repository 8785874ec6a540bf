//! Which element each type is, where somebody says so: of files whose types are numbers, or words of their own.
//!
//! Takes particles with an attribute of types, gives them an attribute `element` with a symbol each, by which all that asks for elements
//! then goes. Names in order are those of the types 1, 2, … as of LAMMPS' `dump_modify element`; of HOOMD's `typeid` those of 0, 1, ….

use std::str::FromStr;

use rayon::prelude::*;

use super::element::Element;
use super::kinds::{MOST, present, types};
use super::meaning::list;
use crate::error::{Error, Result};
use crate::names::nearest;
use crate::particles::{Attribute, Particles, Radii, Values, View};

/// The setting's name.
const SETTING: &str = "--elements";
/// The attribute that has the elements.
const ELEMENT: &str = "element";
/// The word of particles that have no element, as files of atoms write it.
const NONE: &str = "X";
/// The attribute of types that count from 0.
const FROM_ZERO: &str = "typeid";

/// Which element each type is.
#[derive(Clone, Debug, PartialEq)]
pub struct TypeElements {
    /// As it was written.
    text: String,
    by: By,
}

#[derive(Clone, Debug, PartialEq)]
enum By {
    /// Of the first type, the second one, and so on.
    Order(Vec<Element>),
    /// Of types by number or name.
    Type(Vec<(String, Element)>),
}

/// Particles whose types have elements.
#[derive(Clone, Debug)]
pub struct Named {
    /// The particles.
    pub particles: Particles,
    /// Which type has become which element, in one line.
    pub description: String,
    /// Which types have none, in one line, if any have none.
    pub warning: Option<String>,
}

impl FromStr for TypeElements {
    type Err = Error;

    /// Reads symbols in the order of types, `Cu,Zr`, or pairs of type and symbol, `1=Cu,4=Zr`.
    fn from_str(text: &str) -> Result<Self> {
        let parts: Vec<&str> = text.split(',').map(str::trim).collect();
        let pairs: Vec<Option<(&str, &str)>> = parts.iter().map(|part| part.rsplit_once('=')).collect();
        let by = match pairs.iter().flatten().count() {
            0 => By::Order(parts.iter().map(|part| element(part)).collect::<Result<_>>()?),
            count if count == parts.len() => {
                let mut named: Vec<(String, Element)> = Vec::new();
                for (kind, symbol) in pairs.into_iter().flatten() {
                    let kind = kind.trim();
                    if kind.is_empty() || named.iter().any(|(known, _)| known == kind) {
                        return Err(Error::setting(SETTING, text, "each type once, as in 1=Cu,4=Zr"));
                    }
                    named.push((kind.to_string(), element(symbol.trim())?));
                }
                By::Type(named)
            }
            _ => {
                let allowed =
                    "either symbols in the order of the types, Cu,Zr, or a type with each: 1=Cu,4=Zr";
                return Err(Error::setting(SETTING, text, allowed));
            }
        };
        Ok(Self { text: text.to_string(), by })
    }
}

/// The element of that symbol, in any case.
fn element(symbol: &str) -> Result<Element> {
    let known = Element::from_symbol(symbol).filter(|it| it.symbol().eq_ignore_ascii_case(symbol));
    known.ok_or_else(|| {
        let symbols = (1..).map_while(Element::from_number).map(Element::symbol);
        let meant = nearest(symbol, symbols).map_or(String::new(), |it| format!("; did you mean {it}?"));
        Error::setting(SETTING, symbol, format!("symbols of elements with commas, such as Cu,Zr{meant}"))
    })
}

impl TypeElements {
    /// Gives particles the elements of their types. Types that have no name keep what the attribute `element` says, if there is one.
    ///
    /// Fails with [`Error::Setting`] if there are no types, or types that are words are named in order.
    pub fn name(&self, particles: Particles) -> Result<Named> {
        let attribute = self.types(&particles)?;
        let kinds = present(attribute);
        if kinds.len() >= MOST {
            let allowed =
                format!("left out: '{}' has {MOST} values or more, which are no types", attribute.name);
            return Err(Error::setting(SETTING, &self.text, allowed));
        }
        let elements: Vec<Option<Element>> =
            kinds.iter().map(|&kind| self.element(attribute, kind)).collect();
        let old = particles.attribute(ELEMENT).filter(|it| it.components == 1);
        let old = old.and_then(|old| match old.values.view() {
            View::Text { codes, names } => Some((codes, names)),
            _ => None,
        });

        let mut names: Vec<String> = Vec::new();
        let mut code = |word: &str| {
            let known = names.iter().position(|name| name == word);
            known.unwrap_or_else(|| {
                names.push(word.to_string());
                names.len() - 1
            }) as u32
        };
        let of_kinds: Vec<Option<u32>> =
            elements.iter().map(|element| element.map(|it| code(it.symbol()))).collect();
        let is_complete = of_kinds.iter().all(Option::is_some);
        let old = old.filter(|_| !is_complete);
        let of_old: Vec<u32> = old.iter().flat_map(|(_, names)| *names).map(|name| code(name)).collect();
        let none = if is_complete || old.is_some() { 0 } else { code(NONE) };
        let code_of = |id: usize| {
            let kind = kinds.partition_point(|&kind| kind < attribute.number(id, 0) as i64);
            let own = || old.and_then(|(codes, _)| of_old.get(codes[id] as usize).copied());
            of_kinds.get(kind).copied().flatten().or_else(own).unwrap_or(none)
        };
        let codes = (0..particles.len()).into_par_iter().with_min_len(1 << 14).map(code_of).collect();

        let description = self.description(attribute, (&kinds, &elements), old.is_some());
        let lacks = !is_complete && old.is_none();
        let warning = lacks.then(|| self.warning(attribute, (&kinds, &elements)));
        let particles =
            self.replaced(particles, Attribute::new(ELEMENT, 1, Values::Text { codes, names }))?;
        Ok(Named { particles, description, warning })
    }

    /// The attribute of the types that are meant.
    fn types<'a>(&self, particles: &'a Particles) -> Result<&'a Attribute> {
        let refuse = |allowed: String| Err(Error::setting(SETTING, &self.text, allowed));
        let is_words = |it: &&Attribute| matches!(it.values.view(), View::Text { .. });
        let words = || types(particles).chain(particles.attribute(ELEMENT)).find(is_words);
        let numbers = types(particles).find(|it| !is_words(it));
        let are_numbers = match &self.by {
            By::Order(_) => true,
            By::Type(pairs) => pairs.iter().all(|(kind, _)| kind.parse::<i64>().is_ok()),
        };
        match (numbers, words()) {
            (Some(numbers), _) if are_numbers => Ok(numbers),
            (_, Some(words)) if matches!(self.by, By::Type(_)) => Ok(words),
            (None, Some(words)) => {
                let pairs: Vec<String> =
                    present(words).iter().map(|&kind| name(words, kind) + "=…").collect();
                let pairs: Vec<&str> = pairs.iter().map(String::as_str).collect();
                refuse(format!(
                    "for types without order: those of '{}' are words — name each: {}",
                    words.name,
                    list(&pairs)
                ))
            }
            (Some(numbers), _) => {
                let kinds: Vec<String> = present(numbers).iter().map(i64::to_string).collect();
                let kinds: Vec<&str> = kinds.iter().map(String::as_str).collect();
                refuse(format!(
                    "for types that are words: those of '{}' are numbers: {}",
                    numbers.name,
                    list(&kinds)
                ))
            }
            (None, None) => {
                let known: Vec<&str> = particles.attributes().iter().map(|it| it.name.as_str()).collect();
                let known = if known.is_empty() { "none".into() } else { list(&known) };
                refuse(format!(
                    "left out: no whole numbers or words are types (type, typeid, …); the file has: {known} — --columns names columns"
                ))
            }
        }
    }

    /// The element of a value of the attribute.
    fn element(&self, attribute: &Attribute, kind: i64) -> Option<Element> {
        match &self.by {
            By::Order(elements) => {
                let first = i64::from(!attribute.name.eq_ignore_ascii_case(FROM_ZERO));
                elements.get(usize::try_from(kind.checked_sub(first)?).ok()?).copied()
            }
            By::Type(pairs) => {
                let own = name(attribute, kind);
                pairs.iter().find(|(known, _)| *known == own).map(|(_, element)| *element)
            }
        }
    }

    fn description(
        &self,
        attribute: &Attribute,
        (kinds, elements): (&[i64], &[Option<Element>]),
        others_stay: bool,
    ) -> String {
        let pairs: Vec<String> = kinds
            .iter()
            .zip(elements)
            .filter_map(|(&kind, element)| {
                Some(format!("{} {}", name(attribute, kind), (*element)?.symbol()))
            })
            .collect();
        let pairs: Vec<&str> = pairs.iter().map(String::as_str).collect();
        let pairs = if pairs.is_empty() { "of none that is there".into() } else { list(&pairs) };
        let others = if others_stay { ", of others as the file says" } else { "" };
        format!("elements by {}: {pairs}{others}", attribute.name)
    }

    fn warning(&self, attribute: &Attribute, (kinds, elements): (&[i64], &[Option<Element>])) -> String {
        let without = kinds.iter().zip(elements).filter(|(_, element)| element.is_none());
        let without: Vec<String> = without.map(|(&kind, _)| name(attribute, kind)).collect();
        let names: Vec<&str> = without.iter().map(String::as_str).collect();
        format!(
            "{} of {} types have no element, {SETTING} {} does not name them: {}",
            names.len(),
            kinds.len(),
            self.text,
            list(&names)
        )
    }

    /// The particles with this attribute in place of that of its name.
    fn replaced(&self, particles: Particles, attribute: Attribute) -> Result<Particles> {
        if let Some(Radii::PerType { attribute: place, .. }) = particles.radii()
            && particles.attributes()[*place].name.eq_ignore_ascii_case(ELEMENT)
        {
            let allowed = "left out: radii follow the elements that are there — give it to tyndall build, where radii are found";
            return Err(Error::setting(SETTING, &self.text, allowed));
        }
        particles.with_attributes(|it| !it.name.eq_ignore_ascii_case(ELEMENT)).with_attribute(attribute)
    }
}

/// What a type is called: its number or word.
fn name(attribute: &Attribute, kind: i64) -> String {
    match attribute.values.view() {
        View::Text { names, .. } => names.get(kind as usize).cloned().unwrap_or_default(),
        _ => kind.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::particles::Columns;
    use crate::scene::element::Elements;
    use glam::DVec3;

    fn text(name: &str, words: &[&str]) -> Attribute {
        let mut names: Vec<String> = words.iter().map(|it| it.to_string()).collect();
        names.dedup();
        let code = |word: &&str| names.iter().position(|it| it == word).unwrap() as u32;
        let codes = words.iter().map(code).collect();
        Attribute::new(name, 1, Values::Text { codes, names })
    }

    fn numbers(name: &str, values: &[i32]) -> Attribute {
        Attribute::new(name, 1, Values::I32(values.to_vec()))
    }

    fn particles(attributes: Vec<Attribute>) -> Particles {
        let mut columns = Columns { attributes, ..Columns::default() };
        let count = columns.attributes.first().map_or(2, |it| it.values.len());
        columns.positions.extend(&vec![DVec3::ZERO; count]);
        Particles::new(columns).unwrap()
    }

    fn named(text: &str, attributes: Vec<Attribute>) -> std::result::Result<(String, Named), String> {
        let elements: TypeElements = text.parse().map_err(|error: Error| error.to_string())?;
        let named = elements.name(particles(attributes)).map_err(|error| error.to_string())?;
        let element = named.particles.attribute("element").unwrap();
        let View::Text { codes, names } = element.values.view() else { panic!("words") };
        let words: Vec<&str> = codes.iter().map(|&code| names[code as usize].as_str()).collect();
        assert_eq!(named.particles.attributes().iter().filter(|it| it.name == "element").count(), 1);
        Ok((words.join(" "), named))
    }

    #[test]
    fn names_in_order_are_those_of_types_from_1() {
        let (words, named) =
            named("Cu, zr,O", vec![numbers("id", &[7, 8, 9]), numbers("type", &[2, 1, 2])]).unwrap();
        assert_eq!(words, "Zr Cu Zr");
        assert_eq!((named.description.as_str(), named.warning), ("elements by type: 1 Cu, 2 Zr", None));
        assert_eq!(Elements::find(&named.particles).unwrap().known, 1.0);
    }

    #[test]
    fn typeid_counts_from_0_and_other_types_do_not() {
        let of = |name: &str| named("Cu,Zr", vec![numbers(name, &[0, 1])]).unwrap();
        assert_eq!(of("typeid").0, "Cu Zr");
        let (words, named) = of("type");
        assert_eq!(words, "X Cu");
        let warning = "1 of 2 types have no element, --elements Cu,Zr does not name them: 0";
        assert_eq!(named.warning.as_deref(), Some(warning));
    }

    #[test]
    fn pairs_name_types_by_number_or_word() {
        let types = || vec![numbers("type", &[4, 1, 2])];
        let (words, named_by_pairs) = named("1=Cu,4=Zr", types()).unwrap();
        assert_eq!(words, "Zr Cu X");
        assert!(named_by_pairs.warning.is_some_and(|it| it.ends_with(": 2")));
        let hoomd = || vec![text("type", &["A", "B", "A"]), numbers("typeid", &[0, 1, 0])];
        assert_eq!(named("A=Cu,B=Zr", hoomd()).unwrap().0, "Cu Zr Cu");
        assert_eq!(named("0=Cu,1=Zr", hoomd()).unwrap().0, "Cu Zr Cu");
        assert_eq!(named("Cu,Zr", hoomd()).unwrap().0, "Cu Zr Cu");
    }

    #[test]
    fn elements_of_the_file_stay_where_types_are_not_named() {
        let file = || vec![numbers("type", &[1, 2, 3]), text("Element", &["C", "H", "N"])];
        let (words, named_in_part) = named("2=O", file()).unwrap();
        assert_eq!(words, "C O N");
        assert_eq!(named_in_part.description, "elements by type: 2 O, of others as the file says");
        assert_eq!((named("O,O,O", file()).unwrap().0, named_in_part.warning), ("O O O".into(), None));
    }

    #[test]
    fn few_that_are_named_count_where_nothing_else_tells() {
        let (_, named) = named("9=Cu", vec![numbers("type", &[1, 2, 3, 9])]).unwrap();
        let found = Elements::find(&named.particles).unwrap();
        assert_eq!((found.known, found.attribute), (0.25, 1));
    }

    #[test]
    fn what_makes_no_sense_says_what_does() {
        let says = |text: &str, attributes: Vec<Attribute>, parts: &[&str]| {
            let message = named(text, attributes).unwrap_err();
            assert!(parts.iter().all(|part| message.contains(part)), "{message}");
        };
        let types = || vec![numbers("type", &[1, 2])];
        says("Cu,Xx", types(), &["--elements cannot be 'Xx'", "did you mean"]);
        says("Cu,", types(), &["cannot be ''"]);
        says("Cu,2=Zr", types(), &["either symbols in the order"]);
        says("1=Cu,1=Zr", types(), &["each type once"]);
        says("=Cu", types(), &["each type once"]);
        says("A=Cu", types(), &["'type' are numbers: 1, 2"]);
        says("Cu", vec![text("type", &["A", "B"])], &["name each: A=…, B=…"]);
        says(
            "Cu",
            vec![numbers("id", &[1, 2])],
            &["no whole numbers or words are types", "the file has: id"],
        );
        says("Cu", Vec::new(), &["the file has: none"]);
        says("Cu", vec![numbers("type", &(0..2000).collect::<Vec<_>>())], &["1000 values or more"]);
        let radii = Radii::PerType { attribute: 1, radii: vec![1.0] };
        let saved = particles(vec![numbers("type", &[1]), text("element", &["C"])]).with_radii(radii);
        let error = "Cu".parse::<TypeElements>().unwrap().name(saved).unwrap_err().to_string();
        assert!(error.contains("tyndall build"), "{error}");
    }
}
