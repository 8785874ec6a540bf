use tyndall::Particles;

use super::*;
use crate::sequence::Sequence;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/samples")
}

fn at(particles: &Particles, id: usize) -> [f64; 3] {
    particles.positions().world(id).to_array()
}

/// Reads the frames of a text that stands beside the samples.
fn read(text: &str) -> Result<Vec<Frame>> {
    let path = folder().join("a.xdmf");
    let options = Options::default();
    let request = Request { options: &options, bytes: None, units: None, topology: None, others: &() };
    let index = index(&path, text.as_bytes(), &options)?;
    index.frames.iter().map(|it| frame(&path, text.as_bytes(), *it, &request, &())).collect()
}

const ITEM: &str = "<DataItem Format=\"HDF\" Dimensions=\"4\">series_xdmf.h5:/";

fn grid(geometry: &str, attributes: &str) -> String {
    format!(
        "<?xml version=\"1.0\"?><Xdmf><Domain><Grid><Topology TopologyType=\"Polyvertex\"/>{geometry}{attributes}</Grid></Domain></Xdmf>"
    )
}

#[test]
fn a_series_has_its_steps_times_and_grids() {
    let sequence = Sequence::open(&[folder().join("series.xdmf")], &Options::default(), &()).unwrap();
    assert_eq!(sequence.len(), 2);
    let first = sequence.frame(0, &()).unwrap();
    assert_eq!((at(&first.particles, 3), first.particles.time()), ([9.0, 10.0, 11.0], Some(0.5)));
    assert!(first.conventions.is_empty() && first.warnings.is_empty(), "{:?}", first.warnings);
    let second = sequence.frame(1, &()).unwrap();
    assert_eq!((at(&second.particles, 3), second.particles.time()), ([9.0, 10.0, 11.0], Some(0.75)));
    assert_eq!(second.conventions, ["a grid without a geometry has the first one of the file"]);
    for (frame, sign) in [(&first, 1.0), (&second, -1.0)] {
        let velocity = frame.particles.attribute("velocity").unwrap();
        assert_eq!((velocity.components, velocity.number(2, 1)), (3, sign * 7.0));
        assert_eq!(frame.particles.attribute("mass").unwrap().number(3, 0), sign * 3.0);
    }
}

#[test]
fn axes_may_stand_alone_and_grids_beside_each_other() {
    let axes = format!("<Geometry GeometryType=\"X_Y\">{ITEM}x</DataItem>{ITEM}y</DataItem></Geometry>");
    let particles = read(&grid(&axes, "")).unwrap().remove(0).particles;
    assert_eq!(at(&particles, 2), [2.0, 20.0, 0.0]);
    let rows = format!("<Geometry Type=\"XYZ\">{ITEM}step_0/position</DataItem></Geometry>");
    let mass = format!("<Attribute Name=\"mass\" Center=\"Node\">{ITEM}step_0/mass</DataItem></Attribute>");
    let both =
        grid(&rows, &mass).replace("</Grid>", &format!("</Grid><Grid GridType=\"Uniform\">{axes}</Grid>"));
    let frames = read(&both).unwrap();
    let mass = frames[0].particles.attribute("mass").unwrap();
    assert_eq!((frames.len(), frames[0].particles.len(), mass.number(3, 0)), (1, 8, 3.0));
    assert!(mass.number(4, 0).is_nan());
    assert_eq!(at(&frames[0].particles, 6), [2.0, 20.0, 0.0]);
}

#[test]
fn times_may_be_a_list_or_steps_and_a_mesh_may_stand_beside() {
    let mesh = format!("<Grid><Geometry>{ITEM}step_0/position</DataItem></Geometry></Grid>");
    let steps = [(&*mesh, "", "List", "2 3.5"), ("<Grid/>", &*mesh, "HyperSlab", "2.0 1.5 2")];
    for (step, beside, kind, numbers) in steps {
        let time = format!("<Time TimeType=\"{kind}\"><DataItem Format=\"XML\">{numbers}</DataItem></Time>");
        let text = format!(
            "<Xdmf><Domain><Grid GridType=\"Collection\" CollectionType=\"Temporal\">{time}{step}{step}</Grid>{beside}</Domain></Xdmf>"
        );
        let frames = read(&text).unwrap();
        let times: Vec<_> = frames.iter().map(|it| it.particles.time()).collect();
        assert_eq!(times, [Some(2.0), Some(3.5)], "{kind}");
        assert_eq!(at(&frames[1].particles, 1), [3.0, 4.0, 5.0]);
    }
}

