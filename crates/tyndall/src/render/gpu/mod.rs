//! The graphics card: the tile sample buffer, light and single rays as compute shaders, over a copy of the scene in the card's memory.
//!
//! [`Gpu`] is an opened device, [`Resident`] a scene on it, [`Renderer`] one picture of it; `films` keeps the pictures of a scene that
//! changes. Work is submitted in bands of tile rows that take a bounded time each; nothing waits but for the band before the last, and
//! for what is read back. The kernels do not check their input: the builder of the hierarchy has written it.

mod build;
mod device;
mod film;
mod films;
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
pub use build::Hierarchy;
#[cfg(test)]
pub(crate) use build::order_of;
pub use device::{AdapterInfo, Gpu, Kind, Options, adapters};
use film::Film;
pub(super) use films::Films;
pub use resident::Resident;
pub use shader::{HeapWalk, Tiling, Tilings};
use shader::{Sampling, Walk};

/// What a band of a picture should take at most, so that a display on the same card stays alive.
const BAND: Duration = Duration::from_millis(50);
/// The same of a picture that can become obsolete at any time.
const PROMPT_BAND: Duration = Duration::from_millis(8);
/// Rows of pixels of which a band is made; a multiple of the height of every tile.
const BAND_ROWS: u32 = 16;

/// What the kernels of a pass need.
#[derive(Clone)]
struct Kernels {
    find_hits: wgpu::ComputePipeline,
    /// Goes on with tiles that were laid aside, if any are.
    go_on: Option<wgpu::ComputePipeline>,
    /// None where only hits are asked for.
    shade: Option<wgpu::ComputePipeline>,
    samples: u32,
    tilings: Tilings,
}

/// What a pass does to find hits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Tiles of the picture.
    pub tiles: u64,
    /// Steps of the walk, of all tiles: each takes several leaves, or several nodes.
    pub steps: u64,
    /// Steps of the tile that has most.
    pub most_steps: u64,
    /// Leaves whose particles were projected.
    pub leaves: u64,
    /// Nodes whose children were projected.
    pub nodes: u64,
    /// Tests of a sample against a particle.
    pub tests: u64,
}

/// What a picture shows: a scene on the card, with whatever light it has now, and from where.
#[derive(Clone, Copy)]
struct Seen<'a> {
    resident: &'a Resident,
    scene: &'a Scene,
    view: View,
}

/// How the bands of a picture are submitted.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Pace {
    /// As large as a display bears; one is encoded while another is worked on.
    Steady,
    /// Short ones, each of which is waited for, so that nothing is on its way when a pass is interrupted.
    Prompt,
}

/// The samples of one picture, and how far the pass that is under way has come.
struct Picture {
    size: [u32; 2],
    pace: Pace,
    film: Film,
    /// Others than those for the number of samples.
    tilings: Option<Tilings>,
    /// Samples that every pixel has.
    samples: u32,
    /// What the bands of the pass that is under way have in common, with the row that comes next, and the samples that it adds.
    under_way: Option<(layout::Pass, u32)>,
    nearness: Nearness,
    /// Kernels that were made, for which sampling and which light.
    made: Vec<(Kernels, Sampling, &'static str)>,
    /// Rows that the next band takes.
    rows: u32,
    /// The last pass that was submitted as a whole, and when.
    submitted: Option<(wgpu::SubmissionIndex, Instant)>,
}

impl Picture {
    /// Without samples. Fails with [`Error::Memory`] if it does not fit.
    fn new(resident: &Resident, size: [u32; 2], pace: Pace) -> Result<Self> {
        Ok(Self {
            size,
            pace,
            film: Film::new(resident.gpu(), resident, size)?,
            tilings: None,
            samples: 0,
            under_way: None,
            nearness: Nearness::NONE,
            made: Vec::new(),
            rows: BAND_ROWS,
            submitted: None,
        })
    }

    /// Forgets all samples.
    fn clear(&mut self) {
        (self.samples, self.under_way, self.nearness) = (0, None, Nearness::NONE);
    }

