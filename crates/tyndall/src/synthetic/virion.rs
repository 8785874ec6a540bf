//! `virion` (angstrom): an enveloped virus of atoms: a lipid double layer, a shell of protein lumps over it, and spikes.
//!
//! Proteins are chains of residues of eight atoms at the density of proteins (one residue in 135 cubic angstrom). Lumps and
//! spikes are turned copies of a few templates, spikes in three chains. At another count than the published one, all lengths
//! but those between atoms scale with its cube root, so that the density stays. Attributes: `element`, with its radius
//! (A. Bondi 1964), and `chain`: 0 for lipids, a lump's number, then three a spike.

use std::f32::consts::{PI, TAU};

use glam::{DVec3, Mat3, Vec3};
use rayon::prelude::*;

use super::{Filled, Kind, Law, Particle, Plan, TABLES, ends};
use crate::particles::Radii;
use crate::random::Stream;

/// Shares of lipids, shell and spikes.
pub(super) const SHARES: [f64; 3] = [0.48, 0.22, 0.30];
const PUBLISHED: f64 = 14_566_669.0;
/// The elements in the order of their codes, and their radii.
const ELEMENTS: &[&str] = &["C", "N", "O", "S"];
const RADII: [f32; 4] = [1.70, 1.55, 1.52, 1.80];
const CARBON: u8 = 0;
const NITROGEN: u8 = 1;
const OXYGEN: u8 = 2;
const SULFUR: u8 = 3;
/// Middle of the shell, whose thickness is 40.
const SHELL: f32 = 450.0;
const LUMPS: usize = 1600;
/// Middles of the two lipid layers, and their thickness.
const LAYERS: [f32; 2] = [396.0, 420.0];
const LAYER: f32 = 19.0;
const LIPID_ATOMS: f64 = 32.0;
/// Where spikes begin; they are 200 long.
const ROOT: f32 = 462.0;
/// Edge of a cube that holds a residue, and the atoms of a residue.
const RESIDUE: f32 = 5.13;
const RESIDUE_ATOMS: usize = 8;

struct Virion {
    seed: u64,
    ends: [u64; 3],
    /// Lengths over those of the published count.
    scale: f32,
    /// Atoms of a lipid.
    lipid: u64,
    lumps: Copies,
    spikes: Copies,
}

/// Turned and moved copies of templates, all of the same number of atoms, up to one.
struct Copies {
    templates: Vec<Vec<Atom>>,
    /// A copy's template, orientation and place.
    placed: Vec<(usize, Mat3, Vec3)>,
}

#[derive(Clone, Copy)]
struct Atom {
    position: Vec3,
    element: u8,
    /// Which of its protein's chains.
    chain: u8,
}

pub(super) fn plan(count: u64, seed: u64) -> Plan<'static> {
    let ends = ends(count, SHARES);
    let scale = (count.max(1) as f64 / PUBLISHED).cbrt();
    let lipid = (LIPID_ATOMS * scale).round().max(1.0) as u64;
    let scale = scale as f32;
    let mut stream = Stream::new(seed, TABLES);
    let lumps = lumps(ends[1] - ends[0], scale, &mut stream);
    let spikes = spikes(ends[2] - ends[1], scale, &mut stream);
    let element = Filled { name: "element", unit: None, kind: Kind::Words(ELEMENTS) };
    let chain = Filled { name: "chain", unit: None, kind: Kind::Whole };
    Plan {
        law: Box::new(Virion { seed, ends, scale, lipid, lumps, spikes }),
        radii: Radii::PerType { attribute: 0, radii: RADII.to_vec() },
        attributes: vec![element, chain],
        cell: None,
        length_unit: Some("Å"),
    }
}

/// Direction `k` of `count` that cover the sphere evenly (a Fibonacci lattice: R. Swinbank, R. J. Purser 2006).
fn even_direction(k: u64, count: u64) -> Vec3 {
    let z = 1.0 - (2.0 * k as f64 + 1.0) / count as f64;
    let across = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = (2.399_963_229_728_653 * k as f64 % std::f64::consts::TAU).sin_cos();
    DVec3::new(across * cos, across * sin, z).as_vec3()
}

