use super::*;
use crate::read::real_data;

const SAMPLE: &str = include_str!("../../../tests/data/samples/universal.usda");

/// Reads frame `number`; how many frames there are comes with it.
fn read(text: &str, number: usize) -> Result<(usize, Frame)> {
    let (path, options) = (Path::new("test"), Options::default());
    let index = index(path, text.as_bytes(), &options)?;
    let request = Request { options: &options, bytes: None, units: None, topology: None, others: &() };
    let count = index.frames.len();
    Ok((count, frame(path, text.as_bytes(), index.frames[number], &request, &())?))
}

fn numbers(frame: &Frame, name: &str) -> Vec<f64> {
    let attribute = frame.particles.attribute(name).unwrap_or_else(|| panic!("no {name}"));
    let count = frame.particles.len() * attribute.components;
    (0..count).map(|it| attribute.number(it / attribute.components, it % attribute.components)).collect()
}

#[test]
fn clouds_are_joined_at_their_places_in_every_frame() {
    for text in [SAMPLE.to_string(), SAMPLE.replace('\n', "\r\n")] {
        for number in 0..2 {
            let (count, frame) = read(&text, number).unwrap();
            assert_eq!(count, 2);
            let particles = &frame.particles;
            let places: Vec<DVec3> = (0..4).map(|id| particles.positions().world(id)).collect();
            // Turned by -90 degrees around z, then by 90, and twice as far along z.
            let z = 2.0 * number as f64;
            let wanted = [[10.0, 0.0, z], [11.0, 0.0, z], [10.0, 1.0, z], [15.0, 5.0, 5.0]];
            for (place, wanted) in places.iter().zip(wanted) {
                assert!(place.abs_diff_eq(DVec3::from_array(wanted), 1e-5), "{place} {wanted:?}");
            }
            assert_eq!(particles.time(), Some(0.5 * number as f64));
            assert_eq!((particles.time_unit(), particles.length_unit()), (Some("s"), Some("cm")));
            let radii = numbers(&frame, "radius");
            let factor = 2f64.cbrt();
            assert_eq!(radii[3], 0.5);
            for (radius, width) in radii.iter().zip([0.5, 0.25, 1.0]) {
                assert!((radius - 0.5 * width * factor).abs() < 1e-6, "{radii:?}");
            }
            assert!(numbers(&frame, "velocity")[..9].chunks(3).all(|it| (it[2] - 4.0).abs() < 1e-6));
            assert_eq!(numbers(&frame, "stress")[..6], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
            assert_eq!(numbers(&frame, "color")[..6], [1.0, 0.5, 0.0, 1.0, 0.5, 0.0]);
            assert_eq!(numbers(&frame, "id")[..3], [7.0, 8.0, 9e9]);
            assert!(numbers(&frame, "id")[3].is_nan() && numbers(&frame, "scales")[9..] == [1.0, 2.0, 3.0]);
            let words = |name: &str| match &particles.attribute(name).unwrap().values {
                Values::Text { codes, names } => {
                    codes.iter().map(|&it| names[it as usize].clone()).collect::<Vec<_>>().join("|")
                }
                _ => panic!("{name}"),
            };
            assert_eq!(words("label"), "a, \"b\"|c|a, \"b\"|");
            assert_eq!(words("prim"), "spray|spray|spray|stones");
            assert!(frame.conventions.iter().any(|it| it.contains("--up y")), "{:?}", frame.conventions);
        }
    }
}

#[test]
fn transforms_are_those_of_their_names() {
    let place = |operations: &str, order: &str| {
        let text = format!(
            "#usda 1.0\ndef Points \"p\" {{\n{operations}\nuniform token[] xformOpOrder = [{order}]\npoint3d[] points = [(1, 2, 3)]\n}}\n"
        );
        read(&text, 0).unwrap().1
    };
    let near = |frame: &Frame, wanted: [f64; 3]| {
        let found = frame.particles.positions().world(0);
        assert!(found.abs_diff_eq(DVec3::from_array(wanted), 1e-9), "{found} {wanted:?}");
    };
    near(&place("float3 xformOp:scale = (2, 3, 4)", "\"xformOp:scale\""), [2.0, 6.0, 12.0]);
    near(&place("float xformOp:rotateX = 90", "\"xformOp:rotateX\""), [1.0, -3.0, 2.0]);
    // Around x, then y: (1, 2, 3) -> (1, -3, 2) -> (2, -3, -1).
    near(&place("float3 xformOp:rotateXYZ = (90, 90, 0)", "\"xformOp:rotateXYZ\""), [2.0, -3.0, -1.0]);
    let half = 0.5f64.sqrt();
    let turn = format!("quatd xformOp:orient = ({half}, {half}, 0, 0)");
    near(&place(&turn, "\"xformOp:orient\""), [1.0, -3.0, 2.0]);
    let both = "double3 xformOp:translate:pivot = (1, 0, 0)\nfloat xformOp:rotateZ = 90";
    let order = "\"xformOp:translate:pivot\", \"xformOp:rotateZ\", \"!invert!xformOp:translate:pivot\"";
    near(&place(both, order), [-1.0, 0.0, 3.0]);
    let unknown = place("float xformOp:shear = 90", "\"xformOp:shear\"");
    assert!(unknown.warnings[0].contains("xformOp:shear of prim 'p'"), "{:?}", unknown.warnings);
}

#[test]
fn faults_are_told_with_their_place() {
    for (from, to, what) in [
        ("(1, 0, 0)", "(1, x, 0)", "prim 'spray'"),
        ("(1, 0, 0)", "(1, 0)", "three coordinates"),
        ("12: [", "later: [", "found 'later:'"),
        ("indices = [0, 1, 0]", "indices = [0, 2, 0]", "the index 2 is none of 2 elements"),
        ("def Points \"spray\"", "def Points spray", "the name of a prim"),
        ("\"spray\" (", "\"spray\" [", "line 17"),
    ] {
        let error = read(&SAMPLE.replacen(from, to, 1), 0).err().unwrap().to_string();
        assert!(error.contains(what), "{to}: {error}");
    }
    let short = read(&SAMPLE.replace("widths = [0.5, ", "widths = ["), 0).unwrap().1;
    assert!(short.warnings.iter().any(|it| it.contains("2 values for 3 points")), "{:?}", short.warnings);
    let none = read("#usda 1.0\ndef Mesh \"m\" { point3f[] points = [(1, 2, 3)] }\n", 0).err().unwrap();
    assert!(none.to_string().contains("no prim of type Points"), "{none}");
    let deep = format!("#usda 1.0\n{}", "def Xform \"a\" {\n".repeat(300));
    assert!(read(&deep, 0).err().unwrap().to_string().contains("in each other"));
    real_data::damage(SAMPLE.as_bytes(), |file| drop(read(&String::from_utf8_lossy(file), 0)));
}
