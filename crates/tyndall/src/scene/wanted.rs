//! Which attributes a picture looks at, so that a reader can leave the others out.
//!
//! Takes the choices that name quantities and what a file offers, gives a flag for each attribute. Invariant: with the flagged ones
//! alone radii, colors and filters are found as with all of them; where a choice names nothing that is offered, all are flagged, so
//! that the message about it can list them.

use super::color::is_geometry;
use super::coloring::Coloring;
use super::expression::Tree;
use super::kinds::TYPE_NAMES;
use super::quantity::{Component, Quantity, named, written};
use super::select::Filter;
use super::{element, ellipsoids, rgb};
use crate::particles::{Attribute, Columns, Particles, Values, is_radius};

/// What a picture is made of.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Wanted {
    /// Where colors come from.
    pub coloring: Coloring,
    /// Which particles are shown.
    pub filters: Vec<Filter>,
    /// Other quantities that are looked at.
    pub quantities: Vec<String>,
    /// Whether radii are those of the elements where the file has none.
    pub radii: bool,
    /// Vectors and tensors that are drawn.
    pub vectors: Vec<String>,
    /// Names that one attribute may have, in any case, of each that is looked at: all of them are wanted that there are.
    pub one_of: Vec<Vec<String>>,
    /// The same of attributes that need not be there.
    pub optional: Vec<String>,
}

/// An attribute that a file has.
#[derive(Clone, Debug, PartialEq)]
pub struct Offered<'a> {
    /// Its name.
    pub name: &'a str,
    /// Values a particle.
    pub components: usize,
    /// Whether it may hold numbers that are not whole.
    pub is_measured: bool,
}

impl Wanted {
    /// The same with what tells the elements of types.
    pub fn with_types(mut self) -> Self {
        self.one_of.push(TYPE_NAMES.iter().chain(&["element"]).map(|it| it.to_string()).collect());
        self
    }

    /// Which of the attributes a picture looks at.
    pub fn flags(&self, offered: &[Offered]) -> Vec<bool> {
        let attribute = |it: &Offered| {
            let values = if it.is_measured { Values::F32(Vec::new()) } else { Values::I32(Vec::new()) };
            Attribute::new(it.name, it.components, values)
        };
        let attributes = offered.iter().map(attribute).collect();
        let Ok(empty) = Particles::new(Columns { attributes, ..Columns::default() }) else {
            return vec![true; offered.len()];
        };
        let mut flags: Vec<bool> = offered.iter().map(|it| is_radius(it.name)).collect();
        if self.radii {
            flag(&mut flags, offered, element::is_named);
        }
        let mut found = true;
        match &self.coloring {
            Coloring::Constant(_) => {}
            Coloring::Element => flag(&mut flags, offered, element::is_named),
            Coloring::Type => flag(&mut flags, offered, is_type),
            Coloring::Attribute { name, component } => {
                found &= flag_text(&mut flags, offered, &empty, &written(name, *component));
            }
            Coloring::Auto => {
                flag(&mut flags, offered, |name| {
                    element::is_named(name) || is_type(name) || rgb::is_named(name)
                });
                for (flag, it) in flags.iter_mut().zip(offered) {
                    let scalar = it.is_measured && it.components == 1 && !is_geometry(it.name);
                    let quantity = Quantity::find(&empty, it.name, None);
                    *flag |= scalar && quantity.is_ok_and(|it| !it.is_component());
                }
            }
        }
        let quantities = self.quantities.iter().map(String::as_str);
        for text in self.filters.iter().map(Filter::quantity).chain(quantities) {
            found &= flag_text(&mut flags, offered, &empty, text);
        }
        for name in &self.vectors {
            if let Some(used) = ellipsoids::tensor_attributes(&empty, name) {
                let used_by = |it: &Attribute| used.iter().any(|used| std::ptr::eq(*used, it));
                flags.iter_mut().zip(empty.attributes()).for_each(|(flag, it)| *flag |= used_by(it));
                continue;
            }
            let mut flag_axis =
                |axis| flag_text(&mut flags, offered, &empty, &written(name, Some(Component::Index(axis))));
            // All three are flagged; in the plane there are two.
            found &= [0, 1, 2].map(&mut flag_axis)[..2] == [true; 2];
        }
        flag(&mut flags, offered, ellipsoids::is_named);
        let is_among = |names: &[String], name: &str| names.iter().any(|it| it.eq_ignore_ascii_case(name));
        for names in &self.one_of {
            flag(&mut flags, offered, |name| is_among(names, name));
            found &= offered.iter().any(|it| is_among(names, it.name));
        }
        flag(&mut flags, offered, |name| is_among(&self.optional, name));
        if found { flags } else { vec![true; offered.len()] }
    }
}

/// Flags the attributes whose names have a property.
fn flag(flags: &mut [bool], offered: &[Offered], is_named: impl Fn(&str) -> bool) {
    flags.iter_mut().zip(offered).for_each(|(flag, it)| *flag |= is_named(it.name));
}

