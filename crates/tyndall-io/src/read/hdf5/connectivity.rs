//! Bonds of H5MD files: lists of pairs of particles, in the group `connectivity` or beside the quantities of their particles.
//!
//! A list is an element as others are, the same in all frames or one a frame. It names its particles by their `id` where they have one,
//! else by their places, and may be filled up with pairs that are none. Of several lists of pairs those are taken whose path speaks of
//! bonds, if there are such. Source: H5MD 1.1, "Connectivity" and "Storage of tuples" (proposals 101 and 103 on nongnu.org/h5md); the
//! element `connectivity` of a group of particles is that of ZnH5MD, whose pairs have the order of the bond as third number.

use std::ops::Range;

use rayon::prelude::*;
use tyndall::Result;
use tyndall::particles::Attribute;
use tyndall::scene::grouped;

use super::h5md::Element;
use super::rows::{NATIVE, Rows};
use super::tree::{Group, Tree};
use crate::read::records::Source;

/// Names of lists that stand beside the quantities of their particles.
const OWN: [&str; 2] = ["connectivity", "bonds"];
/// How deep in `connectivity` lists are looked for.
const DEPTH: usize = 2;
/// Rows that are read together.
const BLOCK: usize = 1 << 18;

/// The particles whose bonds are wanted.
#[derive(Clone, Copy)]
pub(super) struct Of<'a> {
    /// Their group, and its name in `particles`.
    pub(super) group: &'a Group<'a>,
    pub(super) name: &'a str,
    /// The names of the other groups of particles.
    pub(super) others: &'a [String],
    /// The frame, and the step at which it was taken.
    pub(super) frame: usize,
    pub(super) step: Option<f64>,
}

/// What was found.
#[derive(Debug, Default)]
pub(super) struct Found {
    /// Pairs of places.
    pub(super) bonds: Vec<[u32; 2]>,
    /// Where they are in the file.
    pub(super) from: Vec<String>,
    /// Whether they were told by ids.
    pub(super) by_id: bool,
    /// How many are of particles that are not there.
    pub(super) unknown: usize,
    /// What could not be read, and why.
    pub(super) left_out: Vec<String>,
}

impl Found {
    /// Where the bonds are from.
    pub(super) fn conventions(&self) -> Vec<String> {
        let by = if self.by_id { "by the ids of particles" } else { "by the places of particles, from 0" };
        (!self.from.is_empty())
            .then(|| format!("bonds: {}, {by}", self.from.join(", ")))
            .into_iter()
            .collect()
    }

    /// What is missing.
    pub(super) fn warnings(&self) -> Vec<String> {
        let unknown = (self.unknown > 0)
            .then(|| format!("left out {} bonds of particles that are not there", grouped(self.unknown)));
        self.left_out.iter().map(|what| format!("left out: {what}")).chain(unknown).collect()
    }
}

/// A list of pairs.
struct List<'a> {
    path: String,
    element: Element<'a>,
}

/// Whether an element of a group of particles is a list of bonds, and no quantity.
pub(super) fn is_own(name: &str, element: &Element) -> bool {
    OWN.contains(&name) && matches!(element.width(), Some(2 | 3))
}

/// Finds the bonds of `count` particles, of which `ids` are the ids if they have such.
pub(super) fn bonds(tree: &Tree, of: Of, count: usize, ids: Option<&Attribute>) -> Result<Found> {
    let mut lists = Vec::new();
    for name in OWN {
        if let Some(element) = Element::find(of.group, name)?.filter(|it| is_own(name, it)) {
            lists.push(List { path: format!("{}/{name}", of.group.path()), element });
        } else if let Some(group) = of.group.group(name)? {
            collect(&group, 1, of, &mut lists)?;
        }
    }
    if let Some(group) = tree.group("connectivity")? {
        collect(&group, DEPTH, of, &mut lists)?;
    }
    let speaks_of_bonds = |list: &List| list.path.to_ascii_lowercase().contains("bond");
    if lists.iter().any(speaks_of_bonds) {
        lists.retain(speaks_of_bonds);
    }
    let mut found = Found::default();
    let places = ids.filter(|_| !lists.is_empty()).and_then(Places::of);
    found.by_id = places.is_some();
    for List { path, element } in lists {
        let lead = element.lead(of.frame, of.step)?;
        let fill = element.value.fill().filter(|it| *it != 0.0);
        match element.value.quantity(&lead)? {
            Ok(rows) => {
                read(&rows, fill, (count, places.as_ref()), &mut found)?;
                found.from.push(path);
            }
            Err(why) => found.left_out.push(format!("'{path}' ({why})")),
        }
    }
    Ok(found)
}

