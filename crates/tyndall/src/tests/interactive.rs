//! A resident scene that was changed shows what a scene made that way shows on the same device, bit for bit, however often it was
//! interrupted.

use std::sync::atomic::{AtomicI64, Ordering};

use glam::{DVec3, Vec3};

use super::scenes::{LAWS, Law, Random, camera, particles};
use super::visibility::{differing_pixels, image};
use crate::film::Image;
use crate::particles::{Attribute, Columns, Particles, Radii, Values};
use crate::progress::Progress;
use crate::render::interactive::{Detail, Interactive};
use crate::render::{Culling, Renderer, Settings};
use crate::scene::Scene;
use crate::scene::camera::Camera;
use crate::scene::color::{self, ParticleColors};
use crate::scene::coloring::Mapping;
use crate::scene::light::Lighting;
use crate::structure::selection::{HalfSpace, Rule};
use crate::structure::{Kind, Packing, Structure, pkd};
use fearless_simd::Level;

/// Says stop after so many questions.
struct Budget(AtomicI64);

impl Budget {
    fn of(questions: i64) -> Self {
        Self(AtomicI64::new(questions))
    }
}

impl Progress for Budget {
    fn begin(&self, _: &str, _: Option<u64>, _: &'static str) {}
    fn advance(&self, _: u64) {}
    fn cancelled(&self) -> bool {
        self.0.fetch_sub(1, Ordering::Relaxed) <= 0
    }
}

/// All that can be changed.
#[derive(Clone)]
struct State {
    camera: Camera,
    settings: Settings,
    colors: ParticleColors,
    lighting: Lighting,
    background: Option<[f32; 3]>,
    radius_scale: f32,
    half_spaces: Vec<HalfSpace>,
    /// Samples that finished pictures may have.
    samples: [u32; 3],
}

impl State {
    fn first(particles: &Particles, random: &mut Random) -> Self {
        Self {
            camera: camera(&particles.bounds(), random),
            settings: Settings { width: 70, height: 45, samples: 21, seed: 1, culling: Culling::default() },
            colors: ParticleColors::constant([0.5; 3]),
            lighting: Lighting::Headlight,
            background: None,
            radius_scale: 1.0,
            half_spaces: Vec::new(),
            samples: [1, 4, 21],
        }
    }

    /// Changes one thing, here and there.
    fn change(&mut self, interactive: &mut Interactive, particles: &Particles, random: &mut Random) {
        match random.below(6) {
            0 => {
                self.camera = camera(&particles.bounds(), random);
                interactive.look_from(self.camera).unwrap();
            }
            1 => {
                let samples = self.samples[random.below(3) as usize];
                let (width, height) = (40 + random.below(40), 20 + random.below(30));
                let culling = [Culling::Off, Culling::default()][random.below(2) as usize];
                self.settings = Settings { width, height, samples, seed: random.below(9), culling };
                interactive.set(self.settings).unwrap();
            }
            2 => {
                self.colors = colors(particles, random);
                interactive.recolor(self.colors.clone());
            }
            3 => {
                self.lighting = match random.below(3) {
                    0 => Lighting::Flat,
                    1 => Lighting::studio(Vec3::X, Vec3::NEG_Y, Vec3::Z),
                    _ => Lighting::Headlight,
                };
                self.background = (random.below(2) == 0).then_some([0.1, 0.2, 0.3]);
                interactive.light(self.lighting.clone(), self.background);
            }
            4 => {
                self.radius_scale = 3.0 * random.unit();
                interactive.scale_radii(self.radius_scale).unwrap();
            }
            _ => {
                let normal = random.vector().as_dvec3();
                let distance = normal.dot(DVec3::splat(0.2 * f64::from(random.unit())));
                self.half_spaces = vec![HalfSpace { normal, distance }];
                interactive.select(&[], &self.half_spaces).unwrap();
            }
        }
    }

