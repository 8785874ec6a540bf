//! What is written is read again: every pair of formats, to the precision of the coarser one.

use std::path::Path;

use tyndall::particles::{Attribute, Columns};
use tyndall::{Cell, DVec3, Error, Particles, Values};
use tyndall_io::write;

use super::{Folder, fixture, frame, open};

/// Formats that are written and read, by their extensions.
#[cfg(not(feature = "parquet"))]
const FORMATS: [&str; 11] = ["xyz", "dump", "csv", "tsv", "ply", "npy", "npz", "vtp", "prt", "bgeo", "usda"];
#[cfg(feature = "parquet")]
const FORMATS: [&str; 13] =
    ["xyz", "dump", "csv", "tsv", "ply", "npy", "npz", "vtp", "prt", "bgeo", "usda", "parquet", "feather"];

/// Particles with all types of columns.
fn sample(count: usize, center: DVec3) -> Particles {
    let mut columns = Columns::default();
    let position = |k: usize| {
        let k = k as f64;
        center + DVec3::new(k.sin(), 0.125 * k, -3.0 * (0.7 * k).cos())
    };
    columns.positions.extend(&(0..count).map(position).collect::<Vec<_>>());
    let words = |names: [&str; 3]| Values::Text {
        codes: (0..count as u32).map(|k| k % 3).collect(),
        names: names.map(String::from).to_vec(),
    };
    columns.attributes = vec![
        Attribute::new("id", 1, Values::I32((0..count as i32).map(|k| 7 - k).collect())),
        Attribute::new("velocity", 3, Values::F32((0..3 * count).map(|k| 0.1 * k as f32 - 1e-7).collect())),
        Attribute::new("radius", 1, Values::F32((0..count).map(|k| 0.25 + 0.5 * k as f32).collect())),
        Attribute::new("charge", 1, Values::F64((0..count).map(|k| 1e-30 * 3f64.powi(k as i32)).collect())),
        Attribute::new("element", 1, words(["Cu", "Zr", "O"])),
        Attribute::new("bin", 1, Values::U8((0..count).map(|k| k as u8).collect())),
    ];
    columns.cell = Some(Cell {
        origin: center - DVec3::splat(9.0),
        vectors: [DVec3::X * 18.0, DVec3::new(1.5, 20.0, 0.0), DVec3::new(-1.0, 0.5, 30.0)],
        periodic: [true, false, true],
    });
    columns.time = Some(250.0);
    Particles::new(columns).unwrap()
}

fn convert(particles: &Particles, path: &Path) -> Particles {
    write::particles::particles(path, None, 1, |_| Ok(particles.clone()))
        .unwrap_or_else(|error| panic!("{error}"));
    frame(&open(path), 0).particles
}

/// All numbers and codes of words, a column a component.
fn columns(particles: &Particles) -> Vec<(String, Vec<f64>)> {
    let of = |attribute: &Attribute| {
        let name = match attribute.name.to_ascii_lowercase().as_str() {
            "velocity" if attribute.components == 3 => "v".to_string(),
            // Where formats have a name of their own.
            "species" => "element".to_string(),
            "pscale" => "radius".to_string(),
            other => other.to_string(),
        };
        (0..attribute.components)
            .map(|component| {
                let name = if attribute.components == 1 {
                    name.clone()
                } else {
                    format!("{name}{}", ["x", "y", "z"][component])
                };
                (name, (0..particles.len()).map(|id| attribute.number(id, component)).collect())
            })
            .collect::<Vec<_>>()
    };
    particles.attributes().iter().flat_map(of).collect()
}

/// Fails unless `found` has all that `wanted` has, to the precision of 32-bit floats.
fn check_same(what: &str, wanted: &Particles, found: &Particles) {
    assert_eq!(found.len(), wanted.len(), "{what}");
    for id in 0..wanted.len() {
        let (a, b) = (wanted.positions().world(id), found.positions().world(id));
        let tolerance = 4e-7 * (1.0 + a.abs().max_element());
        assert!(a.abs_diff_eq(b, tolerance), "{what}: particle {id} at {b}, not {a}");
    }
    let found_columns = columns(found);
    for (name, values) in columns(wanted) {
        let same = found_columns.iter().find(|(other, _)| *other == name);
        let (_, others) = same.unwrap_or_else(|| {
            panic!(
                "{what}: no {name} among {:?}",
                found.attributes().iter().map(|it| &it.name).collect::<Vec<_>>()
            )
        });
        for (a, b) in values.iter().zip(others) {
            assert!((a - b).abs() <= 1e-6 * a.abs(), "{what}: {name} is {b}, not {a}");
        }
    }
    let radius =
        |particles: &Particles, id: usize| particles.radii().map(|radii| particles.radius(radii, id));
    for id in 0..wanted.len() {
        assert_eq!(radius(found, id), radius(wanted, id), "{what}: radius of {id}");
    }
}

