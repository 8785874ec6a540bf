//! One view without and with culling: times, visited nodes, and how the pictures differ.

use std::time::Instant;

use rayon::prelude::*;
use tyndall::Image;
use tyndall::math::Ray;
use tyndall::render::certified;
use tyndall::render::confidence::Options;
use tyndall::render::{Culling, Renderer, Settings};
use tyndall::scene::Scene;
use tyndall::scene::camera::{Camera, Projection, View};
use tyndall::structure::{Structure, Visits};

use super::quality::{Quality, quality};
use super::sets::EDGE;
use crate::report::{Outcome, Report};

/// Windows of the picture across and down.
const ACROSS: u32 = 3;
/// Samples a pixel of pictures that are compared.
pub(super) const COMPARED: u32 = 16;

/// Parts of a picture, evenly spread, each seen by a camera of its own through pixels of the same size.
pub(super) struct Windows {
    pub(super) cameras: Vec<Camera>,
    pub(super) edge: u32,
    /// Which share of the picture they are.
    share: f64,
}

impl Windows {
    /// Windows of `edge` pixels an edge of what `camera` sees.
    pub(super) fn of(camera: &Camera, edge: u32) -> Self {
        let corner = |number: u32| ((2 * number + 1) * EDGE / (2 * ACROSS) - edge / 2) / 8 * 8;
        let cameras = (0..ACROSS * ACROSS)
            .map(|at| window(camera, [corner(at % ACROSS), corner(at / ACROSS)], edge))
            .collect();
        let share = f64::from(ACROSS * ACROSS * edge * edge) / f64::from(EDGE * EDGE);
        Self { cameras, edge, share }
    }

    fn settings(&self, samples: u32, culling: Culling) -> Settings {
        Settings { width: self.edge, height: self.edge, samples, seed: 0, culling }
    }
}

/// The camera of the window whose upper left corner is pixel `corner` of the whole picture.
pub(super) fn window(camera: &Camera, corner: [u32; 2], edge: u32) -> Camera {
    let Projection::Orthographic { height } = camera.projection else { return *camera };
    let pixel = height / f64::from(EDGE);
    let forward = (camera.look_at - camera.eye).normalize();
    let right = forward.cross(camera.up).normalize();
    let up = right.cross(forward);
    let middle = |corner: u32| f64::from(corner) + 0.5 * f64::from(edge) - 0.5 * f64::from(EDGE);
    let shift = pixel * (right * middle(corner[0]) - up * middle(corner[1]));
    let projection = Projection::Orthographic { height: pixel * f64::from(edge) };
    Camera { eye: camera.eye + shift, look_at: camera.look_at + shift, projection, ..*camera }
}

/// A view without culling, and with the certified kind, which shows the same.
pub(super) struct Off {
    /// Of a frame of the whole picture.
    secs: f64,
    certified_secs: f64,
    images: Vec<Image>,
}

/// A view with culling, beside the same without.
pub(super) struct Measured {
    /// Seconds of a frame of the whole picture without culling.
    pub(super) off_secs: f64,
    /// The same with certified culling.
    pub(super) certified_secs: f64,
    /// The same with culling by confidence, by frame until all have converged.
    pub(super) frame_secs: Vec<f64>,
    /// The same after that.
    pub(super) after_secs: f64,
    /// Share of pixels that had converged at the end, and of those whose rays are cut.
    pub(super) converged: f64,
    pub(super) cut: f64,
    /// Nodes opened and particles tested by a ray on average: without culling, with it, and if each ray knew where it ends.
    pub(super) visits: [Visited; 3],
    /// The pictures after convergence beside those without culling.
    pub(super) quality: Quality,
    pub(super) grid_secs: f64,
    pub(super) grid_bytes: u64,
    /// Memory of what the pixels of the whole picture know.
    pub(super) pixel_bytes: u64,
}

impl Measured {
    /// Seconds of a frame before convergence, on average.
    pub(super) fn before_secs(&self) -> f64 {
        self.frame_secs.iter().sum::<f64>() / self.frame_secs.len().max(1) as f64
    }
}

/// A ray's visits, on average.
#[derive(Clone, Copy, Default)]
pub(super) struct Visited {
    pub(super) nodes: f64,
    pub(super) particles: f64,
}

/// Renders the windows without culling, and with the certified kind.
pub(super) fn off(scene: &Scene, windows: &Windows, report: &Report) -> Outcome<Off> {
    let certified = Culling::Certified(certified::Options { clip: true, ..certified::Options::default() });
    let (certified_secs, _) = pictures(scene, windows, certified, report)?;
    let (secs, images) = pictures(scene, windows, Culling::Off, report)?;
    Ok(Off { secs, certified_secs, images })
}

/// The windows, and the seconds of a frame of the whole picture.
fn pictures(
    scene: &Scene,
    windows: &Windows,
    culling: Culling,
    report: &Report,
) -> Outcome<(f64, Vec<Image>)> {
    let (mut secs, mut images) = (0.0, Vec::new());
    for camera in &windows.cameras {
        let settings = windows.settings(COMPARED, culling);
        let mut renderer = Renderer::new(scene, camera, &settings)?;
        let mut fastest = f64::INFINITY;
        // The first run has to get its memory.
        for _ in 0..2 {
            renderer.restart(camera)?;
            let start = Instant::now();
            renderer.pass(report.progress())?;
            fastest = fastest.min(start.elapsed().as_secs_f64());
        }
        secs += fastest * 4.0 / f64::from(COMPARED) / windows.share;
        images.push(renderer.image());
    }
    Ok((secs, images))
}