    /// Submits samples of every pixel, those that come after the ones it has. Fails when interrupted; begun again, it goes on with the rows
    /// that are left.
    fn pass(&mut self, seen: &Seen, added: &Samples, progress: &dyn Progress) -> Result<()> {
        let kernels = self.kernels(seen, added.count, progress)?;
        if self.under_way.is_none() {
            self.under_way = Some((self.record(seen, added), added.count));
            self.film.set_samples(seen.resident.gpu(), added);
        }
        self.bands(seen, &kernels, progress)?;
        self.samples += added.count;
        self.under_way = None;
        Ok(())
    }

    /// Waits, and draws the samples so far over `image`, which has its size; pixels without samples stay as they are.
    fn draw_over(&self, gpu: &Gpu, scene: &Scene, image: &mut Image) -> Result<()> {
        let (row, added) = self.under_way.as_ref().map_or((0, 0), |(pass, added)| (pass.first_row, *added));
        self.film.draw_over(gpu, scene, 0..row, self.samples + added, image)?;
        self.film.draw_over(gpu, scene, row..self.size[1], self.samples, image)
    }

    /// Submits the first samples of every pixel as one band; they are not counted.
    fn one_band(
        &mut self,
        seen: &Seen,
        added: &Samples,
        kernels: &Kernels,
        timer: Option<&film::Timer>,
    ) -> Result<()> {
        self.clear();
        let gpu = seen.resident.gpu();
        let pass = self.record(seen, added);
        self.film.set_samples(gpu, added);
        self.film.set_pass(gpu, &pass);
        self.film.submit_band(gpu, seen.resident, kernels, self.size[1], timer)?;
        Ok(())
    }

    fn sampling(&self, seen: &Seen, samples: u32) -> Sampling {
        let tilings = self.tilings.unwrap_or_else(|| Tilings::of(samples, seen.scene.structure().len()));
        Sampling { samples, perspective: seen.view.perspective, tilings }
    }

    fn kernels(&mut self, seen: &Seen, samples: u32, progress: &dyn Progress) -> Result<Kernels> {
        let sampling = self.sampling(seen, samples);
        let light = match seen.scene.lighting {
            Lighting::Studio(..) => "shade_studio",
            Lighting::Headlight | Lighting::Flat => "shade_open",
        };
        // Texts are long: those of a picture are not put together for every pass.
        let is_made = |(kernels, of, with): &&(Kernels, Sampling, &str)| {
            kernels.samples == samples && *of == sampling && *with == light
        };
        if let Some((kernels, ..)) = self.made.iter().find(is_made) {
            return Ok(kernels.clone());
        }
        let resident = seen.resident;
        let (shape, gpu) = (resident.shape(), resident.gpu());
        let [first, second] = resident.walk_layouts();
        let mut go_on = None;
        if sampling.tilings.patience > 0 && shape.walked.has_tiles() {
            let text = shape.tiles(sampling, Walk::Second);
            go_on = Some(gpu.pipeline(text, "find_hits", second, progress)?);
        }
        let kernels = Kernels {
            find_hits: gpu.pipeline(shape.hits(sampling), "find_hits", first, progress)?,
            go_on,
            shade: Some(gpu.pipeline(shape.shade(sampling), light, resident.pass_layout(), progress)?),
            samples,
            tilings: sampling.tilings,
        };
        self.made.push((kernels.clone(), sampling, light));
        Ok(kernels)
    }

