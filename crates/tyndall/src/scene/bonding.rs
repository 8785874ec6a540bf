//! Which particles are joined by bonds, and where these go: never across the picture where they leave a periodic cell.

use std::collections::HashSet;
use std::str::FromStr;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::automatic::per_angstrom;
use super::element::Elements;
use super::spacing::median_spacing;
use super::statistics::{grouped, quantiles, sampled_ids, short};
use crate::error::{Error, Result};
use crate::particles::Particles;
use crate::periodic::{Lattice, pairs};
use crate::structure::shapes::Segment;

/// What says who is bonded.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Bonding {
    /// The file, else the elements; both where the file tells few of those of the elements, as PDB files do, which leave out what everyone knows.
    #[default]
    Auto,
    /// The file.
    File,
    /// Distances up to 1.2 times the sum of the covalent radii of two elements.
    Elements,
    /// Distances up to this one.
    Distance(f64),
}

impl FromStr for Bonding {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "auto" => Ok(Self::Auto),
            "file" => Ok(Self::File),
            "elements" => Ok(Self::Elements),
            _ => {
                let distance = text.parse().ok().filter(|it: &f64| it.is_finite() && *it > 0.0);
                let allowed = "auto, file, elements or a distance above 0; without one of these it stands behind all files";
                distance.map(Self::Distance).ok_or_else(|| Error::setting("--bonds", text, allowed))
            }
        }
    }
}

/// How much farther than the sum of their radii two bonded atoms may be.
const TOLERANCE: f64 = 1.2;
/// More bonds a particle than any matter has: a distance beyond the nearest neighbors.
const MOST_EACH: usize = 32;
/// The radius of a bond over the usual length: sticks between balls.
const THICKNESS: f64 = 0.1;
/// Bonds that are looked at for the usual length.
const SAMPLES: usize = 10_000;

/// Bonds to be drawn.
#[derive(Clone, Debug)]
pub struct Bonded {
    /// Where they go: one that leaves the cell is two halves.
    pub segments: Vec<Segment>,
    /// The radius of all.
    pub radius: f32,
    /// How they were found, in one line.
    pub description: String,
}

/// Finds bonds; without `radius` it is a tenth of their usual length.
///
/// Fails with [`Error::Setting`] if nothing says who is bonded, or a distance is so long that it says nothing.
pub fn find(particles: &Particles, bonding: Bonding, radius: Option<f32>) -> Result<Bonded> {
    let lattice = particles.cell().filter(|cell| cell.periodic.contains(&true));
    // A cell that is none repeats nothing.
    let lattice = lattice.and_then(|cell| Lattice::new(cell, "--bonds", "drawn").ok());
    let (found, by) = who(particles, lattice.as_ref(), bonding)?;
    let vector = |[one, other]: [u32; 2]| {
        let [from, to] = [one, other].map(|id| particles.positions().offset(id as usize).as_dvec3());
        let nearest = lattice.as_ref().map_or(to - from, |lattice| lattice.nearest(to - from));
        (from, to, nearest)
    };
    let mut lengths: Vec<f64> =
        sampled_ids(found.len(), SAMPLES).map(|bond| vector(found[bond]).2.length()).collect();
    let usual = quantiles(&mut lengths, [0.5]).map_or(1.0, |[usual]| usual);
    let radius = radius.unwrap_or((THICKNESS * usual) as f32);
    let segments = found.par_iter().flat_map_iter(|&bond| segments(bond, vector(bond))).collect();
    let description = match found.len() {
        0 => format!("no bonds {by}"),
        1 => format!("1 bond {by}, radius {}", short(radius.into())),
        count => format!("{} bonds {by}, radius {}", grouped(count), short(radius.into())),
    };
    Ok(Bonded { segments, radius, description })
}

