//! The files are written by h5py, that is by HDF5's C library: see make.py beside them.

use std::path::PathBuf;

use tyndall::scene::coloring::Coloring;
use tyndall::scene::wanted::Wanted;
use tyndall::{DVec3, Particles, Values};

use super::*;
use crate::read::real_data;
use crate::sequence::Sequence;

fn path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/hdf5").join(name)
}

fn open_with(name: &str, options: &Options) -> Result<Sequence> {
    Sequence::open(&[path(name)], options, &())
}

fn open(name: &str) -> Sequence {
    open_with(name, &Options::default()).unwrap_or_else(|error| panic!("{error}"))
}

fn types(words: &[&str]) -> Options {
    Options { types: Some(words.iter().map(|it| it.to_string()).collect()), ..Options::default() }
}

fn numbers(particles: &Particles, name: &str) -> Vec<f64> {
    let attribute = particles.attribute(name).unwrap_or_else(|| panic!("no {name}"));
    (0..attribute.values.len()).map(|place| attribute.values.number(place)).collect()
}

fn at(particles: &Particles, id: usize) -> [f64; 3] {
    particles.positions().world(id).to_array()
}

#[test]
fn a_swift_snapshot_goes_through_its_filters() {
    for name in ["swift.hdf5", "swift_latest.hdf5"] {
        let sequence = open(name);
        assert_eq!((sequence.len(), sequence.format()), (1, "SWIFT HDF5"));
        let frame = sequence.frame(0, &()).unwrap();
        let particles = &frame.particles;
        assert_eq!((particles.len(), at(particles, 7)), (8, [7.0, 7.25, 7.5]));
        assert_eq!(numbers(particles, "Masses"), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]);
        assert_eq!(particles.attribute("ParticleIDs").unwrap().values, Values::I64((100..108).collect()));
        let lengths = numbers(particles, "SmoothingLengths");
        assert!(lengths[4] == f64::from(0.4f32) && lengths[5].is_nan());
        assert_eq!(&numbers(particles, "Flags")[..5], [1.0, 0.0, 1.0, 0.0, 1.0]);
        assert_eq!(particles.attribute("Velocities").unwrap().number(6, 1), 6.0);
        let names = ["gas", "star"].map(String::from).to_vec();
        let kinds = Values::Text { codes: vec![0, 0, 0, 0, 0, 1, 1, 1], names };
        assert_eq!(particles.attribute("type").unwrap().values, kinds);
        assert_eq!(particles.cell().unwrap().vectors[0], DVec3::X * 8.0);
        assert_eq!((particles.time(), particles.time_unit()), (Some(0.5), Some("a")), "the scale factor");
        assert_eq!(particles.length_unit(), Some("cMpc"));
        assert!(frame.conventions[0].contains("a = 0.5") && !frame.conventions[0].contains("h ="));
        // The latter says its kernel.
        let gamma = if name == "swift.hdf5" { 1.825742 } else { 1.936492 };
        let radii = numbers(particles, "SupportRadius");
        assert!((radii[4] - gamma * lengths[4]).abs() < 1e-7 && radii[5].is_nan());
        let said = format!("SupportRadius is {gamma} times SmoothingLengths");
        assert!(frame.conventions.iter().any(|it| it.contains(&said)), "{:?}", frame.conventions);
        assert!(frame.warnings.is_empty(), "{:?}", frame.warnings);
    }
}

#[test]
fn radii_of_kernels_are_there_where_they_are_wanted() {
    let read = |name: &str| {
        let wanted = Wanted {
            coloring: Coloring::Constant([0.0; 3]),
            optional: vec![name.into()],
            ..Wanted::default()
        };
        let options = Options { wanted: Some(wanted), ..types(&["gas"]) };
        let particles = open_with("swift.hdf5", &options).unwrap().frame(0, &()).unwrap().particles;
        ["SmoothingLengths", "SupportRadius"].map(|name| particles.attribute(name).is_some())
    };
    assert_eq!(read("SupportRadius"), [false, true]);
    assert_eq!(read("SmoothingLengths"), [true, false]);
    assert_eq!(read("Flags"), [false; 2]);
}

#[test]
fn wanted_types_alone_are_read() {
    let read = |words: &[&str]| open_with("swift.hdf5", &types(words)).unwrap().frame(0, &());
    let stars = read(&["stars"]).unwrap().particles;
    assert_eq!((stars.len(), at(&stars, 0)), (3, [5.0, 5.25, 5.5]));
    assert!(stars.attribute("SmoothingLengths").is_none());
    assert_eq!(read(&["0"]).unwrap().particles.len(), 5);
    let message = read(&["neutrino"]).unwrap_err().to_string();
    assert!(message.contains("gas, star"), "{message}");
    assert!(read(&["planet"]).is_err());
    assert!(open_with("candidates.h5", &types(&["gas"])).is_err());
}

