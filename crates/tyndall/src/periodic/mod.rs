//! Particles of a periodic box, put where they are wanted: folded into the cell, with molecules whole, or where they have come to.
//!
//! Takes particles and gives the same ones elsewhere, always at an image of where they were. Image flags of the file, if it has them, are
//! kept in step: position and flags together say what they said before.

pub mod center;
mod lattice;
mod molecules;
mod neighbors;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::particles::{Particles, Values, View};
pub(crate) use lattice::Lattice;
use molecules::Molecules;
pub(crate) use neighbors::pairs;

/// Where particles of a periodic box are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Placement {
    /// Where the file says.
    #[default]
    AsStored,
    /// Each in the cell, along the edges that repeat.
    Atoms,
    /// Those of a molecule as near each other as their images come, with the middle of all in the cell. A molecule is what the file
    /// says (`mol`), else a residue, or a chain of those that proteins and nucleic acids are made of; and what bonds join to it.
    Molecules,
    /// Where they came to by themselves, by the file's image flags `ix iy iz`.
    Unwrapped,
}

/// Names of the image flags, which count how often a particle has left the cell along each edge.
pub const FLAGS: [&str; 3] = ["ix", "iy", "iz"];

/// Puts particles where `placement` says. Returns too what was done, in one line; nothing for [`Placement::AsStored`].
///
/// Fails with [`Error::Setting`] if the particles have no cell that repeats, or lack what says where they belong.
pub fn place(particles: Particles, placement: Placement) -> Result<(Particles, Option<String>)> {
    let (setting, name) = match placement {
        Placement::AsStored => return Ok((particles, None)),
        Placement::Atoms => ("--wrap", "atoms"),
        Placement::Molecules => ("--wrap", "molecules"),
        Placement::Unwrapped => ("--unwrap", "on"),
    };
    let Some(cell) = particles.cell() else {
        let allowed = "left out for this file: it has no cell to repeat — its topology file may have one, as in topol.gro traj.xtc";
        return Err(Error::setting(setting, name, allowed));
    };
    let lattice = Lattice::new(cell, setting, name)?;
    let (edges, text) = match placement {
        Placement::Molecules => {
            let molecules = Molecules::of(&particles)?;
            let text = format!("molecules by {}, whole, in the cell", molecules.by);
            (molecules.whole(&particles, &lattice), text)
        }
        Placement::Unwrapped => match unwrapped(&particles, &lattice)? {
            Some(edges) => (edges, "unwrapped by ix iy iz".to_string()),
            None => {
                let text = "unwrapped already: image flags and positions agree";
                return Ok((particles, Some(text.into())));
            }
        },
        Placement::AsStored | Placement::Atoms => {
            let edges = each(&particles, |_, place| -lattice.image(place));
            (edges, "in the cell".to_string())
        }
    };
    let moved = edges.par_iter().filter(|edges| **edges != [0; 3]).count();
    let text = format!("{text}: {moved} of {} moved", particles.len());
    Ok((moved_by(particles, &lattice, &edges)?, Some(text)))
}

/// By how many edges of the cell each particle is moved.
type Edges = Vec<[i32; 3]>;

/// What `edges` says of each particle and its position.
fn each(particles: &Particles, edges: impl Fn(usize, DVec3) -> DVec3 + Sync) -> Edges {
    let ids = (0..particles.len()).into_par_iter().with_min_len(1 << 12);
    ids.map(|id| counted(edges(id, particles.positions().world(id)))).collect()
}

/// As whole numbers, which they are.
fn counted(edges: DVec3) -> [i32; 3] {
    edges.to_array().map(|it| it as i32)
}

/// By how much the image flags of each particle move it; none if they have been applied.
fn unwrapped(particles: &Particles, lattice: &Lattice) -> Result<Option<Edges>> {
    let [Some(x), Some(y), Some(z)] = FLAGS
        .map(|name| particles.attribute(name).filter(|it| it.components == 1 && it.values.is_discrete()))
    else {
        let allowed =
            "left out: the file has no image flags ix iy iz — --wrap molecules makes molecules whole";
        return Err(Error::setting("--unwrap", "on", allowed));
    };
    let flags = |id: usize| DVec3::new(x.number(id, 0), y.number(id, 0), z.number(id, 0));
    // Flags that say in which image of the cell a particle is, rather than to which it should go: coordinates xu yu zu.
    let (applied, left) = (0..particles.len())
        .into_par_iter()
        .map(|id| {
            let image = lattice.only_periodic(flags(id));
            let is_there = lattice.image(particles.positions().world(id)) == image;
            if image == DVec3::ZERO { (0, 0) } else { (usize::from(is_there), usize::from(!is_there)) }
        })
        .reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    Ok((applied <= left).then(|| each(particles, |id, _| lattice.only_periodic(flags(id)))))
}

/// The particles, moved; their image flags count it.
fn moved_by(particles: Particles, lattice: &Lattice, edges: &[[i32; 3]]) -> Result<Particles> {
    let place = |id: usize| {
        let offset = particles.positions().offset(id);
        // What stays keeps its bits.
        match edges[id] {
            [0, 0, 0] => offset,
            edges => (offset.as_dvec3() + lattice.shift(edges.map(f64::from).into())).as_vec3(),
        }
    };
    let places: Vec<Vec3> = (0..particles.len()).into_par_iter().with_min_len(1 << 12).map(place).collect();
    let offsets = [0, 1, 2].map(|axis| places.par_iter().map(|place| place[axis]).collect());
    let mut flags = Vec::new();
    for (axis, name) in FLAGS.into_iter().enumerate() {
        let attribute = particles.attributes().iter().position(|it| it.name == name && it.components == 1);
        let Some(attribute) = attribute else { continue };
        let values = match particles.attributes()[attribute].values.view() {
            View::I32(flags) => {
                Values::I32(flags.iter().zip(edges).map(|(it, by)| it.wrapping_sub(by[axis])).collect())
            }
            View::I64(flags) => {
                Values::I64(flags.iter().zip(edges).map(|(it, by)| it - i64::from(by[axis])).collect())
            }
            _ => continue,
        };
        flags.push((attribute, values));
    }
    particles.moved(offsets, flags)
}

#[cfg(test)]
mod tests;
