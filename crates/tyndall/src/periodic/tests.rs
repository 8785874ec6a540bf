//! Particles put elsewhere, against a search over all images and against where they were before they were folded.

use glam::{DMat3, DVec3};

use super::{FLAGS, Placement, place};
use crate::particles::{Attribute, Cell, Columns, Particles, Positions, Values};
use crate::random::Stream;

const CELLS: [Cell; 4] = [
    Cell {
        origin: DVec3::ZERO,
        vectors: [DVec3::new(6.0, 0.0, 0.0), DVec3::new(0.0, 7.0, 0.0), DVec3::new(0.0, 0.0, 8.0)],
        periodic: [true; 3],
    },
    Cell {
        origin: DVec3::new(-3.0, 1.0, 2.0),
        vectors: [DVec3::new(6.0, 0.0, 0.0), DVec3::new(2.5, 7.0, 0.0), DVec3::new(-1.5, 3.0, 8.0)],
        periodic: [true; 3],
    },
    Cell {
        origin: DVec3::new(1.0, 1.0, -9.0),
        vectors: [DVec3::new(6.0, 1.0, 0.5), DVec3::new(-1.0, 7.0, 2.0), DVec3::new(1.0, 0.0, 8.0)],
        periodic: [true, true, false],
    },
    Cell {
        origin: DVec3::ZERO,
        vectors: [DVec3::new(6.0, 0.0, 0.0), DVec3::new(3.0, 7.0, 0.0), DVec3::ZERO],
        periodic: [true, true, false],
    },
];

fn particles(places: &[DVec3], cell: Option<Cell>, attributes: Vec<Attribute>) -> Particles {
    let mut positions = Positions::around(DVec3::new(0.5, -0.25, 0.125));
    positions.extend(places);
    Particles::new(Columns { positions, attributes, cell, ..Columns::default() }).unwrap()
}

fn worlds(particles: &Particles) -> Vec<DVec3> {
    (0..particles.len()).map(|id| particles.positions().world(id)).collect()
}

/// The image flags, one column an axis.
fn flags(edges: &[[i32; 3]]) -> Vec<Attribute> {
    let column = |axis: usize| Values::I32(edges.iter().map(|it| it[axis]).collect());
    (0..3).map(|axis| Attribute::new(FLAGS[axis], 1, column(axis))).collect()
}

/// Edges by which a point is moved at random, along those that repeat.
fn random_edges(cell: &Cell, stream: &mut Stream) -> [i32; 3] {
    let any = (4.0 * stream.cube()).round().to_array();
    std::array::from_fn(|axis| if cell.periodic[axis] { any[axis] as i32 } else { 0 })
}

fn shift(cell: &Cell, edges: [i32; 3]) -> DVec3 {
    (0..3).map(|axis| f64::from(edges[axis]) * cell.vectors[axis]).sum()
}

fn inside(cell: &Cell, stream: &mut Stream) -> DVec3 {
    // Not so near a face that single precision rounds it over.
    let at = 0.5 + 0.48 * stream.cube().as_dvec3();
    cell.origin + (0..3).map(|axis| at[axis] * cell.vectors[axis]).sum::<DVec3>()
}

#[test]
fn atoms_go_to_their_image_in_the_cell_and_come_back_by_their_flags() {
    for (number, cell) in CELLS.iter().enumerate() {
        let mut stream = Stream::new(40, number as u64);
        let wanted: Vec<DVec3> = (0..300).map(|_| inside(cell, &mut stream)).collect();
        let edges: Vec<[i32; 3]> = wanted.iter().map(|_| random_edges(cell, &mut stream)).collect();
        let far: Vec<DVec3> =
            wanted.iter().zip(&edges).map(|(it, edges)| *it + shift(cell, *edges)).collect();
        let before = particles(&far, Some(*cell), flags(&[[0; 3]; 300]));
        let (wrapped, text) = place(before.clone(), Placement::Atoms).unwrap();
        for (found, wanted) in worlds(&wrapped).iter().zip(&wanted) {
            assert!(found.abs_diff_eq(*wanted, 1e-4), "cell {number}: {found} is not {wanted}");
        }
        let moved = edges.iter().filter(|edges| **edges != [0; 3]).count();
        assert_eq!(text.unwrap(), format!("in the cell: {moved} of 300 moved"));
        assert_eq!(wrapped.attributes(), flags(&edges), "where they were is not forgotten");
        assert_eq!(wrapped.bounds(), particles(&worlds(&wrapped), None, Vec::new()).bounds());

        let (back, _) = place(wrapped.clone(), Placement::Unwrapped).unwrap();
        for (found, wanted) in worlds(&back).iter().zip(&far) {
            assert!(found.abs_diff_eq(*wanted, 1e-4), "cell {number}: {found} is not {wanted}");
        }
        assert_eq!(back.attributes(), flags(&[[0; 3]; 300]));
        // Twice is once.
        let (again, _) = place(wrapped.clone(), Placement::Atoms).unwrap();
        assert_eq!(again.positions(), wrapped.positions());
    }
}