#[test]
fn every_pair_of_formats_keeps_the_particles() {
    let folder = Folder::new("pairs");
    let original = sample(11, DVec3::new(0.5, -2.0, 1.0));
    for first in FORMATS {
        let once = convert(&original, &folder.file(&format!("a.{first}"), b""));
        check_same(first, &original, &once);
        for second in FORMATS {
            let twice = convert(&once, &folder.file(&format!("b.{second}"), b""));
            check_same(&format!("{first} to {second}"), &original, &twice);
        }
    }
}

#[test]
fn cell_and_time_are_kept_where_there_is_a_place() {
    let folder = Folder::new("cells");
    let original = sample(5, DVec3::ZERO);
    let with_cells = ["xyz", "dump", "parquet", "feather"];
    for format in with_cells.into_iter().filter(|it| FORMATS.contains(it)) {
        let found = convert(&original, &folder.file(&format!("a.{format}"), b""));
        let (a, b) = (original.cell().unwrap(), found.cell().unwrap());
        assert_eq!((b.periodic, found.time()), (a.periodic, Some(250.0)), "{format}");
        assert!(a.origin.abs_diff_eq(b.origin, 1e-9), "{format}: {b:?}");
        for (a, b) in a.vectors.iter().zip(b.vectors) {
            assert!(a.abs_diff_eq(b, 1e-9), "{format}: {b:?}");
        }
    }
    for name in ["a.npz", "a.ply", "a.vtp", "a.mmpld"] {
        assert_eq!(convert(&original, &folder.file(name, b"")).time(), Some(250.0), "{name}");
    }
}

#[test]
fn coordinates_far_from_zero_keep_their_precision() {
    let folder = Folder::new("far");
    let original = sample(9, DVec3::new(6.4e6, -2.1e7, 9.0e8));
    for format in FORMATS.into_iter().filter(|it| !["tsv", "bgeo"].contains(it)) {
        let found = convert(&original, &folder.file(&format!("a.{format}"), b""));
        for id in 0..original.len() {
            let (a, b) = (original.positions().world(id), found.positions().world(id));
            assert!(a.abs_diff_eq(b, 1e-6), "{format}: {b} instead of {a}");
        }
    }
}

#[test]
fn none_and_one_particle_can_be_written() {
    let folder = Folder::new("few");
    for format in FORMATS.into_iter().chain(["mmpld", "glb"]) {
        for count in [0, 1] {
            let path = folder.file(&format!("a{count}.{format}"), b"");
            let few = sample(count, DVec3::ZERO);
            write::particles::particles(&path, None, 1, |_| Ok(few.clone())).unwrap();
            if FORMATS.contains(&format) && (count > 0 || !["csv", "tsv"].contains(&format)) {
                assert_eq!(frame(&open(&path), 0).particles.len(), count, "{format}");
            }
        }
    }
}

#[test]
fn frames_share_a_file_where_the_format_holds_them() {
    let folder = Folder::new("frames");
    let sequence = open(&fixture("triclinic_scaled.dump"));
    for format in ["xyz", "dump"] {
        let path = folder.file(&format!("a.{format}"), b"");
        let read = |k| Ok(frame(&sequence, k).particles);
        write::particles::particles(&path, None, 2, read).unwrap();
        let again = open(&path);
        assert_eq!(again.len(), 2, "{format}");
        for k in 0..2 {
            check_same(format, &frame(&sequence, k).particles, &frame(&again, k).particles);
        }
    }
    let error = write::particles::particles(&folder.file("a.ply", b"old"), None, 2, |k| {
        Ok(frame(&sequence, k).particles)
    });
    assert!(error.unwrap_err().to_string().contains("holds one frame, not 2"));
}

#[test]
fn radii_and_one_quantity_go_into_mmpld() {
    let folder = Folder::new("mmpld");
    let original = sample(7, DVec3::ONE);
    let path = folder.file("a.mmpld", b"");
    let frames = |k| Ok(sample(7 + k, DVec3::ONE));
    let fields = ["radius".to_string(), "charge".to_string()];
    assert!(write::particles::particles(&path, Some(&fields), 3, frames).unwrap().is_empty());
    let read = open(&path);
    assert_eq!(read.len(), 3);
    let found = frame(&read, 0).particles;
    for id in 0..original.len() {
        let radius = |particles: &Particles| particles.radius(particles.radii().unwrap(), id);
        assert_eq!(radius(&found), radius(&original));
        assert!(found.positions().world(id).abs_diff_eq(original.positions().world(id), 1e-6));
    }
    assert_eq!(frame(&read, 2).particles.len(), 9);
}