/// A frame whose third axis is `up`, turned about it at random.
fn frame(up: Vec3, stream: &mut Stream) -> Mat3 {
    let (u, v) = up.any_orthonormal_pair();
    let (sin, cos) = (TAU * stream.unit()).sin_cos();
    Mat3::from_cols(u * cos + v * sin, v * cos - u * sin, up)
}

/// Domains side by side: blobs of four balls, flat enough for the shell.
fn lumps(count: u64, scale: f32, stream: &mut Stream) -> Copies {
    let atoms = count.div_ceil(LUMPS as u64) as usize;
    let templates = (0..16u64)
        .map(|number| {
            let ball = |_| {
                let center = stream.cube() * Vec3::new(11.0, 11.0, 9.0);
                (scale * center, scale * stream.range(9.0, 13.0))
            };
            let balls: [(Vec3, f32); 4] = std::array::from_fn(ball);
            let field = move |point: Vec3| {
                let outside = |(center, radius): &(Vec3, f32)| point.distance(*center) - radius;
                (balls.iter().map(outside).fold(f32::INFINITY, f32::min), 0)
            };
            (number, field)
        })
        .collect::<Vec<_>>()
        .into_par_iter()
        .map(|(number, field)| {
            template(field, Vec3::splat(-28.0 * scale), Vec3::splat(28.0 * scale), atoms, number)
        })
        .collect();
    let placed = (0..LUMPS).map(|lump| {
        let tilt = 0.012 * stream.normal3();
        let up = (even_direction(lump as u64, LUMPS as u64) + tilt).normalize_or(Vec3::Z);
        let height = SHELL + 2.5 * stream.normal().clamp(-2.0, 2.0);
        (stream.below(16), frame(up, stream), scale * height * up)
    });
    Copies { placed: placed.collect(), templates }
}

/// From 70 to 100 spikes: a stalk, bent a little, and a head of three lobes around it, wider at the top.
fn spikes(count: u64, scale: f32, stream: &mut Stream) -> Copies {
    let spikes = 70 + stream.below(31);
    let atoms = count.div_ceil(spikes as u64) as usize;
    let templates = (0..4u64)
        .map(|number| {
            let bend = 8.0 * stream.normal();
            let open = stream.range(0.0, 10.0);
            (number, move |point: Vec3| spike(point / scale, bend, open, scale))
        })
        .collect::<Vec<_>>()
        .into_par_iter()
        .map(|(number, field)| {
            let (low, high) = (Vec3::new(-90.0, -90.0, -20.0), Vec3::new(90.0, 90.0, 225.0));
            template(field, scale * low, scale * high, atoms, 100 + number)
        })
        .collect();
    let mut ups: Vec<Vec3> = Vec::with_capacity(spikes);
    for _ in 0..spikes {
        // The candidate farthest from the spikes that stand already (D. Mitchell 1991), of few: not too even.
        let crowded = |up: &Vec3| ups.iter().map(|it| it.dot(*up)).fold(-1.0, f32::max);
        let candidates: [Vec3; 6] = std::array::from_fn(|_| stream.direction());
        let best = candidates.into_iter().min_by(|a, b| crowded(a).total_cmp(&crowded(b)));
        ups.push(best.unwrap_or(Vec3::Z));
    }
    let placed = ups.into_iter().map(|up| {
        let leaning = (up + 0.12 * stream.normal3()).normalize_or(up);
        (stream.below(4), frame(leaning, stream), scale * ROOT * up)
    });
    Copies { placed: placed.collect(), templates }
}

