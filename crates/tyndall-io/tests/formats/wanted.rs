//! What is left out on reading changes no picture: radii, colors and filters are found as with all attributes.

use std::io::Write as _;
use std::path::Path;

use tyndall::DVec3;
use tyndall::particles::{Attribute, Columns, Particles, Positions, Radii, Values};
use tyndall::scene::automatic;
use tyndall::scene::color::resolve;
use tyndall::scene::coloring::{Coloring, Mapping};
use tyndall::scene::select::Selectable;
use tyndall::scene::wanted::Wanted;
use tyndall_io::{Options, Sequence, write};

use super::{Folder, fixture, shared};

/// What a picture takes of particles: radii, and colors by `coloring`.
fn seen(particles: &Particles, wanted: &Wanted) -> String {
    let (radii, text) = automatic::radii(particles);
    let colors = resolve(particles, &wanted.coloring, &Mapping::default());
    let colors = colors.map_err(|error| error.to_string());
    let places = (0..particles.len()).step_by(1 + particles.len() / 100);
    let each: Vec<_> = places
        .map(|id| (particles.radius(&radii, id), colors.as_ref().map(|it| it.color(id)).unwrap_or_default()))
        .collect();
    let filters: Vec<_> = wanted.filters.iter().map(|it| Selectable::of(particles, it).is_ok()).collect();
    let said = colors.as_ref().map_or_else(|error| error.clone(), |it| it.description.clone());
    format!("{text}; {said}; {each:?}; {filters:?}")
}

/// Reads the first frame with all attributes and with those that are wanted; gives how many were left out.
fn left_out(path: &Path, wanted: &Wanted) -> usize {
    let read = |wanted: Option<Wanted>| {
        let options = Options { wanted, ..Options::default() };
        Sequence::open(&[path.to_path_buf()], &options, &()).and_then(|it| it.frame(0, &())).ok()
    };
    let Some(all) = read(None) else { return 0 };
    let some = read(Some(wanted.clone())).expect("it can be read with all attributes");
    let name = path.display();
    assert_eq!(some.particles.len(), all.particles.len(), "{name}");
    assert!(some.particles.positions() == all.particles.positions(), "{name}");
    assert_eq!(seen(&some.particles, wanted), seen(&all.particles, wanted), "{name}, {wanted:?}");
    all.particles.attributes().len() - some.particles.attributes().len()
}

fn wanted(coloring: &str, filters: &[&str]) -> Wanted {
    let filters = filters.iter().map(|it| it.parse().unwrap()).collect();
    Wanted { coloring: coloring.parse().unwrap(), filters, radii: true, ..Wanted::default() }
}

#[test]
fn the_shared_files_look_alike() {
    let Some((folder, expected)) = shared() else { return };
    let mut left = 0;
    for name in expected["files"].as_object().unwrap_or(expected.as_object().unwrap()).keys() {
        let path = folder.join(name);
        // Large files add minutes and nothing else.
        if std::fs::metadata(&path).is_ok_and(|it| it.is_file() && it.len() < 1 << 20) {
            for it in [wanted("auto", &["type=1"]), wanted("vx", &["v=0:"])] {
                left += left_out(&path, &it);
            }
        }
    }
    assert!(left > 0);
}

#[test]
fn attributes_that_nobody_looks_at_are_left_out() {
    let folder = Folder::new("wanted");
    let rows: String = (0..500).map(|k| format!("{k} {} {k}.5 0 1 -1 {k}e-1 2 7.25\n", k % 2)).collect();
    let dump = format!(
        "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n500\nITEM: BOX BOUNDS pp pp pp\n0 1\n0 1\n0 1\nITEM: ATOMS id type x y z vx vy vz q\n{rows}"
    );
    let path = folder.file("a.dump", dump.as_bytes());
    assert_eq!(left_out(&path, &wanted("auto", &[])), 4);
    assert_eq!(left_out(&path, &wanted("#fff", &[])), 5);
    assert_eq!(left_out(&path, &wanted("vy", &["id=3:7"])), 1);
    assert_eq!(left_out(&path, &wanted("nothing", &[])), 0);
    assert_eq!(left_out(&fixture("odd.xyz"), &wanted("auto", &[])), 0);
}