#[test]
fn what_is_not_read_is_said() {
    let rows = format!("<Geometry>{ITEM}step_0/position</DataItem></Geometry>");
    let message = |text: String| read(&text).err().unwrap().to_string();
    assert!(message(grid(&rows.replace("HDF", "TIFF"), "")).contains("format TIFF"));
    assert!(message(grid(&rows.replace("HDF", "XML"), "")).contains("a number was wanted, 'series_xdmf"));
    assert!(message(grid(&rows.replace("step_0", "step_7"), "")).contains("no such data set"));
    assert!(
        message(grid(&rows.replace("<Geometry>", "<Geometry Type=\"ORIGIN_DXDYDZ\">"), ""))
            .contains("no points")
    );
    assert!(message(grid("", "")).contains("no Geometry"));
    assert!(message(grid(&rows, "").replace("Domain", "Range")).contains("no element Domain"));
    let odd = format!(
        "<Attribute Name=\"a\">{ITEM}one</DataItem></Attribute><Attribute Name=\"b\"><DataItem ItemType=\"Function\"/></Attribute>"
    );
    let frame = read(&grid(&rows, &odd)).unwrap().remove(0);
    assert_eq!(
        frame.warnings,
        ["left out: a (1 rows for 4 points)", "left out: b (its DataItem is a Function)"]
    );
}

/// Positions `k, 2, 3` and what else is said of three points, in the XML.
const POINTS: &str =
    "<Geometry GeometryType=\"XYZ\"><DataItem Dimensions=\"3 3\">0 2 3\n 1 2 3\t2 2 3</DataItem></Geometry>";

fn attribute(name: &str, item: &str, numbers: &str) -> String {
    format!(
        "<Attribute Name=\"{name}\" AttributeType=\"Vector\"><DataItem {item}>{numbers}</DataItem></Attribute>"
    )
}

#[test]
fn numbers_may_stand_in_the_xml() {
    let flat = POINTS.replace("3 3", "9").replace("XYZ", "xyz");
    let axes = "<Geometry Type=\"X_Y\"><DataItem Dimensions=\"3\" Format=\"XML\" Precision=\"8\">0 1 2</DataItem>\
                <DataItem Dimensions=\"3\" NumberType=\"Int\">2 2 2</DataItem></Geometry>";
    for (geometry, depth) in [(POINTS, 3.0), (&flat, 3.0), (axes, 0.0)] {
        let attributes =
            attribute("id", "Dimensions=\"3 1\" NumberType=\"UInt\" Precision=\"8\"", "7 8 9000000000")
                + &attribute("v", "Dimensions=\"9\" Format=\"XML\"", "1 2 3 4 5 6 7 8 9.5e-1");
        let frame = read(&grid(geometry, &attributes)).unwrap().remove(0);
        let particles = &frame.particles;
        assert_eq!((particles.len(), at(particles, 2)), (3, [2.0, 2.0, depth]));
        assert_eq!(particles.attribute("id").unwrap().number(2, 0), 9e9);
        let velocity = particles.attribute("v").unwrap();
        assert_eq!((velocity.components, velocity.number(2, 2)), (3, f64::from(0.95f32)));
        assert!(frame.warnings.is_empty(), "{:?}", frame.warnings);
    }
    let none = POINTS.replace("3 3", "0 3").replace("0 2 3\n 1 2 3\t2 2 3", " ");
    assert_eq!(read(&grid(&none, "")).unwrap()[0].particles.len(), 0);
}

#[test]
fn numbers_may_stand_in_binary_files() {
    let place = tempfile::tempdir().unwrap();
    let mut file = vec![0xef, 0xbb, 0xbf];
    file.extend((0..9).flat_map(|it| (f64::from(it) / 2.0).to_be_bytes()));
    file.extend([-1i16, 2, 300].into_iter().flat_map(i16::to_le_bytes));
    std::fs::write(place.path().join("a.bin"), &file).unwrap();
    let item = |what: &str| format!("<DataItem Format=\"Binary\" {what}>\n a.bin \n</DataItem>");
    let rows = item("Dimensions=\"3 3\" NumberType=\"Float\" Precision=\"8\" Endian=\"Big\" Seek=\"3\"");
    let read = |attribute: &str| {
        let kind = format!("<Attribute Name=\"kind\">{}</Attribute>", item(attribute));
        let path = place.path().join("a.xmf");
        std::fs::write(&path, grid(&format!("<Geometry>{rows}</Geometry>"), &kind)).unwrap();
        Sequence::open(&[path], &Options::default(), &()).unwrap().frame(0, &())
    };
    let short = "Dimensions=\"3\" NumberType=\"Short\" Endian=\"Little\"";
    let frame = read(&format!("{short} Seek=\"75\"")).unwrap();
    assert_eq!(at(&frame.particles, 2), [3.0, 3.5, 4.0]);
    let kind = frame.particles.attribute("kind").unwrap();
    assert_eq!([0, 1, 2].map(|id| kind.number(id, 0)), [-1.0, 2.0, 300.0]);
    // What a hostile or damaged file says.
    let left_out = |attribute: &str| read(attribute).unwrap().warnings.concat();
    assert!(left_out(&format!("{short} Seek=\"76\"")).contains("more than a file of 81 bytes has"));
    assert!(left_out(&format!("{short} Seek=\"18446744073709551615\"")).contains("more than a file"));
    assert!(left_out(&format!("{short} Seek=\"-1\"")).contains("Seek is '-1'"));
    assert!(left_out(&short.replace("Little", "Middle")).contains("no order of bytes 'middle'"));
    assert!(left_out(&short.replace("Short", "Float\" Precision=\"16")).contains("type Float of 16 bytes"));
    assert!(left_out(&format!("{short} Compression=\"Zlib\"")).contains("compressed: Zlib"));
    for wrong in ["9223372036854775807 4", "4 99999999", "-3", "", "3 0"] {
        let told = left_out(&short.replace("\"3\"", &format!("\"{wrong}\"")));
        assert!(told.contains("Dimensions are"), "{wrong}: {told}");
    }
    assert!(left_out(&short.replace("\"3\"", "\"9223372036854775807\"")).contains("more than a file"));
    assert!(left_out("").contains("no Dimensions"));
    std::fs::remove_file(place.path().join("a.bin")).unwrap();
    assert!(read(short).unwrap_err().to_string().contains("a.bin"));
}

