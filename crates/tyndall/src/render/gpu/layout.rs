//! Records that stand in the card's memory as they stand here; a test compares every offset with what the shaders declare.

use bytemuck::{Pod, Zeroable};

use crate::math::Ray;
use crate::render::confidence::GAUSSIAN_STEPS;
use crate::scene::camera;

/// The camera: `View` in camera.wgsl.
#[derive(Clone, Copy, Debug, Pod, Zeroable, PartialEq)]
#[repr(C)]
pub(super) struct View {
    pub(super) eye: [f32; 3],
    pub(super) left: f32,
    pub(super) forward: [f32; 3],
    pub(super) top: f32,
    pub(super) right: [f32; 3],
    pub(super) pixel: f32,
    pub(super) up: [f32; 3],
    pub(super) unused: f32,
}

impl View {
    pub(super) fn of(view: &camera::View) -> Self {
        Self {
            eye: view.eye.to_array(),
            left: view.left,
            forward: view.forward.to_array(),
            top: view.top,
            right: view.right.to_array(),
            pixel: view.pixel,
            up: view.up.to_array(),
            unused: 0.0,
        }
    }
}

/// What all tiles of a pass have in common: `Pass` in pass.wgsl.
#[derive(Clone, Copy, Debug, Pod, Zeroable, PartialEq)]
#[repr(C)]
pub(super) struct Pass {
    pub(super) view: View,
    pub(super) size: [u32; 2],
    pub(super) first_row: u32,
    pub(super) pattern_px: u32,
    pub(super) centered: u32,
    pub(super) is_first: u32,
    pub(super) lighting: u32,
    pub(super) unused: u32,
    pub(super) nearest: [u32; 64],
    pub(super) lights: [[f32; 4]; 32],
}

/// Values of `Pass::lighting`.
pub(super) const HEADLIGHT: u32 = 0;
/// See [`HEADLIGHT`].
pub(super) const FLAT: u32 = 1;

/// The hierarchy's outline: `Bvh` in bvh.wgsl.
#[derive(Clone, Copy, Debug, Pod, Zeroable, PartialEq)]
#[repr(C)]
pub(super) struct Bvh {
    /// By level where it begins, how many it has, and nothing.
    pub(super) levels: [[u32; 4]; 12],
    pub(super) radii: [f32; 256],
    pub(super) top: u32,
    pub(super) particles: u32,
    pub(super) slack: f32,
    pub(super) radius: f32,
    pub(super) radius_scale: f32,
    pub(super) unused_0: u32,
    pub(super) unused_1: u32,
    pub(super) unused_2: u32,
}

/// The outline of heaps: `Outline` in heap.wgsl.
#[derive(Clone, Copy, Debug, Pod, Zeroable, PartialEq)]
#[repr(C)]
pub(super) struct Outline {
    pub(super) particles: u32,
    pub(super) slack: f32,
    pub(super) radius_scale: f32,
    pub(super) unused: u32,
}

/// What a kernel of the build is told: `Task` in build/task.wgsl.
#[derive(Clone, Copy, Debug, Pod, Zeroable, PartialEq)]
#[repr(C)]
pub(super) struct Task {
    pub(super) low: [f32; 3],
    pub(super) inv_edge: f32,
    pub(super) giant: f32,
    pub(super) count: u32,
    pub(super) first: u32,
    pub(super) runs: u32,
    pub(super) bit: u32,
    pub(super) level: u32,
    pub(super) next_level: u32,
    pub(super) nodes: u32,
}

/// `Ray` in math.wgsl.
#[derive(Clone, Copy, Debug, Pod, Zeroable, PartialEq)]
#[repr(C)]
pub(super) struct RayRecord {
    pub(super) origin: [f32; 3],
    pub(super) t_min: f32,
    pub(super) direction: [f32; 3],
    pub(super) t_max: f32,
}

impl RayRecord {
    /// What is infinitely far ends at the largest number.
    pub(super) fn of(ray: &Ray) -> Self {
        Self {
            origin: ray.origin.to_array(),
            t_min: ray.t_min,
            direction: ray.direction.to_array(),
            t_max: ray.t_max.min(f32::MAX),
        }
    }
}

/// What a sample of a pixel has led to: `Estimate` in culling.wgsl.
#[derive(Clone, Copy, Debug, Pod, Zeroable, PartialEq)]
#[repr(C)]
pub(super) struct Estimate {
    pub(super) depth: f32,
    pub(super) confidence: f32,
    pub(super) next: u32,
    pub(super) unique: f32,
}

/// What a pixel knows: `Pixel` in culling.wgsl.
#[derive(Clone, Copy, Debug, Pod, Zeroable, PartialEq)]
#[repr(C)]
pub(super) struct Pixel {
    pub(super) accumulation: Estimate,
    pub(super) cull: Estimate,
    pub(super) clip: f32,
    pub(super) unchanged: u32,
}

/// Vectors of the table of the Gaussian's integral.
pub(super) const NORMAL_VECTORS: usize = (GAUSSIAN_STEPS + 1).div_ceil(4);

/// What all pixels of culling by confidence have in common: `Culling` in culling.wgsl.
#[derive(Clone, Copy, Debug, Pod, Zeroable, PartialEq)]
#[repr(C)]
pub(super) struct Culling {
    pub(super) low: [f32; 3],
    pub(super) unit: f32,
    pub(super) high: [f32; 3],
    pub(super) radius: f32,
    pub(super) edge: [f32; 3],
    pub(super) radius_sq: f32,
    pub(super) inv_edge: [f32; 3],
    pub(super) stride: u32,
    pub(super) voxels: [u32; 3],
    pub(super) first: u32,
    pub(super) samples: u32,
    pub(super) seed: u32,
    pub(super) is_new: u32,
    pub(super) convergence_samples: u32,
    pub(super) sample_budget: u32,
    pub(super) occlusion_confidence: f32,
    pub(super) depth_quantization: u32,
    pub(super) trilinear: u32,
    pub(super) up_to_depth: u32,
    pub(super) kernel: u32,
    pub(super) level: u32,
    pub(super) normal_limit: f32,
    pub(super) normal: [[f32; 4]; NORMAL_VECTORS],
}

/// Sizes of two levels of the pyramid of confidences: `Level` in neighborhood.wgsl.
#[derive(Clone, Copy, Debug, Pod, Zeroable, PartialEq)]
#[repr(C)]
pub(super) struct Level {
    pub(super) from_size: [u32; 2],
    pub(super) to_size: [u32; 2],
}

/// The node of what has met nothing: `NONE` in math.wgsl.
pub(super) const NONE: u32 = u32::MAX;

/// A distance, and the node of what was met there, as the kernels write them.
#[derive(Clone, Copy, Debug, Pod, Zeroable, PartialEq)]
#[repr(C)]
pub(super) struct HitRecord {
    pub(super) depth: f32,
    pub(super) node: u32,
}
