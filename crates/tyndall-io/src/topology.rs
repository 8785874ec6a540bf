//! What a file with names gives to files that have coordinates only: `topol.gro traj.xtc`.
//!
//! Takes the particles of the first file, gives their attributes to every frame of the others, which must have as many particles. What
//! changes from frame to frame is not given.

use std::path::{Path, PathBuf};

use tyndall::particles::Attribute;
use tyndall::scene::grouped;
use tyndall::{Columns, Error, Particles, Result};

/// Attributes that are those of one moment.
const MOVING: [&str; 15] = [
    "velocity", "vx", "vy", "vz", "force", "fx", "fy", "fz", "ix", "iy", "iz", "image", "omegax", "omegay",
    "omegaz",
];

/// Attributes for particles whose own file has none.
#[derive(Debug)]
pub(crate) struct Topology {
    path: PathBuf,
    count: usize,
    attributes: Vec<Attribute>,
    bonds: Vec<[u32; 2]>,
}

impl Topology {
    /// Of the particles of a file. Fails where some of them could not be kept: their names would go to others.
    pub(crate) fn new(path: &Path, particles: &Particles) -> Result<Self> {
        let dropped = particles.dropped().total();
        if dropped > 0 {
            let what = format!(
                "{} particles have no finite place or radius, so names cannot be given by order",
                grouped(dropped as usize)
            );
            return Err(Error::format(path, "", what, "correct their coordinates"));
        }
        let stays = |it: &&Attribute| !MOVING.contains(&it.name.as_str());
        let attributes = particles.attributes().iter().filter(stays).cloned().collect();
        let bonds = particles.bonds().to_vec();
        Ok(Self { path: path.to_path_buf(), count: particles.len(), attributes, bonds })
    }

    /// Adds the attributes to a frame of the file at `path`, as far as it has not its own of that name; says so.
    pub(crate) fn complete(&self, columns: &mut Columns, path: &Path, frame: u64) -> Result<String> {
        let count = columns.positions.len();
        if count != self.count {
            let name =
                |path: &Path| path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
            let (first, here) = (grouped(self.count), grouped(count));
            let what = format!(
                "{} has {first} particles, {} frame {frame} has {here}",
                name(&self.path),
                name(path)
            );
            let hint = "give a file of names for just the particles of the trajectory, which may hold a part of them";
            return Err(Error::format(path, "", what, hint));
        }
        let mut names = Vec::new();
        for attribute in &self.attributes {
            if !columns.attributes.iter().any(|it| it.name == attribute.name) {
                names.push(attribute.name.as_str());
                columns.attributes.push(attribute.clone());
            }
        }
        if columns.bonds.is_empty() && !self.bonds.is_empty() {
            names.push("bonds");
            columns.bonds.clone_from(&self.bonds);
        }
        Ok(format!("from {}: {}", self.path.display(), names.join(" ")))
    }
}
