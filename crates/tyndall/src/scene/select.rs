//! What a user asks to see of the particles, and how it is written: `c_pe=-4.2:-3.1`, `type=1,3`, `z<0.5L`, `plane 0,0,0 0,1,0`.
//!
//! A [`Filter`] asks for a quantity of the particle, a [`Clip`] for the place of its center: a particle is shown as a whole or not at
//! all. What filters ask for is kept as [`Selectable`] before the particles are arranged, so that filters can change afterwards.

use std::fmt;
use std::str::FromStr;

use glam::DVec3;

use super::Scene;
use super::expression::{Tree, Wanted};
use super::meaning::{LISTED, Meaning, list, no_word};
use super::statistics::short;
use super::viewpoint::point;
use crate::error::{Error, Result};
use crate::particles::Particles;
use crate::structure::selection::{Column, HalfSpace, Numbers, Rule};

/// Particles are shown whose quantity has one of some values, or lies in one of some ranges.
#[derive(Clone, Debug, PartialEq)]
pub struct Filter {
    /// The setting that it was given by.
    setting: &'static str,
    text: String,
    quantity: String,
    wanted: Vec<Wanted>,
}

impl FromStr for Filter {
    type Err = Error;

    /// Reads `QUANTITY=VALUE,...`: values are numbers, words, or ranges `LOW:HIGH` with both ends in them, of which one may be left out.
    /// Quantities are written as colors are: an attribute, `v.x`, `|v|`, `x`, `type`, `element`.
    fn from_str(text: &str) -> Result<Self> {
        let wrong = |what: &str| {
            let allowed = "NAME=LOW:HIGH or NAME=VALUE,VALUE, such as c_pe=-4.2:-3.1, v.x=0:, type=1,3";
            Error::setting("--filter", text, format!("{what}; a filter is {allowed}"))
        };
        let (quantity, values) = text.split_once('=').ok_or_else(|| wrong("there is no '='"))?;
        let quantity = quantity.trim();
        if quantity.is_empty() {
            return Err(wrong("no quantity is named"));
        }
        let wanted = |value: &str| match interval(value) {
            _ if value.is_empty() => Err(wrong("a value is missing")),
            Some([low, high]) if low > high => Err(wrong("a range ends before it begins")),
            interval => Ok(Wanted { text: value.into(), interval }),
        };
        let wanted = values.split(',').map(str::trim).map(wanted).collect::<Result<_>>()?;
        Ok(Self { setting: "--filter", text: text.trim().into(), quantity: quantity.into(), wanted })
    }
}

/// A number, or `LOW:HIGH`, as an interval; none if it is neither.
fn interval(text: &str) -> Option<[f64; 2]> {
    let number = |text: &str| text.trim().parse().ok().filter(|it: &f64| !it.is_nan());
    match text.split_once(':') {
        None => number(text).map(|it| [it; 2]),
        Some((low, high)) => {
            let end = |text: &str, open: f64| if text.trim().is_empty() { Some(open) } else { number(text) };
            Some([end(low, f64::NEG_INFINITY)?, end(high, f64::INFINITY)?])
        }
    }
}

impl fmt::Display for Filter {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl Filter {
    /// Of a condition in the language of expressions: `element == O and z > 2`. Fails with [`Error::Setting`] if it is none.
    pub fn condition(text: &str) -> Result<Self> {
        let text = text.trim();
        let wrong = |why: String| Error::setting("--select", text, why);
        if !Tree::parse(text).map_err(wrong)?.is_condition() {
            return Err(wrong("it is true or false for no particle: compare numbers, as in c_pe > 0".into()));
        }
        let wanted = vec![Wanted { text: "true".into(), interval: Some([1.0; 2]) }];
        Ok(Self { setting: "--select", text: text.into(), quantity: text.into(), wanted })
    }

    /// The quantity, as it is written.
    pub fn quantity(&self) -> &str {
        &self.quantity
    }

    /// The filter in a sentence.
    pub(super) fn named(&self) -> String {
        format!("the {} '{self}'", if self.setting == "--select" { "selection" } else { "filter" })
    }

