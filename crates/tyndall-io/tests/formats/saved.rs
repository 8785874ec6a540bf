//! Saved structures: what is opened is what was built, to the bit, and what is not whole says so.

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use tyndall::particles::{Attribute, Cell, Columns, Positions, Radii, Values};
use tyndall::render::{Settings, render};
use tyndall::scene::automatic::Outliers;
use tyndall::scene::camera::{Camera, Projection};
use tyndall::scene::coloring::Mapping;
use tyndall::scene::guesses::Guesses;
use tyndall::scene::light::Lighting;
use tyndall::scene::{Scene, color};
use tyndall::structure::{Kind, Packing, Spheres, Structure, pkd, treelets};
use tyndall::{DVec3, Error, Image, Particles, Progress, Vec3};
use tyndall_io::Saved;
use tyndall_io::saved::{self, Recipe};

use super::{Folder, frame, gzip, open};

/// Particles in and around a cube far from zero, some of which cannot be drawn, with attributes of all kinds.
fn cloud(count: usize) -> Particles {
    let at = |step: f64| move |id: usize| (id as f64 * step).fract();
    let (x, y, z) = (at(0.754_877_666), at(0.569_840_291), at(0.618_033_989));
    let place = |id| match id {
        7 => DVec3::NAN,
        _ => DVec3::new(1e6 + x(id), y(id) - 3e5, 0.1 * z(id)),
    };
    let mut positions = Positions::new();
    positions.extend(&(0..count).map(place).collect::<Vec<_>>());
    let numbers = |scale: f64| (0..count).map(move |id| scale * x(id));
    let text = |values| Values::Text { codes: values, names: vec!["Cu".into(), "".into(), "µ\"\n".into()] };
    let mut q = Attribute::new("q", 1, Values::F32(numbers(9.0).map(|it| it as f32).collect()));
    q.unit = Some("e".into());
    Particles::new(Columns {
        positions,
        attributes: vec![
            q,
            Attribute::new("v", 3, Values::F64((0..3 * count).map(|k| (k as f64).sqrt()).collect())),
            Attribute::new("kind", 1, Values::I32((0..count as i32).map(|id| id % 3).collect())),
            Attribute::new("id", 1, Values::I64((0..count as i64).map(|id| id << 33).collect())),
            Attribute::new("flag", 1, Values::U8((0..count).map(|id| id as u8).collect())),
            Attribute::new("name", 1, text((0..count as u32).map(|id| id % 3).collect())),
            Attribute::new("size", 1, Values::F32(numbers(0.05).map(|it| 0.01 + it as f32).collect())),
        ],
        radii: None,
        cell: Some(Cell {
            origin: DVec3::new(1e6, -3e5, -0.1),
            vectors: [DVec3::X, DVec3::new(0.1, 1.0, 0.0), DVec3::Z],
            periodic: [true, false, true],
        }),
        time: Some(0.1 + 0.2),
        time_unit: Some("ps".into()),
        length_unit: Some("Å".into()),
        // Two are of the particle that is dropped, one is there twice.
        bonds: vec![[9, 0], [7, 3], [0, 9], [count.saturating_sub(1) as u32, 8], [6, 7]],
    })
    .unwrap()
}

/// One radius, one a type, one a particle.
fn all_radii() -> [Radii; 3] {
    [
        Radii::Uniform(0.03),
        Radii::PerType { attribute: 2, radii: vec![0.01, 0.02, 0.1 / 3.0] },
        Radii::PerParticle { attribute: 6, scale: 0.7 },
    ]
}

fn all_kinds() -> Vec<Kind> {
    let heaps = [
        pkd::Options::default(),
        pkd::Options { axis: pkd::Axis::RoundRobin, order: pkd::Order::NearChildFirst },
    ];
    let treelets = |size, cut| Kind::Treelets(treelets::Options { size, cut, heap: heaps[1] });
    let packings = [Packing::Exact, Packing::Bits16, Packing::Bits11, Packing::Bits8];
    let mut kinds: Vec<Kind> = packings.into_iter().map(Kind::Bvh).collect();
    kinds.extend(heaps.map(Kind::Pkd));
    kinds.extend([treelets(16, treelets::Cut::Median), treelets(64, treelets::Cut::Middle)]);
    kinds
}

fn recipe(kind: Kind) -> Recipe {
    Recipe {
        kind,
        radii_text: "radius of a test".into(),
        conventions: vec!["a guess".into()],
        sources: vec!["cloud".into()],
        writer: "tyndall test".into(),
    }
}

