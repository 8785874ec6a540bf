//! The hierarchy as the processor builds it beside the one that the card builds: how long each takes, and how long walks through it are.
//!
//! `build` of the card has the upload of the particles in it; `copy` is what brings the structure to the other side: the processor's to the
//! card, the card's back. Kernels are made before the clock starts. Walks have 4 samples a pixel.

use std::time::Instant;

use tyndall::Error;
use tyndall::render::gpu::{Hierarchy, Renderer, Resident};
use tyndall::scene::Scene;
use tyndall::scene::automatic;
use tyndall::scene::camera::Camera;
use tyndall::scene::color::ParticleColors;
use tyndall::scene::light::Lighting;
use tyndall::structure::{Kind, Spheres};
use tyndall::synthetic;

use super::{Bench, STREAMED};
use crate::bench::table::Cell;
use crate::report::Outcome;
use crate::structure;

pub(super) const BUILDS: [&str; 12] = [
    "set",
    "particles",
    "builder",
    "build s",
    "build Mparticles/s",
    "copy s",
    "build and copy Mparticles/s",
    "steps a tile",
    "nodes a tile",
    "leaves a tile",
    "tests a sample",
    "hits ms",
];

/// What building took.
#[derive(Clone, Copy)]
pub(super) struct Secs {
    pub(super) build: f64,
    pub(super) copy: f64,
}

impl Bench<'_> {
    /// Adds a row for each builder; `text` says what the particles are, and `scene` and `secs` are the processor's.
    pub(super) fn measure_builds(
        &mut self,
        text: &str,
        scene: &Scene,
        camera: &Camera,
        secs: Secs,
    ) -> Outcome<()> {
        let Kind::Bvh(packing) = structure::kind(&self.args.structure)? else { return Ok(()) };
        if synthetic::count(text)? >= STREAMED {
            return Ok(());
        }
        let progress = self.report.progress();
        let resident = Resident::load(&self.gpu, scene, progress)?;
        let row = self.row(text, "cpu", &resident, scene, camera, secs)?;
        self.builds.add(row);
        drop(resident);

        let particles = synthetic::generate(text, progress)?;
        let (radii, _) = automatic::radii(&particles);
        let spheres = Spheres { particles: &particles, radii: &radii, radius_scale: 1.0 };
        // The first time makes the kernels.
        match Hierarchy::build(&self.gpu, spheres, packing, progress) {
            Ok(hierarchy) => drop(hierarchy),
            Err(error @ Error::Memory { .. }) => {
                self.report.note(format_args!("note: {error}"));
                return Ok(());
            }
            Err(error) => return Err(error.into()),
        }
        let start = Instant::now();
        let hierarchy = Hierarchy::build(&self.gpu, spheres, packing, progress)?;
        let build = start.elapsed().as_secs_f64();
        let start = Instant::now();
        let structure = hierarchy.structure(particles, &radii, 1.0, progress)?;
        let secs = Secs { build, copy: start.elapsed().as_secs_f64() };
        let colors = ParticleColors::constant([0.7; 3]);
        let scene = Scene::new(structure, colors, Lighting::Headlight, Some([1.0; 3]));
        let resident = Resident::built(hierarchy, &scene, progress)?;
        let row = self.row(text, "gpu", &resident, &scene, camera, secs)?;
        self.builds.add(row);
        Ok(())
    }

    fn row(
        &self,
        text: &str,
        builder: &str,
        resident: &Resident,
        scene: &Scene,
        camera: &Camera,
        secs: Secs,
    ) -> Outcome<[Cell; BUILDS.len()]> {
        const SAMPLES: u32 = 4;
        let frames = self.frames(resident, scene, camera, SAMPLES)?;
        let mut renderer = Renderer::new(resident, scene, camera, &self.settings(SAMPLES))?;
        let work = renderer.count_work(self.report.progress())?;
        let particles = scene.structure().len();
        let rate = |secs: f64| Cell::Number(1e-6 * particles as f64 / secs, 1);
        let size = self.args.size;
        let samples = f64::from(SAMPLES) * f64::from(size.width) * f64::from(size.height);
        let [steps, nodes, leaves, tests] = match work {
            None => [Cell::Unknown, Cell::Unknown, Cell::Unknown, Cell::Unknown],
            Some(work) => {
                let a_tile = |count: u64| Cell::Number(count as f64 / work.tiles as f64, 1);
                let tests = Cell::Number(work.tests as f64 / samples, 2);
                [a_tile(work.steps), a_tile(work.nodes), a_tile(work.leaves), tests]
            }
        };
        let hits = frames.secs.map_or(Cell::Unknown, |secs| Cell::Number(1e3 * secs[0], 3));
        Ok([
            Cell::Word(text.split('?').next().unwrap_or(text).into()),
            Cell::Count(particles),
            Cell::Word(builder.into()),
            Cell::Number(secs.build, 3),
            rate(secs.build),
            Cell::Number(secs.copy, 3),
            rate(secs.build + secs.copy),
            steps,
            nodes,
            leaves,
            tests,
            hits,
        ])
    }
}
