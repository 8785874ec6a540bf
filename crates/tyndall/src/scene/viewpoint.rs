//! From what a user says about the camera to a camera: what is not said follows from the box to show.
//!
//! Also says why a picture shows nothing, so that no blank picture is left unexplained.

use std::str::FromStr;

use glam::{DQuat, DVec3, Vec3};
use rayon::prelude::*;

use super::camera::{Camera, Projection, View, usable_up};
use super::outline::Outline;
use super::statistics::{grouped, sampled_ids, short};
use crate::error::{Error, Result};
use crate::particles::Particles;
use crate::structure::{Spheres, Structure};

/// Where the camera looks if nobody says so: from the front right, and from above.
pub const DIRECTION: DVec3 = DVec3::new(-2.0, -1.3, -1.0);

/// Particles with a smaller radius are smaller than the distance of 64 samples.
const SMALL_PX: f64 = 0.1;
/// At most so many particles are looked at to find how small they are.
const SAMPLES: usize = 1_000_000;
/// And at so many to find which share of them is in view, as that is asked of every frame.
const SHARE_SAMPLES: usize = 1 << 16;

/// A side to look from, or the default.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Side {
    /// Where the camera looks; any length.
    pub direction: DVec3,
    /// Which way is up in the picture.
    pub up: DVec3,
}

impl Default for Side {
    fn default() -> Self {
        Self { direction: DIRECTION, up: DVec3::Z }
    }
}

impl FromStr for Side {
    type Err = Error;

    /// Reads `x`, `y`, `z` (from the positive end of that axis), `-x`, `-y`, `-z` (from its negative end) or `iso`. Up is z; from
    /// above and below it is y.
    fn from_str(text: &str) -> Result<Self> {
        let side = |direction| Ok(Self { direction, up: DVec3::Z });
        match text.strip_prefix('+').unwrap_or(text) {
            "x" => side(DVec3::NEG_X),
            "-x" => side(DVec3::X),
            "y" => side(DVec3::NEG_Y),
            "-y" => side(DVec3::Y),
            "z" => Ok(Self { direction: DVec3::NEG_Z, up: DVec3::Y }),
            "-z" => Ok(Self { direction: DVec3::Z, up: DVec3::Y }),
            "iso" => side(DVec3::NEG_ONE),
            _ => Err(Error::setting("--view", text, "known: x y z -x -y -z iso")),
        }
    }
}

/// A direction as users write it: three numbers `X,Y,Z`, or an axis such as `y` or `-z`.
pub fn direction(text: &str) -> Option<DVec3> {
    let axis = |name: &str| match name {
        "x" => Some(DVec3::X),
        "y" => Some(DVec3::Y),
        "z" => Some(DVec3::Z),
        _ => None,
    };
    let text = text.trim();
    if let Some(axis) = axis(text.strip_prefix(['+', '-']).unwrap_or(text)) {
        return Some(if text.starts_with('-') { -axis } else { axis });
    }
    point(text)
}

/// A point as users write it: three finite numbers `X,Y,Z`.
pub fn point(text: &str) -> Option<DVec3> {
    let numbers: Option<Vec<f64>> =
        text.split(',').map(|part| part.trim().parse().ok().filter(|it: &f64| it.is_finite())).collect();
    <[f64; 3]>::try_from(numbers?).ok().map(DVec3::from_array)
}

/// How rays leave the camera, as far as it is said.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lens {
    /// Within a vertical angle of view, in radians.
    Perspective {
        /// Angle between the picture's lower and upper edge.
        vertical_angle: f64,
    },
    /// In parallel.
    Orthographic {
        /// Height of what the picture shows; `None`: that of the box to show.
        height: Option<f64>,
    },
    /// All around the eye; without one, around what is looked at.
    Panorama,
}

/// What is said about the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Viewpoint {
    /// Where it stands; `None`: so far back that the box is seen.
    pub eye: Option<DVec3>,
    /// What it looks at; `None`: the middle of the box.
    pub look_at: Option<DVec3>,
    /// Which way is up; `None`: that of the side.
    pub up: Option<DVec3>,
    /// Where it looks if no eye is given.
    pub side: Side,
    /// How rays leave it.
    pub lens: Lens,
    /// Whether it will move.
    pub motion: Motion,
}

