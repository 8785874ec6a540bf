//! What is cut, against closed forms in double precision, and the same for all structures.

use glam::{DQuat, DVec3, Vec3};

use super::replicas;
use super::scenes::{LAWS, Law, Random, camera, particles};
use super::visibility::{KINDS, differing_pixels, image, scene};
use crate::film::Window;
use crate::math::Ray;
use crate::particles::{Attribute, Columns, Particles, Positions, Radii, Values};
use crate::render::illustration::{Contours, Illustration};
use crate::render::{Culling, Renderer, Settings, certified, confidence};
use crate::scene::Scene;
use crate::scene::automatic::Outliers;
use crate::scene::camera::{Camera, Projection};
use crate::scene::color::{ParticleColors, resolve};
use crate::scene::coloring::{Mapping, Range};
use crate::scene::guesses::Shown;
use crate::scene::light::{KeyLight, Lighting, Lights, Paths, Sky};
use crate::scene::material::Material;
use crate::structure::replicas::Replicas;
use crate::structure::selection::HalfSpace;
use crate::structure::shapes::{Ellipsoid, Segment};
use crate::structure::{Kind, Packing, Spheres, Structure};
use fearless_simd::Level;

const RADII: Radii = Radii::PerParticle { attribute: 0, scale: 1.0 };

fn spheres(all: &[([f64; 3], f32)]) -> Particles {
    let mut positions = Positions::around(DVec3::ZERO);
    positions.extend(&all.iter().map(|(center, _)| DVec3::from_array(*center)).collect::<Vec<_>>());
    let radius = Attribute::new("radius", 1, Values::F32(all.iter().map(|(_, radius)| *radius).collect()));
    Particles::new(Columns { positions, attributes: vec![radius], ..Columns::default() }).unwrap()
}

/// One to three planes through the cloud, or a box within it.
fn sides(particles: &Particles, random: &mut Random) -> Vec<HalfSpace> {
    let bounds = particles.bounds();
    let middle = bounds.center() + 0.2 * random.vector() * bounds.extent();
    if random.below(3) == 0 {
        let corner = 0.3 * bounds.extent();
        return [Vec3::X, Vec3::Y, Vec3::Z]
            .into_iter()
            .flat_map(|axis| [axis, -axis])
            .map(|axis| {
                let distance = axis.dot(middle) + axis.abs().dot(corner);
                HalfSpace { normal: axis.as_dvec3(), distance: f64::from(distance) }
            })
            .collect();
    }
    let side = |_| {
        let normal = if random.below(3) == 0 { Vec3::Y } else { random.vector() }.as_dvec3();
        HalfSpace { normal, distance: normal.dot(middle.as_dvec3()) }
    };
    (0..1 + particles.len() % 3).map(side).collect()
}

/// What a ray meets of spheres that are cut, and the least relative change of a length that would alter it.
struct Truth {
    /// Distance, id, and of a cap the unit normal.
    met: Option<(f64, u32, Option<DVec3>)>,
    slack: f64,
}

