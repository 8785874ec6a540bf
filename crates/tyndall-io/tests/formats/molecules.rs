//! Molecular formats: the shared real files, where they are.

use std::collections::HashMap;

use serde_json::Value;
use tyndall::particles::Values;
use tyndall::{Cell, DVec3, Particles};

use tyndall_io::{Frame, Options, Sequence};

use super::{Folder, check_frame, check_shared, check_truncated, fixture, frame, open, shared, vector};

/// The word that `attribute` has for particle `id`.
fn word(particles: &Particles, attribute: &str, id: usize) -> String {
    let attribute = particles.attribute(attribute).unwrap_or_else(|| panic!("no attribute {attribute}"));
    let Values::Text { codes, names } = &attribute.values else { panic!("{} is no text", attribute.name) };
    names[codes[id] as usize].clone()
}

fn number(particles: &Particles, attribute: &str, id: usize) -> f64 {
    particles.attribute(attribute).unwrap_or_else(|| panic!("no attribute {attribute}")).number(id, 0)
}

/// How many particles have each word.
fn counts(particles: &Particles, attribute: &str) -> serde_json::Map<String, Value> {
    let mut counts = serde_json::Map::new();
    for id in 0..particles.len() {
        let count = counts.entry(word(particles, attribute, id)).or_insert(Value::from(0));
        *count = Value::from(count.as_u64().unwrap() + 1);
    }
    counts
}

fn check_cell(cell: &Cell, lengths_and_angles: &Value) {
    let [a, b, c] = cell.vectors;
    let found =
        [a.length(), b.length(), c.length(), b.angle_between(c), a.angle_between(c), a.angle_between(b)];
    for (place, found) in found.into_iter().enumerate() {
        let found = if place < 3 { found } else { found.to_degrees() };
        let wanted = lengths_and_angles[place].as_f64().unwrap();
        assert!((found - wanted).abs() < 1e-4, "{found}, wanted {wanted}");
    }
}

fn cut(name: &str) {
    if let Some((folder, _)) = shared() {
        check_truncated(&name.replace('/', "-"), &std::fs::read(folder.join(name)).unwrap());
    }
}

#[test]
fn the_shared_binary_dump_is_read() {
    let name = "lammps/lj_triclinic.dump.bin";
    let Some((sequence, expected)) = check_shared(name) else { return };
    assert_eq!(sequence.format(), "LAMMPS binary dump");
    let first = frame(&sequence, 0).particles;
    let names: Vec<&str> = first.attributes().iter().map(|it| it.name.as_str()).collect();
    assert_eq!(names, ["id", "type", "vx", "vy", "vz"]);
    for (end, place) in [("first", 0), ("last", first.len() - 1)] {
        assert_eq!(number(&first, "id", place), expected[end]["Particle Identifier"].as_f64().unwrap());
        for (axis, name) in ["vx", "vy", "vz"].iter().enumerate() {
            let wanted = expected[end]["Velocity"][axis].as_f64().unwrap();
            assert!((number(&first, name, place) - wanted).abs() < 1e-6, "{end} {name}");
        }
    }
    let cell = first.cell().unwrap();
    for (edge, found) in cell.vectors.into_iter().chain([cell.origin]).enumerate() {
        assert!(
            found.abs_diff_eq(vector(&expected["cell_matrix_columns_a_b_c_origin"][edge]), 1e-6),
            "{found}"
        );
    }
    assert_eq!(cell.periodic, [true; 3]);
    for (kind, count) in [(1.0, 7713), (2.0, 3263)] {
        assert_eq!((0..first.len()).filter(|&id| number(&first, "type", id) == kind).count(), count);
    }
    cut(name);
}