#[test]
fn flags_that_have_been_applied_are_not_applied_again() {
    let cell = CELLS[1];
    let mut stream = Stream::new(41, 0);
    let edges: Vec<[i32; 3]> = (0..50).map(|_| random_edges(&cell, &mut stream)).collect();
    let far: Vec<DVec3> =
        edges.iter().map(|edges| inside(&cell, &mut stream) + shift(&cell, *edges)).collect();
    let before = particles(&far, Some(cell), flags(&edges));
    let (after, text) = place(before.clone(), Placement::Unwrapped).unwrap();
    assert_eq!((after.positions(), after.attributes()), (before.positions(), before.attributes()));
    assert!(text.unwrap().contains("already"));
}

/// Chains that wander through the cell, longer than half of it, of particles that lie up to 1.5 apart.
fn chains(cell: &Cell, stream: &mut Stream) -> Vec<Vec<DVec3>> {
    let step = |stream: &mut Stream| 1.5 * f64::from(stream.unit()) * stream.direction().as_dvec3();
    (0..40)
        .map(|number| {
            let start = inside(cell, stream);
            let mut chain = vec![start];
            for _ in 0..number % 13 {
                chain.push(chain[chain.len() - 1] + step(stream));
            }
            chain
        })
        .collect()
}

#[test]
fn molecules_become_whole_and_their_middles_lie_in_the_cell() {
    for (number, cell) in CELLS.iter().enumerate() {
        let mut stream = Stream::new(42, number as u64);
        let chains = chains(cell, &mut stream);
        // Molecule ids stand in any order; residues one after the other.
        let (mut places, mut mol, mut resid) = (Vec::new(), Vec::new(), Vec::new());
        for (number, chain) in chains.iter().enumerate() {
            for it in chain {
                places.push(*it + shift(cell, random_edges(cell, &mut stream)));
                mol.push(1000 - number as i32);
                // The same number again is another residue of the next chain.
                resid.push(number as i32 / 2);
            }
        }
        let codes =
            chains.iter().enumerate().flat_map(|(at, chain)| chain.iter().map(move |_| at as u32 % 2));
        let names = vec!["A".to_string(), "B".to_string()];
        let by_residue = vec![
            Attribute::new("resid", 1, Values::I32(resid)),
            Attribute::new("chain", 1, Values::Text { codes: codes.collect(), names }),
        ];
        let by_molecule = vec![Attribute::new("mol", 1, Values::I32(mol))];
        for attributes in [by_molecule, by_residue] {
            let before = particles(&places, Some(*cell), attributes);
            let (after, text) = place(before.clone(), Placement::Molecules).unwrap();
            assert!(text.unwrap().starts_with("molecules by "));
            let (after, mut at) = (worlds(&after), 0);
            for chain in &chains {
                let found = &after[at..at + chain.len()];
                let moved = found[0] - chain[0];
                for (found, chain) in found.iter().zip(chain) {
                    assert!((*found - moved).abs_diff_eq(*chain, 1e-3), "cell {number}: a chain is torn");
                }
                let middle = found.iter().sum::<DVec3>() / found.len() as f64;
                let (folded, _) =
                    place(particles(&[middle], Some(*cell), Vec::new()), Placement::Atoms).unwrap();
                assert!(
                    folded.positions().world(0).abs_diff_eq(middle, 1e-3),
                    "cell {number}: {middle} is outside"
                );
                at += chain.len();
            }
        }
    }
}

