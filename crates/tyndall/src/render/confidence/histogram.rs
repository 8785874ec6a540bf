//! How many particles are in a pixel's frustum up to each depth: the march through the density grid (Walloner 2022, section 5.2.2).
//!
//! The ray through the pixel's center is sampled once in every slab of voxels across the largest component of its direction (of
//! equal ones the first), in the middle of its way through the slab: of a slab that the ray enters or leaves through a side of the
//! grid only the part in the grid counts.

use glam::Vec3;

use super::grid::DensityGrid;
use super::{Interpolation, footprint};
use crate::math::Ray;
use crate::scene::camera::View;

/// See the module. Depths are distances along rays.
#[derive(Default)]
pub(crate) struct Histogram {
    /// Where the ray enters and leaves the grid, or ends in it.
    enter: f32,
    leave: f32,
    /// Where the first slab begins, and the slabs' thickness along the ray.
    first: f32,
    step: f32,
    /// Particles in front of each slab, and in front of the end.
    before: Vec<f32>,
}

impl Histogram {
    /// Marches along `ray`, the ray through the center of a pixel of `view`, up to its end.
    pub(crate) fn march(&mut self, grid: &DensityGrid, view: &View, ray: &Ray, interpolation: Interpolation) {
        self.before.clear();
        self.before.push(0.0);
        let direction = ray.direction.abs().to_array();
        let axis = (1..3).fold(0, |best, axis| if direction[axis] > direction[best] { axis } else { best });
        let speed = ray.direction[axis];
        let (start, edge) = (grid.bounds().min[axis], grid.edge()[axis]);
        let slab = |t: f32| (ray.origin[axis] + t * speed - start) / edge;

        // Where the first slab begins: the side of its slab that the ray comes from.
        let [enter, leave] = grid.bounds().clip(ray).unwrap_or([0.0, 0.0]);
        let place = slab(enter).clamp(0.0, grid.voxels()[axis] as f32);
        let side = if speed >= 0.0 { place.floor() } else { place.ceil() };
        self.step = edge / speed.abs();
        self.first = ((start + side * edge - ray.origin[axis]) / speed).min(enter);
        (self.enter, self.leave) = (enter, leave);

        let cosine = ray.direction.dot(view.forward);
        let count =
            ((leave - self.first) / self.step).ceil().clamp(0.0, grid.voxels()[axis] as f32 + 2.0) as usize;
        let mut sum = 0.0;
        for number in 0..count {
            let near = (self.first + number as f32 * self.step).max(enter);
            let far = (self.first + (number + 1) as f32 * self.step).min(leave);
            if near < far {
                let t = 0.5 * (near + far);
                let density = grid.density(ray.origin + t * ray.direction, interpolation);
                if density > 0.0 {
                    // The edge of the frustum there, and its volume between `near` and `far`, in voxels.
                    let pixel = if view.perspective { view.pixel * t * cosine } else { view.pixel };
                    let sides = Vec3::new(pixel, pixel, cosine * (far - near)) / grid.edge();
                    sum +=
                        density * sides.element_product() * footprint::population(grid.mean_radius(), pixel);
                }
            }
            self.before.push(sum);
        }
    }

    /// Particles in the frustum: D(d_min, d_max).
    pub(crate) fn total(&self) -> f32 {
        self.before.last().copied().unwrap_or(0.0)
    }

    /// Particles in the frustum in front of depth `t`: D(d_min, t).
    pub(crate) fn before(&self, t: f32) -> f32 {
        if t <= self.enter {
            return 0.0;
        }
        if t >= self.leave {
            return self.total();
        }
        let last = self.before.len() - 2;
        let number = (((t - self.first) / self.step) as usize).min(last);
        let near = (self.first + number as f32 * self.step).max(self.enter);
        let far = (self.first + (number + 1) as f32 * self.step).min(self.leave);
        let along = if near < far { ((t - near) / (far - near)).clamp(0.0, 1.0) } else { 1.0 };
        self.before[number] + (self.before[number + 1] - self.before[number]) * along
    }

    /// Particles in the frustum behind depth `t`: D(t, d_max).
    pub(crate) fn behind(&self, t: f32) -> f32 {
        (self.total() - self.before(t)).max(0.0)
    }

    /// Where the pixel's ray leaves the slab of voxels that depth `t` is in: not nearer than `t`, and the same for all depths in it
    /// (depth quantisation, section 4.1).
    pub(crate) fn back_of_slab(&self, t: f32) -> f32 {
        let number = ((t - self.first) / self.step).floor();
        (self.first + (number + 1.0) * self.step).max(t)
    }
}