impl Viewpoint {
    /// The camera that shows `outline` in a picture of that `aspect`, width over height.
    pub fn camera(&self, outline: &Outline, aspect: f64) -> Camera {
        let all_around;
        let outline = match self.motion {
            Motion::Still => outline,
            Motion::Orbit => {
                all_around = outline.turned_all_around(self.up.unwrap_or(self.side.up));
                &all_around
            }
        };
        let Outline { center, points } = outline;
        let target = self.look_at.unwrap_or(*center);
        let direction = self.eye.map_or(self.side.direction, |eye| target - eye);
        let up = self.up.unwrap_or_else(|| usable_up(direction.normalize_or(DVec3::Y), self.side.up));
        let angle = match self.lens {
            Lens::Perspective { vertical_angle } => Some(vertical_angle),
            Lens::Orthographic { .. } | Lens::Panorama => None,
        };
        let mut camera = Camera::framing(*center, points, direction, up, aspect, angle);
        match self.eye {
            Some(eye) => (camera.eye, camera.look_at) = (eye, target),
            None if self.look_at.is_some() => {
                (camera.eye, camera.look_at) = (camera.eye + (target - camera.look_at), target);
            }
            None => {}
        }
        if self.lens == Lens::Panorama {
            camera.projection = Projection::Panorama;
            if self.eye.is_none() {
                (camera.eye, camera.look_at) = (target, target + self.side.direction);
            }
        }
        // Kept even where it cannot be: the renderer refuses it by name.
        camera.up = up;
        if let Lens::Orthographic { height: Some(height) } = self.lens {
            camera.projection = Projection::Orthographic { height };
        }
        camera
    }

    /// `camera`, as [`Self::camera`] gave it, turned by `angle` radians: around what it was told to look at, else around the
    /// middle of the outline, which it may not look at exactly.
    pub fn turned(&self, camera: &Camera, outline: &Outline, angle: f64) -> Camera {
        let told = self.eye.is_some() || self.look_at.is_some();
        let pivot = if told { camera.look_at } else { outline.center };
        let turn = DQuat::from_axis_angle(camera.up.normalize_or(DVec3::Z), angle);
        let around = |place: DVec3| pivot + turn * (place - pivot);
        Camera { eye: around(camera.eye), look_at: around(camera.look_at), ..*camera }
    }
}

/// Whether the camera will move.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Motion {
    /// It stays.
    #[default]
    Still,
    /// It goes around: everything stays in view all the way.
    Orbit,
}

/// Why a picture of these particles shows none of them, in one line. `dropped` is how many were left out on entry.
pub fn why_unseen(structure: &Structure, dropped: u64, view: &View) -> String {
    let all = structure.len();
    if all == 0 {
        return match dropped {
            0 => "0 particles: the frame has none".into(),
            _ => format!("0 particles: all {} of the frame were dropped", grouped(dropped as usize)),
        };
    }
    let largest = (0..structure.nodes())
        .into_par_iter()
        .filter(|&node| structure.shows(node))
        .filter_map(|node| size_in_view(structure.sphere(node), view));
    let (count, largest) = largest
        .fold(|| (0, 0.0_f64), |a, px| (a.0 + 1, a.1.max(px)))
        .reduce(|| (0, 0.0), |a, b| (a.0 + b.0, a.1.max(b.1)));
    let all = structure.nodes() as usize;
    let shown = (0..all as u32).into_par_iter().filter(|&node| structure.shows(node)).count();
    let all =
        if shown < all { format!("{} shown of {}", grouped(shown), grouped(all)) } else { grouped(all) };
    if count > 0 {
        return format!(
            "{} of {all} particles are in view but no sample met one: the largest radius is {} pixels — raise --radius, \
             --radius-scale or --samples",
            grouped(count),
            short(largest)
        );
    }
    let (origin, bounds) = (structure.origin(), structure.bounds());
    let (min, max) = (origin + bounds.min.as_dvec3(), origin + bounds.max.as_dvec3());
    let sides = ["x", "y", "z"].iter().enumerate();
    let sides: Vec<String> =
        sides.map(|(axis, name)| format!("{name} {}..{}", short(min[axis]), short(max[axis]))).collect();
    format!(
        "0 of {all} particles are in view — the camera looks past them, they are in {}; without --eye, --look-at and --ortho \
         they are framed",
        sides.join(", ")
    )
}