#[test]
fn residues_of_a_protein_are_a_chain_and_waters_are_not() {
    let resnames = ["NALA", "GLY", "CHIE", "SOL", "SOL", "ALA", "DA5"].map(String::from).to_vec();
    let attributes = vec![
        // The last amino acid is numbered anew: another chain.
        Attribute::new("resid", 1, Values::I32(vec![1, 2, 3, 4, 5, 1, 2])),
        Attribute::new("resname", 1, Values::Text { codes: (0..7).collect(), names: resnames }),
    ];
    let places = [4.25, 0.75, 3.25, 1.75, 4.25, 0.75, 5.5].map(|x| DVec3::new(x, 1.0, 1.0));
    let before = particles(&places, Some(CELLS[0]), attributes);
    let (after, _) = place(before, Placement::Molecules).unwrap();
    let x: Vec<f64> = worlds(&after).iter().map(|it| it.x).collect();
    assert_eq!(x, [-1.75, 0.75, 3.25, 1.75, 4.25, 0.75, -0.5]);
}

#[test]
fn bonds_say_whom_a_particle_follows() {
    for (number, cell) in CELLS.iter().enumerate() {
        let mut stream = Stream::new(43, number as u64);
        // Trees: each particle is bonded to any before it, so that the one before in the file may be far.
        let (mut wanted, mut bonds, mut trees) = (Vec::new(), Vec::new(), Vec::new());
        for size in [1, 2, 3, 8, 30] {
            let first = wanted.len();
            wanted.push(inside(cell, &mut stream));
            for at in 1..size {
                let other = first + (stream.unit() * at as f32) as usize;
                let step = 1.5 * f64::from(stream.unit()) * stream.direction().as_dvec3();
                bonds.push([(first + at) as u32, other as u32]);
                wanted.push(wanted[other] + step);
            }
            trees.push(first..wanted.len());
        }
        let places: Vec<DVec3> =
            wanted.iter().map(|it| *it + shift(cell, random_edges(cell, &mut stream))).collect();
        let mut positions = Positions::around(DVec3::ZERO);
        positions.extend(&places);
        let columns = Columns { positions, cell: Some(*cell), bonds, ..Columns::default() };
        let (after, text) = place(Particles::new(columns).unwrap(), Placement::Molecules).unwrap();
        assert!(text.unwrap().starts_with("molecules by bonds, whole"));
        let after = worlds(&after);
        for tree in trees {
            let moved = after[tree.start] - wanted[tree.start];
            for id in tree {
                assert!(
                    (after[id] - moved).abs_diff_eq(wanted[id], 1e-3),
                    "cell {number}: a molecule is torn"
                );
            }
        }
    }
}

#[test]
fn molecule_zero_is_none() {
    let mol = vec![Attribute::new("mol", 1, Values::I32(vec![0, 0, 7, 7]))];
    let places = [DVec3::splat(0.5), DVec3::new(5.5, 0.5, 0.5), DVec3::splat(0.5), DVec3::new(5.8, 0.5, 0.5)];
    let before = particles(&places, Some(CELLS[0]), mol);
    let (after, _) = place(before, Placement::Molecules).unwrap();
    let x: Vec<f64> = worlds(&after).iter().map(|it| (it.x * 1e3).round() / 1e3).collect();
    assert_eq!(x, [0.5, 5.5, 0.5, -0.2]);
}

#[test]
fn what_cannot_be_placed_says_what_is_missing() {
    let none = particles(&[DVec3::ZERO], None, Vec::new());
    let bare = particles(&[DVec3::ZERO], Some(CELLS[0]), Vec::new());
    let refused =
        |particles: &Particles, placement| place(particles.clone(), placement).unwrap_err().to_string();
    assert!(
        refused(&none, Placement::Atoms)
            .contains("--wrap cannot be 'atoms' — left out for this file: it has no cell")
    );
    assert!(refused(&none, Placement::Unwrapped).starts_with("--unwrap cannot be 'on'"));
    assert!(
        refused(&bare, Placement::Molecules)
            .contains("atoms: the file has neither molecules (mol), residues (resid) nor bonds")
    );
    assert!(refused(&bare, Placement::Unwrapped).contains("no image flags ix iy iz — --wrap molecules"));
    let (same, text) = place(none.clone(), Placement::AsStored).unwrap();
    assert_eq!((same.positions(), text), (none.positions(), None));
    let empty = particles(&[], Some(CELLS[0]), vec![Attribute::new("mol", 1, Values::I32(Vec::new()))]);
    for placement in [Placement::Atoms, Placement::Molecules] {
        assert!(place(empty.clone(), placement).unwrap().0.is_empty());
    }
}

mod centers {
    use super::*;
    use crate::periodic::center::{around, densest, middle};

