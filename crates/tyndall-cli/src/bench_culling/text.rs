//! The report: what was measured, in tables beside the thesis', and what of its findings holds.

use tyndall::render::confidence::Neighborhood;
use tyndall::scene::grouped;
use tyndall::structure::Kind;

use super::Evaluated;
use super::measure::Measured;
use super::sets::{EDGE, VIEWS};
use crate::args;
use crate::bench::table::{Cell, Table};
use crate::structure;

/// All of it, as Markdown.
pub(super) fn report(evaluated: &[Evaluated], kind: Kind, args: &args::Bench, secs: f64) -> String {
    let bench = &args.culling;
    let mut text = format!(
        "# Culling by confidence\n\n\
         tyndall {}, {} threads, {}, orthographic, {EDGE} x {EDGE} pixels, 4 samples a pixel and frame, headlight; {} in all. Times and \
         quality: nine windows of {} pixels an edge; at most {} frames until convergence ({} for pictures that are shown whole).\n\n\
         nc: no culling, bc: before convergence, ac: after convergence. Views marked * are axis-aligned.\n",
        env!("CARGO_PKG_VERSION"),
        rayon::current_num_threads(),
        structure::name(kind),
        crate::report::seconds(secs),
        bench.window,
        bench.frames,
        bench.picture_frames,
    );
    let mut section = |title: &str, table: Table| text += &format!("\n## {title}\n\n{}", table.markdown());
    section("Parameters (thesis, tables 6.1 and 6.2)", parameters(evaluated, args));
    section("Frames a second (thesis, table 6.3)", frames(evaluated));
    section("What a ray visits on average, and the ceiling", visits(evaluated));
    section("Pictures after convergence beside those without culling", quality(evaluated));
    section("Structures", structures(evaluated));
    section("Memory of culling", memory(evaluated));
    if evaluated.iter().any(|set| !set.variants.is_empty()) {
        section("Other knobs (thesis, sections 6.1 and 6.2)", variants(evaluated));
    }
    text += "\n## Findings\n\n";
    for finding in findings(evaluated) {
        text += &format!("- {finding}\n");
    }
    text += "\n## Figures\n";
    for (file, caption) in evaluated.iter().flat_map(|set| &set.figures) {
        text += &format!("\n![{caption}]({file})\n\n{caption}\n");
    }
    text
}

fn word(word: impl Into<String>) -> Cell {
    Cell::Word(word.into())
}

/// A row's first cells: which set and which view.
fn names(set: &Evaluated, view: usize) -> [Cell; 2] {
    let mark = if VIEWS[view].1 { "*" } else { "" };
    [word(set.set.name), word(format!("{}{mark}", view + 1))]
}