#[test]
fn the_files_of_a_snapshot_are_one_frame_with_masses_of_the_table() {
    let paths = [path("snap_007.0.hdf5"), path("snap_007.1.hdf5")];
    for named in [vec![paths[1].clone()], paths.to_vec()] {
        let sequence = Sequence::open(&named, &Options::default(), &()).unwrap();
        assert_eq!((sequence.len(), sequence.format()), (1, "Gadget HDF5, 2 files"));
        let frame = sequence.frame(0, &()).unwrap();
        let particles = &frame.particles;
        assert_eq!(numbers(particles, "ParticleIDs"), [0.0, 1.0, 2.0, 10.0, 11.0, 12.0]);
        assert_eq!(numbers(particles, "Masses"), [2.0, 0.5, 0.5, 3.0, 0.5, 0.5]);
        assert_eq!((at(particles, 2), at(particles, 5)), ([7.0, 8.0, 9.0], [8.0, 9.0, 10.0]));
        assert!(numbers(particles, "InternalEnergy")[1].is_nan());
        assert!(
            frame.conventions[0].contains("a = 0.25") && frame.conventions[0].contains("1/h with h = 0.7")
        );
        assert!(frame.warnings.is_empty(), "{:?}", frame.warnings);
    }
}

#[test]
fn of_a_file_that_points_to_its_parts_the_parts_are_read() {
    let sequence = open("virtual.hdf5");
    assert_eq!(sequence.format(), "SWIFT HDF5, 2 files");
    let frame = sequence.frame(0, &()).unwrap();
    assert_eq!((frame.particles.len(), at(&frame.particles, 3)), (4, [13.0, 14.0, 15.0]));
    assert!(frame.warnings.is_empty(), "{:?}", frame.warnings);
    // With its parts it is still one frame.
    let all = ["virtual.hdf5", "virtual.0.hdf5", "virtual.1.hdf5"].map(path);
    assert_eq!(Sequence::open(&all, &Options::default(), &()).unwrap().len(), 1);
}

#[test]
fn a_filter_that_is_not_built_in_is_named_with_a_way_out() {
    let zstd = open("zstd.h5").frame(0, &()).unwrap().particles;
    assert_eq!((zstd.len(), at(&zstd, 999)), (1000, [2997.0, 2998.0, 2999.0]));
    let message = open("blosc.h5").frame(0, &()).unwrap_err().to_string();
    assert!(message.contains("Coordinates") && message.contains("filter 32001 (Blosc)"), "{message}");
    assert!(message.contains("h5repack"), "{message}");
}

#[test]
fn what_is_no_quantity_or_needs_another_filter_is_left_out() {
    let frame = open("left_out.h5").frame(0, &()).unwrap();
    let names: Vec<&str> = frame.particles.attributes().iter().map(|it| it.name.as_str()).collect();
    assert_eq!((frame.particles.len(), &names[..]), (4, &["mass"][..]));
    let warnings = frame.warnings.join("; ");
    for part in ["nothing (0 numbers", "spectrum (5000 numbers", "packed (it needs HDF5 filter 32001 (Blosc)"]
    {
        assert!(warnings.contains(part), "{part}: {warnings}");
    }
}

#[test]
fn groups_that_hold_each_other_are_looked_into_once() {
    let begin = std::time::Instant::now();
    assert_eq!(open("circle.h5").frame(0, &()).unwrap().particles.len(), 2);
    // Else the twelve links of each of eight levels are four hundred million groups.
    assert!(begin.elapsed().as_secs() < 20);
}

#[test]
fn linked_data_sets_are_measured_by_the_files_that_they_are_in() {
    assert_eq!(open("linked.h5").frame(0, &()).unwrap().particles.len(), 100_000);
}

