//! Files whose checksums are right and whose content is not: a picture may be wrong, but nothing panics, and all ends.

use std::io::Cursor;
use std::path::PathBuf;

use tyndall::math::Ray;
use tyndall::render::{Settings, render};
use tyndall::scene::Scene;
use tyndall::scene::camera::{Camera, Projection};
use tyndall::scene::color::ParticleColors;
use tyndall::scene::light::Lighting;
use tyndall::scene::select::Filter;
use tyndall::structure::treelets::{Cut, Options};
use tyndall::structure::{Packing, pkd};
use tyndall::{DVec3, Vec3};

use super::container::Writer;
use super::*;
use crate::write::tests::Folder;

/// Saves particles, and gives the file and its sections.
fn sections(path: &Path, kind: Kind, count: usize, each: bool) -> Vec<(String, String, Vec<u8>)> {
    let column = |step: f32| (0..count).map(|id| (id as f32 * step).fract()).collect::<Vec<_>>();
    let positions =
        Positions::from_offsets(DVec3::ZERO, [column(0.754_877), column(0.569_84), column(0.618_034)]);
    let sizes = (0..count).map(|id| 0.01 + 1e-5 * id as f32).collect();
    let attributes = vec![Attribute::new("size", 1, Values::F32(sizes))];
    let bonds = (1..count as u32).map(|id| [id, id / 2]).collect();
    let particles = Particles::new(Columns { positions, attributes, bonds, ..Columns::default() }).unwrap();
    let radii = match each {
        true => tyndall::Radii::PerParticle { attribute: 0, scale: 1.0 },
        false => tyndall::Radii::Uniform(0.02),
    };
    let recipe = Recipe {
        kind,
        radii_text: String::new(),
        conventions: Vec::new(),
        sources: Vec::new(),
        writer: "test".into(),
    };
    build(path, particles.with_radii(radii), recipe, &()).unwrap();
    let bytes = std::fs::read(path).unwrap();
    let table = Table::parse(path, &bytes).unwrap();
    table
        .sections
        .iter()
        .map(|it| (it.name.clone(), it.kind.clone(), bytes[it.range.clone()].to_vec()))
        .collect()
}

/// Writes sections with the right checksums.
fn write(path: &Path, sections: &[(String, String, Vec<u8>)]) {
    let mut file = Cursor::new(Vec::new());
    let mut writer = Writer::new(&mut file, &()).unwrap();
    for (name, kind, bytes) in sections {
        writer.section(name, kind, bytes).unwrap();
    }
    writer.finish("test").unwrap();
    std::fs::write(path, file.into_inner()).unwrap();
}

/// Uses all of what was opened: pictures in light, single rays, filters, radii that are scaled.
fn use_all(opened: Saved) {
    let Saved { mut structure, particles, .. } = opened;
    for k in 0..24 {
        let direction = Vec3::new((k as f32).sin(), (1.7 * k as f32).cos(), 0.3).normalize();
        let ray = Ray { origin: Vec3::splat(0.5) - 3.0 * direction, direction, t_min: 0.0, t_max: 1e9 };
        structure.intersect(&ray, None).inspect(|hit| assert!((hit.node as usize) < structure.len()));
        structure.occluded(&ray, Some(3));
        structure.hits(&ray, &mut |_, node| assert!((node as usize) < structure.len()));
    }
    structure.scale_radii(1.5);
    let colors = ParticleColors::constant([0.5; 3]);
    let mut scene = Scene::new(structure, colors, Lighting::studio(Vec3::NEG_X, Vec3::Y, Vec3::Z), None);
    let camera = Camera {
        eye: DVec3::new(2.0, 1.0, 1.5),
        look_at: DVec3::splat(0.5),
        up: DVec3::Z,
        projection: Projection::Orthographic { height: 1.5 },
    };
    let settings = Settings { width: 16, height: 12, samples: 4, ..Settings::default() };
    render(&scene, &camera, &settings, &()).unwrap();
    assert!(particles.bonds().as_flattened().iter().all(|&id| (id as usize) < particles.len()));
    let filter: Filter = "size=0.01:0.012".parse().unwrap();
    let kept = tyndall::scene::select::Selectable::of(&particles, &filter).unwrap();
    scene.keep(vec![kept]);
    scene.select(&[filter], &[]).unwrap();
    render(&scene, &camera, &settings, &()).unwrap();
}

fn kinds() -> Vec<Kind> {
    let packings = [Packing::Exact, Packing::Bits16, Packing::Bits11, Packing::Bits8];
    let treelets = Options { size: 16, cut: Cut::Middle, heap: pkd::Options::default() };
    let mut kinds: Vec<Kind> = packings.into_iter().map(Kind::Bvh).collect();
    kinds.extend([Kind::Pkd(pkd::Options::default()), Kind::Treelets(treelets)]);
    kinds
}