#[test]
fn of_every_format_an_attribute_alone_is_as_among_all() {
    // What some attribute of theirs leaves out.
    let mut lean = vec![
        "houdini.bgeo",
        "renderman.ptc",
        "saved.tyn",
        "fixed_and_varying.h5md",
        "scan.laz",
        "swift.hdf5",
        "arrays.npz",
        "lammps.dump",
        "extended.xyz",
        "atoms.imd",
        "scanner.ptx",
    ];
    if cfg!(feature = "parquet") {
        lean.extend(["groups_snappy.parquet", "feather_lz4.feather", "stream.arrows"]);
    }
    let mut left = std::collections::BTreeSet::new();
    for folder in ["samples", "hdf5"] {
        for entry in std::fs::read_dir(fixture(folder)).unwrap() {
            let path = entry.unwrap().path();
            let read = |wanted: Option<Wanted>| {
                let options = Options { wanted, ..Options::default() };
                Sequence::open(std::slice::from_ref(&path), &options, &()).and_then(|it| it.frame(0, &()))
            };
            let Ok(all) = read(None) else { continue };
            let all = all.particles;
            for attribute in all.attributes() {
                let wanted = Wanted {
                    coloring: Coloring::Constant([0.0; 3]),
                    one_of: vec![vec![attribute.name.clone()]],
                    ..Wanted::default()
                };
                let some = read(Some(wanted)).unwrap_or_else(|error| panic!("{error}")).particles;
                let what = format!("{}, {}", path.display(), attribute.name);
                assert!(some.positions() == all.positions() && some.dropped() == all.dropped(), "{what}");
                let [found, wanted] = [&some, &all].map(|it| format!("{:?}", it.attribute(&attribute.name)));
                assert_eq!(found, wanted, "{what}");
                assert_eq!(some.bonds().len(), all.bonds().len(), "{what}");
                let radius = |it: &Particles| it.radii().map(|radii| it.radius(radii, 0));
                assert!(some.is_empty() || radius(&some) == radius(&all), "{what}");
                if some.attributes().len() < all.attributes().len() {
                    left.insert(path.file_name().unwrap().to_str().unwrap().to_string());
                }
            }
        }
    }
    lean.retain(|it| !left.contains(*it));
    assert_eq!(lean, [""; 0], "all attributes are read of these, whatever is wanted");
}

/// The names of the attributes that are read of a file where only these quantities are wanted.
fn names(path: &Path, quantities: &[&str]) -> Vec<String> {
    let wanted = Wanted {
        coloring: Coloring::Constant([0.0; 3]),
        quantities: quantities.iter().map(|it| it.to_string()).collect(),
        ..Wanted::default()
    };
    let options = Options { wanted: Some(wanted), ..Options::default() };
    let frame = Sequence::open(&[path.to_path_buf()], &options, &()).and_then(|it| it.frame(0, &()));
    let particles = frame.unwrap_or_else(|error| panic!("{error}")).particles;
    assert_eq!(particles.len(), 300);
    particles.attributes().iter().map(|it| it.name.clone()).collect()
}

#[test]
fn of_tables_of_bytes_the_columns_that_are_wanted_are_read() {
    let folder = Folder::new("columns");
    let column = |step: f32| (0..300).map(|id| id as f32 * step).collect::<Vec<f32>>();
    let positions = Positions::from_offsets(DVec3::ONE, [column(0.5), column(-0.25), column(0.1)]);
    let words =
        Values::Text { codes: (0..300).map(|id| id % 2).collect(), names: vec!["Cu".into(), "Zr".into()] };
    let attributes = vec![
        Attribute::new("element", 1, words),
        Attribute::new("q", 1, Values::F32(column(0.3))),
        Attribute::new("v", 3, Values::F32(column(2.0).repeat(3))),
        Attribute::new("kind", 1, Values::I32((0..300).collect())),
    ];
    let particles = Particles::new(Columns { positions, attributes, ..Columns::default() }).unwrap();
    for (name, has_vectors, has_words) in
        [("a.ply", false, false), ("a.npy", true, true), ("a.npz", true, true), ("a.bgeo", true, true)]
    {
        let path = folder.path(name);
        write::particles::particles(&path, None, 1, |_| Ok(particles.clone())).unwrap();
        assert_eq!(names(&path, &["q"]), ["q"], "{name}");
        assert_eq!(names(&path, &["kind", "x"]), ["kind"], "{name}");
        assert_eq!(names(&path, &["v"]).len(), if has_vectors { 1 } else { 3 }, "{name}");
        assert_eq!(names(&path, &["nothing"]).len(), if has_vectors { 4 } else { 6 }, "{name}");
        for it in [wanted("auto", &[]), wanted("q", &["kind=3:7"]), wanted("#fff", &[]), wanted("v", &[])] {
            assert!(left_out(&path, &it) > 0, "{name}, {it:?}");
        }
        assert_eq!(names(&path, &["element"]).len(), 1, "{name}, words {has_words}");
    }
}

