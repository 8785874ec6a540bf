//! Facts about reading PLY files: the same particles in every encoding, odd headers, damage.

use std::fmt::Write;
use std::path::Path;

use super::*;
use crate::read::real_data;

const HEADER: &str = "element vertex 3
property double x
property float y
property float z
property uchar red
property short charge
property uint id
property float radius
end_header
";

/// x, y, z, red, charge, id, radius.
type Row = (f64, f32, f32, u8, i16, u32, f32);

const ROWS: [Row; 3] = [
    (1.5e6, 0.1, -2.0, 255, -300, 7, 0.5),
    (1.500001e6, 0.2, 1e-3, 0, 300, 4_000_000_000, 0.25),
    (-1.0, 3.3333333, 4.0, 17, 0, 0, 1.0),
];

fn text() -> Vec<u8> {
    let mut file = format!("ply\nformat ascii 1.0\ncomment made by a test\n{HEADER}");
    for (x, y, z, red, charge, id, radius) in ROWS {
        writeln!(file, "{x} {y} {z} {red} {charge} {id} {radius}").unwrap();
    }
    file.into_bytes()
}

fn binary(big: bool) -> Vec<u8> {
    let name = if big { "big" } else { "little" };
    let mut file = format!("ply\nformat binary_{name}_endian 1.0\n{HEADER}").into_bytes();
    for (x, y, z, red, charge, id, radius) in ROWS {
        macro_rules! put {
            ($($value:expr),*) => {$(
                file.extend_from_slice(&if big { $value.to_be_bytes() } else { $value.to_le_bytes() });
            )*};
        }
        put!(x, y, z, red, charge, id, radius);
    }
    file
}

fn read_all(file: impl AsRef<[u8]>) -> Result<Frame> {
    read(Path::new("test"), file.as_ref(), None, &())
}

fn message(file: impl AsRef<[u8]>) -> String {
    read_all(file).unwrap_err().to_string()
}

#[test]
fn all_encodings_give_the_same_particles() {
    let frames = [text(), binary(false), binary(true)].map(|file| read_all(file).unwrap().particles);
    for particles in &frames {
        assert_eq!(particles.positions(), frames[0].positions());
        assert_eq!(particles.attributes(), frames[0].attributes());
        assert_eq!(particles.radii(), Some(&Radii::PerParticle { attribute: 3, scale: 1.0 }));
    }
    let particles = &frames[0];
    let names: Vec<&str> = particles.attributes().iter().map(|it| it.name.as_str()).collect();
    assert_eq!(names, ["red", "charge", "id", "radius"]);
    assert_eq!(particles.attributes()[0].values, Values::U8(vec![255, 0, 17]));
    assert_eq!(particles.attributes()[1].values, Values::I32(vec![-300, 300, 0]));
    assert_eq!(particles.attributes()[2].values, Values::I64(vec![7, 4_000_000_000, 0]));
    assert_eq!(particles.attributes()[3].values, Values::F32(vec![0.5, 0.25, 1.0]));
    for (id, row) in ROWS.iter().enumerate() {
        let world = particles.positions().world(id);
        assert!((world.x - row.0).abs() < 0.1 && (world.y - f64::from(row.1)).abs() < 1e-6, "{id}: {world}");
    }
}

#[test]
fn line_ends_of_all_systems_are_understood() {
    let wanted = read_all(text()).unwrap().particles;
    let text = String::from_utf8(text()).unwrap();
    for end in ["\r\n", "\r", "\n\n", " \n"] {
        let found = read_all(text.replace('\n', end).replacen("ply ", "ply", 1)).unwrap().particles;
        assert_eq!(found.positions(), wanted.positions(), "{end:?}");
    }
    let binary = binary(true);
    let body = binary.len() - 3 * 27;
    let header = String::from_utf8(binary[..body].to_vec()).unwrap().replace('\n', "\r\n");
    let found = read_all([header.as_bytes(), &binary[body..]].concat()).unwrap().particles;
    assert_eq!(found.positions(), wanted.positions());
}

