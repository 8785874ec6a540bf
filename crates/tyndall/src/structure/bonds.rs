//! Bonds: cylinders between particles, with flat ends, that belong half and half to the particles that they join.
//!
//! They stand in a hierarchy of their own, over the balls around them, and are asked after the particles. A bond has two nodes, one a half,
//! behind those of the particles. The formula of `enter_cylinder` is that of the kernels: each product and sum rounded, nothing fused.

use glam::Vec3;

use super::Structure;
use super::bvh::{Bvh, Packing};
use super::search::{Every, Search};
use crate::error::{Error, Result};
use crate::math::{Bounds, Ray};
use crate::structure::build::Record;

/// Where a bond goes, as offsets from the particles' origin, and the ids of the particles that its first and second half belong to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Where it starts.
    pub from: Vec3,
    /// Where it ends.
    pub to: Vec3,
    /// The particle of each half.
    pub ends: [u32; 2],
}

/// A cylinder by its middle, the unit vector along it, half its length, and its radius.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cylinder {
    pub(crate) middle: Vec3,
    pub(crate) axis: Vec3,
    pub(crate) half_length: f32,
    pub(crate) radius: f32,
}

impl Cylinder {
    /// The radius of the ball around it.
    fn reach(&self) -> f32 {
        1.000_001 * (self.half_length * self.half_length + self.radius * self.radius).sqrt()
    }

    /// The point on the axis from which a point of the surface lies away at a right angle, as far as the radius; of a point on an end, one
    /// behind it. So what is met is shaded as a sphere around that point.
    #[inline(always)]
    pub(crate) fn center_of(&self, point: Vec3) -> Vec3 {
        let off = point - self.middle;
        let along = off.dot(self.axis);
        let across = off - along * self.axis;
        let is_end = self.half_length - along.abs() < self.radius - across.length();
        if is_end {
            return point - along.signum() * self.radius * self.axis;
        }
        self.middle + along.clamp(-self.half_length, self.half_length) * self.axis
    }
}

/// Where a ray enters a cylinder, and whether in its second half; none if it does not, within its interval. A ray that starts inside does
/// not enter.
///
/// As with spheres, differences of vectors near the cylinder in place of squared lengths, which would cancel far away.
pub(crate) fn enter_cylinder(ray: &Ray, cylinder: &Cylinder) -> Option<(f32, bool)> {
    let dot = |a: Vec3, b: Vec3| a.x * b.x + a.y * b.y + a.z * b.z;
    let Cylinder { middle, axis, half_length, radius } = *cylinder;
    let to_middle = middle - ray.origin;
    let closest = dot(to_middle, ray.direction);
    // From the middle to the point of the ray that is nearest to it: the origin of what follows.
    let start = closest * ray.direction - to_middle;
    let (start_along, speed_along) = (dot(start, axis), dot(ray.direction, axis));
    let start_across = start - start_along * axis;
    let speed_across = ray.direction - speed_along * axis;
    // The stretch within the endless cylinder.
    let speed_sq = dot(speed_across, speed_across).max(LEAST_SPEED);
    let nearest = -dot(start_across, speed_across) / speed_sq;
    let off = start_across + nearest * speed_across;
    let half_chord_sq = (radius * radius - dot(off, off)) / speed_sq;
    let half_chord = half_chord_sq.max(0.0).sqrt();
    // The stretch between the ends.
    let inverse = 1.0 / if speed_along.abs() < LEAST_SPEED { LEAST_SPEED } else { speed_along };
    let [one, other] = [-half_length - start_along, half_length - start_along].map(|end| end * inverse);
    let enter = (nearest - half_chord).max(one.min(other));
    let leave = (nearest + half_chord).min(one.max(other));
    let t = closest + enter;
    let meets = half_chord_sq > 0.0 && enter < leave && ray.t_min < t && t < ray.t_max;
    meets.then_some((t, start_along + enter * speed_along > 0.0))
}