fn build(path: &Path, particles: &Particles, kind: Kind) {
    saved::build(path, particles.clone(), recipe(kind), &()).unwrap();
}

/// A picture of a structure over these particles, colored by their attribute `q`.
fn picture(structure: Structure, particles: &Particles) -> Image {
    let colors = color::resolve(particles, &"q".parse().unwrap(), &Mapping::default()).unwrap();
    let scene = Scene::new(structure, colors, Lighting::studio(Vec3::NEG_X, Vec3::Y, Vec3::Z), None);
    let middle = DVec3::new(1e6 + 0.5, -3e5 + 0.5, 0.05);
    let camera = Camera {
        eye: middle + DVec3::new(1.5, 0.6, 0.9),
        look_at: middle,
        up: DVec3::Z,
        projection: Projection::Orthographic { height: 1.3 },
    };
    let settings = Settings { width: 40, height: 32, samples: 4, ..Settings::default() };
    render(&scene, &camera, &settings, &()).unwrap()
}

/// Whether two pictures are the same to the bit: colors, depths and ids.
fn is_same(a: &Image, b: &Image) -> bool {
    let bits = |image: &Image| {
        let color = image.color.iter().flatten().map(|it| it.to_bits());
        color.chain(image.depth.iter().map(|it| it.to_bits())).collect::<Vec<_>>()
    };
    bits(a) == bits(b) && a.id == b.id
}

fn is_same_cloud(a: &Particles, b: &Particles) -> bool {
    let places = |it: &Particles| (0..it.len()).map(|id| it.place(id)).collect::<Vec<_>>();
    a.positions() == b.positions()
        && a.attributes() == b.attributes()
        && (a.radii(), a.cell(), a.time(), a.time_unit(), a.length_unit())
            == (b.radii(), b.cell(), b.time(), b.time_unit(), b.length_unit())
        && a.bonds() == b.bonds()
        && (a.dropped(), a.bounds(), places(a)) == (b.dropped(), b.bounds(), places(b))
}

#[test]
fn what_is_opened_is_what_was_built() {
    let folder = Folder::new("saved-round");
    let path = folder.0.join("cloud.tyn");
    for kind in all_kinds() {
        for radii in all_radii() {
            for count in [0, 1, 2, 17, 1000] {
                let particles = cloud(count).with_radii(radii.clone());
                let case = format!("{count} particles, {kind:?}, {radii:?}");
                build(&path, &particles, kind);
                let opened = Saved::open(&path).unwrap();
                opened.check(&()).unwrap();
                assert_eq!((opened.kind(), opened.writer()), (kind, "tyndall test"), "{case}");
                assert_eq!(opened.conventions, ["a guess"]);
                // Particle 7 is dropped, so that those behind it have ids that are 1 less.
                assert!(count < 1000 || opened.particles.bonds() == [[0, 8], [7, 998]], "{case}");
                assert!(is_same_cloud(&opened.particles, &particles), "{case}");
                let spheres = Spheres { particles: &particles, radii: &radii, radius_scale: 1.0 };
                assert_eq!(opened.guesses, Guesses::of(spheres, "radius of a test".into()), "{case}");
                let built = Structure::build(kind, particles.clone(), &radii, 1.0, &()).unwrap();
                assert_eq!(opened.structure.packing_error(), built.packing_error(), "{case}");
                assert_eq!(opened.structure.ids(), built.ids(), "{case}");
                let place = |structure: &Structure| {
                    (0..structure.len() as u32).map(|node| structure.place(node)).max()
                };
                assert_eq!(place(&opened.structure), place(&built), "{case}");
                let expected = picture(built, &particles);
                let found = picture(opened.structure, &opened.particles);
                assert!(is_same(&found, &expected), "{case}");
                assert!(count < 100 || expected.id.iter().filter(|&&id| id >= 0).count() > 200, "{case}");
                // Read as any other format, also compressed.
                assert!(is_same_cloud(&frame(&open(&path), 0).particles, &particles), "{case}");
            }
        }
    }
    let packed = folder.file("cloud.tyn.gz", &gzip(&std::fs::read(&path).unwrap()));
    let sequence = open(&packed);
    assert!(sequence.saved(0).unwrap().is_none() && sequence.format() == "Tyndall (gzip)");
    assert_eq!(frame(&sequence, 0).particles.len(), 999);
}