    /// The wanted intervals, where words stand for their places in `words`.
    fn intervals(&self, words: &[String]) -> Result<Vec<[f64; 2]>> {
        let interval = |wanted: &Wanted| {
            let same = |word: &&String| **word == wanted.text;
            let similar = |word: &&String| word.eq_ignore_ascii_case(&wanted.text);
            let place = |word: &String| words.iter().position(|it| it == word);
            let word = words.iter().find(same).or_else(|| words.iter().find(similar)).and_then(place);
            let number = wanted.interval.filter(|_| words.is_empty());
            number.or(word.map(|place| [place as f64; 2])).ok_or_else(|| {
                let Self { setting, text, quantity, .. } = self;
                let what = match words {
                    [] => format!("'{}' is no number, and {quantity} has numbers", wanted.text),
                    _ => {
                        no_word(&wanted.text, quantity, &words.iter().map(String::as_str).collect::<Vec<_>>())
                    }
                };
                Error::setting(*setting, text, what)
            })
        };
        self.wanted.iter().map(interval).collect()
    }
}

/// A quantity that filters can ask for after the particles were arranged.
pub struct Selectable<N = Numbers> {
    name: String,
    numbers: N,
    /// What the numbers stand for, where they are places of words.
    words: Vec<String>,
    /// Of a condition that nothing fulfills, what there is of the quantities in it.
    present: Option<String>,
}

impl Selectable {
    /// What `filter` asks for. Fails as [`super::quantity::Quantity::find`] does, and if a word is none of the quantity's.
    pub fn of(particles: &Particles, filter: &Filter) -> Result<Self> {
        let mut found = Self::find(particles, &filter.quantity).map_err(|error| match error {
            Error::Setting { allowed, .. } => Error::setting(filter.setting, filter, allowed),
            other => other,
        })?;
        filter.intervals(&found.words)?;
        if filter.setting == "--select" && !found.numbers.map(|number| number == 1.0).contains(&true) {
            found.present = Some(present(particles, &filter.quantity));
        }
        Ok(found)
    }

    /// The quantity called `name`.
    pub fn find(particles: &Particles, name: &str) -> Result<Self> {
        let count = particles.len();
        let (numbers, words) = match Meaning::of(particles, name)? {
            Meaning::Number(quantity) => (Numbers::collect(count, |id| quantity.value(id)), Vec::new()),
            Meaning::Word(words) => {
                let list = words.list().into_iter().map(String::from).collect();
                (Numbers::collect(count, words.places()), list)
            }
        };
        Ok(Self { name: name.into(), numbers, words, present: None })
    }
}

impl Selectable {
    /// Which particles, by id, a filter of this quantity keeps.
    pub(super) fn flags(&self, filter: &Filter) -> Result<Vec<bool>> {
        let intervals = filter.intervals(&self.words)?;
        Ok(self.numbers.map(|number| intervals.iter().any(|[low, high]| (*low..=*high).contains(&number))))
    }
}

/// What there is of the quantities in a text.
pub(super) fn present(particles: &Particles, text: &str) -> String {
    let tree = Tree::parse(text);
    let mut names = tree.as_ref().map_or(Vec::new(), Tree::names);
    names.dedup();
    let ids: Vec<u32> = (0..particles.len() as u32).collect();
    let found = names.into_iter().filter_map(|(name, _)| {
        let Selectable { name, numbers, words, present } = Selectable::find(particles, name).ok()?;
        Some(Selectable { name, numbers: Column::new(&numbers, &ids), words, present }.present())
    });
    found.collect::<Vec<_>>().join("; ")
}

impl Selectable<Column> {
    /// What there is, for people.
    fn present(&self) -> String {
        if let Some(present) = &self.present {
            return present.clone();
        }
        match (self.numbers.values(), self.numbers.span()) {
            (Some(values), Some(_)) if values.len() <= LISTED => {
                let word = |value: &f64| self.words.get(*value as usize).cloned();
                let words = values.iter().map(|value| word(value).unwrap_or_else(|| short(*value)));
                format!("{} has {}", self.name, words.collect::<Vec<_>>().join(", "))
            }
            (_, Some(_)) if !self.words.is_empty() => {
                format!(
                    "{} has {}",
                    self.name,
                    list(&self.words.iter().map(String::as_str).collect::<Vec<_>>())
                )
            }
            (_, Some([low, high])) => format!("{} spans {}:{}", self.name, short(low), short(high)),
            (_, None) => format!("{} is missing everywhere", self.name),
        }
    }
}

/// Particles are shown whose center lies on one side of a plane, or in a box.
#[derive(Clone, Debug, PartialEq)]
pub struct Clip {
    text: String,
    shape: Shape,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Shape {
    /// Below (1) or above (-1) a coordinate, which may be a share of the cell's extent.
    Axis { axis: usize, sign: f64, at: f64, of_cell: bool },
    /// On the side of a plane from which the normal points away.
    Plane { point: DVec3, normal: DVec3 },
    /// In a box, by two corners.
    Box([DVec3; 2]),
}

impl FromStr for Clip {
    type Err = Error;