/// What the user should know about particles so small in the picture that samples miss most of them; `None` if at most a tenth
/// are. Looks at a sample of the particles.
pub fn too_small(spheres: Spheres, view: &View) -> Option<String> {
    let ids = sampled_ids(spheres.len(), SAMPLES).filter_map(|id| {
        let px = size_in_view((spheres.center(id), spheres.radius(id)), view)?;
        Some((1_usize, usize::from(px < SMALL_PX), spheres.radius(id), spheres.radius(id)))
    });
    let none = || (0, 0, f32::INFINITY, 0.0_f32);
    let (seen, small, least, greatest) =
        ids.reduce(none, |a, b| (a.0 + b.0, a.1 + b.1, a.2.min(b.2), a.3.max(b.3)));
    if seen == 0 || 10 * small <= seen {
        return None;
    }
    let (least, greatest) = (short(least.into()), short(greatest.into()));
    let share = short((100.0 * small as f64 / seen as f64).round());
    let which = if least == greatest {
        format!("{share} % of the particles in view have a radius")
    } else {
        format!("radii span {least}..{greatest}; {share} % of those in view are")
    };
    Some(format!(
        "{which} under {SMALL_PX} pixel, so that samples miss most of them (--radius-scale, --samples, --size)"
    ))
}

/// Which share of the particles is in view, by their centers; 1 without particles. Looks at a sample of them.
pub fn share_in_view(particles: &Particles, view: &View) -> f64 {
    let ids = sampled_ids(particles.len(), SHARE_SAMPLES);
    let is_seen = |id: usize| size_in_view((particles.positions().offset(id), 0.0), view).is_some();
    let (seen, all) =
        ids.map(|id| (usize::from(is_seen(id)), 1_usize)).reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    if all == 0 { 1.0 } else { seen as f64 / all as f64 }
}

/// The radius in pixels of the sphere at `center`, if it may be seen in some pixel.
fn size_in_view((center, radius): (Vec3, f32), view: &View) -> Option<f64> {
    let offset = center - view.eye;
    if view.panorama {
        let distance = offset.length();
        return (distance > radius).then(|| f64::from(radius) / f64::from(view.pixel * distance));
    }
    let depth = offset.dot(view.forward);
    let scale = if view.perspective { depth } else { 1.0 };
    let within = |along: f32, half: f32| along.abs() - radius <= half.abs() * scale;
    let seen =
        depth > 0.0 && within(offset.dot(view.right), view.left) && within(offset.dot(view.up), view.top);
    seen.then(|| f64::from(radius) / f64::from(view.pixel * scale))
}

#[cfg(test)]
mod tests {
    use super::super::camera::corners;
    use super::*;
    use crate::math::Bounds;
    use crate::particles::{Attribute, Columns, Radii, Values};
    use crate::structure::Kind;

    fn viewpoint() -> Viewpoint {
        let lens = Lens::Perspective { vertical_angle: 0.6 };
        Viewpoint { eye: None, look_at: None, up: None, side: Side::default(), lens, motion: Motion::Still }
    }

    const BOX: Bounds = Bounds { min: Vec3::splat(-1.0), max: Vec3::splat(1.0) };

    #[test]
    fn what_is_said_is_kept() {
        let (eye, look_at) = (DVec3::new(9.0, 8.0, 7.0), DVec3::new(1.0, 2.0, 3.0));
        let said = Viewpoint { eye: Some(eye), look_at: Some(look_at), up: Some(DVec3::Y), ..viewpoint() };
        let camera = said.camera(&Outline::of_box(&BOX, DVec3::ZERO), 1.5);
        assert_eq!((camera.eye, camera.look_at, camera.up), (eye, look_at, DVec3::Y));
        let lens = Lens::Orthographic { height: Some(2.5) };
        let camera = Viewpoint { lens, ..viewpoint() }.camera(&Outline::of_box(&BOX, DVec3::ZERO), 1.5);
        assert_eq!(camera.projection, Projection::Orthographic { height: 2.5 });
    }

    #[test]
    fn what_is_not_said_follows_from_the_box() {
        let far = DVec3::splat(1e6);
        for side in ["x", "-x", "y", "-y", "z", "-z", "iso"] {
            for lens in [viewpoint().lens, Lens::Orthographic { height: None }] {
                let side: Side = side.parse().unwrap();
                let camera = Viewpoint { side, lens, ..viewpoint() }.camera(&Outline::of_box(&BOX, far), 1.5);
                assert!(camera.look_at.distance(far) < 0.3 * BOX.extent().length() as f64);
                assert!(
                    (camera.look_at - camera.eye).normalize().abs_diff_eq(side.direction.normalize(), 1e-9)
                );
                let view = camera.view(far, 30, 20).unwrap();
                for corner in corners(&BOX, DVec3::ZERO) {
                    let offset = corner.as_vec3() - view.eye;
                    let scale = if view.perspective { offset.dot(view.forward) } else { 1.0 };
                    assert!(offset.dot(view.up).abs() < view.top * scale, "{side:?} {lens:?}");
                }
            }
        }
        let above = Viewpoint { eye: Some(DVec3::Z * 9.0), ..viewpoint() }
            .camera(&Outline::of_box(&BOX, DVec3::ZERO), 1.0);
        assert!(above.view(DVec3::ZERO, 4, 4).is_ok(), "up is found when looking down");
        let empty = viewpoint().camera(&Outline::of_box(&Bounds::EMPTY, DVec3::ZERO), 1.0);
        assert!(empty.view(DVec3::ZERO, 4, 4).is_ok());
    }

