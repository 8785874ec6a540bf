//! LAMMPS dumps, XYZ and tables: own fixtures always, the shared real files where they are.

use std::path::PathBuf;
use std::sync::Mutex;

use serde_json::Value;
use tyndall::{DVec3, Error, Particles, Progress, Values};
use tyndall_io::{Options, Sequence};

use super::{Folder, check_frame, fixture, frame, gzip, open, shared, vector, zstd};

#[test]
fn a_scaled_triclinic_dump_with_image_flags_is_read() {
    let sequence = open(&fixture("triclinic_scaled.dump"));
    assert_eq!((sequence.len(), sequence.format()), (2, "LAMMPS dump (text)"));
    assert_eq!(sequence.name(1), "triclinic_scaled.dump[1]");
    let first = frame(&sequence, 0);
    assert_eq!(first.conventions[0], "coordinates: xs ys zs (scaled by the triclinic cell)");
    let particles = &first.particles;
    assert_eq!((particles.len(), particles.length_unit(), particles.time()), (3, Some("Å"), Some(0.0)));
    // a = (10, 0, 0), b = (2, 8, 0), c = (-1, 1, 6), origin (1, 2, 3).
    assert!(particles.positions().world(2).abs_diff_eq(DVec3::new(6.5, 6.5, 6.0), 1e-5));
    assert_eq!(particles.attribute("ix").unwrap().values, Values::I32(vec![0, 1, -1]));
    assert_eq!(frame(&sequence, 1).particles.len(), 1);
}

#[test]
fn extended_xyz_of_odd_spelling_is_read() {
    let sequence = open(&fixture("odd.xyz"));
    assert_eq!(sequence.len(), 3);
    let particles = frame(&sequence, 0).particles;
    assert_eq!(particles.attribute("charge").unwrap().values, Values::F32(vec![0.5, -0.5]));
    assert_eq!(particles.cell().unwrap().periodic, [true, true, false]);
    assert_eq!(frame(&sequence, 1).particles.attribute("type").unwrap().values, Values::I32(vec![3]));
    assert!(frame(&sequence, 2).particles.is_empty());
}

#[test]
fn a_semicolon_table_with_decimal_commas_is_read() {
    let sequence = open(&fixture("comma.csv"));
    let frame = frame(&sequence, 0);
    assert_eq!(frame.particles.positions().world(1), DVec3::new(4.5, 5.25, 0.0));
    assert_eq!(frame.particles.attribute("speed").unwrap().unit.as_deref(), Some("m/s"));
    assert_eq!(frame.conventions, ["two-dimensional: z = 0", "decimal commas"]);
}

#[test]
fn a_long_table_is_the_same_mapped_and_streamed() {
    let folder = Folder::new("long");
    // More than a block of 16 MiB; a column that turns from integers to floats on the way.
    let row = |k: u64| format!("{k},{}.25,-{k}e-3,{}\n", k % 977, if k == 900_000 { "0.5" } else { "7" });
    let text: String = std::iter::once("x,y,z,id\n".to_string()).chain((0..1_000_000).map(row)).collect();
    let plain = frame(&open(&folder.file("a.csv", text.as_bytes())), 0).particles;
    assert!(text.len() > 17 << 20 && plain.len() == 1_000_000);
    assert_eq!(plain.attribute("id").unwrap().values.type_name(), "f32");
    for (name, packed) in [("a.csv.gz", gzip(text.as_bytes())), ("a.csv.zst", zstd(text.as_bytes()))] {
        let streamed = frame(&open(&folder.file(name, &packed)), 0).particles;
        assert!(
            streamed.positions() == plain.positions() && streamed.attributes() == plain.attributes(),
            "{name}"
        );
    }
}

/// Many frames of changing size; the rows tell the frame.
fn trajectory(frames: usize) -> Vec<u8> {
    let mut text = String::new();
    for k in 0..frames {
        let count = 100 + 37 * (k % 3);
        text += &format!("{count}\nTime={k}\n");
        for row in 0..count {
            text += &format!("{row} {k}.25 {row}.5 -1e0\n");
        }
    }
    text.into_bytes()
}

