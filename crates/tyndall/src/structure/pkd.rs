//! The P-k-d tree: one left-balanced heap over all particles, so a balanced k-d tree that has no nodes beside them.
//!
//! Regions are grown by the largest radius. See `structure/heap/` for what holds, how it is walked, and the source.

use fearless_simd::{Level, dispatch};
use glam::Vec3;

use super::build::Record;
use super::heap::{self, Columns, Heap, Stack};
use super::saved::{Arrays, Broken, Facts, Named};
use super::search::{Observer, Search};
#[cfg(feature = "gpu")]
use super::selection::Bits;
use super::selection::Test;
use super::{Hit, Kind, box_slack};
use crate::error::{Error, Result};
use crate::math::{Bounds, Ray};
use crate::progress::Progress;
pub use heap::{Axis, Options, Order};

/// See the module.
#[derive(Clone)]
pub struct Pkd {
    columns: Columns,
    heap: Heap,
    slack: f32,
    options: Options,
}

impl Pkd {
    /// Builds over `records`, in parallel; `radius` is that of all where the records have none. Fails only when interrupted.
    pub(super) fn build<const N: usize>(
        mut records: Vec<Record<N>>,
        radius: f32,
        options: Options,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let heap = Heap::over(&records, radius, 0);
        heap::sort(&mut records, heap.centers, 0, options, progress);
        if progress.cancelled() {
            return Err(Error::Interrupted);
        }
        let place = |node| heap::place_in_order(node, records.len());
        let columns = Columns::gather(&records, radius, place, &[heap], options);
        Ok(Self { columns, slack: box_slack(&heap.centers.grown(heap.radius)), heap, options })
    }

    /// See [`super::Structure::saved`].
    pub(super) fn saved(&self) -> Option<(Facts, Vec<Named<'_>>)> {
        let (radii, arrays) = self.columns.saved()?;
        let facts = Facts {
            kind: Kind::Pkd(self.options),
            count: self.ids().len(),
            bounds: self.heap.centers,
            radii,
            largest_radius: self.heap.radius,
            packing_error: None,
        };
        Some((facts, arrays))
    }

    /// See [`super::Structure::restore`].
    pub(super) fn restore(
        facts: Facts,
        options: Options,
        arrays: &mut Arrays,
    ) -> std::result::Result<Self, Broken> {
        let Facts { count, bounds: centers, radii, largest_radius: radius, .. } = facts;
        let columns = Columns::restore(count, &radii, arrays)?;
        let heap = Heap { centers, radius, first: 0 };
        Ok(Self { columns, slack: box_slack(&centers.grown(radius)), heap, options })
    }

    /// See [`super::Structure::intersect`].
    pub fn intersect(&self, ray: &Ray, except: Option<u32>) -> Option<Hit> {
        self.search(Search::nearest(ray, except))
    }

    /// See [`super::Structure::occluded`].
    pub fn occluded(&self, ray: &Ray, except: Option<u32>) -> bool {
        self.search(Search::any(ray, except)).is_some()
    }

    /// Ends a search that has begun.
    pub(super) fn search<O: Observer>(&self, mut search: Search<O>) -> Option<Hit> {
        let mut stack = Stack::default();
        let heap = (&self.heap, self.ids().len());
        let (columns, slack, options) = (&self.columns, self.slack, self.options);
        let order = options.order;
        dispatch!(Level::new(), simd => heap::walk(simd, columns, heap, slack, order, &mut search, &mut stack));
        search.found(self.ids())
    }

    /// The same particles with radii `scale` times those that were built.
    pub(super) fn scaled(mut self, scale: f32) -> Self {
        self.columns.scale_radii(scale);
        self.slack = box_slack(&self.bounds());
        self
    }

    /// See [`super::Structure::show`].
    pub(super) fn show(&mut self, tests: &[Test]) -> u64 {
        self.columns.show(tests, std::slice::from_ref(&self.heap))
    }

    /// See [`super::Structure::thinned`].
    pub(super) fn thin(&mut self, keeps: impl Fn(u32) -> bool + Sync) {
        self.columns.thin(keeps, std::slice::from_ref(&self.heap));
    }

    /// See [`super::Structure::shows`].
    pub(super) fn shows(&self, node: u32) -> bool {
        self.columns.shows(node as usize)
    }

    /// What is shown, where that is not all.
    #[cfg(feature = "gpu")]
    pub(super) fn shown_bits(&self) -> Option<Bits<'_>> {
        self.columns.shown_bits()
    }

    /// See [`super::Structure::sphere`].
    #[inline(always)]
    pub fn sphere(&self, node: u32) -> (Vec3, f32) {
        self.columns.sphere(node)
    }

    /// The ids, by node.
    pub fn ids(&self) -> &[u32] {
        self.columns.ids()
    }

    /// The box of all particles, each as large as the largest.
    pub fn bounds(&self) -> Bounds {
        match self.heap.centers.is_empty() {
            true => Bounds::EMPTY,
            false => self.heap.centers.grown(self.columns.radius_scale() * self.heap.radius),
        }
    }

    /// Memory that it takes in bytes, without the ids.
    pub fn bytes(&self) -> u64 {
        self.columns.bytes()
    }

    /// A copy for a device.
    #[cfg(feature = "gpu")]
    pub(crate) fn arrays(&self) -> heap::Arrays<'_> {
        self.columns.arrays(std::slice::from_ref(&self.heap), self.slack)
    }
}