    /// The nearest distance of two points among all images.
    fn distance(cell: Option<&Cell>, a: DVec3, b: DVec3) -> f64 {
        let Some(cell) = cell else { return a.distance(b) };
        let range = |axis: usize| if cell.periodic[axis] { -3..=3 } else { 0..=0 };
        let mut least = f64::INFINITY;
        for x in range(0) {
            for y in range(1) {
                for z in range(2) {
                    least = least.min((a - b + shift(cell, [x, y, z])).length());
                }
            }
        }
        least
    }

    #[test]
    fn a_clump_across_the_border_is_found_and_whole() {
        for (seed, cell) in CELLS.iter().map(Some).chain([None]).enumerate() {
            println!("seed {seed}");
            let mut stream = Stream::new(seed as u64, 3);
            let any = |stream: &mut Stream| match cell {
                Some(cell) => inside(cell, stream),
                None => 5.0 * stream.cube().as_dvec3(),
            };
            // The corner of the cell is at its border; of open ones a place within.
            let clump = cell.map_or(DVec3::new(1.0, -2.0, 0.5), |cell| {
                let inner = (0..3).filter(|&axis| !cell.periodic[axis]).map(|axis| 0.4 * cell.vectors[axis]);
                cell.origin + inner.sum::<DVec3>()
            });
            let flat = cell.is_some_and(|cell| cell.vectors[2] == DVec3::ZERO);
            let mut places: Vec<DVec3> = (0..2000).map(|_| any(&mut stream)).collect();
            places.extend((0..300).map(|_| {
                let offset = 0.05 * stream.cube().as_dvec3();
                clump + if flat { offset.with_z(0.0) } else { offset }
            }));
            let given = particles(&places, cell.copied(), flags(&vec![[0; 3]; places.len()]));
            let given = match cell {
                Some(_) => place(given, Placement::Atoms).unwrap().0,
                None => given,
            };
            let found = densest(&given).unwrap();
            assert!(distance(cell, found, clump) < 0.05, "{found} is not {clump}");
            let ids: Vec<u32> = (2000..2300).collect();
            let found = middle(&given, &ids).unwrap();
            assert!(distance(cell, found, clump) < 0.02, "{found} is not {clump}");

            let (seen, text) = around(given.clone(), found, Placement::AsStored).unwrap();
            let near = worlds(&seen)[2000..].iter().all(|it| it.length() < 0.12);
            assert!(near && text.is_some() == cell.is_some(), "the clump is whole, around 0: {text:?}");
            if let Some(Cell { origin, vectors: [a, b, c], periodic }) = seen.cell() {
                let c = if flat { DVec3::Z } else { *c };
                let zero = DMat3::from_cols(*a, *b, c).inverse() * -*origin;
                let halves =
                    (0..3).filter(|&axis| periodic[axis]).all(|axis| (zero[axis] - 0.5).abs() < 1e-9);
                assert!(halves, "the center is the middle of the cell: {zero}");
            }
            let by = |a: &DVec3, b: &DVec3| distance(cell, *a, *b + found) < 1e-5;
            assert!(
                worlds(&given).iter().zip(&worlds(&seen)).all(|(a, b)| by(a, b)),
                "each is an image of what it was"
            );
        }
    }

    #[test]
    fn without_a_box_nothing_but_the_zero_changes() {
        let places = [DVec3::ZERO, DVec3::new(5.0, 1.0, -3.0)];
        let (seen, text) =
            around(particles(&places, None, Vec::new()), DVec3::new(1e6, 0.0, 2.0), Placement::AsStored)
                .unwrap();
        assert_eq!(worlds(&seen), [DVec3::new(-1e6, 0.0, -2.0), DVec3::new(5.0 - 1e6, 1.0, -5.0)]);
        assert_eq!(text, None);
    }

    #[test]
    fn few_particles_have_a_densest_place_too() {
        let of = |places: &[DVec3]| densest(&particles(places, None, Vec::new()));
        assert_eq!(of(&[]), None);
        assert_eq!(of(&[DVec3::new(1.0, 2.0, 3.0)]), Some(DVec3::new(1.0, 2.0, 3.0)));
        assert_eq!(of(&[DVec3::ONE; 1000]), Some(DVec3::ONE));
        let far = of(&[DVec3::ZERO, DVec3::X * 1e30, DVec3::ZERO]).unwrap();
        assert!(far.length() < 1e-3, "{far}");
        assert_eq!(middle(&particles(&[DVec3::ONE], None, Vec::new()), &[]), None);
    }
}
