//! Files written here in every way that VTK writes them.

use std::io::Write;

use tempfile::TempDir;
use tyndall::particles::Radii;

use super::*;
use crate::read::real_data;

const COUNT: usize = 5;

/// All frames of a file.
fn frames(path: &Path, bytes: &[u8]) -> Result<Vec<Frame>> {
    let options = Options::default();
    let index = index(path, bytes, &options)?;
    let request = Request { options: &options, bytes: None, units: None, topology: None, others: &() };
    index.frames.iter().map(|&span| frame(path, bytes, span, &request, &())).collect()
}

fn read(bytes: &[u8]) -> Result<Frame> {
    frames(Path::new("test"), bytes).map(|mut frames| frames.remove(0))
}

fn message(bytes: &[u8]) -> String {
    read(bytes).map_or_else(|error| error.to_string(), |_| "it was read".into())
}

/// What every file of this module says.
fn check(what: &str, frame: &Frame) {
    let particles = &frame.particles;
    assert_eq!(particles.len(), COUNT, "{what}");
    for id in 0..COUNT {
        let at = id as f64;
        assert_eq!(particles.positions().world(id).to_array(), [at, 2.0 * at, -0.5 * at], "{what}");
        let velocity = particles.attribute("the velocity").unwrap_or_else(|| panic!("{what}: velocity"));
        assert_eq!([0, 1, 2].map(|axis| velocity.number(id, axis)), [at, 0.25, 1e3], "{what}");
    }
    let ids = particles.attribute("id").unwrap_or_else(|| panic!("{what}: id"));
    assert_eq!(ids.values, Values::I64((0..COUNT as i64).map(|it| (1 << 40) - it).collect()), "{what}");
    assert!(matches!(particles.radii(), Some(Radii::PerParticle { scale: 1.0, .. })), "{what}");
    assert_eq!(particles.time(), Some(0.125), "{what}");
}

/// The numbers of the arrays: points, velocity, radius, id.
fn numbers(id: usize) -> ([f64; 3], [f64; 3], f64, i64) {
    let at = id as f64;
    ([at, 2.0 * at, -0.5 * at], [at, 0.25, 1e3], 0.5, (1 << 40) - id as i64)
}

/// A legacy file. In version 5 cells are offsets and connectivity.
fn legacy_file(binary: bool, version: &str, count: usize) -> Vec<u8> {
    let mut file = format!("# vtk DataFile Version {version}\nnot empty: POINTS 9 float\n").into_bytes();
    let encoding = if binary { "BINARY" } else { "ASCII" };
    file.extend(
        format!("{encoding}\nDATASET UNSTRUCTURED_GRID\nFIELD FieldData 2\nTIME 1 1 double\n").bytes(),
    );
    let array = |file: &mut Vec<u8>, values: &[f64], kind: &str| {
        for value in values {
            match (binary, kind) {
                (false, _) => file.extend(format!("{value} ").bytes()),
                (_, "double") => file.extend(value.to_be_bytes()),
                (_, "float") => file.extend((*value as f32).to_be_bytes()),
                (_, "vtktypeint64") => file.extend((*value as i64).to_be_bytes()),
                (_, "int") => file.extend((*value as i32).to_be_bytes()),
                _ => file.push(*value as u8),
            }
        }
        file.push(b'\n');
    };
    let words = |file: &mut Vec<u8>, text: &str| file.extend(text.bytes());
    let each = |of: fn(usize) -> Vec<f64>| (0..count).flat_map(of).collect::<Vec<f64>>();
    array(&mut file, &[0.125], "double");
    words(&mut file, "title 1 1 string\n");
    file.extend_from_slice(if binary { b"\xc3a b\n" } else { b"a%20b\n" });
    words(&mut file, &format!("METADATA\nINFORMATION 0\n\nPOINTS {count} double\n"));
    array(&mut file, &each(|id| numbers(id).0.to_vec()), "double");
    if version.starts_with('5') {
        words(&mut file, &format!("CELLS {} {count}\nOFFSETS vtktypeint64\n", count + 1));
        array(&mut file, &(0..=count).map(|it| it as f64).collect::<Vec<_>>(), "vtktypeint64");
        words(&mut file, "CONNECTIVITY vtktypeint64\n");
        array(&mut file, &each(|id| vec![id as f64]), "vtktypeint64");
    } else {
        words(&mut file, &format!("CELLS {count} {}\n", 2 * count));
        array(&mut file, &each(|id| vec![1.0, id as f64]), "int");
    }
    words(&mut file, &format!("CELL_TYPES {count}\n"));
    array(&mut file, &vec![1.0; count], "int");
    words(&mut file, &format!("CELL_DATA {count}\nSCALARS quality float\nLOOKUP_TABLE default\n"));
    array(&mut file, &vec![2.0; count], "float");
    words(&mut file, &format!("POINT_DATA {count}\nVECTORS the%20velocity float\n"));
    array(&mut file, &each(|id| numbers(id).1.to_vec()), "float");
    words(&mut file, "SCALARS radius float 1\nLOOKUP_TABLE own\n");
    array(&mut file, &each(|id| vec![numbers(id).2]), "float");
    words(&mut file, "LOOKUP_TABLE own 2\n");
    array(&mut file, &[0.0; 8], "byte");
    words(&mut file, &format!("FIELD FieldData 2\nid 1 {count} vtktypeint64\n"));
    array(&mut file, &each(|id| vec![numbers(id).3 as f64]), "vtktypeint64");
    words(&mut file, &format!("METADATA\nINFORMATION 0\n\nname 1 {count} string\n"));
    for _ in 0..count {
        file.extend_from_slice(if binary { b"\xc1x" } else { b"x\n" });
    }
    file.push(b'\n');
    file
}