    fn scene(&self, particles: &Particles, radii: &Radii, kind: Kind) -> Scene {
        // Radii decide which particles share a leaf, and thereby how packed centers are rounded.
        let is_packed = matches!(kind, Kind::Bvh(packing) if packing != Packing::Exact);
        let (built, scale) = if is_packed { (1.0, self.radius_scale) } else { (self.radius_scale, 1.0) };
        let mut structure = Structure::build(kind, particles.clone(), radii, built, &()).unwrap();
        structure.scale_radii(scale);
        structure.show(&self.half_spaces.iter().copied().map(Rule::HalfSpace).collect::<Vec<_>>());
        Scene::new(structure, self.colors.clone(), self.lighting.clone(), self.background)
    }
}

/// Random colors, held in each way.
fn colors(particles: &Particles, random: &mut Random) -> ParticleColors {
    let bytes = (0..3 * particles.len()).map(|_| random.below(256) as u8).collect();
    let columns = Columns {
        positions: particles.positions().clone(),
        attributes: vec![
            Attribute::new("Cd", 3, Values::U8(bytes)),
            Attribute::new("s", 1, Values::F32((0..particles.len()).map(|_| random.unit()).collect())),
        ],
        ..Columns::default()
    };
    let coloring = match random.below(3) {
        0 => return ParticleColors::constant([random.unit(), 0.5, random.unit()]),
        1 => "Cd",
        _ => "s",
    };
    let particles = Particles::new(columns).unwrap();
    color::resolve(&particles, &coloring.parse().unwrap(), &Mapping::default()).unwrap()
}

/// What keeps a scene and renders it.
trait Device {
    /// Samples of finished pictures: of one pass, and of several.
    fn samples(&self) -> [u32; 3];

    /// Moves the scene there.
    fn take(&self, interactive: Interactive) -> Interactive;

    /// The picture of a scene that it never saw.
    fn whole(&self, scene: &Scene, camera: &Camera, settings: &Settings) -> Image;
}

struct Cpu;

impl Device for Cpu {
    fn samples(&self) -> [u32; 3] {
        [1, 4, 21]
    }

    fn take(&self, interactive: Interactive) -> Interactive {
        interactive
    }