#[test]
fn a_picture_that_differs_in_one_bit_is_seen() {
    let particles = cloud(100).with_radii(all_radii()[0].clone());
    let built = Structure::build(Kind::default(), particles.clone(), &all_radii()[0], 1.0, &()).unwrap();
    let image = picture(built, &particles);
    for change in [
        |image: &mut Image| image.color[9][1] = f32::from_bits(image.color[9][1].to_bits() + 1),
        |image: &mut Image| image.depth[9] = 1.0,
        |image: &mut Image| image.id[9] += 1,
    ] {
        let mut other = image.clone();
        change(&mut other);
        assert!(!is_same(&image, &other));
    }
}

#[test]
fn radii_that_are_scaled_after_opening_are_those_of_a_new_structure() {
    let folder = Folder::new("saved-scaled");
    let path = folder.0.join("cloud.tyn");
    let kinds =
        all_kinds().into_iter().filter(|it| !matches!(it, Kind::Bvh(packing) if *packing != Packing::Exact));
    for kind in kinds {
        for radii in all_radii() {
            let particles = cloud(900).with_radii(radii.clone());
            build(&path, &particles, kind);
            let mut opened = Saved::open(&path).unwrap();
            opened.structure.scale_radii(0.7);
            let built = Structure::build(kind, particles.clone(), &radii, 0.7, &()).unwrap();
            let same = is_same(&picture(opened.structure, &particles), &picture(built, &particles));
            assert!(same, "{kind:?} {radii:?}");
        }
    }
}

#[test]
fn opening_loads_no_more_than_what_is_looked_at() {
    let folder = Folder::new("saved-kept");
    let path = folder.0.join("cloud.tyn");
    build(&path, &cloud(2000).with_radii(Radii::Uniform(0.03)), Kind::default());
    let opened = Saved::open(&path).unwrap();
    // What is mapped stays when the file is gone.
    std::fs::remove_file(&path).unwrap();
    assert_eq!(opened.sample().unwrap().len(), 1999);
    assert_eq!(opened.guesses.shown(Outliers::Shown).framing.description, "framed on all particles");
    let ray = tyndall::math::Ray {
        origin: Vec3::splat(5.0),
        direction: Vec3::NEG_ONE.normalize(),
        t_min: 0.0,
        t_max: 1e9,
    };
    assert!(opened.structure.intersect(&ray, None).is_some());
    opened.check(&()).unwrap();
}

/// Fails to open in all ways; why.
#[track_caller]
fn refused(path: &Path, bytes: &[u8]) -> String {
    std::fs::write(path, bytes).unwrap();
    let error = Saved::open(path).err().expect("it does not open");
    assert!(matches!(&error, Error::Format { path: told, .. } if told == path), "{error:?}");
    let sequence = tyndall_io::Sequence::open(&[path.to_path_buf()], &Default::default(), &());
    if let Ok(sequence) = sequence {
        assert!(sequence.frame(0, &()).is_err(), "{error}");
    }
    error.to_string()
}

#[test]
fn what_is_cut_short_or_goes_on_says_so() {
    let folder = Folder::new("saved-cut");
    let path = folder.0.join("cut.tyn");
    build(&path, &cloud(300).with_radii(Radii::Uniform(0.03)), Kind::default());
    let whole = std::fs::read(&path).unwrap();
    let places = (1..200).chain((200..whole.len()).step_by(997)).chain(whole.len() - 99..whole.len());
    for length in places {
        let why = refused(&path, &whole[..length]);
        let wanted = format!("the file ends early: it has {length} of");
        assert!(why.contains(&wanted) && why.contains("copied to its end"), "{length}: {why}");
    }
    assert!(refused(&path, &[&whole[..], b"\n"].concat()).contains("its header tells of"));
}

#[test]
fn every_byte_of_header_and_table_counts() {
    let folder = Folder::new("saved-flips");
    let path = folder.0.join("flipped.tyn");
    build(&path, &cloud(30).with_radii(Radii::Uniform(0.03)), Kind::default());
    let whole = std::fs::read(&path).unwrap();
    let table = u64::from_le_bytes(whole[16..24].try_into().unwrap()) as usize;
    let places = (0..128).chain((table..whole.len()).step_by(3));
    for place in places {
        for flip in [1, 0x80, 0xff] {
            let mut bytes = whole.clone();
            bytes[place] ^= flip;
            let why = refused(&path, &bytes);
            assert!(place < 128 || why.contains("table of sections"), "byte {place}: {why}");
        }
    }
}

