//! `tyndall bench structures`: what each structure takes in memory and time, and how many single rays it answers in a second.
//!
//! Coherent rays are those through the pixels of a picture in perspective, row by row; incoherent ones go from points around the
//! particles to points among them. Both sets are the same for all structures over the same particles.

use tyndall::render::estimate::Work;
use tyndall::structure::treelets::{self, Cut};
use tyndall::structure::{Kind, Packing, Structure, pkd};

use super::table::{Cell, Table};
use super::{Bench, PROJECTIONS, camera_of, jobs, rays};
use crate::args;
use crate::dry_run::check_memory;
use crate::report::{Outcome, Report};
use crate::structure;

const HEADINGS: [&str; 9] = [
    "set",
    "particles",
    "structure",
    "treelets of",
    "cut",
    "B/particle",
    "build s",
    "coherent Mrays/s",
    "incoherent Mrays/s",
];

const SIZES: [u32; 5] = [16, 64, 256, 1024, 4096];

/// Measures every structure over every set at every count.
pub(super) fn run(args: &args::Bench, report: &Report) -> Outcome<()> {
    let heap = match structure::kind(&args.structure)? {
        Kind::Pkd(heap) => heap,
        _ => pkd::Options::default(),
    };
    let bench = Bench::new(args, report)?;
    let mut table = Table::new(&HEADINGS);
    for (set, count) in jobs(args) {
        for kind in kinds(heap) {
            let work = Work::of_count(count, kind, bench.settings(1));
            check_memory(&work, work.memory_bytes(), None)?;
            let (structure, build_secs) = bench.build(set, count, kind)?;
            let (coherent, incoherent) = rates(&structure, args)?;
            let (size, cut) = match kind {
                Kind::Treelets(options) => (Cell::Count(options.size as usize), cut_name(options.cut)),
                _ => (Cell::Unknown, "–"),
            };
            let held = structure.bytes() as f64 / structure.len().max(1) as f64;
            table.add([
                Cell::Word(set.into()),
                Cell::Count(structure.len()),
                Cell::Word(structure::name(kind).into()),
                size,
                Cell::Word(cut.into()),
                Cell::Number(held, 2),
                Cell::Number(build_secs, 2),
                Cell::Number(coherent, 2),
                Cell::Number(incoherent, 2),
            ]);
        }
    }
    match args.json {
        true => report.out(&format!("{:#}\n", table.json())),
        false => report.out(&table.markdown()),
    }
}

/// All that is measured, with the k-d trees of `heap`.
fn kinds(heap: pkd::Options) -> Vec<Kind> {
    let mut kinds = vec![Kind::Bvh(Packing::Exact), Kind::Bvh(Packing::Bits16), Kind::Pkd(heap)];
    for cut in [Cut::Median, Cut::Middle] {
        kinds.extend(SIZES.map(|size| Kind::Treelets(treelets::Options { size, cut, heap })));
    }
    kinds
}

fn cut_name(cut: Cut) -> &'static str {
    match cut {
        Cut::Median => "median",
        Cut::Middle => "middle",
    }
}

/// Millions of coherent and of incoherent rays answered in a second.
fn rates(structure: &Structure, args: &args::Bench) -> Outcome<(f64, f64)> {
    let bounds = structure.bounds();
    let (width, height) = (args.size.width, args.size.height);
    let [_, (_, perspective)] = PROJECTIONS;
    let center = structure.origin() + bounds.center().as_dvec3();
    let camera = camera_of(perspective, center, f64::from(bounds.extent().max_element()));
    let view = camera.view(structure.origin(), width, height)?;
    let coherent = rays::rate(structure, &rays::coherent(&view, width, height));
    Ok((coherent, rays::rate(structure, &rays::incoherent(&bounds, rays::INCOHERENT))))
}