#[test]
fn legacy_files_of_all_versions_say_the_same() {
    for version in ["1.0", "2.0", "3.0", "4.2", "5.1"] {
        for binary in [false, true] {
            let frame = read(&legacy_file(binary, version, COUNT)).unwrap();
            check(&format!("version {version}, binary: {binary}"), &frame);
            let wanted = [
                "left out: arrays of cells, not of points: quality",
                "left out: arrays of words or bits: name",
            ];
            assert_eq!(frame.warnings, wanted);
        }
    }
    let text = String::from_utf8(legacy_file(false, "4.2", COUNT)).unwrap().replace('\n', "\r\n");
    check("CRLF", &read(text.as_bytes()).unwrap());
}

#[test]
fn legacy_files_of_no_and_one_point_are_fine() {
    for version in ["3.0", "5.1"] {
        for binary in [false, true] {
            for count in [0, 1] {
                assert_eq!(read(&legacy_file(binary, version, count)).unwrap().particles.len(), count);
            }
        }
    }
}

#[test]
fn cells_that_are_no_points_are_said() {
    let file = b"# vtk DataFile Version 3.0\n\nASCII\nDATASET POLYDATA\nPOINTS 3 float\n0 0 0 1 0 0 0 1 0\n\
        POLYGONS 1 4\n3 0 1 2\nPOINT_DATA 3\nSCALARS s int\n1 2 3";
    let frame = read(file).unwrap();
    assert_eq!(frame.particles.attribute("s").unwrap().values, Values::I32(vec![1, 2, 3]));
    assert_eq!(frame.warnings.len(), 2, "{:?}", frame.warnings);
    assert!(frame.warnings[0].contains("may be cut off") && frame.warnings[1].contains("1 lines, polygons"));
}

#[test]
fn colors_are_bytes_in_text_and_in_binary_files() {
    let header = |encoding: &str| {
        format!("# vtk DataFile Version 3.0\n\n{encoding}\nDATASET POLYDATA\nPOINTS 1 float\n")
    };
    let colors = "\nPOINT_DATA 1\nCOLOR_SCALARS rgb 3\n";
    let text = header("ASCII") + "1 2 3" + colors + "0 0.5 1\n";
    let binary = [header("BINARY").as_bytes(), &[0; 12], colors.as_bytes(), &[0, 128, 255, b'\n']].concat();
    for file in [text.as_bytes(), &binary] {
        let particles = read(file).unwrap().particles;
        assert_eq!(particles.attribute("rgb").unwrap().values, Values::U8(vec![0, 128, 255]));
    }
}

