//! Where the particles are: the structures that a ray or a tile asks for what it meets.
//!
//! A structure takes the particles and arranges their centers in its own order: after that a particle has a place in the structure,
//! its node, besides its id. All structures answer with the same formula, [`crate::math::enter_sphere`], so that they agree
//! bit for bit. Where two particles are entered at the same distance, the one with the smaller id counts.

mod build;
pub mod bvh;
pub(crate) mod heap;
pub mod pkd;
pub mod replicas;
pub mod saved;
mod search;
pub mod selection;
pub mod shapes;
pub mod treelets;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::error::Result;
use crate::frozen::Frozen;
use crate::math::{Bounds, Ray, enter_sphere, leave_sphere};
use crate::particles::{Particles, Radii};
use crate::progress::Progress;
use crate::source::Source;
use build::{Record, records};
use replicas::{Nearest, Replica, ReplicaTree, Replicas};
use search::{Every, Observer, Search};
#[cfg(feature = "gpu")]
use selection::Bits;
use selection::{Rule, Test, all_bits, shows, thinned};

pub use bvh::{Bvh, Packing, PackingError};
pub use pkd::Pkd;
pub use treelets::Treelets;

/// The particles as a structure sees them: centers, as offsets from the particles' origin, and radii.
#[derive(Clone, Copy)]
pub struct Spheres<'a> {
    /// The particles.
    pub particles: &'a Particles,
    /// Their sizes.
    pub radii: &'a Radii,
    /// What every size is multiplied with.
    pub radius_scale: f32,
}

impl Spheres<'_> {
    /// How many there are.
    pub fn len(&self) -> usize {
        self.particles.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The center of particle `id`.
    #[inline(always)]
    pub fn center(&self, id: usize) -> Vec3 {
        self.particles.positions().offset(id)
    }

    /// The radius of particle `id`.
    #[inline(always)]
    pub fn radius(&self, id: usize) -> f32 {
        self.radius_scale * self.particles.radius(self.radii, id)
    }

    /// The radius of all, where that is one number.
    pub(crate) fn uniform(&self) -> Option<f32> {
        match self.radii {
            Radii::Uniform(radius) => Some(self.radius_scale * radius),
            _ => None,
        }
    }
}

/// What a ray met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance at which the ray enters the particle.
    pub t: f32,
    /// Which particle.
    pub id: u32,
    /// Its place in the structure.
    pub node: u32,
}

impl Hit {
    /// The nearer of the best so far and what is met at `node`; of equally near ones that with the smaller id.
    #[inline(always)]
    fn keep_nearer(best: &mut Option<Hit>, t: f32, node: u32, ids: &[u32]) {
        if best.is_none_or(|best| t <= best.t) {
            let id = ids[node as usize];
            if best.is_none_or(|best| t < best.t || id < best.id) {
                *best = Some(Hit { t, id, node });
            }
        }
    }
}

/// What finding a hit took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Visits {
    /// Nodes that were opened: boxes of a hierarchy together, one particle of a k-d tree with its cut.
    pub nodes: u64,
    /// Particles that were tested; all others lie in subtrees that were skipped.
    pub particles: u64,
}

/// Which structure to build.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Wide nodes over packed leaves.
    Bvh(Packing),
    /// A balanced k-d tree in place.
    Pkd(pkd::Options),
    /// Wide nodes over small k-d trees in place.
    Treelets(treelets::Options),
    /// None: every particle is tried.
    Brute,
}

impl Default for Kind {
    fn default() -> Self {
        Self::Bvh(Packing::Exact)
    }
}

/// Particles arranged to be found by rays.
#[derive(Clone)]
pub struct Structure {
    pub(crate) store: Store,
    origin: DVec3,
    /// By id, where some particles of the file were dropped.
    places: Option<Frozen<u64>>,
    replicas: Option<ReplicaTree>,
}

/// The structures. `Brute` is the oracle for tests.
#[derive(Clone)]
pub(crate) enum Store {
    Bvh(Bvh),
    Pkd(Pkd),
    Treelets(Treelets),
    Brute(Brute),
}

/// Runs the same expression on whichever structure there is.
macro_rules! each_store {
    ($store:expr, $held:ident => $body:expr) => {
        match $store {
            Store::Bvh($held) => $body,
            Store::Pkd($held) => $body,
            Store::Treelets($held) => $body,
            Store::Brute($held) => $body,
        }
    };
}