fn check_trajectory(sequence: &Sequence, order: impl Iterator<Item = usize>) {
    for k in order {
        let particles = frame(sequence, k).particles;
        assert_eq!((particles.len(), particles.time()), (100 + 37 * (k % 3), Some(k as f64)), "frame {k}");
        assert!(particles.positions().world(7).abs_diff_eq(DVec3::new(k as f64 + 0.25, 7.5, -1.0), 1e-4));
    }
}

#[test]
fn frames_are_found_in_any_order_and_compression() {
    let folder = Folder::new("order");
    let text = trajectory(60);
    // Members of a gzip file end anywhere, here in the middle of a line.
    let (front, back) = text.split_at(text.len() / 2 + 1);
    let plain = folder.file("a.xyz", &text);
    let packed = folder.file("a.xyz.gz", &[gzip(front), gzip(back)].concat());
    let zstd = folder.file("a.zst", &zstd(&text));
    for path in [&plain, &packed, &zstd] {
        let sequence = open(path);
        assert_eq!(sequence.len(), 60);
        check_trajectory(&sequence, [0, 59, 3, 4, 30, 29].into_iter());
    }
    // Two compressed files together are not kept unpacked: frames are reached by unpacking on, or again.
    let both = Sequence::open(&[packed, plain, zstd], &Options::default(), &()).unwrap();
    assert_eq!((both.len(), both.format()), (180, "XYZ (text, gzip)"));
    check_trajectory(&both, [0, 1, 59, 3, 58].into_iter());
    let last = frame(&both, 120 + 17).particles;
    assert_eq!(last.time(), Some(17.0));
    std::thread::scope(|scope| {
        for thread in 0..4 {
            let both = &both;
            scope.spawn(move || check_trajectory(both, (thread..60).step_by(7)));
        }
    });
}

/// Notes what it is told, and stops the work once it was told of more than so many bytes.
struct Listener {
    stages: Mutex<Vec<(String, Option<u64>, u64)>>,
    patience: u64,
}

impl Listener {
    fn new(patience: u64) -> Self {
        Self { stages: Mutex::default(), patience }
    }

    /// The stages: name, total, how much of it was done.
    fn stages(self) -> Vec<(String, Option<u64>, u64)> {
        self.stages.into_inner().unwrap()
    }
}

impl Progress for Listener {
    fn begin(&self, stage: &str, total: Option<u64>, _unit: &'static str) {
        self.stages.lock().unwrap().push((stage.to_string(), total, 0));
    }

    fn advance(&self, amount: u64) {
        self.stages.lock().unwrap().last_mut().unwrap().2 += amount;
    }

    fn cancelled(&self) -> bool {
        self.stages.lock().unwrap().last().is_some_and(|stage| stage.2 > self.patience)
    }
}

/// A trajectory of about 40 MB, plain and compressed, which saves little.
fn long_trajectories(folder: &Folder) -> [PathBuf; 3] {
    let digits = |k: u32, prime: u32| k.wrapping_mul(prime) % 1_000_000_007;
    let row = |k| format!("Cu {} 2.{} {}\n", digits(k, 2_654_435_761), digits(k, 97_711), digits(k, 65_537));
    let rows: String = (0..100_000).map(row).collect();
    let frame = format!("100000\nProperties=species:S:1:pos:R:3\n{rows}");
    let text = frame.repeat(10).into_bytes();
    let (packed, zstd) = (gzip(&text), zstd(&text));
    [folder.file("a.xyz", &text), folder.file("a.xyz.gz", &packed), folder.file("a.xyz.zst", &zstd)]
}

