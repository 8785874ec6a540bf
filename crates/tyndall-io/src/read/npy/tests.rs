//! Facts about reading NPY and NPZ files: files that NumPy wrote, and arrays written here.

use std::path::PathBuf;

use tyndall::particles::Values;

use super::*;
use crate::read::real_data;

fn data(name: &str) -> Vec<u8> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name);
    std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn read_all(file: impl AsRef<[u8]>) -> Result<Frame> {
    assert!(recognise(file.as_ref()));
    read(Path::new("test"), file.as_ref(), None, &())
}

fn message(file: impl AsRef<[u8]>) -> String {
    read_all(file).unwrap_err().to_string()
}

/// An array of version 1.
fn array(descr: &str, fortran_order: &str, shape: &str, values: &[u8]) -> Vec<u8> {
    let text = format!("{{'descr': {descr}, 'fortran_order': {fortran_order}, 'shape': {shape}, }}\n");
    let mut file = b"\x93NUMPY\x01\0".to_vec();
    file.extend((text.len() as u16).to_le_bytes());
    file.extend(text.as_bytes());
    file.extend(values);
    file
}

fn floats(count: usize) -> Vec<u8> {
    (0..count).flat_map(|value| (value as f32).to_le_bytes()).collect()
}

/// Position `id` of the files that NumPy wrote.
fn position(id: usize) -> [f64; 3] {
    [0, 1, 2].map(|axis| (3 * id + axis) as f64 * 1.5 - 3.0)
}

fn assert_positions(frame: &Frame) {
    assert_eq!(frame.particles.len(), 5);
    for id in 0..5 {
        assert_eq!(frame.particles.positions().world(id).to_array(), position(id), "particle {id}");
    }
}

fn values<'a>(frame: &'a Frame, name: &str) -> &'a Values {
    &frame.particles.attribute(name).unwrap_or_else(|| panic!("no {name}")).values
}

#[test]
fn fortran_order_is_understood() {
    let frame = read_all(data("fortran_f8.npy")).unwrap();
    assert_positions(&frame);
    assert!(
        frame.particles.attributes().is_empty() && frame.conventions.is_empty() && frame.warnings.is_empty()
    );
}

#[test]
fn structures_of_big_endian_numbers_are_understood() {
    let frame = read_all(data("structured_be.npy")).unwrap();
    assert_positions(&frame);
    let names: Vec<&str> = frame.particles.attributes().iter().map(|it| it.name.as_str()).collect();
    assert_eq!(names, ["id", "vel", "alive", "kind", "inner.a", "inner.b"]);
    assert_eq!(*values(&frame, "id"), Values::I64((0..5).map(|id| 3_999_999_995 + id).collect()));
    assert_eq!(*values(&frame, "vel"), Values::F32((0..15).map(|it| it as f32 * 15.0 - 30.0).collect()));
    assert_eq!(frame.particles.attribute("vel").unwrap().components, 3);
    assert_eq!(*values(&frame, "alive"), Values::U8(vec![1, 0, 1, 1, 0]));
    assert_eq!(*values(&frame, "inner.a"), Values::I32(vec![0, -1, -2, -3, -4]));
    assert_eq!(*values(&frame, "inner.b"), Values::I64((0..5).map(|id| (1 << 40) + id).collect()));
    let names = ["water", "air", ""].map(String::from).to_vec();
    assert_eq!(*values(&frame, "kind"), Values::Text { codes: vec![0, 1, 0, 2, 1], names });
}

#[test]
fn archives_are_read_alike_stored_and_deflated() {
    for name in ["stored.npz", "deflate.npz"] {
        let frame = read_all(data(name)).unwrap();
        assert_positions(&frame);
        assert_eq!(frame.particles.radii(), Some(&Radii::Uniform(0.25)), "{name}");
        assert_eq!(frame.particles.time(), Some(1.5));
        assert_eq!(
            *values(&frame, "vel"),
            Values::F64((0..15).map(|it| f64::from(it) * 3.0 - 6.0).collect())
        );
        assert_eq!(*values(&frame, "mass"), Values::I32(vec![0, 1, 2, 3, 4]));
        let names = ["Ar", "Äé", "Xe"].map(String::from).to_vec();
        assert_eq!(*values(&frame, "kind"), Values::Text { codes: vec![0, 1, 0, 2, 2], names });
        assert_eq!(*values(&frame, "mask"), Values::U8(vec![1, 0, 1, 1, 0]));
        assert!(
            frame.warnings.len() == 1 && frame.warnings[0].contains("'box' has 3 rows"),
            "{:?}",
            frame.warnings
        );
    }
}