#[test]
fn h5md_has_frames_fixed_and_varying_elements_and_a_box() {
    let sequence = open("fixed_and_varying.h5md");
    assert_eq!((sequence.len(), sequence.format()), (3, "H5MD"));
    for frame in 0..3 {
        let read = sequence.frame(frame, &()).unwrap();
        let particles = &read.particles;
        let first = 6.0 * frame as f64;
        assert_eq!(at(particles, 1), [first + 3.0, first + 4.0, first + 5.0]);
        // Velocities are there at steps 0 and 20.
        assert_eq!(numbers(particles, "velocity")[0], if frame == 2 { 106.0 } else { 100.0 });
        let names = ["H", "O"].map(String::from).to_vec();
        assert_eq!(particles.attribute("species").unwrap().values, Values::Text { codes: vec![1, 0], names });
        assert_eq!(numbers(particles, "mass"), [16.0, 1.0]);
        let cell = particles.cell().unwrap();
        assert_eq!(cell.vectors[1], DVec3::Y * (5.0 + frame as f64));
        assert_eq!(cell.periodic, [true, false, true]);
        assert_eq!((particles.time(), particles.length_unit()), (Some(5.0 * frame as f64), Some("nm")));
        assert!(read.warnings[0].contains("particles/ions"), "{:?}", read.warnings);
    }
    let ions = Options { dataset: Some("ions".into()), ..Options::default() };
    assert_eq!(open_with("fixed_and_varying.h5md", &ions).unwrap().frame(0, &()).unwrap().particles.len(), 1);
    let none = Options { dataset: Some("gas".into()), ..Options::default() };
    assert!(open_with("fixed_and_varying.h5md", &none).err().unwrap().to_string().contains("atoms, ions"));
}

#[test]
fn lists_of_pairs_in_h5md_are_bonds() {
    let read = |group: &str, frame: usize| {
        let options = Options { dataset: Some(group.into()), ..Options::default() };
        let frame = open_with("bonds.h5md", &options).unwrap().frame(frame, &()).unwrap();
        (frame.particles.bonds().to_vec(), frame)
    };
    // Ids 30, 10, 20, 40 are places 0, 1, 2, 3; a pair is told twice, and one particle is not there.
    for frame in 0..2 {
        let (bonds, read) = read("atoms", frame);
        assert_eq!(bonds, [[0, 3], [1, 2]]);
        assert!(
            read.conventions[0].starts_with("bonds: connectivity/bonds, by the ids"),
            "{:?}",
            read.conventions
        );
        assert!(read.warnings[0].contains("left out 1 bonds"), "{:?}", read.warnings);
        assert_eq!(read.particles.attributes().len(), 1, "the ids");
    }
    // Lists that change, the first filled up with the file's own number.
    assert_eq!([read("beads", 0).0, read("beads", 1).0], [vec![[0, 1]], vec![[0, 2], [1, 2]]]);
    assert!(read("beads", 0).1.warnings.iter().all(|it| it.contains("particles/")));
    assert_eq!([read("grains", 0).0, read("grains", 1).0], [vec![[0, 1], [0, 2]], vec![[0, 1], [1, 2]]]);
    let said = read("grains", 1).1.conventions;
    assert_eq!(
        said,
        [
            "bonds: particles/grains/connectivity, connectivity/grains/more, by the places of particles, from 0"
        ]
    );
    assert!(open("fixed_and_varying.h5md").frame(0, &()).unwrap().particles.bonds().is_empty());
}

#[test]
fn openpmd_is_read_in_si_units() {
    let sequence = open("series.h5");
    assert_eq!((sequence.len(), sequence.format()), (2, "openPMD 1.1.0 HDF5"));
    let frame = sequence.frame(1, &()).unwrap();
    let particles = &frame.particles;
    assert_eq!((particles.len(), particles.time(), particles.length_unit()), (4, Some(0.1), Some("m")));
    assert_eq!((at(particles, 0), at(particles, 2)), ([10.5, 11.0, 11.0], [11.5, 12.0, 11.0]));
    let momentum = particles.attribute("momentum").unwrap();
    assert_eq!((momentum.components, momentum.number(2, 1)), (3, 6.0));
    assert_eq!(momentum.unit.as_deref(), Some("m kg s^-1"));
    assert!(momentum.number(3, 0).is_nan(), "the ion has no momentum");
    let electrons = open_with("series.h5", &types(&["electrons"])).unwrap().frame(0, &()).unwrap().particles;
    assert_eq!(electrons.attribute("id").unwrap().values, Values::I64(vec![7, 8, 9]));
    assert!(open_with("series.h5", &types(&["muons"])).unwrap().frame(0, &()).is_err());
}

#[test]
fn of_several_candidates_the_caller_says_which() {
    let message = open_with("candidates.h5", &Options::default()).err().unwrap().to_string();
    assert!(message.contains("run/a, run/b") && message.contains("--dataset"), "{message}");
    for (name, y) in [("run/b", -4.0), ("a", 4.0)] {
        let options = Options { dataset: Some(name.into()), ..Options::default() };
        let frame = open_with("candidates.h5", &options).unwrap().frame(0, &()).unwrap();
        assert_eq!((frame.particles.len(), at(&frame.particles, 1)[1]), (4, y));
        let heat = frame.particles.attribute("heat").unwrap();
        assert_eq!((&heat.values, heat.unit.as_deref()), (&Values::F32(vec![0.0, 1.0, 2.0, 3.0]), Some("K")));
        assert!(frame.warnings[0].contains("note"), "{:?}", frame.warnings);
    }
    let options = Options { dataset: Some("nothing".into()), ..Options::default() };
    assert!(open_with("candidates.h5", &options).is_err());
}

