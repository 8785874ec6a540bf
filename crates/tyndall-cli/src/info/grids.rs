//! What is in files of grids, for people or as JSON.

use std::path::Path;

use serde_json::{Value, json};
use tyndall::scene::{grouped, short};
use tyndall_io::vdb::{self, About};

use crate::report::{Outcome, Report, counted};

/// Describes the grids of files, file by file.
pub(super) fn run(paths: &[impl AsRef<Path>], is_json: bool, report: &Report) -> Outcome<()> {
    let mut told = Vec::new();
    for path in paths {
        let (version, grids) = vdb::grids(path.as_ref(), report.progress())?;
        told.push((path.as_ref().display().to_string(), version, grids));
    }
    if is_json {
        let file = |(path, version, grids): &(String, u32, Vec<About>)| {
            let grids: Vec<Value> = grids.iter().map(object).collect();
            json!({ "format": "OpenVDB", "path": path, "version": version, "grids": grids })
        };
        let files: Vec<Value> = told.iter().map(file).collect();
        let all = if let [one] = &files[..] { one.clone() } else { Value::from(files) };
        return report.out(&format!("{all:#}\n"));
    }
    let mut text = String::new();
    for (path, version, grids) in &told {
        let name = if told.len() > 1 { format!("{path}: ") } else { String::new() };
        text += &format!("{name}OpenVDB {version} · {}\n", counted(grids.len(), "grid"));
        grids.iter().for_each(|grid| text += &(line(grid) + "\n"));
    }
    report.out(&text)
}

/// A grid in a line: `density float · fog volume · 1,234 active voxels of 0.01 · x 0..1 · y 0..1 · z 0..1`.
fn line(grid: &About) -> String {
    let half = if grid.is_half { " as half" } else { "" };
    let mut parts = vec![format!("{} {}{half}", grid.name, grid.kind), grid.class.name().to_string()];
    let count = grid.voxel_count.and_then(|it| usize::try_from(it).ok());
    let count = count.map_or("voxels".into(), |count| format!("{} active voxels", grouped(count)));
    match &grid.transform {
        Ok(transform) => {
            let [x, y, z] = transform.scale.map(short);
            parts.push(if x == y && y == z {
                format!("{count} of {x}")
            } else {
                format!("{count} of {x}×{y}×{z}")
            });
        }
        Err(shape) => parts.push(format!("{count}, {shape}")),
    }
    if let Some([low, high]) = bounds(grid) {
        let side = |axis: usize| format!("{}..{}", short(low[axis]), short(high[axis]));
        parts.push(format!("x {} · y {} · z {}", side(0), side(1), side(2)));
    }
    parts.join(" · ")
}

/// The box of the middles of the active voxels.
fn bounds(grid: &About) -> Option<[[f64; 3]; 2]> {
    let transform = grid.transform.as_ref().ok()?;
    grid.voxel_box.map(|corners| corners.map(|corner| transform.position(corner)))
}

fn object(grid: &About) -> Value {
    let transform = grid.transform.as_ref().ok();
    let bounds = bounds(grid).map(|[min, max]| json!({ "min": min, "max": max }));
    json!({
        "name": grid.name,
        "type": grid.kind,
        "half": grid.is_half,
        "class": grid.class.name(),
        "active_voxels": grid.voxel_count,
        "voxel_box": grid.voxel_box,
        "scale": transform.map(|it| it.scale),
        "translation": transform.map(|it| it.translation),
        "bounds": bounds,
    })
}
