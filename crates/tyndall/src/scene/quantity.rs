//! A number of every particle, found by name: an attribute, a component or the magnitude of a vector, or a coordinate; or what an
//! expression makes of these.
//!
//! A vector is an attribute with several components, or scalars whose names differ in the axis only (`vx`, `vy`, `vz`).

use glam::DVec3;

use super::expression::{Bound, Tree};
use crate::error::{Error, Result};
use crate::names::nearest;
use crate::particles::{Attribute, Particles};

/// How the names of a vector's components end in files that hold them as scalars.
const SUFFIXES: [[&str; 3]; 7] = [
    ["x", "y", "z"],
    ["_x", "_y", "_z"],
    [".x", ".y", ".z"],
    [":0", ":1", ":2"],
    ["[1]", "[2]", "[3]"],
    ["_0", "_1", "_2"],
    [".0", ".1", ".2"],
];
/// What a velocity is called in the files of the known programs.
const VELOCITIES: [&str; 5] = ["v", "vel", "velocity", "velocities", "u"];

/// Signs that make a text an expression that was meant as one.
const OPERATORS: [char; 11] = ['+', '*', '/', '^', '(', ')', '<', '>', '=', '!', '&'];

/// Which number of a vector is meant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Component {
    /// Its length, in the vector's unit; of a scalar, the absolute value.
    Magnitude,
    /// The component at this place, from 0.
    Index(usize),
}

/// Where the numbers come from.
#[derive(Clone, Debug)]
enum Source<'a> {
    /// One component of an attribute.
    Component(&'a Attribute, usize),
    /// The magnitude of an attribute.
    Magnitude(&'a Attribute),
    /// The magnitude of the vector of these scalars.
    Scalars(Vec<&'a Attribute>),
    /// A coordinate: its axis.
    Coordinate(usize),
    /// The particle's place in its frame.
    Index,
    /// What is made of others.
    Expression(Bound<'a>),
}

/// A number of every particle.
#[derive(Clone, Debug)]
pub struct Quantity<'a> {
    particles: &'a Particles,
    source: Source<'a>,
    label: String,
}

impl<'a> Quantity<'a> {
    /// The quantity of that name. Without a component, a scalar is itself and a vector its magnitude. What is no name is an expression:
    /// `c_pe / mass` (see `docs/expressions.md`), in which a condition is 1 or 0.
    ///
    /// Fails with [`Error::Setting`], which names the nearest attribute and all others, if there is none.
    pub fn find(particles: &'a Particles, name: &str, component: Option<Component>) -> Result<Self> {
        if let Some(found) = Self::of_name(particles, name, component) {
            return Ok(found);
        }
        let label = written(name, component);
        match Tree::parse(&label) {
            Ok(Tree::Name(_)) => Err(unknown(particles, &label)),
            Err(_) if !label.contains(OPERATORS) => Err(unknown(particles, &label)),
            Ok(tree) => match Bound::new(&tree, particles) {
                Ok(bound) => Ok(Self { particles, source: Source::Expression(bound), label }),
                Err(why) => Err(Error::setting("--color", label, why)),
            },
            Err(why) => Err(Error::setting("--color", label, why)),
        }
    }

    /// The same, of names alone.
    pub(super) fn of_name(
        particles: &'a Particles,
        name: &str,
        component: Option<Component>,
    ) -> Option<Self> {
        let found = match component {
            None => plain(particles, name),
            Some(Component::Magnitude) => {
                vector(particles, name).or_else(|| particles.attribute(name).map(Source::Magnitude))
            }
            Some(Component::Index(place)) => component_of(particles, name, place),
        };
        let source = found?;
        let label = match &source {
            Source::Component(attribute, place) if attribute.components > 1 => {
                format!("{}.{}", attribute.name, "xyz".get(*place..place + 1).unwrap_or("?"))
            }
            Source::Component(attribute, _) => attribute.name.clone(),
            Source::Magnitude(attribute) => format!("|{}|", attribute.name),
            Source::Scalars(_) => format!("|{name}|"),
            Source::Coordinate(axis) => "xyz"[*axis..axis + 1].into(),
            Source::Index => "index".into(),
            Source::Expression(_) => name.into(),
        };
        Some(Self { particles, source, label })
    }

    /// The components of the vector that `text` names, in their order; else the one quantity that it stands for. Fails as [`Self::find`] does.
    pub fn components(particles: &'a Particles, text: &str) -> Result<Vec<Self>> {
        let (name, component) = named(text);
        let part = |axis| Self::of_name(particles, name, Some(Component::Index(axis)));
        let parts: Vec<Self> = if component.is_none() { (0..).map_while(part).collect() } else { Vec::new() };
        if parts.len() > 1 { Ok(parts) } else { Ok(vec![Self::find(particles, name, component)?]) }
    }

    /// The number of particle `id`; NaN where the file has none.
    #[inline]
    pub fn value(&self, id: usize) -> f64 {
        match &self.source {
            Source::Component(attribute, place) => attribute.number(id, *place),
            Source::Magnitude(attribute) => {
                (0..attribute.components).map(|place| attribute.number(id, place).powi(2)).sum::<f64>().sqrt()
            }
            Source::Scalars(columns) => columns.iter().map(|it| it.number(id, 0).powi(2)).sum::<f64>().sqrt(),
            Source::Coordinate(axis) => self.particles.positions().world(id)[*axis],
            Source::Index => self.particles.place(id) as f64,
            Source::Expression(bound) => bound.value(id),
        }
    }

    /// Its name for people: `c_pe`, `|v|`, `Vel.x`; of an expression its text.
    pub fn label(&self) -> &str {
        &self.label
    }

    /// Its unit, where the file or its format tells; that of an expression is not known.
    pub fn unit(&self) -> Option<&str> {
        match &self.source {
            Source::Component(attribute, _) | Source::Magnitude(attribute) => attribute.unit.as_deref(),
            Source::Scalars(columns) => {
                let unit = columns.first()?.unit.as_deref();
                unit.filter(|_| columns.iter().all(|it| it.unit.as_deref() == unit))
            }
            Source::Coordinate(_) => self.particles.length_unit(),
            Source::Index | Source::Expression(_) => None,
        }
    }

    /// The attribute, if the quantity is one scalar attribute as it stands in the file.
    pub fn scalar(&self) -> Option<&'a Attribute> {
        match self.source {
            Source::Component(attribute, _) if attribute.components == 1 => Some(attribute),
            _ => None,
        }
    }

    /// The attributes that decide about it: those that it is made of, and of a vector's component the others. An expression names its own.
    pub(super) fn attributes(&self) -> Vec<&'a Attribute> {
        let mut found = match &self.source {
            Source::Component(attribute, _) | Source::Magnitude(attribute) => vec![*attribute],
            Source::Scalars(columns) => columns.clone(),
            Source::Coordinate(_) | Source::Index | Source::Expression(_) => Vec::new(),
        };
        let names: Vec<&str> = found.iter().map(|it| it.name.as_str()).collect();
        for (stem, _) in names.into_iter().flat_map(stems) {
            found.extend(scalars(self.particles, stem).unwrap_or_default());
        }
        found
    }

    /// Whether this is a component of a vector, which has a sign.
    pub fn is_component(&self) -> bool {
        match &self.source {
            Source::Component(attribute, _) if attribute.components > 1 => true,
            Source::Component(attribute, _) => stems(&attribute.name)
                .any(|(stem, _)| scalars(self.particles, stem).is_some_and(|columns| columns.len() > 1)),
            _ => false,
        }
    }
}

