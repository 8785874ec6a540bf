//! The same tetrahedron and square in all formats, and what is wrong with others.

use std::fmt::Write as _;

use super::*;
use crate::read::numbers::Order;

const CORNERS: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.5, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, -3.0]];
const FACES: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];

fn read(bytes: impl AsRef<[u8]>) -> Result<Mesh> {
    mesh_of("--mesh", Path::new("a.mesh"), bytes.as_ref())
}

fn triangles(bytes: impl AsRef<[u8]>) -> Vec<[[f64; 3]; 3]> {
    read(bytes).unwrap().triangles().map(|triangle| triangle.map(|corner| corner.to_array())).collect()
}

fn binary_stl(comment: &str) -> Vec<u8> {
    let mut file = vec![b' '; 80];
    file[..comment.len()].copy_from_slice(comment.as_bytes());
    file.extend(4_u32.to_le_bytes());
    for face in FACES {
        file.extend([0; 12]);
        file.extend(face.iter().flat_map(|&place| CORNERS[place as usize]).flat_map(f32::to_le_bytes));
        file.extend([7, 9]);
    }
    file
}

fn text_stl() -> String {
    let mut file = "solid a box\n".to_string();
    for face in FACES {
        file += "facet normal 0 0 0\n  outer loop\n";
        for [x, y, z] in face.map(|place| CORNERS[place as usize]) {
            writeln!(file, "    vertex {x} {y:e} {z}").unwrap();
        }
        file += "  endloop\nendfacet\n";
    }
    file + "endsolid a box\n"
}

fn obj() -> String {
    let mut file = "# made by a test\nmtllib a.mtl\no one\n".to_string();
    for [x, y, z] in CORNERS {
        writeln!(file, "v {x} {y} {z} 1.0\nvn 0 0 1").unwrap();
    }
    file += "usemtl red\nf 1 3/2/1 2//1\nf 1/1 2/2 4/4 # from the first\nf -3 -2 -1\r\nf 1 4 3\n";
    file
}

fn ply(order: Option<Order>) -> Vec<u8> {
    let format = match order {
        None => "ascii",
        Some(Order::Little) => "binary_little_endian",
        Some(Order::Big) => "binary_big_endian",
    };
    let mut file = format!(
        "ply\nformat {format} 1.0\nelement vertex 4\nproperty double z\nproperty uchar red\nproperty float x\n\
         property float y\nelement face 4\nproperty uchar flags\nproperty list uchar int vertex_indices\nend_header\n"
    )
    .into_bytes();
    for [x, y, z] in CORNERS {
        let z = f64::from(z);
        match order {
            None => file.extend(format!("{z} 200 {x} {y}\n").bytes()),
            Some(Order::Little) => {
                file.extend(
                    z.to_le_bytes().iter().chain(&[200]).chain(&x.to_le_bytes()).chain(&y.to_le_bytes()),
                );
            }
            Some(Order::Big) => {
                file.extend(
                    z.to_be_bytes().iter().chain(&[200]).chain(&x.to_be_bytes()).chain(&y.to_be_bytes()),
                );
            }
        }
    }
    for face in FACES {
        match order {
            None => file.extend(format!("1 3 {} {} {}\n", face[0], face[1], face[2]).bytes()),
            Some(order) => {
                let bytes =
                    |place: u32| if order == Order::Big { place.to_be_bytes() } else { place.to_le_bytes() };
                file.extend([1, 3].into_iter().chain(face.into_iter().flat_map(bytes)));
            }
        }
    }
    file
}

