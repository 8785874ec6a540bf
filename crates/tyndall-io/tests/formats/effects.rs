//! VTK, MegaMol and the formats of visual effects, through the front door.

use serde_json::Value;
use tyndall::particles::Radii;
use tyndall::{Particles, Values};
use tyndall_io::{Options, Sequence};

use super::{Folder, check_shared, check_truncated, frame, gzip, open, shared};

/// The values of an attribute of a particle.
fn values(particles: &Particles, name: &str, id: usize) -> Vec<f64> {
    let attribute = particles.attribute(name).unwrap_or_else(|| panic!("no attribute {name}"));
    (0..attribute.components).map(|component| attribute.number(id, component)).collect()
}

/// Checks the attributes of the first and the last particle, where the expected file has them.
fn check_attributes(name: &str, particles: &Particles, expected: &Value) {
    for (end, id) in [("first", 0), ("last", particles.len() - 1)] {
        for (key, wanted) in expected[end].as_object().unwrap() {
            if key.eq_ignore_ascii_case("position") {
                continue;
            }
            let wanted: Vec<f64> = match wanted.as_array() {
                Some(list) => list.iter().flat_map(Value::as_f64).collect(),
                None => vec![wanted.as_f64().unwrap()],
            };
            let found = values(particles, key, id);
            let close = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-6 * b.abs();
            assert!(
                found.len() == wanted.len() && found.iter().zip(&wanted).all(close),
                "{name}: {key} of {end} is {found:?}, wanted {wanted:?}"
            );
        }
    }
}

#[test]
fn shared_files_are_read_as_other_programs_read_them() {
    for (name, title) in [
        ("vtk/bunny_frame_14_7705_particles.vtk", "legacy VTK (binary, unstructured grid)"),
        ("vtk/cube_8_particles.vtk", "legacy VTK (text, unstructured grid)"),
        ("vtk/dem_grains_zlib.vtp", "VTK PolyData"),
        ("vtk/double_dam_break_frame_26_4732_particles.vtk", "legacy VTK (binary, unstructured grid)"),
        ("vtk/fluid_250_particles.vtu", "VTK UnstructuredGrid"),
        ("vtk/sailors_knot_19539_particles.vtk", "legacy VTK (binary, unstructured grid)"),
        ("prt/fluid50.prt", "Krakatoa PRT 1.0"),
        ("prt/fractal_312.prt", "Krakatoa PRT 1.1"),
        ("partio/fluid50.ptc", "PTC"),
        ("partio/fluid50.pda", "Maya PDA (text)"),
        ("houdini/partio_test.geo", "Houdini GEO"),
    ] {
        let Some((sequence, expected)) = check_shared(name) else { return };
        assert_eq!(sequence.format(), title, "{name}");
        check_attributes(name, &frame(&sequence, 0).particles, &expected);
    }
}

#[test]
fn shared_lists_of_megamol_have_their_radii_and_colors() {
    let Some((folder, all)) = shared() else { return };
    let mut files = 0;
    for (name, entry) in all["files"].as_object().unwrap().iter().filter(|it| it.0.starts_with("mmpld/")) {
        let Some((sequence, _)) = check_shared(name) else { return };
        assert!(sequence.format().starts_with("MMPLD 1."), "{name}");
        let particles = frame(&sequence, 0).particles;
        let first = &entry["expected"]["first_frame"];
        let near = |a: f64, b: &Value| b.as_f64().is_none_or(|b| (a - b).abs() < 1e-6);
        assert!(near(particles.time().unwrap_or(f64::NAN), &first["time"]), "{name}");
        let mut id = 0;
        for list in first["lists"].as_array().unwrap() {
            let count = list["particles"].as_u64().unwrap() as usize;
            for (end, id) in [("first", id), ("last", id + count - 1)] {
                let radius = particles.radius(particles.radii().unwrap(), id);
                assert!(near(radius.into(), &list["global_radius"]), "{name}: {radius}");
                let colors = list[end]["colour"].as_array().or(list["global_rgba"].as_array());
                let colors: Vec<f64> = colors.into_iter().flatten().flat_map(Value::as_f64).collect();
                let kind = list["colour"].as_str().unwrap();
                if kind.ends_with("_i") {
                    assert_eq!(values(&particles, "intensity", id), colors, "{name}");
                    continue;
                }
                let factor = match kind {
                    "ushort_rgba" => 255.0 / 65535.0,
                    "float_rgb" | "float_rgba" => 255.0,
                    _ => 1.0,
                };
                let found = values(&particles, "color", id);
                let alike = found.iter().zip(&colors).all(|(a, b)| (a - (b * factor).round()).abs() < 1e-9);
                assert!(found.len() >= 3 && alike, "{name}: {found:?}, wanted {colors:?}");
            }
            id += count;
        }
        assert_eq!(id, particles.len(), "{name}");
        check_truncated("a.mmpld", &std::fs::read(folder.join(name)).unwrap());
        files += 1;
    }
    assert!(files > 10);
}

