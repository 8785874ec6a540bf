//! The particles: columns of positions, radii and attributes, checked once on entry.
//!
//! A reader fills [`Columns`]; [`Particles::new`] drops what cannot be drawn (positions that are not finite, radii that are
//! negative or not finite), counts it, and keeps the place in the file of what stays. After that nothing downstream checks again.
//!
//! Invariants of [`Particles`]: all columns have the same length, below 2^32; positions are finite; radii are finite and >= 0.

mod bonds;
mod cell;
mod positions;
mod radii;
mod values;

use std::sync::OnceLock;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::frozen::Frozen;
use crate::math::Bounds;
use bonds::Bonds;
pub use cell::Cell;
pub use positions::Positions;
pub use radii::Radii;
pub(crate) use radii::is_radius;
use radii::{radii_by_name, radius_of};
pub use values::{Attribute, FrozenValues, Values, View};

/// What a reader hands over: nothing is checked yet.
#[derive(Clone, Debug, Default)]
pub struct Columns {
    /// Centers.
    pub positions: Positions,
    /// Attributes, in the order of the file.
    pub attributes: Vec<Attribute>,
    /// Sizes, where the format itself defines them. `None`: an attribute named like a radius or a diameter is looked for.
    pub radii: Option<Radii>,
    /// The simulation's cell, if the file has one.
    pub cell: Option<Cell>,
    /// The simulation's time or step.
    pub time: Option<f64>,
    /// The unit of the time, where the file or its format tells: `ps`; `step` where steps are counted, `a` of a scale factor.
    pub time_unit: Option<String>,
    /// The unit of lengths, where the file or its format tells.
    pub length_unit: Option<String>,
    /// Pairs of particles that are bonded, by their places in the columns.
    pub bonds: Vec<[u32; 2]>,
}

/// How many particles were left out on entry, and why.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Dropped {
    /// A coordinate was NaN or infinite.
    pub position: u64,
    /// The radius was negative, NaN or infinite.
    pub radius: u64,
}

impl Dropped {
    /// All of them.
    pub fn total(&self) -> u64 {
        self.position + self.radius
    }
}

/// What [`Particles::new`] found out about columns.
#[derive(Clone, Debug)]
pub struct Entry {
    /// How many were dropped.
    pub dropped: Dropped,
    /// By id the places in the file, where some were dropped.
    pub places: Option<Frozen<u64>>,
    /// The box of the centers that stayed, as offsets from the origin.
    pub bounds: Bounds,
    /// Bonds by ids, in the place of those of the columns: they are looked at when somebody asks for them.
    pub bonds: Option<Frozen<[u32; 2]>>,
}

/// Particles that can be drawn. See the module for the invariants.
#[derive(Clone, Debug)]
pub struct Particles {
    positions: Positions,
    attributes: Vec<Attribute>,
    radii: Option<Radii>,
    cell: Option<Cell>,
    time: Option<f64>,
    time_unit: Option<String>,
    length_unit: Option<String>,
    dropped: Dropped,
    places: Option<Frozen<u64>>,
    bonds: Bonds,
    /// The box of the centers, once it is known.
    bounds: OnceLock<Bounds>,
}

impl Particles {
    /// Checks the columns and drops, counting, what cannot be drawn.
    ///
    /// Fails with [`Error::Setting`] if a column's length does not fit or there are 2^32 - 1 particles or more.
    pub fn new(columns: Columns) -> Result<Self> {
        let Columns { mut positions, mut attributes, radii, cell, time, time_unit, length_unit, bonds } =
            columns;
        let count = positions.len();
        check_lengths(count, &attributes)?;
        let radii = radii.or_else(|| radii_by_name(&attributes));

        let [x, y, z] = positions.offsets();
        let finite = |id: usize| x[id].is_finite() && y[id].is_finite() && z[id].is_finite();
        let sized = |id: usize| match &radii {
            Some(radii) => (0.0..f32::INFINITY).contains(&radius_of(radii, &attributes, id)),
            None => true,
        };
        let (bad_positions, bad_radii) = (0..count)
            .into_par_iter()
            .map(|id| if !finite(id) { (1, 0) } else { (0, u64::from(!sized(id))) })
            .reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
        let dropped = Dropped { position: bad_positions, radius: bad_radii };

        let mut places = None;
        if dropped.total() > 0 {
            let keep: Vec<bool> = (0..count).into_par_iter().map(|id| finite(id) && sized(id)).collect();
            retain(&mut positions, &mut attributes, &keep);
            let kept: Vec<u64> = (0..count as u64).filter(|&id| keep[id as usize]).collect();
            places = Some(kept.into());
        }
        let bonds = Bonds::new(bonds, count, places.as_deref());
        let bounds = OnceLock::new();
        Ok(Self {
            positions,
            attributes,
            radii,
            cell,
            time,
            time_unit,
            length_unit,
            dropped,
            places,
            bonds,
            bounds,
        })
    }

