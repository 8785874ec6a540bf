//! The graphics card: the tile sample buffer, light and single rays as compute shaders, over a copy of the scene in the card's memory.
//!
//! [`Gpu`] is an opened device, [`Resident`] a scene on it, [`Renderer`] one picture of it. Work is submitted in bands of tile rows that
//! take a bounded time each; nothing waits but for the band before the last, and for what is read back. The kernels do not check
//! their input: the builder of the hierarchy has written it.

mod device;
mod film;
mod layout;
mod pages;
mod resident;
mod shader;
#[cfg(test)]
mod tests;

use std::time::{Duration, Instant};

use super::Settings;
use super::sampling::{Nearness, PATTERN, Samples};
use super::shade::{key_radiance, light_sample, sky_radiance};
use crate::error::{Error, Result};
use crate::film::Image;
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::camera::{Camera, View};
use crate::scene::light::Lighting;
pub use device::{AdapterInfo, Gpu, Kind, Options, adapters};
use film::Film;
pub use resident::Resident;
use shader::Sampling;
pub use shader::Tiling;

/// What a band of a picture should take at most, so that a display on the same card stays alive.
const BAND: Duration = Duration::from_millis(50);
/// Rows of pixels of which a band is made; a multiple of the height of every tile.
const BAND_ROWS: u32 = 16;

/// What the kernels of a pass need.
struct Kernels {
    find_hits: wgpu::ComputePipeline,
    shade: wgpu::ComputePipeline,
    samples: u32,
    tiling: Tiling,
}

/// Renders one picture of a scene that is on the card, pass by pass.
pub struct Renderer<'a> {
    resident: &'a Resident<'a>,
    scene: &'a Scene,
    view: View,
    settings: Settings,
    tiling: Tiling,
    film: Film,
    samples_done: u32,
    nearness: Nearness,
    /// Rows that the next band takes.
    rows: u32,
    /// The last pass that was submitted as a whole.
    submitted: Option<wgpu::SubmissionIndex>,
}

impl<'a> Renderer<'a> {
    /// A picture without samples yet. `scene` is what `resident` was loaded from, with whatever light and background it has now.
    /// Fails with [`Error::Setting`] if a knob or the camera is out of range, with [`Error::Memory`] if the picture does not fit.
    pub fn new(
        resident: &'a Resident,
        scene: &'a Scene,
        camera: &Camera,
        settings: &Settings,
    ) -> Result<Self> {
        settings.check()?;
        let view = camera.view(scene.structure().origin(), settings.width, settings.height)?;
        let film = Film::new(resident.gpu(), settings)?;
        Ok(Self {
            resident,
            scene,
            view,
            settings: *settings,
            tiling: Tiling::default(),
            film,
            samples_done: 0,
            nearness: Nearness::NONE,
            rows: BAND_ROWS,
            submitted: None,
        })
    }

    /// Uses tiles of another shape. The picture stays the same.
    pub fn with_tiling(self, tiling: Tiling) -> Self {
        Self { tiling, ..self }
    }

    /// Whether every pixel has all its samples.
    pub fn is_done(&self) -> bool {
        self.samples_done >= self.settings.samples
    }

    /// Starts anew with another camera, in the same memory. Fails as [`Renderer::new`] does.
    pub fn restart(&mut self, camera: &Camera) -> Result<()> {
        let Settings { width, height, .. } = self.settings;
        self.view = camera.view(self.scene.structure().origin(), width, height)?;
        self.samples_done = 0;
        self.nearness = Nearness::NONE;
        Ok(())
    }

    /// Submits up to sixteen samples of every pixel. Fails when interrupted, and with what went wrong on the card before.
    pub fn pass(&mut self, progress: &dyn Progress) -> Result<()> {
        let Settings { samples, seed, .. } = self.settings;
        let Some(added) = Samples::after(self.samples_done, samples, seed) else {
            return Ok(());
        };
        let kernels = self.kernels(added.count, progress)?;
        let pass = self.pass_record(&added);
        self.film.set_samples(self.resident.gpu(), &added);
        self.bands(&kernels, pass, progress)?;
        self.samples_done += added.count;
        Ok(())
    }

    /// Waits until all that was submitted is done, and tells what went wrong.
    pub fn finish(&self) -> Result<()> {
        self.resident.gpu().flush()
    }

    /// Waits, and reads back the picture of the samples so far.
    pub fn image(&self) -> Result<Image> {
        self.film.image(self.resident.gpu(), self.scene, self.samples_done)
    }

    /// The place in the file of the particle that pixel (x, y) shows at its center, and its distance, of the samples so far; none
    /// where it shows none or lies outside. Reads back one pixel.
    pub fn pick(&self, x: u32, y: u32) -> Result<Option<(u64, f32)>> {
        if x >= self.settings.width || y >= self.settings.height || self.samples_done == 0 {
            return Ok(None);
        }
        let hit = self.film.nearest(self.resident.gpu(), x, y)?;
        Ok((hit.node != layout::NONE).then(|| (self.scene.structure().place(hit.node), hit.depth)))
    }

