//! Snapshots, HDF5 and point clouds, through the front door.

use super::*;

/// The value of attribute `name` of particle `id`.
fn number(particles: &Particles, name: &str, id: usize, component: usize) -> f64 {
    particles.attribute(name).unwrap_or_else(|| panic!("no attribute {name}")).number(id, component)
}

/// Compares named numbers of the first and the last particle with what is expected.
fn check_ends(particles: &Particles, expected: &Value, names: &[(&str, &str)]) {
    for (end, id) in [("first", 0), ("last", particles.len() - 1)] {
        for (ours, theirs) in names {
            let wanted = &expected[end][theirs];
            let wanted = wanted.as_array().cloned().unwrap_or_else(|| vec![wanted.clone()]);
            for (component, wanted) in wanted.iter().enumerate() {
                let (found, wanted) = (number(particles, ours, id, component), wanted.as_f64().unwrap());
                let what = format!("{ours} of the {end} particle is {found}, wanted {wanted}");
                assert!((found - wanted).abs() <= 1e-6 * wanted.abs() + 1e-12, "{what}");
            }
        }
    }
}

/// How many particles have each word of `type`.
fn families(particles: &Particles) -> Vec<(String, usize)> {
    let tyndall::Values::Text { codes, names } = &particles.attribute("type").unwrap().values else {
        panic!("types are words")
    };
    let count = |code: usize| codes.iter().filter(|it| **it as usize == code).count();
    names.iter().enumerate().map(|(code, name)| (name.clone(), count(code))).collect()
}

fn family(name: &str, count: usize) -> (String, usize) {
    (name.to_string(), count)
}

fn read_types(name: &str, types: &[&str]) -> Particles {
    let (folder, _) = shared().expect("the caller has looked");
    let options =
        Options { types: Some(types.iter().map(|it| it.to_string()).collect()), ..Options::default() };
    Sequence::open(&[folder.join(name)], &options, &()).unwrap().frame(0, &()).unwrap().particles
}

#[test]
fn gadget_snapshots_are_read_as_pynbody_reads_them() {
    let name = "cosmology/galaxy_littleendian.gadget1";
    let Some((sequence, expected)) = check_shared(name) else { return };
    let galaxies = frame(&sequence, 0);
    assert_eq!(sequence.format(), "Gadget format 1, little-endian");
    assert_eq!(families(&galaxies.particles), [family("halo", 40_000), family("disk", 20_000)]);
    check_ends(&galaxies.particles, &expected, &[("id", "iord"), ("mass", "mass"), ("vel", "vel")]);
    assert!(galaxies.warnings.iter().any(|it| it.contains("1 byte behind")), "{:?}", galaxies.warnings);
    assert!(galaxies.particles.cell().is_none());
    assert_eq!(read_types(name, &["disk"]).len(), 20_000);

    let name = "cosmology/lcdm_gas_littleendian.gadget1";
    let Some((sequence, expected)) = check_shared(name) else { return };
    let gas = frame(&sequence, 0);
    assert_eq!(families(&gas.particles), [family("gas", 32_768), family("halo", 32_768)]);
    check_ends(&gas.particles, &expected, &[("id", "iord"), ("mass", "mass"), ("vel", "vel")]);
    assert_eq!(number(&gas.particles, "u", 0, 0), 0.0);
    assert!(number(&gas.particles, "u", 65_535, 0).is_nan());
    assert!(gas.particles.cell().is_none(), "the header has no box");
    assert!(gas.conventions.iter().any(|it| it.contains("a = 0.090909")), "{:?}", gas.conventions);
    assert!((gas.particles.time().unwrap() - 1.0 / 11.0).abs() < 1e-6);
}