fn plain<'a>(particles: &'a Particles, name: &str) -> Option<Source<'a>> {
    if let Some(attribute) = particles.attribute(name) {
        let scalar = attribute.components == 1;
        return Some(if scalar { Source::Component(attribute, 0) } else { Source::Magnitude(attribute) });
    }
    let axis = ["x", "y", "z"].iter().position(|axis| axis.eq_ignore_ascii_case(name));
    let component = || stems(name).find_map(|(stem, place)| component_of(particles, stem, place));
    let index = || name.eq_ignore_ascii_case("index").then_some(Source::Index);
    axis.map(Source::Coordinate).or_else(|| vector(particles, name)).or_else(component).or_else(index)
}

/// The vector of that name; any name of a velocity means the one that the file has.
fn vector<'a>(particles: &'a Particles, name: &str) -> Option<Source<'a>> {
    spellings(name).find_map(|name| {
        let attribute = particles.attribute(name).filter(|it| it.components > 1).map(Source::Magnitude);
        attribute.or_else(|| scalars(particles, name).map(Source::Scalars))
    })
}

fn component_of<'a>(particles: &'a Particles, name: &str, place: usize) -> Option<Source<'a>> {
    spellings(name).find_map(|name| {
        if let Some(attribute) = particles.attribute(name).filter(|it| place < it.components) {
            return Some(Source::Component(attribute, place));
        }
        let ends = SUFFIXES.iter().filter_map(|ends| ends.get(place));
        let found = ends.filter_map(|end| particles.attribute(&format!("{name}{end}")));
        found.into_iter().find(|it| it.components == 1).map(|attribute| Source::Component(attribute, 0))
    })
}