    /// Submits the first pass as one piece, waits, and gives the seconds that the card took by its own clock: to find what samples
    /// meet, and to light it. None if it has no clock, or if one piece is too much for it.
    pub fn time_pass(&mut self, progress: &dyn Progress) -> Result<Option<[f64; 2]>> {
        let Settings { samples, seed, height, .. } = self.settings;
        let gpu = self.resident.gpu();
        let (Some(added), Some(timer)) = (Samples::after(0, samples, seed), film::Timer::new(gpu)?) else {
            return Ok(None);
        };
        if self.film.band_rows(gpu, added.count)? < height {
            return Ok(None);
        }
        self.nearness = Nearness::NONE;
        let kernels = self.kernels(added.count, progress)?;
        let pass = self.pass_record(&added);
        self.film.set_samples(gpu, &added);
        self.film.set_pass(gpu, &pass);
        self.film.submit_band(gpu, self.resident, &kernels, height, Some(&timer))?;
        self.samples_done = added.count;
        timer.secs(gpu).map(Some)
    }

    fn kernels(&self, samples: u32, progress: &dyn Progress) -> Result<Kernels> {
        let sampling =
            Sampling { samples, perspective: self.view.perspective, tiling: self.tiling.of(samples) };
        let shade = match self.scene.lighting {
            Lighting::Studio(..) => "shade_studio",
            Lighting::Headlight | Lighting::Flat => "shade_open",
        };
        let shape = self.resident.shape();
        let gpu = self.resident.gpu();
        let layout = self.resident.pass_layout();
        Ok(Kernels {
            find_hits: gpu.pipeline(shape.tiles(sampling), "find_hits", layout, progress)?,
            // Light is the same for every shape of tiles.
            shade: gpu.pipeline(
                shape.shade(Sampling { tiling: Tiling::default().of(samples), ..sampling }),
                shade,
                layout,
                progress,
            )?,
            samples,
            tiling: sampling.tiling,
        })
    }

    /// What all bands of a pass have in common.
    fn pass_record(&mut self, added: &Samples) -> layout::Pass {
        let mut lights = [[0.0; 4]; 32];
        let mut lighting = layout::FLAT;
        match &self.scene.lighting {
            Lighting::Headlight => lighting = layout::HEADLIGHT,
            Lighting::Flat => {}
            Lighting::Studio(key, sky) => {
                for (pair, sample) in lights.chunks_exact_mut(2).zip(0..added.count) {
                    let light = light_sample(key, added.seed, added.first + sample);
                    pair[0] = light.key.extend(key_radiance(key)).to_array();
                    pair[1] = light.sky.extend(sky_radiance(sky, light.sky)).to_array();
                }
            }
        }
        let nearest = self.nearness.add(added).map(|sample| sample.unwrap_or(layout::NONE));
        const { assert!(PATTERN * PATTERN == 64) };
        layout::Pass {
            view: layout::View::of(&self.view),
            size: [self.settings.width, self.settings.height],
            first_row: 0,
            pattern_px: film::pattern_px(added.count),
            centered: added.centered.into(),
            is_first: (added.first == 0).into(),
            lighting,
            unused: 0,
            nearest,
            lights,
        }
    }

    /// Submits the pass in bands. How long one takes decides how high the next ones are; a pass that fits in one does not wait.
    fn bands(&mut self, kernels: &Kernels, mut pass: layout::Pass, progress: &dyn Progress) -> Result<()> {
        let Settings { width, height, .. } = self.settings;
        let gpu = self.resident.gpu();
        let most_rows = self.film.band_rows(gpu, kernels.samples)?;
        let mut row = 0;
        while row < height {
            if progress.cancelled() {
                return Err(Error::Interrupted);
            }
            let rows = self.rows.min(most_rows).min(height - row);
            pass.first_row = row;
            self.film.set_pass(gpu, &pass);
            let start = Instant::now();
            let submitted = self.film.submit_band(gpu, self.resident, kernels, rows, None)?;
            if rows < height {
                gpu.wait(submitted)?;
                let time = start.elapsed();
                if time < BAND / 4 {
                    self.rows = self.rows.saturating_mul(2);
                } else if time > BAND {
                    self.rows = (rows / 2).next_multiple_of(BAND_ROWS).max(BAND_ROWS);
                }
            } else if let Some(before) = self.submitted.replace(submitted) {
                gpu.wait(before)?;
            }
            row += rows;
            progress.advance(u64::from(width) * u64::from(rows) * u64::from(kernels.samples));
        }
        Ok(())
    }
}

/// Renders a whole picture of a scene that is on the card.
pub fn render(
    resident: &Resident,
    scene: &Scene,
    camera: &Camera,
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<Image> {
    let mut renderer = Renderer::new(resident, scene, camera, settings)?;
    let pixels = u64::from(settings.width) * u64::from(settings.height);
    progress.begin("render", Some(pixels * u64::from(settings.samples)), "samples");
    while !renderer.is_done() {
        renderer.pass(progress)?;
    }
    renderer.image()
}