#[test]
fn items_may_refer_to_others() {
    let shared = "<DataItem Name=\"p/q\" Dimensions=\"3 3\">0 2 3 1 2 3 2 2 3</DataItem>";
    let paths = [
        "Reference=\"/Xdmf/Domain/DataItem[@Name='p/q']\"/>",
        "Reference=\"/Xdmf/Domain/DataItem\"/>",
        "Reference=\"XML\"> /Xdmf/Domain/DataItem[1] </DataItem>",
    ];
    let text = |path: &str| {
        grid(&format!("<Geometry><DataItem {path}</Geometry>"), "")
            .replace("<Domain>", &format!("<Domain>{shared}"))
    };
    for path in paths {
        assert_eq!(at(&read(&text(path)).unwrap()[0].particles, 2), [2.0, 2.0, 3.0], "{path}");
    }
    let itself = "Reference=\"/Xdmf/Domain/Grid/Geometry/DataItem\"/>";
    for (path, wrong) in [
        (itself, "in a circle"),
        ("Reference=\"/Xdmf/Range/[[\"/>", "not there"),
        ("Reference=\"/Xdmf/Domain/DataItem[0]\"/>", "not there"),
    ] {
        let message = read(&text(path)).err().unwrap().to_string();
        assert!(message.contains(wrong), "{message}");
    }
}

#[test]
fn hyperslabs_take_rows() {
    let slab = |numbers: &str, source: &str| {
        format!(
            "<DataItem ItemType=\"HyperSlab\"><DataItem Dimensions=\"3 2\">{numbers}</DataItem>{source}</DataItem>"
        )
    };
    let rows = format!("{ITEM}step_0/position</DataItem>");
    let mass = format!(
        "<Attribute Name=\"mass\">{}</Attribute>",
        slab("2 1 2", &format!("{ITEM}step_0/mass</DataItem>"))
    );
    let text = |numbers: &str| grid(&format!("<Geometry>{}</Geometry>", slab(numbers, &rows)), &mass);
    let frame = read(&text("2 0 1 1 2 3")).unwrap().remove(0);
    assert_eq!((frame.particles.len(), at(&frame.particles, 1)), (2, [9.0, 10.0, 11.0]));
    assert_eq!(frame.particles.attribute("mass").unwrap().number(1, 0), 3.0);
    assert_eq!(read(&text("0 0 1 1 4 3")).unwrap()[0].warnings, ["left out: mass (2 rows for 4 points)"]);
    for wrong in ["2 0 1 1 3 3", "0 0 2 1 2 3", "0 1 1 1 4 2", "1 2 3", "", "18446744073709551615 0 1 1 2 3"]
    {
        let message = read(&text(wrong)).err().unwrap().to_string();
        assert!(message.contains("HyperSlab"), "{wrong}: {message}");
    }
    let message =
        read(&grid(&format!("<Geometry>{}</Geometry>", slab("0 0 1 1 1 3", POINTS)), "")).err().unwrap();
    assert!(message.to_string().contains("1 DataItems, not two"), "{message}");
}

#[test]
fn damage_never_panics() {
    let attributes =
        attribute("v", "Dimensions=\"3 3\" NumberType=\"Int\" Format=\"XML\"", "1 2 3 4 5 6 7 8 9");
    let text = grid(POINTS, &attributes);
    crate::read::real_data::damage_some(text.as_bytes(), |file| drop(read(&String::from_utf8_lossy(file))));
    for wrong in ["4 3", "3 4", "2 3", "99999999999 3"] {
        let message = read(&text.replacen("3 3", wrong, 1)).err().unwrap().to_string();
        assert!(message.contains("numbers were wanted") || message.contains("wants 3 rows"), "{message}");
    }
}