    #[test]
    fn an_orbit_keeps_everything_in_view() {
        let outline = Outline::of_box(&BOX, DVec3::ONE);
        for lens in [viewpoint().lens, Lens::Orthographic { height: None }] {
            let viewpoint = Viewpoint { motion: Motion::Orbit, lens, ..viewpoint() };
            let camera = viewpoint.camera(&outline, 1.3);
            for turn in 0..100 {
                let view =
                    viewpoint.turned(&camera, &outline, 0.1 * turn as f64).view(DVec3::ZERO, 13, 10).unwrap();
                for point in &outline.points {
                    let offset = point.as_vec3() - view.eye;
                    let scale = if view.perspective { offset.dot(view.forward) } else { 1.0 };
                    assert!(offset.dot(view.up).abs() < view.top * scale, "{lens:?} {turn}");
                    assert!(offset.dot(view.right).abs() < -view.left * scale, "{lens:?} {turn}");
                }
            }
        }
    }

    #[test]
    fn a_panorama_is_seen_from_the_middle() {
        let viewpoint = Viewpoint { lens: Lens::Panorama, ..viewpoint() };
        let camera = viewpoint.camera(&Outline::of_box(&BOX, DVec3::ONE), 2.0);
        assert_eq!((camera.eye, camera.projection), (DVec3::ONE, Projection::Panorama));
        let view = camera.view(DVec3::ONE, 40, 20).unwrap();
        // Whatever lies anywhere is seen.
        assert!(
            [Vec3::X, Vec3::NEG_Y, Vec3::NEG_Z].iter().all(|at| size_in_view((*at, 0.1), &view).is_some())
        );
        let outside = Viewpoint { eye: Some(DVec3::X * 9.0), ..viewpoint }
            .camera(&Outline::of_box(&BOX, DVec3::ZERO), 2.0);
        assert_eq!((outside.eye, outside.look_at), (DVec3::X * 9.0, DVec3::ZERO));
    }

    #[test]
    fn a_blank_picture_is_explained() {
        let mut columns = Columns::default();
        columns.positions.extend(&[DVec3::ZERO, DVec3::ONE]);
        let particles = Particles::new(columns).unwrap();
        let why = |eye: DVec3, radius: f32| {
            let radii = Radii::Uniform(radius);
            let structure = Structure::build(Kind::default(), particles.clone(), &radii, 1.0, &()).unwrap();
            let camera = Viewpoint { eye: Some(eye), look_at: Some(DVec3::X * 5.0), ..viewpoint() };
            let camera = camera.camera(&Outline::of_box(&BOX, DVec3::ZERO), 1.0);
            why_unseen(&structure, 0, &camera.view(structure.origin(), 10, 10).unwrap())
        };
        let past = why(DVec3::X * 4.0, 0.1);
        assert!(
            past.starts_with("0 of 2 particles are in view — ") && past.contains("x -0.1..1.1"),
            "{past}"
        );
        let small = why(DVec3::X * -20.0, 1e-6);
        assert!(small.starts_with("2 of 2 particles are in view but"), "{small}");
    }

    #[test]
    fn particles_that_samples_miss_are_told() {
        let mut columns = Columns::default();
        columns.positions.extend(&[DVec3::ZERO, DVec3::ONE, DVec3::X]);
        let values = Values::F32(vec![2e-6, 1e-6, 0.5]);
        columns.attributes.push(Attribute::new("radius", 1, values));
        let particles = Particles::new(columns).unwrap();
        let view = viewpoint()
            .camera(&Outline::of_box(&BOX, DVec3::ZERO), 1.0)
            .view(particles.positions().origin(), 10, 10)
            .unwrap();
        let told =
            |radii: &Radii| too_small(Spheres { particles: &particles, radii, radius_scale: 1.0 }, &view);
        let spread = told(particles.radii().unwrap()).unwrap();
        assert!(
            spread.starts_with("radii span 1e-6..0.5; 67 % of those in view are under 0.1 pixel"),
            "{spread}"
        );
        assert!(
            told(&Radii::Uniform(1e-5))
                .unwrap()
                .starts_with("100 % of the particles in view have a radius under")
        );
        assert_eq!(told(&Radii::Uniform(0.2)), None);
    }
}