/// By trying every sphere; `shadow` rays start within what is left, on the sphere `on`, and meet no caps.
fn truth(spheres: &Spheres, sides: &[HalfSpace], ray: &Ray, on: Option<u32>) -> Truth {
    let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3().normalize());
    let mut slack = f64::INFINITY;
    let (mut enter, mut leave, mut normal) = (f64::NEG_INFINITY, f64::INFINITY, DVec3::ZERO);
    let size = spheres.particles.bounds().extent().max_element() as f64
        + (spheres.particles.bounds().center().as_dvec3() - origin).length();
    let near = |a: f64, b: f64, slack: &mut f64| *slack = slack.min((a - b).abs() / size);
    for side in sides {
        let unit = side.normal.normalize();
        let (speed, left) = (unit.dot(direction), side.distance / side.normal.length() - unit.dot(origin));
        slack = slack.min(speed.abs());
        let t = left / speed;
        if speed < 0.0 {
            near(t, enter, &mut slack);
            if t > enter {
                (enter, normal) = (t, unit);
            }
        } else {
            near(t, leave, &mut slack);
            leave = leave.min(t);
        }
    }
    near(enter, leave, &mut slack);
    near(enter, 0.0, &mut slack);
    near(leave, 0.0, &mut slack);
    let mut met: Option<(f64, u32, Option<DVec3>)> = None;
    let mut deepest = f64::NEG_INFINITY;
    if enter >= leave || leave <= 0.0 {
        return Truth { met, slack };
    }
    for id in (0..spheres.len() as u32).filter(|id| on != Some(*id)) {
        let (center, radius) =
            (spheres.center(id as usize).as_dvec3(), f64::from(spheres.radius(id as usize)));
        let closest = (center - origin).dot(direction);
        let off = (center - origin - closest * direction).length();
        near(off, radius, &mut slack);
        if off >= radius {
            continue;
        }
        let half = (radius * radius - off * off).sqrt();
        let (first, last) = (closest - half, closest + half);
        for t in [first, last] {
            [0.0, enter, leave].iter().for_each(|at| near(t, *at, &mut slack));
        }
        if enter > 0.0 && on.is_none() && first <= enter && enter < last {
            let depth = (enter - first) * (last - enter);
            slack = slack.min((depth - deepest).abs() / (size * size));
            if depth > deepest {
                deepest = depth;
                met = Some((enter, id, Some(normal)));
            }
        } else if first > enter.max(0.0) && first < leave && deepest == f64::NEG_INFINITY {
            if let Some((nearest, ..)) = met {
                near(nearest, first, &mut slack);
            }
            if met.is_none_or(|(nearest, ..)| first < nearest) {
                met = Some((first, id, None));
            }
        }
    }
    Truth { met, slack }
}

#[test]
fn what_is_left_is_what_double_precision_finds() {
    let (mut caps, mut others, mut nothing, mut undecided) = (0, 0, 0, 0);
    for seed in 0..40 {
        let mut random = Random::new(12_000 + seed);
        let law = LAWS[seed as usize % LAWS.len()];
        if matches!(law, Law::Equal) {
            continue;
        }
        let (particles, radii) = particles(law, 200, &mut random);
        let wanted = Spheres { particles: &particles, radii: &radii, radius_scale: 2.0 };
        let sides = sides(&particles, &mut random);
        let mut scene = scene(&particles, &radii, KINDS[seed as usize % KINDS.len()], Lighting::Flat);
        scene.scale_radii(2.0);
        scene.set_cut(&sides, None);
        let camera = camera(&particles.bounds(), &mut random);
        let settings = Settings { width: 24, height: 20, samples: 1, seed: 0, culling: Culling::Off };
        let view = camera.view(DVec3::ZERO, 24, 20).unwrap();
        let mut renderer = Renderer::new(&scene, &camera, &settings).unwrap();
        renderer.finish(&()).unwrap();
        let (found, surfaces) = (renderer.image(), renderer.surfaces());
        for (pixel, surface) in surfaces.iter().enumerate() {
            let ray = view.ray((pixel % 24) as f32 + 0.5, (pixel / 24) as f32 + 0.5);
            let Truth { met, slack } = truth(&wanted, &sides, &ray, None);
            if slack < 1e-5 {
                undecided += 1;
                continue;
            }
            let told = format!("seed {seed}: {law:?}, pixel {pixel}, {met:?}");
            assert_eq!(found.id[pixel], met.map_or(-1, |(_, id, _)| i64::from(id)), "{told}");
            let Some((t, id, cap)) = met else {
                nothing += 1;
                continue;
            };
            let depth = f64::from(found.depth[pixel]);
            assert!((depth - t).abs() < 2e-3 * t, "{told}: {depth}");
            let center = wanted.center(id as usize).as_dvec3();
            let at = ray.origin.as_dvec3() + t * ray.direction.as_dvec3();
            let normal = cap.unwrap_or((at - center).normalize());
            let off = (Vec3::from(surface.normal).as_dvec3() - normal).length();
            assert!(off < if cap.is_some() { 1e-6 } else { 0.05 }, "{told}: {off}");
            *if cap.is_some() { &mut caps } else { &mut others } += 1;
        }
    }
    let told = format!("{caps} caps, {others} others, {nothing} of nothing, {undecided} too close to call");
    assert!(caps > 1000 && others > 1000 && nothing > 1000 && undecided < 3000, "{told}");
}