#[test]
fn the_shared_data_files_are_read() {
    let Some((sequence, expected)) = check_shared("lammps/peptide_full.data") else { return };
    assert_eq!(sequence.format(), "LAMMPS data (text)");
    let peptide = frame(&sequence, 0);
    assert_eq!(
        peptide.conventions[0],
        "atom style full (by the number and kind of columns): id mol type q x y z ix iy iz"
    );
    let particles = &peptide.particles;
    for (end, place) in [("first", 0), ("last", particles.len() - 1)] {
        let wanted = &expected[end];
        let pairs = [
            ("id", "Particle Identifier"),
            ("type", "Particle Type"),
            ("mol", "Molecule Identifier"),
            ("q", "Charge"),
            ("mass", "Mass"),
        ];
        let vectors = [("ix", "Periodic Image", 0), ("iz", "Periodic Image", 2), ("vy", "Velocity", 1)];
        let all = pairs.iter().map(|(ours, theirs)| (*ours, &wanted[*theirs]));
        for (ours, wanted) in
            all.chain(vectors.iter().map(|(ours, theirs, axis)| (*ours, &wanted[*theirs][*axis])))
        {
            let (found, wanted) = (number(particles, ours, place), wanted.as_f64().unwrap());
            assert!(
                (found - wanted).abs() < 1e-6 * wanted.abs().max(1.0),
                "{end} {ours}: {found}, wanted {wanted}"
            );
        }
    }
    let cell = particles.cell().unwrap();
    for (edge, found) in cell.vectors.into_iter().chain([cell.origin]).enumerate() {
        assert!(
            found.abs_diff_eq(vector(&expected["cell_matrix_columns_a_b_c_origin"][edge]), 1e-6),
            "{found}"
        );
    }
    for (kind, element) in expected["type_names"].as_object().unwrap() {
        let place =
            (0..particles.len()).find(|&id| number(particles, "type", id).to_string() == *kind).unwrap();
        assert_eq!(*element, word(particles, "element", place), "type {kind}");
    }
    assert_eq!(particles.bonds().len(), 1365);

    let Some((sequence, expected)) = check_shared("lammps/powerlaw_2d.data") else { return };
    let particles = frame(&sequence, 0).particles;
    assert_eq!(particles.time(), Some(400_000.0));
    for (end, place) in [("first", 0), ("last", particles.len() - 1)] {
        let radius = f64::from(particles.radius(particles.radii().unwrap(), place));
        assert!((radius - expected[end]["Radius"].as_f64().unwrap()).abs() < 1e-5, "{end}");
        let spin = expected[end]["Angular Velocity"][2].as_f64().unwrap();
        assert!((number(&particles, "omegaz", place) - spin).abs() < 1e-9, "{end}");
    }
    assert!(particles.attribute("element").is_none());
    cut("lammps/peptide_full.data");
    cut("lammps/powerlaw_2d.data");
}

#[test]
fn the_shared_gromacs_files_are_read() {
    let Some((sequence, expected)) = check_shared("molecular/adk_oplsaa.gro") else { return };
    assert_eq!(sequence.format(), "GROMACS GRO (text)");
    let particles = frame(&sequence, 0).particles;
    for (end, place) in [("first", 0), ("last", particles.len() - 1)] {
        let wanted = &expected[end];
        assert_eq!(word(&particles, "name", place), wanted["names"].as_str().unwrap());
        assert_eq!(word(&particles, "resname", place), wanted["resnames"].as_str().unwrap());
        assert_eq!(number(&particles, "resid", place), wanted["resids"].as_f64().unwrap());
    }
    check_cell(particles.cell().unwrap(), &expected["cell_lengths_angles"]);
    assert_eq!(particles.length_unit(), Some("nm"));
    cut("molecular/adk_oplsaa.gro");

    let Some((sequence, expected)) = check_shared("molecular/adk_oplsaa.xtc") else { return };
    assert_eq!(sequence.format(), "GROMACS XTC");
    let [first, last] = [0, 9].map(|it| frame(&sequence, it).particles);
    check_cell(first.cell().unwrap(), &expected["cell_lengths_angles"]);
    assert_eq!(
        (first.time(), last.time(), first.length_unit()),
        (Some(0.0), Some(f64::from(900.000_06_f32)), Some("nm"))
    );
    cut("molecular/adk_oplsaa.xtc");
}

#[test]
fn the_shared_trajectories_of_water_are_read() {
    for (name, format, unit, edge) in [
        ("molecular/water.trr", "GROMACS TRR", "nm", 1.5),
        ("molecular/water.dcd", "DCD", "Å", 15.0),
        ("molecular/water.nc", "AMBER NetCDF", "Å", 15.0),
    ] {
        let Some((sequence, _)) = check_shared(name) else { return };
        assert_eq!(sequence.format(), format);
        let particles = frame(&sequence, 99).particles;
        assert_eq!(particles.length_unit(), Some(unit), "{name}");
        let cell = particles.cell().unwrap();
        for (found, axis) in cell.vectors.into_iter().zip([DVec3::X, DVec3::Y, DVec3::Z]) {
            assert!(found.abs_diff_eq(edge * axis, 1e-6), "{name}: {found}");
        }
        cut(name);
    }
}

