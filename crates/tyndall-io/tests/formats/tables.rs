//! Tables of Arrow and Parquet: files that pyarrow wrote, and what is written here.

use std::path::Path;

use tyndall::particles::{Attribute, Columns, Particles, Values};
use tyndall::scene::wanted::Wanted;
use tyndall::{Cell, DVec3};
use tyndall_io::{Frame, Options, Sequence, write};

use super::{Folder, fixture, frame, open};

/// The same table, as pyarrow writes it: see `samples/make.py`.
const SAMPLES: [&str; 6] = [
    "groups_snappy.parquet",
    "version_2_zstd.parquet",
    "plain_gzip.parquet",
    "pages_lz4.parquet",
    "feather_lz4.feather",
    "stream.arrows",
];

fn numbers(particles: &Particles, name: &str) -> Vec<f64> {
    let attribute = particles.attribute(name).unwrap_or_else(|| panic!("no attribute {name}"));
    let count = particles.len() * attribute.components;
    (0..count).map(|it| attribute.number(it / attribute.components, it % attribute.components)).collect()
}

fn words(particles: &Particles, name: &str) -> Vec<String> {
    let Values::Text { codes, names } = &particles.attribute(name).unwrap().values else { panic!("{name}") };
    codes.iter().map(|&code| names[code as usize].clone()).collect()
}

fn kind(particles: &Particles, name: &str) -> (&'static str, usize) {
    let attribute = particles.attribute(name).unwrap_or_else(|| panic!("no attribute {name}"));
    (attribute.values.type_name(), attribute.components)
}

/// What `make.py` says of particle `k`.
fn check(what: &str, frame: &Frame) {
    let particles = &frame.particles;
    assert_eq!(particles.len(), 24, "{what}");
    for k in 0..24 {
        let wanted = DVec3::new(k as f64 * 0.5, 100.0 - k as f64, -3.25);
        assert_eq!(particles.positions().world(k), wanted, "{what}: particle {k}");
    }
    let all = |value: &dyn Fn(i64) -> f64| (0..24).map(value).collect::<Vec<_>>();
    let kinds = [
        ("id", ("i64", 1)),
        ("small", ("i32", 1)),
        ("byte", ("u8", 1)),
        ("flag", ("u8", 1)),
        ("half", ("f32", 1)),
        ("velocity", ("f32", 3)),
        ("pair", ("f64", 2)),
        ("count", ("f64", 1)),
        ("gap", ("f32", 1)),
        ("price", ("f64", 1)),
        ("when", ("f64", 1)),
        ("huge", ("f64", 1)),
    ];
    for (name, wanted) in kinds {
        assert_eq!(kind(particles, name), wanted, "{what}: {name}");
    }
    assert_eq!(numbers(particles, "id"), all(&|k| (k * 1_000_000_000_000) as f64), "{what}");
    assert_eq!(numbers(particles, "small"), all(&|k| (k - 12) as f64), "{what}");
    assert_eq!(numbers(particles, "byte"), all(&|k| (10 * k) as f64), "{what}");
    assert_eq!(numbers(particles, "flag"), all(&|k| (k % 3 == 0).into()), "{what}");
    assert_eq!(numbers(particles, "half"), all(&|k| k as f64 / 4.0), "{what}");
    assert_eq!(numbers(particles, "price"), all(&|k| k as f64 / 100.0), "{what}");
    assert_eq!(
        numbers(particles, "huge"),
        all(&|k| if k == 0 { u64::MAX as f64 } else { k as f64 }),
        "{what}"
    );
    let when = numbers(particles, "when");
    assert!((0..24).all(|k| (when[k] - (1e9 + 0.25 * k as f64)).abs() < 1e-6), "{what}: {when:?}");
    let velocity: Vec<f64> = (0..72).map(f64::from).collect();
    assert_eq!(numbers(particles, "velocity"), velocity, "{what}");
    assert_eq!(numbers(particles, "pair"), (0..48).map(f64::from).collect::<Vec<_>>(), "{what}");
    for (k, count) in numbers(particles, "count").into_iter().enumerate() {
        let wanted = if k % 5 == 4 { f64::NAN } else { k as f64 * 7.0 };
        assert!(count == wanted || count.is_nan() && wanted.is_nan(), "{what}: count {k} is {count}");
    }
    assert!((0..24).all(|k| numbers(particles, "gap")[k].is_nan() == (k % 2 == 1)), "{what}");
    let kinds: Vec<String> = (0..24).map(|k| ["gas", "star", ""][k % 3].to_string()).collect();
    assert_eq!(words(particles, "kind"), kinds, "{what}");
    let names: Vec<String> = (0..24).map(|k| format!("Ω{k} \"\"")).collect();
    assert_eq!(words(particles, "name"), names, "{what}");
    assert_eq!(particles.attribute("velocity").unwrap().unit.as_deref(), Some("km/s"), "{what}");
    assert_eq!(particles.length_unit(), Some("kpc"), "{what}");
    let said = |text: &str| frame.conventions.iter().any(|it| it.contains(text));
    assert!(
        said("'count' has nulls") && said("'huge' has nulls or numbers beyond"),
        "{:?}",
        frame.conventions
    );
    assert!(
        frame.warnings.iter().any(|it| it.contains("left out: 'ragged'")),
        "{what}: {:?}",
        frame.warnings
    );
    assert!(frame.warnings.iter().any(|it| it.contains("left out: 'blob'")), "{what}: {:?}", frame.warnings);
}