impl Structure {
    /// Arranges `particles`, in parallel, with radii that are `radius_scale` times those of `radii`. Their centers are not held
    /// twice: the particles are used up, so take colors and whatever else is wanted from their attributes before.
    ///
    /// Fails only when interrupted.
    pub fn build(
        kind: Kind,
        particles: Particles,
        radii: &Radii,
        radius_scale: f32,
        progress: &dyn Progress,
    ) -> Result<Self> {
        progress.begin("build", Some(particles.len() as u64), "particles");
        let spheres = Spheres { particles: &particles, radii, radius_scale };
        let origin = particles.positions().origin();
        Ok(match spheres.uniform() {
            Some(radius) => {
                let records = records::<3>(spheres);
                Self {
                    origin,
                    places: particles.into_places(),
                    store: arrange(kind, records, radius, progress)?,
                    replicas: None,
                }
            }
            None => {
                let records = records::<4>(spheres);
                Self {
                    origin,
                    places: particles.into_places(),
                    store: arrange(kind, records, 0.0, progress)?,
                    replicas: None,
                }
            }
        })
    }

    /// Takes a hierarchy that was built elsewhere, over these particles with radii that are `radius_scale` times those of `radii`.
    #[cfg(feature = "gpu")]
    pub(crate) fn of_hierarchy(bvh: Bvh, particles: Particles, radii: &Radii, radius_scale: f32) -> Self {
        let bvh = bvh.measured(Spheres { particles: &particles, radii, radius_scale });
        let origin = particles.positions().origin();
        Self { origin, places: particles.into_places(), store: Store::Bvh(bvh), replicas: None }
    }

    /// Arranges spheres of one radius that are read part by part, in a hierarchy: see [`Bvh::stream`]. Centers are offsets from
    /// `origin`. Returns too how many particles were not finite.
    pub fn stream(
        source: &dyn Source,
        origin: DVec3,
        radius: f32,
        packing: Packing,
        progress: &dyn Progress,
    ) -> Result<(Self, u64)> {
        let (bvh, dropped) = Bvh::stream(source, radius, packing, AT_ONCE, progress)?;
        Ok((Self { store: Store::Bvh(bvh), origin, places: None, replicas: None }, dropped))
    }

    /// From now on shows only particles that fulfill all rules; without rules, all. What is not shown is met by no ray and casts no
    /// shadow, but keeps its node. Returns how many are shown.
    pub fn show(&mut self, rules: &[Rule]) -> u64 {
        let tests: Vec<Test> = rules.iter().map(|rule| Test::new(rule, self.origin)).collect();
        each_store!(&mut self.store, store => store.show(&tests))
    }

    /// The same structure, in the same memory, that shows of what this one shows only those nodes that `keeps` keeps. Images show the same.
    pub(crate) fn thinned(&self, keeps: impl Fn(u32) -> bool + Sync) -> Self {
        let mut thinned = self.clone();
        each_store!(&mut thinned.store, store => store.thin(keeps));
        thinned
    }

    /// Whether [`Structure::moved`] is for it.
    pub(crate) fn can_move(&self) -> bool {
        matches!(self.store, Store::Bvh(_) | Store::Brute(_))
    }

    /// The same structure with its particles `by` away from where they are, by node. What is shown stays.
    pub(crate) fn moved(&self, by: impl Fn(u32) -> Vec3 + Sync) -> Self {
        let store = match &self.store {
            Store::Bvh(bvh) => Store::Bvh(bvh.moved(by)),
            Store::Brute(brute) => {
                let moved = |(&(center, radius), node): (&(Vec3, f32), u32)| (center + by(node), radius);
                Store::Brute(Brute {
                    spheres: brute.spheres.iter().zip(0..).map(moved).collect(),
                    ..brute.clone()
                })
            }
            Store::Pkd(_) | Store::Treelets(_) => self.store.clone(),
        };
        Self { store, ..self.clone() }
    }

