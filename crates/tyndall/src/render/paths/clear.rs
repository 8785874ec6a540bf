//! Light in clear bodies: mirrored or broken where it enters, and followed until it leaves.
//!
//! Spheres and other shapes that overlap are one body: light within goes on where another one begins before the first one ends. A triangle of a mesh is a thin pane. Where a body is cut, its cap is as clear as
//! the rest, unless caps have a color of their own: then they are matte.

use glam::Vec3;

use super::MOST_CLEAR;
use super::scatter::fresnel;
use crate::math::Ray;
use crate::random::Stream;
use crate::render::surface::Surface;
use crate::scene::Scene;
use crate::structure::shapes::Shape;

/// Diameters after which light has a body's color: colors of maps are too dark for one.
pub(super) const COLOR_DIAMETERS: f32 = 4.0;

/// Light that goes on from the surface of a clear body.
pub(super) struct Out {
    pub(super) origin: Vec3,
    pub(super) direction: Vec3,
    /// Of what it starts on.
    pub(super) node: u32,
    pub(super) throughput: Vec3,
}

/// What light goes through.
#[derive(Clone, Copy)]
pub(super) enum Body<'a> {
    Sphere {
        center: Vec3,
        radius: f32,
    },
    /// A solid shape of an image, which is moved.
    Shape {
        shape: &'a Shape,
        shift: Vec3,
    },
    /// What is flat.
    Pane,
}

impl<'a> Body<'a> {
    /// What is behind the surface at a node; none if that is a matte cap.
    pub(super) fn at(scene: &'a Scene, node: u32) -> Option<Self> {
        let node = match scene.cap_of(node) {
            Some((cut, _)) if cut.is_painted() => return None,
            Some((_, node)) => node,
            None => node,
        };
        let Some((shapes, own, shift)) = scene.locate_shape(node) else {
            let (center, radius) = scene.structure().sphere(node);
            return Some(Self::Sphere { center, radius });
        };
        Some(match shapes.shape(own / 2) {
            Shape::Triangle(_) => Self::Pane,
            shape => Self::Shape { shape, shift },
        })
    }

    /// How far it is from a point in or on it to its surface.
    fn leave(&self, origin: Vec3, direction: Vec3) -> f32 {
        match *self {
            Self::Sphere { center, radius } => {
                let to_center = center - origin;
                let closest = to_center.dot(direction);
                let off = to_center - closest * direction;
                (closest + (radius * radius - off.dot(off)).max(0.0).sqrt()).max(0.0)
            }
            Self::Shape { shape, shift } => {
                let line = Ray { origin: origin - shift, direction, t_min: 0.0, t_max: f32::INFINITY };
                shape.chord(&line).map_or(0.0, |[_, leave]| leave.max(0.0))
            }
            Self::Pane => 0.0,
        }
    }

    /// Place and normal of the surface near a point of it at which light comes from within.
    fn surface(&self, point: Vec3, direction: Vec3) -> (Vec3, Vec3) {
        match *self {
            Self::Sphere { center, radius } => {
                let outward = (point - center).normalize_or(direction);
                (center + radius * outward, outward)
            }
            Self::Shape { shape, shift } => {
                let (place, outward) = shape.surface(point - shift, -direction);
                (place + shift, outward)
            }
            Self::Pane => (point, direction),
        }
    }

    /// Half its thickness, about.
    fn radius(&self) -> f32 {
        match *self {
            Self::Sphere { radius, .. } => radius,
            Self::Shape { shape, .. } => shape.radius(),
            Self::Pane => 0.0,
        }
    }
}