    /// What all bands of a pass have in common.
    fn record(&mut self, seen: &Seen, added: &Samples) -> layout::Pass {
        let mut lights = [[0.0; 4]; 32];
        let mut lighting = layout::FLAT;
        match &seen.scene.lighting {
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
            view: layout::View::of(&seen.view),
            size: self.size,
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

    /// Submits what is left of the pass in bands. How long one takes decides how high the next ones are; at a steady pace a pass that fits in
    /// one does not wait.
    fn bands(&mut self, seen: &Seen, kernels: &Kernels, progress: &dyn Progress) -> Result<()> {
        let [width, height] = self.size;
        let gpu = seen.resident.gpu();
        let most_rows = self.film.band_rows(gpu, kernels.samples)?;
        let (band, always_waits) = match self.pace {
            Pace::Steady => (BAND, false),
            Pace::Prompt => (PROMPT_BAND, true),
        };
        let lower = |rows: u32| (rows / 2).next_multiple_of(BAND_ROWS).max(BAND_ROWS);
        while let Some((pass, _)) = self.under_way.as_mut().filter(|(pass, _)| pass.first_row < height) {
            if progress.cancelled() {
                return Err(Error::Interrupted);
            }
            let rows = self.rows.min(most_rows).min(height - pass.first_row);
            self.film.set_pass(gpu, pass);
            let start = Instant::now();
            let submitted = self.film.submit_band(gpu, seen.resident, kernels, rows, None)?;
            pass.first_row += rows;
            if rows < height || always_waits {
                gpu.wait(submitted)?;
                let time = start.elapsed();
                if time < band / 4 {
                    self.rows = self.rows.saturating_mul(2);
                } else if time > band {
                    self.rows = lower(rows);
                }
            } else if let Some((before, since)) = self.submitted.replace((submitted, start)) {
                gpu.wait(before)?;
                // Two are on their way at one time.
                if since.elapsed() > 2 * band {
                    (self.rows, self.submitted) = (lower(rows), None);
                }
            }
            progress.advance(u64::from(width) * u64::from(rows) * u64::from(kernels.samples));
        }
        Ok(())
    }
}

/// Renders one picture of a scene that is on the card, pass by pass.
pub struct Renderer<'a> {
    seen: Seen<'a>,
    settings: Settings,
    picture: Picture,
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
        let Settings { width, height, .. } = *settings;
        let view = camera.view(scene.structure().origin(), width, height)?;
        let picture = Picture::new(resident, [width, height], Pace::Steady)?;
        Ok(Self { seen: Seen { resident, scene, view }, settings: *settings, picture })
    }

    /// Uses tiles of another shape. The picture stays the same.
    pub fn with_tilings(mut self, tilings: Tilings) -> Self {
        self.picture.tilings = Some(tilings);
        self
    }

    /// Whether every pixel has all its samples.
    pub fn is_done(&self) -> bool {
        self.picture.samples >= self.settings.samples
    }

    /// Starts anew with another camera, in the same memory. Fails as [`Renderer::new`] does.
    pub fn restart(&mut self, camera: &Camera) -> Result<()> {
        let Settings { width, height, .. } = self.settings;
        self.seen.view = camera.view(self.seen.scene.structure().origin(), width, height)?;
        self.picture.clear();
        Ok(())
    }

    /// Submits up to sixteen samples of every pixel. Fails when interrupted, and with what went wrong on the card before; after an
    /// interruption the next pass goes on with the rows that are left.
    pub fn pass(&mut self, progress: &dyn Progress) -> Result<()> {
        let Settings { samples, seed, .. } = self.settings;
        match Samples::after(self.picture.samples, samples, seed) {
            Some(added) => self.picture.pass(&self.seen, &added, progress),
            None => Ok(()),
        }
    }

    /// Waits until all that was submitted is done, and tells what went wrong.
    pub fn finish(&self) -> Result<()> {
        self.seen.resident.gpu().flush()
    }

    /// Waits, and reads back the picture of the samples so far.
    pub fn image(&self) -> Result<Image> {
        let Seen { resident, scene, .. } = self.seen;
        let [width, height] = self.picture.size;
        let mut image = Image::empty(width, height, scene.background);
        self.picture.draw_over(resident.gpu(), scene, &mut image)?;
        Ok(image)
    }

