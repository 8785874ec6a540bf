//! Particles that move while the shutter is open. How pictures are made of them, `render::drawn` tells.

use glam::Vec3;
use rayon::prelude::*;

use super::Scene;
use super::quantity::vector_by_id;
use crate::error::{Error, Result};
use crate::particles::Particles;
use crate::structure::by_node;

/// How far each particle moves in `exposure`, a time in the unit of the file, with the velocity called `name`; where that is not finite, not at all.
///
/// Fails with [`Error::Setting`] if there is no such vector, or the exposure is not a number of 0 or more.
pub fn displacements(particles: &Particles, name: &str, exposure: f64) -> Result<Vec<Vec3>> {
    if !(exposure >= 0.0 && exposure.is_finite()) {
        return Err(Error::setting("--shutter", exposure, "a time of 0 or more, in the unit of the file"));
    }
    moves(particles, "--velocity", name, exposure)
}

/// The velocity called `name` of each particle, in the unit of the file; where that is not finite, none. Any name of a velocity, such as `v`, means the
/// one that the file has.
///
/// Fails with [`Error::Setting`] of `setting` if there is no such vector.
pub fn velocities(particles: &Particles, setting: &'static str, name: &str) -> Result<Vec<Vec3>> {
    moves(particles, setting, name, 1.0)
}

/// How far each particle moves in a time.
fn moves(particles: &Particles, setting: &'static str, name: &str, exposure: f64) -> Result<Vec<Vec3>> {
    let velocity = vector_by_id(particles, setting, name)?;
    let displacement =
        |id| Some((exposure * velocity(id)).as_vec3()).filter(|it| it.is_finite()).unwrap_or_default();
    Ok((0..particles.len()).into_par_iter().with_min_len(1 << 14).map(displacement).collect())
}

impl Scene {
    /// From now on particles move by these displacements, by id, while a picture is taken: from half of it before their place to half of it behind.
    /// None lets them rest.
    ///
    /// Fails with [`Error::Setting`] if the structure is none whose particles can move: `bvh` or `brute`, without bonds, arrows and ellipsoids.
    pub fn set_motion(&mut self, displacements: Option<&[Vec3]>) -> Result<()> {
        let moving = displacements.filter(|all| all.iter().any(|it| *it != Vec3::ZERO));
        let refused = |allowed: &str| Err(Error::setting("--shutter", "given", allowed));
        if moving.is_some() && !self.structure.can_move() {
            return refused("left out with pkd and treelets: --structure bvh");
        }
        if moving.is_some() && self.shapes.as_ref().is_some_and(|shapes| shapes.have_particles()) {
            return refused("left out with bonds, arrows and ellipsoids, which do not move");
        }
        self.motion = moving.map(|all| by_node(all, self.structure.ids(), Vec3::ZERO));
        Ok(())
    }

    /// Whether any particle moves.
    pub fn is_moving(&self) -> bool {
        self.motion.is_some()
    }

    /// Whether each sample of a picture meets another scene.
    pub(crate) fn differs_by_sample(&self) -> bool {
        self.is_translucent() || self.is_moving()
    }

    /// Fails with [`Error::Setting`] if each sample meets another scene.
    pub(crate) fn check_same(&self, unable: &str) -> Result<()> {
        let name = if self.is_moving() { "--shutter" } else { "--opacity" };
        if self.differs_by_sample() {
            return Err(Error::setting(name, "given", format!("left out {unable}")));
        }
        Ok(())
    }

    /// The scene when this share of the exposure, -0.5 to 0.5, is behind the middle of it. All but what moves is in the same memory.
    pub(crate) fn at(&self, time: f32) -> Self {
        let structure = match &self.motion {
            None => self.structure.clone(),
            Some(motion) => self.structure.moved(|node| time * motion[node as usize]),
        };
        self.with(structure, self.shapes.clone(), self.opacity.clone())
    }
}
