//! What is hidden is met by no ray and casts no shadow: pictures equal those of brute force over the particles that are shown.

use glam::{DVec3, Vec3};

use super::scenes::{LAWS, Random, camera, particles};
use super::visibility::{COUNTS, KINDS, decoded, differing_pixels, image};
use crate::film::Image;
use crate::math::Ray;
use crate::particles::{Attribute, Columns, Particles, Positions, Radii, Values};
use crate::render::{Culling, Settings};
use crate::scene::Scene;
use crate::scene::color;
use crate::scene::coloring::{Mapping, Range};
use crate::scene::light::Lighting;
use crate::structure::selection::{Column, HalfSpace, Numbers, Rule};
use crate::structure::{Kind, Packing, Structure};
use fearless_simd::Level;

/// Rules of every kind, as a test states them: numbers by id with the wanted intervals, and half spaces.
pub(super) struct Rules {
    numbers: Vec<(Vec<f64>, Vec<[f64; 2]>)>,
    half_spaces: Vec<HalfSpace>,
}

impl Rules {
    /// Random ones for `particles`: numbers that follow a coordinate, that are few, or that are noise; planes through the cloud.
    pub(super) fn random(particles: &Particles, random: &mut Random) -> Self {
        let bounds = particles.bounds();
        let mut rules = Self { numbers: Vec::new(), half_spaces: Vec::new() };
        let kinds = 1 + random.below(7);
        if kinds & 1 == 1 {
            let law = random.below(3);
            let numbers: Vec<f64> = (0..particles.len())
                .map(|id| match law {
                    0 => f64::from(particles.positions().offset(id)[0]),
                    1 => f64::from(random.below(5)),
                    _ if random.below(20) == 0 => f64::NAN,
                    _ => f64::from(random.unit()),
                })
                .collect();
            let (low, high) = numbers.iter().fold((0.0_f64, 0.0_f64), |(a, b), &it| (a.min(it), b.max(it)));
            let at = |share: f32| low + f64::from(share) * (high - low);
            let first = random.unit();
            let wanted = vec![[at(first), at(first + 0.4 * random.unit())], [at(0.0), at(0.1)]];
            rules.numbers.push((numbers, wanted));
        }
        for _ in 0..kinds >> 1 {
            let normal = if random.below(2) == 0 { Vec3::NEG_Y } else { random.vector() }.as_dvec3();
            let through = bounds.center() + 0.3 * random.vector() * bounds.extent();
            let through = if particles.is_empty() { DVec3::ZERO } else { through.as_dvec3() };
            rules.half_spaces.push(HalfSpace { normal, distance: normal.dot(through) });
        }
        rules
    }

    /// Whether a particle is shown, said anew.
    fn show(&self, id: usize, center: Vec3) -> bool {
        let within = |(numbers, wanted): &(Vec<f64>, Vec<[f64; 2]>)| {
            wanted.iter().any(|[low, high]| (*low..=*high).contains(&numbers[id]))
        };
        self.numbers.iter().all(within)
            && self.half_spaces.iter().all(|it| it.normal.dot(center.as_dvec3()) <= it.distance)
    }

    pub(super) fn apply(&self, structure: &mut Structure) -> u64 {
        let column = |(numbers, _): &(Vec<f64>, _)| {
            Column::new(&Numbers::collect(numbers.len(), |id| numbers[id]), structure.ids())
        };
        let columns: Vec<Column> = self.numbers.iter().map(column).collect();
        let within =
            columns.iter().zip(&self.numbers).map(|(column, (_, wanted))| Rule::Within(column, wanted));
        let half_spaces = self.half_spaces.iter().copied().map(Rule::HalfSpace);
        structure.show(&within.chain(half_spaces).collect::<Vec<_>>())
    }
}

/// The particles with these ids.
fn only(all: &Particles, radii: &Radii, ids: &[usize]) -> (Particles, Radii) {
    let axis = |axis: usize| ids.iter().map(|&id| all.positions().offset(id)[axis]).collect();
    let positions = Positions::from_offsets(all.positions().origin(), [axis(0), axis(1), axis(2)]);
    let sizes = ids.iter().map(|&id| all.radius(radii, id)).collect();
    let attributes = vec![Attribute::new("radius", 1, Values::F32(sizes))];
    let kept = Particles::new(Columns { positions, attributes, ..Columns::default() }).unwrap();
    (kept, Radii::PerParticle { attribute: 0, scale: 1.0 })
}

/// Colors that depend on the particle alone, not on which others there are.
fn colored(structure: Structure, particles: &Particles, greatest: f32, lighting: Lighting) -> Scene {
    let range = Range::Given(0.0, f64::from(greatest).max(1e-30));
    let colors =
        color::resolve(particles, &"radius".parse().unwrap(), &Mapping { range, ..Mapping::default() })
            .unwrap();
    Scene::new(structure, colors, lighting, None)
}