    /// From now on all radii are `scale` times those it was built with; `scale` is finite and not negative.
    pub fn scale_radii(&mut self, scale: f32) {
        let none =
            Store::Brute(Brute { spheres: Vec::new(), radius_scale: 1.0, ids: Vec::new(), shown: None });
        self.store = match std::mem::replace(&mut self.store, none) {
            Store::Bvh(bvh) => Store::Bvh(bvh.scaled(scale)),
            Store::Pkd(pkd) => Store::Pkd(pkd.scaled(scale)),
            Store::Treelets(treelets) => Store::Treelets(treelets.scaled(scale)),
            Store::Brute(brute) => Store::Brute(Brute { radius_scale: scale, ..brute }),
        };
    }

    /// From now on has these images besides the particles themselves, without copies of them: every image gives every particle another
    /// node, from [`Structure::len`] times the image's number on. What is shown, and its radii, are the same in all images.
    ///
    /// Fails with [`Error::Setting`](crate::Error::Setting) if there are 2^32 nodes or more.
    pub fn replicate(&mut self, replicas: &Replicas) -> Result<()> {
        self.replicas =
            if replicas.count() == 1 { None } else { Some(ReplicaTree::new(replicas, self.len())?) };
        Ok(())
    }

    /// The images, if there are several.
    #[inline(always)]
    pub(crate) fn replicas(&self) -> Option<&ReplicaTree> {
        self.replicas.as_ref()
    }

    /// The particle that `ray` enters first, not counting the one at node `except`.
    pub fn intersect(&self, ray: &Ray, except: Option<u32>) -> Option<Hit> {
        let Some(replicas) = &self.replicas else {
            return each_store!(&self.store, store => store.intersect(ray, except));
        };
        let ask = |ray: &Ray, replica: Replica| {
            let except = except.and_then(|node| node.checked_sub(replica.first_node));
            each_store!(&self.store, store => store.intersect(ray, except))
        };
        Nearest::new(replicas, ray, ask).found(&self.own_bounds())
    }

    /// As [`Structure::intersect`], and counts in `visits` what that took.
    pub fn intersect_counted(&self, ray: &Ray, visits: &mut Visits) -> Option<Hit> {
        let Some(replicas) = &self.replicas else {
            return each_store!(&self.store, store => store.search(Search::observed(ray, visits)));
        };
        let ask = |ray: &Ray, _| each_store!(&self.store, store => store.search(Search::observed(ray, &mut *visits)));
        Nearest::new(replicas, ray, ask).found(&self.own_bounds())
    }

    /// Calls `met` with distance and node of every particle that `ray` enters, in no order, and returns the first one along it. Of images
    /// of the structure only the particles themselves are asked.
    pub fn hits(&self, ray: &Ray, met: &mut dyn FnMut(f32, u32)) -> Option<Hit> {
        each_store!(&self.store, store => store.search(Search::observed(ray, Every(met))))
    }

    /// Of the particles that hold the place of `ray` at distance `t`, how deep it lies in the one in which it lies deepest, and its node. The depth is the
    /// power of the point, its sign turned: how far the particle was entered before times how far on it is left. Of equal ones that of the earlier image
    /// counts, then that with the smaller id.
    pub(crate) fn deepest(&self, ray: &Ray, t: f32) -> Option<(f32, u32)> {
        let mut best: Option<(f32, [u32; 2], u32)> = None;
        let mut ask = |ray: &Ray, first_node: u32| {
            let mut met = |entered: f32, node: u32| {
                let (center, radius) = self.own_sphere(node);
                let left = leave_sphere(ray, center, radius);
                if t >= left {
                    return;
                }
                let depth = (t - entered) * (left - t);
                let order = [first_node, self.ids()[node as usize]];
                if best.is_none_or(|best| depth > best.0 || depth == best.0 && order < best.1) {
                    best = Some((depth, order, first_node + node));
                }
            };
            each_store!(&self.store, store => store.search(Search::around(ray, t, Every(&mut met))));
        };
        match &self.replicas {
            None => ask(ray, 0),
            Some(replicas) => {
                replicas.each_at(&self.own_bounds(), (ray, t), |ray, replica| ask(ray, replica.first_node));
            }
        }
        best.map(|(depth, _, node)| (depth, node))
    }

    /// Whether `ray` enters any particle but the one at node `except`.
    pub fn occluded(&self, ray: &Ray, except: Option<u32>) -> bool {
        let Some(replicas) = &self.replicas else {
            return each_store!(&self.store, store => store.occluded(ray, except));
        };
        let ask = |ray: &Ray, replica: Replica| {
            let except = except.and_then(|node| node.checked_sub(replica.first_node));
            each_store!(&self.store, store => store.occluded(ray, except))
        };
        replicas.meets_any(&self.own_bounds(), ray, ask)
    }