#[test]
fn tipsy_snapshots_are_read_as_pynbody_reads_them() {
    let names = [("mass", "mass"), ("vel", "vel"), ("eps", "eps"), ("phi", "phi")];
    for (name, kind, count, time) in
        [("cube300.tipsy", "dark", 110_592, 0.05), ("shocktube.tipsy", "gas", 20_000, 1.0)]
    {
        let Some((sequence, expected)) = check_shared(&format!("cosmology/{name}")) else { return };
        let particles = frame(&sequence, 0).particles;
        assert_eq!(sequence.format(), "TIPSY standard");
        assert_eq!(families(&particles), [family(kind, count)]);
        check_ends(&particles, &expected, &names);
        assert!((particles.time().unwrap() - time).abs() < 1e-9);
        for (attribute, values) in expected["family_only"]["gas"].as_object().into_iter().flatten() {
            for (id, place) in [(0, 0), (count - 1, 1)] {
                let (found, wanted) = (number(&particles, attribute, id, 0), values[place].as_f64().unwrap());
                assert!(
                    (found - wanted).abs() <= 1e-6 * wanted.abs(),
                    "{attribute}: {found}, wanted {wanted}"
                );
            }
        }
    }
}

#[cfg(feature = "hdf5")]
#[test]
fn hdf5_files_are_read_as_h5py_reads_them() {
    let Some((sequence, expected)) = check_shared("cosmology/lcdm_gas_swift.hdf5") else { return };
    assert_eq!(sequence.format(), "SWIFT HDF5");
    let particles = frame(&sequence, 0).particles;
    assert_eq!(families(&particles), [family("gas", 32_768), family("dark", 32_768)]);
    for name in expected["attributes"].as_array().unwrap().iter().filter(|it| *it != "Coordinates") {
        assert!(particles.attribute(name.as_str().unwrap()).is_some(), "{name}");
    }
    assert_eq!((particles.length_unit(), particles.cell().unwrap().vectors[1].y), (Some("cMpc"), 50.0));

    let Some((sequence, _)) = check_shared("cosmology/dm_halo.hdf5") else { return };
    assert_eq!((sequence.format(), frame(&sequence, 0).particles.attributes().len()), ("HDF5", 0));

    let Some((sequence, expected)) = check_shared("hdf5/distgen_openpmd.h5") else { return };
    let beam = frame(&sequence, 0).particles;
    assert_eq!((sequence.format(), beam.length_unit()), ("openPMD 2.0.0 HDF5", Some("m")));
    for name in expected["attributes"].as_array().unwrap().iter().filter(|it| *it != "position") {
        assert!(beam.attribute(name.as_str().unwrap()).is_some(), "{name}");
    }
    assert_eq!(number(&beam, "weight", 9_999, 0), 1e-15);

    let Some((sequence, _)) = check_shared("molecular/cu.h5md") else { return };
    let last = frame(&sequence, 19).particles;
    assert_eq!((sequence.format(), last.length_unit()), ("H5MD", Some("Å")));
    assert_eq!((last.cell().unwrap().periodic, number(&last, "species", 0, 0)), ([true; 3], 29.0));
}

#[test]
fn point_clouds_are_read_as_their_own_libraries_read_them() {
    let Some((sequence, _)) = check_shared("pointcloud/bunny.pcd") else { return };
    assert_eq!(sequence.format(), "PCD");
    let (folder, all) = shared().unwrap();
    for name in ["pointcloud/five_people.pcd", "pointcloud/milk_color.pcd"] {
        let expected = &all["files"][name]["expected"];
        let particles = frame(&open(&folder.join(name)), 0).particles;
        let finite = expected["finite_points"].as_u64().unwrap();
        assert_eq!(particles.len() as u64, finite, "{name}");
        assert_eq!(particles.dropped().position, expected["particles"].as_u64().unwrap() - finite);
        let [min, max] = ["min", "max"].map(|it| vector(&expected["bounds_of_finite"][it]));
        let [least, most] = particles.world_bounds().unwrap().map(DVec3::from_array);
        assert!(least.abs_diff_eq(min, 1e-5) && most.abs_diff_eq(max, 1e-5), "{name}");
        if finite == 13_704 {
            check_ends(&particles, expected, &[("rgba", "rgba")]);
            let color = expected["first"]["rgba"].as_u64().unwrap();
            assert_eq!(number(&particles, "red", 0, 0) as u64, color >> 16 & 255);
        }
    }

    for (name, format) in [("1.2-with-color.las", "LAS"), ("autzen_trim.laz", "LAS")] {
        let Some((sequence, expected)) = check_shared(&format!("pointcloud/{name}")) else { return };
        assert!(sequence.format().starts_with(format));
        let particles = frame(&sequence, 0).particles;
        let wanted = expected["attributes"].as_array().unwrap().iter().flat_map(Value::as_str);
        let names: Vec<(&str, &str)> =
            wanted.filter(|it| !["X", "Y", "Z"].contains(it)).map(|it| (it, it)).collect();
        for (_, name) in &names {
            assert!(particles.attribute(name).is_some(), "{name}");
        }
        check_ends(&particles, &expected, &names);
        for (end, id) in [("first", 0), ("last", particles.len() - 1)] {
            let found = particles.positions().world(id);
            assert!(found.abs_diff_eq(vector(&expected[end]["xyz"]), 1e-3), "{name}: {found}");
        }
    }

    let name = "pointcloud/bunnyInt19.e57";
    let expected = &all["files"][name]["expected"]["scan"][0];
    let particles = frame(&open(&folder.join(name)), 0).particles;
    assert_eq!(particles.len(), 30_571);
    let [min, max] = ["min", "max"].map(|it| vector(&expected["bounds_before_pose"][it]));
    let [least, most] = particles.world_bounds().unwrap().map(DVec3::from_array);
    assert!(least.abs_diff_eq(min, 1e-5) && most.abs_diff_eq(max, 1e-5), "{least} {most}");

    let Some((sequence, expected)) = check_shared("pointcloud/xyzrgb.pts") else { return };
    let particles = frame(&sequence, 0).particles;
    for (place, name) in [(3, "red"), (4, "green"), (5, "blue")] {
        assert_eq!(number(&particles, name, 4, 0), expected["last"][place].as_f64().unwrap());
    }
}

