//! How far particles have come between two frames, by the ids that a file gives them.
//!
//! Takes the particles of a frame in which they rest, gives for those of another what each has moved since, and how far that can be trusted:
//! a particle whose id is not there, or is there more than once, has no trust. In a periodic cell the shortest way counts, and trust ends where
//! it is nearly half a cell: a longer one could as well have been the way around.

use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;

use super::fade;
use crate::error::{Error, Result};
use crate::names::nearest;
use crate::particles::{Attribute, Cell, Particles, View};

/// What ids are called in the files of the known programs, in any case; the first one that is there counts.
pub const ID_NAMES: [&str; 9] = [
    "id",
    "ids",
    "particle_id",
    "particleid",
    "particleids",
    "particle_ids",
    "idp",
    "pid",
    "particle identifier",
];
/// Shares of a periodic edge: up to the first a way is trusted, from the second on not at all.
const TRUSTED: [f32; 2] = [0.25, 0.4];

/// What a particle has moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moved {
    /// From where it was to where it is.
    pub by: Vec3,
    /// 0 where that is unknown, up to 1.
    pub trust: f32,
}

impl Moved {
    /// Not known how far.
    pub const UNKNOWN: Self = Self { by: Vec3::ZERO, trust: 0.0 };
}

/// Particles in a frame in which they rest: their places by their ids.
#[derive(Clone, Debug)]
pub struct Rest {
    places: Vec<(i64, Vec3)>,
    origin: DVec3,
}

/// Whether particles have an attribute whose name is usual for ids.
pub fn have_ids(particles: &Particles) -> bool {
    attribute(particles, None).is_some()
}

fn is_number(attribute: &Attribute) -> bool {
    attribute.components == 1 && !matches!(attribute.values.view(), View::Text { .. })
}

/// The attribute of single numbers that is called `name`, or with none one whose name is usual.
fn attribute<'a>(particles: &'a Particles, name: Option<&str>) -> Option<&'a Attribute> {
    match name {
        Some(name) => particles.attribute(name).filter(|it| is_number(it)),
        None => ID_NAMES.iter().find_map(|name| particles.attribute(name).filter(|it| is_number(it))),
    }
}

/// The ids of particles, in their order. `index` is their place in the file.
///
/// Fails with [`Error::Setting`] if there is no such attribute of single numbers.
fn ids(particles: &Particles, name: Option<&str>) -> Result<Vec<i64>> {
    if let Some(attribute) = attribute(particles, name) {
        return Ok(match attribute.values.view() {
            View::I32(values) => values.iter().map(|&it| it.into()).collect(),
            View::I64(values) => values.to_vec(),
            _ => (0..particles.len()).map(|at| attribute.values.number(at) as i64).collect(),
        });
    }
    if name.is_some_and(|name| name.eq_ignore_ascii_case("index")) {
        return Ok((0..particles.len()).map(|at| particles.place(at) as i64).collect());
    }
    let there: Vec<&str> =
        particles.attributes().iter().filter(|it| is_number(it)).map(|it| it.name.as_str()).collect();
    let meant = name.and_then(|name| nearest(name, there.iter().copied()));
    let meant = meant.map_or(String::new(), |meant| format!("; did you mean '{meant}'?"));
    let there = if there.is_empty() { "none".into() } else { there.join(", ") };
    let allowed = format!(
        "an attribute of whole numbers, or index where particles keep their order — the file has: {there}{meant}"
    );
    Err(Error::setting("--noise-motion", format!("id:{}", name.unwrap_or("id")), allowed))
}

impl Rest {
    /// Particles that rest where they are; their ids are the attribute called `name`, or with none one whose name is usual; `index` is their place
    /// in the file. Fails with [`Error::Setting`] if there is no such attribute of single numbers.
    pub fn new(particles: &Particles, name: Option<&str>) -> Result<Self> {
        let positions = particles.positions();
        let numbered = ids(particles, name)?.into_iter().enumerate();
        let mut all: Vec<(i64, Vec3)> = numbered.map(|(at, id)| (id, positions.offset(at))).collect();
        // Stable: what has one id stays in its order, of which nothing is kept.
        all.par_sort_by_key(|it| it.0);
        let places = all.chunk_by(|one, other| one.0 == other.0).filter(|it| it.len() == 1);
        let places = places.flatten().copied().collect();
        Ok(Self { places, origin: positions.origin() })
    }

    /// What `particles` have moved since, in their order. Fails as [`Rest::new`] does.
    pub fn moved(&self, particles: &Particles, name: Option<&str>) -> Result<Vec<Moved>> {
        let ids = ids(particles, name)?;
        let positions = particles.positions();
        let shift = (positions.origin() - self.origin).as_vec3();
        let ways = particles.cell().and_then(Ways::new);
        let moved = |(at, id): (usize, &i64)| {
            let Ok(found) = self.places.binary_search_by_key(id, |it| it.0) else { return Moved::UNKNOWN };
            let by = positions.offset(at) - self.places[found].1 + shift;
            ways.as_ref().map_or(Moved { by, trust: 1.0 }, |ways| ways.shortest(by))
        };
        Ok(ids.par_iter().enumerate().with_min_len(1 << 12).map(moved).collect())
    }
}