    fn whole(&self, scene: &Scene, camera: &Camera, settings: &Settings) -> Image {
        image(scene, camera, settings, Level::new())
    }
}

const KINDS: [Kind; 2] = [
    Kind::Bvh(Packing::Exact),
    Kind::Pkd(pkd::Options { axis: pkd::Axis::WidestExtent, order: pkd::Order::NodeFirst }),
];

/// Changes scenes of so many seeds on a device, so often each, and compares every picture. `compare` is given the seed, scene and picture
/// as well.
fn change_at_random(
    device: &impl Device,
    (seeds, edits): (u64, u32),
    kinds: &[Kind],
    mut compare: impl FnMut(u64, &Scene, &State, &Image),
) {
    for seed in 0..seeds {
        let mut random = Random::new(11_000 + seed);
        let (particles, radii) = particles(LAWS[seed as usize % LAWS.len()], 500, &mut random);
        // Each law with each kind in turn.
        let kind = kinds[(seed as usize + seed as usize / LAWS.len()) % kinds.len()];
        let mut state = State { samples: device.samples(), ..State::first(&particles, &mut random) };
        state.settings.samples = state.samples[2];
        let scene = state.scene(&particles, &radii, kind);
        let mut interactive = device.take(Interactive::new(scene, state.camera, state.settings).unwrap());
        for edit in 0..edits {
            state.change(&mut interactive, &particles, &mut random);
            if random.below(3) == 0 {
                // Two changes before the next picture, or in the middle of one.
                interactive.refine(&Budget::of(random.below(12).into())).unwrap();
                state.change(&mut interactive, &particles, &mut random);
            }
            let mut calls = 0;
            while !interactive.is_done() {
                interactive.refine(&Budget::of(1 + i64::from(random.below(30)))).unwrap();
                calls += 1;
                assert!(calls < 1000, "it ends");
            }
            let scene = state.scene(&particles, &radii, kind);
            let expected = device.whole(&scene, &state.camera, &state.settings);
            let differing = differing_pixels(&expected, interactive.image());
            assert_eq!(differing, 0, "seed {seed}, edit {edit}: {kind:?}");
            compare(seed, &scene, &state, interactive.image());
        }
    }
}

#[test]
fn changes_come_to_what_a_scene_made_that_way_shows() {
    change_at_random(&Cpu, (16, 6), &KINDS, |_, _, _, _| ());
}

/// Selects halves of a scene one after another, and compares every picture with that of a scene which shows only that half.
fn select_in_turn(device: &impl Device, kinds: &[Kind]) {
    let mut random = Random::new(5);
    let (particles, radii) = particles(Law::Uniform, 300, &mut random);
    let mut state = State::first(&particles, &mut random);
    let bounds = particles.bounds();
    let middle = (0.5 * (bounds.min + bounds.max)).as_dvec3();
    for &kind in kinds {
        state.half_spaces.clear();
        let scene = state.scene(&particles, &radii, kind);
        let mut it = device.take(Interactive::new(scene, state.camera, state.settings).unwrap());
        let mut before = Vec::new();
        for normal in [DVec3::X, DVec3::NEG_X, DVec3::Y] {
            state.half_spaces = vec![HalfSpace { normal, distance: normal.dot(middle) }];
            it.select(&[], &state.half_spaces).unwrap();
            it.refine(&()).unwrap();
            let expected =
                device.whole(&state.scene(&particles, &radii, kind), &state.camera, &state.settings);
            assert_eq!(differing_pixels(&expected, it.image()), 0, "{kind:?}, {normal}");
            assert!(it.image().id != before, "{kind:?}, {normal}: nothing changed");
            before.clone_from(&it.image().id);
        }
    }
}

#[test]
fn a_selection_takes_the_place_of_the_one_before() {
    select_in_turn(&Cpu, &KINDS);
}

/// A resident scene of a few hundred particles.
fn resident(samples: u32) -> Interactive {
    let mut random = Random::new(5);
    let (particles, radii) = particles(Law::Uniform, 300, &mut random);
    let mut state = State::first(&particles, &mut random);
    state.settings.samples = samples;
    let scene = state.scene(&particles, &radii, KINDS[0]);
    Interactive::new(scene, state.camera, state.settings).unwrap()
}

/// A view that is given time for a tile, another, and the rest: the scene with its finished picture.
fn refined_step_by_step(device: &impl Device) -> Interactive {
    let mut it = device.take(resident(4));
    assert_eq!(it.refine(&Budget::of(0)).unwrap(), Detail::Stale);
    assert!(it.image().color.is_empty(), "no picture yet");
    // 70 x 45 pixels are one tile, or one band, in blocks of 8 and of 4.
    assert_eq!(it.refine(&Budget::of(1)).unwrap(), Detail::Block(8));
    let image = it.image();
    assert_eq!((image.width, image.height, image.id.len()), (70, 45, 70 * 45));
    for (pixel, id) in image.id.iter().enumerate() {
        let (x, y) = (pixel % 70, pixel / 70);
        assert_eq!(*id, image.id[y / 8 * 8 * 70 + x / 8 * 8], "a block has one id");
    }
    assert_eq!(it.refine(&Budget::of(1)).unwrap(), Detail::Block(4));
    assert_eq!(it.refine(&Budget::of(100)).unwrap(), Detail::Samples(4));
    assert!(it.is_done());
    it
}

#[test]
fn a_picture_goes_from_coarse_to_fine_and_the_next_begins_where_time_allows() {
    let mut it = refined_step_by_step(&Cpu);
    // Views that are finished at once need no coarse steps; one that is not makes the next begin coarser.
    it.look_from(*it.camera()).unwrap();
    assert!(!it.is_done());
    assert_eq!(it.refine(&()).unwrap(), Detail::Samples(4));
    it.look_from(*it.camera()).unwrap();
    assert_eq!(it.refine(&Budget::of(3)).unwrap(), Detail::Stale, "begins with the finished picture");
    it.look_from(*it.camera()).unwrap();
    assert_eq!(it.refine(&Budget::of(9)).unwrap(), Detail::Block(1));
}

#[test]
fn a_pixel_is_picked_as_it_is_seen() {
    let mut it = resident(1);
    it.refine(&()).unwrap();
    let mut met = 0;
    for (pixel, (&id, &depth)) in it.image().id.iter().zip(&it.image().depth).enumerate() {
        let pick = it.pick(pixel as u32 % 70, pixel as u32 / 70);
        let seen = (id >= 0).then_some((Some(id as u64), depth));
        assert_eq!(pick.map(|pick| (pick.place, pick.depth)), seen);
        if let Some(pick) = pick {
            let (center, radius) = it.scene().structure().sphere(pick.node);
            let from_center = pick.position - it.scene().structure().origin() - center.as_dvec3();
            assert!((from_center.length() / f64::from(radius) - 1.0).abs() < 1e-3, "on its surface");
            met += 1;
        }
    }
    assert!(met > 100, "{met} pixels show a particle");
    assert!(it.scale_radii(-1.0).is_err() && it.scale_radii(f32::NAN).is_err());
}

#[test]
fn a_renderer_that_was_interrupted_goes_on() {
    let mut random = Random::new(6);
    let (particles, radii) = particles(Law::Uniform, 300, &mut random);
    let state = State::first(&particles, &mut random);
    let scene = state.scene(&particles, &radii, KINDS[0]);
    let expected = image(&scene, &state.camera, &state.settings, Level::new());
    let mut renderer = Renderer::new(&scene, &state.camera, &state.settings).unwrap();
    let mut interrupted = 0;
    while !renderer.is_done() {
        interrupted += u32::from(renderer.pass(&Budget::of(3)).is_err());
    }
    assert!(interrupted > 3);
    assert_eq!(differing_pixels(&expected, &renderer.image()), 0);
}

#[cfg(feature = "gpu")]
mod card {
    use super::super::twins::{self, device, device_that_hides, scale};
    use super::*;
    use crate::render::gpu::{self, Gpu, Resident};
    use crate::render::render;
    use crate::structure::treelets;