#[test]
fn steps_of_h5part_are_frames_in_order() {
    let sequence = open("steps.h5part");
    assert_eq!(sequence.len(), 3);
    let particles = sequence.frame(2, &()).unwrap().particles;
    assert_eq!((at(&particles, 1), particles.time()), ([11.0, 11.0, 12.0], Some(5.0)));
    assert_eq!(numbers(&particles, "id"), [1.0, 2.0]);
}

#[test]
fn a_file_without_particles_is_read() {
    assert_eq!(open("empty.h5").frame(0, &()).unwrap().particles.len(), 0);
}

#[test]
fn a_compressed_file_is_read_as_its_content() {
    let bytes = std::fs::read(path("swift.hdf5")).unwrap();
    let request =
        Request { options: &Options::default(), bytes: None, units: None, topology: None, others: &() };
    let span = Span { offset: 0, line: 1, bytes: None };
    let frame = frame(Path::new("no such file"), &bytes, span, &request, &()).unwrap();
    assert_eq!(frame.particles.len(), 8);
}

#[test]
fn damage_never_panics() {
    for name in [
        "swift.hdf5",
        "swift_latest.hdf5",
        "fixed_and_varying.h5md",
        "bonds.h5md",
        "series.h5",
        "candidates.h5",
        "table.h5",
    ] {
        let bytes = std::fs::read(path(name)).unwrap();
        let options =
            Options { dataset: (name == "candidates.h5").then(|| "a".to_string()), ..Options::default() };
        real_data::damage_some(&bytes, |file| {
            let path = Path::new("no such file");
            let Ok(index) = index(path, file, &options) else { return };
            let request =
                Request { options: &options, bytes: None, units: None, topology: None, others: &() };
            for span in index.frames.into_iter().take(4) {
                drop(frame(path, file, span, &request, &()));
            }
        });
    }
}

#[test]
fn numbers_of_few_bits_are_what_they_stand_for() {
    let particles = open("forms.h5").frame(0, &()).unwrap().particles;
    assert_eq!(at(&particles, 3), [9.0, 10.0, 11.0]);
    let exact = [0.0, 1.5, -2.25, 100.5, 3e-5, 1e6, -0.75, 1.0, 7.0, 2.0, 3.0, 4.0];
    for (name, mantissa, kind) in [("FMantissa9", 9, "f32"), ("BFloat16", 7, "f32"), ("DMantissa9", 9, "f64")]
    {
        assert_eq!(particles.attribute(name).unwrap().values.type_name(), kind);
        for (found, wanted) in numbers(&particles, name).into_iter().zip(exact) {
            assert!(
                (found - wanted).abs() <= 0.5f64.powi(mantissa) * wanted.abs(),
                "{name}: {found} for {wanted}"
            );
        }
        assert_eq!(numbers(&particles, name)[1..3], [1.5, -2.25], "{name}");
    }
}

#[test]
fn steps_of_vtkhdf_are_frames() {
    let sequence = open("steps.vtkhdf");
    assert_eq!((sequence.len(), sequence.format()), (2, "VTKHDF"));
    let [first, last] = [0, 1].map(|it| sequence.frame(it, &()).unwrap().particles);
    assert_eq!((first.len(), at(&first, 2), first.time()), (3, [6.0, 7.0, 8.0], Some(0.5)));
    assert_eq!((last.len(), at(&last, 0), last.time()), (2, [9.0, 10.0, 11.0], Some(1.5)));
    assert_eq!((numbers(&last, "mass"), numbers(&last, "kind")), (vec![3.0, 4.0], vec![7.0, 8.0]));
}

#[test]
fn values_are_multiplied_by_their_scale_factor() {
    let frame = open("scaled.nc").frame(1, &()).unwrap();
    let particles = &frame.particles;
    assert_eq!((at(particles, 0), at(particles, 3)), ([56.0, 56.5, 57.0], [60.5, 61.0, 61.5]));
    let factor = f64::from(20.455f32);
    for (found, number) in numbers(particles, "velocities").into_iter().zip(12..24) {
        assert_eq!(found as f32, (factor * f64::from(number)) as f32);
    }
    assert_eq!(numbers(particles, "charge"), [0.0, 0.25, 1.5, 3.0]);
    assert_eq!((particles.time(), particles.length_unit()), (Some(6.0), Some("Å")));
    let cell = particles.cell().unwrap();
    assert_eq!([cell.vectors[0].x, cell.vectors[1].y, cell.vectors[2].z], [2.0, 3.0, 4.0]);
    assert_eq!(frame.conventions[1], "coordinates are scaled by 0.5, their scale_factor");
}

