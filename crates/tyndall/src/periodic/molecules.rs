//! Molecules: which particles belong together, and how they are made whole across the faces of a periodic cell.
//!
//! A particle follows the one before it in its molecule, at the image that is nearest to that one: chains longer than half the cell stay
//! whole, as long as neighbors in the file are neighbors in space.

use glam::DVec3;
use rayon::prelude::*;

use super::lattice::Lattice;
use super::{Edges, counted};
use crate::error::{Error, Result};
use crate::particles::{Attribute, Particles, View};

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
/// Names of the numbers of residues, and of what else tells chains apart.
const RESIDUE_NAMES: [&str; 3] = ["resid", "residue", "residue_number"];
const CHAIN_NAMES: [&str; 3] = ["chain", "asym", "segment"];
/// Residues that are links of chains: amino acids with the protonation states of the AMBER, CHARMM and OPLS force fields, their caps,
/// and nucleotides.
const LINKS: &str = " ALA ARG ASN ASP CYS GLN GLU GLY HIS ILE LEU LYS MET PHE PRO SER THR TRP TYR VAL ASH GLH LYN CYM CYX HID HIE HIP \
    HSD HSE HSP HISD HISE HISH HIS1 HIS2 LYSH ARGN ASPH GLUH CYS2 CYSH MSE SEC PYL ACE NME NMA NH2 NAC A C G U T I DA DC DG DT DU ADE CYT GUA THY URA \
    RA RC RG RU ";

/// Whether a residue of this name is a link of a chain; with N, C or 5, 3 where it ends one.
fn is_link(name: &str) -> bool {
    let is_known = |name: &str| !name.is_empty() && LINKS.contains(&format!(" {name} "));
    let name = name.trim();
    let inside =
        name.strip_suffix(['5', '3']).or_else(|| name.strip_prefix(['N', 'C']).filter(|it| it.len() == 3));
    is_known(name) || inside.is_some_and(is_known)
}

impl Molecules {
    /// Those of the particles: by a number of molecules, else residues and chains of them. Fails with [`Error::Setting`] if there are neither.
    pub(super) fn of(particles: &Particles) -> Result<Self> {
        let named = |names: &[&str]| {
            let whole = |it: &&Attribute| it.components == 1 && it.values.is_discrete();
            names.iter().find_map(|name| particles.attribute(name).filter(whole))
        };
        if let Some(numbers) = named(&MOLECULE_NAMES) {
            return Ok(Self::numbered(numbers));
        }
        if let Some(residues) = named(&RESIDUE_NAMES) {
            let beside: Vec<&Attribute> =
                CHAIN_NAMES.iter().filter_map(|name| particles.attribute(name)).collect();
            return Ok(Self::residues(residues, particles.attribute("resname"), &beside));
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

    /// Runs of particles of one residue. Residues of proteins and nucleic acids that follow each other in number are a chain.
    fn residues(numbers: &Attribute, names: Option<&Attribute>, beside: &[&Attribute]) -> Self {
        let count = numbers.values.len();
        let links: Vec<bool> = match names.map(|it| it.values.view()) {
            Some(View::Text { names, .. }) => names.iter().map(|name| is_link(name)).collect(),
            _ => Vec::new(),
        };
        let is_link = |at: usize| {
            names.is_some_and(|names| links.get(names.number(at, 0) as usize).copied().unwrap_or_default())
        };
        let is_first = |at: usize| {
            let differs = |it: &&Attribute| it.number(at, 0) != it.number(at - 1, 0);
            let step = numbers.number(at, 0) - numbers.number(at - 1, 0);
            let follows = (0.0..=1.0).contains(&step) && is_link(at) && is_link(at - 1);
            beside.iter().any(differs) || !follows && (step != 0.0 || names.iter().any(differs))
        };
        Self { order: (0..count as u32).collect(), starts: starts(count, is_first), by: numbers.name.clone() }
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