    /// The place in the file of the particle that pixel (x, y) shows at its center, and its distance, of the samples so far; none
    /// where it shows none or lies outside. Reads back one pixel.
    pub fn pick(&self, x: u32, y: u32) -> Result<Option<(u64, f32)>> {
        if x >= self.settings.width || y >= self.settings.height || self.picture.samples == 0 {
            return Ok(None);
        }
        let Seen { resident, scene, .. } = self.seen;
        let hit = self.picture.film.nearest(resident.gpu(), x, y)?;
        Ok((hit.node != layout::NONE).then(|| (scene.structure().place(hit.node), hit.depth)))
    }

    /// Submits the first pass as one piece, waits, and gives the seconds that the card took by its own clock: to find what samples
    /// meet, and to light it. None if it has no clock, or if one piece is too much for it.
    pub fn time_pass(&mut self, progress: &dyn Progress) -> Result<Option<[f64; 2]>> {
        let Settings { samples, seed, height, .. } = self.settings;
        let gpu = self.seen.resident.gpu();
        let (Some(added), Some(timer)) = (Samples::after(0, samples, seed), film::Timer::new(gpu)?) else {
            return Ok(None);
        };
        if self.picture.film.band_rows(gpu, added.count)? < height {
            return Ok(None);
        }
        let kernels = self.picture.kernels(&self.seen, added.count, progress)?;
        self.picture.one_band(&self.seen, &added, &kernels, Some(&timer))?;
        self.picture.samples = added.count;
        timer.secs(gpu).map(Some)
    }

    /// What the walk of the first pass does: counts of all tiles if none is laid aside. None if one band is too little for it, or if the
    /// structure is walked by single rays.
    pub fn count_work(&mut self, progress: &dyn Progress) -> Result<Option<Work>> {
        let Settings { width, height, samples, seed, .. } = self.settings;
        let Seen { resident, .. } = self.seen;
        let gpu = resident.gpu();
        let Some(added) = Samples::after(0, samples, seed) else {
            return Ok(None);
        };
        let shape = resident.shape();
        if !shape.walked.has_tiles() || self.picture.film.band_rows(gpu, added.count)? < height {
            return Ok(None);
        }
        let sampling = self.picture.sampling(&self.seen, added.count);
        let text = shape.tiles(sampling, Walk::Counted);
        let find_hits = gpu.pipeline(text, "find_hits", &resident.walk_layouts()[0], progress)?;
        let tilings = sampling.tilings;
        let kernels = Kernels { find_hits, go_on: None, shade: None, samples: added.count, tilings };
        self.picture.one_band(&self.seen, &added, &kernels, None)?;
        let mut work = Work::default();
        let tile = tilings.first.tile;
        self.picture.film.read_hits(gpu, |hits| {
            let pixels = hits.chunks_exact(added.count as usize).take(width as usize * height as usize);
            for (pixel, hits) in (0..).zip(pixels) {
                let told = u64::from(hits[0].node);
                work.tests += u64::from(hits[0].depth.to_bits());
                match (pixel % width % tile[0], pixel / width % tile[1]) {
                    (0, 0) => {
                        work.steps += told;
                        work.most_steps = work.most_steps.max(told);
                    }
                    (1, 0) => work.leaves += told,
                    (2, 0) => work.nodes += told,
                    _ => {}
                }
            }
        })?;
        // Each thread has told of the first sample of its pixel, for all that it has.
        work.tests *= u64::from(added.count);
        work.tiles = u64::from(width.div_ceil(tile[0])) * u64::from(height.div_ceil(tile[1]));
        self.picture.clear();
        Ok(Some(work))
    }

    /// Makes the kernels that the picture needs, so that passes do not wait for them.
    pub fn prepare(&mut self, progress: &dyn Progress) -> Result<()> {
        let Settings { samples, seed, .. } = self.settings;
        let mut done = 0;
        while let Some(added) = Samples::after(done, samples, seed) {
            self.picture.kernels(&self.seen, added.count, progress)?;
            done += added.count;
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
    renderer.prepare(progress)?;
    let pixels = u64::from(settings.width) * u64::from(settings.height);
    progress.begin("render", Some(pixels * u64::from(settings.samples)), "samples");
    while !renderer.is_done() {
        renderer.pass(progress)?;
    }
    renderer.image()
}
