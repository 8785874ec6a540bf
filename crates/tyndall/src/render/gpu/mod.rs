//! The graphics card: the tile sample buffer, light and single rays as compute shaders, over a copy of the scene in the card's memory.
//!
//! [`Gpu`] is an opened device, [`Resident`] a scene on it, [`Renderer`] one picture of it. Work is submitted in bands of tile rows that
//! take a bounded time each; nothing waits but for the band before the last, and for what is read back. The kernels do not check
//! their input: the builder of the hierarchy has written it.

mod confidence;
mod device;
mod film;
mod layout;
mod pages;
mod resident;
mod shader;
#[cfg(test)]
mod tests;
mod visible;

use std::time::{Duration, Instant};

use super::certified::Counts;
use super::confidence::Report;
use super::sampling::{Nearness, PATTERN, Samples};
use super::shade::{key_radiance, light_sample, sky_radiance};
use super::{Culling, Settings};
use crate::error::{Error, Result};
use crate::film::Image;
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::camera::{Camera, View};
use crate::scene::light::Lighting;
use confidence::Confidence;
pub use device::{AdapterInfo, Gpu, Kind, Options, adapters};
use film::Film;
pub use resident::Resident;
pub use shader::{HeapWalk, Tiling, Tilings};
use shader::{Sampling, Walk};
use visible::VisibleSet;

/// What a band of a picture should take at most, so that a display on the same card stays alive.
const BAND: Duration = Duration::from_millis(50);
/// Rows of pixels of which a band is made; a multiple of the height of every tile.
const BAND_ROWS: u32 = 16;

/// What the kernels of a pass need.
#[derive(Clone)]
struct Kernels {
    find_hits: wgpu::ComputePipeline,
    /// What culling has to say, in the place where else only tiles are laid aside.
    beside: Option<wgpu::BindGroup>,
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

/// Renders one picture of a scene that is on the card, pass by pass.
pub struct Renderer<'a> {
    resident: &'a Resident<'a>,
    scene: &'a Scene,
    view: View,
    settings: Settings,
    /// Others than those for the number of samples.
    tilings: Option<Tilings>,
    film: Film,
    culling: Option<Confidence>,
    /// With certified culling, where several passes are alike.
    visible: Option<VisibleSet>,
    samples_done: u32,
    nearness: Nearness,
    /// Kernels that were made, for which sampling, light and walk.
    made: Vec<(Kernels, Sampling, &'static str, Walk)>,
    /// Rows that the next band takes.
    rows: u32,
    /// The last pass that was submitted as a whole, and when.
    submitted: Option<(wgpu::SubmissionIndex, Instant)>,
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
        let film = Film::new(resident.gpu(), resident, settings)?;
        let culling = match settings.culling {
            Culling::Off | Culling::Certified(_) => None,
            Culling::Confidence(_) if !resident.shape().walked.has_tiles() => {
                let allowed = "bvh with --culling confidence on the GPU; the others are for --device cpu";
                return Err(Error::setting("--structure", "another", allowed));
            }
            Culling::Confidence(options) => {
                let grid = resident.grid(scene.structure(), options.voxel_count, &())?;
                Some(Confidence::new(resident, grid, [settings.width, settings.height], options)?)
            }
        };
        Ok(Self {
            resident,
            scene,
            view,
            settings: *settings,
            tilings: None,
            film,
            culling,
            visible: None,
            samples_done: 0,
            nearness: Nearness::NONE,
            made: Vec::new(),
            rows: BAND_ROWS,
            submitted: None,
        })
    }

    /// Uses tiles of another shape. The picture stays the same.
    pub fn with_tilings(self, tilings: Tilings) -> Self {
        Self { tilings: Some(tilings), ..self }
    }

    /// Whether every pixel has all its samples.
    pub fn is_done(&self) -> bool {
        self.samples_done >= self.settings.samples
    }