#[test]
fn texts_and_splats_of_ply_are_read_in_part() {
    let folder = Folder::new("ply");
    let properties = ["x", "y", "z", "scale_0", "scale_1", "scale_2", "rot_0", "opacity", "f_dc_0"];
    let header: String = properties.iter().map(|name| format!("property float {name}\n")).collect();
    let rows: String =
        (0..300).map(|id| format!("{id} 0 {}.5 -1 -2 -{id}e-2 1 0.5 {id}.25\n", id % 7)).collect();
    let text = format!("ply\nformat ascii 1.0\nelement vertex 300\n{header}end_header\n{rows}");
    let path = folder.file("splats.ply", text.as_bytes());
    assert_eq!(names(&path, &[]), ["radius"]);
    assert_eq!(names(&path, &["rot_0"]), ["rot_0", "radius"]);
    assert_eq!(left_out(&path, &wanted("f_dc_0", &["radius=0.1:"])), 5);
    // What is no number is found where it is looked at.
    let path = folder.file("damaged.ply", text.replace("1 0.5 7.25", "1 half 7.25").as_bytes());
    assert_eq!(names(&path, &["f_dc_0"]), ["f_dc_0", "radius"]);
    let open = Sequence::open(&[path], &Options::default(), &()).unwrap();
    assert!(open.frame(0, &()).unwrap_err().to_string().contains("'half' was found"));
}

#[test]
fn arrays_of_an_archive_that_are_not_wanted_are_not_unpacked() {
    let folder = Folder::new("npz");
    let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let mut add = |name: &str, shape: &str, values: &[f32]| {
        let options = zip::write::SimpleFileOptions::default();
        zip.start_file(name, options.compression_method(zip::CompressionMethod::Deflated)).unwrap();
        let header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}, }}");
        let mut array = b"\x93NUMPY\x01\x00".to_vec();
        array.extend((header.len() as u16).to_le_bytes());
        array.extend(header.bytes());
        array.extend(values.iter().flat_map(|it| it.to_le_bytes()));
        zip.write_all(&array).unwrap();
    };
    let numbers: Vec<f32> = (0..900).map(|k| (k as f32).sin()).collect();
    add("pos.npy", "(300, 3)", &numbers);
    add("q.npy", "(300,)", &numbers[..300]);
    add("damaged.npy", "(3, 300)", &numbers);
    add("radius.npy", "()", &[0.25]);
    let mut bytes = zip.finish().unwrap().into_inner();
    let name = b"damaged.npy";
    let at = bytes.windows(name.len()).position(|it| it == name).unwrap();
    // Behind its header, in the middle of what is packed.
    bytes[at + 1500..at + 1600].fill(0x55);
    let path = folder.file("a.npz", &bytes);
    assert_eq!(names(&path, &["q"]), ["q"]);
    let open = |wanted: Option<Wanted>| {
        let options = Options { wanted, ..Options::default() };
        Sequence::open(std::slice::from_ref(&path), &options, &()).and_then(|it| it.frame(0, &()))
    };
    assert!(open(None).unwrap_err().to_string().contains("damaged"));
    assert!(open(Some(wanted("damaged", &[]))).is_err());
    let particles = open(Some(wanted("#fff", &[]))).unwrap().particles;
    assert_eq!((particles.radii(), particles.attributes().len()), (Some(&Radii::Uniform(0.25)), 0));
    assert!((particles.positions().world(7).y - f64::from(numbers[22])).abs() < 1e-6);
}

