use std::path::PathBuf;

use tyndall::Values;

use super::*;
use crate::read::real_data;
use crate::sequence::{Options, Sequence};

/// Writes a snapshot: blocks with their names, little-endian numbers of the given widths.
struct Writer {
    counts: [u32; 6],
    masses: [f64; 6],
    totals: [u32; 6],
    files: i32,
    box_size: f64,
    time: f64,
    redshift: f64,
    omega: f64,
    cooling: i32,
    big: bool,
    named: bool,
    blocks: Vec<(&'static str, Vec<u8>)>,
}

impl Writer {
    fn new(counts: [u32; 6]) -> Self {
        Self {
            counts,
            masses: [0.0; 6],
            totals: counts,
            files: 1,
            box_size: 0.0,
            time: 0.5,
            redshift: 1.0,
            omega: 0.3,
            cooling: 0,
            big: false,
            named: false,
            blocks: Vec::new(),
        }
    }

    fn floats(&mut self, name: &'static str, values: impl IntoIterator<Item = f32>) {
        let bytes = |value: f32| if self.big { value.to_be_bytes() } else { value.to_le_bytes() };
        self.blocks.push((name, values.into_iter().flat_map(bytes).collect()));
    }

    fn doubles(&mut self, name: &'static str, values: impl IntoIterator<Item = f64>) {
        let bytes = |value: f64| if self.big { value.to_be_bytes() } else { value.to_le_bytes() };
        self.blocks.push((name, values.into_iter().flat_map(bytes).collect()));
    }

    fn ids(&mut self, values: impl IntoIterator<Item = u32>) {
        let bytes = |value: u32| if self.big { value.to_be_bytes() } else { value.to_le_bytes() };
        self.blocks.push(("ID", values.into_iter().flat_map(bytes).collect()));
    }

    fn long_ids(&mut self, values: impl IntoIterator<Item = u64>) {
        let bytes = |value: u64| if self.big { value.to_be_bytes() } else { value.to_le_bytes() };
        self.blocks.push(("ID", values.into_iter().flat_map(bytes).collect()));
    }