    impl Device for Gpu {
        fn samples(&self) -> [u32; 3] {
            // Passes of 1 and 16: each other number of samples has kernels of its own, which take a second to compile.
            [1, 16, 17]
        }

        fn take(&self, mut interactive: Interactive) -> Interactive {
            interactive.move_to_gpu(self, &()).unwrap();
            interactive
        }

        fn whole(&self, scene: &Scene, camera: &Camera, settings: &Settings) -> Image {
            gpu::render(&Resident::load(self, scene, &()).unwrap(), scene, camera, settings, &()).unwrap()
        }
    }

    const KINDS: [Kind; 6] = [
        Kind::Bvh(Packing::Exact),
        Kind::Bvh(Packing::Bits16),
        Kind::Bvh(Packing::Bits11),
        Kind::Bvh(Packing::Bits8),
        Kind::Pkd(pkd::Options { axis: pkd::Axis::WidestExtent, order: pkd::Order::NodeFirst }),
        Kind::Treelets(treelets::Options {
            size: 50,
            cut: treelets::Cut::Median,
            heap: pkd::Options { axis: pkd::Axis::RoundRobin, order: pkd::Order::NodeFirst },
        }),
    ];

    #[test]
    fn changes_come_to_what_a_scene_made_that_way_shows() {
        let Some(gpu) = device_that_hides() else { return };
        let (mut pixels, mut differing) = (0, 0);
        change_at_random(&gpu, (8, 5), &KINDS, |seed, scene, state, found| {
            // Where all particles share a center, what a shadow ray starts on lies within rounding of the others.
            if matches!(
                (LAWS[seed as usize % LAWS.len()], state.lighting.clone()),
                (Law::Equal, Lighting::Studio(..))
            ) {
                return;
            }
            let expected = render(scene, &state.camera, &state.settings, &()).unwrap();
            differing += twins::differing_pixels(&expected, found, scale(&state.camera));
            pixels += found.id.len();
        });
        println!("{differing} of {pixels} pixels differ from those of the CPU");
        assert!(differing * 200 < pixels, "{differing} of {pixels}");
    }

