//! `tyndall bench bodies`: how far pictures of spheres in a medium are off at so many samples, marched with the cache and traced by paths, as Markdown.
//!
//! Three scenes of lumps of matter with fourteen spheres in them, which differ in thickness, phase and lights. What is right is the path tracer's picture with
//! [`CONVERGED`] samples and another seed. relMSE is the mean over pixels and channels of the squared difference over the squared right value and 0.01.

use std::time::Instant;

use tyndall::medium::light::{Directional, Environment, Point};
use tyndall::medium::{Grid, Light, Medium, Optics, Phase};
use tyndall::random::Stream;
use tyndall::render::medium::cache::{self, Cache};
use tyndall::render::medium::free_path::FreePath;
use tyndall::render::medium::march::{self, Illumination, March, Pixel};
use tyndall::render::medium::reference::{self, Reference};
use tyndall::render::medium::solids::Solids;
use tyndall::scene::Scene;
use tyndall::scene::camera::{Camera, Projection, View};
use tyndall::scene::color::ParticleColors;
use tyndall::scene::light::Lighting;
use tyndall::structure::{Kind, Structure};
use tyndall::{Columns, DVec3, Particles, Positions, Radii, Vec3};

use crate::args;
use crate::report::{Outcome, Report};

/// Samples a pixel that are measured.
const SAMPLES: [u32; 4] = [1, 4, 16, 64];
/// Those of what is right.
const CONVERGED: u32 = 1024;
/// Samples of the density along an edge of the box of edge 2.
const EDGE: u32 = 32;

/// A scene, its pictures, and what is right.
struct Measured<'a> {
    medium: &'a Medium,
    lights: &'a [Light],
    solids: Solids<'a>,
    view: View,
    size: [u32; 2],
    right: Vec<Pixel>,
    report: &'a Report,
}

/// Measures all scenes and prints a table.
pub(crate) fn run(args: &args::Bench, report: &Report) -> Outcome<()> {
    // A fourth of the usual picture is enough pixels for a mean.
    let size = [args.size.width.div_ceil(4), args.size.height.div_ceil(4)];
    let spheres = spheres()?;
    let [width, height] = size;
    report.out(&format!(
        "{width}x{height} pixels, {} threads, right is a picture of {CONVERGED} samples\n\n",
        rayon::current_num_threads()
    ))?;
    report.out("| scene | samples | march relMSE | denoised | s | path tracer relMSE | denoised | s |\n|---|---|---|---|---|---|---|---|\n")?;
    for (name, medium, lights) in scenes()? {
        let scene = Measured::new((&medium, &lights), Solids::new(&spheres), size, report)?;
        let start = Instant::now();
        let cache = Cache::around(
            &medium,
            &lights,
            Some(scene.solids),
            &cache::Settings::default(),
            report.progress(),
        )?;
        let caching = start.elapsed().as_secs_f64();
        report.out(&format!("| {name} | | | | light {caching:.2} | | | |\n"))?;
        for samples in SAMPLES {
            let (marched, traced) = (scene.marched(&cache, samples)?, scene.traced(samples, 1)?);
            let cells = [marched, traced].map(|it| scene.cells(&it));
            report.out(&format!("| | {samples} | {} | {} |\n", cells[0], cells[1]))?;
        }
    }
    Ok(())
}

/// A picture as it is and with less noise, and its seconds, without those of taking out noise.
struct Made {
    pixels: Vec<Pixel>,
    denoised: Option<Vec<Pixel>>,
    secs: f64,
}

impl<'a> Measured<'a> {
    fn new(
        (medium, lights): (&'a Medium, &'a [Light]),
        solids: Solids<'a>,
        size: [u32; 2],
        report: &'a Report,
    ) -> Outcome<Self> {
        let projection = Projection::Orthographic { height: 2.4 };
        let camera =
            Camera { eye: DVec3::new(0.0, 0.0, 5.0), look_at: DVec3::ZERO, up: DVec3::Y, projection };
        let view = camera.view(DVec3::ZERO, size[0], size[1])?;
        let measured = Self { medium, lights, solids, view, size, right: Vec::new(), report };
        let right = measured.traced(CONVERGED, 2)?.pixels;
        Ok(Self { right, ..measured })
    }

    fn traced(&self, samples: u32, seed: u32) -> Outcome<Made> {
        let [width, height] = self.size;
        let settings = reference::Settings { width, height, seed, orders: None, free_path: FreePath::Delta };
        let start = Instant::now();
        let mut reference = Reference::new(self.medium, self.lights, self.view, settings)?
            .with_solids(self.solids)
            .with_halves();
        reference.pass(samples, self.report.progress())?;
        let secs = start.elapsed().as_secs_f64();
        Ok(Made { pixels: reference.pixels(), denoised: reference.denoised(), secs })
    }

