//! The thesis' figures 6.1 to 6.4, of the stand-ins.

use std::path::Path;

use tyndall::Image;
use tyndall::render::confidence::{Neighborhood, Options, Population};
use tyndall::render::{Culling, Renderer, Settings};
use tyndall::scene::Scene;
use tyndall::scene::camera::Camera;
use tyndall::scene::colormap::Colormap;

use super::measure::{COMPARED, visited, window};
use super::plots::{Canvas, Line, lines, panels};
use super::sets::{EDGE, VIEWS};
use super::{Evaluated, measure::Measured};
use crate::args;
use crate::report::{Outcome, Report};

/// Pixels along an edge of a part of the picture that is shown, and where its upper left corner lies.
const PART: u32 = 256;
/// Over the lower rim, where the plume stands on the block.
const FOOT: [u32; 2] = [(EDGE - PART) / 2, EDGE - PART - 40];
/// Over the upper rim, where spikes stand in front of the shell.
const RIM: [u32; 2] = [(EDGE - PART) / 2, 56];

/// Draws the figures that the set has, into the folder of the report.
pub(super) fn draw(
    scene: &Scene,
    cameras: &[Camera; 4],
    args: &args::Bench,
    evaluated: &mut Evaluated,
    report: &Report,
) -> Outcome<()> {
    let artist = Artist { scene, frames: args.culling.picture_frames, folder: &args.culling.report, report };
    let options = args.culling.scaled(evaluated.set.options);
    let name = evaluated.set.name;
    match name {
        "ablation" => {
            artist.comparison(
                "figure-6.1",
                (&cameras[1], FOOT),
                &[("culled after convergence, 1x1", options)],
                evaluated,
            )?;
            artist.heat_maps("figure-6.4", [(&cameras[3], 3), (&cameras[0], 0)], options, evaluated)?;
        }
        "virion" => {
            let one = Options { neighborhood: Neighborhood::Kernel(1), ..options };
            let depth = Options { population: Population::UpToDepth, ..one };
            artist.comparison(
                "figure-6.2",
                (&cameras[0], RIM),
                &[("culled, 1x1", one), ("culled, 3x3", options), ("culled, 1x1, N up to the depth", depth)],
                evaluated,
            )?;
        }
        _ => {}
    }
    if !evaluated.variants.is_empty() {
        curves(&args.culling.report, evaluated)?;
    }
    Ok(())
}

struct Artist<'a> {
    scene: &'a Scene,
    frames: u32,
    folder: &'a Path,
    report: &'a Report,
}

