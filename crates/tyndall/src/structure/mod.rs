//! Where the particles are: the structures that a ray or a tile asks for what it meets.
//!
//! All are built from the same [`Spheres`] and answer with the same formula, [`crate::math::enter_sphere`], so that they agree
//! bit for bit. Where two particles are entered at the same distance, the one with the smaller id counts.

mod build;
pub mod bvh;
pub mod pkd;

use glam::Vec3;

use crate::error::Result;
use crate::math::{Bounds, Ray, enter_sphere};
use crate::particles::{Particles, Radii};
use crate::progress::Progress;

pub use bvh::Bvh;
pub use pkd::Pkd;

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
    fn uniform(&self) -> Option<f32> {
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
    /// The nearer of two, of equally near ones that with the smaller id.
    #[inline(always)]
    pub(crate) fn keep_nearer(best: &mut Option<Hit>, hit: Hit) {
        if best.is_none_or(|best| hit.t < best.t || (hit.t == best.t && hit.id < best.id)) {
            *best = Some(hit);
        }
    }
}

/// Which structure to build.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Kind {
    /// Wide nodes over packed leaves.
    #[default]
    Bvh,
    /// A balanced k-d tree in place.
    Pkd(pkd::Options),
    /// None: every particle is tried.
    Brute,
}

/// A structure over particles.
pub enum Structure {
    /// Wide nodes over packed leaves.
    Bvh(Bvh),
    /// A balanced k-d tree in place.
    Pkd(Pkd),
    /// None: every particle is tried. The oracle for tests.
    Brute(Brute),
}

impl Structure {
    /// Builds over `spheres`, in parallel.
    pub fn build(kind: Kind, spheres: Spheres, progress: &dyn Progress) -> Result<Self> {
        progress.begin("build", Some(spheres.len() as u64), "particles");
        let structure = match kind {
            Kind::Bvh => Self::Bvh(Bvh::build(spheres, progress)?),
            Kind::Pkd(options) => Self::Pkd(Pkd::build(spheres, options, progress)?),
            Kind::Brute => Self::Brute(Brute::new(spheres)),
        };
        Ok(structure)
    }

    /// The particle that `ray` enters first, not counting particle `except`.
    pub fn intersect(&self, ray: &Ray, except: Option<u32>) -> Option<Hit> {
        match self {
            Self::Bvh(bvh) => bvh.intersect(ray, except),
            Self::Pkd(pkd) => pkd.intersect(ray, except),
            Self::Brute(brute) => brute.intersect(ray, except),
        }
    }

    /// Whether `ray` enters any particle but `except`.
    pub fn occluded(&self, ray: &Ray, except: Option<u32>) -> bool {
        match self {
            Self::Bvh(bvh) => bvh.occluded(ray, except),
            Self::Pkd(pkd) => pkd.occluded(ray, except),
            Self::Brute(brute) => brute.occluded(ray, except),
        }
    }

    /// Center and radius of the particle at `node`, and its id.
    #[inline(always)]
    pub fn sphere(&self, node: u32) -> (Vec3, f32, u32) {
        match self {
            Self::Bvh(bvh) => bvh.sphere(node),
            Self::Pkd(pkd) => pkd.sphere(node),
            Self::Brute(brute) => {
                let (center, radius) = brute.spheres[node as usize];
                (center, radius, node)
            }
        }
    }

    /// The box of all particles, radii included.
    pub fn bounds(&self) -> Bounds {
        match self {
            Self::Bvh(bvh) => bvh.bounds(),
            Self::Pkd(pkd) => pkd.bounds(),
            Self::Brute(brute) => brute.bounds(),
        }
    }

    /// Memory it takes, in bytes.
    pub fn bytes(&self) -> u64 {
        match self {
            Self::Bvh(bvh) => bvh.bytes(),
            Self::Pkd(pkd) => pkd.bytes(),
            Self::Brute(brute) => size_of_val(&brute.spheres[..]) as u64,
        }
    }
}

/// Tries every particle.
pub struct Brute {
    spheres: Vec<(Vec3, f32)>,
}

impl Brute {
    /// Takes the particles as they are.
    pub fn new(spheres: Spheres) -> Self {
        Self { spheres: (0..spheres.len()).map(|id| (spheres.center(id), spheres.radius(id))).collect() }
    }

    /// See [`Structure::intersect`].
    pub fn intersect(&self, ray: &Ray, except: Option<u32>) -> Option<Hit> {
        let mut best = None;
        for hit in self.hits(ray, except) {
            Hit::keep_nearer(&mut best, hit);
        }
        best
    }

    /// See [`Structure::occluded`].
    pub fn occluded(&self, ray: &Ray, except: Option<u32>) -> bool {
        self.hits(ray, except).next().is_some()
    }

    /// See [`Structure::bounds`].
    pub fn bounds(&self) -> Bounds {
        let boxes =
            self.spheres.iter().map(|&(center, radius)| Bounds { min: center, max: center }.grown(radius));
        boxes.fold(Bounds::EMPTY, Bounds::union)
    }

    fn hits(&self, ray: &Ray, except: Option<u32>) -> impl Iterator<Item = Hit> {
        (0u32..).zip(&self.spheres).filter_map(move |(id, &(center, radius))| {
            let t = enter_sphere(ray, center, radius);
            (t < ray.t_max && except != Some(id)).then_some(Hit { t, id, node: id })
        })
    }
}

/// What the rounding of decoded boxes can lose, relative to the largest coordinate: 8 units in the last place.
pub(crate) const BOX_ROUNDING: f32 = 5.0e-7;

/// The margin by which boxes within `bounds` are grown against the rounding of their own coordinates.
pub(crate) fn box_slack(bounds: &Bounds) -> f32 {
    if bounds.is_empty() { 0.0 } else { BOX_ROUNDING * bounds.min.abs().max(bounds.max.abs()).max_element() }
}