#[test]
fn opening_tells_how_much_of_the_files_it_has_seen() {
    let folder = Folder::new("told");
    let mut paths = long_trajectories(&folder).to_vec();
    paths.push(fixture("comma.csv"));
    paths.push(fixture("aligned.npy"));
    let bytes = |path: &PathBuf| std::fs::metadata(path).unwrap().len();
    let total = paths.iter().map(bytes).sum();
    let listener = Listener::new(u64::MAX);
    Sequence::open(&paths, &Options::default(), &listener).unwrap();
    assert_eq!(listener.stages(), [("open".to_string(), Some(total), total)]);
}

#[test]
fn opening_ends_soon_after_it_is_cancelled() {
    let folder = Folder::new("cancelled");
    for path in long_trajectories(&folder) {
        let bytes = std::fs::metadata(&path).unwrap().len();
        let listener = Listener::new(bytes / 10);
        let opened = Sequence::open(std::slice::from_ref(&path), &Options::default(), &listener);
        assert!(matches!(opened.err(), Some(Error::Interrupted)), "{}", path.display());
        let (_, _, told) = listener.stages()[0].clone();
        assert!(told < bytes / 2, "{told} of {bytes} bytes of {}", path.display());
    }
}

#[test]
fn reading_on_in_a_compressed_file_can_be_cancelled() {
    let folder = Folder::new("cancelled-frame");
    // Two files, so that neither is kept unpacked.
    let sequence = Sequence::open(&long_trajectories(&folder)[1..], &Options::default(), &()).unwrap();
    let listener = Listener::new(0);
    listener.begin("other work", None, "B");
    listener.advance(1);
    assert!(matches!(sequence.frame(9, &listener).err(), Some(Error::Interrupted)));
    assert_eq!(listener.stages().len(), 1, "no stage begins any more");
}

#[test]
fn unpacking_whole_content_is_told_and_can_be_cancelled() {
    let folder = Folder::new("unpacked");
    let rows: Vec<u8> = (0..6_000_000u32).flat_map(|k| ((k % 4096) as f32).to_le_bytes()).collect();
    let header = format!("{:117}\n", "{'descr': '<f4', 'fortran_order': False, 'shape': (2000000, 3), }");
    let npy = [b"\x93NUMPY\x01\0\x76\0", header.as_bytes(), &rows].concat();
    let path = folder.file("a.npy.gz", &gzip(&npy));
    let bytes = std::fs::metadata(&path).unwrap().len();
    let sequence = open(&path);
    let listener = Listener::new(u64::MAX);
    assert_eq!(sequence.frame(0, &listener).unwrap().particles.len(), 2_000_000);
    assert_eq!(listener.stages()[0], ("unpack".to_string(), Some(bytes), bytes));
    let listener = Listener::new(0);
    assert!(matches!(sequence.frame(0, &listener).err(), Some(Error::Interrupted)));
    assert!(listener.stages()[0].2 < bytes);
}

#[test]
fn truncated_files_give_their_whole_frames_or_fail() {
    let folder = Folder::new("cut");
    let text = trajectory(10);
    let packed = gzip(&text);
    let strict = Options { strict: true, ..Options::default() };
    for (name, bytes) in
        [("plain.xyz", &text[..text.len() - 200]), ("packed.gz", &packed[..packed.len() - 100])]
    {
        let path = folder.file(name, bytes);
        let sequence = open(&path);
        let whole = sequence.len();
        assert!((8..10).contains(&whole), "{name}: {whole}");
        check_trajectory(&sequence, 0..whole);
        let next = whole + 1;
        let wanted = format!(
            "{name} ends inside frame {next} of ≥{next} — {whole} whole frames read (use --strict to fail)"
        );
        assert_eq!(frame(&sequence, 0).warnings, [wanted]);
        assert!(Sequence::open(&[path], &strict, &()).is_err());
    }
    let nothing = folder.file("nothing.xyz", &text[..50]);
    let error = Sequence::open(&[nothing], &Options::default(), &()).err().unwrap().to_string();
    assert!(error.contains("ends inside its first frame"), "{error}");
    let table = gzip(
        "x,y,z\n"
            .bytes()
            .chain((0..9000).flat_map(|k| format!("{k},{},3\n", k * k).into_bytes()))
            .collect::<Vec<_>>()
            .as_slice(),
    );
    let table = folder.file("t.csv.gz", &table[..table.len() - 2000]);
    let read = frame(&open(&table), 0);
    assert!(
        !read.particles.is_empty() && read.warnings[0].contains("ends inside its compressed data"),
        "{:?}",
        read.warnings
    );
    assert!(Sequence::open(&[table], &strict, &()).unwrap().frame(0, &()).is_err());
}

