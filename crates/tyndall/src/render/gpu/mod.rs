//! The graphics card: the tile sample buffer, light and single rays as compute shaders, over a copy of the scene in the card's memory.
//!
//! [`Gpu`] is an opened device, [`Resident`] a scene on it, [`Renderer`] one picture of it; `films` keeps the pictures of a scene that
//! changes. Work is submitted in bands of tile rows that take a bounded time each; nothing waits but for the band before the last, and
//! for what is read back. The kernels do not check their input: the builder of the hierarchy has written it.

mod build;
mod confidence;
mod device;
mod film;
mod films;
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
pub use build::Hierarchy;
#[cfg(test)]
pub(crate) use build::order_of;
use confidence::Confidence;
pub use device::{AdapterInfo, Gpu, Kind, Options, adapters};
use film::Film;
pub(super) use films::Films;
pub use resident::Resident;
pub use shader::{HeapWalk, Tiling, Tilings};
use shader::{Sampling, Walk};
use visible::VisibleSet;

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
    under_way: Option<UnderWay>,
    culling: Option<Confidence>,
    /// With certified culling, where several passes are alike.
    visible: Option<VisibleSet>,
    nearness: Nearness,
    /// Kernels that were made, for which sampling, light and walk.
    made: Vec<(Kernels, Sampling, &'static str, Walk)>,
    /// Rows that the next band takes.
    rows: u32,
    /// The last pass that was submitted as a whole, and when.
    submitted: Option<(wgpu::SubmissionIndex, Instant)>,
}

/// A pass that is under way.
struct UnderWay {
    /// What its bands have in common, with the row that comes next.
    record: layout::Pass,
    kernels: Kernels,
    walk: Walk,
    /// Rows that a band can have at most.
    most_rows: u32,
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
            culling: None,
            visible: None,
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

    /// Forgets what was learned of the view, too.
    fn restart(&mut self) {
        self.clear();
        if let Some(culling) = &mut self.culling {
            culling.restart();
        }
        if let Some(visible) = &mut self.visible {
            visible.restart();
        }
    }

    /// Submits samples of every pixel, those that come after the ones it has. Fails when interrupted; begun again, it goes on with the rows
    /// that are left.
    fn pass(&mut self, seen: &Seen, added: &Samples, walk: Walk, progress: &dyn Progress) -> Result<()> {
        let gpu = seen.resident.gpu();
        if self.under_way.is_none() {
            let mut kernels = self.kernels(seen, added.count, walk, progress)?;
            self.film.set_samples(gpu, added);
            let mut most_rows = self.film.band_rows(gpu, added.count)?;
            if let Some(culling) = &mut self.culling {
                most_rows = most_rows.min(culling.band_rows(gpu, BAND_ROWS)?);
                kernels.beside = Some(culling.begin(gpu, added, most_rows)?);
            }
            if let Some(visible) = self.visible.as_ref().filter(|_| walk != Walk::First) {
                kernels.beside = Some(visible.group().clone());
            }
            let record = self.record(seen, added);
            self.under_way = Some(UnderWay { record, kernels, walk, most_rows });
        }
        self.bands(seen, progress)?;
        self.samples += added.count;
        let walk = self.under_way.take().map_or(walk, |it| it.walk);
        if let Some(visible) = self.visible.as_mut().filter(|_| walk != Walk::First) {
            visible.used();
        }
        if let Some(culling) = &mut self.culling {
            culling.decide(gpu, progress)?;
        }
        Ok(())
    }

    /// With what the tiles of a pass begin that certified culling helps: the first pass notes the visible set for those that are alike.
    /// `next` are the samples of the pass after it.
    fn walk(&mut self, seen: &Seen, added: &Samples, next: Option<&Samples>) -> Result<Walk> {
        let own = self.sampling(seen, added.count).tilings.first;
        let serves = next.is_some_and(|next| self.sampling(seen, next.count).tilings.first == own);
        if added.first == 0 && serves && self.visible.is_none() {
            self.visible = VisibleSet::new(seen.resident, &self.film, self.size, own)?;
        }
        let visible = self.visible.as_ref().filter(|visible| visible.is_of(own));
        Ok(match visible {
            Some(visible) if visible.is_noted() => Walk::Again,
            Some(_) if added.first == 0 && serves => Walk::Noting,
            _ => Walk::First,
        })
    }