#[test]
fn what_pyarrow_writes_is_read_whole() {
    for name in SAMPLES {
        let sequence = open(&fixture("samples").join(name));
        let format = match name.rsplit('.').next() {
            Some("parquet") => "Parquet",
            Some("arrows") => "Arrow stream",
            _ => "Arrow",
        };
        assert_eq!((sequence.len(), sequence.format()), (1, format), "{name}");
        check(name, &frame(&sequence, 0));
    }
}

#[test]
fn positions_are_found_in_lists_and_structures() {
    for (name, said) in [
        ("vector.parquet", ""),
        ("lists.parquet", "'where' is taken as the positions"),
        ("structure.feather", ""),
    ] {
        let read = frame(&open(&fixture("samples").join(name)), 0);
        for k in 0..24 {
            let wanted = DVec3::new(k as f64 * 0.5, 100.0 - k as f64, -3.25);
            assert_eq!(read.particles.positions().world(k), wanted, "{name}: particle {k}");
        }
        assert_eq!(numbers(&read.particles, "mass"), vec![1.5; 24], "{name}");
        assert!(said.is_empty() || read.conventions.iter().any(|it| it == said), "{:?}", read.conventions);
    }
}

#[test]
fn names_of_columns_can_be_given() {
    let path = fixture("samples/lists.parquet");
    let read = |columns: &[&str]| {
        let columns = Some(columns.iter().map(|it| it.to_string()).collect());
        let options = Options { columns, ..Options::default() };
        Sequence::open(std::slice::from_ref(&path), &options, &()).and_then(|it| it.frame(0, &()))
    };
    let particles = read(&["pos", "weight", "other"]).unwrap().particles;
    assert_eq!(numbers(&particles, "weight"), vec![1.5; 24]);
    let message = read(&["x"]).err().unwrap().to_string();
    assert!(message.contains("there are 1 names for 3 columns"), "{message}");
    let message = read(&["a", "b", "c"]).map(|it| it.particles.len());
    assert_eq!(message.unwrap(), 24, "there is one vector of three");
}

#[test]
fn a_table_without_positions_lists_its_columns() {
    let folder = Folder::new("nowhere");
    for name in ["a.parquet", "a.arrow"] {
        let mut columns = Columns::default();
        columns.positions.extend(&[DVec3::ZERO; 3]);
        columns.attributes = vec![Attribute::new("mass", 1, Values::F32(vec![1.0; 3]))];
        let path = folder.file(name, b"");
        let particles = Particles::new(columns).unwrap();
        write::particles::particles(&path, None, 1, |_| Ok(particles.clone())).unwrap();
        let options =
            Options { columns: Some(["a", "b", "c", "d"].map(String::from).to_vec()), ..Options::default() };
        let read = Sequence::open(&[path], &options, &()).and_then(|it| it.frame(0, &()));
        let message = read.err().unwrap().to_string();
        assert!(message.contains(name) && message.contains("among the columns a, b, c, d"), "{message}");
        assert!(message.contains("--columns"), "{message}");
    }
}

#[test]
fn only_the_wanted_columns_are_read() {
    let wanted = |coloring: &str| Wanted { coloring: coloring.parse().unwrap(), ..Wanted::default() };
    for name in SAMPLES {
        let options = Options { wanted: Some(wanted("half")), ..Options::default() };
        let sequence = Sequence::open(&[fixture("samples").join(name)], &options, &()).unwrap();
        let particles = frame(&sequence, 0).particles;
        let names: Vec<&str> = particles.attributes().iter().map(|it| it.name.as_str()).collect();
        assert_eq!(names, ["half"], "{name}");
        assert_eq!(numbers(&particles, "half")[23], 5.75, "{name}");
    }
}