/// Rays that go straighter along a cylinder, or straighter across it, count as if they went so.
pub(crate) const LEAST_SPEED: f32 = 1e-12;

/// See the module.
#[derive(Clone)]
pub struct Bonds {
    cylinders: Vec<Cylinder>,
    /// By cylinder the nodes of the particles of its halves.
    ends: Vec<[u32; 2]>,
    /// Over those that are shown.
    bvh: Bvh,
    /// The radius of the largest ball around one.
    longest: f32,
}

impl Bonds {
    /// Of particles that stand in `structure`, whose ids the segments have; what has no length is left out. `radius` is that of all.
    ///
    /// Fails with [`Error::Setting`] if the radius is not a number above 0, or there are 2^31 bonds or more.
    pub fn new(structure: &Structure, segments: &[Segment], radius: f32) -> Result<Self> {
        if !(radius > 0.0 && radius.is_finite()) {
            return Err(Error::setting("--bond-radius", radius, "a number above 0"));
        }
        if segments.len() >= 1 << 31 {
            return Err(Error::setting("--bonds", segments.len(), "fewer than 2^31 bonds"));
        }
        let mut nodes = vec![0_u32; structure.len()];
        for (&id, node) in structure.ids().iter().zip(0..) {
            if let Some(place) = nodes.get_mut(id as usize) {
                *place = node;
            }
        }
        let (mut cylinders, mut ends) = (Vec::new(), Vec::new());
        for segment in segments {
            let along = segment.to - segment.from;
            let known = segment.ends.iter().all(|&id| (id as usize) < nodes.len());
            if let Some(axis) = along.try_normalize().filter(|_| known) {
                let middle = 0.5 * segment.from + 0.5 * segment.to;
                cylinders.push(Cylinder { middle, axis, half_length: 0.5 * along.length(), radius });
                ends.push(segment.ends.map(|id| nodes[id as usize]));
            }
        }
        let bvh = hierarchy(&cylinders, |_| true)?;
        let longest = cylinders.iter().map(Cylinder::reach).fold(0.0, f32::max);
        Ok(Self { cylinders, ends, bvh, longest })
    }

    /// Shows those both of whose particles are shown.
    pub(crate) fn show(&mut self, structure: &Structure) -> Result<()> {
        self.bvh =
            hierarchy(&self.cylinders, |bond| self.ends[bond].iter().all(|&node| structure.shows(node)))?;
        Ok(())
    }

    /// Those of the shown ones that `keeps` keeps, by the nodes of their particles.
    pub(crate) fn thinned(&self, keeps: impl Fn([u32; 2]) -> bool + Sync) -> Self {
        let mut thinned = self.clone();
        thinned.bvh.thin(|place| keeps(self.ends[self.at(place) as usize]));
        thinned
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.cylinders.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.cylinders.is_empty()
    }

    /// Nodes of one image: two a bond.
    pub(crate) fn nodes(&self) -> u32 {
        2 * self.cylinders.len() as u32
    }

    /// The box of all that are shown.
    pub(crate) fn bounds(&self) -> Bounds {
        self.bvh.bounds()
    }

    pub(crate) fn bvh(&self) -> &Bvh {
        &self.bvh
    }

    /// The bond at a place of the hierarchy.
    #[inline(always)]
    pub(crate) fn at(&self, place: u32) -> u32 {
        self.bvh.ids()[place as usize]
    }

    #[inline(always)]
    pub(crate) fn cylinder(&self, bond: u32) -> &Cylinder {
        &self.cylinders[bond as usize]
    }

    /// The node of the particle that a bond's node, counted from 0, belongs to.
    #[inline(always)]
    pub(crate) fn owner(&self, node: u32) -> u32 {
        self.ends[node as usize / 2][node as usize % 2]
    }