#[test]
fn objects_are_left_out_of_archives_and_refused_alone() {
    let frame = read_all(data("xyz_object.npz")).unwrap();
    assert_positions(&frame);
    assert!(frame.warnings[0].contains("'names': the array holds Python objects"), "{:?}", frame.warnings);
    assert!(message(data("object.npy")).contains("astype"));
}

#[test]
fn padding_and_names_beyond_latin_are_understood() {
    let frame = read_all(data("aligned.npy")).unwrap();
    assert_eq!(frame.particles.positions().world(1).to_array(), [4.0, 5.0, 6.0]);
    assert_eq!(*values(&frame, "flag"), Values::U8(vec![1, 2]));
    assert_eq!(*values(&frame, "w"), Values::F64(vec![7.0, 8.0]));
    let frame = read_all(data("version_3.npy")).unwrap();
    assert_eq!(*values(&frame, "θ"), Values::F32(vec![1.0, 2.0]));
}

#[test]
fn shapes_that_need_a_guess_are_said() {
    let world = |frame: &Frame, id| frame.particles.positions().world(id).to_array();
    let frame = read_all(array("'<f4'", "False", "(3, 2)", &floats(6))).unwrap();
    assert_eq!((frame.particles.len(), world(&frame, 2)), (3, [4.0, 5.0, 0.0]));
    assert!(frame.conventions[0].contains("z is taken as 0"));

    let frame = read_all(array("'<f4'", "False", "(3, 4)", &floats(12))).unwrap();
    assert_eq!((frame.particles.len(), world(&frame, 1)), (3, [4.0, 5.0, 6.0]));
    assert_eq!(*values(&frame, "radius"), Values::F32(vec![3.0, 7.0, 11.0]));
    assert!(frame.conventions[0].contains("radius"));

    for order in ["False", "True"] {
        let frame = read_all(array("'<f4'", order, "(3, 5)", &floats(15))).unwrap();
        let wanted = if order == "False" { [1.0, 6.0, 11.0] } else { [3.0, 4.0, 5.0] };
        assert_eq!((frame.particles.len(), world(&frame, 1)), (5, wanted));
        assert!(frame.conventions[0].contains("transposed"));
    }

    let frame = read_all(array("'<f4'", "False", "(2, 6)", &floats(12))).unwrap();
    assert_eq!((frame.particles.len(), world(&frame, 1)), (2, [6.0, 7.0, 8.0]));
    assert_eq!(*values(&frame, "column 4"), Values::F32(vec![4.0, 10.0]));
}

#[test]
fn all_types_of_numbers_are_positions() {
    for (descr, bytes) in [
        ("'|i1'", vec![1, 2, 0xff]),
        ("'|u1'", vec![1, 2, 0xff]),
        ("'>i2'", vec![0, 1, 0, 2, 0xff, 0xff]),
        ("'<u2'", vec![1, 0, 2, 0, 0xff, 0xff]),
        ("'<i8'", [1i64, 2, -1].map(i64::to_le_bytes).concat()),
        ("'>u8'", [1u64, 2, 255].map(u64::to_be_bytes).concat()),
        ("'>f2'", vec![0x3c, 0, 0x40, 0, 0xbc, 0]),
        ("'>f8'", [1f64, 2.0, -1.0].map(f64::to_be_bytes).concat()),
    ] {
        let frame = read_all(array(descr, "False", "(1, 3)", &bytes)).unwrap();
        let world = frame.particles.positions().world(0);
        assert_eq!((world.x, world.y), (1.0, 2.0), "{descr}");
        assert!([-1.0, 255.0, 65535.0].contains(&world.z), "{descr}: {world}");
    }
}

#[test]
fn none_is_fine_and_what_is_not_a_number_is_dropped() {
    assert!(read_all(array("'<f4'", "False", "(0, 3)", &[])).unwrap().particles.is_empty());
    let values =
        [[1f32, 2.0, 3.0], [f32::NAN, 0.0, 0.0]].as_flattened().iter().flat_map(|it| it.to_le_bytes());
    let particles =
        read_all(array("'<f4'", "False", "(2, 3)", &values.collect::<Vec<_>>())).unwrap().particles;
    assert_eq!((particles.len(), particles.dropped().position), (1, 1));
}

