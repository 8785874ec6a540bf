//! What is guessed where nobody says: the particles' radii, and the box that the camera frames.
//!
//! Each guess comes with one line that says what was chosen and why; a shell prints it once.

use super::element::{Element, Elements};
use super::spacing::{QUERIES, median_spacing};
use super::statistics::{grouped, quantiles, sampled_ids, short};
use super::units;
use crate::math::Bounds;
use crate::particles::{Attribute, Cell, Particles, Radii};
use crate::structure::Spheres;
use glam::Vec3;
use rayon::prelude::*;

/// The radius, in Å, of a site of charge: it lies within its atom.
const SITE_RADIUS: f32 = 0.3;
/// The radius, in Å, of an atom whose element has none or is not known.
const UNKNOWN_RADIUS: f32 = 1.7;
/// The radius of particles without any distance between them, in the unit of the positions.
const LONE_RADIUS: f32 = 0.5;
/// No two atoms are nearer than those of hydrogen, 0.74 Å: a smaller spacing is in nm.
const LEAST_SPACING: f64 = 0.5;
/// At most so many particles are sampled for the framing box.
const SAMPLES: usize = 1_000_000;
/// The share of particles on either side of an axis that may be outliers.
const TAIL: f64 = 0.001;

/// The radii of the particles, and how they were found: the file's own, else the van der Waals radii of the elements, else half
/// the median distance to the nearest neighbor.
pub fn radii(particles: &Particles) -> (Radii, String) {
    if let Some(radii) = particles.radii() {
        return (radii.clone(), described(radii, particles.attributes()));
    }
    let spacing = median_spacing(particles.positions());
    if let Some(elements) = Elements::find(particles) {
        return by_element(particles, &elements, spacing);
    }
    match spacing.map(|spacing| (spacing, (0.5 * spacing) as f32)) {
        // A radius that single precision rounds to nothing would show nothing.
        Some((spacing, radius)) if radius > 0.0 => {
            let samples = grouped(particles.len().min(QUERIES));
            let nearest = short(spacing);
            let text = format!(
                "radius {}: half the median distance {nearest} to the nearest neighbor ({samples} samples)",
                short(radius as f64)
            );
            (Radii::Uniform(radius), text)
        }
        _ => {
            let why = match particles.len() {
                0 => "no particles",
                1 => "a single particle",
                _ => "all particles are at one place",
            };
            (Radii::Uniform(LONE_RADIUS), format!("radius {LONE_RADIUS}: {why}"))
        }
    }
}

fn described(radii: &Radii, attributes: &[Attribute]) -> String {
    match radii {
        Radii::Uniform(radius) => format!("radius {} of the file", short(*radius as f64)),
        Radii::PerType { attribute, .. } => format!("radius of the file, by {}", attributes[*attribute].name),
        Radii::PerParticle { attribute, scale } => {
            let name = &attributes[*attribute].name;
            if *scale == 1.0 {
                format!("radius {name}")
            } else {
                format!("radius {name} × {}", short(*scale as f64))
            }
        }
    }
}

fn by_element(particles: &Particles, elements: &Elements, spacing: Option<f64>) -> (Radii, String) {
    let (per_angstrom, unit) = per_angstrom(particles, spacing);
    let of_value = |(element, is_site): (&Option<Element>, &bool)| match is_site {
        true => SITE_RADIUS,
        false => element.and_then(Element::radius).unwrap_or(UNKNOWN_RADIUS),
    };
    let values = elements.by_value.iter().zip(&elements.sites);
    let mut radii: Vec<f32> = values.map(|value| per_angstrom * of_value(value)).collect();
    // Values beyond the table have its last entry.
    radii.push(per_angstrom * UNKNOWN_RADIUS);
    let name = &particles.attributes()[elements.attribute].name;
    let mut text = format!("radius of the elements of {name}, van der Waals × 1, in {unit}");
    if elements.known < 1.0 {
        let unknown = short(100.0 * (1.0 - elements.known));
        text += &format!("; {unknown} % unknown have {UNKNOWN_RADIUS} Å");
    }
    if elements.sites.contains(&true) {
        text += &format!("; sites of charge have {SITE_RADIUS} Å");
    }
    (Radii::PerType { attribute: elements.attribute, radii }, text)
}