#[test]
fn light_is_hidden_by_what_is_left_alone() {
    let (mut shadowed, mut spared, mut undecided) = (0, 0, 0);
    for seed in 0..24 {
        let mut random = Random::new(12_100 + seed);
        let (particles, radii) = particles(Law::Uniform, 150, &mut random);
        let wanted = Spheres { particles: &particles, radii: &radii, radius_scale: 1.5 };
        let sides = sides(&particles, &mut random);
        let mut scene = scene(&particles, &radii, KINDS[seed as usize % KINDS.len()], Lighting::Flat);
        scene.scale_radii(1.5);
        scene.set_cut(&sides, None);
        let view = camera(&particles.bounds(), &mut random).view(DVec3::ZERO, 24, 20).unwrap();
        for pixel in 0..24 * 20 {
            let ray = view.ray((pixel % 24) as f32 + 0.5, (pixel / 24) as f32 + 0.5);
            let Some((t, node)) = scene.meet(&ray) else { continue };
            let toward = random.vector().normalize_or(Vec3::X);
            let point = ray.origin + t * ray.direction;
            let light = |origin: Vec3| Ray { origin, direction: toward, t_min: 0.0, t_max: f32::INFINITY };
            if let Some((cut, _)) = scene.cap_of(node) {
                let normal = cut.normal(point, ray.direction);
                assert!(normal.dot(toward) <= 0.0 || !scene.is_shadowed(&light(point), Some(node)));
                assert_eq!(scene.enter(&light(point), Some(node)), None);
                continue;
            }
            let (center, radius) = scene.structure().sphere(node);
            let normal = (point - center).normalize();
            let toward = if normal.dot(toward) < 0.0 { -toward } else { toward };
            let light = Ray { direction: toward, ..light(center + radius * normal) };
            let id = scene.structure().ids()[node as usize];
            let Truth { met, slack } = truth(&wanted, &sides, &light, Some(id));
            if slack < 1e-4 {
                undecided += 1;
                continue;
            }
            assert_eq!(scene.is_shadowed(&light, Some(node)), met.is_some(), "seed {seed}: pixel {pixel}");
            let entered =
                scene.enter(&light, Some(node)).map(|(_, node)| scene.structure().ids()[node as usize]);
            assert_eq!(entered, met.map(|(_, id, _)| id), "seed {seed}: pixel {pixel}");
            shadowed += u32::from(met.is_some());
            spared += u32::from(met.is_none() && scene.structure().occluded(&light, Some(node)));
        }
    }
    assert!(shadowed > 200 && spared > 100 && undecided < 200, "{shadowed} {spared} {undecided}");
}

