//! One view without and with culling: times, visited nodes, and how the pictures differ.

use std::time::Instant;

use rayon::prelude::*;
use tyndall::Image;
use tyndall::math::Ray;
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

/// A view without culling.
pub(super) struct Off {
    /// Of a frame of the whole picture.
    secs: f64,
    images: Vec<Image>,
}

/// A view with culling, beside the same without.
pub(super) struct Measured {
    /// Seconds of a frame of the whole picture without culling.
    pub(super) off_secs: f64,
    /// The same by frame until all have converged.
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

/// Renders the windows without culling.
pub(super) fn off(scene: &Scene, windows: &Windows, report: &Report) -> Outcome<Off> {
    let mut off = Off { secs: 0.0, images: Vec::new() };
    for camera in &windows.cameras {
        let settings = windows.settings(COMPARED, Culling::Off);
        let mut renderer = Renderer::new(scene, camera, &settings)?;
        let mut fastest = f64::INFINITY;
        // The first run has to get its memory.
        for _ in 0..2 {
            renderer.restart(camera)?;
            let start = Instant::now();
            renderer.pass(report.progress())?;
            fastest = fastest.min(start.elapsed().as_secs_f64());
        }
        off.secs += fastest * 4.0 / f64::from(COMPARED) / windows.share;
        off.images.push(renderer.image());
    }
    Ok(off)
}

/// Renders the windows with culling until they have converged, at most `frames` frames, and then again.
pub(super) fn culled(
    scene: &Scene,
    windows: &Windows,
    options: Options,
    frames: u32,
    off: &Off,
    report: &Report,
) -> Outcome<Measured> {
    let samples = options.frame_samples * frames.max(COMPARED);
    let settings = windows.settings(samples, Culling::Confidence(options));
    let start = Instant::now();
    let mut renderer = Renderer::new(scene, &windows.cameras[0], &settings)?;
    let grid_secs = start.elapsed().as_secs_f64();
    // By window the seconds of its frames, and of one when it has converged.
    let mut times: Vec<(Vec<f64>, f64)> = Vec::new();
    let (mut images, mut converged, mut cut, mut visits) = (Vec::new(), 0.0, 0, [Visits::default(); 3]);
    for camera in &windows.cameras {
        renderer.restart(camera)?;
        let mut secs = Vec::new();
        while secs.len() < frames as usize && renderer.confidence().is_some_and(|it| it.converged < 1.0) {
            let start = Instant::now();
            renderer.pass(report.progress())?;
            secs.push(start.elapsed().as_secs_f64());
        }
        let Some(known) = renderer.confidence() else { continue };
        converged += known.converged / windows.cameras.len() as f64;
        cut += known.depths.iter().filter(|depth| depth.is_finite()).count();
        renderer.settle();
        let start = Instant::now();
        for _ in 0..COMPARED / options.frame_samples {
            renderer.pass(report.progress())?;
        }
        let frames = f64::from(COMPARED / options.frame_samples);
        times.push((secs, start.elapsed().as_secs_f64() / frames));
        images.push(renderer.image());
        let view = camera.view(scene.structure().origin(), windows.edge, windows.edge)?;
        for visited in visited(scene.structure(), &view, windows.edge, &known.depths) {
            for (sum, one) in visits.iter_mut().zip(visited) {
                sum.nodes += one.nodes;
                sum.particles += one.particles;
            }
        }
    }
    let known = renderer.confidence();
    let longest = times.iter().map(|(secs, _)| secs.len()).max().unwrap_or(0);
    let frame = |number: usize| {
        let of_window = |(secs, after): &(Vec<f64>, f64)| secs.get(number).copied().unwrap_or(*after);
        times.iter().map(of_window).sum::<f64>() / windows.share
    };
    let pixels = windows.cameras.len() * (windows.edge * windows.edge) as usize;
    let mean = |sum: Visits| Visited {
        nodes: sum.nodes as f64 / pixels as f64,
        particles: sum.particles as f64 / pixels as f64,
    };
    Ok(Measured {
        off_secs: off.secs,
        frame_secs: (0..longest).map(frame).collect(),
        after_secs: times.iter().map(|(_, after)| after).sum::<f64>() / windows.share,
        converged,
        cut: cut as f64 / pixels as f64,
        visits: visits.map(mean),
        quality: quality(&off.images, &images),
        grid_secs,
        grid_bytes: known.as_ref().map_or(0, |known| known.grid_bytes),
        pixel_bytes: known.map_or(0, |known| {
            let pixels = f64::from(windows.edge * windows.edge);
            (known.pixel_bytes as f64 * f64::from(EDGE * EDGE) / pixels) as u64
        }),
    })
}

/// What the ray through each pixel's center visits: up to where it ends without culling, with the pixels' `depths`, and if it knew
/// where it ends. A ray that meets nothing would then not be asked.
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
        let known = hit.map_or(Visits::default(), |hit| of(&Ray { t_max: hit.t.next_up(), ..ray }).0);
        [off, cut, known]
    };
    (0..(edge * edge) as usize).into_par_iter().with_min_len(256).map(pixel).collect()
}