    /// Waits, and draws the samples so far over `image`, which has its size; pixels without samples stay as they are.
    fn draw_over(&self, gpu: &Gpu, scene: &Scene, image: &mut Image) -> Result<()> {
        let (row, added) =
            self.under_way.as_ref().map_or((0, 0), |it| (it.record.first_row, it.kernels.samples));
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
        let mut tilings = self.tilings.unwrap_or_else(|| Tilings::of(samples, seen.scene.structure().len()));
        if self.culling.is_some() {
            tilings.first.tile = [confidence::GROUP_EDGE; 2];
        }
        Sampling { samples, perspective: seen.view.perspective, tilings }
    }

    fn kernels(&mut self, seen: &Seen, samples: u32, walk: Walk, progress: &dyn Progress) -> Result<Kernels> {
        let sampling = self.sampling(seen, samples);
        let light = match &seen.scene.lighting {
            Lighting::Studio(..) => "shade_studio",
            Lighting::Headlight | Lighting::Flat => "shade_open",
            Lighting::Paths(_) => {
                let allowed = "default, headlight or flat on the GPU; --device cpu follows paths of light";
                return Err(Error::setting("--look", "traced by paths", allowed));
            }
            Lighting::Toon { .. } => {
                let allowed = "default, headlight or flat on the GPU; --device cpu has light in levels";
                return Err(Error::setting("--look", "toon", allowed));
            }
        };
        // Texts are long: those of a picture are not put together for every pass.
        let is_made = |(kernels, of, with, walked): &&(Kernels, Sampling, &str, Walk)| {
            kernels.samples == samples && *of == sampling && *with == light && *walked == walk
        };
        if let Some((kernels, ..)) = self.made.iter().find(is_made) {
            return Ok(kernels.clone());
        }
        let resident = seen.resident;
        let (shape, gpu) = (resident.shape(), resident.gpu());
        let [first, second] = resident.walk_layouts();
        let mut go_on = None;
        if sampling.tilings.patience > 0 && shape.walked.has_tiles() && self.culling.is_none() {
            let text = shape.tiles(sampling, Walk::Second);
            go_on = Some(gpu.pipeline(text, "find_hits", second, progress)?);
        }
        let find_hits = match (&self.culling, &self.visible) {
            (Some(culling), _) => culling.pipeline(resident, sampling, progress)?,
            (None, Some(visible)) if walk != Walk::First => {
                gpu.pipeline(shape.tiles(sampling, walk), "find_hits", visible.layout(), progress)?
            }
            _ => gpu.pipeline(shape.hits(sampling), "find_hits", first, progress)?,
        };
        let kernels = Kernels {
            find_hits,
            beside: None,
            go_on,
            shade: Some(gpu.pipeline(shape.shade(sampling), light, resident.pass_layout(), progress)?),
            samples,
            tilings: sampling.tilings,
        };
        self.made.push((kernels.clone(), sampling, light, walk));
        Ok(kernels)
    }