    /// Takes columns that [`Particles::new`] has checked before, as they were saved, with what else it knew. Nothing is looked at but
    /// lengths, and bonds of the columns.
    ///
    /// Fails with [`Error::Setting`] if a length does not fit, or the radii refer to an attribute that is not there.
    pub fn restore(columns: Columns, entry: Entry) -> Result<Self> {
        let Columns { positions, attributes, radii, cell, time, time_unit, length_unit, bonds } = columns;
        let Entry { dropped, places, bounds, bonds: saved_bonds } = entry;
        let count = positions.len();
        check_lengths(count, &attributes)?;
        let is_known = |place: &usize| attributes.get(*place).is_some_and(|it| it.components == 1);
        let fits = match &radii {
            None | Some(Radii::Uniform(_)) => true,
            Some(Radii::PerType { attribute, radii }) => is_known(attribute) && !radii.is_empty(),
            Some(Radii::PerParticle { attribute, .. }) => is_known(attribute),
        };
        if !fits {
            return Err(Error::setting("radii", "of an attribute", "one of the scalars that are there"));
        }
        if places.as_ref().is_some_and(|places| places.len() != count) {
            return Err(Error::setting("places", "of another number", format!("one for {count} particles")));
        }
        let bonds = saved_bonds.map_or_else(|| Bonds::new(bonds, count, None), Bonds::saved);
        let bounds = OnceLock::from(bounds);
        Ok(Self {
            positions,
            attributes,
            radii,
            cell,
            time,
            time_unit,
            length_unit,
            dropped,
            places,
            bonds,
            bounds,
        })
    }

    /// Whether all positions are finite, and all radii neither negative nor infinite.
    pub fn check(&self) -> bool {
        let sized = |id| match &self.radii {
            Some(radii) => (0.0..f32::INFINITY).contains(&self.radius(radii, id)),
            None => true,
        };
        let ids = (0..self.len()).into_par_iter().with_min_len(1 << 14);
        ids.all(|id| self.positions.offset(id).is_finite() && sized(id))
    }

    /// The same particles with those attributes only that `wanted` chooses, and the one that their radii follow.
    pub fn with_attributes(self, wanted: impl Fn(&Attribute) -> bool) -> Self {
        let Self { attributes, radii, .. } = self;
        let mut radii = radii;
        let place_of_radii = match &mut radii {
            None | Some(Radii::Uniform(_)) => None,
            Some(Radii::PerType { attribute, .. } | Radii::PerParticle { attribute, .. }) => Some(attribute),
        };
        let followed = place_of_radii.as_ref().map(|place| **place);
        let mut kept = Vec::new();
        for (place, attribute) in attributes.into_iter().enumerate() {
            if Some(place) == followed || wanted(&attribute) {
                kept.push((place, attribute));
            }
        }
        if let Some(place) = place_of_radii {
            *place = kept.iter().position(|(old, _)| old == place).expect("it was kept");
        }
        let attributes = kept.into_iter().map(|(_, attribute)| attribute).collect();
        Self { attributes, radii, ..self }
    }

    /// The same particles with one more attribute. Fails with [`Error::Setting`] if it has another number of values.
    pub fn with_attribute(mut self, attribute: Attribute) -> Result<Self> {
        check_lengths(self.len(), std::slice::from_ref(&attribute))?;
        self.attributes.push(attribute);
        Ok(self)
    }

