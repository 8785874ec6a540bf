//! The surfaces that samples met: where they are, how they face, and their color.

use fearless_simd::{f32x16, mask32x16, prelude::*, u32x16};
use glam::Vec3;

use super::hits::PACKETS;
use super::tiles::RAYS;
use crate::scene::Scene;
use crate::scene::camera::View;
use crate::simd::Lanes3;

/// What sixteen rays met, where they met anything.
pub(super) struct Met<S: Simd> {
    pub(super) hits: mask32x16<S>,
    pub(super) position: Lanes3<f32x16<S>>,
    pub(super) normal: Lanes3<f32x16<S>>,
    /// The cosine between the normal and the way back to the eye.
    pub(super) cosine: f32x16<S>,
    pub(super) color: Lanes3<f32x16<S>>,
}

/// Looks up what rays met at `depth` and `node`; none if they met nothing. `varying` are their origins (orthographic) or directions
/// (perspective).
#[inline(always)]
pub(super) fn look_up<S: Simd>(
    simd: S,
    scene: &Scene,
    view: &View,
    (depth, node): (&[f32; RAYS], &[u32; RAYS]),
    varying: Lanes3<f32x16<S>>,
) -> Option<Met<S>> {
    let depth = f32x16::load_array_ref(simd, depth);
    let hits = depth.simd_lt(f32x16::splat(simd, f32::INFINITY));
    let bits = hits.to_bitmask();
    if bits == 0 {
        return None;
    }

    let (origin, direction) = if view.perspective {
        (Lanes3::splat(simd, view.eye), varying)
    } else {
        (varying, Lanes3::splat(simd, view.forward))
    };
    let point = origin.plus(direction.times(depth));
    let structure = scene.structure();
    let is_plain = structure.replicas().is_none() && scene.shapes().is_none() && scene.cut().is_none();
    // Neighboring rays often meet the same particle: it is looked up once for all of them.
    let zero = f32x16::splat(simd, 0.0);
    let mut center = Lanes3 { x: zero, y: zero, z: zero };
    let mut radius = zero;
    let mut color = Lanes3 { x: zero, y: zero, z: zero };
    let nodes = u32x16::load_array_ref(simd, node);
    let mut left = bits;
    let mut others: Option<Others> = None;
    while left != 0 {
        let node = node[left.trailing_zeros() as usize];
        let same = nodes.simd_eq(u32x16::splat(simd, node));
        left &= !same.to_bitmask();
        let (original, sphere) = if is_plain {
            (node, structure.own_sphere(node))
        } else if let Some((cut, node)) = scene.cap_of(node) {
            let lanes = same.to_bitmask() & bits;
            let cap = |point, direction| (point, cut.normal(point, direction));
            others.get_or_insert_default().settle(cap, lanes, Vec3::ZERO, (&point, &direction));
            color = Lanes3::splat(simd, scene.cap_color(cut, node).into()).where_else(same, color);
            continue;
        } else if let Some((shapes, own, shift)) = scene.locate_shape(node) {
            let lanes = same.to_bitmask() & bits;
            let shape = |point, direction| shapes.shape(own / 2).surface(point, direction);
            others.get_or_insert_default().settle(shape, lanes, shift, (&point, &direction));
            let owned = shapes.color(own, |owner| scene.color(owner));
            color = Lanes3::splat(simd, Vec3::from_array(owned)).where_else(same, color);
            continue;
        } else {
            (structure.original(node), structure.sphere(node))
        };
        center = Lanes3::splat(simd, sphere.0).where_else(same, center);
        radius = same.select(f32x16::splat(simd, sphere.1), radius);
        color = Lanes3::splat(simd, Vec3::from_array(scene.color(original))).where_else(same, color);
    }

    let outward = point.minus(center);
    // A sphere so small that rounding leaves no direction faces the eye.
    let length_sq = outward.dot(outward);
    let is_clear = length_sq.simd_gt(f32x16::splat(simd, f32::MIN_POSITIVE));
    let normal = outward.times(f32x16::splat(simd, 1.0) / length_sq.sqrt());
    let normal = normal.where_else(is_clear, Lanes3 { x: -direction.x, y: -direction.y, z: -direction.z });
    let mut position = center.plus(normal.times(radius));
    let mut normal = normal;
    if let Some(others) = others {
        let is_other = mask32x16::from_bitmask(simd, others.lanes);
        position = Lanes3::load(simd, &others.position).where_else(is_other, position);
        normal = Lanes3::load(simd, &others.normal).where_else(is_other, normal);
    }
    Some(Met { hits, position, normal, cosine: -normal.dot(direction), color })
}

/// Place and normal of surfaces that are no spheres, by axis and lane; a bit for each lane that has them.
#[derive(Default)]
struct Others {
    lanes: u64,
    position: [[f32; RAYS]; 3],
    normal: [[f32; RAYS]; 3],
}

impl Others {
    /// Sets the lanes of the bit mask, which met something at `point` along `direction`, in an image that is moved by `shift`. `surface` says place and
    /// normal of that near such a point.
    fn settle<S: Simd>(
        &mut self,
        surface: impl Fn(Vec3, Vec3) -> (Vec3, Vec3),
        mut lanes: u64,
        shift: Vec3,
        (point, direction): (&Lanes3<f32x16<S>>, &Lanes3<f32x16<S>>),
    ) {
        self.lanes |= lanes;
        let (points, directions) = (point.to_arrays(), direction.to_arrays());
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize;
            lanes &= lanes - 1;
            let at = |columns: &[[f32; RAYS]; 3]| Vec3::from([0, 1, 2].map(|axis| columns[axis][lane]));
            let (position, normal) = surface(at(&points) - shift, at(&directions));
            let position = position + shift;
            for axis in 0..3 {
                (self.position[axis][lane], self.normal[axis][lane]) = (position[axis], normal[axis]);
            }
        }
    }
}

/// What one sample of every pixel of a film tile met, by packet; see `hits`.
pub(super) struct Layer {
    /// A bit for each lane that met something; where it is zero the rest of the packet means nothing.
    pub(super) hits: [u16; PACKETS],
    pub(super) node: [[u32; RAYS]; PACKETS],
    /// By axis.
    pub(super) position: [[[f32; RAYS]; 3]; PACKETS],
    pub(super) normal: [[[f32; RAYS]; 3]; PACKETS],
    pub(super) color: [[[f32; RAYS]; 3]; PACKETS],
    /// Light gathered so far.
    pub(super) brightness: [[f32; RAYS]; PACKETS],
}

impl Layer {
    pub(super) fn new() -> Box<Self> {
        Box::new(Self {
            hits: [0; PACKETS],
            node: [[0; RAYS]; PACKETS],
            position: [[[0.0; RAYS]; 3]; PACKETS],
            normal: [[[0.0; RAYS]; 3]; PACKETS],
            color: [[[0.0; RAYS]; 3]; PACKETS],
            brightness: [[0.0; RAYS]; PACKETS],
        })
    }

    /// Holds what a packet met, dark.
    #[inline(always)]
    pub(super) fn set<S: Simd>(&mut self, packet: usize, node: &[u32; RAYS], met: Option<Met<S>>) {
        let Some(met) = met else {
            self.hits[packet] = 0;
            return;
        };
        self.hits[packet] = met.hits.to_bitmask() as u16;
        self.node[packet] = *node;
        met.position.store(&mut self.position[packet]);
        met.normal.store(&mut self.normal[packet]);
        met.color.store(&mut self.color[packet]);
        self.brightness[packet] = [0.0; RAYS];
    }
}