    /// What a ray enters first, but for bond `except`, and the node, counted from 0: those are tried whose balls it enters.
    pub(crate) fn nearest(&self, ray: &Ray, except: Option<u32>) -> Option<(f32, u32)> {
        // Started so far back that it enters the balls in which it is.
        let back = 2.5 * self.longest;
        let from_behind = Ray { origin: ray.origin - back * ray.direction, t_max: ray.t_max + back, ..*ray };
        let mut best: Option<(f32, u32)> = None;
        let mut met = |_, place: u32| {
            let bond = self.at(place);
            if except != Some(bond)
                && let Some((t, is_second)) = enter_cylinder(ray, self.cylinder(bond))
            {
                let found = (t, 2 * bond + u32::from(is_second));
                if best.is_none_or(|best| t < best.0 || t == best.0 && found.1 < best.1) {
                    best = Some(found);
                }
            }
        };
        self.bvh.search(Search::observed(&from_behind, Every(&mut met)));
        best
    }

    /// What a ray enters first, and the node, counted from 0: every bond that is shown is tried.
    pub(crate) fn intersect(&self, ray: &Ray) -> Option<(f32, u32)> {
        let mut best: Option<(f32, u32)> = None;
        for (place, &bond) in (0..).zip(self.bvh.ids()) {
            if self.bvh.shows(place)
                && let Some((t, is_second)) = enter_cylinder(ray, self.cylinder(bond))
            {
                let found = (t, 2 * bond + u32::from(is_second));
                if best.is_none_or(|best| t < best.0 || t == best.0 && found.1 < best.1) {
                    best = Some(found);
                }
            }
        }
        best
    }
}

