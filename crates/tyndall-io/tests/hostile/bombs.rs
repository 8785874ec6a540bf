//! Small files that ask for much: to be unpacked, to be read again and again, to wait.

use std::io::Write;

use tyndall_io::vdb::{self, Class, Grid, LEAF_VOXELS, Leaf, Precision, Tile, Transform, Tree};

use crate::files::Folder;
use crate::watch::watched;

/// Two blocks of text, which a stream may have in memory.
const BLOCKS: usize = 1 << 20;

/// Makes an attempt and gives what the reader said against the file.
fn refused(folder: &Folder, name: &str, bytes: &[u8]) -> String {
    let outcome =
        watched(&folder.file(name, bytes), BLOCKS).unwrap_or_else(|fault| panic!("{name}: {fault}"));
    outcome.expect_err(name)
}

fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::best());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

#[test]
fn text_that_unpacks_to_much_more_passes_through_little_memory() {
    let folder = Folder::empty("text-bomb");
    let mut encoder = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::best());
    encoder.write_all(b"x,y,z\n1,2,3\n").unwrap();
    let lines = [vec![b' '; 4095], vec![b'\n']].concat().repeat(16 << 10);
    encoder.write_all(&lines).unwrap();
    let head = encoder.finish().unwrap();
    let mut encoder = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::best());
    encoder.write_all(&lines).unwrap();
    let rest = encoder.finish().unwrap().repeat(4);
    // 320 MB of empty lines in some hundred bytes.
    let message = refused(&folder, "table.csv.bz2", &[head, rest].concat());
    assert!(message.contains("unpack it on disk"), "{message}");
}

#[test]
fn an_array_of_vtk_is_not_unpacked_beyond_its_count() {
    let folder = Folder::empty("vtk-bomb");
    let packed = zlib(&vec![0; 32 << 20]);
    let header: Vec<u8> =
        [1u32, 36, 36, packed.len() as u32].iter().flat_map(|it| it.to_le_bytes()).collect();
    let mut file = br#"<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt32" compressor="vtkZLibDataCompressor">
<PolyData><Piece NumberOfPoints="3"><Points><DataArray type="Float32" NumberOfComponents="3" format="appended" offset="0"/></Points></Piece></PolyData>
<AppendedData encoding="raw">_"#
        .to_vec();
    file.extend(header);
    file.extend(packed);
    file.extend(b"</AppendedData></VTKFile>");
    let path = folder.file("points.vtp", &file);
    // What is there more than was promised is not looked at; it may as well be refused.
    drop(watched(&path, file.len()).unwrap_or_else(|fault| panic!("{fault}")));
}

#[test]
fn deep_xml_ends_soon() {
    let folder = Folder::empty("deep");
    let deep = ["<VTKFile type=\"PolyData\">".to_string(), "<a>".repeat(1 << 18)].concat();
    refused(&folder, "deep.vtp", deep.as_bytes());
    let brackets =
        ["{\"file-series-version\": \"1.0\", \"files\": ".to_string(), "[".repeat(1 << 18)].concat();
    refused(&folder, "deep.vtp.series", brackets.as_bytes());
}

#[test]
fn lists_that_name_themselves_or_no_file_are_refused() {
    let folder = Folder::empty("lists");
    let list = |file: &str| {
        format!(
            "<?xml version=\"1.0\"?><VTKFile type=\"Collection\"><Collection><DataSet timestep=\"0\" file=\"{file}\"/></Collection></VTKFile>"
        )
    };
    for file in ["self.pvd", "../lists", ".", "/dev/zero", "no such file"] {
        refused(&folder, "self.pvd", list(file).as_bytes());
    }
    let piece = |file: &str| {
        format!("<VTKFile type=\"PPolyData\"><PPolyData><Piece Source=\"{file}\"/></PPolyData></VTKFile>")
    };
    refused(&folder, "self.pvtp", piece("self.pvtp").as_bytes());
    #[cfg(unix)]
    {
        // Nobody waits for a pipe.
        let made = std::process::Command::new("mkfifo").arg(folder.0.join("pipe")).status().unwrap();
        assert!(made.success());
        refused(&folder, "pipe.pvd", list("pipe").as_bytes());
        refused(&folder, "pipe.pvtp", piece("pipe").as_bytes());
    }
}

#[test]
fn voxels_take_no_memory_for_what_is_between_them() {
    let folder = Folder::empty("vdb-bomb");
    let tree =
        |leaves: Vec<Leaf>, tiles: Vec<Tile>| Tree { components: 1, background: [0.0; 3], leaves, tiles };
    let leaf = |origin: [i32; 3]| Leaf { origin, active: [u64::MAX; 8], values: vec![1.0; LEAF_VOXELS] };
    let tile = |origin: [i32; 3], edge: i32| Tile { origin, edge, value: [2.0, 0.0, 0.0], is_active: true };
    // Leaves that are zipped to nothing, with leaves left out between them; boxes of one value; two voxels at the ends of space.
    let spread = (0..4096).map(|k| [k % 16, k / 16 % 16, k / 256].map(|it| 16 * it)).map(leaf).collect();
    let trees = [
        tree(spread, Vec::new()),
        tree(Vec::new(), vec![tile([0; 3], 128), tile([128, 0, 0], 128), tile([0, 384, 0], 128)]),
        tree(Vec::new(), vec![tile([0; 3], 4096)]),
        tree(vec![leaf([i32::MIN; 3]), leaf([i32::MAX - 7; 3])], Vec::new()),
    ];
    for tree in trees {
        let transform = Transform { scale: [0.5; 3], translation: [0.0; 3] };
        let grid = Grid { name: "density".into(), class: Class::FogVolume, transform, tree };
        let path = folder.0.join("a.vdb");
        vdb::write(&path, &[grid], Precision::Full, &()).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let message = refused(&folder, "a.vdb", &bytes);
        assert!(message.contains("OpenVDB"), "{message}");
    }
}