    /// The node, in the particles themselves, of the particle whose image is at `node`.
    #[inline(always)]
    pub(crate) fn original(&self, node: u32) -> u32 {
        self.replicas.as_ref().map_or(node, |replicas| replicas.locate(node).0)
    }

    /// Whether the particle at `node` is shown: see [`Structure::show`].
    #[inline(always)]
    pub fn shows(&self, node: u32) -> bool {
        each_store!(&self.store, store => store.shows(self.original(node)))
    }

    /// What is shown, where that is not all, for a device that walks the structure; none walks `brute`.
    #[cfg(feature = "gpu")]
    pub(crate) fn shown_bits(&self) -> Option<Bits<'_>> {
        match &self.store {
            Store::Bvh(bvh) => bvh.shown_bits(),
            Store::Pkd(pkd) => pkd.shown_bits(),
            Store::Treelets(treelets) => treelets.shown_bits(),
            Store::Brute(_) => None,
        }
    }

    /// How many particles there are.
    pub fn len(&self) -> usize {
        self.ids().len()
    }

    /// How many images of the particles there are, themselves included.
    pub fn images(&self) -> u32 {
        self.replicas.as_ref().map_or(1, ReplicaTree::count)
    }

    /// By how much an image is moved.
    #[inline(always)]
    pub(crate) fn shift(&self, image: u32) -> Vec3 {
        self.replicas.as_ref().map_or(Vec3::ZERO, |replicas| replicas.shift(image))
    }

    /// Nodes count from 0 to this: the particles, times the images.
    pub fn nodes(&self) -> u32 {
        self.len() as u32 * self.images()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Center and radius of the particle at `node`.
    #[inline(always)]
    pub fn sphere(&self, node: u32) -> (Vec3, f32) {
        let Some(replicas) = &self.replicas else { return self.own_sphere(node) };
        let (original, shift) = replicas.locate(node);
        let (center, radius) = self.own_sphere(original);
        (center + shift, radius)
    }

    /// The same without images.
    #[inline(always)]
    pub(crate) fn own_sphere(&self, node: u32) -> (Vec3, f32) {
        each_store!(&self.store, store => store.sphere(node))
    }

    /// By node the ids of the particles, without images: their places among those that the structure was built from.
    pub fn ids(&self) -> &[u32] {
        each_store!(&self.store, store => store.ids())
    }

    /// The place in the file of the particle at `node`, counted from 0 and with those that were dropped.
    pub fn place(&self, node: u32) -> u64 {
        let id = self.ids()[self.original(node) as usize];
        self.places.as_ref().and_then(|places| places.get(id as usize).copied()).unwrap_or(id.into())
    }

    /// The point from which centers are measured.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// The box of all particles, radii included, in all images.
    pub fn bounds(&self) -> Bounds {
        let bounds = self.own_bounds();
        match &self.replicas {
            Some(replicas) if !bounds.is_empty() => replicas.around(&bounds),
            _ => bounds,
        }
    }

    /// The box of the particles themselves.
    pub(crate) fn own_bounds(&self) -> Bounds {
        each_store!(&self.store, store => store.bounds())
    }

    /// By how much the centers and radii that this structure holds differ from those of the particles; none where they are exact.
    pub fn packing_error(&self) -> Option<&PackingError> {
        match &self.store {
            Store::Bvh(bvh) => bvh.packing_error(),
            Store::Pkd(_) | Store::Treelets(_) | Store::Brute(_) => None,
        }
    }

    /// Memory that centers, radii and nodes take, in bytes; the ids take four more a particle.
    pub fn bytes(&self) -> u64 {
        each_store!(&self.store, store => store.bytes())
    }
}

/// A column that stands by id in the order of nodes; `missing` where an id is that of no particle, as in damaged files.
pub(crate) fn by_node<T: Copy + Send + Sync>(column: &[T], ids: &[u32], missing: T) -> Vec<T> {
    ids.par_iter().map(|&id| column.get(id as usize).copied().unwrap_or(missing)).collect()
}

/// Particles whose records are held at once while a source is read: 2 GiB.
pub(crate) const AT_ONCE: u64 = 1 << 27;