#[test]
fn faults_of_legacy_files_are_told_with_a_place() {
    let header = "# vtk DataFile Version 3.0\n\nASCII\nDATASET ";
    for (rest, what) in [
        ("STRUCTURED_POINTS\n", "grid of samples"),
        ("TABLE\n", "'table' was found"),
        ("POLYDATA\n", "no POINTS"),
        ("POLYDATA\nPOINTS 2 float\n1.0000 2.0000 3.0000\n", "after 3 of 6"),
        ("POLYDATA\nPOINTS 99999999999 float\n1 2 3\n", "were wanted"),
        ("POLYDATA\nPOINTS 18446744073709551615 double\n1 2 3\n", "no size"),
        ("POLYDATA\nPOINTS 1 float\n1 2 x\n", "'x' was found"),
        ("POLYDATA\nPOINTS 1 floats\n1 2 3\n", "'floats' was found"),
        ("POLYDATA\nPOINTS 1 float\n1 2 3\nPOINT_DATA 2\n", "data of 2 points"),
        ("POLYDATA\nPOINTS 1 float\n1 2 3\nHELLO\n", "'HELLO' was found"),
    ] {
        let message = message(format!("{header}{rest}").as_bytes());
        assert!(message.contains(what), "{rest}: {message}");
    }
}

/// How an XML file is written.
#[derive(Clone, Copy, Debug)]
struct Way {
    format: &'static str,
    base64: bool,
    big: bool,
    wide: bool,
    compressor: &'static str,
}

const PLAIN: Way = Way { format: "ascii", base64: false, big: false, wide: false, compressor: "" };

impl Way {
    fn header(self, numbers: &[usize]) -> Vec<u8> {
        let number = |&it: &usize| match (self.wide, self.big) {
            (false, false) => (it as u32).to_le_bytes().to_vec(),
            (false, true) => (it as u32).to_be_bytes().to_vec(),
            (true, false) => (it as u64).to_le_bytes().to_vec(),
            (true, true) => (it as u64).to_be_bytes().to_vec(),
        };
        numbers.iter().flat_map(number).collect()
    }

    /// The bytes of an array behind its header, in base64 if wanted: of a compressed one the header is encoded by itself.
    fn encoded(self, bytes: &[u8]) -> Vec<u8> {
        let (header, data) = match self.compressor {
            "" => (vec![], [self.header(&[bytes.len()]), bytes.to_vec()].concat()),
            compressor => {
                let blocks: Vec<Vec<u8>> = bytes.chunks(16).map(|block| pack(compressor, block)).collect();
                let mut header = vec![blocks.len(), 16, bytes.len() % 16];
                header.extend(blocks.iter().map(Vec::len));
                (self.header(&header), blocks.concat())
            }
        };
        if self.base64 { [base64(&header), base64(&data)].concat() } else { [header, data].concat() }
    }
}

fn pack(compressor: &str, block: &[u8]) -> Vec<u8> {
    if compressor.contains("LZ4") {
        return lz4_flex::block::compress(block);
    }
    if compressor.contains("LZMA") {
        let mut encoder =
            lzma_rust2::XzWriter::new(Vec::new(), lzma_rust2::XzOptions::with_preset(0)).unwrap();
        encoder.write_all(block).unwrap();
        return encoder.finish().unwrap();
    }
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(block).unwrap();
    encoder.finish().unwrap()
}

fn base64(bytes: &[u8]) -> Vec<u8> {
    const LETTERS: &[u8] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let group = |three: &[u8]| {
        let bits =
            (0..3).fold(0usize, |bits, at| bits << 8 | usize::from(three.get(at).copied().unwrap_or(0)));
        let letter = |at: usize| if at <= three.len() { LETTERS[bits >> (18 - 6 * at) & 63] } else { b'=' };
        [0, 1, 2, 3].map(letter)
    };
    bytes.chunks(3).flat_map(group).collect()
}

