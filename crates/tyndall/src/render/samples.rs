//! What the samples of a picture met, kept: the picture is lit and colored anew without a ray to the particles that are seen.

use fearless_simd::Level;

use super::cpu::{self, Film};
use super::normals::NormalStatistics;
use super::sampling::Samples;
use super::{Renderer, Settings};
use crate::error::{Error, Result};
use crate::film::Image;
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::camera::View;

/// Depth and particle of every sample of a picture: 8 bytes a sample.
pub struct SampleBuffer {
    view: View,
    settings: Settings,
    film: Film,
    passes: Vec<Samples>,
    nodes: u32,
    level: Level,
}

impl Renderer<'_> {
    /// Keeps what samples meet from now on, for [`Self::into_samples`]. To be called before the first pass.
    pub fn keeping_samples(mut self) -> Self {
        self.film.keeps = true;
        self
    }

    /// What the samples so far met; none unless it was kept.
    pub fn into_samples(self) -> Option<SampleBuffer> {
        self.film.keeps.then(|| SampleBuffer {
            view: self.view,
            settings: self.settings,
            film: self.film,
            passes: self.passes,
            nodes: self.scene.nodes(),
            level: self.level,
        })
    }
}

impl SampleBuffer {
    /// The picture in the light and the colors that `scene` has now: that of a new [`Renderer`], bit for bit. `scene` has the
    /// structure that the samples met. Shadows are found anew. Fails if it is another one, or when interrupted.
    pub fn image(&self, scene: &Scene, progress: &dyn Progress) -> Result<Image> {
        let mut film = self.film.like();
        let passes = self.passes(scene, &mut film)?;
        cpu::shade_each_tile(&mut film, &self.film, &passes, self.level, progress);
        if progress.cancelled() {
            return Err(Error::Interrupted);
        }
        let mut image = Image::default();
        film.image_into(scene, &mut image);
        Ok(image)
    }

    /// Moments of the normals and the mean color of every pixel, row by row. Fails as [`Self::image`] does.
    pub fn normals(&self, scene: &Scene) -> Result<Vec<NormalStatistics>> {
        let mut film = self.film.like();
        let passes = self.passes(scene, &mut film)?;
        Ok(cpu::normals::statistics(&self.film, &passes, self.level))
    }

    /// How many samples each pixel has.
    pub fn samples(&self) -> u32 {
        self.passes.iter().map(|samples| samples.count).sum()
    }

    /// Memory that it takes, in bytes.
    pub fn bytes(&self) -> u64 {
        self.film.kept_bytes()
    }

    fn passes<'a>(&self, scene: &'a Scene, film: &mut Film) -> Result<Vec<cpu::Pass<'a>>> {
        scene.check_same("where samples are kept")?;
        let found = scene.nodes();
        if found != self.nodes {
            return Err(Error::setting("scene", found, "the particles that the samples met"));
        }
        let certified = self.settings.culling.certified();
        Ok(self.passes.iter().map(|&samples| film.pass(scene, self.view, samples, certified)).collect())
    }
}