/// The same vertices in text and binary, with elements before and behind and lists inside.
fn with_lists() -> [Vec<u8>; 2] {
    let header = "element camera 2
property list uchar short view
property float focus
element empty 3
element vertex 2
property float z
property list uint8 int32 neighbors
property float y
property float x
element face 1
property list uchar int vertex_indices
end_header
";
    let text = "2 5 6 1.5\n0 2.5\n3 2 8 9 2 1\n6 0 5 4\n3 0 1 1\n";
    let mut binary = Vec::new();
    binary.extend([2, 5, 0, 6, 0].iter().chain(&1.5f32.to_le_bytes()));
    binary.extend([0].iter().chain(&2.5f32.to_le_bytes()));
    binary.extend(3f32.to_le_bytes().iter().chain(&[2]).chain(&[0; 8]));
    binary.extend([2f32, 1.0].map(f32::to_le_bytes).as_flattened());
    binary.extend(6f32.to_le_bytes().iter().chain(&[0]));
    binary.extend([5f32, 4.0].map(f32::to_le_bytes).as_flattened());
    binary.extend([3; 13]);
    let text = format!("ply\nformat ascii 1.0\n{header}{text}").into_bytes();
    [text, [format!("ply\nformat binary_little_endian 1.0\n{header}").as_bytes(), &binary].concat()]
}