    /// Reads `z<10`, `x>0.5L` (in extents of the cell), `plane X,Y,Z NX,NY,NZ` (a point and the normal; what the normal points to is cut
    /// away), `box X,Y,Z X,Y,Z` (two corners; what is outside is cut away).
    fn from_str(text: &str) -> Result<Self> {
        let shape = shape(text.trim()).ok_or_else(|| {
            let allowed = "what is kept: x<NUMBER or x>NUMBER for x, y or z, in the file's unit or with L in sizes of the cell (z<0.5L); \
                           'plane X,Y,Z NX,NY,NZ', a point and the normal of what is cut away; or 'box X,Y,Z X,Y,Z', two corners";
            Error::setting("--clip", text, allowed)
        })?;
        Ok(Self { text: text.trim().into(), shape })
    }
}

impl fmt::Display for Clip {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&self.text)
    }
}

fn shape(text: &str) -> Option<Shape> {
    if let Some((axis, at)) = text.split_once(['<', '>']) {
        let axis = ["x", "y", "z"].iter().position(|it| it.eq_ignore_ascii_case(axis.trim()))?;
        let sign = if text.contains('<') { 1.0 } else { -1.0 };
        let number = at.trim().trim_end_matches('L').trim_end();
        let at = (number, at.trim_end().ends_with('L'));
        return Some(Shape::Axis { axis, sign, at: finite(at.0)?, of_cell: at.1 });
    }
    let mut words = text.split_whitespace();
    let (kind, first, second) = (words.next()?, point(words.next()?)?, point(words.next()?)?);
    match kind {
        _ if words.next().is_some() => None,
        "plane" if second != DVec3::ZERO => Some(Shape::Plane { point: first, normal: second.normalize() }),
        "box" => Some(Shape::Box([first.min(second), first.max(second)])),
        _ => None,
    }
}

fn finite(text: &str) -> Option<f64> {
    text.trim().parse().ok().filter(|it: &f64| it.is_finite())
}

impl Clip {
    /// Whether it is measured by the particles' cell, or where they have none, by where they are.
    pub fn is_share(&self) -> bool {
        matches!(self.shape, Shape::Axis { of_cell: true, .. })
    }

    /// What is kept lies in all of these. A size that is meant as a share is one of the particles' cell, or if they have none, of the box
    /// around their centers.
    pub fn half_spaces(&self, particles: &Particles) -> Vec<HalfSpace> {
        let unit = |axis: usize, sign: f64| DVec3::AXES[axis] * sign;
        match self.shape {
            Shape::Plane { point, normal } => vec![HalfSpace { normal, distance: normal.dot(point) }],
            Shape::Axis { axis, sign, at, of_cell } => {
                let [low, high] = if of_cell { cell_of(particles, axis) } else { [0.0, 1.0] };
                vec![HalfSpace { normal: unit(axis, sign), distance: sign * (low + at * (high - low)) }]
            }
            Shape::Box([min, max]) => {
                let sides = [(1.0, max), (-1.0, min)];
                let sides = (0..3).flat_map(|axis| sides.map(|(sign, corner)| (axis, sign, corner)));
                let side = |(axis, sign, corner): (usize, f64, DVec3)| HalfSpace {
                    normal: unit(axis, sign),
                    distance: sign * corner[axis],
                };
                sides.map(side).collect()
            }
        }
    }
}

/// The least and the greatest coordinate of the cell, or without a cell of the centers.
fn cell_of(particles: &Particles, axis: usize) -> [f64; 2] {
    match particles.cell() {
        Some(cell) => {
            let corners = cell.corners().map(|corner| corner[axis]);
            [
                corners.into_iter().fold(f64::INFINITY, f64::min),
                corners.into_iter().fold(f64::NEG_INFINITY, f64::max),
            ]
        }
        None => particles.world_bounds().map_or([0.0; 2], |[min, max]| [min[axis], max[axis]]),
    }
}

impl Scene {
    /// Keeps quantities of the particles, by id, for filters.
    pub fn keep(&mut self, quantities: Vec<Selectable>) {
        let arranged = quantities.into_iter().map(|it| {
            let numbers = Column::new(&it.numbers, self.structure.ids());
            Selectable { name: it.name, numbers, words: it.words, present: it.present }
        });
        self.selectables = arranged.collect();
    }