/// Builds the structure of that kind; `radius` is that of all where the records have none.
fn arrange<const N: usize>(
    kind: Kind,
    records: Vec<Record<N>>,
    radius: f32,
    progress: &dyn Progress,
) -> Result<Store> {
    Ok(match kind {
        Kind::Bvh(packing) => Store::Bvh(Bvh::build(records, radius, packing, progress)?),
        Kind::Pkd(options) => Store::Pkd(Pkd::build(records, radius, options, progress)?),
        Kind::Treelets(options) => Store::Treelets(Treelets::build(records, radius, options, progress)?),
        Kind::Brute => Store::Brute(Brute::build(&records, radius)),
    })
}

/// Tries every particle.
#[derive(Clone)]
pub struct Brute {
    /// Centers, and radii as they were built; `radius_scale` times that is what is seen.
    spheres: Vec<(Vec3, f32)>,
    radius_scale: f32,
    ids: Vec<u32>,
    /// A bit a particle, where not all are shown.
    shown: Option<Vec<u16>>,
}

impl Brute {
    fn build<const N: usize>(records: &[Record<N>], radius: f32) -> Self {
        let sphere = |record: &Record<N>| (record.center(), record.radius(radius));
        Self {
            spheres: records.iter().map(sphere).collect(),
            radius_scale: 1.0,
            ids: records.iter().map(|record| record.id).collect(),
            shown: None,
        }
    }

    fn intersect(&self, ray: &Ray, except: Option<u32>) -> Option<Hit> {
        let mut best = None;
        for (t, node) in self.hits(ray, except) {
            Hit::keep_nearer(&mut best, t, node, &self.ids);
        }
        best
    }

    fn search<O: Observer>(&self, mut search: Search<O>) -> Option<Hit> {
        search.visit(1, self.spheres.len() as u64);
        for node in (0..self.ids.len() as u32).filter(|&node| self.shows(node)) {
            let (center, radius) = self.sphere(node);
            search.try_one(center, radius, node, &self.ids);
        }
        search.found(&self.ids)
    }

    fn occluded(&self, ray: &Ray, except: Option<u32>) -> bool {
        self.hits(ray, except).next().is_some()
    }

    fn sphere(&self, node: u32) -> (Vec3, f32) {
        let (center, radius) = self.spheres[node as usize];
        (center, self.radius_scale * radius)
    }

    fn ids(&self) -> &[u32] {
        &self.ids
    }

    fn bounds(&self) -> Bounds {
        let spheres = (0..self.ids.len() as u32).map(|node| self.sphere(node));
        let boxes = spheres.map(|(center, radius)| Bounds { min: center, max: center }.grown(radius));
        boxes.fold(Bounds::EMPTY, Bounds::union)
    }

    fn bytes(&self) -> u64 {
        size_of_val(&self.spheres[..]) as u64
    }

    fn show(&mut self, tests: &[Test]) -> u64 {
        let bits = all_bits(self.ids.len(), tests, |node| self.spheres[node].0);
        let count = bits.iter().map(|bits| u64::from(bits.count_ones())).sum();
        self.shown = Some(bits);
        count
    }

    fn thin(&mut self, keeps: impl Fn(u32) -> bool + Sync) {
        self.shown = Some(thinned(self.ids.len(), self.shown.as_deref(), keeps));
    }

    fn shows(&self, node: u32) -> bool {
        self.shown.as_ref().is_none_or(|shown| shows(shown, node as usize))
    }

    fn hits(&self, ray: &Ray, except: Option<u32>) -> impl Iterator<Item = (f32, u32)> {
        (0..self.ids.len() as u32).filter_map(move |node| {
            let (center, radius) = self.sphere(node);
            let t = enter_sphere(ray, center, radius);
            (t < ray.t_max && except != Some(node) && self.shows(node)).then_some((t, node))
        })
    }
}

/// What the rounding of decoded boxes can lose, relative to the largest coordinate: 8 units in the last place.
pub(crate) const BOX_ROUNDING: f32 = 5.0e-7;

/// The margin by which boxes within `bounds` are grown against the rounding of their own coordinates.
pub(crate) fn box_slack(bounds: &Bounds) -> f32 {
    if bounds.is_empty() { 0.0 } else { BOX_ROUNDING * bounds.min.abs().max(bounds.max.abs()).max_element() }
}