#[test]
fn other_elements_and_lists_are_skipped_and_said() {
    for file in with_lists() {
        let frame = read_all(file).unwrap();
        let positions = frame.particles.positions();
        assert_eq!([0, 1].map(|id| positions.world(id).to_array()), [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
        assert!(frame.particles.attributes().is_empty());
        let warnings = frame.warnings.join("\n");
        assert!(
            ["camera", "empty", "face", "neighbors"].iter().all(|name| warnings.contains(name)),
            "{warnings}"
        );
    }
}

#[test]
fn splats_get_a_radius_from_their_scales() {
    let header = ["x", "y", "z", "f_dc_0", "opacity", "scale_0", "scale_1", "scale_2", "rot_0"]
        .map(|name| format!("property float {name}\n"))
        .concat();
    let file = format!("ply\nformat ascii 1.0\nelement vertex 1\n{header}end_header\n0 0 0 1 1 -1 -2 -3 1\n");
    let frame = read_all(file).unwrap();
    assert!(frame.conventions[0].contains("Gaussian splats"));
    let radius = frame.particles.radius(frame.particles.radii().unwrap(), 0);
    assert!((radius - (-2f32).exp()).abs() < 1e-7, "{radius}");
}

#[test]
fn short_color_names_are_not_taken_for_a_radius() {
    let header = "element vertex 1\nproperty float x\nproperty float y\nproperty float z\nproperty uchar r\n";
    let file = format!(
        "ply\nformat ascii 1.0\n{header}property uchar g\nproperty uchar b\nend_header\n0 0 0 9 8 7\n"
    );
    let frame = read_all(file).unwrap();
    assert_eq!(frame.particles.radii(), None);
    assert!(frame.conventions[0].contains("red, green, blue"));
    assert_eq!(frame.particles.attribute("red").unwrap().number(0, 0), 9.0);
}

#[test]
fn none_is_fine_and_what_is_not_a_number_is_dropped() {
    let header = "property float x\nproperty float y\nend_header\n";
    let frame = read_all(format!("ply\nformat ascii 1.0\nelement vertex 0\n{header}")).unwrap();
    assert!(frame.particles.is_empty() && frame.conventions.len() == 1);
    let words = ["nan", "-nan", "-nan(ind)", "1.#QNAN", "-1.#IND", "inf", "-1.#INF", "1e99"];
    let rows: String = words.iter().map(|word| format!("{word} 0\n")).collect();
    let file = format!("ply\nformat ascii 1.0\nelement vertex 9\n{header}{rows}+1.5 2e0\n");
    let particles = read_all(file).unwrap().particles;
    assert_eq!((particles.len(), particles.dropped().position, particles.place(0)), (1, 8, 8));
    assert_eq!(particles.positions().world(0).to_array(), [1.5, 2.0, 0.0]);
}

#[test]
fn integers_are_checked_against_their_type() {
    let file = |value: &str| {
        let header = "element vertex 1\nproperty int x\nproperty int y\nproperty uchar red\nend_header\n";
        read_all(format!("ply\nformat ascii 1.0\n{header}-3 4 {value}\n"))
    };
    for value in ["255", "255.0", "2.55e2", "+255"] {
        let frame = file(value).unwrap_or_else(|error| panic!("{value}: {error}"));
        assert_eq!(frame.particles.attribute("red").unwrap().values, Values::U8(vec![255]));
    }
    for value in ["256", "-1", "0.5", "x", "-", "1e400", "99999999999999999999", "1 2", ""] {
        assert!(file(value).is_err(), "{value}");
    }
}

#[test]
fn errors_say_what_and_where() {
    let text = String::from_utf8(text()).unwrap();
    let wrong = message(text.replace("300 4", "abc 4"));
    assert!(wrong.contains("line 14") && wrong.contains("'abc' was found"), "{wrong}");
    assert!(message(text.replace("vertex 3", "vertex 4")).contains("promises 4 vertices"));
    assert!(message(text.replace("double x", "quad x")).contains("line 5"));
    assert!(message(text.replace(" x\n", " u\n")).contains("they have: u, y"));
    assert!(message(text.replace("vertex", "corner")).contains("there are: corner"));
    let binary = binary(false);
    let cut = message(&binary[..binary.len() - 1]);
    assert!(cut.contains("promises 3 particles of 27 bytes, 80 bytes are there: enough for 2"), "{cut}");
}

#[test]
fn a_file_cut_anywhere_is_refused() {
    for file in [binary(false), binary(true)] {
        for length in 0..file.len() {
            assert!(read_all(&file[..length]).is_err(), "{length} bytes");
        }
    }
    let file = text();
    for length in 0..file.len() - 1 {
        assert!(read_all(&file[..length]).is_err(), "{length} bytes");
    }
    // Without its line end the last value may be cut: it cannot be known, so it is said.
    assert!(!read_all(&file[..file.len() - 1]).unwrap().warnings.is_empty());
}

#[test]
fn hostile_counts_are_refused() {
    for file in [text(), binary(false)].into_iter().chain(with_lists()) {
        for count in ["1152921504606846976", "18446744073709551615", "4294967296"] {
            let hostile = String::from_utf8_lossy(&file).replace("vertex 3", &format!("vertex {count}"));
            let hostile = hostile.replace("vertex 2", &format!("vertex {count}"));
            assert!(read_all(hostile).is_err());
        }
    }
    let properties: String = (0..10_000).map(|id| format!("property float a{id}\n")).collect();
    let header =
        format!("element vertex 100000\nproperty float x\nproperty float y\n{properties}end_header\n");
    let hostile = message(format!("ply\nformat ascii 1.0\n{header}{}", "1\n".repeat(100_000)));
    assert!(hostile.contains("promises 100000 vertices of 10002 values"), "{hostile}");
}

#[test]
fn many_blocks_of_text_are_read_in_order() {
    let count = 200_000;
    let rows: String = (0..count).map(|id| format!("{id} {}.5 -{id}\n", 2 * id)).collect();
    let header = "property float x\nproperty float y\nproperty float z\nend_header\n";
    let file = format!("ply\nformat ascii 1.0\nelement vertex {count}\n{header}{rows}");
    let particles = read_all(file).unwrap().particles;
    for id in 0..count {
        let at = id as f64;
        assert!(particles.positions().world(id).abs_diff_eq([at, 2.0 * at + 0.5, -at].into(), 0.02), "{id}");
    }
}

#[test]
fn damage_never_panics() {
    for file in [text(), binary(true)].into_iter().chain(with_lists()) {
        real_data::damage(&file, |file| drop(read_all(file)));
    }
}

#[test]
fn a_listener_can_stop_the_reading() {
    struct Impatient;
    impl Progress for Impatient {
        fn begin(&self, _: &str, _: Option<u64>, _: &'static str) {}
        fn advance(&self, _: u64) {}
        fn cancelled(&self) -> bool {
            true
        }
    }
    for file in [text(), binary(true)].into_iter().chain(with_lists()) {
        assert!(matches!(read(Path::new("test"), &file, None, &Impatient), Err(Error::Interrupted)));
    }
}

/// Written by NumPy: a structured array of big-endian numbers behind a header.
#[test]
fn files_of_others_are_understood() {
    let frame = read_all(include_bytes!("../../../tests/data/points_be.ply")).unwrap();
    let particles = frame.particles;
    assert_eq!((particles.len(), particles.positions().world(4).to_array()), (5, [15.0, 16.5, 18.0]));
    assert_eq!(particles.attribute("radius").unwrap().values, Values::F32(vec![0.0, 0.5, 1.0, 1.5, 2.0]));
    assert_eq!(particles.attribute("nx").unwrap().values, Values::F64(vec![-1.0, -0.5, 0.0, 0.5, 1.0]));
    assert_eq!(particles.attribute("label").unwrap().values, Values::I32(vec![-2, -1, 0, 1, 2]));
}

#[test]
fn real_files_are_read_as_plyfile_reads_them() {
    let read = |path: &Path, bytes: &[u8], progress: &dyn Progress| read(path, bytes, None, progress);
    real_data::compare("pointcloud/dem_grains_binary_le.ply", recognise, read);
}