/// Atoms of one frame of GRO text: names tell the order.
fn gro(count: usize) -> String {
    let atom = |k: usize| {
        format!("{:5}SOL  {:>5}{:5}{:8.3}{:8.3}{:8.3}\n", k, format!("A{k}"), k, k as f64, 0.0, 0.0)
    };
    format!("names\n{count}\n{}1 1 1\n", (1..=count).map(atom).collect::<String>())
}

/// A trajectory whose numbers tell frame, axis and atom.
fn dcd(count: i32, frames: i32) -> Vec<u8> {
    let record = |content: &[u8]| {
        let mark = (content.len() as u32).to_le_bytes();
        [&mark[..], content, &mark].concat()
    };
    let mut control = [0i32; 20];
    [control[0], control[2], control[19]] = [frames, 1, 24];
    let control: Vec<u8> = control.iter().flat_map(|it| it.to_le_bytes()).collect();
    let mut file = record(&[b"CORD", &control[..]].concat());
    file.extend(record(&[&1i32.to_le_bytes()[..], &[b' '; 80]].concat()));
    file.extend(record(&count.to_le_bytes()));
    for frame in 0..frames {
        for axis in 0..3 {
            let value = |atom: i32| (100 * frame + 10 * axis + atom) as f32;
            file.extend(record(&(0..count).flat_map(|atom| value(atom).to_le_bytes()).collect::<Vec<_>>()));
        }
    }
    file
}

#[test]
fn a_file_with_names_gives_them_to_files_of_coordinates() {
    let folder = Folder::new("names");
    let names = folder.file("topol.gro", gro(3).as_bytes());
    let [one, two] = [folder.file("one.dcd", &dcd(3, 2)), folder.file("two.dcd", &dcd(3, 1))];
    let sequence =
        Sequence::open(&[names.clone(), one.clone(), two.clone()], &Options::default(), &()).unwrap();
    assert_eq!(
        (sequence.len(), sequence.name(1), sequence.name(2)),
        (3, "one.dcd[1]".into(), "two.dcd".into())
    );
    assert_eq!(sequence.format(), "DCD, names from GROMACS GRO (text)");
    for k in 0..3 {
        let frame = frame(&sequence, k);
        assert_eq!(word(&frame.particles, "name", 2), "A3");
        assert_eq!(number(&frame.particles, "resid", 1), 2.0);
        assert_eq!((frame.particles.length_unit(), frame.particles.cell()), (Some("Å"), None));
        assert!(
            frame.conventions.iter().any(|it| it.contains("topol.gro: resid resname name id")),
            "{:?}",
            frame.conventions
        );
    }
    assert_eq!(frame(&sequence, 1).particles.positions().world(2), DVec3::new(102.0, 112.0, 122.0));

    // Counts that do not agree are both named.
    let more = folder.file("more.gro", gro(1204).as_bytes());
    let sequence = Sequence::open(&[more, one.clone()], &Options::default(), &()).unwrap();
    let message = sequence.frame(1, &()).unwrap_err().to_string();
    assert!(message.contains("more.gro has 1,204 particles, one.dcd frame 1 has 3"), "{message}");

    // Without names first, or with other files behind, all are frames.
    let other = folder.file("other.gro", gro(2).as_bytes());
    for (paths, count) in [
        (vec![one.clone(), two.clone()], 3),
        (vec![names.clone(), other], 2),
        (vec![one, names.clone()], 3),
        (vec![names], 1),
    ] {
        assert_eq!(Sequence::open(&paths, &Options::default(), &()).unwrap().len(), count, "{paths:?}");
    }
}