    #[test]
    fn a_selection_takes_the_place_of_the_one_before() {
        let Some(gpu) = device_that_hides() else { return };
        // A hierarchy and a heap.
        select_in_turn(&gpu, &[KINDS[0], KINDS[4]]);
    }

    #[test]
    fn a_picture_goes_from_coarse_to_fine_and_the_next_begins_where_time_allows() {
        let Some(gpu) = device(None) else { return };
        let mut it = refined_step_by_step(&gpu);
        it.look_from(*it.camera()).unwrap();
        assert_eq!(it.refine(&Budget::of(0)).unwrap(), Detail::Stale, "begins with the finished picture");
        it.look_from(*it.camera()).unwrap();
        assert_eq!(it.refine(&()).unwrap(), Detail::Samples(4));
    }

    #[test]
    fn a_renderer_that_was_interrupted_goes_on_and_shows_what_it_has() {
        let Some(gpu) = device(None) else { return };
        let mut random = Random::new(6);
        let (particles, radii) = particles(Law::Uniform, 300, &mut random);
        let state = State::first(&particles, &mut random);
        let scene = state.scene(&particles, &radii, KINDS[0]);
        let expected = gpu.whole(&scene, &state.camera, &state.settings);
        let resident = Resident::load(&gpu, &scene, &()).unwrap();
        let mut renderer = gpu::Renderer::new(&resident, &scene, &state.camera, &state.settings).unwrap();
        let mut interrupted = 0;
        while !renderer.is_done() {
            if renderer.pass(&Budget::of(1)).is_err() {
                interrupted += 1;
                let image = renderer.image().unwrap();
                assert!(
                    image.color.iter().flatten().all(|it| (0.0..=1.001).contains(it)),
                    "every row is a mean"
                );
            }
        }
        assert!(interrupted > 0);
        assert_eq!(differing_pixels(&expected, &renderer.image().unwrap()), 0);
    }

    #[test]
    fn a_scene_moves_between_devices_and_stays_where_it_is_when_it_cannot() {
        let Some(gpu) = device(None) else { return };
        let mut it = resident(1);
        it.refine(&()).unwrap();
        let by_cpu = it.image().clone();
        it.move_to_gpu(&gpu, &()).unwrap();
        assert!(!it.is_done());
        it.refine(&()).unwrap();
        let by_card = it.image().clone();
        assert!(twins::differing_pixels(&by_cpu, &by_card, scale(it.camera())) < 30);
        it.move_to_cpu();
        it.refine(&()).unwrap();
        assert_eq!(differing_pixels(&by_cpu, it.image()), 0);
        // Memory of a few bytes a page, which are more pages than there are bindings.
        let Some(small) = device(Some(16)) else { return };
        assert!(it.move_to_gpu(&small, &()).is_err());
        it.look_from(*it.camera()).unwrap();
        it.refine(&()).unwrap();
        assert_eq!(differing_pixels(&by_cpu, it.image()), 0);
    }

    #[test]
    fn a_pixel_is_picked_as_it_is_seen() {
        let Some(gpu) = device(None) else { return };
        let mut it = gpu.take(resident(1));
        it.refine(&()).unwrap();
        let (mut met, mut differing) = (0, 0);
        for (pixel, (&id, &depth)) in it.image().id.iter().zip(&it.image().depth).enumerate() {
            let pick = it.pick(pixel as u32 % 70, pixel as u32 / 70);
            met += usize::from(pick.is_some());
            // A ray that grazes a sphere may be decided otherwise.
            differing += usize::from(pick.map_or(-1, |pick| pick.place.unwrap() as i64) != id);
            if let Some(pick) = pick.filter(|pick| pick.place == Some(id as u64)) {
                assert!((pick.depth - depth).abs() <= 1e-4 * depth, "{depth} {pick:?}");
            }
        }
        assert!(met > 100 && differing < 30, "{met} pixels show a particle, {differing} picks differ");
    }
}