#[test]
fn what_is_dropped_is_said() {
    let folder = Folder::new("dropped");
    let rows: String = (0..1500).map(|k| if k < 1204 { "nan,0,0,1\n" } else { "1,2,3,1\n" }).collect();
    let path = folder.file("a.csv", format!("x,y,z,radius\n{rows}0,0,0,-1\n").as_bytes());
    let wanted = "dropped 1,205 of 1,501 particles (1,204 NaN positions, 1 radius < 0)";
    assert_eq!(frame(&open(&path), 0).warnings, [wanted]);
}

#[test]
fn damaged_and_hostile_files_fail_kindly() {
    let folder = Folder::new("hostile");
    let mut damaged = gzip(&trajectory(50));
    let middle = damaged.len() / 2;
    damaged[middle..middle + 64].fill(0xff);
    let huge =
        format!("ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n{}\nITEM: ATOMS x y z\n1 2 3\n", 1u64 << 60);
    let cases = [
        ("damaged.gz", damaged),
        ("huge.dump", huge.into_bytes()),
        ("empty.csv", Vec::new()),
        ("empty.gz", gzip(b"")),
        ("short.gz", vec![0x1f, 0x8b, 8]),
        ("zeros.bin", vec![0; 4096]),
    ];
    for (name, bytes) in cases {
        let path = folder.file(name, &bytes);
        let read = Sequence::open(&[path], &Options::default(), &()).and_then(|it| it.frame(0, &()));
        let error = read.err().unwrap_or_else(|| panic!("{name} was read")).to_string();
        assert!(error.contains(name), "{error}");
    }
}

#[test]
fn altered_files_never_panic() {
    let folder = Folder::new("altered");
    let texts =
        ["triclinic_scaled.dump", "odd.xyz", "comma.csv"].map(|name| std::fs::read(fixture(name)).unwrap());
    let pieces: [&[u8]; 10] =
        [b"\n", b" ", b"\"", b",", b"-1", b"99999999999999999999", b"nan", b"\0", b"=", b"ITEM: ATOMS"];
    for seed in 0..600u64 {
        let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
        let mut random = |below: usize| {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 33) as usize % below
        };
        let mut text = texts[seed as usize % 3].clone();
        for _ in 0..1 + random(3) {
            let place = random(text.len());
            match random(3) {
                0 => text.truncate(place.max(1)),
                1 => text[place] = random(256) as u8,
                _ => drop(text.splice(place..place, pieces[random(pieces.len())].iter().copied())),
            }
        }
        let packed = seed % 5 == 0;
        let path = folder.file("altered", &if packed { gzip(&text) } else { text });
        if let Ok(sequence) = Sequence::open(&[path], &Options::default(), &()) {
            println!("seed {seed}: {} frames", sequence.len());
            (0..sequence.len()).for_each(|k| drop(sequence.frame(k, &())));
        }
    }
}

/// The attributes of a dump that OVITO shows under a name of its own.
fn own_names(name: &str) -> Vec<&str> {
    match name {
        "Particle Identifier" => vec!["id"],
        "Particle Type" => vec!["type"],
        "Velocity" => vec!["vx", "vy", "vz"],
        "Angular Velocity" => vec!["omegax", "omegay", "omegaz"],
        "Periodic Image" => vec!["ix", "iy", "iz"],
        "Radius" => vec!["radius"],
        "Position" | "Velocity Magnitude" => vec![],
        other => vec![other],
    }
}