#[test]
fn a_group_of_an_index_file_has_its_names_and_the_bonds_within_it() {
    let folder = Folder::new("groups");
    let atom = |k: usize| {
        format!("HETATM{k:5}  C{k}  ABC A   1    {:8.3}   0.000   0.000  1.00  0.00           C\n", k as f64)
    };
    let atoms: String = (1..=4).map(atom).collect();
    let bonds = "CONECT    1    2\nCONECT    2    3\nCONECT    3    4\n";
    let names = folder.file("topol.pdb", format!("{atoms}{bonds}END\n").as_bytes());
    let index = folder.file("index.ndx", b"[ All ]\n1 2 3 4\n[ End ]\n4 3 1\n[ Pair ]\n1 4\n");
    let traj = folder.file("traj.dcd", &dcd(3, 2));
    let options =
        |index: &std::path::Path| Options { index: Some(index.to_path_buf()), ..Options::default() };
    let sequence = Sequence::open(&[names.clone(), traj.clone()], &options(&index), &()).unwrap();
    for k in 0..2 {
        let Frame { particles, conventions, .. } = frame(&sequence, k);
        let found: Vec<String> = (0..3).map(|id| word(&particles, "name", id)).collect();
        assert_eq!((found, particles.bonds()), (vec!["C4".into(), "C3".into(), "C1".into()], &[[0, 1]][..]));
        assert_eq!(particles.positions().world(1).x, (100 * k + 1) as f64);
        assert!(conventions.iter().any(|it| it.contains("group End of index.ndx")), "{conventions:?}");
    }
    let pair = index.with_file_name("index.ndx:Pair");
    let sequence = Sequence::open(&[names.clone(), traj], &options(&pair), &()).unwrap();
    let message = sequence.frame(0, &()).unwrap_err().to_string();
    assert!(message.contains("group Pair of index.ndx has 2 particles, traj.dcd frame 0 has 3"), "{message}");
    let message = Sequence::open(&[names], &options(&index), &()).err().unwrap().to_string();
    assert!(message.contains("--index cannot be"), "{message}");
}

#[test]
fn the_shared_trajectory_gets_the_names_of_its_topology() {
    let Some((folder, _)) = shared() else { return };
    let paths = ["adk_oplsaa.gro", "adk_oplsaa.xtc"].map(|it| folder.join("molecular").join(it));
    let sequence = Sequence::open(&paths, &Options::default(), &()).unwrap();
    assert_eq!(sequence.len(), 10);
    let last = frame(&sequence, 9).particles;
    assert_eq!((word(&last, "resname", 0), word(&last, "name", last.len() - 1)), ("MET".into(), "NA".into()));
    let water = folder.join("molecular/water.trr");
    let sequence = Sequence::open(&[paths[0].clone(), water], &Options::default(), &()).unwrap();
    let message = sequence.frame(0, &()).unwrap_err().to_string();
    assert!(message.contains("47,681") && message.contains("297"), "{message}");
}

/// Compares first and last atom, and the counts of elements, with what gemmi found.
fn check_atoms(particles: &Particles, expected: &Value) {
    for (end, place) in [("first", 0), ("last", particles.len() - 1)] {
        let wanted = &expected[end];
        assert_eq!(number(particles, "id", place), wanted["serial"].as_f64().unwrap());
        for (ours, theirs) in
            [("name", "name"), ("element", "element"), ("chain", "chain"), ("resname", "residue")]
        {
            assert_eq!(word(particles, ours, place), wanted[theirs].as_str().unwrap(), "{end} {ours}");
        }
        assert_eq!(number(particles, "resid", place).to_string(), wanted["seqid"].as_str().unwrap());
        let b_factor = number(particles, "b_factor", place);
        assert!((b_factor - wanted["b_iso"].as_f64().unwrap()).abs() < 1e-5);
    }
    assert_eq!(Value::from(counts(particles, "element")), expected["element_counts"]);
}

fn open_assembly(name: &str, assembly: &str) -> Option<Particles> {
    let (folder, _) = shared()?;
    let options = Options { assembly: Some(assembly.to_string()), ..Options::default() };
    let sequence = Sequence::open(&[folder.join(name)], &options, &()).unwrap();
    Some(frame(&sequence, 0).particles)
}

#[test]
fn the_shared_pdb_entries_are_read() {
    for name in ["molecular/1IHM_norwalk.pdb", "molecular/1M4X_capsid.pdb"] {
        let Some((folder, all)) = shared() else { return };
        let expected = &all["files"][name]["expected"];
        let sequence = open(&folder.join(name));
        assert_eq!((sequence.len(), sequence.format()), (1, "PDB"));
        let entry = frame(&sequence, 0);
        check_frame(name, &entry.particles, expected);
        check_atoms(&entry.particles, expected);
        let operators = &expected["assembly_1"]["operators"];
        let offer = format!("assembly 1 is made by {operators} operators");
        assert!(entry.conventions.iter().any(|it| it.contains(&offer)), "{:?}", entry.conventions);
        assert!(entry.particles.cell().is_none(), "the cell is that of a crystal");
        cut(name);
    }
}