#[test]
fn errors_say_what_was_found() {
    assert!(message(array("'<f4'", "False", "(6,)", &floats(6))).contains("found: '' (6,)"));
    assert!(message(array("'<f4'", "False", "(2, 7, 3)", &floats(42))).contains("one frame a file"));
    assert!(message(array("'<c8'", "False", "(1, 3)", &[0; 24])).contains("type cannot be shown"));
    let cut = message(array("'<f4'", "False", "(3, 3)", &[0; 35]));
    assert!(cut.contains("promises 3 particles of 12 bytes, 35 bytes are there: enough for 2"), "{cut}");
}

#[test]
fn hostile_shapes_are_refused() {
    for shape in ["(1152921504606846976, 3)", "(3, 18446744073709551615)", "(4294967296, 4294967296, 3)"] {
        assert!(read_all(array("'<f4'", "False", shape, &floats(9))).is_err(), "{shape}");
    }
    for descr in ["'|S0'", "'|V0'", "[('x', '|S0')]", "[]", "[('a', [], (4294967296,))]"] {
        assert!(read_all(array(descr, "False", "(1152921504606846976,)", &[])).is_err(), "{descr}");
    }
    let hostile = "[('a', [('b', [('c', '<f4')], (4294967295,))], (4294967295,))]";
    assert!(read_all(array(hostile, "False", "(1,)", &floats(9))).is_err());
    let hostile = "[('x', '<f4', (4611686018427387904,)), ('y', '<f4')]";
    assert!(read_all(array(hostile, "False", "(1,)", &floats(9))).is_err());
}

#[test]
fn a_file_cut_anywhere_is_refused() {
    for name in ["fortran_f8.npy", "structured_be.npy", "stored.npz", "deflate.npz"] {
        let file = data(name);
        for length in 0..file.len() {
            let cut = read(Path::new("test"), &file[..length], None, &());
            assert!(cut.is_err(), "{name}: {length} bytes");
        }
    }
}

#[test]
fn a_box_is_no_positions() {
    let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for (name, shape, count) in [("R.npy", "(2, 4, 3)", 24), ("box.npy", "(3, 3)", 9)] {
        zip.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
        std::io::Write::write_all(&mut zip, &array("'<f4'", "False", shape, &floats(count))).unwrap();
    }
    assert!(message(zip.finish().unwrap().into_inner()).contains("of shape (N, 3), was wanted"));
}

/// A directory that lists one small entry a thousand times would unpack to a thousand times its size.
#[test]
fn archives_with_overlapping_entries_are_refused() {
    let file = data("deflate.npz");
    let end = memchr::memmem::rfind(&file, b"PK\x05\x06").unwrap();
    let start = u32::from_le_bytes(file[end + 16..][..4].try_into().unwrap()) as usize;
    let mut hostile = file[..start].to_vec();
    for copy in 0..20u8 {
        let mut directory = file[start..end].to_vec();
        for name in memchr::memmem::find_iter(&file[start..end], b".npy") {
            directory[name - 1] = b'a' + copy;
        }
        hostile.extend(directory);
    }
    let length = (hostile.len() - start) as u32;
    hostile.extend(&file[end..]);
    let end = hostile.len() - 22;
    let entries = 20 * u16::from_le_bytes([file[file.len() - 12], file[file.len() - 11]]);
    hostile[end + 8..][..2].copy_from_slice(&entries.to_le_bytes());
    hostile[end + 10..][..2].copy_from_slice(&entries.to_le_bytes());
    hostile[end + 12..][..4].copy_from_slice(&length.to_le_bytes());
    assert!(message(hostile).contains("overlap"));
}

#[test]
fn damage_never_panics() {
    for name in
        ["fortran_f8.npy", "structured_be.npy", "aligned.npy", "stored.npz", "deflate.npz", "xyz_object.npz"]
    {
        real_data::damage(&data(name), |file| drop(read(Path::new("test"), file, None, &())));
    }
}

#[test]
fn a_damaged_value_in_an_archive_is_noticed() {
    for (name, behind_name) in [("stored.npz", 200), ("deflate.npz", 100)] {
        let mut file = data(name);
        let place = memchr::memmem::find(&file, b"pos.npy").unwrap() + behind_name;
        file[place] ^= 0x10;
        let error = message(file);
        assert!(error.contains("(test: pos)"), "{name}: {error}");
    }
}
