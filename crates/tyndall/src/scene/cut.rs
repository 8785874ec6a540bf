//! Particles and shapes that are cut: what lies outside of half spaces is away, and where their boundary goes through something, a cap closes it.
//!
//! What is left is convex, so that a ray is within it between two distances. A ray from outside meets a cap where it comes in, if that place lies within
//! something: within several things, the cap is that of the one in which the place lies deepest, by the power of the point, so that spheres part along
//! the plane of the circle in which they cut each other. Everything else that is seen is entered further on. From a cap light leaves what is
//! left at once: nothing is in its way. A cap has a node of its own, behind those of particles and shapes, so that whoever has a node knows what faces him there.
//!
//! Whether something holds a place is decided by where the ray enters and leaves it, with the numbers by which it would be entered further on: no ray slips through between.

use glam::Vec3;

use super::Scene;
use crate::error::{Error, Result};
use crate::math::Ray;
use crate::structure::selection::HalfSpace;

/// See the module.
#[derive(Clone, Debug)]
pub(crate) struct Cut {
    /// What is left lies in all of these, measured from the structure's origin; normals have unit length.
    sides: Vec<HalfSpace>,
    /// Linear RGB of all caps; none if they have the colors of what is cut.
    cap: Option<[f32; 3]>,
}

impl Cut {
    /// The distances between which a ray is within what is left; none if it never is within its interval. Unlike the interval's own start, the first may
    /// lie before it.
    fn stretch(&self, ray: &Ray) -> Option<[f32; 2]> {
        let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
        for HalfSpace { normal, distance } in &self.sides {
            let (speed, left) = (normal.dot(direction), distance - normal.dot(origin));
            match speed {
                _ if speed < 0.0 => enter = enter.max(left / speed),
                _ if speed > 0.0 => leave = leave.min(left / speed),
                _ if left < 0.0 => return None,
                _ => {}
            }
        }
        let [enter, leave] = [enter, leave].map(|it| it as f32);
        let is_met = enter < leave && enter < ray.t_max && ray.t_min < leave;
        is_met.then_some([enter, leave])
    }

    /// Where a ray that starts within what is left comes out of it, and the normal there; infinitely far if it never does.
    fn end(&self, ray: &Ray) -> (f32, Vec3) {
        let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let ahead = self.sides.iter().filter_map(|HalfSpace { normal, distance }| {
            let speed = normal.dot(direction);
            (speed > 0.0).then(|| ((distance - normal.dot(origin)) / speed, normal.as_vec3()))
        });
        let (t, normal) =
            ahead.min_by(|one, other| one.0.total_cmp(&other.0)).unwrap_or((f64::INFINITY, Vec3::ZERO));
        (t.max(0.0) as f32, normal)
    }

    /// Whether caps have a color of their own.
    pub(crate) fn is_painted(&self) -> bool {
        self.cap.is_some()
    }

    /// Whether a sphere reaches into what is left; one outside of an edge or a corner may be said to.
    pub(super) fn reaches(&self, center: Vec3, radius: f32) -> bool {
        let center = center.as_dvec3();
        self.sides.iter().all(|side| side.normal.dot(center) - side.distance <= f64::from(radius))
    }

    /// The normal of the side on which a point lies by which a ray in `direction` came in.
    pub(crate) fn normal(&self, point: Vec3, direction: Vec3) -> Vec3 {
        let (point, toward) = (point.as_dvec3(), direction.as_dvec3());
        let outside = |side: &&HalfSpace| side.normal.dot(point) - side.distance;
        let facing = self.sides.iter().filter(|side| side.normal.dot(toward) < 0.0);
        let side = facing.max_by(|one, other| outside(one).total_cmp(&outside(other)));
        side.map_or(-direction, |side| side.normal.as_vec3())
    }
}

impl Scene {
    /// From now on shows of particles and shapes only what lies in all of these half spaces; without any, all of them. Where a boundary goes through
    /// something solid it is closed by a cap, in the color of what is cut or in `cap` (linear RGB). What is cut away casts no shadow.
    pub fn set_cut(&mut self, half_spaces: &[HalfSpace], cap: Option<[f32; 3]>) {
        let origin = self.structure.origin();
        let side = |it: &HalfSpace| {
            let scale = 1.0 / it.normal.length();
            HalfSpace { normal: it.normal * scale, distance: (it.distance - it.normal.dot(origin)) * scale }
        };
        let sides: Vec<HalfSpace> = half_spaces.iter().map(side).collect();
        self.cut = Some(Cut { sides, cap }).filter(|cut| !cut.sides.is_empty());
    }

