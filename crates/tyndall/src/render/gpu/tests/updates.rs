//! What changed in a scene is sent, and nothing else: a scene in which all has changed is given to a copy on the card that is told of one
//! change at a time.

use glam::DVec3;

use super::super::{Gpu, Resident, render};
use super::formulas::device;
use crate::film::Image;
use crate::particles::{Attribute, Columns, Particles, Positions, Radii, Values};
use crate::random::Stream;
use crate::render::Settings;
use crate::render::interactive::Changes;
use crate::scene::Scene;
use crate::scene::camera::{Camera, Projection};
use crate::scene::color;
use crate::scene::coloring::Mapping;
use crate::scene::light::Lighting;
use crate::structure::selection::HalfSpace;
use crate::structure::{Kind, Packing, Structure};

/// What of a scene is changed.
const NOTHING: Changes = Changes { colors: false, radii: false, shown: false };
const ALL: Changes = Changes { colors: true, radii: true, shown: true };

fn particles() -> Particles {
    let mut stream = Stream::new(3, 0);
    let mut columns: [Vec<f32>; 3] = Default::default();
    let mut radii = Vec::new();
    let mut bytes = Vec::new();
    for _ in 0..700 {
        columns.iter_mut().for_each(|column| column.push(stream.unit()));
        radii.push(0.02 + 0.05 * stream.unit());
        bytes.extend([0; 3].map(|_: u8| stream.below(256) as u8));
    }
    let positions = Positions::from_offsets(DVec3::ZERO, columns);
    let attributes =
        vec![Attribute::new("radius", 1, Values::F32(radii)), Attribute::new("Cd", 3, Values::U8(bytes))];
    Particles::new(Columns { positions, attributes, ..Columns::default() }).unwrap()
}

/// A scene with some changes; colors are held in the ways that `before` and `after` name.
fn scene(kind: Kind, radii: &Radii, [before, after]: [&str; 2], changes: Changes) -> Scene {
    let particles = particles();
    let name = if changes.colors { after } else { before };
    let colors = color::resolve(&particles, &name.parse().unwrap(), &Mapping::default()).unwrap();
    let structure = Structure::build(kind, particles, radii, 1.0, &()).unwrap();
    let mut scene = Scene::new(structure, colors, Lighting::Headlight, None);
    if changes.radii {
        scene.scale_radii(1.4);
    }
    if changes.shown {
        scene.select(&[], &[HalfSpace { normal: DVec3::new(0.3, 1.0, -0.2), distance: 0.6 }]).unwrap();
    }
    scene
}

fn image(resident: &Resident, scene: &Scene) -> Image {
    let camera = Camera {
        eye: DVec3::new(2.0, -1.0, 1.5),
        look_at: DVec3::splat(0.5),
        up: DVec3::Z,
        projection: Projection::Orthographic { height: 1.6 },
    };
    let settings = Settings { width: 40, height: 30, samples: 4, ..Settings::default() };
    render(resident, scene, &camera, &settings, &()).unwrap()
}

fn whole(gpu: &Gpu, scene: &Scene) -> Image {
    image(&Resident::load(gpu, scene, &()).unwrap(), scene)
}

#[test]
fn only_what_changed_is_sent() {
    let Some(gpu) = device() else { return };
    if gpu.storage_buffers() < 11 {
        println!("left out: {} buffers are too few to hide particles of treelets", gpu.storage_buffers());
        return;
    }
    let (one, each) = (Radii::Uniform(0.05), Radii::PerParticle { attribute: 0, scale: 1.0 });
    let exact = Kind::Bvh(Packing::Exact);
    for (kind, radii, looks) in [
        (exact, one.clone(), ["#406080", "radius"]),
        (exact, each.clone(), ["radius", "Cd"]),
        (Kind::Bvh(Packing::Bits8), each.clone(), ["Cd", "#406080"]),
        (Kind::Pkd(Default::default()), one, ["radius", "x"]),
        (Kind::Treelets(Default::default()), each, ["#406080", "Cd"]),
    ] {
        let scene = |changes| scene(kind, &radii, looks, changes);
        let (before, after) = (scene(NOTHING), scene(ALL));
        let first = whole(&gpu, &before);
        for changes in [
            Changes { colors: true, ..NOTHING },
            Changes { radii: true, ..NOTHING },
            Changes { shown: true, ..NOTHING },
            ALL,
        ] {
            let about = format!("{kind:?}, {radii:?}, {changes:?}");
            let expected = whole(&gpu, &scene(changes));
            assert!(expected != first, "{about}: the change is seen");
            let mut resident = Resident::load(&gpu, &before, &()).unwrap();
            resident.update(&after, changes).unwrap();
            assert!(image(&resident, &after) == expected, "{about}");
            // And back again, with what may be of another length or not be there at all.
            resident.update(&before, changes).unwrap();
            assert!(image(&resident, &before) == first, "{about}, and back");
        }
    }
}

#[test]
fn kernels_are_made_anew_only_where_arrays_are_laid_out_otherwise() {
    let Some(gpu) = device() else { return };
    let scene =
        |changes| scene(Kind::Bvh(Packing::Exact), &Radii::Uniform(0.05), ["#406080", "radius"], changes);
    let first = scene(NOTHING);
    let mut resident = Resident::load(&gpu, &first, &()).unwrap();
    let bytes = resident.bytes();
    assert_eq!(bytes, first.structure().bytes() + 4 * 700, "what the structure takes, and ids");
    for changes in [Changes { colors: true, ..NOTHING }, Changes { shown: true, ..NOTHING }] {
        let changed = scene(changes);
        assert!(resident.update(&changed, changes).unwrap(), "{changes:?}");
        assert!(!resident.update(&changed, changes).unwrap(), "{changes:?}, as it is");
        assert!(resident.bytes() > bytes);
        assert!(resident.update(&first, changes).unwrap(), "{changes:?}, and back");
        assert_eq!(resident.bytes(), bytes);
    }
    let changes = Changes { radii: true, ..NOTHING };
    assert!(!resident.update(&scene(changes), changes).unwrap(), "{changes:?}");
}
