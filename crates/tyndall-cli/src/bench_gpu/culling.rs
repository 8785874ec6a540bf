//! Frames with each way to leave out what is hidden. With 1 and 4 samples a frame is a pass; with 64 it is four, of which with certified
//! culling the later ones begin with what the first has noted. Culling by confidence is measured while it learns, over the frames after which
//! pixels can be final for the first time, and with the depths that it has learned then.

use std::time::Instant;

use tyndall::Result;
use tyndall::render::gpu::{Renderer, Resident};
use tyndall::render::{Culling, Settings, confidence};
use tyndall::scene::Scene;
use tyndall::scene::camera::Camera;

use super::{Bench, FRAMES, MEASURED};
use crate::bench::table::Cell;
use crate::report::Outcome;

/// Of a frame.
pub(super) const SAMPLES: [u32; 3] = [1, 4, 64];
pub(super) const HEADINGS: [&str; 12] = [
    "set",
    "particles",
    "camera",
    "samples",
    "off frames/s",
    "certified frames/s",
    "confidence learning frames/s",
    "confidence learned frames/s",
    "pixels cut %",
    "density grid s",
    "steps of a first pass",
    "of a later one",
];

impl Bench<'_> {
    /// A row: frames a second of one camera with every way of culling.
    pub(super) fn culled(
        &self,
        set: &str,
        camera_name: &str,
        resident: &Resident,
        scene: &Scene,
        camera: &Camera,
        samples: u32,
    ) -> Outcome<[Cell; HEADINGS.len()]> {
        let rate =
            |culling| self.rate(resident, scene, camera, Settings { culling, ..self.settings(samples) });
        let [off, certified] = [Culling::Off, Culling::default()].map(rate);
        let confidence = match samples {
            1 | 4 => match self.confidence(resident, scene, camera, samples) {
                // Kernels of this card may see too few buffers.
                Err(tyndall::Error::Device(why)) => {
                    self.report.note(format_args!("note: {why}"));
                    None
                }
                measured => Some(measured?),
            },
            _ => None,
        };
        let number =
            |number: Option<f64>, decimals| number.map_or(Cell::Unknown, |it| Cell::Number(it, decimals));
        let settings = Settings { culling: Culling::default(), ..self.settings(samples) };
        let mut renderer = Renderer::new(resident, scene, camera, &settings)?;
        let progress = self.report.progress();
        let again = renderer.count_work_again(progress)?;
        let first = match again {
            Some(_) => renderer.count_work(progress)?,
            None => None,
        };
        Ok([
            Cell::Word(set.into()),
            Cell::Count(scene.structure().len()),
            Cell::Word(camera_name.into()),
            Cell::Count(samples as usize),
            Cell::Number(off?, 1),
            Cell::Number(certified?, 1),
            number(confidence.as_ref().map(|of| of.learning), 1),
            number(confidence.as_ref().map(|of| of.learned), 1),
            number(confidence.as_ref().map(|of| 100.0 * of.cut), 1),
            number(confidence.as_ref().map(|of| of.grid_secs), 2),
            first.map_or(Cell::Unknown, |work| Cell::Count(work.steps as usize)),
            again.map_or(Cell::Unknown, |work| Cell::Count(work.steps as usize)),
        ])
    }

    /// Whole frames in a second.
    fn rate(&self, resident: &Resident, scene: &Scene, camera: &Camera, settings: Settings) -> Result<f64> {
        let mut renderer = Renderer::new(resident, scene, camera, &settings)?;
        renderer.prepare(self.report.progress())?;
        let frame = |renderer: &mut Renderer| {
            renderer.restart(camera)?;
            while !renderer.is_done() {
                renderer.pass(self.report.progress())?;
            }
            Ok(())
        };
        // Bands grow to what the card can do.
        for _ in 0..3 {
            frame(&mut renderer)?;
        }
        measured(&mut renderer, FRAMES[1], frame)
    }

    /// Frames of a picture that goes on, before and after its depths are final.
    fn confidence(
        &self,
        resident: &Resident,
        scene: &Scene,
        camera: &Camera,
        frame_samples: u32,
    ) -> Result<Confidence> {
        let options = confidence::Options { frame_samples, ..confidence::Options::default() };
        let settings = Settings { culling: Culling::Confidence(options), ..self.settings(1 << 24) };
        // Counted once for all cameras and numbers of samples.
        let start = Instant::now();
        let mut renderer = Renderer::new(resident, scene, camera, &settings)?;
        let grid_secs = start.elapsed().as_secs_f64();
        let progress = self.report.progress();
        renderer.pass(progress)?;
        renderer.finish()?;
        renderer.restart(camera)?;
        let most = options.convergence_samples.div_ceil(frame_samples);
        let learning = measured(&mut renderer, most, |renderer| renderer.pass(progress))?;
        let depths = renderer.confidence()?.map(|report| report.depths).unwrap_or_default();
        let cut = depths.iter().filter(|depth| depth.is_finite()).count() as f64 / depths.len().max(1) as f64;
        let learned = measured(&mut renderer, FRAMES[1], |renderer| {
            renderer.settle();
            renderer.pass(progress)
        })?;
        Ok(Confidence { learning, learned, cut, grid_secs })
    }
}

/// What was measured of culling by confidence.
struct Confidence {
    learning: f64,
    learned: f64,
    /// The share of pixels whose rays end somewhere.
    cut: f64,
    grid_secs: f64,
}

/// How many of at most so many frames are made in a second.
fn measured(
    renderer: &mut Renderer,
    most: u32,
    mut frame: impl FnMut(&mut Renderer) -> Result<()>,
) -> Result<f64> {
    renderer.finish()?;
    let start = Instant::now();
    let mut count = 0;
    while count < FRAMES[0] || (count < most && start.elapsed() < MEASURED) {
        frame(renderer)?;
        count += 1;
    }
    renderer.finish()?;
    Ok(f64::from(count) / start.elapsed().as_secs_f64())
}
