//! A structure taken apart into arrays and a few facts, and put together again over arrays that stay where they are.
//!
//! Whatever the arrays hold, no walk leaves them, goes on forever or panics: `bvh` and `pkd` have no pointers, and where arrays are as
//! long as the number of particles demands, every place that a walk computes is in them; the pointers of `treelets` are looked at when
//! it is put together. Wrong numbers in the arrays make wrong pictures, no more.

use glam::DVec3;

use super::treelets::Treelets;
use super::{Bvh, Kind, PackingError, Pkd, Store, Structure};
use crate::frozen::{Frozen, Region};
use crate::math::Bounds;
use bytemuck::Pod;

/// All of a structure but its arrays.
#[derive(Clone, Debug, PartialEq)]
pub struct Facts {
    /// Which structure, and how it was built.
    pub kind: Kind,
    /// How many particles.
    pub count: usize,
    /// The box of all particles with their radii; of `pkd` that of their centers. Empty without particles.
    pub bounds: Bounds,
    /// Where the radii are.
    pub radii: RadiiOf,
    /// The largest radius: only `pkd` needs it.
    pub largest_radius: f32,
    /// What packing cost, where centers are packed.
    pub packing_error: Option<PackingError>,
}

/// How a structure holds radii.
#[derive(Clone, Debug, PartialEq)]
pub enum RadiiOf {
    /// One for all.
    One(f32),
    /// At most 256 different ones, in ascending order; each particle has a byte in an array.
    Table(Vec<f32>),
    /// Each its own, in an array.
    Each,
    /// Each its own, packed to a byte in equal ratios within its leaf.
    Packed,
}

/// An array's name and memory.
pub type Named<'a> = (&'static str, &'a [u8]);

/// Why arrays are no structure: the name of the array, and what is wrong with it.
pub type Broken = (&'static str, String);

impl Structure {
    /// The facts and the arrays of this structure. None of `brute`, and where radii were scaled since it was built.
    pub fn saved(&self) -> Option<(Facts, Vec<Named<'_>>)> {
        match &self.store {
            Store::Bvh(bvh) => bvh.saved(),
            Store::Pkd(pkd) => pkd.saved(),
            Store::Treelets(treelets) => treelets.saved(),
            Store::Brute(_) => None,
        }
    }

    /// Puts a structure together. `array` gives the memory of an array by its name; centers are measured from `origin`; `places` are the
    /// places in the file, by id, where some particles were dropped.
    ///
    /// Looks at no array but those that have pointers.
    pub fn restore(
        facts: Facts,
        origin: DVec3,
        places: Option<Frozen<u64>>,
        array: &mut dyn FnMut(&'static str) -> Option<Region>,
    ) -> Result<Self, Broken> {
        let arrays = &mut Arrays(array);
        let store = match facts.kind {
            Kind::Bvh(packing) => Store::Bvh(Bvh::restore(facts, packing, arrays)?),
            Kind::Pkd(options) => Store::Pkd(Pkd::restore(facts, options, arrays)?),
            Kind::Treelets(options) => Store::Treelets(Treelets::restore(facts, options, arrays)?),
            Kind::Brute => return Err(("", "brute force has no structure".into())),
        };
        Ok(Self { store, origin, places, replicas: None })
    }
}

/// The arrays by their names.
pub(super) struct Arrays<'a>(&'a mut dyn FnMut(&'static str) -> Option<Region>);

impl Arrays<'_> {
    pub(super) fn region(&mut self, name: &'static str) -> Result<Region, Broken> {
        self.0(name).ok_or_else(|| (name, "it is not there".into()))
    }

    /// As many items as there are.
    pub(super) fn any<T: Pod + Send + Sync>(&mut self, name: &'static str) -> Result<Frozen<T>, Broken> {
        let region = self.region(name)?;
        let bytes = region.bytes().len();
        Frozen::of(region).ok_or_else(|| (name, format!("{bytes} bytes are no array of {}", size_of::<T>())))
    }

    /// `count` items.
    pub(super) fn of<T: Pod + Send + Sync>(
        &mut self,
        name: &'static str,
        count: usize,
    ) -> Result<Frozen<T>, Broken> {
        let array = self.any(name)?;
        match array.len() == count {
            true => Ok(array),
            false => Err((name, format!("it has {} items, wanted {count}", array.len()))),
        }
    }
}