fn hierarchy(cylinders: &[Cylinder], is_shown: impl Fn(usize) -> bool) -> Result<Bvh> {
    let record = |(id, cylinder): (usize, &Cylinder)| {
        let [x, y, z] = cylinder.middle.to_array();
        Record { coordinates: [x, y, z, cylinder.reach()], id: id as u32 }
    };
    let shown = cylinders.iter().enumerate().filter(|(id, _)| is_shown(*id));
    Bvh::build(shown.map(record).collect(), 0.0, Packing::Exact, &())
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::random::Stream;

    /// By how much in f64 a point lies within the cylinder: negative outside.
    fn depth(cylinder: &Cylinder, point: DVec3) -> f64 {
        let off = point - cylinder.middle.as_dvec3();
        let axis = cylinder.axis.as_dvec3();
        let along = off.dot(axis);
        let across = (off - along * axis).length();
        (f64::from(cylinder.half_length) - along.abs()).min(f64::from(cylinder.radius) - across)
    }

    #[test]
    fn rays_enter_where_points_along_them_come_inside() {
        let (mut entered, mut ends) = (0, 0);
        for seed in 0..3000 {
            let mut stream = Stream::new(60, seed);
            let cylinder = Cylinder {
                middle: stream.cube(),
                axis: stream.direction(),
                half_length: 0.05 + stream.unit(),
                radius: 0.05 + 0.5 * stream.unit(),
            };
            // From as far away as makes single precision hard.
            let far = [3.0, 300.0, 3e4][seed as usize % 3];
            let target = cylinder.middle + 0.8 * stream.cube();
            let direction = match seed % 5 {
                0 => cylinder.axis,
                _ => stream.direction(),
            };
            let origin = target - far * direction;
            let ray = Ray { origin, direction, t_min: 0.0, t_max: f32::INFINITY };
            let place = |t: f64| origin.as_dvec3() + t * direction.as_dvec3();
            // By steps, then by halving.
            let near = f64::from(far) - 4.0;
            let step = 8.0 / 4000.0;
            let inside =
                (0..4000).map(|k| near + step * f64::from(k)).find(|&t| depth(&cylinder, place(t)) > 0.0);
            let found = enter_cylinder(&ray, &cylinder);
            let tolerance = 2e-6 * f64::from(far) + 1e-5;
            match (inside, found) {
                (Some(mut high), Some((t, is_second))) => {
                    let mut low = high - step;
                    for _ in 0..50 {
                        let middle = 0.5 * (low + high);
                        if depth(&cylinder, place(middle)) > 0.0 { high = middle } else { low = middle }
                    }
                    let at = depth(&cylinder, place(f64::from(t)));
                    assert!(at.abs() < tolerance, "seed {seed}: {t} instead of {high}, {at} inside");
                    let along =
                        (place(f64::from(t)) - cylinder.middle.as_dvec3()).dot(cylinder.axis.as_dvec3());
                    assert!(is_second == (along > 0.0) || along.abs() < tolerance, "seed {seed}");
                    let center = cylinder.center_of(place(f64::from(t)).as_vec3());
                    let normal = (place(f64::from(t)).as_vec3() - center) / cylinder.radius;
                    assert!(
                        (normal.length() - 1.0).abs() < 0.02 + 10.0 * tolerance as f32,
                        "seed {seed}: {normal}"
                    );
                    entered += 1;
                    ends += u32::from(normal.dot(cylinder.axis).abs() > 0.99);
                }
                (Some(t), None) => {
                    // It only grazes.
                    let deepest = (0..400)
                        .map(|k| depth(&cylinder, place(t + 0.01 * f64::from(k))))
                        .fold(0.0, f64::max);
                    assert!(deepest < tolerance, "seed {seed}: nothing instead of {t}, {deepest}");
                }
                (None, Some((t, _))) => {
                    assert!(
                        depth(&cylinder, place(f64::from(t))).abs() < tolerance + 1e-3,
                        "seed {seed}: {t} instead of nothing"
                    );
                }
                (None, None) => {}
            }
        }
        assert!(entered > 500 && ends > 200, "{entered} entered, {ends} of them through an end");
    }

    #[test]
    fn the_hierarchy_finds_what_trying_every_bond_finds() {
        let mut stream = Stream::new(11, 0);
        let mut point = || Vec3::from([0, 1, 2].map(|_| stream.range(-1.0, 1.0)));
        let cylinders: Vec<Cylinder> = (0..300)
            .map(|_| Cylinder {
                middle: 4.0 * point(),
                axis: point().normalize(),
                half_length: 0.5,
                radius: 0.1,
            })
            .collect();
        let bonds = Bonds {
            bvh: hierarchy(&cylinders, |bond| bond % 7 != 3).unwrap(),
            ends: vec![[0; 2]; cylinders.len()],
            longest: cylinders[0].reach(),
            cylinders,
        };
        let mut met = 0;
        for _ in 0..2000 {
            let ray = Ray { origin: 5.0 * point(), direction: point().normalize(), t_min: 0.0, t_max: 6.0 };
            let expected = bonds.intersect(&ray);
            assert_eq!(bonds.nearest(&ray, None), expected);
            if let Some((_, node)) = expected {
                met += 1;
                let behind = bonds.nearest(&ray, Some(node / 2));
                assert!(behind.is_none_or(|(t, other)| other / 2 != node / 2 && t >= expected.unwrap().0));
            }
        }
        assert!(met > 200, "{met}");
    }

    #[test]
    fn what_starts_inside_does_not_enter() {
        let cylinder = Cylinder { middle: Vec3::ZERO, axis: Vec3::Z, half_length: 1.0, radius: 0.5 };
        let ray = |origin, direction| Ray { origin, direction, t_min: 0.0, t_max: 10.0 };
        assert_eq!(enter_cylinder(&ray(Vec3::ZERO, Vec3::X), &cylinder), None);
        assert_eq!(enter_cylinder(&ray(Vec3::X * 2.0, Vec3::NEG_X), &cylinder), Some((1.5, false)));
        assert_eq!(enter_cylinder(&ray(Vec3::Z * 3.0, Vec3::NEG_Z), &cylinder), Some((2.0, true)));
        assert_eq!(enter_cylinder(&ray(Vec3::Z * -3.0, Vec3::Z), &cylinder), Some((2.0, false)));
        assert_eq!(enter_cylinder(&ray(Vec3::X * 20.0, Vec3::NEG_X), &cylinder), None, "too far");
    }
}