fn check_dump(name: &str, particles: &Particles, expected: &Value) {
    let coordinates = ["x", "y", "z", "xs", "ys", "zs"];
    let columns: Vec<&str> =
        expected["file_columns"].as_array().unwrap().iter().map(|it| it.as_str().unwrap()).collect();
    let columns: Vec<&str> = columns.into_iter().filter(|it| !coordinates.contains(it)).collect();
    let found: Vec<&str> = particles.attributes().iter().map(|it| it.name.as_str()).collect();
    assert_eq!(found, columns, "{name}");
    for (end, place) in [("first", 0), ("last", particles.len() - 1)] {
        for (theirs, value) in expected[end].as_object().unwrap() {
            for (component, ours) in own_names(theirs).into_iter().enumerate() {
                let wanted = value.as_f64().or(value[component].as_f64()).unwrap();
                let found = particles.attribute(ours).unwrap().number(place, 0);
                assert!(
                    (found - wanted).abs() <= 1e-5 * wanted.abs(),
                    "{name}: {end} {ours} is {found}, wanted {wanted}"
                );
            }
        }
    }
    let (cell, matrix) = (particles.cell().unwrap(), &expected["cell_matrix_columns_a_b_c_origin"]);
    for (edge, found) in cell.vectors.into_iter().chain([cell.origin]).enumerate() {
        assert!(found.abs_diff_eq(vector(&matrix[edge]), 1e-5), "{name}: {found}, wanted {}", matrix[edge]);
    }
    let pbc: Vec<bool> = expected["pbc"].as_array().unwrap().iter().map(|it| it.as_bool().unwrap()).collect();
    assert_eq!(cell.periodic.to_vec(), pbc, "{name}");
    if let (Some(counts), Some(kind)) = (expected["type_counts"].as_object(), particles.attribute("type")) {
        for (value, count) in counts {
            let value: f64 = value.parse().unwrap();
            let found = (0..particles.len()).filter(|&id| kind.number(id, 0) == value).count();
            assert_eq!(found as u64, count.as_u64().unwrap(), "{name}: type {value}");
        }
    }
}

fn check_table(name: &str, particles: &Particles, expected: &Value) {
    let places: Vec<u64> =
        expected["position_columns"].as_array().unwrap().iter().map(|it| it.as_u64().unwrap()).collect();
    let names = expected["attributes"].as_array().unwrap();
    for (end, place) in [("first", 0), ("last", particles.len() - 1)] {
        for (column, wanted) in expected[end].as_array().unwrap().iter().enumerate() {
            let wanted = wanted.as_f64().unwrap();
            let found = match places.iter().position(|&it| it == column as u64) {
                Some(axis) => particles.positions().world(place)[axis],
                None => particles.attribute(names[column].as_str().unwrap()).unwrap().number(place, 0),
            };
            assert!(
                (found - wanted).abs() <= 1e-5 * wanted.abs().max(1.0),
                "{name}: {end} {column} is {found}, wanted {wanted}"
            );
        }
    }
    assert_eq!(particles.attributes().len() + 3, names.len(), "{name}");
}

#[test]
fn the_shared_files_hold_what_other_programs_find() {
    let Some((folder, all)) = shared() else { return };
    let text = ["csv/", "lammps/", "sph/", "xyz/"];
    let mut count = 0;
    for (name, entry) in all["files"].as_object().unwrap() {
        let known =
            text.iter().any(|it| name.starts_with(it)) && !name.ends_with(".data") && !name.ends_with(".bin");
        if !known {
            continue;
        }
        count += 1;
        let expected = &entry["expected"];
        let sequence = open(&folder.join(name));
        assert_eq!(sequence.len() as u64, expected["frames"].as_u64().unwrap(), "{name}");
        let first = frame(&sequence, 0);
        assert!(first.warnings.is_empty(), "{name}: {:?}", first.warnings);
        check_frame(name, &first.particles, expected);
        if name.starts_with("csv/") {
            check_table(name, &first.particles, expected);
        } else if name.starts_with("lammps/") || name.starts_with("sph/") {
            check_dump(name, &first.particles, expected);
        }
        if expected["last_frame"].is_object() {
            let last = frame(&sequence, sequence.len() - 1);
            check_frame(name, &last.particles, &expected["last_frame"]);
        }
        for (k, count) in expected["particles_per_frame"].as_array().into_iter().flatten().enumerate() {
            assert_eq!(
                frame(&sequence, k).particles.len() as u64,
                count.as_u64().unwrap(),
                "{name}: frame {k}"
            );
        }
        if let Some(types) = expected["type_names"].as_object() {
            let Values::Text { names, .. } = &first.particles.attribute("element").unwrap().values else {
                panic!("{name}")
            };
            assert_eq!(names.len(), types.len(), "{name}");
        }
    }
    assert_eq!(count, 13);
}