/// How far `point` lies outside a spike that stands on the origin along z (negative inside), times `scale`, and which of its
/// three chains is nearest.
fn spike(point: Vec3, bend: f32, open: f32, scale: f32) -> (f32, u8) {
    let stalk_axis = Vec3::new(bend * (PI * point.z / 95.0).sin(), 0.0, point.z.clamp(-10.0, 105.0));
    let stalk = point.distance(stalk_axis) - 12.0;
    let mut nearest = (f32::INFINITY, 0);
    for chain in 0..3u8 {
        let (sin, cos) = (TAU / 3.0 * f32::from(chain)).sin_cos();
        let outward = Vec3::new(cos, sin, 0.0);
        let (low, high) = (20.0 * outward + Vec3::Z * 112.0, 34.0 * outward + Vec3::Z * 158.0);
        let along = ((point - low).dot(high - low) / (high - low).length_squared()).clamp(0.0, 1.0);
        let lobe = point.distance(low.lerp(high, along)) - (19.0 + 12.0 * along);
        // One chain's tip may stand up.
        let lift = if chain == 0 { open } else { 0.0 };
        let tip = point.distance(27.0 * outward + Vec3::Z * (175.0 + lift)) - 22.0;
        let thread = (stalk_axis + 6.0 * outward).distance(point) - 6.0;
        let outside = lobe.min(tip).min(if point.z < 110.0 { thread.max(stalk) } else { stalk });
        if outside < nearest.0 {
            nearest = (outside, chain);
        }
    }
    (scale * nearest.0.min(stalk), nearest.1)
}

/// At least `atoms` atoms of a protein that fills the places where `field` is lowest, the innermost residues first. `field`
/// gives that order and a residue's chain; the box should hold a shape of so many atoms.
fn template(
    field: impl Fn(Vec3) -> (f32, u8),
    mut low: Vec3,
    mut high: Vec3,
    atoms: usize,
    number: u64,
) -> Vec<Atom> {
    let residues = atoms.div_ceil(RESIDUE_ATOMS);
    let mut stream = Stream::new(number, TABLES);
    let mut sites = Vec::new();
    while sites.len() < residues {
        sites.clear();
        let counts = ((high - low) / RESIDUE).ceil().as_uvec3();
        for (x, y, z) in
            (0..counts.x).flat_map(|x| (0..counts.y).flat_map(move |y| (0..counts.z).map(move |z| (x, y, z))))
        {
            let cell = Vec3::new(x as f32, y as f32, z as f32) + 0.5;
            let point = low + RESIDUE * (cell + 0.3 * stream.cube());
            let (outside, chain) = field(point);
            sites.push((outside, chain, point));
        }
        (low, high) = (low - RESIDUE, high + RESIDUE);
    }
    sites.sort_by(|a, b| a.0.total_cmp(&b.0));
    sites.truncate(residues);
    sites.into_iter().flat_map(|(_, chain, center)| residue(center, chain, &mut stream)).collect()
}

/// Eight atoms about `center`: the backbone N C C O, and a side chain of four.
fn residue(center: Vec3, chain: u8, stream: &mut Stream) -> [Atom; RESIDUE_ATOMS] {
    const BOND: f32 = 1.5;
    let end = match stream.unit() {
        it if it < 0.05 => SULFUR,
        it if it < 0.40 => NITROGEN,
        it if it < 0.85 => OXYGEN,
        _ => CARBON,
    };
    let elements = [NITROGEN, CARBON, CARBON, OXYGEN, CARBON, CARBON, CARBON, end];
    let along = stream.direction();
    let (across, _) = along.any_orthonormal_pair();
    let mut tip = 0.4 * across;
    std::array::from_fn(|place| {
        let offset = match place {
            0..3 => BOND * (place as f32 - 1.0) * along - 0.4 * across,
            3 => BOND * (along - 0.8 * across),
            // The side chain wanders off on the other side.
            _ => {
                tip += BOND * (0.5 * across + 0.8 * stream.direction()).normalize_or(across);
                tip - 0.8 * across
            }
        };
        Atom { position: center + offset, element: elements[place], chain }
    })
}

impl Copies {
    /// Atom `place` of `count` in all: it, its position in the world, and the number of its copy.
    fn atom(&self, place: u64, count: u64) -> (Atom, Vec3, usize) {
        let copies = self.placed.len() as u128;
        let copy = u128::from(place) * copies / u128::from(count);
        let before = (copy * u128::from(count)).div_ceil(copies) as u64;
        let (template, turn, origin) = &self.placed[copy as usize];
        let atom = self.templates[*template][(place - before) as usize];
        (atom, *origin + *turn * atom.position, copy as usize)
    }
}