#[test]
fn the_shared_capsids_are_made_whole() {
    let name = "molecular/1IHM_norwalk.pdb";
    let Some(particles) = open_assembly(name, "1") else { return };
    let (_, all) = shared().unwrap();
    let expected = &all["files"][name]["expected"]["assembly_1"];
    let count = &expected["particles_if_every_operator_is_applied_to_every_atom"];
    assert_eq!(particles.len() as u64, count.as_u64().unwrap());
    let bounds = particles.world_bounds().unwrap();
    for (corner, found) in ["min", "max"].into_iter().zip(bounds) {
        let wanted = vector(&expected["bounds"][corner]);
        assert!(DVec3::from_array(found).abs_diff_eq(wanted, 4e-3), "{corner}: {found:?}, wanted {wanted}");
    }
    assert_eq!(number(&particles, "operator", particles.len() - 1), 60.0);
}

#[test]
fn the_shared_mmcif_entries_are_read() {
    let Some((folder, all)) = shared() else { return };
    let name = "molecular/4hhb.cif";
    let expected = &all["files"][name]["expected"];
    let sequence = open(&folder.join(name));
    assert_eq!((sequence.len(), sequence.format()), (1, "mmCIF"));
    let particles = frame(&sequence, 0).particles;
    check_frame(name, &particles, expected);
    check_atoms(&particles, expected);
    assert_eq!(open_assembly(name, "1").unwrap().len(), 4779);
    // The irons and their histidines, at the distances that the file says.
    let lengths: Vec<i64> = particles
        .bonds()
        .iter()
        .map(|pair| {
            let [one, other] = pair.map(|id| particles.positions().world(id as usize));
            (1000.0 * one.distance(other)).round() as i64
        })
        .collect();
    assert_eq!(lengths, [2143, 2222, 2258, 1982]);
    cut(name);

    let Some((sequence, expected)) = check_shared("molecular/2axd.bcif") else { return };
    assert_eq!(sequence.format(), "BinaryCIF");
    let particles = frame(&sequence, 0).particles;
    for (end, place) in [("first", 0), ("last", particles.len() - 1)] {
        assert_eq!(number(&particles, "id", place), expected[end]["id"].as_f64().unwrap());
        assert_eq!(word(&particles, "name", place), expected[end]["label_atom_id"].as_str().unwrap());
        assert_eq!(word(&particles, "element", place), expected[end]["type_symbol"].as_str().unwrap());
    }
    let rows: usize = (0..12).map(|k| frame(&sequence, k).particles.len()).sum();
    assert_eq!(rows as u64, expected["rows_in_atom_site"].as_u64().unwrap());
    cut("molecular/2axd.bcif");
}

#[test]
fn the_shared_mmtf_entry_is_that_of_mmcif() {
    let name = "molecular/4HHB.mmtf";
    let Some((folder, all)) = shared() else { return };
    let sequence = open(&folder.join(name));
    assert_eq!((sequence.len(), sequence.format()), (1, "MMTF"));
    let entry = frame(&sequence, 0);
    let mut expected = all["files"][name]["expected"].clone();
    expected["bounds"] = expected["bounds_all_models"].clone();
    check_frame(name, &entry.particles, &expected);
    assert_eq!(entry.particles.bonds().len(), 4700, "as numBonds says");
    assert!(entry.particles.cell().is_none(), "the cell is that of a crystal");
    let other = frame(&open(&folder.join("molecular/4hhb.cif")), 0).particles;
    check_atoms(&entry.particles, &all["files"]["molecular/4hhb.cif"]["expected"]);
    // What is no protein stands in another order.
    let key = |particles: &Particles, id: usize| {
        particles.positions().world(id).to_array().map(|it| (1000.0 * it).round() as i64)
    };
    let places: HashMap<[i64; 3], usize> =
        (0..other.len()).map(|place| (key(&other, place), place)).collect();
    for id in 0..other.len() {
        let [one, two] = [(&entry.particles, id), (&other, places[&key(&entry.particles, id)])];
        // The archive has given what is no protein other names since.
        let is_protein = id < 4384;
        for attribute in ["name", "element", "resname", "chain", "asym", "entity"] {
            if !is_protein && ["asym", "entity"].contains(&attribute) {
                continue;
            }
            let [one, two] = [one, two].map(|(particles, id)| word(particles, attribute, id));
            assert_eq!(one, two, "{attribute} of {id}");
        }
        for attribute in ["resid", "b_factor", "occupancy"] {
            let [one, two] = [one, two].map(|(particles, id)| number(particles, attribute, id));
            assert!((one - two).abs() < 1e-5, "{attribute} of {id} is {one}, not {two}");
        }
    }
    assert_eq!(open_assembly(name, "1").unwrap().len(), 4779);
    cut(name);
    let temporary = Folder::new("mmtf");
    let packed = temporary.file("4HHB.mmtf.gz", &super::gzip(&std::fs::read(folder.join(name)).unwrap()));
    assert_eq!(frame(&open(&packed), 0).particles.len(), 4779);
}