/// A row for each view.
fn by_view(
    evaluated: &[Evaluated],
    headings: &[&'static str],
    cells: impl Fn(&Evaluated, usize, &Measured) -> Vec<Cell>,
) -> Table {
    let mut table = Table::new(headings);
    for set in evaluated {
        for (view, measured) in set.views.iter().enumerate() {
            table.add(names(set, view).into_iter().chain(cells(set, view, measured)));
        }
    }
    table
}

fn parameters(evaluated: &[Evaluated], args: &args::Bench) -> Table {
    let mut table =
        Table::new(&["set", "stands for", "particles", "vc", "C_occ", "ci", "spp", "dq", "di", "ks"]);
    for set in evaluated {
        let options = args.culling.scaled(set.set.options);
        let kernel = match options.neighborhood {
            Neighborhood::Kernel(edge) => format!("{edge}x{edge}"),
            Neighborhood::Pyramid(level) => format!("level {level}"),
        };
        table.add([
            word(set.set.name),
            word(set.set.title),
            Cell::Count(set.particles),
            Cell::Count(options.voxel_count as usize),
            Cell::Number(options.occlusion_confidence.into(), 2),
            Cell::Count(options.convergence_samples as usize),
            Cell::Count(options.frame_samples as usize),
            word(if options.depth_quantization { "yes" } else { "no" }),
            word("no"),
            word(kernel),
        ]);
    }
    table
}

fn frames(evaluated: &[Evaluated]) -> Table {
    let headings = [
        "set",
        "view",
        "nc",
        "bc",
        "ac",
        "certified",
        "bc : nc",
        "ac : nc",
        "certified : nc",
        "frames",
        "converged %",
        "thesis nc",
        "thesis bc",
        "thesis ac",
        "thesis bc : nc",
        "thesis ac : nc",
    ];
    by_view(evaluated, &headings, |set, view, measured| {
        let (off, before, after) = (measured.off_secs, measured.before_secs(), measured.after_secs);
        let [nc, bc, ac] = set.set.thesis[view];
        vec![
            Cell::Number(1.0 / off, 3),
            Cell::Number(1.0 / before, 3),
            Cell::Number(1.0 / after, 3),
            Cell::Number(1.0 / measured.certified_secs, 3),
            Cell::Number(off / before, 2),
            Cell::Number(off / after, 2),
            Cell::Number(off / measured.certified_secs, 2),
            Cell::Count(measured.frame_secs.len()),
            Cell::Number(100.0 * measured.converged, 1),
            Cell::Number(nc, 1),
            Cell::Number(bc, 1),
            Cell::Number(ac, 1),
            Cell::Number(bc / nc, 2),
            Cell::Number(ac / nc, 2),
        ]
    })
}

fn visits(evaluated: &[Evaluated]) -> Table {
    let headings = [
        "set",
        "view",
        "nodes nc",
        "nodes ac",
        "nodes oracle",
        "particles nc",
        "particles ac",
        "particles oracle",
        "ac : nc",
        "ceiling",
    ];
    by_view(evaluated, &headings, |_, _, measured| {
        let [off, cut, known] = measured.visits;
        let mut cells: Vec<Cell> =
            [off.nodes, cut.nodes, known.nodes].map(|nodes| Cell::Number(nodes, 1)).into_iter().collect();
        cells.extend([off.particles, cut.particles, known.particles].map(|it| Cell::Number(it, 1)));
        cells.push(Cell::Number(off.particles / cut.particles, 2));
        cells.push(Cell::Number(off.particles / known.particles, 2));
        cells
    })
}

fn quality_cells(measured: &Measured) -> Vec<Cell> {
    let quality = measured.quality;
    vec![
        Cell::Number(quality.psnr, 1),
        Cell::Number(quality.ssim, 4),
        Cell::Number(quality.flip, 4),
        Cell::Number(100.0 * quality.pierced, 2),
        Cell::Number(100.0 * measured.cut, 1),
    ]
}

fn quality(evaluated: &[Evaluated]) -> Table {
    let headings = ["set", "view", "PSNR dB", "SSIM", "FLIP", "pixels pierced %", "pixels cut %"];
    by_view(evaluated, &headings, |_, _, measured| quality_cells(measured))
}

fn structures(evaluated: &[Evaluated]) -> Table {
    let mut table =
        Table::new(&["set", "structure", "build s", "B/particle", "coherent Mrays/s", "peak MiB"]);
    for set in evaluated {
        for &(name, secs, bytes, rate) in &set.structures {
            let peak = set
                .peak_bytes
                .map_or(Cell::Unknown, |bytes| Cell::Number(bytes as f64 / f64::from(1 << 20), 0));
            table.add([
                word(set.set.name),
                word(name),
                Cell::Number(secs, 2),
                Cell::Number(bytes as f64 / set.particles.max(1) as f64, 1),
                Cell::Number(rate, 3),
                peak,
            ]);
        }
    }
    table
}

fn memory(evaluated: &[Evaluated]) -> Table {
    let mut table =
        Table::new(&["set", "density grid MiB", "grid s", "pixels MiB", "B/particle of the grid"]);
    let mib = |bytes: u64| Cell::Number(bytes as f64 / f64::from(1 << 20), 1);
    for set in evaluated {
        let Some(first) = set.views.first() else { continue };
        table.add([
            word(set.set.name),
            mib(first.grid_bytes),
            Cell::Number(first.grid_secs, 2),
            mib(first.pixel_bytes),
            Cell::Number(first.grid_bytes as f64 / set.particles.max(1) as f64, 1),
        ]);
    }
    table
}

fn variants(evaluated: &[Evaluated]) -> Table {
    let headings = [
        "set",
        "knobs",
        "bc : nc",
        "ac : nc",
        "particles ac : nc",
        "PSNR dB",
        "SSIM",
        "FLIP",
        "pixels pierced %",
        "pixels cut %",
        "grid MiB",
    ];
    let mut table = Table::new(&headings);
    for set in evaluated {
        for (name, measured) in &set.variants {
            let [off, cut, _] = measured.visits;
            let times = [
                Cell::Number(measured.off_secs / measured.before_secs(), 2),
                Cell::Number(measured.off_secs / measured.after_secs, 2),
                Cell::Number(off.particles / cut.particles, 2),
            ];
            let grid = Cell::Number(measured.grid_bytes as f64 / f64::from(1 << 20), 1);
            let cells = [word(set.set.name), word(name.clone())].into_iter().chain(times);
            table.add(cells.chain(quality_cells(measured)).chain([grid]));
        }
    }
    table
}

/// The middle one, or the mean of the middle two.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    match values.len() {
        0 => f64::NAN,
        count => 0.5 * (values[(count - 1) / 2] + values[count / 2]),
    }
}