#[test]
fn all_structures_and_images_show_the_same() {
    let mut met = 0;
    for seed in 0..12 {
        let mut random = Random::new(12_200 + seed);
        let counts = [[1; 3], [2, 1, 2]][seed as usize % 2];
        let [(one, radii), (copies, all_radii)] = replicas::particles(60, counts, &mut random);
        let look_at = copies.bounds().center().as_dvec3();
        // Moving it back by the cell's edges rounds nothing: see `replicas`.
        let eye = look_at + 30.0 * random.vector().abs().normalize_or(Vec3::X).as_dvec3();
        let projection = Projection::Perspective { vertical_angle: 0.25 };
        let camera = Camera { eye, look_at, up: DVec3::new(0.3, 0.2, 1.0), projection };
        let view = camera.view(DVec3::ZERO, 33, 21).unwrap();
        let lighting = || match seed % 3 {
            0 => Lighting::Headlight,
            1 => Lighting::Toon { toward: view.up },
            _ => Lighting::studio(view.forward, view.right, view.up),
        };
        let sides = sides(&copies, &mut random);
        let samples = [1, 4, 16][random.below(3) as usize];
        let settings =
            Settings { width: 33, height: 21, samples, seed: seed as u32, culling: Culling::default() };
        let opacity: Vec<f32> = (0..60).map(|id| [1.0, 0.5][id % 2]).collect();
        let picture = |mut scene: Scene| {
            scene.set_cut(&sides, None);
            scene.scale_radii(1.5);
            if seed % 4 == 3 {
                scene.set_opacity(Some(&opacity.repeat(scene.structure().len() / 60))).unwrap();
            }
            let mut image = image(&scene, &camera, &settings, Level::new());
            image.id.iter_mut().filter(|id| **id >= 0).for_each(|id| *id %= 60);
            image
        };
        // Colors do not depend on how many there are; whether copies are there does.
        let scene = |particles: &Particles, radii: &Radii, kind: Kind| {
            let mapping = Mapping { range: Range::Given(0.0, 0.7), ..Mapping::default() };
            let colors = resolve(particles, &"radius".parse().unwrap(), &mapping).unwrap();
            let structure = Structure::build(kind, particles.clone(), radii, 1.0, &()).unwrap();
            Scene::new(structure, colors, lighting(), None)
        };
        let expected = (seed % 4 != 3).then(|| picture(scene(&copies, &all_radii, Kind::Brute)));
        let replicated = |kind: Kind| {
            let mut scene = scene(&one, &radii, kind);
            scene.replicate(&Replicas::new(one.cell(), counts).unwrap()).unwrap();
            picture(scene)
        };
        let expected = expected.unwrap_or_else(|| replicated(Kind::Brute));
        met += expected.id.iter().filter(|id| **id >= 0).count();
        for kind in KINDS {
            assert_eq!(differing_pixels(&expected, &replicated(kind)), 0, "seed {seed}: {kind:?}");
        }
    }
    assert!(met > 800, "only {met} pixels show anything");
    // Of packed leaves what they decode.
    let mut random = Random::new(12_290);
    let (particles, radii) = particles(Law::Uniform, 300, &mut random);
    let camera = camera(&particles.bounds(), &mut random);
    let settings = Settings { width: 24, height: 24, samples: 16, ..Settings::default() };
    let sides = sides(&particles, &mut random);
    let packed = Structure::build(Kind::Bvh(Packing::Bits8), particles, &radii, 1.0, &()).unwrap();
    let (decoded, decoded_radii) = super::visibility::decoded(&packed);
    let picture = |structure: Structure| {
        let colors = ParticleColors::constant([0.5; 3]);
        let mut scene = Scene::new(structure, colors, Lighting::Headlight, None);
        scene.set_cut(&sides, None);
        image(&scene, &camera, &settings, Level::new())
    };
    let brute = Structure::build(Kind::Brute, decoded, &decoded_radii, 1.0, &()).unwrap();
    assert_eq!(differing_pixels(&picture(packed), &picture(brute)), 0);
}

/// From z = 10 down, four units high, parallel.
fn above() -> Camera {
    let projection = Projection::Orthographic { height: 4.0 };
    Camera { eye: DVec3::new(0.0, 0.0, 10.0), look_at: DVec3::ZERO, up: DVec3::Y, projection }
}

fn settings(edge: u32, samples: u32) -> Settings {
    Settings { width: edge, height: edge, samples, seed: 1, culling: Culling::Off }
}

const BELOW_ZERO: HalfSpace = HalfSpace { normal: DVec3::new(0.0, 0.0, 2.0), distance: 0.0 };

#[test]
fn a_cap_has_its_color_and_all_of_the_light() {
    // A ball cut through its middle, under a wide one that is cut away, before a bowl that is not.
    let particles = spheres(&[([0.0, 0.0, 0.0], 0.8), ([0.0, 0.0, 3.0], 2.0), ([0.0, 0.0, -6.0], 3.0)]);
    let sky = Sky { zenith: 1.0, ground: 1.0, up: Vec3::Z };
    let key = KeyLight { toward: Vec3::new(0.6, 0.0, 0.8), angular_radius: 0.2, strength: 0.5 };
    let paths = Paths {
        lights: Lights::Studio(key, sky),
        material: Material::Matte { roughness: 0.0 },
        bounces: 3,
        lens: None,
    };
    for lighting in [Lighting::Flat, Lighting::Headlight, Lighting::Studio(key, sky), Lighting::Paths(paths)]
    {
        for cap in [None, Some([0.1, 0.5, 0.9])] {
            let mut scene = scene(&particles, &RADII, Kind::default(), lighting.clone());
            scene.set_cut(&[BELOW_ZERO], cap);
            let found = image(&scene, &above(), &settings(24, 64), Level::new());
            let node = scene.structure().ids().iter().position(|id| *id == 0).unwrap();
            let color = cap.unwrap_or(scene.color(node as u32));
            // Sky and key light are not mirrored or hidden by anything above.
            let brightness = match lighting {
                Lighting::Studio(..) | Lighting::Paths(_) => 1.0 + 0.5 * 0.8,
                _ => 1.0,
            };
            for (x, y) in [(12, 12), (9, 14), (14, 10)] {
                let at = y * 24 + x;
                assert_eq!((found.depth[at], found.id[at]), (10.0, 0));
                for (found, wanted) in found.color[at].iter().zip(color) {
                    let tolerance = if brightness == 1.0 { 1e-5 } else { 0.03 };
                    assert!((found / (brightness * wanted) - 1.0).abs() < tolerance, "{lighting:?} {found}");
                }
            }
            assert_eq!(found.id[12 * 24 + 20], 2, "{lighting:?}");
        }
    }
}

