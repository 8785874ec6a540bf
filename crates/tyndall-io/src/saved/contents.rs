//! From sections to particles: over a mapped file, whose pages stay where they are, or over bytes, from which checked copies are made.

use std::path::Path;
use std::sync::Arc;

use bytemuck::Pod;
use memmap2::Mmap;
use tyndall::frozen::{Frozen, Region};
use tyndall::particles::{Attribute, Columns, Entry, FrozenValues, Positions, Values, View};
use tyndall::{DVec3, Error, Particles, Result};

use super::about::{self, About};
use super::container::Table;
use super::fault;

/// A file's content, and how sections become arrays.
pub(super) struct Contents<'a> {
    path: &'a Path,
    table: &'a Table,
    whole: Whole<'a>,
}

enum Whole<'a> {
    Mapped(Arc<Mmap>),
    Copied(&'a [u8]),
}

impl<'a> Contents<'a> {
    /// Arrays are parts of the mapped file, and nobody looks at what is in them.
    pub(super) fn mapped(path: &'a Path, table: &'a Table, map: Arc<Mmap>) -> Self {
        Self { path, table, whole: Whole::Mapped(map) }
    }

    /// Arrays are copies, made when the section has the right checksum.
    pub(super) fn copied(path: &'a Path, table: &'a Table, bytes: &'a [u8]) -> Self {
        Self { path, table, whole: Whole::Copied(bytes) }
    }

    /// What the file says about itself.
    pub(super) fn about(&self) -> Result<About> {
        let bytes = match &self.whole {
            Whole::Mapped(map) => &map[..],
            Whole::Copied(bytes) => bytes,
        };
        About::parse(self.path, self.table.checked(self.path, bytes, "about")?)
    }

    /// The section of that name in the mapped file.
    pub(super) fn region(&self, name: &str) -> Option<Region> {
        let Whole::Mapped(map) = &self.whole else { return None };
        Region::new(map.clone(), self.table.section(name)?.range.clone())
    }

    /// A section as an array.
    pub(super) fn array<T: Pod + Send + Sync>(&self, name: &str) -> Result<Frozen<T>> {
        let no_array = || fault(self.path, name, format!("no whole number of items of {}", size_of::<T>()));
        match &self.whole {
            Whole::Mapped(_) => {
                let region =
                    self.region(name).ok_or_else(|| fault(self.path, name, "the section is not there"))?;
                Frozen::of(region).ok_or_else(no_array)
            }
            Whole::Copied(bytes) => {
                let bytes = self.table.checked(self.path, bytes, name)?;
                if !bytes.len().is_multiple_of(size_of::<T>()) {
                    return Err(no_array());
                }
                Ok(bytemuck::pod_collect_to_vec::<u8, T>(bytes).into())
            }
        }
    }

    /// By id the places in the source, where some particles were dropped.
    pub(super) fn places(&self) -> Result<Option<Frozen<u64>>> {
        self.table.section("places").map(|_| self.array("places")).transpose()
    }

    /// The bonds, by ids, if there are some.
    fn bonds(&self, about: &About) -> Result<Option<Frozen<[u32; 2]>>> {
        if about.bonds == 0 {
            return Ok(None);
        }
        let bonds: Frozen<[u32; 2]> = self.array("bonds")?;
        if bonds.len() as u64 != about.bonds {
            let what = format!("{} bonds, there should be {}", bonds.len(), about.bonds);
            return Err(fault(self.path, "bonds", what));
        }
        Ok(Some(bonds))
    }

    /// The particles with the attributes at `places`, among which is that of the radii.
    pub(super) fn particles(&self, about: &About, places: &[usize]) -> Result<Particles> {
        let mut offsets = Vec::new();
        for axis in ["x", "y", "z"] {
            let name = format!("position.{axis}");
            let column: Frozen<f32> = self.array(&name)?;
            if column.len() as u64 != about.particles {
                let what = format!("{} numbers for {} particles", column.len(), about.particles);
                return Err(fault(self.path, name, what));
            }
            offsets.push(column);
        }
        let offsets = <[Frozen<f32>; 3]>::try_from(offsets).expect("three axes");
        let columns = Columns {
            positions: Positions::from_frozen(DVec3::from_array(about.origin), offsets),
            attributes: places
                .iter()
                .map(|&place| self.attribute(place, &about.attributes[place]))
                .collect::<Result<_>>()?,
            radii: Some(about.radii.radii(places)),
            cell: about.cell.map(about::Cell::cell),
            time: about.time,
            time_unit: about.time_unit.clone(),
            length_unit: about.length_unit.clone(),
            bonds: Vec::new(),
        };
        let entry = Entry {
            dropped: about.dropped.dropped(),
            places: self.places()?,
            bounds: about.bounds(),
            bonds: self.bonds(about)?,
        };
        Particles::restore(columns, entry).map_err(|error| fault(self.path, "about", error.to_string()))
    }

    fn attribute(&self, place: usize, about: &about::Attribute) -> Result<Attribute> {
        let section = format!("attribute.{place}");
        let values = match (about.values.as_str(), &about.names) {
            ("f32", None) => FrozenValues::F32(self.array(&section)?),
            ("f64", None) => FrozenValues::F64(self.array(&section)?),
            ("i32", None) => FrozenValues::I32(self.array(&section)?),
            ("i64", None) => FrozenValues::I64(self.array(&section)?),
            ("u8", None) => FrozenValues::U8(self.array(&section)?),
            ("text", Some(names)) => {
                FrozenValues::Text { codes: self.array(&section)?, names: names.clone() }
            }
            (kind, _) => return Err(fault(self.path, section, format!("no values can be '{kind}'"))),
        };
        let unit = about.unit.clone();
        let values = Values::Frozen(values);
        Ok(Attribute { name: about.name.clone(), components: about.components, unit, values })
    }

    /// Whether all that downstream takes for granted of particles is so.
    pub(super) fn check_values(&self, about: &About, places: &[usize], particles: &Particles) -> Result<()> {
        for (place, attribute) in places.iter().zip(particles.attributes()) {
            if let View::Text { codes, names } = attribute.values.view()
                && let Some(code) = codes.iter().find(|&&code| code as usize >= names.len())
            {
                let what = format!("word {code} of '{}', which has {}", attribute.name, names.len());
                return Err(fault(self.path, format!("attribute.{place}"), what));
            }
        }
        if particles.bonds().len() as u64 != about.bonds {
            let what = "bonds that are there twice, or of particles that are not there";
            return Err(Error::format(self.path, "bonds", what, "it was not written by Tyndall"));
        }
        match particles.check() {
            true => Ok(()),
            false => {
                let what = "positions that are not finite, or radii below 0";
                Err(Error::format(self.path, "", what, "it was not written by Tyndall"))
            }
        }
    }
}