/// The pairs, and what says so.
fn who(
    particles: &Particles,
    lattice: Option<&Lattice>,
    bonding: Bonding,
) -> Result<(Vec<[u32; 2]>, String)> {
    let refuse = |value: &str, allowed: &str| Err(Error::setting("--bonds", value, allowed));
    let limited = |pairs: Option<Vec<[u32; 2]>>, by: String| match pairs {
        Some(pairs) => Ok((pairs, by)),
        None => {
            let allowed = format!("shorter: {by}, particles have more than {MOST_EACH} bonds each");
            Err(Error::setting("--bonds", "a distance", allowed))
        }
    };
    let of_file = particles.bonds();
    match bonding {
        // What is bonded as a whole has at least a bond for two particles.
        Bonding::Auto if !of_file.is_empty() && of_file.len() < particles.len() / 2 => {
            Ok(match who(particles, lattice, Bonding::Elements) {
                Ok((known, by)) => with_known(of_file, known, &by),
                Err(_) => (of_file.to_vec(), "of the file".into()),
            })
        }
        Bonding::Auto | Bonding::File if !of_file.is_empty() => Ok((of_file.to_vec(), "of the file".into())),
        Bonding::File => refuse("file", "elements or a distance: the file has no bonds"),
        Bonding::Distance(distance) => {
            let by = format!("by distances up to {}", short(distance));
            limited(pairs(particles, lattice, distance, MOST_EACH, |_, _| distance), by)
        }
        Bonding::Auto | Bonding::Elements => {
            let Some(elements) = Elements::find(particles) else {
                let (value, allowed) = match bonding {
                    Bonding::Auto => {
                        ("auto", "a distance, as in --bonds 1.8: the file has neither bonds nor elements")
                    }
                    _ => ("elements", "a distance, as in --bonds 1.8: the file names no elements"),
                };
                return refuse(value, allowed);
            };
            let unit = f64::from(per_angstrom(particles, median_spacing(particles.positions())).0);
            let radius = |(element, is_site): (&Option<super::element::Element>, &bool)| {
                let radius = element.filter(|_| !is_site).and_then(|it| it.covalent_radius());
                radius.map(|radius| TOLERANCE * unit * radius)
            };
            let radii: Vec<Option<f64>> = elements.by_value.iter().zip(&elements.sites).map(radius).collect();
            let values = &particles.attributes()[elements.attribute].values;
            let of = |id: u32| radii.get(values.number(id as usize) as usize).copied().flatten();
            // Only the radii of elements that are there: the largest decides how far to look.
            let there = (0..particles.len() as u32).into_par_iter().with_min_len(1 << 14).filter_map(of);
            let most = 2.0 * there.reduce(|| 0.0, f64::max);
            let reach =
                |one: u32, other: u32| of(one).zip(of(other)).map_or(-1.0, |(one, other)| one + other);
            let by = format!("by the elements, up to {TOLERANCE} × the sum of covalent radii");
            limited(pairs(particles, lattice, most, MOST_EACH, reach), by)
        }
    }
}

/// The bonds of a file, and those that are known otherwise if it tells less than half of them.
fn with_known(of_file: &[[u32; 2]], known: Vec<[u32; 2]>, by: &str) -> (Vec<[u32; 2]>, String) {
    let ordered = |[one, other]: [u32; 2]| [one.min(other), one.max(other)];
    let told: HashSet<[u32; 2]> = of_file.iter().copied().map(ordered).collect();
    let all = known.len();
    let more: Vec<[u32; 2]> = known.into_iter().filter(|&bond| !told.contains(&ordered(bond))).collect();
    if more.len() <= all / 2 {
        return (of_file.to_vec(), "of the file".into());
    }
    let text = format!("of the file and {} {by}", grouped(more.len()));
    ([of_file, &more].concat(), text)
}