/// What an Å is in the unit of the positions, and how that was found; `spacing` is the usual distance of neighbors.
pub(super) fn per_angstrom(particles: &Particles, spacing: Option<f64>) -> (f32, &'static str) {
    match particles.length_unit().and_then(units::known) {
        Some((unit, meters)) => ((1e-10 / meters) as f32, unit),
        _ if spacing.is_some_and(|spacing| spacing < LEAST_SPACING) => {
            (0.1, "nm, as the atoms are so near each other")
        }
        _ => (1.0, "Å, as the file names no unit"),
    }
}

/// The box that a camera should show.
#[derive(Clone, Debug, PartialEq)]
pub struct Framing {
    /// The box of the centers, as offsets from the positions' origin. Empty without particles.
    pub bounds: Bounds,
    /// How it was found, in one line.
    pub description: String,
    /// What the picture may leave out, in one line.
    pub warning: Option<String>,
    /// Whether it is the simulation's cell, which stays in view whatever is in it.
    pub of_cell: bool,
}

/// The box to show: the simulation's cell if the particles fill it, else that of the particles without far outliers.
///
/// Outliers count as far where they make the box more than 1.5 times as large as that of the 0.1 to 99.9 percentiles.
pub fn framing(particles: &Particles) -> Framing {
    let full = particles.bounds();
    let framed = |bounds: Bounds, text: &str| Framing {
        bounds,
        description: format!("framed on {text}"),
        warning: None,
        of_cell: false,
    };
    if full.is_empty() {
        return framed(full, "nothing: there are no particles");
    }
    let middle = percentile_box(particles);
    if let Some(cell) = particles.cell() {
        let cell = cell_bounds(cell, particles);
        if fills(middle, cell) {
            return Framing { of_cell: true, ..framed(cell, "the cell") };
        }
    }
    let size = middle.extent().max_element();
    let farthest = (middle.min - full.min).max(full.max - middle.max).max_element();
    let grows = (full.extent() - middle.extent()).max_element();
    // Without an extent of the many there is nothing to frame but the few.
    if size <= 0.0 || grows <= 0.5 * size {
        return framed(full, "all particles");
    }
    let outside = count_outside(particles, middle.grown(0.5 * size));
    if outside == 0 {
        return framed(full, "all particles");
    }
    let share = short(100.0 * outside as f64 / particles.len() as f64);
    let times = short((farthest / size) as f64);
    let mut framing = framed(middle, "the 99.9 % box of the particles");
    framing.warning = Some(format!(
        "{share} % of particles lie up to {times}× the box's size outside the rest; framed on the 99.9 % box \
         (--frame-all to see all)"
    ));
    framing
}

/// The box to show of particles that have a size: see [`framing`]; `outliers` says whether the farthest is shown too.
pub fn framing_of(spheres: Spheres, outliers: Outliers) -> Framing {
    let particles = spheres.particles;
    let around_all = || {
        let ids = (0..particles.len()).into_par_iter().with_min_len(1 << 14);
        let sphere = |id| {
            let center = spheres.center(id);
            Bounds { min: center, max: center }.grown(spheres.radius(id))
        };
        ids.map(sphere).reduce(|| Bounds::EMPTY, Bounds::union)
    };
    let mut framing = framing(particles);
    if outliers == Outliers::Shown {
        return Framing {
            bounds: around_all(),
            description: "framed on all particles".into(),
            warning: None,
            of_cell: false,
        };
    }
    if framing.bounds == particles.bounds() {
        framing.bounds = around_all();
    } else {
        // Of a crowd only the typical size: one huge outlier shall not ruin the frame.
        let mut sizes: Vec<f64> =
            sampled_ids(particles.len(), SAMPLES).map(|id| f64::from(spheres.radius(id))).collect();
        let [typical] = quantiles(&mut sizes, [0.5]).unwrap_or_default();
        let crowd = percentile_box(particles).grown(typical as f32);
        framing.bounds = if framing.warning.is_some() { crowd } else { framing.bounds.union(crowd) };
    }
    framing
}

/// Whether far outliers are framed too.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Outliers {
    /// What lies far outside the rest may be outside the picture.
    #[default]
    Left,
    /// The picture shows every particle.
    Shown,
}