    /// Those of the particles that are flagged, a flag for each, with their places in the file.
    pub fn retained(self, keep: &[bool]) -> Self {
        let Self { mut positions, mut attributes, places, .. } = self;
        retain(&mut positions, &mut attributes, keep);
        let place = |id: usize| places.as_ref().map_or(id as u64, |places| places[id]);
        let places: Vec<u64> = (0..keep.len()).filter(|&id| keep[id]).map(place).collect();
        let ids: Vec<u64> = (0..keep.len() as u64).filter(|&id| keep[id as usize]).collect();
        let bonds = Bonds::new(self.bonds.of(keep.len()).to_vec(), keep.len(), Some(&ids));
        Self { positions, attributes, places: Some(places.into()), bonds, bounds: OnceLock::new(), ..self }
    }

    /// The same particles, whose lengths and time are told in other units.
    pub(crate) fn with_units(self, length_unit: Option<String>, time_unit: Option<String>) -> Self {
        Self { length_unit, time_unit, ..self }
    }

    /// The same particles, of whose attributes other units are told.
    pub(crate) fn with_attributes_told(mut self, tell: impl Fn(&mut [Attribute])) -> Self {
        tell(&mut self.attributes);
        self
    }

    /// The same particles with radii `radii`, which may refer to their attributes.
    pub fn with_radii(self, radii: Radii) -> Self {
        Self { radii: Some(radii), ..self }
    }

    /// The same particles with radii `radii`, which may refer to their attributes, but for those that cannot be drawn with them: these are dropped and counted.
    pub(crate) fn sized(self, radii: Radii) -> Self {
        let ids = (0..self.len()).into_par_iter().with_min_len(1 << 14);
        let keep: Vec<bool> = ids.map(|id| (0.0..f32::INFINITY).contains(&self.radius(&radii, id))).collect();
        let bad = keep.par_iter().filter(|keeps| !**keeps).count() as u64;
        let mut sized = if bad > 0 { self.retained(&keep) } else { self };
        sized.dropped.radius += bad;
        sized.with_radii(radii)
    }

    /// The same particles, whose positions are measured from `origin`: of frames with one origin places can be compared.
    pub fn measured_from(self, origin: DVec3) -> Self {
        let before = self.positions.origin();
        if before == origin {
            return self;
        }
        let shift = before - origin;
        let column = |axis: usize| {
            let offsets = self.positions.offsets()[axis].par_iter();
            offsets.map(|offset| (f64::from(*offset) + shift[axis]) as f32).collect()
        };
        let positions = Positions::from_offsets(origin, [0, 1, 2].map(column));
        Self { positions, bounds: OnceLock::new(), ..self }
    }

    /// The same particles in the coordinates whose zero is `center` of their own.
    pub(crate) fn seen_from(self, center: DVec3) -> Self {
        let Self { mut positions, cell, .. } = self;
        positions.measure_from(center);
        let cell = cell.map(|cell| Cell { origin: cell.origin - center, ..cell });
        Self { positions, cell, ..self }
    }

    /// The same particles with another cell.
    pub(crate) fn in_cell(self, cell: Cell) -> Self {
        Self { cell: Some(cell), ..self }
    }