    fn bytes(&self) -> Vec<u8> {
        let u32_bytes = |value: u32| if self.big { value.to_be_bytes() } else { value.to_le_bytes() };
        let f64_bytes = |value: f64| if self.big { value.to_be_bytes() } else { value.to_le_bytes() };
        let mut header = Vec::new();
        header.extend(self.counts.iter().flat_map(|&it| u32_bytes(it)));
        header.extend(self.masses.iter().chain([&self.time, &self.redshift]).flat_map(|&it| f64_bytes(it)));
        header.extend([0; 8]);
        header.extend(self.totals.iter().flat_map(|&it| u32_bytes(it)));
        header.extend([self.cooling, self.files].iter().flat_map(|&it| u32_bytes(it as u32)));
        header.extend([self.box_size, self.omega, 0.7, 0.7].iter().flat_map(|&it| f64_bytes(it)));
        header.resize(HEADER_BYTES, 0);
        let mut file = Vec::new();
        let head = ("HEAD", header);
        for (name, block) in std::iter::once(&head).chain(&self.blocks) {
            if self.named {
                file.extend(u32_bytes(8));
                file.extend(format!("{name:<4}").bytes());
                file.extend(u32_bytes(block.len() as u32 + 8));
                file.extend(u32_bytes(8));
            }
            file.extend(u32_bytes(block.len() as u32));
            file.extend(block);
            file.extend(u32_bytes(block.len() as u32));
        }
        file
    }
}

/// Two gas, three halo (of one mass) and two star particles; coordinates count on from 0.
fn sample(big: bool, named: bool) -> Writer {
    let mut writer = Writer::new([2, 3, 0, 0, 2, 0]);
    (writer.big, writer.named, writer.masses[1], writer.box_size) = (big, named, 0.25, 30.0);
    writer.floats("POS", (0..21).map(|it| it as f32));
    writer.floats("VEL", (0..21).map(|it| -it as f32));
    writer.ids(10..17);
    writer.floats("MASS", [1.0, 2.0, 4.0, 8.0]);
    writer.floats("U", [0.5, 0.75]);
    writer.floats("RHO", [7.0, 9.0]);
    writer.floats("HSML", [0.1, 0.2]);
    writer
}

fn read_with(bytes: &[u8], options: &Options) -> Result<Frame> {
    let path = Path::new("snap");
    let index = index(path, bytes, options)?;
    let request = Request { options, bytes: None, units: None, topology: None, others: &() };
    frame(path, bytes, index.frames[0], &request, &())
}

fn read(bytes: &[u8]) -> Result<Frame> {
    read_with(bytes, &Options::default())
}

fn numbers(frame: &Frame, name: &str) -> Vec<f64> {
    let attribute = frame.particles.attribute(name).unwrap_or_else(|| panic!("no {name}"));
    (0..frame.particles.len()).map(|id| attribute.number(id, 0)).collect()
}

#[test]
fn all_types_are_read_in_both_formats_and_orders() {
    for (big, named) in [(false, false), (false, true), (true, false), (true, true)] {
        let bytes = sample(big, named).bytes();
        assert!(recognise(&bytes));
        let frame = read(&bytes).unwrap();
        let particles = &frame.particles;
        assert_eq!(particles.positions().world(6).to_array(), [18.0, 19.0, 20.0]);
        let names = ["gas", "halo", "star"].map(String::from).to_vec();
        let types = Values::Text { codes: vec![0, 0, 1, 1, 1, 2, 2], names };
        assert_eq!(particles.attribute("type").unwrap().values, types);
        assert_eq!(numbers(&frame, "mass"), [1.0, 2.0, 0.25, 0.25, 0.25, 4.0, 8.0]);
        assert_eq!(particles.attribute("id").unwrap().values, Values::I64((10..17).collect()));
        assert_eq!(particles.attribute("vel").unwrap().number(6, 2), -20.0);
        assert!(
            numbers(&frame, "u")[..2] == [0.5, 0.75]
                && numbers(&frame, "u")[2..].iter().all(|it| it.is_nan())
        );
        assert_eq!(numbers(&frame, "hsml")[1], f64::from(0.2f32));
        assert_eq!(particles.cell().unwrap().vectors[2], DVec3::Z * 30.0);
        assert_eq!(particles.time(), Some(0.5));
        assert!(frame.warnings.is_empty(), "{:?}", frame.warnings);
        assert!(frame.conventions.iter().any(|it| it.contains("a = 0.5") && it.contains("h = 0.7")));
        assert_eq!(frame.conventions.iter().any(|it| it.contains("no names")), !named);
        let index = index(Path::new("snap"), &bytes, &Options::default()).unwrap();
        let (format, order) = (if named { 2 } else { 1 }, if big { "big" } else { "little" });
        assert_eq!(index.title, Some(format!("Gadget format {format}, {order}-endian")));
    }
}

#[test]
fn wanted_types_alone_are_read() {
    let types = |words: &[&str]| Options {
        types: Some(words.iter().map(|it| it.to_string()).collect()),
        ..Options::default()
    };
    let bytes = sample(false, false).bytes();
    let frame = read_with(&bytes, &types(&["star", "0"])).unwrap();
    assert_eq!(numbers(&frame, "id"), [10.0, 11.0, 15.0, 16.0]);
    assert_eq!(numbers(&frame, "mass"), [1.0, 2.0, 4.0, 8.0]);
    let halo = read_with(&bytes, &types(&["halo"])).unwrap();
    assert!(halo.particles.attribute("u").is_none(), "no gas, so no internal energy");
    let message = read_with(&bytes, &types(&["bulge"])).unwrap_err().to_string();
    assert!(message.contains("gas, halo, star"), "{message}");
    assert!(read_with(&bytes, &types(&["planet"])).is_err());
}

#[test]
fn wide_numbers_and_unknown_blocks_are_told_by_their_size() {
    let mut writer = Writer::new([1, 0, 0, 0, 0, 1]);
    writer.named = true;
    writer.doubles("POS", [0.0, 1.0, 2.0, 1e6 + 0.125, 4.0, 5.0]);
    writer.long_ids([7, u64::MAX]);
    writer.floats("MASS", [1.0, 2.0]);
    writer.floats("BFLD", [1.0, 2.0, 3.0]);
    writer.floats("WHAT", [1.0; 5]);
    let frame = read(&writer.bytes()).unwrap();
    assert_eq!(numbers(&frame, "id"), [7.0, u64::MAX as f64]);
    let field = frame.particles.attribute("bfld").unwrap();
    assert!(field.components == 3 && field.number(0, 2) == 3.0 && field.number(1, 0).is_nan());
    assert!(frame.warnings.iter().any(|it| it.contains("'what'")), "{:?}", frame.warnings);
    assert!((frame.particles.positions().world(1).x - 1e6 - 0.125).abs() < 0.05);
}

#[test]
fn blocks_of_cooling_gas_are_told_from_others() {
    let mut writer = Writer::new([3, 0, 0, 0, 0, 0]);
    writer.cooling = 1;
    writer.floats("POS", (0..9).map(|it| it as f32));
    writer.floats("VEL", (0..9).map(|it| it as f32));
    writer.ids(0..3);
    for block in 1..=6 {
        writer.floats("", [block as f32; 3]);
    }
    let frame = read(&writer.bytes()).unwrap();
    let names = ["mass", "u", "rho", "ne", "nh", "hsml"];
    assert_eq!(names.map(|name| numbers(&frame, name)[0]), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
}

#[test]
fn stray_bytes_and_empty_files_are_said() {
    let mut bytes = sample(false, false).bytes();
    bytes.push(0);
    let frame = read(&bytes).unwrap();
    assert_eq!((frame.particles.len(), frame.warnings.len()), (7, 1));
    assert!(frame.warnings[0].contains("1 byte behind"));
    assert_eq!(read(&Writer::new([0; 6]).bytes()).unwrap().particles.len(), 0);
    let mut one = Writer::new([0, 1, 0, 0, 0, 0]);
    one.floats("POS", [1.0, 2.0, 3.0]);
    assert_eq!(read(&one.bytes()).unwrap().particles.positions().world(0).to_array(), [1.0, 2.0, 3.0]);
}

#[test]
fn what_is_missing_is_an_error() {
    let bytes = sample(false, true).bytes();
    let message = read(&bytes[..bytes.len() - 1]).unwrap_err().to_string();
    assert!(message.contains("a block of 8 bytes begins here, 11 bytes are left"), "{message}");
    let message = read(&bytes[..300]).unwrap_err().to_string();
    assert!(message.contains("block 'pos' stands at the end, without the block"), "{message}");
    let empty = Writer::new([5, 0, 0, 0, 0, 0]).bytes();
    let message = read(&empty).unwrap_err().to_string();
    assert!(message.contains("promises 5 particles, but no block has their positions"), "{message}");
    // Positions of the first type alone, or one number a particle.
    for counts in [[10, 7, 0, 0, 0, 0], [10, 5, 0, 0, 0, 0]] {
        let mut writer = Writer::new(counts);
        writer.named = true;
        writer.floats("POS", (0..30).map(|it| it as f32));
        let message = read(&writer.bytes()).unwrap_err().to_string();
        assert!(message.contains("no block has their positions"), "{message}");
    }
}

#[test]
fn hostile_counts_ask_for_no_memory() {
    for place in (4..28).step_by(4) {
        let mut bytes = sample(false, false).bytes();
        bytes[place..][..4].fill(0xff);
        assert!(read(&bytes).is_err(), "count at {place}");
    }
}

#[test]
fn damage_never_panics() {
    for named in [false, true] {
        real_data::damage(&sample(false, named).bytes(), |file| drop(read(file)));
    }
}

/// A folder with a snapshot in two files.
fn two_files(name: &str) -> (PathBuf, [PathBuf; 2]) {
    let folder = std::env::temp_dir().join(format!("tyndall-gadget-{}-{name}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let paths = [0, 1].map(|number| folder.join(format!("snap_003.{number}")));
    for (number, path) in paths.iter().enumerate() {
        let mut writer = Writer::new([1, 2, 0, 0, 0, 0]);
        (writer.files, writer.totals) = (2, [2, 4, 0, 0, 0, 0]);
        writer.floats("POS", (0..9).map(|it| (9 * number + it) as f32));
        writer.floats("VEL", (0..9).map(|it| it as f32));
        writer.ids((0..3).map(|it| 3 * number as u32 + it));
        writer.floats("MASS", [1.0, 2.0, 3.0]);
        std::fs::write(path, writer.bytes()).unwrap();
    }
    (folder, paths)
}

#[test]
fn the_files_of_a_snapshot_are_one_frame_whichever_is_named() {
    let (folder, paths) = two_files("all");
    for named in [vec![paths[1].clone()], paths.to_vec()] {
        let sequence = Sequence::open(&named, &Options::default(), &()).unwrap();
        assert_eq!((sequence.len(), sequence.format()), (1, "Gadget format 1, little-endian, 2 files"));
        let frame = sequence.frame(0, &()).unwrap();
        assert_eq!(numbers(&frame, "id"), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(frame.particles.positions().world(5).to_array(), [15.0, 16.0, 17.0]);
        assert!(frame.warnings.is_empty(), "{:?}", frame.warnings);
    }
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn a_missing_file_of_a_snapshot_is_said_or_refused() {
    let (folder, paths) = two_files("missing");
    std::fs::remove_file(&paths[1]).unwrap();
    let first = [paths[0].clone()];
    let frame = Sequence::open(&first, &Options::default(), &()).unwrap().frame(0, &()).unwrap();
    assert_eq!(frame.particles.len(), 3);
    assert!(
        frame.warnings[0].contains("missing: 1 of the snapshot's 2 files, first snap_003.1"),
        "{:?}",
        frame.warnings
    );
    let strict = Options { strict: true, ..Options::default() };
    assert!(Sequence::open(&first, &strict, &()).is_err());
    std::fs::remove_dir_all(folder).unwrap();
}