#[test]
fn models_chains_and_assemblies_of_mmtf_are_told_apart() {
    let path = fixture("samples/protein.mmtf");
    let sequence = open(&path);
    assert_eq!((sequence.len(), sequence.format()), (2, "MMTF"));
    let [first, second] = [0, 1].map(|it| frame(&sequence, it).particles);
    assert_eq!((first.len(), second.len()), (12, 12));
    assert_eq!(second.positions().world(0), first.positions().world(0) + DVec3::X);
    for particles in [&first, &second] {
        assert_eq!((word(particles, "chain", 0), word(particles, "asym", 11)), ("A".into(), "C".into()));
        assert_eq!(
            (word(particles, "resname", 0), word(particles, "resname", 11)),
            ("GLY".into(), "NA".into())
        );
        assert_eq!((word(particles, "name", 1), word(particles, "element", 11)), ("CA".into(), "Na".into()));
        assert_eq!((word(particles, "entity", 4), word(particles, "entity", 11)), ("1".into(), "2".into()));
        assert_eq!((word(particles, "icode", 4), word(particles, "altloc", 3)), ("A".into(), "B".into()));
        assert_eq!([0, 4, 11].map(|it| number(particles, "resid", it)), [7.0, 8.0, 101.0]);
        assert_eq!((number(particles, "charge", 0), number(particles, "charge", 11)), (0.0, 1.0));
    }
    assert_eq!([first.len() - 1, 0].map(|it| number(&first, "id", it)), [12.0, 1.0]);
    assert_eq!(number(&second, "id", 0), 13.0);
    check_cell(first.cell().unwrap(), &serde_json::json!([10.0, 20.0, 30.0, 90.0, 90.0, 90.0]));

    let options = Options { assembly: Some("dimer".to_string()), ..Options::default() };
    let whole = frame(&Sequence::open(&[path], &options, &()).unwrap(), 1).particles;
    assert_eq!(whole.len(), 20, "two copies of chains A and B");
    let [one, other] = [0, 8].map(|it| whole.positions().world(it));
    assert!(other.abs_diff_eq(DVec3::new(5.0 - one.x, -one.y, one.z), 1e-5), "{one} became {other}");
    assert_eq!(number(&whole, "operator", 12), 2.0);
}

#[test]
fn the_shared_gsd_file_is_read() {
    let Some((sequence, expected)) = check_shared("molecular/example.gsd") else { return };
    assert_eq!(sequence.format(), "GSD");
    let particles = frame(&sequence, 0).particles;
    for (end, place) in [("first", 0), ("last", particles.len() - 1)] {
        assert_eq!(word(&particles, "type", place), expected[end]["type"].as_str().unwrap());
        let diameter = 2.0 * f64::from(particles.radius(particles.radii().unwrap(), place));
        assert_eq!(diameter, expected[end]["diameter"].as_f64().unwrap());
    }
    let cell = particles.cell().unwrap();
    assert_eq!(cell.vectors[0].x as f32, expected["box"][0].as_f64().unwrap() as f32);
    assert_eq!(cell.center(), DVec3::ZERO);
    assert_eq!(frame(&sequence, 1).particles.time(), Some(500.0));
    cut("molecular/example.gsd");
}

#[test]
fn an_assembly_of_a_file_that_has_none_is_refused() {
    let folder = Folder::new("assembly");
    let path = folder.file("a.gro", gro(2).as_bytes());
    let options = Options { assembly: Some("1".to_string()), ..Options::default() };
    let message = Sequence::open(&[path], &options, &()).err().unwrap().to_string();
    assert!(message.contains("only PDB, mmCIF, BinaryCIF and MMTF"), "{message}");
}