#[test]
fn the_shared_extended_xyz_has_its_cell_and_attributes() {
    let Some((folder, all)) = shared() else { return };
    let name = "xyz/extended.xyz";
    let expected = &all["files"][name]["expected"];
    let sequence = open(&folder.join(name));
    let first = frame(&sequence, 0).particles;
    let names: Vec<&str> = first.attributes().iter().map(|it| it.name.as_str()).collect();
    assert_eq!(names, ["species", "CS"]);
    let cell = first.cell().unwrap();
    for (edge, found) in cell.vectors.into_iter().enumerate() {
        assert!(found.abs_diff_eq(vector(&expected["cell"][edge]), 1e-5), "{found}");
    }
    assert_eq!(cell.periodic, [true; 3]);
    let last = frame(&sequence, 2).particles;
    let kinds: Vec<(&str, usize, &str)> =
        last.attributes().iter().map(|it| (it.name.as_str(), it.components, it.values.type_name())).collect();
    assert_eq!(kinds, [("species", 1, "text"), ("bool", 1, "u8"), ("int", 1, "i32"), ("strings", 2, "text")]);
}

#[test]
fn a_wrong_expectation_raises_the_alarm() {
    let particles = frame(&open(&fixture("triclinic_scaled.dump")), 0).particles;
    let bounds = serde_json::json!({"min": [0.0, 0.0, 0.0], "max": [1.0, 1.0, 1.0]});
    let wrong = serde_json::json!({"particles": 3, "bounds": bounds});
    let alarm = std::panic::catch_unwind(|| check_frame("altered", &particles, &wrong));
    assert!(alarm.is_err());
}

#[test]
fn a_grid_is_no_particles() {
    let Some((folder, _)) = shared() else { return };
    let grid = Sequence::open(&[folder.join("volume/hf.dx")], &Options::default(), &());
    assert!(grid.is_err(), "a grid was opened as particles");
}

#[test]
fn a_mark_of_utf8_in_front_of_a_text_is_no_part_of_it() {
    let folder = Folder::new("mark");
    for name in [
        "lammps.dump",
        "lammps.data",
        "extended.xyz",
        "gromacs.gro",
        "protein.pdb",
        "protein.cif",
        "text.ply",
        "legacy_text.vtk",
        "text.vtp",
        "houdini.geo",
        "maya.pda",
        "table.csv",
        "universal.usda",
        "cloud.pts",
        "vasp.poscar",
        "atomeye.cfg",
        "atoms.imd",
        "scanner.ptx",
    ] {
        let path = fixture("samples").join(name);
        let (plain, wanted) = (std::fs::read(&path).unwrap(), frame(&open(&path), 0).particles);
        let marked = [b"\xef\xbb\xbf", &plain[..]].concat();
        for (name, bytes) in [(name.to_string(), marked.clone()), (format!("{name}.gz"), gzip(&marked))] {
            let found = frame(&open(&folder.file(&name, &bytes)), 0).particles;
            assert!(found.positions() == wanted.positions(), "{name}");
            // As text, in which NaN is as NaN.
            let [found, wanted] = [&found, &wanted].map(|it| format!("{:?}", it.attributes()));
            assert_eq!(found, wanted, "{name}");
        }
    }
}