#[test]
fn later_versions_and_other_machines_are_named() {
    let folder = Folder::new("saved-later");
    let path = folder.0.join("later.tyn");
    build(&path, &cloud(30).with_radii(Radii::Uniform(0.03)), Kind::default());
    let whole = std::fs::read(&path).unwrap();
    let with = |at: usize, part: &[u8]| {
        let mut bytes = whole.clone();
        bytes[at..at + part.len()].copy_from_slice(part);
        bytes
    };
    let why = refused(&path, &with(8, &7u32.to_le_bytes()));
    assert!(
        why.contains("of version 7, versions up to 1 are known") && why.contains("newer Tyndall"),
        "{why}"
    );
    assert!(refused(&path, &with(8, &[0, 0, 0, 1, 1, 2, 3, 4])).contains("big-endian machine"));
    let text = refused(&path, &with(4, b"\n\x1a\n\n"));
    assert!(text.contains("does not begin like a .tyn file"), "{text}");
}

#[test]
fn a_damaged_section_is_found_by_the_check_and_by_whoever_reads_it_all() {
    let folder = Folder::new("saved-damaged");
    let path = folder.0.join("damaged.tyn");
    for kind in [all_kinds()[0], all_kinds()[2], all_kinds()[4], all_kinds()[6]] {
        build(&path, &cloud(600).with_radii(all_radii()[2].clone()), kind);
        let whole = std::fs::read(&path).unwrap();
        let table = u64::from_le_bytes(whole[16..24].try_into().unwrap()) as usize;
        for entry in whole[table..].chunks(64) {
            let name: String =
                entry[..32].iter().take_while(|&&byte| byte > 0).map(|&it| it as char).collect();
            let number = |at: usize| u64::from_le_bytes(entry[at..at + 8].try_into().unwrap()) as usize;
            let (start, length) = (number(40), number(48));
            for place in [start, start + length - 1] {
                let mut bytes = whole.clone();
                bytes[place] ^= 0x11;
                std::fs::write(&path, bytes).unwrap();
                match Saved::open(&path) {
                    Err(error) => {
                        let looked_at =
                            ["about", "structure.heaps", "structure.children", "structure.blocks"];
                        assert!(looked_at.contains(&&name[..]), "{name}: {error}");
                    }
                    Ok(opened) => {
                        let error = opened.check(&()).unwrap_err().to_string();
                        assert!(error.contains(&name) && error.contains("damaged"), "{name}: {error}");
                        // A picture may be wrong, but there is one.
                        picture(opened.structure, &opened.particles);
                    }
                }
                let is_read = ["position", "attribute", "places", "bonds", "about"]
                    .iter()
                    .any(|it| name.starts_with(it));
                assert_eq!(open(&path).frame(0, &()).is_err(), is_read, "{name}");
            }
        }
    }
}

/// Stops after so many questions.
struct Stop(AtomicUsize);

impl Progress for Stop {
    fn begin(&self, _: &str, _: Option<u64>, _: &'static str) {}
    fn advance(&self, _: u64) {}
    fn cancelled(&self) -> bool {
        self.0.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| left.checked_sub(1)).is_err()
    }
}

#[test]
fn an_old_file_stays_until_the_new_one_is_whole() {
    let folder = Folder::new("saved-whole");
    let path = folder.file("old.tyn", b"old");
    let particles = cloud(300).with_radii(Radii::Uniform(0.03));
    for questions in 0..12 {
        let stop = Stop(AtomicUsize::new(questions));
        let stopped = saved::build(&path, particles.clone(), recipe(Kind::default()), &stop);
        assert!(matches!(stopped, Err(Error::Interrupted)), "{questions}: {stopped:?}");
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(std::fs::read_dir(&folder.0).unwrap().count(), 1, "nothing is left behind");
    }
    let brute = saved::build(&path, particles.clone(), recipe(Kind::Brute), &());
    assert!(brute.unwrap_err().to_string().contains("brute force has nothing to save"));
    let without = saved::build(&path, cloud(3), recipe(Kind::default()), &());
    assert!(without.unwrap_err().to_string().contains("give the particles some"));
    assert_eq!(std::fs::read(&path).unwrap(), b"old");
    let written = saved::build(&path, particles, recipe(Kind::default()), &()).unwrap();
    assert_eq!(written.file_bytes, std::fs::metadata(&path).unwrap().len());
    assert!(Saved::open(&path).is_ok());
}