/// Follows light that comes along `direction` to a body's surface until it leaves the body; chance decides at each surface whether it is
/// mirrored or broken.
pub(super) fn cross<'a>(
    scene: &'a Scene,
    (surface, body): (&Surface, Body<'a>),
    direction: Vec3,
    index: f32,
    stream: &mut Stream,
) -> Out {
    let Surface { node, position, normal, color, .. } = *surface;
    let (once, other) = fresnel((-direction.dot(normal)).clamp(0.0, 1.0), index);
    let is_pane = matches!(body, Body::Pane);
    // What both sides of a pane mirror, again and again.
    let mirrored = if is_pane { 2.0 * once / (1.0 + once) } else { once };
    if stream.unit() < mirrored {
        return Out { origin: position, direction: mirror(direction, normal), node, throughput: Vec3::ONE };
    }
    if is_pane {
        return Out { origin: position, direction, node, throughput: left(color, 1.0 / COLOR_DIAMETERS) };
    }
    let mut within = broken(direction, normal, 1.0 / index, other);
    let node = scene.cap_of(node).map_or(node, |(_, of)| of);
    let mut inside = Inside { node, body, color };
    let (mut origin, mut throughput) = (position, Vec3::ONE);
    for _ in 0..MOST_CLEAR {
        let end = inside.run_to_end(scene, origin, within);
        origin = end.place;
        throughput *= end.clearness;
        let (mirrored, other) = fresnel(within.dot(end.outward).clamp(0.0, 1.0), 1.0 / index);
        if stream.unit() >= mirrored {
            let direction = broken(within, -end.outward, index, other);
            return Out { origin, direction, node: end.node, throughput };
        }
        within = mirror(within, end.outward);
    }
    Out { origin, direction: within, node: inside.node, throughput: Vec3::ZERO }
}

/// The body in which light is.
struct Inside<'a> {
    node: u32,
    body: Body<'a>,
    color: Vec3,
}

/// Where light comes to the end of a body from within.
struct End {
    place: Vec3,
    outward: Vec3,
    /// Of the surface there.
    node: u32,
    /// The share of light that is left.
    clearness: Vec3,
}

impl<'a> Inside<'a> {
    /// Where the body ends from a point on or in it. Afterwards this is the one in which it ends.
    fn run_to_end(&mut self, scene: &'a Scene, origin: Vec3, direction: Vec3) -> End {
        let ray = |t_min: f32, t_max: f32| Ray { origin, direction, t_min, t_max };
        let (to_cap, cap) = scene.end_of_uncut(&ray(0.0, f32::INFINITY));
        let mut clearness = Vec3::ONE;
        let (mut start, mut end) = (0.0, self.body.leave(origin, direction));
        let mut from = self.node;
        let mut reached = 0.0;
        for _ in 0..MOST_CLEAR {
            // Bodies that begin before the last one ends, and then those in which it ends that hold a cap by which light came in.
            let entered = scene.nearest(&ray(reached, end.min(to_cap)), Some(from));
            let held = || {
                let is_cut = scene.cut().is_some() && end < to_cap;
                let node = is_cut.then(|| scene.deepest(&ray(0.0, f32::INFINITY), end)).flatten();
                node.map(|node| (end, node))
            };
            let Some((t, node)) = entered.or_else(held) else { break };
            (reached, from) = (t, node);
            let Some(body) = Body::at(scene, node) else { continue };
            let other_end = body.leave(origin, direction);
            if entered.is_none() && other_end <= end {
                break;
            }
            if other_end > end {
                clearness *= self.left(t - start);
                let color = Surface::new(scene, &ray(0.0, f32::INFINITY), (t, node)).color;
                *self = Self { node, body, color };
                (start, end) = (t, other_end);
            }
        }
        clearness *= self.left(end.min(to_cap) - start);
        let point = origin + end.min(to_cap) * direction;
        if to_cap < end {
            return End { place: point, outward: cap, node: scene.nodes() + self.node, clearness };
        }
        let (place, outward) = self.body.surface(point, direction);
        End { place, outward, node: self.node, clearness }
    }

    /// The share of light that is left after a length within the body.
    fn left(&self, length: f32) -> Vec3 {
        left(self.color, (length / (COLOR_DIAMETERS * 2.0 * self.body.radius())).max(0.0))
    }
}

/// The share of light of a color that is left, where it is the color after a depth of 1.
fn left(color: Vec3, depth: f32) -> Vec3 {
    Vec3::from_array(color.to_array().map(|channel| channel.max(1e-6).powf(depth).min(1.0)))
}

fn mirror(direction: Vec3, normal: Vec3) -> Vec3 {
    (direction - 2.0 * direction.dot(normal) * normal).normalize_or(normal)
}

/// Where light goes on through a surface whose normal is against it; `relative` is the index of this side over that of the other, `other` the
/// cosine there.
fn broken(direction: Vec3, normal: Vec3, relative: f32, other: f32) -> Vec3 {
    let cosine = -direction.dot(normal);
    (relative * direction + (relative * cosine - other) * normal).normalize_or(direction)
}
