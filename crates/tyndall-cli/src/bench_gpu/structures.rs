//! Single rays through every structure on the card: how many it answers in a second, and what a picture by single rays takes.

use tyndall::render::gpu::{HeapWalk, Resident};
use tyndall::scene::Scene;
use tyndall::scene::color::ParticleColors;
use tyndall::scene::light::Lighting;
use tyndall::structure::treelets::{self, Cut};
use tyndall::structure::{Kind, Packing, pkd};
use tyndall::synthetic;

use super::Bench;
use crate::bench::table::Cell;
use crate::report::Outcome;

pub(super) const HEADINGS: [&str; 7] =
    ["set", "particles", "structure", "walk", "MiB on card", "incoherent Grays/s", "1 sample frames/s"];
/// More particles take too long to arrange in so many ways.
const MOST: u64 = 12_000_000;

/// What is asked.
fn variants() -> Vec<(&'static str, Kind, &'static str, HeapWalk)> {
    let treelets = |size, cut| Kind::Treelets(treelets::Options { size, cut, ..Default::default() });
    let pkd = Kind::Pkd(pkd::Options::default());
    let (stack, free) = (("short stack", HeapWalk::ShortStack), ("stack-free", HeapWalk::StackFree));
    let variant = |name, kind, (walk, how): (&'static str, HeapWalk)| (name, kind, walk, how);
    vec![
        variant("bvh", Kind::Bvh(Packing::Exact), ("stack", HeapWalk::ShortStack)),
        variant("pkd", pkd, stack),
        variant("pkd", pkd, free),
        variant("treelets of 16", treelets(16, Cut::Median), stack),
        variant("treelets of 16, middle", treelets(16, Cut::Middle), stack),
        variant("treelets of 64", treelets(64, Cut::Median), stack),
        variant("treelets of 64, middle", treelets(64, Cut::Middle), stack),
        variant("treelets of 64, middle", treelets(64, Cut::Middle), free),
        variant("treelets of 1024, middle", treelets(1024, Cut::Middle), stack),
    ]
}

impl Bench<'_> {
    /// Asks every structure, if there are not too many particles.
    pub(super) fn measure_structures(&mut self, set: &str, count: Option<u64>) -> Outcome<()> {
        let own = match count {
            Some(count) => count,
            None => synthetic::count(set)?,
        };
        if own > MOST {
            return Ok(());
        }
        for (name, kind, walk, how) in variants() {
            let (structure, cameras, _) = self.build(set, count, kind)?;
            let colors = ParticleColors::constant([0.7; 3]);
            let scene = Scene::new(structure, colors, Lighting::Headlight, Some([1.0; 3]));
            let resident = Resident::load(&self.gpu, &scene, self.report.progress())?.with_heap_walk(how);
            let rays = self.incoherent(&resident, &scene)?;
            let frames = self.frames(&resident, &scene, &cameras[0].1, 1)?;
            self.structures.add([
                Cell::Word(set.into()),
                Cell::Count(scene.structure().len()),
                Cell::Word(name.into()),
                Cell::Word(walk.into()),
                Cell::Number(resident.bytes() as f64 / f64::from(1 << 20), 0),
                Cell::Number(1e-9 * rays, 3),
                Cell::Number(frames.rate, 0),
            ]);
        }
        Ok(())
    }
}