/// The thesis' findings, each with the numbers that speak for or against it.
fn findings(evaluated: &[Evaluated]) -> Vec<String> {
    let views = || evaluated.iter().flat_map(|set| set.views.iter().enumerate());
    let gain = |measured: &Measured| measured.off_secs / measured.after_secs;
    let slower = views().filter(|(_, measured)| measured.before_secs() > measured.off_secs).count();
    let faster = views().filter(|(_, measured)| gain(measured) > 1.0).count();
    let all = views().count();
    let gains = |aligned: bool| {
        let of_kind = views().filter(|(view, _)| VIEWS[*view].1 == aligned);
        median(of_kind.map(|(_, measured)| gain(measured)).collect())
    };
    let mut found = vec![
        format!(
            "Slower before convergence (section 6.2): in {slower} of {all} views; a frame takes {:.2} times as long (median).",
            median(views().map(|(_, it)| it.before_secs() / it.off_secs).collect())
        ),
        format!(
            "A gain after convergence (section 6.2): in {faster} of {all} views; {:.2} times as fast (median).",
            median(views().map(|(_, it)| gain(it)).collect())
        ),
        format!(
            "More for axis-aligned views (section 6.2): {:.2} times as fast there, {:.2} elsewhere (medians).",
            gains(true),
            gains(false)
        ),
    ];
    let by_set: Vec<String> = evaluated
        .iter()
        .map(|set| {
            let gain = median(set.views.iter().map(gain).collect());
            format!("{} ({} particles) {gain:.2}", set.set.name, grouped(set.particles))
        })
        .collect();
    found.push(format!("More for large data (section 6.2), medians by set: {}.", by_set.join(", ")));
    found.push(format!(
        "The ceiling: a ray that knows where it ends tests {:.2} times fewer particles, one that confidence cuts {:.2} times (medians).",
        median(views().map(|(_, it)| it.visits[0].particles / it.visits[2].particles).collect()),
        median(views().map(|(_, it)| it.visits[0].particles / it.visits[1].particles).collect()),
    ));
    let virion = evaluated.iter().find(|set| set.set.name == "virion");
    let pierced: Vec<String> = virion.map_or(Vec::new(), |set| {
        let share = |(name, it): &(String, Measured)| format!("{name} {:.2} %", 100.0 * it.quality.pierced);
        set.variants.iter().map(share).collect()
    });
    if !pierced.is_empty() {
        found.push(format!(
            "Artifacts on the virion by kernel, interpolation and slices (section 6.1), share of pixels pierced by the background: {}.",
            pierced.join(", ")
        ));
    }
    found
}