/// All files, with what they are.
fn files() -> [(&'static str, Vec<u8>); 8] {
    [
        ("binary STL", binary_stl("made by a test")),
        ("binary STL that begins like text", binary_stl("solid body")),
        ("text STL", text_stl().into_bytes()),
        ("text STL of Windows", text_stl().replace('\n', "\r\n").into_bytes()),
        ("OBJ", obj().into_bytes()),
        ("text PLY", ply(None)),
        ("PLY, little endian", ply(Some(Order::Little))),
        ("PLY, big endian", ply(Some(Order::Big))),
    ]
}

#[test]
fn all_formats_give_the_same_triangles() {
    let wanted: Vec<[[f64; 3]; 3]> =
        FACES.iter().map(|face| face.map(|place| CORNERS[place as usize].map(f64::from))).collect();
    for (name, file) in files() {
        assert_eq!(triangles(file), wanted, "{name}");
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.stl.gz");
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    std::io::Write::write_all(&mut packed, &binary_stl("packed")).unwrap();
    std::fs::write(&path, packed.finish().unwrap()).unwrap();
    assert_eq!(mesh("--mesh", &path).unwrap().len(), 4);
}

#[test]
fn damage_is_an_error_or_another_mesh() {
    let (mut refused, mut read_all_the_same) = (0, 0);
    for (name, file) in files() {
        for place in 0..file.len() {
            let is_whole_without = !name.contains("binary") && !name.contains("endian");
            assert!(read(&file[..place]).is_err() || is_whole_without, "{name} cut at {place}");
            for bits in [0x01, 0x10, 0xff] {
                let mut damaged = file.clone();
                damaged[place] ^= bits;
                *(if read(damaged).is_ok() { &mut read_all_the_same } else { &mut refused }) += 1;
            }
        }
    }
    assert!(refused > 500 && read_all_the_same > 500, "{refused} refused, {read_all_the_same} read");
}

#[test]
fn polygons_are_fans() {
    let file = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nl 1 2\nf 1 2 3 4\nf 1 2\n";
    assert_eq!(triangles(file).len(), 2);
    assert_eq!(triangles(file)[1][1], [1.0, 1.0, 0.0]);
}

#[test]
fn errors_say_what_and_where() {
    let message = |bytes: &[u8]| read(bytes).unwrap_err().to_string();
    for (file, parts) in [
        ("hello\n", ["this is no mesh that is known", "STL, OBJ or PLY"]),
        ("", ["this is no mesh that is known", "STL, OBJ or PLY"]),
        ("v 0 0 0\n", ["--mesh", "without faces"]),
        ("solid nothing\nendsolid\n", ["--mesh", "without faces"]),
        ("v 0 0 0\nv 1 1 1\nf 1 2 3\n", ["line 3", "'3' is none of the 2 corners"]),
        ("v 0 0 0\nv 1 1 1\nf 1 2 -3\n", ["line 3", "'-3' is none of the 2 corners"]),
        ("v 0 0 0\nf 0 1 1\n", ["line 2", "'0' is none"]),
        ("v 0 0\n", ["line 1", "'v X Y Z' was wanted, 'v 0 0' was found"]),
        ("v 0 0 nan\nf 1 1 1\n", ["corner 0", "corners at finite places"]),
        ("solid a\nouter loop\nvertex 1 2 x\n", ["line 3", "'vertex 1 2 x' was found"]),
        (
            "solid a\nouter loop\nvertex 1 2 3\nendloop\n",
            ["line 4", "three corners were wanted, 1 were found"],
        ),
        ("solid a\nouter loop\nvertex 1 2 3\n", ["the file ends within a triangle", "cut off"]),
    ] {
        let said = message(file.as_bytes());
        assert!(parts.iter().all(|part| said.contains(part)), "{file:?}: {said}");
    }
    let whole = ply(Some(Order::Little));
    let said = message(&whole[..whole.len() - 1]);
    assert!(said.contains("promises 4 of element 'face', 3 are whole"), "{said}");
    let text = String::from_utf8(ply(None)).unwrap();
    let said = message(text.replace("1 3 0 2 1", "1 3 0 2 4").as_bytes());
    assert!(said.contains("with corner 4 in face 0, of 4 corners"), "{said}");
    let said = message(text.replace("1 3 0 2 1", "1 3 0 2 -1").as_bytes());
    assert!(said.contains("face 0") && said.contains("no places of vertices"), "{said}");
    let said = message(text.replace("1 3 0 2 1", "1 4000000000 0 2 -1").as_bytes());
    assert!(said.contains("promises 4 of element 'face', 0 are whole"), "{said}");
    assert!(mesh("--mesh", Path::new("/nowhere/a.stl")).unwrap_err().to_string().contains("/nowhere/a.stl"));
}