    /// The same particles elsewhere: `offsets` from the origin, and other values of some attributes. Fails with [`Error::Setting`] if a
    /// place is not finite.
    pub(crate) fn moved(mut self, offsets: [Vec<f32>; 3], values: Vec<(usize, Values)>) -> Result<Self> {
        if offsets.par_iter().any(|column| column.par_iter().any(|it| !it.is_finite())) {
            return Err(Error::setting("positions", "beyond all numbers", "where particles can be moved to"));
        }
        for (place, values) in values {
            self.attributes[place].values = values;
        }
        check_lengths(offsets[0].len(), &self.attributes)?;
        let positions = Positions::from_offsets(self.positions.origin(), offsets);
        Ok(Self { positions, bounds: OnceLock::new(), ..self })
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Centers.
    pub fn positions(&self) -> &Positions {
        &self.positions
    }

    /// Attributes, in the order of the file.
    pub fn attributes(&self) -> &[Attribute] {
        &self.attributes
    }

    /// The attribute of that name: exactly, else ignoring case.
    pub fn attribute(&self, name: &str) -> Option<&Attribute> {
        let exact = self.attributes.iter().find(|it| it.name == name);
        exact.or_else(|| self.attributes.iter().find(|it| it.name.eq_ignore_ascii_case(name)))
    }

    /// Sizes that the file gives; `None` if it gives none.
    pub fn radii(&self) -> Option<&Radii> {
        self.radii.as_ref()
    }

    /// The radius of particle `id` by `radii`, which may be other than [`Particles::radii`].
    #[inline(always)]
    pub fn radius(&self, radii: &Radii, id: usize) -> f32 {
        radius_of(radii, &self.attributes, id)
    }

    /// The simulation's cell.
    pub fn cell(&self) -> Option<&Cell> {
        self.cell.as_ref()
    }

    /// The simulation's time or step.
    pub fn time(&self) -> Option<f64> {
        self.time
    }

    /// The unit of the time, where it is known: `step` where steps are counted, `a` of a cosmological scale factor.
    pub fn time_unit(&self) -> Option<&str> {
        self.time_unit.as_deref()
    }

    /// The unit of lengths.
    pub fn length_unit(&self) -> Option<&str> {
        self.length_unit.as_deref()
    }

    /// Pairs of particles that are bonded, by their ids; each pair once, the smaller id first, in order.
    pub fn bonds(&self) -> &[[u32; 2]] {
        self.bonds.of(self.len())
    }

    /// How many were dropped on entry.
    pub fn dropped(&self) -> Dropped {
        self.dropped
    }

    /// The place in the file of particle `id`, counted from 0 and with the dropped ones.
    #[inline(always)]
    pub fn place(&self, id: usize) -> u64 {
        self.places.as_ref().map_or(id as u64, |places| places[id])
    }

    /// The same particles as a part of a whole, in which their places begin with this one.
    pub fn numbered_from(self, first: u64) -> Self {
        let places = (0..self.len()).map(|id| first + self.place(id)).collect();
        if first == 0 { self } else { self.with_places(places) }
    }

    /// The same particles with these places in the file, one for each.
    pub(crate) fn with_places(self, places: Vec<u64>) -> Self {
        Self { places: Some(places.into()), ..self }
    }

    /// Gives up all but the places in the file, if some particles were dropped.
    pub(crate) fn into_places(self) -> Option<Frozen<u64>> {
        self.places
    }

    /// The least and the greatest coordinates of the centers, in those of the file; `None` without particles.
    pub fn world_bounds(&self) -> Option<[[f64; 3]; 2]> {
        let bounds = self.bounds();
        let decimal = |corner: Vec3| std::array::from_fn(|axis| self.positions.decimal(axis, corner[axis]));
        (!bounds.is_empty()).then(|| [decimal(bounds.min), decimal(bounds.max)])
    }

    /// The position of particle `id` in the coordinates of its file, with as few digits as say what is stored.
    pub fn world_position(&self, id: usize) -> [f64; 3] {
        let offset = self.positions.offset(id);
        std::array::from_fn(|axis| self.positions.decimal(axis, offset[axis]))
    }

    /// Memory that the columns take, in bytes.
    pub fn bytes(&self) -> u64 {
        let places = self.places.as_ref().map_or(0, |places| size_of_val(&places[..]));
        let attributes = self.attributes.iter().map(|it| it.values.len() * it.values.value_bytes());
        (12 * self.len() + places + self.bonds.bytes() + attributes.sum::<usize>()) as u64
    }

    /// The places in the file of all, by id; none where none was dropped.
    pub fn places(&self) -> Option<&[u64]> {
        self.places.as_deref()
    }

    /// The box of the centers, as offsets from the origin.
    pub fn bounds(&self) -> Bounds {
        let around = || {
            let ids = (0..self.len()).into_par_iter().with_min_len(1 << 14);
            ids.fold(|| Bounds::EMPTY, |bounds, id| bounds.with(self.positions.offset(id)))
                .reduce(|| Bounds::EMPTY, Bounds::union)
        };
        *self.bounds.get_or_init(around)
    }
}

/// Leaves those of the particles that are flagged.
fn retain(positions: &mut Positions, attributes: &mut [Attribute], keep: &[bool]) {
    positions.retain(keep);
    for attribute in attributes {
        attribute.values.retain(attribute.components, keep);
    }
}

/// Refuses too many particles, and columns that have more or less values.
fn check_lengths(count: usize, attributes: &[Attribute]) -> Result<()> {
    if count >= u32::MAX as usize {
        return Err(Error::setting("particles", count, "at most 2^32 - 2 in one layer: split the file"));
    }
    match attributes.iter().find(|it| Some(it.values.len()) != count.checked_mul(it.components)) {
        None => Ok(()),
        Some(attribute) => {
            let wanted = format!("{count} particles need {} values each", attribute.components);
            Err(Error::setting(&attribute.name, attribute.values.len(), wanted))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn columns(positions: &[DVec3], radii: &[f32]) -> Columns {
        let mut columns = Columns::default();
        columns.positions.extend(positions);
        columns.attributes.push(Attribute::new("radius", 1, Values::F32(radii.to_vec())));
        columns
    }

    #[test]
    fn what_cannot_be_drawn_is_dropped_and_counted() {
        let nan = DVec3::new(f64::NAN, 0.0, 0.0);
        let positions = [DVec3::ONE, nan, DVec3::INFINITY, DVec3::ZERO, DVec3::X];
        let particles = Particles::new(columns(&positions, &[1.0, 1.0, -1.0, -2.0, 3.0])).unwrap();
        assert_eq!(particles.len(), 2);
        assert_eq!(particles.dropped(), Dropped { position: 2, radius: 1 });
        assert_eq!((particles.place(0), particles.place(1)), (0, 4));
        assert_eq!(particles.attribute("Radius").unwrap().values, Values::F32(vec![1.0, 3.0]));
        assert_eq!(particles.positions().world(1), DVec3::X);
    }

    #[test]
    fn frames_can_be_measured_from_one_origin() {
        let positions = [DVec3::new(1e6, 2.0, -3.0), DVec3::new(1e6 + 0.25, 5.0, 1.0)];
        let particles = Particles::new(columns(&positions, &[1.0, 2.0])).unwrap();
        let bounds = particles.bounds();
        let origin = DVec3::new(1e6 - 1.0, 0.5, 0.0);
        let shift = (particles.positions().origin() - origin).as_vec3();
        let moved = particles.measured_from(origin);
        assert_eq!(moved.positions().origin(), origin);
        assert_eq!([0, 1].map(|id| moved.positions().world(id)), positions);
        assert!(moved.bounds().min.abs_diff_eq(bounds.min + shift, 1e-6));
    }

    #[test]
    fn coordinates_far_from_zero_keep_their_precision() {
        let far = DVec3::new(6.4e6, -2.1e7, 9.9e8);
        let positions: Vec<DVec3> = (0..100).map(|k| far + DVec3::splat(k as f64 * 1e-3)).collect();
        let particles = Particles::new(columns(&positions, &[1.0; 100])).unwrap();
        for (id, position) in positions.iter().enumerate() {
            assert!(particles.positions().world(id).abs_diff_eq(*position, 1e-6), "particle {id}");
        }
    }

    #[test]
    fn coordinates_are_told_with_the_digits_of_the_file() {
        let positions = [DVec3::new(0.8, 1234.567, -1e-7), DVec3::new(0.1, 1230.001, 3.0)];
        let particles = Particles::new(columns(&positions, &[1.0; 2])).unwrap();
        for (id, position) in positions.iter().enumerate() {
            let told = DVec3::from_array(particles.world_position(id));
            let error = (told - *position).abs();
            assert!(error.max_element() < 1e-6, "{told}");
        }
        assert_eq!(particles.world_position(0)[0], 0.8);
        let around = Positions::from_offsets(DVec3::splat(0.8), [vec![-0.8], vec![2e20], vec![0.0]]);
        assert_eq!((around.decimal(0, -0.8).to_bits(), around.decimal(1, 2e20)), (0, 2e20));
        let [min, max] = particles.world_bounds().unwrap();
        assert_eq!((min[0], min[1], max[1]), (0.1, 1230.001, 1234.567));
        assert_eq!(particles.bytes(), 2 * (12 + 4));
    }

    #[test]
    fn a_column_of_another_length_is_refused() {
        assert!(Particles::new(columns(&[DVec3::ONE], &[1.0, 2.0])).is_err());
    }

    #[test]
    fn no_particles_are_fine() {
        let particles = Particles::new(Columns::default()).unwrap();
        assert!(particles.is_empty() && particles.bounds().is_empty());
    }
}