    /// Where particles and shapes are cut, if they are.
    #[inline(always)]
    pub(crate) fn cut(&self) -> Option<&Cut> {
        self.cut.as_ref()
    }

    /// Fails with [`Error::Setting`] if caps have no numbers left for their nodes.
    pub(crate) fn check_cut(&self) -> Result<()> {
        match self.nodes() {
            nodes if self.cut.is_some() && nodes > 1 << 31 => Err(Error::setting(
                "--cut",
                "given",
                "left out of more than 2^31 particles and parts of shapes",
            )),
            _ => Ok(()),
        }
    }

    /// What is cut, and its node, where `node` is that of a cap.
    #[inline(always)]
    pub(crate) fn cap_of(&self, node: u32) -> Option<(&Cut, u32)> {
        let cut = self.cut.as_ref()?;
        Some((cut, node.checked_sub(self.nodes())?))
    }

    /// The color of the cap of what is at `node`.
    pub(crate) fn cap_color(&self, cut: &Cut, node: u32) -> [f32; 3] {
        cut.cap.unwrap_or_else(|| match self.locate_shape(node) {
            Some((shapes, own, _)) => shapes.color(own, |owner| self.color(owner)),
            None => self.color(self.structure.original(node)),
        })
    }

    /// Depth and node of what a ray meets first that may come from outside of what is left: a cap, or something that it enters.
    pub(crate) fn meet(&self, ray: &Ray) -> Option<(f32, u32)> {
        let Some(cut) = &self.cut else { return self.enter(ray, None) };
        let [enter, leave] = cut.stretch(ray)?;
        if enter > ray.t_min
            && let Some(node) = self.deepest(ray, enter)
        {
            return Some((enter, self.nodes() + node));
        }
        self.nearest(&Ray { t_min: ray.t_min.max(enter), t_max: ray.t_max.min(leave), ..*ray }, None)
    }

    /// The same for a ray that starts within what is left, at a surface of node `except`, which does not count.
    pub(crate) fn enter(&self, ray: &Ray, except: Option<u32>) -> Option<(f32, u32)> {
        self.nearest(&self.within(ray, except)?, except)
    }

    /// Whether a ray that starts so enters anything.
    pub(crate) fn is_shadowed(&self, ray: &Ray, from: Option<u32>) -> bool {
        let Some(ray) = self.within(ray, from) else { return false };
        self.structure.occluded(&ray, from) || self.shape_met(&ray, None, from).is_some()
    }

    /// The part within what is left of a ray that starts there, on a surface; none of one from a cap.
    fn within(&self, ray: &Ray, from: Option<u32>) -> Option<Ray> {
        let Some(cut) = &self.cut else { return Some(*ray) };
        if from.is_some_and(|node| node >= self.nodes()) {
            return None;
        }
        let [_, leave] = cut.stretch(ray)?;
        Some(Ray { t_max: ray.t_max.min(leave), ..*ray })
    }

    /// Where a ray that starts within what is left comes to a cap from behind, and the cap's normal; infinitely far if nothing is cut there.
    pub(crate) fn end_of_uncut(&self, ray: &Ray) -> (f32, Vec3) {
        self.cut.as_ref().map_or((f32::INFINITY, Vec3::ZERO), |cut| cut.end(ray))
    }

    /// What a ray enters first within its interval, cut away or not.
    pub(crate) fn nearest(&self, ray: &Ray, except: Option<u32>) -> Option<(f32, u32)> {
        let hit = self.structure.intersect(ray, except).map(|hit| (hit.t, hit.node));
        self.shape_met(ray, hit.map(|(depth, _)| depth), except).or(hit)
    }

    /// The node of that in which the place on a ray at distance `t` lies deepest: of a particle, else of a shape.
    pub(crate) fn deepest(&self, ray: &Ray, t: f32) -> Option<u32> {
        if let Some((_, node)) = self.structure.deepest(ray, t) {
            return Some(node);
        }
        let shapes = self.shapes.as_ref()?;
        let mut best: Option<(f32, u32)> = None;
        for image in 0..self.structure.images() {
            let moved = Ray { origin: ray.origin - self.structure.shift(image), ..*ray };
            let first_node = self.structure.nodes() + image * shapes.nodes();
            if let Some((depth, node)) = shapes.deepest(&moved, t)
                && best.is_none_or(|best| depth > best.0)
            {
                best = Some((depth, first_node + node));
            }
        }
        best.map(|(_, node)| node)
    }
}