/// The scalars that are the components of the vector `name`: two or three.
fn scalars<'a>(particles: &'a Particles, name: &str) -> Option<Vec<&'a Attribute>> {
    SUFFIXES.iter().find_map(|ends| {
        let scalar =
            |end: &&str| particles.attribute(&format!("{name}{end}")).filter(|it| it.components == 1);
        let columns: Vec<_> = ends.iter().map_while(scalar).collect();
        (columns.len() >= 2).then_some(columns)
    })
}

/// The vector called `name`, of two or three numbers, by id. Fails with [`Error::Setting`] of `setting` if there is none.
pub(super) fn vector_by_id<'a>(
    particles: &'a Particles,
    setting: &'static str,
    name: &str,
) -> Result<impl Fn(usize) -> DVec3 + Sync + use<'a>> {
    let component = |place| Quantity::of_name(particles, name, Some(Component::Index(place)));
    let [Some(x), Some(y), z] = [0, 1, 2].map(component) else {
        let there = match vectors(particles)[..] {
            [] => "the file has none".to_string(),
            ref all => format!("the file has: {}", all.join(", ")),
        };
        let allowed = format!("a vector attribute — {there}{}", meant_vector(particles, name));
        return Err(Error::setting(setting, name, allowed));
    };
    Ok(move |id| DVec3::new(x.value(id), y.value(id), z.as_ref().map_or(0.0, |z| z.value(id))))
}

/// The question whether another vector was meant, if one is called alike.
pub(super) fn meant_vector(particles: &Particles, name: &str) -> String {
    let all = vectors(particles);
    let meant = nearest(name, all.iter().map(String::as_str));
    meant.map_or(String::new(), |meant| format!("; did you mean '{meant}'?"))
}

/// The names of all vectors of two or three numbers.
fn vectors(particles: &Particles) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for attribute in particles.attributes() {
        let own = (2..=3).contains(&attribute.components).then_some(attribute.name.as_str());
        let stem =
            || stems(&attribute.name).map(|(stem, _)| stem).find(|stem| scalars(particles, stem).is_some());
        let is_scalar = attribute.components == 1;
        if let Some(name) = own.or_else(|| stem().filter(|_| is_scalar))
            && !names.iter().any(|known| known == name)
        {
            names.push(name.into());
        }
    }
    names
}

/// The name, and if it is one of a velocity, its other names.
fn spellings(name: &str) -> impl Iterator<Item = &str> {
    let velocity = VELOCITIES.iter().any(|known| known.eq_ignore_ascii_case(name));
    let others = if velocity { &VELOCITIES[..] } else { &[] };
    std::iter::once(name).chain(others.iter().copied())
}

/// The vectors that `name` may be a component of, and which: `vx` is component 0 of `v`.
fn stems(name: &str) -> impl Iterator<Item = (&str, usize)> {
    SUFFIXES.iter().flat_map(move |ends| {
        let found = ends.iter().enumerate().find_map(|(place, end)| Some((name.strip_suffix(end)?, place)));
        found.filter(|(stem, _)| !stem.is_empty())
    })
}

/// What is written as `v`, `|v|`, `v.x` or `v.1` (components count from 0): a name, and which number of a vector.
pub(super) fn named(text: &str) -> (&str, Option<Component>) {
    if let Some(name) = text.strip_prefix('|').and_then(|rest| rest.strip_suffix('|')) {
        return (name.trim(), Some(Component::Magnitude));
    }
    // The decimals of a number in an expression are no component.
    let is_number = |name: &str| name.contains(OPERATORS) && name.ends_with(|it: char| it.is_ascii_digit());
    let parts = text.rsplit_once('.').filter(|(name, _)| !name.is_empty() && !is_number(name));
    if let Some((name, end)) = parts {
        let axis = ["x", "y", "z"].iter().position(|axis| axis.eq_ignore_ascii_case(end));
        if let Some(place) = axis.or_else(|| end.parse().ok()) {
            return (name, Some(Component::Index(place)));
        }
    }
    (text, None)
}

/// The quantity as people write it.
pub(super) fn written(name: &str, component: Option<Component>) -> String {
    match component {
        None => name.into(),
        Some(Component::Magnitude) => format!("|{name}|"),
        Some(Component::Index(place)) => format!("{name}.{place}"),
    }
}