/// The box between the 0.1 and the 99.9 percentile of each coordinate.
fn percentile_box(particles: &Particles) -> Bounds {
    let ends = particles.positions().offsets().into_par_iter().map(|column| {
        let mut values: Vec<f64> = sampled_ids(column.len(), SAMPLES).map(|id| column[id] as f64).collect();
        quantiles(&mut values, [TAIL, 1.0 - TAIL]).unwrap_or_default().map(|end| end as f32)
    });
    let ends: Vec<[f32; 2]> = ends.collect();
    let corner = |end: usize| Vec3::from_array(std::array::from_fn(|axis| ends[axis][end]));
    Bounds { min: corner(0), max: corner(1) }
}

/// The box around the cell, as offsets from the positions' origin.
fn cell_bounds(cell: &Cell, particles: &Particles) -> Bounds {
    let origin = particles.positions().origin();
    cell.corners().into_iter().fold(Bounds::EMPTY, |bounds, corner| bounds.with((corner - origin).as_vec3()))
}

/// Whether a box lies in the cell, give or take a tenth, and takes at least 8/10 of it along each axis on which the cell is not thin.
fn fills(middle: Bounds, cell: Bounds) -> bool {
    let (size, extent) = (cell.extent(), middle.extent());
    let around = cell.grown(0.1 * size.max_element());
    let inside = middle.min.cmpge(around.min).all() && middle.max.cmple(around.max).all();
    // Two-dimensional simulations have a cell of any thickness.
    let full = (0..3).all(|axis| extent[axis] >= 0.8 * size[axis] || size[axis] < 0.1 * size.max_element());
    inside && full && size.max_element() > 0.0
}

fn count_outside(particles: &Particles, bounds: Bounds) -> usize {
    let outside = |id: &usize| {
        let place = particles.positions().offset(*id);
        !(place.cmpge(bounds.min).all() && place.cmple(bounds.max).all())
    };
    (0..particles.len()).into_par_iter().with_min_len(1 << 14).filter(outside).count()
}

#[cfg(test)]
mod tests {
    use super::super::statistics::scrambled;
    use super::*;
    use crate::particles::{Columns, Values};
    use glam::DVec3;

    fn point(key: usize) -> DVec3 {
        let uniform = |key: usize| scrambled(key as u64) as f64 / u64::MAX as f64;
        DVec3::new(uniform(3 * key), uniform(3 * key + 1), uniform(3 * key + 2))
    }

    fn columns(count: usize, place: impl Fn(usize) -> DVec3) -> Columns {
        let mut columns = Columns::default();
        columns.positions.extend(&(0..count).map(place).collect::<Vec<_>>());
        columns
    }

    fn elements(symbols: &[&str], spacing: f64, unit: Option<&str>) -> Particles {
        let mut it = columns(symbols.len(), |id| DVec3::X * spacing * id as f64);
        let codes = (0..symbols.len() as u32).collect();
        let names = symbols.iter().map(|symbol| symbol.to_string()).collect();
        it.attributes.push(Attribute::new("element", 1, Values::Text { codes, names }));
        it.length_unit = unit.map(str::to_string);
        Particles::new(it).unwrap()
    }

    #[test]
    fn the_radius_of_the_file_comes_first() {
        let mut it = columns(2, point);
        it.attributes.push(Attribute::new("diameter", 1, Values::F32(vec![1.0, 2.0])));
        let (found, text) = radii(&Particles::new(it).unwrap());
        assert_eq!(found, Radii::PerParticle { attribute: 0, scale: 0.5 });
        assert_eq!(text, "radius diameter × 0.5");
    }

    #[test]
    fn sites_of_charge_are_no_atoms() {
        let mut it = columns(4, point);
        let names = ["OW", "HW1", "HW2", "MW"].map(String::from).to_vec();
        it.attributes.push(Attribute::new("name", 1, Values::Text { codes: vec![0, 1, 2, 3], names }));
        it.length_unit = Some("nm".into());
        let it = Particles::new(it).unwrap();
        let (found, text) = radii(&it);
        let radii: Vec<f32> = (0..4).map(|id| it.radius(&found, id)).collect();
        assert!((radii[0] - 0.152).abs() < 1e-6 && radii[1] == radii[2], "{radii:?}");
        assert!(
            (radii[3] - 0.03).abs() < 1e-6 && text.ends_with("in nm; sites of charge have 0.3 Å"),
            "{text}"
        );
    }