/// Ways in a periodic cell.
struct Ways {
    vectors: DMat3,
    fractions: DMat3,
    periodic: [bool; 3],
}

impl Ways {
    /// `None` in a cell that does not repeat, or is flat.
    fn new(cell: &Cell) -> Option<Self> {
        let [a, b, c] = cell.vectors;
        let vectors = DMat3::from_cols(a, b, c);
        let volume = vectors.determinant().abs();
        let is_whole = volume.is_finite() && volume > 1e-12 * a.length() * b.length() * c.length();
        let periodic = cell.periodic;
        (is_whole && periodic != [false; 3]).then(|| Self { vectors, fractions: vectors.inverse(), periodic })
    }

    /// The shortest way to an image of where `by` leads.
    fn shortest(&self, by: Vec3) -> Moved {
        let mut fractions = self.fractions * by.as_dvec3();
        let (mut whole, mut longest) = (DVec3::ZERO, 0.0_f64);
        for axis in (0..3).filter(|&axis| self.periodic[axis]) {
            whole[axis] = fractions[axis].round();
            fractions[axis] -= whole[axis];
            longest = longest.max(fractions[axis].abs());
        }
        let trust = 1.0 - fade(TRUSTED, longest as f32);
        if whole == DVec3::ZERO {
            Moved { by, trust }
        } else {
            Moved { by: (self.vectors * fractions).as_vec3(), trust }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::particles::{Columns, Positions, Values};

    fn particles(places: &[[f32; 3]], ids: Values, cell: Option<Cell>) -> Particles {
        let offsets = [0, 1, 2].map(|axis| places.iter().map(|it| it[axis]).collect());
        let positions = Positions::from_offsets(DVec3::ZERO, offsets);
        let attributes = vec![Attribute::new("ID", 1, ids)];
        Particles::new(Columns { positions, attributes, cell, ..Columns::default() }).unwrap()
    }

    #[test]
    fn what_moved_is_found_by_ids_in_any_order() {
        let before = particles(
            &[[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [9.0; 3]],
            Values::I64(vec![7, 1 << 60, 5, 5]),
            None,
        );
        let after = particles(
            &[[1.0, 2.0, 0.0], [0.5, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0]],
            Values::I64(vec![1 << 60, 7, 5, (1 << 60) + 1]),
            None,
        );
        let moved = Rest::new(&before, None).unwrap().moved(&after, Some("id")).unwrap();
        let by = |x: f32, y: f32| Moved { by: Vec3::new(x, y, 0.0), trust: 1.0 };
        assert_eq!(moved, [by(0.0, 2.0), by(0.5, 0.0), Moved::UNKNOWN, Moved::UNKNOWN]);
        let later = before.clone().measured_from(DVec3::new(100.0, 0.0, 0.0));
        let moved = Rest::new(&before, None).unwrap().moved(&later, None).unwrap();
        assert_eq!(moved[..2], [by(0.0, 0.0); 2]);
        let by_place = Rest::new(&before, Some("index")).unwrap().moved(&after, Some("index")).unwrap();
        assert_eq!(by_place[0], by(1.0, 2.0));
        let error = ids(&before, Some("IDS")).unwrap_err().to_string();
        assert!(error.contains("id:IDS") && error.contains("did you mean 'ID'?"), "{error}");
        assert!(have_ids(&before));
    }

    #[test]
    fn in_a_periodic_cell_the_shortest_way_counts_while_it_is_sure() {
        let cell = Cell {
            origin: DVec3::ZERO,
            vectors: [DVec3::X * 10.0, DVec3::new(2.0, 10.0, 0.0), DVec3::Z * 10.0],
            periodic: [true, true, false],
        };
        let at = |place: [f32; 3]| particles(&[place], Values::I32(vec![1]), Some(cell));
        let moved = |from, to| Rest::new(&at(from), None).unwrap().moved(&at(to), None).unwrap()[0];
        assert_eq!(
            moved([1.0, 1.0, 9.0], [2.0, 1.0, 0.0]),
            Moved { by: Vec3::new(1.0, 0.0, -9.0), trust: 1.0 }
        );
        let around = moved([9.5, 1.0, 0.0], [0.5, 1.0, 0.0]);
        assert!(around.by.abs_diff_eq(Vec3::X, 1e-5) && around.trust == 1.0, "{around:?}");
        let skewed = moved([9.0, 9.5, 0.0], [1.5, 0.5, 0.0]);
        assert!(skewed.by.abs_diff_eq(Vec3::new(4.5, 1.0, 0.0), 1e-5), "{skewed:?}");
        assert!((0.01..0.99).contains(&moved([0.0, 1.0, 0.0], [3.2, 1.0, 0.0]).trust));
        assert_eq!(moved([0.0, 1.0, 0.0], [4.5, 1.0, 0.0]).trust, 0.0);
    }
}
