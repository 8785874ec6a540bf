//! What was chosen for a density and how many particles its grid points used, as JSON: `--statistics`. Keys do not change.

use serde_json::{Value, json};
use tyndall::Particles;
use tyndall::medium::density::statistics::Used;
use tyndall::medium::density::{Settings, Smoothing, Volume};

/// The object, and a line end, of `count` particles, some or all of which these are.
pub(super) fn json((particles, count): (&Particles, usize), settings: &Settings, volume: &Volume) -> String {
    let smoothing = Smoothing::NAMES.iter().find(|(_, it)| *it == settings.smoothing).map(|(name, _)| name);
    let grid = &volume.density;
    let [stored, all] = grid.stored_bricks();
    let object = json!({
        "particles": count,
        "smoothing": smoothing,
        "h0": volume.length.map(shortest),
        "neighbors": settings.neighbors,
        "correction_scale": shortest(settings.scale),
        "further_passes": settings.further_passes,
        // N used by grid points: those with any particle within h0, and those with N* or more.
        "used": { "touched": used(volume.statistics.touched), "full": used(volume.statistics.full) },
        "grid": {
            "size": grid.size(),
            "spacing": shortest(grid.spacing()),
            "origin": (particles.positions().origin() + grid.origin().as_dvec3()).to_array(),
            "bricks": { "stored": stored, "all": all, "finer": &grid.levels()[1..] },
            "max": shortest(grid.max()),
            "mass": grid.mass(),
        },
        "peak_bytes": volume.peak_bytes,
        "notes": volume.notes,
    });
    format!("{object:#}\n")
}

fn used(used: Used) -> Value {
    json!({
        "points": used.samples(),
        "mean": used.mean(),
        "deviation": used.deviation(),
        "ratio": used.ratio(),
    })
}

/// Through its shortest digits, so that 0.1 is not told as 0.10000000149.
fn shortest(value: f32) -> Option<f64> {
    value.to_string().parse().ok().filter(|it: &f64| it.is_finite())
}