    #[test]
    fn elements_have_their_radii_in_the_unit_of_the_file() {
        let of = |it: &Particles| {
            let (found, text) = radii(it);
            (0..it.len())
                .map(|id| it.radius(&found, id))
                .chain([0.0])
                .zip(std::iter::repeat(text))
                .collect::<Vec<_>>()
        };
        let it = of(&elements(&["O", "H", "?"], 1.0, None));
        assert_eq!((it[0].0, it[1].0, it[2].0), (1.52, 1.2, UNKNOWN_RADIUS));
        let text = "radius of the elements of element, van der Waals × 1, in Å, as the file names no unit; 33.33 % \
                    unknown have 1.7 Å";
        assert_eq!(it[0].1, text);
        assert_eq!(of(&elements(&["O", "H"], 1.0, Some("nm")))[0].0, 0.1 * 1.52);
        assert_eq!(of(&elements(&["O", "H"], 0.1, None))[0].0, 0.1 * 1.52);
        assert_eq!(of(&elements(&["O", "H"], 0.1, Some("Å")))[0].0, 1.52);
    }

    #[test]
    fn else_half_the_spacing_is_the_radius() {
        let lattice =
            columns(1000, |id| DVec3::new((id % 10) as f64, (id / 10 % 10) as f64, (id / 100) as f64) * 0.25);
        let (found, text) = radii(&Particles::new(lattice).unwrap());
        assert_eq!(found, Radii::Uniform(0.125));
        assert_eq!(
            text,
            "radius 0.125: half the median distance 0.25 to the nearest neighbor (1,000 samples)"
        );
        for (count, why) in [(0, "no particles"), (1, "a single particle"), (5, "one place")] {
            let (found, text) = radii(&Particles::new(columns(count, |_| DVec3::ONE)).unwrap());
            assert_eq!(found, Radii::Uniform(0.5));
            assert!(text.ends_with(why), "{text}");
        }
    }

    #[test]
    fn far_outliers_do_not_decide_the_frame() {
        let far = |id: usize| if id == 77 { DVec3::splat(1e4) } else { point(id) };
        let found = framing(&Particles::new(columns(20_000, far)).unwrap());
        assert!(found.bounds.extent().max_element() < 1.0, "{found:?}");
        let wanted = "0.005 % of particles lie up to 100";
        assert!(found.warning.is_some_and(|text| text.starts_with(wanted) && text.contains("--frame-all")));
    }

    #[test]
    fn without_far_outliers_all_are_framed() {
        let near = |id: usize| if id == 77 { DVec3::splat(1.3) } else { point(id) };
        let flat = |id: usize| if id == 77 { DVec3::Z } else { point(id) * DVec3::new(9.0, 9.0, 0.0) };
        let heap = |id: usize| if id == 77 { DVec3::X } else { DVec3::ZERO };
        for (count, place) in
            [(20_000, &near as &dyn Fn(usize) -> DVec3), (20_000, &flat), (20_000, &heap), (3, &near)]
        {
            let it = Particles::new(columns(count, place)).unwrap();
            let found = framing(&it);
            assert_eq!((found.bounds, found.warning), (it.bounds(), None));
        }
        assert!(framing(&Particles::new(columns(0, point)).unwrap()).bounds.is_empty());
    }

    #[test]
    fn a_filled_cell_is_framed_and_an_empty_one_is_not() {
        let framed = |vectors: [DVec3; 3], place: &dyn Fn(usize) -> DVec3| {
            let mut it = columns(5000, place);
            it.cell = Some(Cell { origin: DVec3::ZERO, vectors, periodic: [true; 3] });
            framing(&Particles::new(it).unwrap()).description
        };
        let cube = [DVec3::X, DVec3::Y, DVec3::Z];
        assert_eq!(framed(cube, &point), "framed on the cell");
        assert_eq!(framed(cube, &|id| point(id) * 0.3), "framed on all particles");
        assert_eq!(framed(cube, &|id| point(id) + 0.5), "framed on all particles");
        let tilted = [DVec3::X, DVec3::new(0.5, 1.0, 0.0), DVec3::Z];
        let sheared = |id: usize| point(id) + DVec3::X * 0.5 * point(id).y;
        assert_eq!(framed(tilted, &sheared), "framed on the cell");
        let thin = [DVec3::X, DVec3::Y, DVec3::Z * 0.01];
        assert_eq!(framed(thin, &|id| point(id) * DVec3::new(1.0, 1.0, 0.0)), "framed on the cell");
    }
}
