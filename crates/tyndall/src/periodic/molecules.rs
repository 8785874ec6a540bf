//! Molecules: which particles belong together, and how they are made whole across the faces of a periodic cell.
//!
//! A particle follows one that it is bonded to, else the one before it in its molecule, at the image that is nearest to that one: chains
//! longer than half the cell stay whole, as long as neighbors in the file are neighbors in space.

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
    /// By place in `order` the place of the particle that one follows, in the same molecule; where there are no bonds, that before it.
    follows: Option<Vec<u32>>,
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
    /// Those of the particles: by a number of molecules, else residues and chains of them, and by bonds. Fails with [`Error::Setting`] if there are none of these.
    pub(super) fn of(particles: &Particles) -> Result<Self> {
        let groups = Self::named(particles);
        match (groups, particles.bonds()) {
            (None, []) => {
                let allowed = "atoms: the file has neither molecules (mol), residues (resid) nor bonds";
                Err(Error::setting("--wrap", "molecules", allowed))
            }
            (Some(groups), []) => Ok(groups),
            (groups, bonds) => Ok(Self::bonded(groups, particles.len(), bonds)),
        }
    }

    /// Those that have a number or a name.
    fn named(particles: &Particles) -> Option<Self> {
        let named = |names: &[&str]| {
            let whole = |it: &&Attribute| it.components == 1 && it.values.is_discrete();
            names.iter().find_map(|name| particles.attribute(name).filter(whole))
        };
        if let Some(numbers) = named(&MOLECULE_NAMES) {
            return Some(Self::numbered(numbers));
        }
        named(&RESIDUE_NAMES).map(|residues| {
            let beside: Vec<&Attribute> =
                CHAIN_NAMES.iter().filter_map(|name| particles.attribute(name)).collect();
            Self::residues(residues, particles.attribute("resname"), &beside)
        })
    }

    /// What bonds or `groups` hold together: within each, a particle follows one that it is bonded to, if it is to any.
    fn bonded(groups: Option<Self>, count: usize, bonds: &[[u32; 2]]) -> Self {
        let mut joined = Joined((0..count as u32).collect());
        for group in
            groups.iter().flat_map(|groups| groups.starts.windows(2).map(|at| &groups.order[at[0]..at[1]]))
        {
            group.windows(2).for_each(|pair| joined.join(pair[0], pair[1]));
        }
        bonds.iter().for_each(|&[one, other]| joined.join(one, other));
        let roots: Vec<u32> = (0..count as u32).map(|id| joined.root(id)).collect();
        let mut members: Vec<u32> = (0..count as u32).collect();
        members.par_sort_by_key(|&id| roots[id as usize]);

        // By particle whom it is bonded to.
        let mut both: Vec<[u32; 2]> =
            bonds.iter().flat_map(|&[one, other]| [[one, other], [other, one]]).collect();
        both.par_sort_unstable();
        let of = |id: u32| {
            let first = both.partition_point(|bond| bond[0] < id);
            both[first..].iter().take_while(move |bond| bond[0] == id).map(|bond| bond[1])
        };
        let mut is_placed = vec![false; count];
        let (mut order, mut follows) = (Vec::with_capacity(count), Vec::with_capacity(count));
        for &id in &members {
            if is_placed[id as usize] {
                continue;
            }
            // What is bonded to nothing before it follows the last.
            let place = order.len() as u32;
            let is_first = order.last().is_none_or(|&last: &u32| roots[last as usize] != roots[id as usize]);
            is_placed[id as usize] = true;
            order.push(id);
            follows.push(if is_first { place } else { place - 1 });
            let mut next = place as usize;
            while next < order.len() {
                for other in of(order[next]) {
                    if !std::mem::replace(&mut is_placed[other as usize], true) {
                        order.push(other);
                        follows.push(next as u32);
                    }
                }
                next += 1;
            }
        }
        let starts = starts(count, |at| roots[order[at] as usize] != roots[order[at - 1] as usize]);
        let by = groups.map_or("bonds".into(), |groups| format!("{} and bonds", groups.by));
        Self { order, starts, follows: Some(follows), by }
    }

    /// Those of one number, wherever they stand; 0 is none, so that each of these is alone (LAMMPS documentation of `read_data`).
    fn numbered(numbers: &Attribute) -> Self {
        let number = |id: u32| numbers.number(id as usize, 0);
        let mut order: Vec<u32> = (0..numbers.values.len() as u32).collect();
        // Stable: within a molecule the order is the file's.
        order.par_sort_by(|&a, &b| number(a).total_cmp(&number(b)));
        let is_first = |at: usize| number(order[at]) == 0.0 || number(order[at - 1]) != number(order[at]);
        let starts = starts(order.len(), is_first);
        Self { order, starts, follows: None, by: numbers.name.clone() }
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
        Self {
            order: (0..count as u32).collect(),
            starts: starts(count, is_first),
            follows: None,
            by: numbers.name.clone(),
        }
    }

    /// By how many edges each particle has to be moved to make molecules whole, with their middles in the cell.
    pub(super) fn whole(&self, particles: &Particles, lattice: &Lattice) -> Edges {
        let one = |ends: &[usize]| {
            let followed = |at: usize| match &self.follows {
                Some(follows) => follows[ends[0] + at] as usize - ends[0],
                None => at - 1,
            };
            whole_one(&self.order[ends[0]..ends[1]], followed, particles, lattice)
        };
        let whole: Vec<Vec<[i32; 3]>> = self.starts.par_windows(2).map(one).collect();
        let mut edges = vec![[0; 3]; self.order.len()];
        for (&id, by) in self.order.iter().zip(whole.iter().flatten()) {
            edges[id as usize] = *by;
        }
        edges
    }
}

/// Sets that are joined: by member another one, or itself where it is the root.
struct Joined(Vec<u32>);

impl Joined {
    fn root(&mut self, mut id: u32) -> u32 {
        while self.0[id as usize] != id {
            // The way becomes shorter for those who come after.
            self.0[id as usize] = self.0[self.0[id as usize] as usize];
            id = self.0[id as usize];
        }
        id
    }

    fn join(&mut self, one: u32, other: u32) {
        let (one, other) = (self.root(one), self.root(other));
        self.0[one.max(other) as usize] = one.min(other);
    }
}

/// Where runs begin among `count` things, and the end; the first of all begins one.
fn starts(count: usize, is_first: impl Fn(usize) -> bool) -> Vec<usize> {
    let first = (count > 0).then_some(0);
    first.into_iter().chain((1..count).filter(|&at| is_first(at))).chain([count]).collect()
}

/// By how many edges each particle of a molecule has to be moved; `followed` is whom it follows.
fn whole_one(
    members: &[u32],
    followed: impl Fn(usize) -> usize,
    particles: &Particles,
    lattice: &Lattice,
) -> Vec<[i32; 3]> {
    let places: Vec<DVec3> = members.iter().map(|&id| particles.positions().world(id as usize)).collect();
    let mut whole = places.clone();
    for at in 1..places.len() {
        let before = whole[followed(at)];
        whole[at] = before + lattice.nearest(places[at] - before);
    }
    let middle = whole.iter().sum::<DVec3>() / whole.len().max(1) as f64;
    let image = lattice.image(middle);
    let by = |(whole, place): (&DVec3, &DVec3)| counted(lattice.edges(*whole - *place) - image);
    whole.iter().zip(&places).map(by).collect()
}