/// Where a bond goes, between two places with the vector `nearest` from one to the nearest image of the other.
fn segments(
    [one, other]: [u32; 2],
    (from, to, nearest): (DVec3, DVec3, DVec3),
) -> impl Iterator<Item = Segment> {
    let point = |it: DVec3| -> Vec3 { it.as_vec3() };
    let leaves_cell = nearest.length() < (1.0 - 1e-6) * (to - from).length();
    let whole = Segment { from: point(from), to: point(to), ends: [one, other] };
    let halves = [
        Segment { from: point(from), to: point(from + 0.5 * nearest), ends: [one; 2] },
        Segment { from: point(to), to: point(to - 0.5 * nearest), ends: [other; 2] },
    ];
    let (whole, halves) = if leaves_cell { (None, Some(halves)) } else { (Some(whole), None) };
    whole.into_iter().chain(halves.into_iter().flatten())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::particles::{Attribute, Cell, Columns, Positions, Values};

    fn water(bonds: Vec<[u32; 2]>, names: bool) -> Particles {
        let mut positions = Positions::around(DVec3::splat(5.0));
        // The second hydrogen is folded to the other side of the cell.
        positions.extend(&[
            DVec3::new(0.3, 5.0, 5.0),
            DVec3::new(0.9, 5.76, 5.0),
            DVec3::new(9.7, 5.76, 5.0),
            DVec3::splat(5.0),
        ]);
        let symbols = ["O", "H", "Ar"].map(String::from).to_vec();
        let mut attributes = Vec::new();
        if names {
            attributes.push(Attribute::new(
                "element",
                1,
                Values::Text { codes: vec![0, 1, 1, 2], names: symbols },
            ));
        }
        let vectors = [10.0 * DVec3::X, 10.0 * DVec3::Y, 10.0 * DVec3::Z];
        let cell = Some(Cell { origin: DVec3::ZERO, vectors, periodic: [true; 3] });
        let length_unit = Some("Å".to_string());
        Particles::new(Columns { positions, attributes, cell, bonds, length_unit, ..Columns::default() })
            .unwrap()
    }

    #[test]
    fn what_leaves_the_cell_is_two_halves() {
        let found = find(&water(vec![[1, 0], [0, 2]], false), Bonding::Auto, Some(0.2)).unwrap();
        assert_eq!(found.description, "2 bonds of the file, radius 0.2");
        let ends: Vec<[u32; 2]> = found.segments.iter().map(|it| it.ends).collect();
        assert_eq!(ends, [[0, 1], [0, 0], [2, 2]]);
        for segment in &found.segments {
            assert!((segment.to - segment.from).length() < 1.0, "{segment:?} is stretched over the cell");
        }
        let [_, out, back] = found.segments[..] else { panic!("three") };
        assert!((out.to + Vec3::X * 10.0).abs_diff_eq(back.to, 1e-5), "halves meet at the face");
    }

    #[test]
    fn elements_and_distances_tell_bonds_too() {
        let pairs = |particles: &Particles, bonding| {
            let mut ends: Vec<[u32; 2]> =
                find(particles, bonding, None).unwrap().segments.iter().map(|it| it.ends).collect();
            ends.sort_unstable();
            ends
        };
        let named = water(Vec::new(), true);
        assert_eq!(pairs(&named, Bonding::Auto), [[0, 0], [0, 1], [2, 2]]);
        assert_eq!(pairs(&named, Bonding::Distance(1.3)), [[0, 0], [0, 1], [1, 1], [2, 2], [2, 2]]);
        assert!(pairs(&named, Bonding::Distance(0.5)).is_empty());
        let told = find(&named, Bonding::Elements, None).unwrap();
        assert!(told.description.starts_with("2 bonds by the elements, up to 1.2 ×"), "{}", told.description);
        assert!((told.radius - 0.0968).abs() < 1e-3, "a tenth of their length: {}", told.radius);
    }

    #[test]
    fn files_that_tell_few_bonds_are_helped_by_the_elements() {
        let told = |bonds, bonding| find(&water(bonds, true), bonding, Some(0.1)).unwrap().description;
        let both = told(vec![[3, 0]], Bonding::Auto);
        assert!(both.starts_with("3 bonds of the file and 2 by the elements, up to 1.2 ×"), "{both}");
        assert_eq!(told(vec![[3, 0]], Bonding::File), "1 bond of the file, radius 0.1");
        assert_eq!(told(vec![[1, 0]], Bonding::Auto), "1 bond of the file, radius 0.1");
        assert_eq!(told(vec![[3, 0], [3, 1]], Bonding::Auto), "2 bonds of the file, radius 0.1");
        let unnamed = find(&water(vec![[3, 0]], false), Bonding::Auto, Some(0.1)).unwrap();
        assert_eq!(unnamed.description, "1 bond of the file, radius 0.1");
    }

    #[test]
    fn bonds_that_nothing_tells_are_refused() {
        let bare = water(Vec::new(), false);
        let refused =
            |particles: &Particles, bonding| find(particles, bonding, None).unwrap_err().to_string();
        assert!(
            refused(&bare, Bonding::Auto).contains("--bonds 1.8: the file has neither bonds nor elements")
        );
        assert!(refused(&bare, Bonding::File).contains("the file has no bonds"));
        assert!(refused(&bare, Bonding::Elements).contains("names no elements"));
        let mut positions = Positions::around(DVec3::ZERO);
        positions.extend(&(0..200).map(|id| DVec3::X * 0.01 * f64::from(id)).collect::<Vec<_>>());
        let crowd = Particles::new(Columns { positions, ..Columns::default() }).unwrap();
        assert!(refused(&crowd, Bonding::Distance(5.0)).contains("more than 32 bonds each"));
        for bad in ["", "0", "-1", "nan", "a.pdb"] {
            assert!(bad.parse::<Bonding>().is_err(), "{bad}");
        }
        assert_eq!(
            ("1.8".parse::<Bonding>().unwrap(), "file".parse::<Bonding>().unwrap()),
            (Bonding::Distance(1.8), Bonding::File)
        );
    }
}