    /// Starts anew with another camera, in the same memory. Fails as [`Renderer::new`] does.
    pub fn restart(&mut self, camera: &Camera) -> Result<()> {
        let Settings { width, height, .. } = self.settings;
        self.view = camera.view(self.scene.structure().origin(), width, height)?;
        self.restart_counts();
        if let Some(culling) = &mut self.culling {
            culling.restart();
        }
        if let Some(visible) = &mut self.visible {
            visible.restart();
        }
        Ok(())
    }

    /// Waits, and tells what certified culling saved since the picture was begun: leaves that passes knew of before they began. The card seeks
    /// no other proofs.
    pub fn counts(&self) -> Result<Counts> {
        let remembered_leaves = match &self.visible {
            Some(visible) => visible.remembered_leaves(self.resident.gpu())?,
            None => 0,
        };
        Ok(Counts { remembered_leaves, ..Counts::default() })
    }

    /// Takes what culling by confidence has learned of this view for final, and starts the picture anew.
    pub fn settle(&mut self) {
        self.restart_counts();
        if let Some(culling) = &mut self.culling {
            culling.settle();
        }
    }

    /// Waits, and tells how far culling by confidence is; none with any other.
    pub fn confidence(&self) -> Result<Option<Report>> {
        self.culling.as_ref().map(|culling| culling.report(self.resident.gpu())).transpose()
    }

    /// Submits up to sixteen samples of every pixel, with culling by confidence those of a frame. Fails when interrupted, and with what went
    /// wrong on the card before.
    pub fn pass(&mut self, progress: &dyn Progress) -> Result<()> {
        let Some(added) = self.samples_after(self.samples_done) else {
            return Ok(());
        };
        let walk = self.walk(&added)?;
        let mut kernels = self.kernels(added.count, walk, progress)?;
        let pass = self.pass_record(&added);
        let gpu = self.resident.gpu();
        self.film.set_samples(gpu, &added);
        let mut most_rows = self.film.band_rows(gpu, added.count)?;
        if let Some(culling) = &mut self.culling {
            most_rows = most_rows.min(culling.band_rows(gpu, BAND_ROWS)?);
            kernels.beside = Some(culling.begin(gpu, &added, most_rows)?);
        }
        if let Some(visible) = self.visible.as_ref().filter(|_| walk != Walk::First) {
            kernels.beside = Some(visible.group().clone());
        }
        self.bands(&kernels, pass, most_rows, progress)?;
        if let Some(visible) = self.visible.as_mut().filter(|_| walk != Walk::First) {
            visible.used();
        }
        if let Some(culling) = &mut self.culling {
            culling.decide(gpu, progress)?;
        }
        self.samples_done += added.count;
        Ok(())
    }

    /// With what the tiles of a pass begin: where certified culling seeks the visible set, the first pass notes it for those that are alike.
    fn walk(&mut self, added: &Samples) -> Result<Walk> {
        let Settings { width, height, .. } = self.settings;
        if !self.settings.culling.certified().visible_set || !self.resident.shape().walked.has_tiles() {
            return Ok(Walk::First);
        }
        let tiling = |added: &Samples| self.sampling(added.count).tilings.first;
        let own = tiling(added);
        let serves = self.samples_after(added.first + added.count).is_some_and(|next| tiling(&next) == own);
        if added.first == 0 && serves && self.visible.is_none() {
            self.visible = VisibleSet::new(self.resident, &self.film, [width, height], own)?;
        }
        let visible = self.visible.as_ref().filter(|visible| visible.is_of(own));
        Ok(match visible {
            Some(visible) if visible.is_noted() => Walk::Again,
            Some(_) if added.first == 0 && serves => Walk::Noting,
            _ => Walk::First,
        })
    }

    /// The samples that come after the first `done`, if any are missing.
    fn samples_after(&self, done: u32) -> Option<Samples> {
        let Settings { samples, seed, .. } = self.settings;
        let at_once = self.culling.as_ref().map_or(u32::MAX, Confidence::frame_samples);
        Samples::after(done, samples, seed).map(|added| added.at_most(at_once))
    }

