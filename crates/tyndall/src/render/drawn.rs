//! Scenes of which each sample meets another one: of particles that are seen through, or that move while the shutter is open.
//!
//! Opacity is the probability that a particle is there. Each sample of a picture sees a scene of its own, in which particles are there or
//! not, and its light meets another one. So the mean of the samples is what composition in the order along each ray gives, the sum over the
//! particles `i` that a ray enters of `a_i c_i prod_{j before i} (1 - a_j)`, and shadows weaken by the same law. Nothing is sorted, and
//! nothing depends on the kind of structure. Source: E. Enderton, E. Sintorn, P. Shirley, D. Luebke, "Stochastic transparency", I3D 2010.
//! There pixels decide, here particles, so that what is left of the noise has no grain.
//!
//! Each sample also has a time of its own, the same all over the picture: times cover the exposure evenly.

use super::sampling::shuffled_number;
use crate::scene::Scene;
use crate::scene::light::Lighting;
use crate::scene::material::Material;

/// What one sample of all pixels meets.
pub(super) struct Drawn {
    /// By rays from the eye.
    pub(super) seen: Scene,
    /// By rays toward lights, and by what goes on from what was seen; none where that is the same.
    pub(super) secondary: Option<Scene>,
}

impl Drawn {
    /// Of sample `sample` of a picture of `scene`.
    pub(super) fn new(scene: &Scene, seed: u32, sample: u32) -> Self {
        let mut scene = scene.at(shuffled_number(seed ^ 0x9b05_688c, 0, sample) - 0.5);
        if !scene.is_translucent() {
            return Self { seen: scene, secondary: None };
        }
        let draw = |scene: &Scene, seed: u32| {
            scene.opaque(|id, opacity| opacity >= 1.0 || shuffled_number(seed, id, sample) < opacity)
        };
        let has_secondary = match &scene.lighting {
            Lighting::Headlight | Lighting::Flat | Lighting::Toon { .. } => false,
            Lighting::Studio(..) => true,
            // Within clear bodies light goes on from what was seen.
            Lighting::Paths(paths) => !matches!(paths.material, Material::Clear { .. }),
        };
        let secondary = has_secondary.then(|| draw(&scene, seed ^ 0x5be0_cd19));
        scene = draw(&scene, seed ^ 0x1f83_d9ab);
        Self { seen: scene, secondary }
    }
}