    /// From now on shows only particles that pass all filters and lie in all half spaces, and tells how many; without any, all are shown.
    /// The others are met by no ray and cast no shadow.
    ///
    /// Fails if a filter asks for a quantity that is not kept, or for a word that is none of its words.
    pub fn select(&mut self, filters: &[Filter], half_spaces: &[HalfSpace]) -> Result<u64> {
        let found: Vec<_> = filters.iter().map(|it| rule(&self.selectables, it)).collect::<Result<_>>()?;
        let within = found.iter().map(|(column, intervals)| Rule::Within(column, intervals));
        let rules: Vec<Rule> = within.chain(half_spaces.iter().copied().map(Rule::HalfSpace)).collect();
        let shown = self.structure.show(&rules);
        if let Some(shapes) = &mut self.shapes {
            shapes.show(&self.structure)?;
        }
        Ok(shown)
    }

    /// Why no particle is shown, after [`Scene::select`] returned 0: the filter or clip that keeps none alone, if there is one. Shows all
    /// particles again.
    pub fn why_none_is_left(&mut self, filters: &[Filter], clips: &[(Clip, Vec<HalfSpace>)]) -> String {
        let mut why = "each filter and clip keeps some particles, but together they keep none".to_string();
        for filter in filters {
            if self.select(std::slice::from_ref(filter), &[]).is_ok_and(|count| count == 0) {
                let kept = self.selectables.iter().find(|it| it.name == filter.quantity);
                why = format!(
                    "{} keeps none ({})",
                    filter.named(),
                    kept.map_or(String::new(), Selectable::present)
                );
                break;
            }
        }
        for (clip, half_spaces) in clips {
            if self.select(&[], half_spaces).is_ok_and(|count| count == 0) {
                why = format!("the clip '{clip}' keeps none");
                break;
            }
        }
        self.structure.show(&[]);
        why
    }
}