#[test]
fn positions_in_three_dimensions_are_frames() {
    let sequence = open("frames.h5");
    assert_eq!(sequence.len(), 2);
    let frame = sequence.frame(1, &()).unwrap();
    let particles = &frame.particles;
    assert_eq!((particles.len(), at(particles, 3)), (4, [21.0, 22.0, 23.0]));
    assert_eq!(numbers(particles, "velocities")[..3], [-12.0, -13.0, -14.0]);
    assert_eq!(numbers(particles, "mass"), [0.0, 1.0, 2.0, 3.0]);
    assert_eq!(
        (particles.time(), particles.time_unit(), particles.length_unit()),
        (Some(2.5), Some("ps"), Some("nm"))
    );
    assert_eq!(particles.cell().unwrap().vectors[1], DVec3::Y * 3.5);
    assert!(frame.warnings.is_empty(), "{:?}", frame.warnings);
}

#[test]
fn rows_may_be_records() {
    let sequence = open("table.h5");
    let frame = sequence.frame(0, &()).unwrap();
    let particles = &frame.particles;
    assert_eq!((particles.len(), at(particles, 3)), (5, [3.0, 13.0, 0.75]));
    assert_eq!(numbers(particles, "id")[4], (1u64 << 40) as f64 + 4.0);
    let spin = particles.attribute("spin").unwrap();
    assert_eq!((spin.components, spin.number(4, 2)), (3, 14.0));
    assert_eq!(numbers(particles, "up"), [1.0, 0.0, 1.0, 1.0, 0.0]);
    assert_eq!(numbers(particles, "beside"), [0.0, 1.0, 2.0, 3.0, 4.0]);
    assert_eq!(frame.conventions, ["positions: data set group/particles"]);
    assert_eq!(frame.warnings, ["left out: word (no 5 rows of numbers)"]);
    let particles = open("table_of_rows.h5").frame(0, &()).unwrap().particles;
    assert_eq!((at(&particles, 2), numbers(&particles, "mass")), ([6.0, 7.0, 8.0], vec![1.0, 2.0, 3.0]));
}

#[test]
fn large_chunks_are_read_whatever_their_filters_and_index() {
    for name in ["large_earliest.h5", "large_latest.h5"] {
        let frame = open(name).frame(0, &()).unwrap();
        let particles = &frame.particles;
        assert_eq!(particles.len(), 150_000);
        let value =
            |name: &str, id: usize, component| particles.attribute(name).unwrap().number(id, component);
        for id in [0, 1, 65_535, 65_536, 131_071, 131_072, 149_999] {
            let step = |of: usize| (id / of) as f64;
            assert_eq!(at(particles, id), [step(2500), 0.5 * step(3000), step(1000)], "{name}");
            let found = ["last", "lzf", "single"].map(|name| value(name, id, 0));
            assert_eq!(found, [step(640), step(4096) + 0.25, step(3000) - 1.0], "{name}");
            let found = [0, 1].map(|it| [value("both", id, it), value("first", id, it)]);
            assert_eq!(found, [[step(700), step(3200)], [step(500), step(900)]], "{name}");
        }
        assert!(frame.warnings.is_empty(), "{:?}", frame.warnings);
    }
}

#[test]
fn large_chunks_that_were_changed_are_told() {
    let whole = std::fs::read(path("large_latest.h5")).unwrap();
    let read = |bytes: &[u8]| {
        let (path, options) = (Path::new("a.h5"), Options::default());
        let request = Request { options: &options, bytes: None, units: None, topology: None, others: &() };
        let span = index(path, bytes, &options)?.frames[0];
        frame(path, bytes, span, &request, &())
    };
    assert_eq!(read(&whole).unwrap().particles.len(), 150_000);
    // Nearly all bytes of the file are those of chunks.
    let place = whole.len() / 3;
    let damaged: Vec<Vec<u8>> = [place, 2 * place]
        .into_iter()
        .map(|place| {
            let mut file = whole.clone();
            file[place] ^= 0x55;
            file
        })
        .collect();
    assert!(damaged.iter().any(|it| read(it).is_err()));
    assert!(read(&whole[..whole.len() / 2]).is_err());
}
