//! What a single ray looks for, and what it has met so far: common to the walks of all structures.

use fearless_simd::{f32x16, prelude::*};
use glam::Vec3;

use super::{Hit, Visits};
use crate::math::{Ray, enter_sphere};
use crate::simd::{self, Lanes3};

/// What ends a walk.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Wanted {
    Nearest,
    Any,
}

/// Is told what a walk visits and meets. `()` is told nothing, and costs nothing.
pub(super) trait Observer {
    /// Whether it has to be told every particle that the ray enters, each once.
    const EVERY: bool = false;
    /// So many more nodes were opened and particles tested.
    fn visit(&mut self, _nodes: u64, _particles: u64) {}
    /// The ray enters the particle at `node` at `t`; returns how far it is of interest from then on. What is behind the particle is hidden.
    #[inline(always)]
    fn meet(&mut self, t: f32, _node: u32) -> f32 {
        t
    }
}

impl Observer for () {}

impl Observer for &mut Visits {
    #[inline(always)]
    fn visit(&mut self, nodes: u64, particles: u64) {
        self.nodes += nodes;
        self.particles += particles;
    }
}

/// Is told every particle that the ray enters.
pub(super) struct Every<'a>(pub(super) &'a mut dyn FnMut(f32, u32));

impl Observer for Every<'_> {
    const EVERY: bool = true;

    #[inline(always)]
    fn meet(&mut self, t: f32, node: u32) -> f32 {
        (self.0)(t, node);
        f32::INFINITY
    }
}

/// Is told particles that the ray enters, and says how far it is of interest from then on.
pub(super) struct Within<'a>(pub(super) &'a mut dyn FnMut(u32) -> f32);

impl Observer for Within<'_> {
    #[inline(always)]
    fn meet(&mut self, _t: f32, node: u32) -> f32 {
        (self.0)(node)
    }
}

/// A ray on its way through a structure.
pub(super) struct Search<O: Observer = ()> {
    ray: Ray,
    pub(super) inv_direction: Vec3,
    /// A node that does not count.
    except: Option<u32>,
    wanted: Wanted,
    /// From where on the ray is of interest: what ends before is passed over, whatever the ray's interval says of where particles are entered.
    pub(super) t_from: f32,
    /// How far the ray is of interest: to its end, or to the nearest that it has met. What is met just there counts.
    pub(super) t_far: f32,
    /// Distance and node of the nearest that it has met.
    best: Option<(f32, u32)>,
    observer: O,
}

impl Search {
    /// For the nearest particle, but the one at node `except`.
    pub(super) fn nearest(ray: &Ray, except: Option<u32>) -> Self {
        Self { except, ..Self::observed(ray, ()) }
    }

    /// For any particle, but the one at node `except`.
    pub(super) fn any(ray: &Ray, except: Option<u32>) -> Self {
        Self { wanted: Wanted::Any, ..Self::nearest(ray, except) }
    }
}

impl<O: Observer> Search<O> {
    /// For the nearest particle; `observer` is told of the way.
    pub(super) fn observed(ray: &Ray, observer: O) -> Self {
        Self {
            ray: *ray,
            inv_direction: ray.inv_direction(),
            except: None,
            wanted: Wanted::Nearest,
            t_from: ray.t_min,
            t_far: ray.t_max,
            best: None,
            observer,
        }
    }

    /// For all particles that the line of `ray` has entered at `t` or before, but for those that end before `t`: of these `observer` may be told, too.
    pub(super) fn around(ray: &Ray, t: f32, observer: O) -> Self {
        let entered = Ray { t_min: f32::NEG_INFINITY, t_max: t.next_up(), ..*ray };
        Self { t_from: t, ..Self::observed(&entered, observer) }
    }

    /// Tells the observer that so many more nodes were opened and particles tested.
    #[inline(always)]
    pub(super) fn visit(&mut self, nodes: u64, particles: u64) {
        self.observer.visit(nodes, particles);
    }

    /// What was found, among particles with these ids by node.
    pub(super) fn found(self, ids: &[u32]) -> Option<Hit> {
        self.best.map(|(t, node)| Hit { t, id: ids[node as usize], node })
    }

    #[inline(always)]
    pub(super) fn ray(&self) -> &Ray {
        &self.ray
    }

    /// Tries the particle at `node`; whether the search is over.
    #[inline(always)]
    pub(super) fn try_one(&mut self, center: Vec3, radius: f32, node: u32, ids: &[u32]) -> bool {
        let t = enter_sphere(&self.ray, center, radius);
        t < self.ray.t_max && t <= self.t_far && self.meet(t, node, ids)
    }

    /// Where the ray enters each of sixteen particles, and a bit for each that it enters not behind `t_far`.
    /// [`crate::math::enter_sphere`] on lanes.
    #[inline(always)]
    pub(super) fn enter<S: Simd>(
        &self,
        simd: S,
        center: Lanes3<f32x16<S>>,
        radius: f32x16<S>,
    ) -> ([f32; 16], u32) {
        let to_center = center.minus(Lanes3::splat(simd, self.ray.origin));
        let direction = Lanes3::splat(simd, self.ray.direction);
        let (t, meets) = simd::enter_sphere(simd, to_center, direction, radius * radius);
        let (t_min, t_max) = (f32x16::splat(simd, self.ray.t_min), f32x16::splat(simd, self.ray.t_max));
        let met = meets & t_min.simd_lt(t) & t.simd_lt(t_max) & t.simd_le(f32x16::splat(simd, self.t_far));
        (t.to_array(), met.to_bitmask() as u32)
    }

    /// Takes note that the ray enters the particle at `node` at `t`; whether the search is over.
    #[inline(always)]
    pub(super) fn meet(&mut self, t: f32, node: u32, ids: &[u32]) -> bool {
        if self.except == Some(node) {
            return false;
        }
        let of_interest = self.observer.meet(t, node);
        // Of equally near ones that with the smaller id; ids are far from the leaves, and asked for then only.
        let is_nearer = |&(nearest, other): &(f32, u32)| {
            t < nearest || (t == nearest && ids[node as usize] < ids[other as usize])
        };
        if self.best.as_ref().is_none_or(is_nearer) {
            self.best = Some((t, node));
        }
        self.t_far = self.t_far.min(of_interest);
        self.wanted == Wanted::Any
    }
}