/// The picture of brute force over the particles with these ids, with the ids that they have among all.
fn expected(all: &Particles, radii: &Radii, ids: &[usize], lighting: Lighting, shot: &Shot) -> Image {
    let (kept, kept_radii) = only(all, radii, ids);
    let structure = Structure::build(Kind::Brute, kept.clone(), &kept_radii, 1.0, &()).unwrap();
    let scene = colored(structure, &kept, greatest(all, radii), lighting);
    let mut image = image(&scene, &shot.camera, &shot.settings, Level::new());
    for id in image.id.iter_mut().filter(|id| **id >= 0) {
        *id = ids[*id as usize] as i64;
    }
    image
}

fn greatest(all: &Particles, radii: &Radii) -> f32 {
    (0..all.len()).map(|id| all.radius(radii, id)).fold(0.0, f32::max)
}

struct Shot {
    camera: crate::scene::camera::Camera,
    settings: Settings,
}

#[test]
fn hidden_particles_are_as_if_they_were_not_there() {
    let (mut hidden, mut met) = (0, 0);
    for seed in 0..120 {
        let mut random = Random::new(8000 + seed);
        let law = LAWS[seed as usize % LAWS.len()];
        let count = COUNTS[seed as usize / LAWS.len() % COUNTS.len()];
        let (all, radii) = particles(law, count, &mut random);
        let rules = Rules::random(&all, &mut random);
        let samples = [1, 4, 16][random.below(3) as usize];
        let culling = if seed % 2 == 0 { Culling::Off } else { Culling::default() };
        let settings = Settings { width: 21, height: 13, samples, seed: seed as u32, culling };
        let shot = Shot { camera: camera(&all.bounds(), &mut random), settings };
        let studio = Lighting::studio(Vec3::X, Vec3::NEG_Y, Vec3::Z);
        let lighting = if seed % 3 == 0 { studio } else { Lighting::Headlight };
        let mut kinds = KINDS.to_vec();
        kinds.push(Kind::Bvh(Packing::Bits8));
        let shown = |all: &Particles| -> Vec<usize> {
            (0..count).filter(|&id| rules.show(id, all.positions().offset(id))).collect()
        };
        // What the structures hold that change no particle.
        let exact = expected(&all, &radii, &shown(&all), lighting.clone(), &shot);
        for kind in kinds {
            let mut structure = Structure::build(kind, all.clone(), &radii, 1.0, &()).unwrap();
            // What is clipped and drawn is what the structure decodes.
            let is_packed = kind == Kind::Bvh(Packing::Bits8);
            let (all, radii) = if is_packed { decoded(&structure) } else { (all.clone(), radii.clone()) };
            let ids = shown(&all);
            let about = format!("seed {seed}: {law:?}, {count} particles, {kind:?}");
            assert_eq!(rules.apply(&mut structure), ids.len() as u64, "{about}");
            hidden += count - ids.len();
            let packed = is_packed.then(|| expected(&all, &radii, &ids, lighting.clone(), &shot));
            let expected = packed.as_ref().unwrap_or(&exact);
            met += expected.id.iter().filter(|&&id| id >= 0).count();
            let all_colors = only(&all, &radii, &(0..count).collect::<Vec<_>>()).0;
            let scene = colored(structure, &all_colors, greatest(&all, &radii), lighting.clone());
            let found = image(&scene, &shot.camera, &shot.settings, Level::new());
            assert_eq!(differing_pixels(expected, &found), 0, "{about}");
        }
    }
    assert!(hidden > 10_000 && met > 10_000, "{hidden} hidden, {met} pixels met: the scenes test nothing");
}

#[test]
fn rays_pass_through_hidden_particles_and_meet_them_again_when_all_are_shown() {
    for seed in 0..60 {
        let mut random = Random::new(9000 + seed);
        let (all, radii) = particles(LAWS[seed as usize % LAWS.len()], 700, &mut random);
        let rules = Rules::random(&all, &mut random);
        let ids: Vec<usize> = (0..700).filter(|&id| rules.show(id, all.positions().offset(id))).collect();
        let (kept, kept_radii) = only(&all, &radii, &ids);
        let build = |kind, particles: &Particles, radii| {
            Structure::build(kind, particles.clone(), radii, 1.0, &()).unwrap()
        };
        let (brute, whole) = (build(Kind::Brute, &kept, &kept_radii), build(Kind::Brute, &all, &radii));
        let size = all.bounds().extent().max_element().max(1e-30);
        for kind in KINDS {
            let mut structure = build(kind, &all, &radii);
            rules.apply(&mut structure);
            let rays = (0..40).map(|_| {
                let direction = random.vector().normalize_or(Vec3::Z);
                Ray { origin: random.vector() * size, direction, t_min: 0.0, t_max: f32::INFINITY }
            });
            let rays: Vec<Ray> = rays.collect();
            for ray in &rays {
                let expected = brute.intersect(ray, None).map(|hit| (hit.t, ids[hit.id as usize] as u32));
                let found = structure.intersect(ray, None).map(|hit| (hit.t, hit.id));
                assert_eq!(found, expected, "seed {seed}: {kind:?}");
                assert_eq!(structure.occluded(ray, None), expected.is_some(), "seed {seed}: {kind:?}");
            }
            structure.show(&[]);
            for ray in &rays {
                let of = |structure: &Structure| structure.intersect(ray, None).map(|hit| (hit.t, hit.id));
                assert_eq!(of(&structure), of(&whole), "seed {seed}: {kind:?}");
            }
        }
    }
}