/// Particles in several row groups and blocks, with all that a file may have beside columns.
fn many(count: usize) -> Particles {
    let mut columns = Columns::default();
    let position = |k: usize| DVec3::new((k as f64).sin(), 0.25 * k as f64, (k % 1000) as f64);
    columns.positions.extend(&(0..count).map(position).collect::<Vec<_>>());
    let names: Vec<String> = (0..300).map(|k| format!("n{k}")).collect();
    let codes = (0..count as u32).map(|k| k.wrapping_mul(2_654_435_761) % 300).collect();
    columns.attributes = vec![
        Attribute::new("id", 1, Values::I64((0..count as i64).map(|k| k << 33).collect())),
        Attribute::new("force", 3, Values::F64((0..3 * count).map(|k| 1.0 / k as f64).collect())),
        Attribute::new("name", 1, Values::Text { codes, names }),
    ];
    columns.attributes[1].unit = Some("nN".to_string());
    columns.cell =
        Some(Cell { origin: DVec3::ONE, vectors: [DVec3::X, DVec3::Y, DVec3::Z], periodic: [true; 3] });
    columns.time = Some(0.1);
    columns.length_unit = Some("nm".to_string());
    columns.radii = Some(tyndall::particles::Radii::Uniform(0.3));
    Particles::new(columns).unwrap()
}

#[test]
fn many_rows_are_the_same_in_any_number_of_blocks() {
    let folder = Folder::new("groups");
    let original = many(600_000);
    for name in ["a.parquet", "a.arrow"] {
        let path = folder.file(name, b"");
        let notes = write::particles::particles(&path, None, 1, |_| Ok(original.clone())).unwrap();
        assert!(notes.is_empty(), "{notes:?}");
        let found = frame(&open(&path), 0).particles;
        assert_eq!(found.len(), original.len(), "{name}");
        assert_eq!(found.attribute("id").unwrap().values, original.attribute("id").unwrap().values, "{name}");
        assert_eq!(words(&found, "name"), words(&original, "name"), "{name}");
        for (component, axis) in ["fx", "fy", "fz"].into_iter().enumerate() {
            let force = found.attribute(axis).unwrap();
            assert_eq!((force.unit.as_deref(), force.values.type_name()), (Some("nN"), "f64"), "{name}");
            let all = original.attribute("force").unwrap();
            assert!((0..found.len()).all(|id| force.number(id, 0) == all.number(id, component)), "{name}");
        }
        for id in 0..found.len() {
            let [one, two] = [&found, &original].map(|it| it.positions().world(id));
            assert!(one.abs_diff_eq(two, 0.02), "{name}: {one}, not {two}");
        }
        assert_eq!(
            (found.cell(), found.time(), found.length_unit()),
            (original.cell(), Some(0.1), Some("nm"))
        );
        assert_eq!(found.radii(), original.radii(), "{name}");
    }
}

#[test]
fn what_is_damaged_names_its_place() {
    let folder = Folder::new("damaged");
    let message = |name: &str, bytes: &[u8]| {
        let path = folder.file(name, bytes);
        let read = Sequence::open(&[path], &Options::default(), &()).and_then(|it| it.frame(0, &()));
        read.err().unwrap_or_else(|| panic!("{name} is read")).to_string()
    };
    let sample = |name: &str| std::fs::read(fixture("samples").join(name)).unwrap();
    let bytes = sample("groups_snappy.parquet");
    assert!(message("a.parquet", &bytes[..bytes.len() - 1]).contains("does not end like Parquet"));
    assert!(message("b.parquet", b"PAR1\xff\xff\xff\x7fPAR1").contains("larger than the file"));
    let mut torn = bytes.clone();
    torn[4..40].fill(0xff);
    let told = message("c.parquet", &torn);
    assert!(told.contains("c.parquet") && told.contains("row group 1, column 'x"), "{told}");
    let bytes = sample("feather_lz4.feather");
    assert!(message("a.feather", &bytes[..bytes.len() - 6]).contains("does not end like one of Arrow"));
    let told = message("zstd.feather", &sample("../feather_zstd.feather"));
    assert!(told.contains("packed with zstd") && told.contains("lz4"), "{told}");
    let told = message("brotli.parquet", &sample("../brotli.parquet"));
    assert!(told.contains("BROTLI") && told.contains("zstd, snappy"), "{told}");
}

#[test]
fn a_stream_without_its_end_says_so() {
    let folder = Folder::new("stream");
    let bytes = std::fs::read(fixture("samples/stream.arrows")).unwrap();
    let read = frame(&open(&folder.file("a.arrows", &bytes[..bytes.len() - 8])), 0);
    assert_eq!(read.particles.len(), 24);
    assert!(read.warnings.iter().any(|it| it.contains("no mark at its end")), "{:?}", read.warnings);
    let cut = folder.file("b.arrows", &bytes[..bytes.len() - 9]);
    assert!(Sequence::open(&[cut], &Options::default(), &()).is_err());
}

#[test]
fn other_formats_are_not_taken_for_tables() {
    for name in ["lammps.dump", "protein.bcif", "arrays.npz", "snapshot.tipsy"] {
        let format = open(&fixture("samples").join(Path::new(name))).format().to_string();
        assert!(!format.contains("Arrow") && !format.contains("Parquet"), "{name}: {format}");
    }
}