#[test]
fn shared_files_that_are_cut_say_so() {
    let Some((folder, _)) = shared() else { return };
    for name in [
        "vtk/cube_8_particles.vtk",
        "vtk/sailors_knot_19539_particles.vtk",
        "vtk/dem_grains_zlib.vtp",
        "vtk/fluid_250_particles.vtu",
        "prt/fractal_312.prt",
        "partio/fluid50.ptc",
        "partio/fluid50.pda",
        "houdini/partio_test.geo",
    ] {
        let extension = name.rsplit('.').next().unwrap();
        check_truncated(&format!("a.{extension}"), &std::fs::read(folder.join(name)).unwrap());
    }
}

const VTK: &str = "# vtk DataFile Version 3.0\nd\u{e9}j\u{e0} vu\nASCII\nDATASET POLYDATA\nPOINTS 2 float\n0 0 0 1 2 3\n\
    POINT_DATA 2\nSCALARS diameter float\nLOOKUP_TABLE default\n1 2\n";

#[test]
fn lists_of_files_are_sequences_with_times() {
    let folder = Folder::new("lists");
    folder.file("ä 1.vtk", VTK.as_bytes());
    folder.file("b.vtk.gz", &gzip(VTK.replace("1 2 3", "4 5 6").as_bytes()));
    let pvd = "<?xml version='1.0'?>\n<VTKFile type='Collection' version='0.1'><Collection>\n\
        <DataSet timestep='0.5' group='' part='0' file='ä 1.vtk'/>\n<DataSet timestep='1' file='b.vtk.gz'/>\n</Collection></VTKFile>";
    let series = "{\"file-series-version\": \"1.0\", \"files\": [{\"name\": \"ä 1.vtk\", \"time\": 0.5}, {\"name\": \"b.vtk.gz\", \"time\": 1}]}";
    for (name, text, title) in
        [("run.pvd", pvd, "ParaView collection"), ("run.vtk.series", series, "ParaView file series")]
    {
        let sequence = open(&folder.file(name, text.as_bytes()));
        assert_eq!((sequence.len(), sequence.format()), (2, title));
        let frames = [0, 1].map(|number| frame(&sequence, number).particles);
        assert_eq!(frames.each_ref().map(Particles::time), [Some(0.5), Some(1.0)]);
        assert_eq!(frames.each_ref().map(|it| it.positions().world(1).x), [1.0, 4.0]);
        assert_eq!(frames[0].radii(), Some(&Radii::PerParticle { attribute: 0, scale: 0.5 }));
        assert_eq!(frames[0].attribute("diameter").unwrap().values, Values::F32(vec![1.0, 2.0]));
    }
    folder.file("c.xyz", b"0\n\n");
    let foreign = folder.file("foreign.pvd", pvd.replace("b.vtk.gz", "c.xyz").as_bytes());
    let error = open(&foreign).frame(1, &()).unwrap_err().to_string();
    assert!(error.contains("c.xyz") && error.contains("glob"), "{error}");
}

#[test]
fn grids_and_later_formats_have_a_way_out() {
    let folder = Folder::new("others");
    for (name, text, what) in [
        ("a.vti", "<VTKFile type=\"ImageData\"><ImageData/></VTKFile>", "[grid] of a scene file"),
        (
            "a.vtk",
            "# vtk DataFile Version 3.0\nx\nASCII\nDATASET STRUCTURED_POINTS\n",
            "[grid] of a scene file",
        ),
    ] {
        let path = folder.file(name, text.as_bytes());
        let error = Sequence::open(&[path], &Options::default(), &()).err().unwrap().to_string();
        assert!(error.contains(what), "{error}");
    }
    let path = folder.file("a.prt", b"\xc0PRT2\r\n\x1a rest");
    let error = Sequence::open(&[path], &Options::default(), &()).err().unwrap().to_string();
    assert!(error.contains("PRT 1"), "{error}");
}