#[test]
fn shapes_are_cut_as_spheres_are() {
    let mut random = Random::new(12_300);
    let (all, radii) = particles(Law::Uniform, 40, &mut random);
    let camera = camera(&all.bounds(), &mut random);
    let sides = sides(&all, &mut random);
    // Ellipsoids and superquadrics that are spheres.
    let picture = |exponents: Option<[f64; 2]>| {
        let mut scene = scene(&all, &radii, Kind::default(), Lighting::Flat);
        let ellipsoid = |id: u32| Ellipsoid {
            particle: id,
            half_axes: DVec3::splat(f64::from(1.5 * all.radius(&radii, id as usize))),
            turn: DQuat::IDENTITY,
            exponents: exponents.unwrap_or(Ellipsoid::ROUND),
        };
        scene.scale_radii(if exponents.is_some() { 0.0 } else { 1.5 });
        if exponents.is_some() {
            scene.add_ellipsoids(&(0..40).map(ellipsoid).collect::<Vec<_>>()).unwrap();
        }
        scene.set_cut(&sides, None);
        image(&scene, &camera, &settings(40, 1), Level::new())
    };
    let expected = picture(None);
    for exponents in [Ellipsoid::ROUND, [2.0, 2.000_001]] {
        let found = picture(Some(exponents));
        let alike = |at: &usize| {
            let off = (found.depth[*at] - expected.depth[*at]).abs() < 1e-3;
            found.id[*at] == expected.id[*at] && (off || expected.id[*at] < 0)
        };
        let same = (0..1600).filter(alike).count();
        assert!(same > 1580 && expected.id.iter().any(|id| *id >= 0), "{exponents:?}: {same}");
    }
    // A bond along x, cut lengthwise: a rectangle, of which each half has its particle's color.
    let particles = spheres(&[([-1.0, 0.0, 0.0], 0.3), ([1.0, 0.0, 0.0], 0.3)]);
    let mut scene = scene(&particles, &RADII, Kind::default(), Lighting::Flat);
    let from = particles.positions().offset(0);
    scene.bond(&[Segment { from, to: -from, ends: [0, 1] }], 0.15).unwrap();
    scene.set_cut(&[BELOW_ZERO], None);
    let found = image(&scene, &above(), &settings(64, 1), Level::new());
    for (at, depth) in found.depth.iter().enumerate() {
        let [x, y] = [at % 64, at / 64].map(|at| (at as f32 + 0.5) / 16.0 - 2.0);
        let is_in_ball = (x.abs() - 1.0).hypot(y) < 0.3;
        let wanted = is_in_ball || x.abs() < 1.0 && y.abs() < 0.15;
        assert_eq!(depth.is_finite(), wanted, "{x} {y}");
        assert!(!wanted || (*depth - 10.0).abs() < 1e-6 && found.id[at] == i64::from(x > 0.0), "{x} {y}");
    }
}