#[test]
fn whatever_the_arrays_hold_nothing_panics_and_all_ends() {
    let folder = Folder::new("saved-hostile");
    let path: PathBuf = folder.0.join("hostile.tyn");
    let mut state = 0x2545_f491_4f6c_dd1d_u64;
    let mut random = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state
    };
    let (mut opened_count, mut refused_count) = (0, 0);
    for (kind, each) in kinds().into_iter().flat_map(|kind| [(kind, false), (kind, true)]) {
        let whole = sections(&path, kind, 200, each);
        for target in 0..whole.len() {
            let name = whole[target].0.as_str();
            if !name.starts_with("structure.") && !["attribute.0", "bonds"].contains(&name) {
                continue;
            }
            for way in 0..6 {
                let mut altered = whole.clone();
                let bytes = &mut altered[target].2;
                match way {
                    0 => bytes.fill(0),
                    1 => bytes.fill(0xff),
                    2 => bytes.iter_mut().for_each(|byte| *byte = random() as u8),
                    3 => bytes.reverse(),
                    // Infinities, or huge places.
                    4 => bytes.chunks_exact_mut(4).for_each(|word| word.copy_from_slice(&[0, 0, 0x80, 0x7f])),
                    _ => (0..20).for_each(|_| {
                        let place = random() as usize % bytes.len();
                        bytes[place] = random() as u8;
                    }),
                }
                write(&path, &altered);
                match Saved::open(&path) {
                    Ok(opened) => {
                        opened_count += 1;
                        use_all(opened);
                    }
                    Err(error) => {
                        refused_count += 1;
                        let Error::Format { place, .. } = &error else { panic!("{error:?}") };
                        let of_pointers = ["structure.heaps", "structure.children", "structure.blocks"];
                        assert!(of_pointers.contains(&&place[..]), "{kind:?}: {error}");
                    }
                }
            }
        }
    }
    assert!(opened_count > 200 && refused_count > 5, "{opened_count} opened, {refused_count} refused");
}

#[test]
fn sections_that_are_missing_or_of_another_length_are_named() {
    let folder = Folder::new("saved-missing");
    let path: PathBuf = folder.0.join("missing.tyn");
    for kind in kinds() {
        let whole = sections(&path, kind, 700, true);
        for target in 0..whole.len() {
            let (name, length) = (whole[target].0.clone(), whole[target].2.len());
            let mut altered = whole.clone();
            altered.remove(target);
            write(&path, &altered);
            let error = Saved::open(&path).err().expect("a section is missing").to_string();
            assert!(error.contains(&name), "{name}: {error}");
            for length in [0, 1, length / 2, length - 1, length + 1, length + 64, 2 * length] {
                let mut altered = whole.clone();
                altered[target].2.resize(length, b' ');
                write(&path, &altered);
                let is_free = name == "sample" && length.is_multiple_of(16)
                    || name == "about" && length >= whole[target].2.len();
                let opened = Saved::open(&path);
                assert!(opened.is_err() || is_free, "{kind:?} {name} of {length} bytes");
            }
        }
    }
}

#[test]
fn files_from_before_bonds_were_kept_open_without() {
    let folder = Folder::new("saved-older");
    let path: PathBuf = folder.0.join("older.tyn");
    let mut sections = sections(&path, Kind::default(), 50, false);
    assert_eq!(Saved::open(&path).unwrap().particles.bonds().len(), 49);
    sections.retain(|it| it.0 != "bonds");
    let about = &mut sections.iter_mut().find(|it| it.0 == "about").unwrap().2;
    let mut object: serde_json::Value = serde_json::from_slice(about).unwrap();
    assert_eq!(object.as_object_mut().unwrap().remove("bonds"), Some(49.into()));
    *about = serde_json::to_vec(&object).unwrap();
    write(&path, &sections);
    let opened = Saved::open(&path).unwrap();
    assert_eq!((opened.particles.len(), opened.particles.bonds().len()), (50, 0));
    assert!(read(&path, &std::fs::read(&path).unwrap(), None, &()).unwrap().particles.bonds().is_empty());
}

#[test]
fn wrong_values_are_found_when_particles_are_read_as_a_whole() {
    let folder = Folder::new("saved-values");
    let path: PathBuf = folder.0.join("values.tyn");
    let whole = sections(&path, Kind::default(), 50, true);
    let read_with = |target: &str, word: f32| {
        let mut altered = whole.clone();
        let section = altered.iter_mut().find(|it| it.0 == target).unwrap();
        section.2[40..44].copy_from_slice(&word.to_le_bytes());
        write(&path, &altered);
        let bytes = std::fs::read(&path).unwrap();
        read(&path, &bytes, None, &()).map(|frame| frame.particles.len()).map_err(|error| error.to_string())
    };
    assert_eq!(read_with("position.x", 0.25), Ok(50));
    for (target, word) in [("position.y", f32::NAN), ("position.z", f32::INFINITY), ("attribute.0", -1.0)] {
        let error = read_with(target, word).unwrap_err();
        assert!(error.contains("not finite, or radii below 0"), "{error}");
    }
    // As a number of a particle, 9.0 is far beyond 50.
    assert!(read_with("bonds", 9.0).unwrap_err().contains("of particles that are not there"));
}