/// The points `ids` as a VTP or VTU.
fn xml_file(way: Way, kind: &str, ids: std::ops::Range<usize>) -> Vec<u8> {
    let mut appended = Vec::new();
    let mut array = |kind: &str, name: &str, components: usize, values: Vec<f64>| {
        let bytes = |value: &f64| -> Vec<u8> {
            let mut bytes = match kind {
                "Float32" => (*value as f32).to_le_bytes().to_vec(),
                "Float64" => value.to_le_bytes().to_vec(),
                "UInt8" => vec![*value as u8],
                _ => (*value as i64).to_le_bytes().to_vec(),
            };
            if way.big {
                bytes.reverse();
            }
            bytes
        };
        let start = format!(r#"<DataArray type="{kind}" Name="{name}" NumberOfComponents="{components}" "#);
        let encoded = way.encoded(&values.iter().flat_map(bytes).collect::<Vec<u8>>());
        match way.format {
            "ascii" => {
                let text: Vec<String> = values.iter().map(f64::to_string).collect();
                format!("{start} format=\"ascii\">\n{}\n</DataArray>\n", text.join(" "))
            }
            "binary" => {
                format!("{start} format=\"binary\">\n {}\n</DataArray>", String::from_utf8(encoded).unwrap())
            }
            _ => {
                let element = format!("{start} format=\"appended\" offset=\"{}\"/>\n", appended.len());
                appended.extend(encoded);
                element
            }
        }
    };
    let each = |of: fn(usize) -> Vec<f64>| ids.clone().flat_map(of).collect::<Vec<f64>>();
    let count = ids.len();
    let time = array("Float64", "TimeValue", 1, vec![0.125]);
    let points = array("Float64", "Points", 3, each(|id| numbers(id).0.to_vec()));
    let types = array("UInt8", "types", 1, vec![1.0; count]);
    let data = array("Float32", "the velocity", 3, each(|id| numbers(id).1.to_vec()))
        + &array("Float32", "radius", 1, each(|id| vec![numbers(id).2]))
        + &array("Int64", "id", 1, each(|id| vec![numbers(id).3 as f64]));
    let words: String = ids.clone().map(|id| format!("{} 98 0 ", 65 + id % 2)).collect();
    let order = if way.big { "BigEndian" } else { "LittleEndian" };
    let width = if way.wide { "UInt64" } else { "UInt32" };
    let compressor =
        if way.compressor.is_empty() { String::new() } else { format!("compressor=\"{}\"", way.compressor) };
    let mut file = format!(
        "<?xml version='1.0'?>\n<!-- a > b --><VTKFile type=\"{kind}\" version='1.0' byte_order=\"{order}\" header_type=\"{width}\" {compressor}>\n\
         <{kind}><FieldData>{time}</FieldData><Piece NumberOfPoints=\"{count}\" NumberOfCells=\"{count}\" NumberOfPolys=\"0\">\n\
         <PointData Scalars=\"radius\">{data}<Array type=\"String\" Name=\"label\" format=\"ascii\">{words}</Array><Array type=\"Bit\" Name=\"bits\"/></PointData>\n\
         <Points>{points}</Points><Cells>{types}</Cells>\n<CellData/></Piece></{kind}>"
    )
    .into_bytes();
    if way.format == "appended" {
        let encoding = if way.base64 { "base64" } else { "raw" };
        file.extend(format!("<AppendedData encoding=\"{encoding}\">\n  _").bytes());
        file.extend(&appended);
        file.extend(b"\n</AppendedData>");
    }
    file.extend(b"\n</VTKFile>\n");
    file
}

fn all_ways() -> Vec<Way> {
    let mut ways = vec![PLAIN];
    for (format, base64) in [("binary", true), ("appended", true), ("appended", false)] {
        for compressor in ["", "vtkZLibDataCompressor", "vtkLZ4DataCompressor", "vtkLZMADataCompressor"] {
            for (big, wide) in [(false, false), (false, true), (true, false), (true, true)] {
                ways.push(Way { format, base64, big, wide, compressor });
            }
        }
    }
    ways
}

#[test]
fn xml_files_say_the_same_in_every_encoding() {
    for way in all_ways() {
        let frame = read(&xml_file(way, "UnstructuredGrid", 0..COUNT))
            .unwrap_or_else(|error| panic!("{way:?}: {error}"));
        check(&format!("{way:?}"), &frame);
        let words = Values::Text {
            codes: (0..COUNT as u32).map(|id| id % 2).collect(),
            names: vec!["Ab".into(), "Bb".into()],
        };
        assert_eq!(frame.particles.attribute("label").unwrap().values, words);
        assert_eq!(frame.warnings, ["left out: arrays of words or bits: bits"]);
        assert_eq!(read(&xml_file(way, "PolyData", 0..0)).unwrap().particles.len(), 0, "{way:?}");
        assert_eq!(read(&xml_file(way, "PolyData", 0..1)).unwrap().particles.len(), 1, "{way:?}");
    }
}

#[test]
fn a_file_cut_anywhere_is_refused_or_has_all_its_points() {
    let ways = all_ways().into_iter().step_by(6);
    let mut files: Vec<Vec<u8>> = ways.map(|it| xml_file(it, "PolyData", 0..COUNT)).collect();
    files.push(legacy_file(true, "5.1", COUNT));
    files.push(legacy_file(false, "3.0", COUNT));
    for file in files {
        for length in (0..file.len()).rev().step_by(3) {
            if let Ok(frame) = read(&file[..length]) {
                assert_eq!(frame.particles.len(), COUNT, "{length} bytes");
            }
        }
    }
}

#[test]
fn damage_never_panics() {
    let appended = Way { format: "appended", ..PLAIN };
    let zlib = Way { compressor: "vtkZLibDataCompressor", ..appended };
    let lz4 = Way { format: "binary", base64: true, compressor: "vtkLZ4DataCompressor", ..PLAIN };
    let lzma = Way { compressor: "vtkLZMADataCompressor", ..lz4 };
    for way in [PLAIN, appended, zlib, lz4, lzma] {
        real_data::damage(&xml_file(way, "PolyData", 0..2), |file| drop(read(file)));
    }
    for binary in [false, true] {
        real_data::damage(&legacy_file(binary, "5.1", 2), |file| drop(read(file)));
    }
}

#[test]
fn faults_of_xml_files_are_told() {
    let file = String::from_utf8(xml_file(PLAIN, "PolyData", 0..COUNT)).unwrap();
    for (from, to, what) in [
        (
            "header_type=\"UInt32\"",
            "compressor=\"vtkOtherDataCompressor\"",
            "compressed by vtkOtherDataCompressor",
        ),
        ("BigEndian", "x", "it was read"),
        ("LittleEndian", "Middle", "no byte order 'Middle'"),
        ("NumberOfPoints=\"5\"", "NumberOfPoints=\"6\"", "18 numbers were wanted, 15 are there"),
        ("NumberOfPoints=\"5\"", "NumberOfPoints=\"-1\"", "'-1' was found"),
        ("PolyData", "ImageData", "grid of samples"),
        ("PolyData", "Table", "file's type is 'Table'"),
        ("</VTKFile>", "", "ends inside"),
        ("format=\"ascii\"", "format=\"appended\"", "no appended data"),
    ] {
        let message = message(file.replace(from, to).as_bytes());
        assert!(message.contains(what), "{to}: {message}");
    }
}

#[test]
fn pieces_are_one_data_set() {
    let folder = TempDir::new().unwrap();
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).unwrap();
    let raw = Way { format: "appended", ..PLAIN };
    std::fs::create_dir(folder.path().join("parts")).unwrap();
    write("parts/a.vtu", &xml_file(raw, "UnstructuredGrid", 0..2));
    write("parts/b.vtu", &xml_file(PLAIN, "UnstructuredGrid", 2..2));
    write("parts/c.vtu", &xml_file(Way { big: true, ..raw }, "UnstructuredGrid", 2..COUNT));
    let pieces = "<Piece Source='parts/a.vtu'/><Piece Source='parts/b.vtu'/><Piece Source='parts/c.vtu'/>";
    let pvtu = format!(
        "<VTKFile type='PUnstructuredGrid'><PUnstructuredGrid GhostLevel='0'>{pieces}</PUnstructuredGrid></VTKFile>"
    );
    let path = folder.path().join("all.pvtu");
    write("all.pvtu", pvtu.as_bytes());
    let mut all = frames(&path, pvtu.as_bytes()).unwrap();
    check("PVTU", &all.remove(0));
    let blocks = "<Block index='0'><DataSet index='0' file='parts/a.vtu'/></Block><DataSet index='1' file='parts/c.vtu'/>";
    let vtm = format!(
        "<VTKFile type='vtkMultiBlockDataSet'><vtkMultiBlockDataSet>{blocks}</vtkMultiBlockDataSet></VTKFile>"
    );
    check("VTM", &frames(&path, vtm.as_bytes()).unwrap()[0]);

    // Steps of pieces, of parts, and of files, with times of their own.
    let sets = "<DataSet timestep='3' file='all.pvtu'/><DataSet timestep='4.5' part='0' file='parts/a.vtu'/>\
        <DataSet timestep='4.5' part='1' file='parts/c.vtu'/><DataSet timestep='5' file='parts/a.vtu'/>";
    let pvd = format!("<VTKFile type='Collection'><Collection>{sets}</Collection></VTKFile>");
    let steps = frames(&folder.path().join("run.pvd"), pvd.as_bytes()).unwrap();
    let told: Vec<_> = steps.iter().map(|it| (it.particles.len(), it.particles.time().unwrap())).collect();
    assert_eq!(told, [(COUNT, 3.0), (COUNT, 4.5), (2, 5.0)]);
    let series = br#"{"file-series-version": "1.0", "files": [{"name": "parts/a.vtu"}, {"name": "all.pvtu", "time": 7}]}"#;
    let steps = frames(&folder.path().join("run.vtu.series"), series).unwrap();
    let told: Vec<_> = steps.iter().map(|it| (it.particles.len(), it.particles.time().unwrap())).collect();
    assert_eq!(told, [(2, 0.125), (COUNT, 7.0)]);

    // An array that one piece lacks, a piece that is missing, and a list of itself.
    let bare = String::from_utf8(xml_file(PLAIN, "UnstructuredGrid", 2..3))
        .unwrap()
        .replace("Name=\"id\"", "Name=\"ID\"");
    write("parts/b.vtu", bare.as_bytes());
    let frame = frames(&path, pvtu.as_bytes()).unwrap().remove(0);
    assert!(frame.particles.attribute("id").is_none() && frame.particles.len() == COUNT + 1);
    assert!(
        frame.warnings.iter().any(|it| it.ends_with("not all pieces have alike: ID, id")),
        "{:?}",
        frame.warnings
    );
    std::fs::remove_file(folder.path().join("parts/c.vtu")).unwrap();
    let error = frames(&path, pvtu.as_bytes()).unwrap_err().to_string();
    assert!(error.contains("c.vtu"), "{error}");
    let own = pvtu.replace("parts/a.vtu", "all.pvtu");
    write("all.pvtu", own.as_bytes());
    assert!(frames(&path, own.as_bytes()).unwrap_err().to_string().contains("list within a list"));
}