/// A renderer of windows that culls, for one view after the other: its density grid is that of the scene.
pub(super) struct Culler<'a> {
    scene: &'a Scene,
    renderer: Renderer<'a>,
    options: Options,
    frames: u32,
    grid_secs: f64,
}

impl<'a> Culler<'a> {
    /// For windows like these, which are taken to have converged after `frames` frames.
    pub(super) fn new(scene: &'a Scene, windows: &Windows, options: Options, frames: u32) -> Outcome<Self> {
        let samples = options.frame_samples * frames.max(COMPARED);
        let settings = windows.settings(samples, Culling::Confidence(options));
        let start = Instant::now();
        let renderer = Renderer::new(scene, &windows.cameras[0], &settings)?;
        Ok(Self { scene, renderer, options, frames, grid_secs: start.elapsed().as_secs_f64() })
    }

    /// Renders the windows until they have converged, and then again, beside what was rendered without culling.
    pub(super) fn measure(&mut self, windows: &Windows, off: &Off, report: &Report) -> Outcome<Measured> {
        let count = windows.cameras.len();
        let mut seen = Vec::with_capacity(count);
        for camera in &windows.cameras {
            seen.push(self.window(camera, windows.edge, report)?);
        }
        let longest = seen.iter().map(|window| window.frame_secs.len()).max().unwrap_or(0);
        let frame = |number: usize| {
            let secs = seen.iter().map(|it| it.frame_secs.get(number).copied().unwrap_or(it.after_secs));
            secs.sum::<f64>() / windows.share
        };
        let pixels = count as f64 * f64::from(windows.edge * windows.edge);
        let visits = [0, 1, 2].map(|kind| Visited {
            nodes: seen.iter().map(|window| window.visits[kind].nodes as f64).sum::<f64>() / pixels,
            particles: seen.iter().map(|window| window.visits[kind].particles as f64).sum::<f64>() / pixels,
        });
        let known = self.renderer.confidence();
        let whole = f64::from(EDGE * EDGE) / f64::from(windows.edge * windows.edge);
        Ok(Measured {
            off_secs: off.secs,
            certified_secs: off.certified_secs,
            frame_secs: (0..longest).map(frame).collect(),
            after_secs: seen.iter().map(|window| window.after_secs).sum::<f64>() / windows.share,
            converged: seen.iter().map(|window| window.converged).sum::<f64>() / count as f64,
            cut: seen.iter().map(|window| window.cut as f64).sum::<f64>() / pixels,
            visits,
            grid_secs: self.grid_secs,
            grid_bytes: known.as_ref().map_or(0, |known| known.grid_bytes),
            pixel_bytes: known.map_or(0, |known| (known.pixel_bytes as f64 * whole) as u64),
            quality: quality(&off.images, &seen.into_iter().map(|window| window.image).collect::<Vec<_>>()),
        })
    }

    /// One window.
    fn window(&mut self, camera: &Camera, edge: u32, report: &Report) -> Outcome<Seen> {
        let renderer = &mut self.renderer;
        renderer.restart(camera)?;
        let mut frame_secs = Vec::new();
        let (mut depths, mut converged) = (Vec::new(), 0.0);
        while frame_secs.len() < self.frames as usize && converged < 1.0 {
            let start = Instant::now();
            renderer.pass(report.progress())?;
            frame_secs.push(start.elapsed().as_secs_f64());
            if let Some(known) = renderer.confidence() {
                (depths, converged) = (known.depths, known.converged);
            }
        }
        renderer.settle();
        let start = Instant::now();
        let frames = COMPARED / self.options.frame_samples;
        for _ in 0..frames {
            renderer.pass(report.progress())?;
        }
        let after_secs = start.elapsed().as_secs_f64() / f64::from(frames);
        let view = camera.view(self.scene.structure().origin(), edge, edge)?;
        let mut visits = [Visits::default(); 3];
        for visited in visited(self.scene.structure(), &view, edge, &depths) {
            for (sum, one) in visits.iter_mut().zip(visited) {
                sum.nodes += one.nodes;
                sum.particles += one.particles;
            }
        }
        let cut = depths.iter().filter(|depth| depth.is_finite()).count();
        Ok(Seen { frame_secs, after_secs, converged, cut, visits, image: renderer.image() })
    }
}

/// A window with culling.
struct Seen {
    frame_secs: Vec<f64>,
    after_secs: f64,
    converged: f64,
    cut: usize,
    visits: [Visits; 3],
    image: Image,
}

/// What the ray through each pixel's center visits: without culling, with the pixels' `depths`, and if it knew beforehand at which
/// distance it meets something. A ray that meets nothing has no such distance.
pub(super) fn visited(structure: &Structure, view: &View, edge: u32, depths: &[f32]) -> Vec<[Visits; 3]> {
    let of = |ray: &Ray| {
        let mut visits = Visits::default();
        let hit = structure.intersect_counted(ray, &mut visits);
        (visits, hit)
    };
    let pixel = |at: usize| {
        let (x, y) = (at as u32 % edge, at as u32 / edge);
        let ray = view.ray(x as f32 + 0.5, y as f32 + 0.5);
        let (off, hit) = of(&ray);
        let (cut, _) = of(&Ray { t_max: depths[at].next_up(), ..ray });
        let known = hit.map_or(off, |hit| of(&Ray { t_max: hit.t.next_up(), ..ray }).0);
        [off, cut, known]
    };
    (0..(edge * edge) as usize).into_par_iter().with_min_len(256).map(pixel).collect()
}