/// The error about an attribute that the particles do not have.
pub(crate) fn unknown(particles: &Particles, name: &str) -> Error {
    let names = || particles.attributes().iter().map(|attribute| attribute.name.as_str());
    let meant = nearest(name, names()).map_or(String::new(), |meant| format!(" did you mean '{meant}'?"));
    let mut all: Vec<&str> = names().collect();
    all.extend(["x", "y", "z"]);
    Error::setting("--color", name, format!("no attribute '{name}';{meant} available: {}", all.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::particles::{Columns, Values};
    use glam::DVec3;

    fn particles(attributes: Vec<Attribute>) -> Particles {
        let mut columns = Columns::default();
        columns.positions.extend(&[DVec3::new(7.0, 8.0, 9.0)]);
        columns.attributes = attributes;
        Particles::new(columns).unwrap()
    }

    fn scalar(name: &str, value: f32) -> Attribute {
        Attribute::new(name, 1, Values::F32(vec![value]))
    }

    fn value(particles: &Particles, name: &str, component: Option<Component>) -> Option<f64> {
        Quantity::find(particles, name, component).ok().map(|quantity| quantity.value(0))
    }

    #[test]
    fn scalars_named_like_components_are_a_vector() {
        for names in [["vx", "vy", "vz"], ["v_x", "v_y", "v_z"], ["Vel:0", "Vel:1", "Vel:2"]] {
            let it = particles(vec![scalar(names[0], -2.0), scalar(names[1], 3.0), scalar(names[2], 6.0)]);
            assert_eq!(value(&it, "v", None), Some(7.0), "{names:?}");
            assert_eq!(value(&it, "v", Some(Component::Magnitude)), Some(7.0));
            assert_eq!(value(&it, "vel", Some(Component::Index(1))), Some(3.0));
            assert_eq!(value(&it, "v", Some(Component::Index(3))), None);
            assert_eq!(value(&it, names[0], None), Some(-2.0));
            assert!(Quantity::find(&it, names[0], None).unwrap().is_component());
        }
    }

    #[test]
    fn an_attribute_with_components_is_a_vector() {
        let it = particles(vec![
            Attribute::new("Velocity", 3, Values::F64(vec![-2.0, 3.0, 6.0])),
            scalar("q", -1.0),
        ]);
        assert_eq!(value(&it, "velocity", None), Some(7.0));
        assert_eq!(value(&it, "vx", None), Some(-2.0));
        assert_eq!(value(&it, "v", Some(Component::Index(2))), Some(6.0));
        assert_eq!(value(&it, "q", Some(Component::Magnitude)), Some(1.0));
        assert_eq!(value(&it, "q", Some(Component::Index(0))), Some(-1.0));
        assert_eq!(Quantity::find(&it, "vx", None).unwrap().label(), "Velocity.x");
        assert!(!Quantity::find(&it, "q", None).unwrap().is_component());
    }

    #[test]
    fn a_vector_has_components_and_a_scalar_is_one() {
        let velocity = Attribute::new("Velocity", 3, Values::F64(vec![-2.0, 3.0, 6.0]));
        let it = particles(vec![velocity, scalar("fx", 4.0), scalar("fy", 5.0), scalar("q", -1.0)]);
        let values = |text: &str| -> Vec<f64> {
            Quantity::components(&it, text).unwrap().iter().map(|part| part.value(0)).collect()
        };
        assert_eq!(values("velocity"), [-2.0, 3.0, 6.0]);
        assert_eq!(values("f"), [4.0, 5.0]);
        for (text, value) in
            [("|Velocity|", 7.0), ("v.y", 3.0), ("fx", 4.0), ("q", -1.0), ("y", 8.0), ("q * fy", -5.0)]
        {
            assert_eq!(values(text), [value], "{text}");
        }
        assert!(Quantity::components(&it, "g").is_err());
    }

    #[test]
    fn coordinates_are_quantities_unless_an_attribute_has_the_name() {
        let it = particles(vec![scalar("z", 0.5)]);
        assert_eq!(
            (value(&it, "x", None), value(&it, "Y", None), value(&it, "z", None)),
            (Some(7.0), Some(8.0), Some(0.5))
        );
    }

    #[test]
    fn an_unknown_name_is_answered_with_the_nearest() {
        let it = particles(vec![scalar("Densities", 1.0), scalar("Temperatures", 2.0)]);
        let message = Quantity::find(&it, "temp", None).unwrap_err().to_string();
        let wanted =
            "no attribute 'temp'; did you mean 'Temperatures'? available: Densities, Temperatures, x, y, z";
        assert!(message.ends_with(wanted), "{message}");
        let message = Quantity::find(&it, "q", None).unwrap_err().to_string();
        assert!(
            message.ends_with("no attribute 'q'; available: Densities, Temperatures, x, y, z"),
            "{message}"
        );
    }
}