#[test]
fn copies_of_other_pieces_points_are_left_out() {
    let file = String::from_utf8(xml_file(PLAIN, "PolyData", 0..COUNT)).unwrap();
    let ghosts =
        "<PointData><DataArray type='UInt8' Name='vtkGhostType' format='ascii'>0 1 2 0 32</DataArray>";
    let frame = read(file.replace("<PointData Scalars=\"radius\">", ghosts).as_bytes()).unwrap();
    assert_eq!(
        frame.particles.attribute("id").unwrap().values,
        Values::I64([0, 3, 4].map(|it| (1 << 40) - it).to_vec())
    );
    assert_eq!(frame.particles.positions().world(2).x, 4.0);
    assert_eq!(frame.particles.attribute("the velocity").unwrap().values.len(), 9);
    assert!(frame.warnings.iter().any(|it| it.starts_with("left out: 2 points")));
}

#[test]
fn real_files_are_read_as_vtk_reads_them() {
    for name in [
        "bunny_frame_14_7705_particles.vtk",
        "cube_8_particles.vtk",
        "dem_grains_zlib.vtp",
        "double_dam_break_frame_26_4732_particles.vtk",
        "fluid_250_particles.vtu",
        "sailors_knot_19539_particles.vtk",
    ] {
        let read = |path: &Path, bytes: &[u8], _: &dyn Progress| Ok(frames(path, bytes)?.remove(0));
        real_data::compare(&format!("vtk/{name}"), recognise, read);
    }
}