#[test]
fn what_fails_leaves_the_old_file() {
    let folder = Folder::new("fails");
    let path = folder.file("a.xyz", b"old");
    let sample = sample(3, DVec3::ZERO);
    let fails = |k| if k == 0 { Ok(sample.clone()) } else { Err(Error::Interrupted) };
    assert!(matches!(write::particles::particles(&path, None, 2, fails), Err(Error::Interrupted)));
    let unknown = write::particles::particles(&path, Some(&["speed".into()]), 1, |_| Ok(sample.clone()));
    let told = unknown.unwrap_err().to_string();
    assert!(told.contains("--fields") && told.contains("id velocity radius charge element bin"), "{told}");
    let extension = write::particles::particles(&folder.file("a.doc", b""), None, 1, |_| Ok(sample.clone()));
    assert!(extension.unwrap_err().to_string().contains(".xyz .dump .csv"));
    assert_eq!(std::fs::read(&path).unwrap(), b"old");
}

#[test]
fn columns_of_one_name_are_told_apart() {
    let folder = Folder::new("names");
    let mut columns = Columns::default();
    columns.positions.extend(&[DVec3::ZERO, DVec3::ONE]);
    let words = Values::Text { codes: vec![0, 1], names: vec!["gas".into(), "star".into()] };
    columns.attributes = vec![
        Attribute::new("type", 1, words),
        Attribute::new("time", 1, Values::F32(vec![1.5, 2.5])),
        Attribute::new("x", 1, Values::F32(vec![7.0, 8.0])),
        Attribute::new("X", 1, Values::F32(vec![9.0, 9.5])),
    ];
    columns.time = Some(3.0);
    let original = Particles::new(columns).unwrap();
    for (format, name) in [("dump", "x_2"), ("csv", "x_2"), ("ply", "x_2"), ("npy", "x"), ("npz", "x")] {
        let found = convert(&original, &folder.file(&format!("a.{format}"), b""));
        assert_eq!(found.positions().world(1), DVec3::ONE, "{format}");
        assert_eq!(found.attribute(name).unwrap().number(1, 0), 8.0, "{format}");
    }
    for format in ["usda", "glb"] {
        let path = folder.file(&format!("a.{format}"), b"");
        write::particles::particles(&path, None, 1, |_| Ok(original.clone())).unwrap();
    }
}

#[test]
fn words_that_a_format_cannot_hold_are_told() {
    let folder = Folder::new("words");
    let mut columns = Columns::default();
    columns.positions.extend(&[DVec3::ZERO, DVec3::ONE]);
    let names = vec!["big, red".to_string(), String::new()];
    columns.attributes = vec![Attribute::new("what", 1, Values::Text { codes: vec![0, 1], names })];
    let words = Particles::new(columns).unwrap();
    let write = |name: &str| {
        let path = folder.file(name, b"");
        let notes = write::particles::particles(&path, None, 1, |_| Ok(words.clone())).unwrap();
        (frame(&open(&path), 0).particles, notes)
    };
    let word = |particles: &Particles, id: usize| {
        let Values::Text { codes, names } = &particles.attribute("what").unwrap().values else { panic!() };
        names[codes[id] as usize].clone()
    };
    let (read, notes) = write("a.csv");
    assert_eq!((word(&read, 0), word(&read, 1), notes.len()), ("big, red".into(), String::new(), 0));
    let (read, notes) = write("a.xyz");
    assert_eq!((word(&read, 0), word(&read, 1)), ("big,_red".into(), "-".into()));
    assert!(notes[0].contains("'what': blanks in words are written as _"), "{notes:?}");
    let (read, notes) = write("a.ply");
    assert!(notes[0].contains("PLY has no words"), "{notes:?}");
    assert_eq!((word(&read, 0), word(&read, 1)), ("big, red".into(), String::new()));
}

#[test]
fn colors_come_back_as_the_light_that_they_are() {
    let folder = Folder::new("colors");
    // Half of the light, as sRGB in 8 and in 16 bits, and as linear floats.
    let scalars = |values: [Values; 3]| {
        let names = ["red", "green", "blue"].into_iter().zip(values);
        names.map(|(name, values)| Attribute::new(name, 1, values)).collect::<Vec<_>>()
    };
    let bytes = scalars([188, 255, 0].map(|it| Values::U8(vec![it, 0])));
    let words = scalars([188 * 257, 65535, 0].map(|it| Values::I32(vec![it, 0])));
    let light = vec![Attribute::new("Cd", 3, Values::F32(vec![0.5, 1.0, 0.0, 0.0, 0.0, 0.0]))];
    for attributes in [bytes, words, light] {
        let mut columns = Columns { attributes, ..Columns::default() };
        columns.positions.extend(&[DVec3::ZERO, DVec3::ONE]);
        let found = convert(&Particles::new(columns).unwrap(), &folder.file("a.usda", b""));
        let color = found.attribute("color").unwrap();
        let found = [0, 1, 2].map(|component| color.number(0, component));
        assert!((found[0] - 0.5).abs() < 3e-3 && found[1..] == [1.0, 0.0], "{found:?}");
    }
}