#[test]
fn caps_of_two_particles_have_a_line_between_them() {
    let particles = spheres(&[([-0.6, 0.0, 0.0], 1.0), ([0.6, 0.0, 0.0], 1.0)]);
    let mut scene = scene(&particles, &RADII, Kind::default(), Lighting::Flat);
    scene.background = Some([1.0; 3]);
    let contours = Some(Contours { width: 34.0, color: [1.0, 0.0, 0.0], jump: 2.0 });
    let over = Illustration { contours, ..Illustration::default() };
    scene.set_cut(&[BELOW_ZERO], None);
    let cut: Vec<bool> = {
        let before = image(&scene, &above(), &settings(64, 1), Level::new());
        let mut after = before.clone();
        over.draw((&scene, &above()), [64; 2], Window::whole(64, 64), &mut after, &()).unwrap();
        let is_under = |(before, after): (&[f32; 4], &[f32; 4])| after[1] < 0.3 * before[1];
        before.color.iter().zip(&after.color).map(is_under).collect()
    };
    let at = |x: f32, y: f32| cut[((2.0 - y) * 16.0) as usize * 64 + ((x + 2.0) * 16.0) as usize];
    // The circle in which they cut each other spans y = -0.8 to 0.8.
    let found = [at(0.0, 0.0), at(0.0, 0.7), at(-1.6, 0.0), at(0.6, 1.0)];
    assert_eq!(found, [true; 4]);
    assert!(!at(-0.6, 0.0) && !at(0.6, 0.3) && !at(0.3, 0.0));
}

#[test]
fn what_is_shown_is_framed_as_if_there_were_nothing_else() {
    let mut random = Random::new(12_400);
    let counts = [2, 1, 1];
    let [(one, radii), (copies, all_radii)] = replicas::particles(300, counts, &mut random);
    let middle = copies.bounds().center();
    let (rule, cut) = (
        HalfSpace { normal: DVec3::Y, distance: f64::from(middle.y) },
        HalfSpace { normal: DVec3::NEG_X, distance: f64::from(-middle.x) },
    );
    for kind in [KINDS[0], KINDS[1], KINDS[2]] {
        for least_radius in [0.0, 0.4] {
            let mut scene = scene(&one, &radii, kind, Lighting::Flat);
            scene.replicate(&Replicas::new(one.cell(), counts).unwrap()).unwrap();
            scene.select(&[], &[rule]).unwrap();
            scene.set_cut(&[cut], None);
            let (found, particles) = Shown::of_scene(&scene, least_radius, Outliers::Shown).unwrap();
            // Rules decide for all images by the particles themselves.
            let size = |id: usize| copies.radius(&all_radii, id).max(least_radius);
            let is_wanted = |id: &usize| {
                one.positions().world(id % 300).y <= rule.distance
                    && copies.positions().world(*id).x + f64::from(size(*id)) >= -cut.distance
            };
            let wanted: Vec<([f64; 3], f32)> = (0..copies.len())
                .filter(is_wanted)
                .map(|id| (copies.positions().world(id).to_array(), size(id)))
                .collect();
            assert!(particles.len() == wanted.len() && wanted.len() > 50 && wanted.len() < 450);
            let wanted = spheres(&wanted);
            let wanted = Spheres { particles: &wanted, radii: &RADII, radius_scale: 1.0 };
            let wanted = Shown::of(wanted, Outliers::Shown);
            assert_eq!(found.framing.bounds, wanted.framing.bounds);
            assert_eq!(found.outline.center, wanted.outline.center);
            for (found, wanted) in found.outline.points.iter().zip(&wanted.outline.points) {
                assert!(found.distance(*wanted) < 1e-4, "{found} {wanted}");
            }
            scene.set_cut(&[HalfSpace { distance: -1e3, ..cut }], None);
            assert!(Shown::of_scene(&scene, least_radius, Outliers::Shown).is_none());
        }
    }
}

#[test]
fn what_does_not_go_with_it_is_refused() {
    let particles = spheres(&[([0.0; 3], 1.0)]);
    let mut scene = scene(&particles, &RADII, Kind::default(), Lighting::Flat);
    scene.set_cut(&[BELOW_ZERO], None);
    let with = |scene: &Scene, culling: Culling| {
        Renderer::new(scene, &above(), &Settings { culling, ..settings(8, 1) }).err().map(|it| it.to_string())
    };
    let confidence = Culling::Confidence(confidence::Options::default());
    let coverage = Culling::Certified(certified::Options { coverage: true, ..certified::Options::OFF });
    assert!(with(&scene, confidence).unwrap().contains("cut"));
    assert!(with(&scene, coverage).unwrap().contains("cut"));
    assert_eq!(with(&scene, Culling::default()), None);
    scene.set_cut(&[], None);
    assert_eq!(with(&scene, confidence), None);
}