#[test]
fn colors_of_a_packed_one_are_wanted_by_their_names() {
    let header = "VERSION 0.7\nFIELDS x y z rgb w _\nSIZE 4 4 4 4 4 1\nTYPE F F F U F U\nCOUNT 1 1 1 1 2 3\n";
    let rows: String = (0..300).map(|k| format!("{k} 0 1 {} 1 {k} 7 7 7\n", 65536 * (k % 256))).collect();
    let folder = Folder::new("pcd");
    let text = format!("{header}WIDTH 300\nHEIGHT 1\nPOINTS 300\nDATA ascii\n{rows}");
    let path = folder.file("a.pcd", text.as_bytes());
    assert_eq!(names(&path, &["w.y"]), ["w"]);
    assert_eq!(names(&path, &["red"]), ["rgb", "red", "green", "blue"]);
    assert_eq!(names(&path, &["rgb", "x"]), ["rgb", "red", "green", "blue"]);
    // Where red has a field of its own, the packed color stays what it is.
    let path = folder.file("b.pcd", text.replace("z rgb w", "red rgb z").as_bytes());
    let error = Sequence::open(&[path], &Options::default(), &()).and_then(|it| it.frame(0, &()));
    assert!(error.err().unwrap().to_string().contains("no fields x, y and z"), "z has two numbers a point");
}

#[test]
fn rows_that_lack_a_value_are_found_though_it_is_not_wanted() {
    let folder = Folder::new("unwanted");
    let path =
        folder.file("a.xyz", b"2\nProperties=species:S:1:pos:R:3:velo:R:3\nH 0 0 0 1 2 3\nO 0 0 1 1 2\n");
    let options = Options { wanted: Some(wanted("#fff", &[])), ..Options::default() };
    let error = Sequence::open(&[path], &options, &()).and_then(|it| it.frame(0, &())).err().unwrap();
    assert!(error.to_string().contains("wanted 7 values, found 6"), "{error}");
}

#[test]
fn random_tables_are_read_as_a_slow_reader_would() {
    let folder = Folder::new("random");
    for seed in 1..6u64 {
        println!("seed {seed}");
        let mut state = seed;
        let mut random = |below: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % below
        };
        let end = ["\n", "\r\n"][random(2) as usize];
        // Several slices, so that lines lie across their borders.
        let count = 20_000 + random(20_000) as usize;
        let (mut text, mut wanted) = (format!("{count}{end}{end}"), Vec::new());
        for row in 0..count {
            let mut number = || {
                let sign = ["", "-", ""][random(3) as usize];
                let below = [10, 1000, 100_000_000][random(3) as usize];
                let whole = random(below);
                let decimals = random(10) as usize;
                let digits: String = (0..decimals).map(|_| char::from(b'0' + random(10) as u8)).collect();
                let exponent = ["", "", "", "e-3", "E+02"][random(5) as usize];
                format!("{sign}{whole}.{digits}{exponent}")
            };
            let numbers = [number(), number(), number(), number()];
            let blank = [" ", "  ", "\t", " \t "][random(4) as usize];
            let last = if row + 1 < count || random(2) == 0 { end } else { "" };
            let [x, y, z, q] = &numbers;
            text += &format!("C{}{blank}{x}{blank}{y} {z}{blank}{q}{last}", random(3));
            wanted.push(([x, y, z].map(|it| it.parse::<f64>().unwrap()), q.parse::<f32>().unwrap()));
        }
        let path = folder.file("a.xyz", text.as_bytes());
        let sequence = super::open(&path);
        let particles = super::frame(&sequence, 0).particles;
        let origin = particles.positions().origin();
        let Values::F32(last) = &particles.attributes()[1].values else { panic!() };
        for (id, (position, number)) in wanted.iter().enumerate() {
            for (axis, offsets) in particles.positions().offsets().iter().enumerate() {
                assert_eq!(offsets[id], (position[axis] - origin[axis]) as f32, "row {id}");
            }
            assert_eq!(last[id], *number, "row {id}");
        }
    }
}