impl Virion {
    /// Atom `k` of the lipids, which stand side by side in two layers, heads out: its element and position.
    fn lipid_atom(&self, k: u64) -> (u8, Vec3) {
        let count = self.ends[0].div_ceil(self.lipid);
        let (lipid, atom) = (k / self.lipid, k % self.lipid);
        // As many in each layer as it has area.
        let areas = LAYERS.map(|radius| f64::from(radius * radius));
        let inner = (count as f64 * areas[0] / (areas[0] + areas[1])).round() as u64;
        let (layer, up) = if lipid < inner {
            (0, even_direction(lipid, inner))
        } else {
            (1, even_direction(lipid - inner, count - inner))
        };
        // From the tail, in the middle of the double layer, to the head.
        let share = (atom as f32 + 0.5) / self.lipid as f32;
        let away = if layer == 0 { 0.5 - share } else { share - 0.5 };
        let mut stream = Stream::new(self.seed, k);
        let height = self.scale * (LAYERS[layer] + LAYER * away);
        let element = match (share > 0.78, stream.unit()) {
            (true, pick) if pick < 0.5 => OXYGEN,
            (true, pick) if pick < 0.65 => NITROGEN,
            _ => CARBON,
        };
        (element, height * up + 1.2 * stream.cube())
    }
}

impl Law for Virion {
    fn particle(&self, k: u64) -> Particle {
        let [lipids, shell, all] = self.ends;
        let (element, chain, position) = if k < lipids {
            let (element, position) = self.lipid_atom(k);
            (element, 0, position)
        } else if k < shell {
            let (atom, position, lump) = self.lumps.atom(k - lipids, shell - lipids);
            (atom.element, 1 + lump, position)
        } else {
            let (atom, position, spike) = self.spikes.atom(k - shell, all - shell);
            (atom.element, 1 + LUMPS + 3 * spike + usize::from(atom.chain), position)
        };
        Particle { position, values: [f32::from(element), chain as f32, 0.0] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::tests::{generated, neighbor_distances};

    #[test]
    fn layers_shell_and_spikes_lie_where_they_should() {
        let cloud = generated("virion?n=1000000&seed=6");
        let scale = (1e6 / PUBLISHED).cbrt() as f32;
        let [lipids, shell, all] = ends(1_000_000, SHARES).map(|it| it as usize);
        let height = |id: usize| cloud.positions().offset(id).length() / scale;
        let slack = 5.0 / scale;
        for id in 0..all {
            let range = match id {
                _ if id < lipids => 380.0 - slack..435.0 + slack,
                _ if id < shell => 415.0 - slack..485.0 + slack,
                _ => 420.0 - slack..700.0 + slack,
            };
            assert!(range.contains(&height(id)), "particle {id} at {}", height(id));
        }
        let top = (shell..all).map(height).fold(0.0, f32::max);
        assert!((630.0..700.0).contains(&top), "spikes end at {top}");
        let chains = cloud.attribute("chain").unwrap();
        let last = chains.number(all - 1, 0) as usize;
        assert!((1 + LUMPS + 3 * 69..1 + LUMPS + 3 * 100).contains(&last), "chain {last}");
    }

    #[test]
    fn atoms_have_the_density_and_elements_of_proteins() {
        let cloud = generated("virion?n=1000000&seed=7");
        let [_, shell, all] = ends(1_000_000, SHARES).map(|it| it as usize);
        let mut counts = [0; 4];
        let element = cloud.attribute("element").unwrap();
        (shell..all).for_each(|id| counts[element.number(id, 0) as usize] += 1);
        let shares = counts.map(|it| it as f64 / (all - shell) as f64);
        assert!((shares[0] - 0.645).abs() < 0.02 && (shares[3] - 0.006).abs() < 0.003, "{shares:?}");
        assert_eq!(cloud.radius(cloud.radii().unwrap(), all - 1), RADII[element.number(all - 1, 0) as usize]);
        let distances = neighbor_distances(&generated("virion?n=30000&seed=7"), 4.0);
        let middle = distances[distances.len() / 2];
        assert!((0.8..1.8).contains(&middle), "neighbors {middle} apart");
    }
}
