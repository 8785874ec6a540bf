//! What a file with names gives to files that have coordinates only: `topol.gro traj.xtc`.
//!
//! Takes the particles of the first file, or a group of them, gives their attributes and bonds to every frame of the others, which must have as many
//! particles. What changes from frame to frame is not given.

use std::path::{Path, PathBuf};

use tyndall::particles::Attribute;
use tyndall::scene::grouped;
use tyndall::{Columns, Error, Particles, Result};

use crate::groups::{self, Groups};

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
    /// The group that it is of all, and its file, if it is one.
    group: Option<(String, PathBuf)>,
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
        Ok(Self { path: path.to_path_buf(), count: particles.len(), attributes, bonds, group: None })
    }

    /// That of a group alone, with the bonds within it; `count` says how many particles it is to have, where only that tells which group.
    pub(crate) fn of_group(self, groups: Groups, count: impl FnOnce() -> Result<usize>) -> Result<Self> {
        let file = groups.path.clone();
        let group = groups.choose(count)?;
        let refuse =
            |what: String, hint: &str| Err(Error::format(&file, format!("group {}", group.name), what, hint));
        let mut places: Vec<Option<u32>> = vec![None; self.count];
        for (place, &atom) in group.atoms.iter().enumerate() {
            let Some(known) = places.get_mut(atom as usize) else {
                let what = format!(
                    "atom {} is not there: {} has {}",
                    atom + 1,
                    name(&self.path),
                    grouped(self.count)
                );
                return refuse(what, "is the index file of this topology?");
            };
            if known.replace(place as u32).is_some() {
                return refuse(format!("atom {} stands twice", atom + 1), "an atom is once in a trajectory");
            }
        }
        let attributes = self.attributes.iter().map(|it| it.of(&group.atoms)).collect();
        let bond = |[one, other]: &[u32; 2]| Some([places[*one as usize]?, places[*other as usize]?]);
        let bonds = self.bonds.iter().filter_map(bond).collect();
        Ok(Self {
            path: self.path,
            count: group.atoms.len(),
            attributes,
            bonds,
            group: Some((group.name, file)),
        })
    }

    /// Adds the attributes to a frame of the file at `path`, as far as it has not its own of that name; says so.
    pub(crate) fn complete(&self, columns: &mut Columns, path: &Path, frame: u64) -> Result<String> {
        let count = columns.positions.len();
        if count != self.count {
            let (first, here) = (grouped(self.count), grouped(count));
            let setting = groups::SETTING;
            let (own, hint) = match &self.group {
                Some((group, file)) => (
                    format!("group {group} of {}", name(file)),
                    format!("choose the group that was written: {setting} {}:GROUP", file.display()),
                ),
                None if count < self.count => (
                    name(&self.path),
                    format!("the trajectory may hold a subset: pass {setting} FILE.ndx, which says which"),
                ),
                None => (name(&self.path), "are they of one simulation?".to_string()),
            };
            let what = format!("{own} has {first} particles, {} frame {frame} has {here}", name(path));
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
        let group = self.group.as_ref().map(|(group, file)| format!(", group {group} of {}", name(file)));
        Ok(format!("from {}{}: {}", self.path.display(), group.unwrap_or_default(), names.join(" ")))
    }
}

/// A file's name, without its folder.
fn name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}