/// Adds the lists of pairs in a group, and in groups in it.
fn collect<'a>(group: &Group<'a>, depth: usize, of: Of, lists: &mut Vec<List<'a>>) -> Result<()> {
    for name in group.datasets()?.into_iter().chain(group.groups()?) {
        let path = format!("{}/{name}", group.path());
        match Element::find(group, &name)? {
            Some(element) if element.width() == Some(2) && belongs(&element, &path, of)? => {
                lists.push(List { path, element });
            }
            Some(_) => {}
            None if depth > 1 => {
                if let Some(inner) = group.group(&name)? {
                    collect(&inner, depth - 1, of, lists)?;
                }
            }
            None => {}
        }
    }
    Ok(())
}

/// Whether a list is of these particles: by what it refers to, else by a name in its path; a list that says nothing is of the only ones.
fn belongs(element: &Element, path: &str, of: Of) -> Result<bool> {
    let attributes = element.attributes()?;
    if let Some(address) = attributes.reference("particles_group") {
        return Ok(address == of.group.address());
    }
    if let Some(name) = attributes.text("particles_group") {
        return Ok(name.trim_end_matches('/').rsplit('/').next() == Some(of.name));
    }
    let mut names = path.split('/');
    Ok(path.starts_with(of.group.path()) || names.any(|it| it == of.name) || of.others.is_empty())
}

/// The places of particles by their ids.
struct Places(Vec<(i64, u32)>);

impl Places {
    fn of(ids: &Attribute) -> Option<Self> {
        if ids.components != 1 {
            return None;
        }
        let places = 0..ids.values.len() as u32;
        let mut all: Vec<(i64, u32)> =
            places.into_par_iter().map(|place| (ids.number(place as usize, 0) as i64, place)).collect();
        all.par_sort_unstable();
        Some(Self(all))
    }

    fn place(&self, id: i64) -> Option<u32> {
        let at = self.0.partition_point(|(known, _)| *known < id);
        self.0.get(at).filter(|(known, _)| *known == id).map(|(_, place)| *place)
    }
}

/// Appends the pairs of a list.
fn read(rows: &Rows, fill: Option<f64>, of: (usize, Option<&Places>), found: &mut Found) -> Result<()> {
    for start in (0..rows.count).step_by(BLOCK) {
        let range: Range<usize> = start..rows.count.min(start + BLOCK);
        let count = range.len();
        let bytes = rows.read(range)?;
        let size = rows.kind.size();
        let source = Source {
            bytes: &bytes,
            kind: rows.kind,
            order: NATIVE,
            start: 0,
            stride: rows.width * size,
            step: size,
        };
        let [one, other] = [0, 1].map(|end| source.component(end));
        for row in 0..count {
            let ends = [one.number(row), other.number(row)];
            // What fills a list up is negative, no number, or what the file says; nothing is bonded to itself.
            let is_filling = |end: &f64| end.is_nan() || *end < 0.0 || Some(*end) == fill;
            if ends[0] == ends[1] || ends.iter().any(is_filling) {
                continue;
            }
            match ends.map(|end| place(end, of)) {
                [Some(one), Some(other)] => found.bonds.push([one, other]),
                _ => found.unknown += 1,
            }
        }
    }
    Ok(())
}

fn place(end: f64, (count, places): (usize, Option<&Places>)) -> Option<u32> {
    match places {
        Some(places) => places.place(end as i64),
        None => (end < count as f64).then_some(end as u32),
    }
}