/// The column that a filter asks for, and which of its numbers are wanted.
fn rule<'a>(kept: &'a [Selectable<Column>], filter: &Filter) -> Result<(&'a Column, Vec<[f64; 2]>)> {
    let found = kept.iter().find(|it| it.name == filter.quantity);
    let found =
        found.ok_or_else(|| Error::setting(filter.setting, filter, "a quantity that the scene keeps"))?;
    Ok((&found.numbers, filter.intervals(&found.words)?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::particles::{Attribute, Cell, Columns, Radii, Values};
    use crate::scene::color::ParticleColors;
    use crate::scene::light::Lighting;
    use crate::structure::{Kind, Structure};

    fn particles() -> Particles {
        let mut columns = Columns::default();
        columns.positions.extend(&(0..10).map(|k| DVec3::new(k as f64, 0.0, -0.5)).collect::<Vec<_>>());
        let words = Values::Text {
            codes: vec![0, 1, 0, 1, 0, 1, 0, 2, 2, 2],
            names: vec!["Cu".into(), "O".into(), "X".into()],
        };
        columns.attributes = vec![
            Attribute::new("c_pe", 1, Values::F64((0..10).map(|k| -4.0 + 0.1 * k as f64).collect())),
            Attribute::new("species", 1, words),
            Attribute::new("atom_type", 1, Values::I32(vec![1, 2, 3, 1, 2, 3, 1, 2, 3, 1])),
            Attribute::new("v", 3, Values::F32((0..30).map(|k| k as f32).collect())),
        ];
        columns.cell = Some(Cell {
            origin: DVec3::new(-10.0, 0.0, -1.0),
            vectors: [DVec3::new(20.0, 0.0, 0.0), DVec3::Y, DVec3::Z],
            periodic: [true; 3],
        });
        Particles::new(columns).unwrap()
    }

    /// The places of what is left.
    fn left(filters: &[&str], clips: &[&str]) -> Result<Vec<u32>> {
        let filter = |text: &&str| match text.strip_prefix("select ") {
            Some(condition) => Filter::condition(condition),
            None => text.parse(),
        };
        let filters: Vec<Filter> = filters.iter().map(filter).collect::<Result<_>>()?;
        let particles = particles();
        let kept = filters.iter().map(|it| Selectable::of(&particles, it)).collect::<Result<_>>()?;
        let mut half_spaces = Vec::new();
        for clip in clips {
            half_spaces.extend(clip.parse::<Clip>()?.half_spaces(&particles));
        }
        let structure = Structure::build(Kind::default(), particles, &Radii::Uniform(0.4), 1.0, &())?;
        let mut scene = Scene::new(structure, ParticleColors::constant([1.0; 3]), Lighting::Flat, None);
        scene.keep(kept);
        let count = scene.select(&filters, &half_spaces)?;
        let down = |x: u32| {
            let origin = DVec3::new(f64::from(x), 0.0, 9.0) - scene.structure().origin();
            let ray = crate::math::Ray {
                origin: origin.as_vec3(),
                direction: glam::Vec3::NEG_Z,
                t_min: 0.0,
                t_max: f32::INFINITY,
            };
            scene.structure().intersect(&ray, None).is_some()
        };
        let left: Vec<u32> = (0..10).filter(|&x| down(x)).collect();
        assert_eq!(left.len() as u64, count);
        Ok(left)
    }

    #[test]
    fn what_is_written_is_shown() {
        for (filters, clips, expected) in [
            (&[][..], &[][..], vec![0, 1, 2, 3, 4, 5, 6, 7, 8, 9]),
            (&["c_pe=-3.9:-3.7"], &[], vec![1, 2, 3]),
            (&["c_pe=:-3.9"], &[], vec![0, 1]),
            (&["C_PE = -3.2: "], &[], vec![8, 9]),
            (&["type=3,1"], &[], vec![0, 2, 3, 5, 6, 8, 9]),
            (&["type=1:2", "x=2:"], &[], vec![3, 4, 6, 7, 9]),
            (&["species=O"], &[], vec![1, 3, 5]),
            (&["element=cu"], &[], vec![0, 2, 4, 6]),
            (&["v.x=3:6"], &[], vec![1, 2]),
            (&["|v|=0:3"], &[], vec![0]),
            (&["v.x + 10 * x=0:20"], &[], vec![0, 1]),
            (&["select c_pe < -3.5 and species == O"], &[], vec![1, 3]),
            (&["select type 1 or x > 8", "x=0:5"], &[], vec![0, 3]),
            (&[], &["x<3"], vec![0, 1, 2, 3]),
            (&[], &["x>0.8L"], vec![6, 7, 8, 9]),
            (&[], &["plane 4,0,0 2,0,0"], vec![0, 1, 2, 3, 4]),
            (&[], &["box 6,1,0 3,-1,-1"], vec![3, 4, 5, 6]),
            (&["type=1"], &["x > 1", "x < 8"], vec![3, 6]),
            (&["type=7"], &[], vec![]),
        ] {
            assert_eq!(left(filters, clips).unwrap(), expected, "{filters:?} {clips:?}");
        }
    }

    #[test]
    fn what_cannot_be_understood_is_explained() {
        for (select, expected) in [
            ("c_pe", "it is true or false for no particle: compare numbers, as in c_pe > 0"),
            ("c_p < 3", "no attribute 'c_p'; did you mean 'c_pe'?"),
        ] {
            let filter = Filter::condition(select);
            let message = filter.and_then(|it| Selectable::of(&particles(), &it)).err().unwrap().to_string();
            assert!(message.starts_with(&format!("--select cannot be '{select}'")), "{message}");
            assert!(message.contains(expected), "{message}");
        }
        for (filter, expected) in [
            (
                "c_p=1:2",
                "no attribute 'c_p'; did you mean 'c_pe'? available: c_pe, species, atom_type, v, x, y, z",
            ),
            ("c_pe", "there is no '='; a filter is NAME=LOW:HIGH or NAME=VALUE,VALUE"),
            ("=3", "no quantity is named"),
            ("c_pe=", "a value is missing"),
            ("c_pe=2:1", "a range ends before it begins"),
            ("c_pe=low", "'low' is no number, and c_pe has numbers"),
            ("species=Cuu", "no 'Cuu' in species; did you mean 'Cu'? it has: Cu, O, X"),
            ("species=1:2", "no '1:2' in species; it has: Cu, O, X"),
        ] {
            let message = left(&[filter], &[]).unwrap_err().to_string();
            assert!(message.starts_with(&format!("--filter cannot be '{filter}'")), "{message}");
            assert!(message.contains(expected), "{message}");
        }
        for clip in [
            "",
            "z",
            "w<3",
            "z<",
            "z<nan",
            "plane 0,0,0",
            "plane 0,0,0 0,0,0",
            "ball 0,0,0 1,1,1",
            "box 1,1 2,2,2",
        ] {
            let message = left(&[], &[clip]).unwrap_err().to_string();
            assert!(message.contains("--clip cannot be") && message.contains("z<0.5L"), "{message}");
        }
    }
}