    /// Submits all samples that are missing. Fails as [`Renderer::pass`] does.
    pub fn complete(&mut self, progress: &dyn Progress) -> Result<()> {
        self.prepare(progress)?;
        let Settings { width, height, samples, .. } = self.settings;
        let samples = u64::from(samples - self.samples_done);
        progress.begin("render", Some(u64::from(width) * u64::from(height) * samples), "samples");
        while !self.is_done() {
            self.pass(progress)?;
        }
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
    /// meet, and to light it. None if it has no clock, if one piece is too much for it, or with culling by confidence, which learns from all
    /// passes.
    pub fn time_pass(&mut self, progress: &dyn Progress) -> Result<Option<[f64; 2]>> {
        let Settings { samples, seed, height, .. } = self.settings;
        let gpu = self.resident.gpu();
        let (Some(added), Some(timer)) = (Samples::after(0, samples, seed), film::Timer::new(gpu)?) else {
            return Ok(None);
        };
        if self.culling.is_some() || self.film.band_rows(gpu, added.count)? < height {
            return Ok(None);
        }
        self.nearness = Nearness::NONE;
        let kernels = self.kernels(added.count, Walk::First, progress)?;
        let pass = self.pass_record(&added);
        self.film.set_samples(gpu, &added);
        self.film.set_pass(gpu, &pass);
        self.film.submit_band(gpu, self.resident, &kernels, height, Some(&timer))?;
        self.samples_done = added.count;
        timer.secs(gpu).map(Some)
    }

    /// What the walk of the first pass does: counts of all tiles if none is laid aside. None if one band is too little for it, or if the
    /// structure is walked by single rays.
    pub fn count_work(&mut self, progress: &dyn Progress) -> Result<Option<Work>> {
        let Some(added) = self.counted_samples(0)? else { return Ok(None) };
        self.restart_counts();
        self.count(&added, Walk::Counted, progress).map(Some)
    }

    /// The same of a second pass, which begins with what the first has noted. None too if that is not noted.
    pub fn count_work_again(&mut self, progress: &dyn Progress) -> Result<Option<Work>> {
        if self.counted_samples(0)?.is_none() || !self.settings.culling.certified().visible_set {
            return Ok(None);
        }
        self.restart_counts();
        if let Some(visible) = &mut self.visible {
            visible.restart();
        }
        self.pass(progress)?;
        let Some(added) = self.counted_samples(self.samples_done)? else { return Ok(None) };
        if self.walk(&added)? != Walk::Again {
            return Ok(None);
        }
        self.count(&added, Walk::CountedAgain, progress).map(Some)
    }

    /// The samples after the first `done`, if a band can have all of theirs.
    fn counted_samples(&self, done: u32) -> Result<Option<Samples>> {
        let Some(added) = self.samples_after(done).filter(|_| self.resident.shape().walked.has_tiles())
        else {
            return Ok(None);
        };
        let rows = self.film.band_rows(self.resident.gpu(), added.count)?;
        Ok((rows >= self.settings.height).then_some(added))
    }

    /// Counts what a walk does for these samples.
    fn count(&mut self, added: &Samples, walk: Walk, progress: &dyn Progress) -> Result<Work> {
        let Settings { width, height, .. } = self.settings;
        let gpu = self.resident.gpu();
        let sampling = self.sampling(added.count);
        let text = self.resident.shape().tiles(sampling, walk);
        let visible = self.visible.as_ref().filter(|_| walk == Walk::CountedAgain);
        let layout = visible.map_or(&self.resident.walk_layouts()[0], VisibleSet::layout);
        let find_hits = gpu.pipeline(text, "find_hits", layout, progress)?;
        let tilings = sampling.tilings;
        let beside = visible.map(|visible| visible.group().clone());
        let kernels = Kernels { find_hits, beside, go_on: None, shade: None, samples: added.count, tilings };
        let pass = self.pass_record(added);
        self.film.set_samples(gpu, added);
        self.film.set_pass(gpu, &pass);
        self.film.submit_band(gpu, self.resident, &kernels, height, None)?;
        let mut work = Work::default();
        let tile = tilings.first.tile;
        self.film.read_hits(gpu, |hits| {
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
        Ok(work)
    }

    /// As without samples.
    fn restart_counts(&mut self) {
        self.samples_done = 0;
        self.nearness = Nearness::NONE;
    }

    fn sampling(&self, samples: u32) -> Sampling {
        let mut tilings = self.tilings.unwrap_or_else(|| Tilings::of(samples, self.scene.structure().len()));
        if self.culling.is_some() {
            tilings.first.tile = [confidence::GROUP_EDGE; 2];
        }
        Sampling { samples, perspective: self.view.perspective, tilings }
    }

    /// Makes the kernels that the picture needs, so that passes do not wait for them.
    pub fn prepare(&mut self, progress: &dyn Progress) -> Result<()> {
        let (mut done, mut noting) = (0, None);
        while let Some(added) = self.samples_after(done) {
            let mut walk = self.walk(&added)?;
            if walk == Walk::Noting {
                noting = Some(added.count);
            } else if noting == Some(added.count) {
                walk = Walk::Again;
            }
            self.kernels(added.count, walk, progress)?;
            done += added.count;
        }
        Ok(())
    }

    fn kernels(&mut self, samples: u32, walk: Walk, progress: &dyn Progress) -> Result<Kernels> {
        let sampling = self.sampling(samples);
        let light = match self.scene.lighting {
            Lighting::Studio(..) => "shade_studio",
            Lighting::Headlight | Lighting::Flat => "shade_open",
        };
        // Texts are long: those of a picture are not put together for every pass.
        let is_made = |(kernels, of, with, walked): &&(Kernels, Sampling, &str, Walk)| {
            kernels.samples == samples && *of == sampling && *with == light && *walked == walk
        };
        if let Some((kernels, ..)) = self.made.iter().find(is_made) {
            return Ok(kernels.clone());
        }
        let shape = self.resident.shape();
        let gpu = self.resident.gpu();
        let [first, second] = self.resident.walk_layouts();
        let mut go_on = None;
        if sampling.tilings.patience > 0 && shape.walked.has_tiles() && self.culling.is_none() {
            let text = shape.tiles(sampling, Walk::Second);
            go_on = Some(gpu.pipeline(text, "find_hits", second, progress)?);
        }
        let find_hits = match (&self.culling, &self.visible) {
            (Some(culling), _) => culling.pipeline(self.resident, sampling, progress)?,
            (None, Some(visible)) if walk != Walk::First => {
                gpu.pipeline(shape.tiles(sampling, walk), "find_hits", visible.layout(), progress)?
            }
            _ => gpu.pipeline(shape.hits(sampling), "find_hits", first, progress)?,
        };
        let kernels = Kernels {
            find_hits,
            beside: None,
            go_on,
            shade: Some(gpu.pipeline(shape.shade(sampling), light, self.resident.pass_layout(), progress)?),
            samples,
            tilings: sampling.tilings,
        };
        self.made.push((kernels.clone(), sampling, light, walk));
        Ok(kernels)
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
    fn bands(
        &mut self,
        kernels: &Kernels,
        mut pass: layout::Pass,
        most_rows: u32,
        progress: &dyn Progress,
    ) -> Result<()> {
        let Settings { width, height, .. } = self.settings;
        let gpu = self.resident.gpu();
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
            } else if let Some((before, since)) = self.submitted.replace((submitted, start)) {
                gpu.wait(before)?;
                // Two are on their way at one time.
                if since.elapsed() > 2 * BAND {
                    (self.rows, self.submitted) = ((rows / 2).next_multiple_of(BAND_ROWS), None);
                }
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
    renderer.complete(progress)?;
    renderer.image()
}
