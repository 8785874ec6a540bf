//! Molecules: which particles belong together, and how they are made whole across the faces of a periodic cell.
//!
//! A particle follows the one before it in its molecule, at the image that is nearest to that one: chains longer than half the cell stay
//! whole, as long as neighbors in the file are neighbors in space.

use glam::DVec3;
use rayon::prelude::*;

use super::lattice::Lattice;
use super::{Edges, counted};
use crate::error::{Error, Result};
use crate::particles::{Attribute, Particles};

/// See the module.
pub(super) struct Molecules {
    /// All particles, molecule by molecule.
    order: Vec<u32>,
    /// Where each molecule begins in it, and the end.
    starts: Vec<usize>,
    /// What says who belongs together.
    pub(super) by: String,
}

/// Names of numbers of molecules: LAMMPS dumps and data files, other programs.
const MOLECULE_NAMES: [&str; 4] = ["mol", "molecule", "molecule_id", "mol_id"];
/// Names of the numbers of residues, and of what else tells two residues apart.
const RESIDUE_NAMES: [&str; 3] = ["resid", "residue", "residue_number"];
const BESIDE_NAMES: [&str; 5] = ["chain", "asym", "segment", "resname", "icode"];

impl Molecules {
    /// Those of the particles: by a number of molecules, else residues. Fails with [`Error::Setting`] if there are neither.
    pub(super) fn of(particles: &Particles) -> Result<Self> {
        let named = |names: &[&str]| {
            let whole = |it: &&Attribute| it.components == 1 && it.values.is_discrete();
            names.iter().find_map(|name| particles.attribute(name).filter(whole))
        };
        if let Some(numbers) = named(&MOLECULE_NAMES) {
            return Ok(Self::numbered(numbers));
        }
        if let Some(residues) = named(&RESIDUE_NAMES) {
            let beside = BESIDE_NAMES.iter().filter_map(|name| particles.attribute(name));
            return Ok(Self::runs(&std::iter::once(residues).chain(beside).collect::<Vec<_>>()));
        }
        let allowed = "atoms: the file has neither molecules (mol) nor residues (resid)";
        Err(Error::setting("--wrap", "molecules", allowed))
    }

    /// Those of one number, wherever they stand; 0 is none, so that each of these is alone (LAMMPS documentation of `read_data`).
    fn numbered(numbers: &Attribute) -> Self {
        let number = |id: u32| numbers.number(id as usize, 0);
        let mut order: Vec<u32> = (0..numbers.values.len() as u32).collect();
        // Stable: within a molecule the order is the file's.
        order.par_sort_by(|&a, &b| number(a).total_cmp(&number(b)));
        let is_first = |at: usize| number(order[at]) == 0.0 || number(order[at - 1]) != number(order[at]);
        let starts = starts(order.len(), is_first);
        Self { order, starts, by: numbers.name.clone() }
    }

    /// Runs of particles that have all of these in common.
    fn runs(common: &[&Attribute]) -> Self {
        let count = common[0].values.len();
        let differs = |at: usize, it: &&Attribute| it.number(at, 0) != it.number(at - 1, 0);
        let starts = starts(count, |at| common.iter().any(|it| differs(at, it)));
        Self { order: (0..count as u32).collect(), starts, by: common[0].name.clone() }
    }

    /// By how many edges each particle has to be moved to make molecules whole, with their middles in the cell.
    pub(super) fn whole(&self, particles: &Particles, lattice: &Lattice) -> Edges {
        let members = self.starts.par_windows(2).map(|ends| &self.order[ends[0]..ends[1]]);
        let whole: Vec<Vec<[i32; 3]>> =
            members.map(|members| whole_one(members, particles, lattice)).collect();
        let mut edges = vec![[0; 3]; self.order.len()];
        for (&id, by) in self.order.iter().zip(whole.iter().flatten()) {
            edges[id as usize] = *by;
        }
        edges
    }
}

/// Where runs begin among `count` things, and the end; the first of all begins one.
fn starts(count: usize, is_first: impl Fn(usize) -> bool) -> Vec<usize> {
    let first = (count > 0).then_some(0);
    first.into_iter().chain((1..count).filter(|&at| is_first(at))).chain([count]).collect()
}

fn whole_one(members: &[u32], particles: &Particles, lattice: &Lattice) -> Vec<[i32; 3]> {
    let places: Vec<DVec3> = members.iter().map(|&id| particles.positions().world(id as usize)).collect();
    let mut whole = places.clone();
    for at in 1..places.len() {
        whole[at] = whole[at - 1] + lattice.nearest(places[at] - whole[at - 1]);
    }
    let middle = whole.iter().sum::<DVec3>() / whole.len().max(1) as f64;
    let image = lattice.image(middle);
    let by = |(whole, place): (&DVec3, &DVec3)| counted(lattice.edges(*whole - *place) - image);
    whole.iter().zip(&places).map(by).collect()
}