    fn marched(&self, cache: &Cache, samples: u32) -> Outcome<Made> {
        let [width, height] = self.size;
        let settings = march::Settings { width, height, samples, seed: 1, ..march::Settings::default() };
        let start = Instant::now();
        let march = March::new(self.medium, Illumination::Cached(cache), self.lights, self.view, settings)?;
        let mut march = march.with_solids(self.solids).with_halves();
        while !march.is_done() {
            march.pass(self.report.progress())?;
        }
        let secs = start.elapsed().as_secs_f64();
        Ok(Made { pixels: march.pixels(), denoised: march.denoised(), secs })
    }

    /// Errors and time as cells of a table.
    fn cells(&self, made: &Made) -> String {
        let error = |pixels: &[Pixel]| format!("{:.2e}", relative_error(pixels, &self.right));
        let denoised = made.denoised.as_deref().map_or(String::new(), error);
        format!("{} | {denoised} | {:.2}", error(&made.pixels), made.secs)
    }
}

/// See the module.
fn relative_error(found: &[Pixel], right: &[Pixel]) -> f64 {
    let light = |pixel: &Pixel| pixel.scattered + pixel.environment;
    let error = |(found, right): (&Pixel, &Pixel)| {
        let (found, right) = (light(found), light(right));
        f64::from(((found - right) * (found - right) / (right * right + 1e-2)).element_sum() / 3.0)
    };
    found.iter().zip(right).map(error).sum::<f64>() / found.len() as f64
}

/// Each by its name.
fn scenes() -> Outcome<Vec<(&'static str, Medium, Vec<Light>)>> {
    let sun = |light: [f32; 3]| Directional::new(Vec3::new(0.5, -1.0, -0.4), light).map(Light::Directional);
    let sky = |light: [f32; 3]| Environment::constant(light).map(Light::Environment);
    let lamp = Light::Point(Point::new(Vec3::splat(0.9), [2.0, 1.6, 1.2])?);
    Ok(vec![
        ("thin, sun and sky", lumps(3.0, 0.9, 0.0)?, vec![sun([4.0, 3.0, 2.0])?, sky([0.3, 0.4, 0.6])?]),
        ("thick, forward, sun", lumps(8.0, 0.6, 0.5)?, vec![sun([4.0; 3])?]),
        ("thin, lamp and sky", lumps(2.0, 0.8, 0.0)?, vec![lamp, sky([0.2; 3])?]),
    ])
}

/// Lumps of random size and place in a box of edge 2 around the origin, of an extinction, an albedo and a mean cosine.
fn lumps(extinction: f32, albedo: f32, g: f32) -> Outcome<Medium> {
    let mut stream = Stream::new(71, 0);
    let lumps: Vec<(Vec3, f32)> = (0..12).map(|_| (0.6 * stream.cube(), stream.range(0.15, 0.4))).collect();
    let (first, spacing) = (1.0 / EDGE as f32 - 1.0, 2.0 / EDGE as f32);
    let value = |place: u32| {
        let at = Vec3::from([place % EDGE, place / EDGE % EDGE, place / (EDGE * EDGE)].map(|it| it as f32));
        let at = first + spacing * at;
        let lump =
            |(center, size): &(Vec3, f32)| (1.0 - (at - *center).length_squared() / (size * size)).max(0.0);
        lumps.iter().map(lump).sum()
    };
    let values: Vec<f32> = (0..EDGE.pow(3)).map(value).collect();
    let grid = Grid::from_dense(Vec3::splat(first), spacing, [EDGE; 3], &values)?;
    let optics = Optics { extinction: [extinction; 3], albedo: [albedo; 3], phase: Phase::new(g)? };
    Ok(Medium::new(grid, optics)?)
}

/// Fourteen of one radius and color.
fn spheres() -> Outcome<Scene> {
    let mut stream = Stream::new(72, 0);
    let centers: Vec<DVec3> = (0..14).map(|_| (0.7 * stream.cube()).as_dvec3()).collect();
    let mut columns = Columns { positions: Positions::around(DVec3::ZERO), ..Columns::default() };
    columns.positions.extend(&centers);
    let particles = Particles::new(columns)?;
    let structure = Structure::build(Kind::default(), particles, &Radii::Uniform(0.17), 1.0, &())?;
    Ok(Scene::new(structure, ParticleColors::constant([0.8, 0.5, 0.2]), Lighting::Flat, None))
}