impl Artist<'_> {
    /// A picture after convergence, and the depths at which its pixels' rays end.
    fn culled(&self, camera: &Camera, edge: u32, options: Options) -> Outcome<(Image, Vec<f32>)> {
        let samples = options.frame_samples * self.frames.max(COMPARED);
        let culling = Culling::Confidence(options);
        let settings = Settings { width: edge, height: edge, samples, seed: 0, culling };
        let mut renderer = Renderer::new(self.scene, camera, &settings)?;
        for _ in 0..self.frames {
            renderer.pass(self.report.progress())?;
        }
        let depths = renderer.confidence().map_or(Vec::new(), |known| known.depths);
        renderer.settle();
        for _ in 0..COMPARED / options.frame_samples {
            renderer.pass(self.report.progress())?;
        }
        Ok((renderer.image(), depths))
    }

    /// A part of the picture without culling, and with it by several knobs, side by side.
    fn comparison(
        &self,
        name: &str,
        (camera, corner): (&Camera, [u32; 2]),
        knobs: &[(&str, Options)],
        evaluated: &mut Evaluated,
    ) -> Outcome<()> {
        let camera = window(camera, corner, PART);
        let off = Settings { width: PART, height: PART, samples: COMPARED, seed: 0, culling: Culling::Off };
        let off = tyndall::render::render(self.scene, &camera, &off, self.report.progress())?;
        let mut pictures = vec![("without culling".to_string(), Canvas::of(&off, 1))];
        for &(title, options) in knobs {
            let (image, _) = self.culled(&camera, PART, options)?;
            pictures.push((title.to_string(), Canvas::of(&image, 1)));
        }
        let file = format!("{name}.png");
        panels(&self.folder.join(&file), &pictures)?;
        let titles: Vec<&str> = pictures.iter().map(|(title, _)| title.as_str()).collect();
        let caption = format!(
            "Thesis, {}: a part of {PART} x {PART} pixels, {COMPARED} samples a pixel: {}.",
            name.replace('-', " "),
            titles.join("; ")
        );
        evaluated.figures.push((file, caption));
        Ok(())
    }

    /// How many particles each pixel's ray has to test, for an axis-aligned view and another one.
    fn heat_maps(
        &self,
        name: &str,
        views: [(&Camera, usize); 2],
        options: Options,
        evaluated: &mut Evaluated,
    ) -> Outcome<()> {
        let colors = Colormap::named("turbo_r")?;
        // From a thousandth of a percent of all particles up to the logarithm of the most.
        let color = |tested: u64| {
            let place = (tested.max(1) as f32).log10() / 5.0;
            colors.at(place.min(1.0)).map(|value| (255.0 * value) as u8)
        };
        let mut pictures = Vec::new();
        for (camera, number) in views {
            let (_, depths) = self.culled(camera, EDGE, options)?;
            let view = camera.view(self.scene.structure().origin(), EDGE, EDGE)?;
            let visits = visited(self.scene.structure(), &view, EDGE, &depths);
            let kind = if VIEWS[number].1 { "axis-aligned" } else { "oblique" };
            for (at, when) in ["nc", "ac"].into_iter().enumerate() {
                let half = EDGE / 2;
                let cell = |place: usize| {
                    let (x, y) = (2 * (place as u32 % half), 2 * (place as u32 / half));
                    color(visits[(y * EDGE + x) as usize][at].particles)
                };
                let title = format!("view {} ({kind}), {when}", number + 1);
                pictures.push((title, Canvas::new(half, half, 1, cell)));
            }
        }
        let bar = |place: usize| color(10_f64.powf(5.0 * (1.0 - (place / 12) as f64 / 400.0)) as u64);
        pictures.push(("tested: 100,000 .. 1".into(), Canvas::new(12, EDGE / 2, 1, bar)));
        let file = format!("{name}.png");
        // The bar's title needs more room than the bar.
        let (title, bar) = pictures.pop().map_or((String::new(), None), |(title, bar)| (title, Some(bar)));
        if let Some(bar) = bar {
            let wide = |place: usize| {
                let (x, y) = (place % 170, place / 170);
                let at = (y * 12 + x.min(11)) * 3;
                if x < 12 { [bar.bytes[at], bar.bytes[at + 1], bar.bytes[at + 2]] } else { [255; 3] }
            };
            pictures.push((title, Canvas::new(170, EDGE / 2, 1, wide)));
        }
        panels(&self.folder.join(&file), &pictures)?;
        let caption = format!(
            "Thesis, {}: particles that the ray through each pixel's center tests; all others are in subtrees that it skips \
             (red: nearly all skipped). nc: without culling, ac: after convergence.",
            name.replace('-', " ")
        );
        evaluated.figures.push((file, caption));
        Ok(())
    }
}

/// Figure 6.3: frames a second over the frames of a view, by knobs.
fn curves(folder: &Path, evaluated: &mut Evaluated) -> Outcome<()> {
    const COLORS: [[u8; 3]; 4] = [[230, 120, 20], [150, 70, 0], [40, 160, 60], [0, 90, 30]];
    let shown: Vec<&(String, Measured)> = evaluated.variants.iter().take(COLORS.len()).collect();
    let longest = shown.iter().map(|(_, measured)| measured.frame_secs.len()).max().unwrap_or(0) + 8;
    let off = 1.0 / shown[0].1.off_secs;
    let mut all = vec![Line {
        name: "without culling".into(),
        color: [40, 90, 200],
        points: vec![(0.0, off), (longest as f64, off)],
    }];
    for ((name, measured), color) in shown.into_iter().zip(COLORS) {
        let secs = |frame: usize| measured.frame_secs.get(frame).copied().unwrap_or(measured.after_secs);
        let points = (0..longest).map(|frame| (frame as f64, 1.0 / secs(frame))).collect();
        all.push(Line { name: name.clone(), color, points });
    }
    let file = format!("figure-6.3-{}.png", evaluated.set.name);
    let title = format!("{}: accumulation performance", evaluated.set.name);
    lines(&folder.join(&file), &title, ["frame", "frames/s"], &all)?;
    let caption =
        "Thesis, figure 6.3: frames a second over the frames, by kernel and interpolation.".to_string();
    evaluated.figures.push((file, caption));
    Ok(())
}