#[test]
fn a_file_that_is_cut_says_so() {
    let Some((folder, _)) = shared() else { return };
    let mut names = vec![
        "cosmology/galaxy_littleendian.gadget1",
        "cosmology/shocktube.tipsy",
        "pointcloud/bunny.pcd",
        "pointcloud/milk_color.pcd",
        "pointcloud/1.2-with-color.las",
        "pointcloud/autzen_trim.laz",
        "pointcloud/bunnyInt19.e57",
        "pointcloud/xyzrgb.pts",
    ];
    if cfg!(feature = "hdf5") {
        names.extend(["cosmology/lcdm_gas_swift.hdf5", "hdf5/distgen_openpmd.h5", "molecular/cu.h5md"]);
    }
    for name in names {
        let path = folder.join(name);
        check_truncated(path.file_name().unwrap().to_str().unwrap(), &std::fs::read(&path).unwrap());
    }
}

#[test]
fn types_are_only_chosen_where_there_are_some() {
    let folder = Folder::new("types");
    let path = folder.file("a.xyz", b"1\n\nO 0 0 0\n");
    let options = Options { types: Some(vec!["gas".into()]), ..Options::default() };
    let message = Sequence::open(&[path], &options, &()).err().unwrap().to_string();
    assert!(message.contains("a.xyz") && message.contains("--filter"), "{message}");
    let path = folder.file("a.xyz", b"1\n\nO 0 0 0\n");
    let options = Options { dataset: Some("x".into()), ..Options::default() };
    let message = Sequence::open(&[path], &options, &()).err().unwrap().to_string();
    assert!(message.contains("only for HDF5, a.xyz is of the format XYZ"), "{message}");
}

#[test]
fn all_compressions_have_the_same_content() {
    let folder = Folder::new("packed");
    let text = b"2\n\nO 0 0 0\nH 1 2 3\n";
    let bzip2 = {
        let mut encoder = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::fast());
        encoder.write_all(text).unwrap();
        encoder.finish().unwrap()
    };
    let xz = {
        let mut writer =
            lzma_rust2::XzWriter::new(Vec::new(), lzma_rust2::XzOptions::with_preset(1)).unwrap();
        writer.write_all(text).unwrap();
        writer.finish().unwrap()
    };
    for (name, packed) in [("gzip", gzip(text)), ("zstd", zstd(text)), ("bzip2", bzip2), ("xz", xz)] {
        let sequence = open(&folder.file(name, &packed));
        assert_eq!(sequence.format(), format!("XYZ (text, {name})"));
        assert_eq!(frame(&sequence, 0).particles.positions().world(1).to_array(), [1.0, 2.0, 3.0]);
    }
}