/// Flags what a text is made of: a quantity, or the names in an expression. Says whether all is offered; a name that may be a word need not be.
fn flag_text(flags: &mut [bool], offered: &[Offered], empty: &Particles, text: &str) -> bool {
    let (name, component) = named(text);
    match name.to_ascii_lowercase().as_str() {
        "element" => {
            flag(flags, offered, element::is_named);
            return true;
        }
        "type" => {
            flag(flags, offered, is_type);
            return true;
        }
        _ => {}
    }
    if let Some(quantity) = Quantity::of_name(empty, name, component) {
        let used = quantity.attributes();
        for (flag, attribute) in flags.iter_mut().zip(empty.attributes()) {
            // Names may come twice: the first one is found.
            *flag |= used.iter().any(|it| std::ptr::eq(*it, attribute));
        }
        return true;
    }
    match Tree::parse(text) {
        Ok(Tree::Name(_)) | Err(_) => false,
        Ok(tree) => {
            let mut flag_name = |(name, may_be_word)| flag_text(flags, offered, empty, name) || may_be_word;
            // All are flagged, also after one that is not offered.
            tree.names().into_iter().filter(|it| !flag_name(*it)).count() == 0
        }
    }
}

fn is_type(name: &str) -> bool {
    TYPE_NAMES.iter().any(|known| known.eq_ignore_ascii_case(name))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kept(coloring: &str, filters: &[&str], names: &str) -> String {
        let offered: Vec<Offered> = names
            .split(' ')
            .map(|name| Offered { name, components: 1, is_measured: !["id", "type", "mol"].contains(&name) })
            .collect();
        let wanted = Wanted {
            coloring: coloring.parse().unwrap(),
            filters: filters.iter().map(|it| it.parse().unwrap()).collect(),
            radii: true,
            ..Wanted::default()
        };
        flagged(&wanted, &offered)
    }

    fn flagged(wanted: &Wanted, offered: &[Offered]) -> String {
        let flags = wanted.flags(offered);
        offered.iter().zip(flags).filter(|it| it.1).map(|it| it.0.name).collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn of_several_names_those_are_wanted_that_there_are() {
        let offered = |names: &'static str| -> Vec<Offered> {
            names.split(' ').map(|name| Offered { name, components: 1, is_measured: true }).collect()
        };
        let names = |text: &str| text.split(' ').map(String::from).collect::<Vec<_>>();
        let wanted = Wanted {
            coloring: Coloring::Constant([0.0; 3]),
            one_of: vec![names("mass m"), names("T temp")],
            optional: names("h hsml"),
            ..Wanted::default()
        };
        assert_eq!(flagged(&wanted, &offered("id Mass q T u")), "Mass T");
        assert_eq!(flagged(&wanted, &offered("m q temp T h")), "m temp T h");
        assert_eq!(flagged(&wanted, &offered("id m q")), "id m q", "all, so that a message can list them");
    }

    #[test]
    fn types_are_wanted_where_elements_go_by_them() {
        let offered = |names: &'static str| -> Vec<Offered> {
            names.split(' ').map(|name| Offered { name, components: 1, is_measured: false }).collect()
        };
        let wanted = Wanted { coloring: Coloring::Constant([0.0; 3]), ..Wanted::default() }.with_types();
        assert_eq!(flagged(&wanted, &offered("id typeid q element")), "typeid element");
        assert_eq!(flagged(&wanted, &offered("id q")), "id q", "all, so that a message can list them");
    }

    #[test]
    fn a_picture_looks_at_kinds_radii_and_what_is_named() {
        let names = "id mol type element vx vy vz radius q c_pe";
        assert_eq!(kept("auto", &[], names), "type element radius q c_pe");
        assert_eq!(kept("#fff", &[], names), "type element radius");
        assert_eq!(kept("c_pe", &["q=0:"], names), "type element radius q c_pe");
        assert_eq!(kept("type", &["mol=1"], names), "mol type element radius");
        assert_eq!(kept("c_pe / q", &["index=0:"], names), "type element radius q c_pe");
        assert_eq!(kept("element == O and mol != 3", &[], names), "mol type element radius");
        assert_eq!(kept("c_pe + w", &[], names), names);
    }

    #[test]
    fn a_component_comes_with_its_vector() {
        // That there is a vy makes vx a component, whose colors are centered on zero.
        assert_eq!(kept("vx", &[], "id vx vy vz q"), "vx vy vz");
        assert_eq!(kept("v", &[], "id vx vy vz q"), "vx vy vz");
        assert_eq!(kept("#fff", &["velocity.y=0:"], "id vx vy vz q"), "vx vy vz");
        assert_eq!(kept("x", &[], "id q"), "");
    }

    #[test]
    fn what_is_not_offered_keeps_all_for_the_message() {
        assert_eq!(kept("temp", &[], "id q vx"), "id q vx");
        assert_eq!(kept("q", &["temp=3"], "id q vx"), "id q vx");
    }
}