    /// What all bands of a pass have in common.
    fn record(&mut self, seen: &Seen, added: &Samples) -> layout::Pass {
        let mut lights = [[0.0; 4]; 32];
        let mut lighting = layout::FLAT;
        match &seen.scene.lighting {
            Lighting::Headlight => lighting = layout::HEADLIGHT,
            Lighting::Flat | Lighting::Paths(_) | Lighting::Toon { .. } => {}
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
    fn bands(&mut self, seen: &Seen, progress: &dyn Progress) -> Result<()> {
        let [width, height] = self.size;
        let gpu = seen.resident.gpu();
        let (band, always_waits) = match self.pace {
            Pace::Steady => (BAND, false),
            Pace::Prompt => (PROMPT_BAND, true),
        };
        let lower = |rows: u32| (rows / 2).next_multiple_of(BAND_ROWS).max(BAND_ROWS);
        while let Some(UnderWay { record, kernels, most_rows, .. }) =
            self.under_way.as_mut().filter(|it| it.record.first_row < height)
        {
            if progress.cancelled() {
                return Err(Error::Interrupted);
            }
            let rows = self.rows.min(*most_rows).min(height - record.first_row);
            self.film.set_pass(gpu, record);
            let start = Instant::now();
            let submitted = self.film.submit_band(gpu, seen.resident, kernels, rows, None)?;
            record.first_row += rows;
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

/// Fails with [`Error::Device`] if the picture lies in no plane.
fn check_flat(view: &View) -> Result<()> {
    let text = "cards draw no panoramas — --device cpu does";
    if view.panorama { Err(Error::Device(text.into())) } else { Ok(()) }
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
        settings.check(scene)?;
        scene.check_same("on the GPU")?;
        let Settings { width, height, .. } = *settings;
        let view = camera.view(scene.structure().origin(), width, height)?;
        check_flat(&view)?;
        let mut picture = Picture::new(resident, [width, height], Pace::Steady)?;
        if let Culling::Confidence(options) = settings.culling {
            if !resident.shape().walked.has_tiles() {
                let allowed = "bvh with --culling confidence on the GPU; the others are for --device cpu";
                return Err(Error::setting("--structure", "another", allowed));
            }
            let grid = resident.grid(scene.structure(), options.voxel_count, &())?;
            picture.culling = Some(Confidence::new(resident, grid, [width, height], options)?);
        }
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
        let view = camera.view(self.seen.scene.structure().origin(), width, height)?;
        check_flat(&view)?;
        self.seen.view = view;
        self.picture.restart();
        Ok(())
    }

    /// Waits, and tells what certified culling saved since the picture was begun: leaves that passes knew of before they began. The card seeks
    /// no other proofs.
    pub fn counts(&self) -> Result<Counts> {
        let remembered_leaves = match &self.picture.visible {
            Some(visible) => visible.remembered_leaves(self.seen.resident.gpu())?,
            None => 0,
        };
        Ok(Counts { remembered_leaves, ..Counts::default() })
    }

    /// Takes what culling by confidence has learned of this view for final, and starts the picture anew.
    pub fn settle(&mut self) {
        self.picture.clear();
        if let Some(culling) = &mut self.picture.culling {
            culling.settle();
        }
    }

    /// Waits, and tells how far culling by confidence is; none with any other.
    pub fn confidence(&self) -> Result<Option<Report>> {
        let gpu = self.seen.resident.gpu();
        self.picture.culling.as_ref().map(|culling| culling.report(gpu)).transpose()
    }

    /// Submits up to sixteen samples of every pixel, with culling by confidence those of a frame. Fails when interrupted, and with what went
    /// wrong on the card before; after an interruption the next pass goes on with the rows that are left.
    pub fn pass(&mut self, progress: &dyn Progress) -> Result<()> {
        let Some(added) = self.samples_after(self.picture.samples) else {
            return Ok(());
        };
        let walk = self.walk(&added)?;
        self.picture.pass(&self.seen, &added, walk, progress)
    }

    /// With what the tiles of a pass begin.
    fn walk(&mut self, added: &Samples) -> Result<Walk> {
        let has_tiles = self.seen.resident.shape().walked.has_tiles();
        if !self.settings.culling.certified().visible_set || !has_tiles {
            return Ok(Walk::First);
        }
        let next = self.samples_after(added.first + added.count);
        self.picture.walk(&self.seen, added, next.as_ref())
    }

    /// The samples that come after the first `done`, if any are missing.
    fn samples_after(&self, done: u32) -> Option<Samples> {
        let Settings { samples, seed, .. } = self.settings;
        let at_once = self.picture.culling.as_ref().map_or(u32::MAX, Confidence::frame_samples);
        Samples::after(done, samples, seed).map(|added| added.at_most(at_once))
    }

    /// Submits all samples that are missing. Fails as [`Renderer::pass`] does.
    pub fn complete(&mut self, progress: &dyn Progress) -> Result<()> {
        self.prepare(progress)?;
        let Settings { width, height, samples, .. } = self.settings;
        let samples = u64::from(samples - self.picture.samples);
        progress.begin("render", Some(u64::from(width) * u64::from(height) * samples), "samples");
        while !self.is_done() {
            self.pass(progress)?;
        }
        Ok(())
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
    /// meet, and to light it. None if it has no clock, if one piece is too much for it, or with culling by confidence, which learns from all
    /// passes.
    pub fn time_pass(&mut self, progress: &dyn Progress) -> Result<Option<[f64; 2]>> {
        let Settings { samples, seed, height, .. } = self.settings;
        let gpu = self.seen.resident.gpu();
        let (Some(added), Some(timer)) = (Samples::after(0, samples, seed), film::Timer::new(gpu)?) else {
            return Ok(None);
        };
        if self.picture.culling.is_some() || self.picture.film.band_rows(gpu, added.count)? < height {
            return Ok(None);
        }
        let kernels = self.picture.kernels(&self.seen, added.count, Walk::First, progress)?;
        self.picture.one_band(&self.seen, &added, &kernels, Some(&timer))?;
        self.picture.samples = added.count;
        timer.secs(gpu).map(Some)
    }

    /// What the walk of the first pass does: counts of all tiles if none is laid aside. None if one band is too little for it, or if the
    /// structure is walked by single rays.
    pub fn count_work(&mut self, progress: &dyn Progress) -> Result<Option<Work>> {
        let Some(added) = self.counted_samples(0)? else { return Ok(None) };
        self.count(&added, Walk::Counted, progress).map(Some)
    }

    /// The same of a second pass, which begins with what the first has noted. None too if that is not noted.
    pub fn count_work_again(&mut self, progress: &dyn Progress) -> Result<Option<Work>> {
        if self.counted_samples(0)?.is_none() || !self.settings.culling.certified().visible_set {
            return Ok(None);
        }
        self.picture.restart();
        self.pass(progress)?;
        let Some(added) = self.counted_samples(self.picture.samples)? else { return Ok(None) };
        if self.walk(&added)? != Walk::Again {
            return Ok(None);
        }
        self.count(&added, Walk::CountedAgain, progress).map(Some)
    }

    /// The samples after the first `done`, if a band can have all of theirs.
    fn counted_samples(&self, done: u32) -> Result<Option<Samples>> {
        let Seen { resident, .. } = self.seen;
        let Some(added) = self.samples_after(done).filter(|_| resident.shape().walked.has_tiles()) else {
            return Ok(None);
        };
        let rows = self.picture.film.band_rows(resident.gpu(), added.count)?;
        Ok((rows >= self.settings.height).then_some(added))
    }

    /// Counts what a walk does for these samples; they are not kept.
    fn count(&mut self, added: &Samples, walk: Walk, progress: &dyn Progress) -> Result<Work> {
        let Settings { width, height, .. } = self.settings;
        let Seen { resident, .. } = self.seen;
        let gpu = resident.gpu();
        let sampling = self.picture.sampling(&self.seen, added.count);
        let text = resident.shape().tiles(sampling, walk);
        let visible = self.picture.visible.as_ref().filter(|_| walk == Walk::CountedAgain);
        let layout = visible.map_or(&resident.walk_layouts()[0], VisibleSet::layout);
        let find_hits = gpu.pipeline(text, "find_hits", layout, progress)?;
        let tilings = sampling.tilings;
        let beside = visible.map(|visible| visible.group().clone());
        let kernels = Kernels { find_hits, beside, go_on: None, shade: None, samples: added.count, tilings };
        self.picture.one_band(&self.seen, added, &kernels, None)?;
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
        Ok(work)
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
            self.picture.kernels(&self.seen, added.count, walk, progress)?;
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
    renderer.complete(progress)?;
    renderer.image()
}
