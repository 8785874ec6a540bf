//! GROMACS XTC: compressed coordinates, frame after frame; nothing else but box, step and time.
//!
//! Numbers are big-endian. Coordinates are whole multiples of 1/precision nm: the first of a group as its place in the frame's
//! bounding box, those that follow as small differences, all packed as digits of mixed radix into bits. Frames of up to nine atoms
//! are plain floats. Magic 1995 counts the packed bytes in 32 bits, 2023 in 64. Sources: GROMACS, xdrf and libxdrf (what the format
//! is); tested against the crate molly, which panics on damaged files and therefore does not read the users'.

use std::path::Path;

use tyndall::{Columns, DVec3, Progress, Result};

use super::cursor::Cursor;
use super::numbers::Order;
use super::{Index, Request, Span, finish, molecules, records};
use crate::sequence::{Frame, Options};

const HINT: &str = "check it with gmx check, and copy or write it again";

/// Radices of small differences; from place 9 on each is about the cube root of 2 times the one before.
const RADICES: [u32; 73] = [
    0, 0, 0, 0, 0, 0, 0, 0, 0, 8, 10, 12, 16, 20, 25, 32, 40, 50, 64, 80, 101, 128, 161, 203, 256, 322, 406,
    512, 645, 812, 1024, 1290, 1625, 2048, 2580, 3250, 4096, 5060, 6501, 8192, 10321, 13003, 16384, 20642,
    26007, 32768, 41285, 52015, 65536, 82570, 104031, 131072, 165140, 208063, 262144, 330280, 416127, 524287,
    660561, 832255, 1048576, 1321122, 1664510, 2097152, 2642245, 3329021, 4194304, 5284491, 6658042, 8388607,
    10568983, 13316085, 16777216,
];
/// Boxes with an edge of more steps than this have their coordinates packed one by one.
const LARGEST_EDGE: u64 = 0xff_ffff;
/// Frames of at most so many atoms are not compressed.
const FEW: u32 = 9;

/// Whether the file begins like XTC.
pub(crate) fn recognise(head: &[u8]) -> bool {
    let cursor = &mut cursor(Path::new(""), head, 0);
    Header::read(cursor).is_ok() || is_magic(head) && head.len() < Header::BYTES
}

fn is_magic(head: &[u8]) -> bool {
    head.starts_with(&1995u32.to_be_bytes()) || head.starts_with(&2023u32.to_be_bytes())
}

fn cursor<'a>(path: &'a Path, bytes: &'a [u8], place: usize) -> Cursor<'a> {
    Cursor::new(path, bytes, place, Order::Big, HINT)
}

/// What stands before the coordinates.
struct Header {
    is_wide: bool,
    count: u32,
    time: f32,
    vectors: [DVec3; 3],
}

impl Header {
    const BYTES: usize = 56;

    fn read(cursor: &mut Cursor) -> Result<Self> {
        let magic: u32 = cursor.number("the magic number")?;
        if magic != 1995 && magic != 2023 {
            return Err(cursor
                .fault(format!("the magic number 1995 or 2023 of a frame was wanted, {magic} was found")));
        }
        let count = cursor.number("the number of atoms")?;
        let _step: u32 = cursor.number("the step")?;
        let time = cursor.number("the time")?;
        let mut vectors = [DVec3::ZERO; 3];
        for vector in &mut vectors {
            let edge = [(); 3].map(|()| cursor.number::<f32>("the box"));
            let [x, y, z] = edge;
            *vector = DVec3::new(x?.into(), y?.into(), z?.into());
        }
        let again: u32 = cursor.number("the number of atoms")?;
        if again != count {
            return Err(cursor.fault(format!("the number of atoms is {count}, then {again}")));
        }
        Ok(Self { is_wide: magic == 2023, count, time, vectors })
    }

    /// How many bytes of packed coordinates follow.
    fn packed_bytes(&self, cursor: &mut Cursor) -> Result<u64> {
        let what = "the size of the coordinates";
        if self.is_wide { cursor.number(what) } else { cursor.number::<u32>(what).map(u64::from) }
    }

    /// Passes over the coordinates.
    fn skip(&self, cursor: &mut Cursor) -> Result<()> {
        if self.count <= FEW {
            return cursor.skip(12 * u64::from(self.count), "the coordinates");
        }
        cursor.skip(32, "the precision")?;
        let bytes = self.packed_bytes(cursor)?;
        cursor.skip(bytes.saturating_add(3) & !3, "the coordinates")
    }
}

/// Finds the frames.
pub(crate) fn index(path: &Path, bytes: &[u8], _: &Options) -> Result<Index> {
    let mut index = Index::default();
    let mut cursor = cursor(path, bytes, 0);
    while cursor.left() > 0 {
        let offset = cursor.place();
        if let Err(error) = Header::read(&mut cursor).and_then(|header| header.skip(&mut cursor)) {
            index.cut = cursor.ended();
            if index.cut { break } else { return Err(error) }
        }
        let bytes = Some((cursor.place() - offset) as u64);
        index.frames.push(Span { offset: offset as u64, line: index.frames.len() as u64 + 1, bytes });
    }
    Ok(index)
}

/// Reads the frame at `span`.
pub(crate) fn frame(
    path: &Path,
    bytes: &[u8],
    span: Span,
    request: &Request,
    progress: &dyn Progress,
) -> Result<Frame> {
    progress.begin("read", span.bytes, "B");
    let mut cursor = cursor(path, bytes, span.offset as usize);
    let header = Header::read(&mut cursor)?;
    let cell = molecules::cell(header.vectors);
    let origin = cell.map(|it| it.center());
    let mut conventions = vec!["lengths: nm (XTC convention)".to_string()];
    let positions = if header.count <= FEW {
        let mut rows = Vec::new();
        for _ in 0..header.count {
            let [x, y, z] = [(); 3].map(|()| cursor.number::<f32>("a coordinate"));
            rows.push(DVec3::new(x?.into(), y?.into(), z?.into()));
        }
        records::positions(rows.len(), origin, |id| rows[id])
    } else {
        let precision: f32 = cursor.number("the precision")?;
        if !(precision.is_finite() && precision > 0.0) {
            return Err(cursor.fault(format!("the precision cannot be {precision}")));
        }
        conventions.push(format!("coordinates are rounded to 1/{precision} nm"));
        let steps = unpack(&mut cursor, &header, progress)?;
        let position =
            |id: usize| DVec3::from_array(steps[id].map(|it| f64::from(it) / f64::from(precision)));
        records::positions(steps.len(), origin, position)
    };
    progress.advance(span.bytes.unwrap_or_default());
    let mut columns = Columns {
        positions,
        cell,
        time: Some(header.time.into()),
        time_unit: Some("ps".to_string()),
        length_unit: Some("nm".to_string()),
        ..Columns::default()
    };
    request.complete(&mut columns, path, span, &mut conventions)?;
    finish(columns, conventions, vec![])
}

/// The coordinates as whole numbers of steps.
fn unpack(cursor: &mut Cursor, header: &Header, progress: &dyn Progress) -> Result<Vec<[i32; 3]>> {
    let mut corners = [[0i32; 3]; 2];
    for corner in corners.as_flattened_mut() {
        *corner = cursor.number("the bounds")?;
    }
    let [least, greatest] = corners;
    let small: u32 = cursor.number("the size of differences")?;
    let bytes = header.packed_bytes(cursor)?;
    let packed = cursor.take(usize::try_from(bytes).unwrap_or(usize::MAX), "the coordinates")?;

    let edge = |axis: usize| i64::from(greatest[axis]) - i64::from(least[axis]) + 1;
    let edges = [edge(0), edge(1), edge(2)].map(|it| u64::try_from(it).unwrap_or(0));
    let count = header.count as usize;
    // An atom has two bits at least.
    if edges.contains(&0) || count as u64 > 4 * bytes {
        let what = format!("{count} atoms from {least:?} to {greatest:?} do not fit {bytes} bytes");
        return Err(cursor.fault(what));
    }
    let is_large = edges.iter().any(|&it| it > LARGEST_EDGE);
    let product: u128 = edges.iter().map(|&it| u128::from(it)).product();
    let (bits, bits_of_axes) = (bits_for(product), edges.map(|it| bits_for(it.into()).min(32)));

    let fault = |what: &str| cursor.fault(format!("the packed coordinates {what}"));
    let radix = |place: usize| {
        let known = RADICES.get(place).copied().filter(|&it| it > 0);
        known.ok_or_else(|| fault("have differences of no known size"))
    };
    let mut reader = Bits { bytes: packed, place: 0 };
    let mut place = small as usize;
    radix(place)?;
    let mut steps: Vec<[i32; 3]> = Vec::with_capacity(count);
    let mut run = 0;
    while steps.len() < count {
        if steps.len() % (1 << 16) < 16 && progress.cancelled() {
            return Err(tyndall::Error::Interrupted);
        }
        let digits = match is_large {
            true => [0, 1, 2].map(|axis| reader.take(bits_of_axes[axis]) as u32),
            false => reader.digits(bits, edges.map(|it| it as u32)),
        };
        let mut before: [i32; 3] =
            std::array::from_fn(|axis| least[axis].wrapping_add_unsigned(digits[axis]));
        let mut change = 0;
        if reader.take(1) == 1 {
            run = reader.take(5) as usize;
            change = run % 3;
            run -= change;
        } else {
            change += 1;
        }
        // What follows is near; the first two are stored in exchange, since the middle one of a water molecule is near to both.
        if run == 0 {
            steps.push(before);
        }
        let size = radix(place)?;
        for k in (0..run).step_by(3) {
            let digits = reader.digits(place as u32, [size; 3]);
            let half = (size / 2) as i32;
            let next = std::array::from_fn(|axis| {
                before[axis].wrapping_add_unsigned(digits[axis]).wrapping_sub(half)
            });
            if k == 0 {
                steps.extend([next, before]);
                before = next;
            } else {
                steps.push(next);
                before = next;
            }
        }
        // 0, 1, 2: the next differences are smaller, alike, larger.
        place = (place + change).wrapping_sub(1);
        if reader.place > 8 * packed.len() {
            return Err(fault("end early"));
        }
    }
    if steps.len() > count {
        return Err(fault("are of more atoms than the frame has"));
    }
    Ok(steps)
}

/// How many bits hold the numbers below and at `size`.
fn bits_for(size: u128) -> u32 {
    u128::BITS - size.leading_zeros()
}

/// Bits, the highest of each byte first. Zeros follow the last.
struct Bits<'a> {
    bytes: &'a [u8],
    /// The next bit.
    place: usize,
}

impl Bits<'_> {
    /// The next `count` bits, at most 56, as a number.
    #[inline]
    fn take(&mut self, count: u32) -> u64 {
        let byte = self.place / 8;
        let word = match self.bytes.get(byte..byte + 8) {
            Some(eight) => u64::from_be_bytes(eight.try_into().expect("eight bytes")),
            None => {
                let mut eight = [0; 8];
                let rest = self.bytes.get(byte..).unwrap_or_default();
                eight[..rest.len().min(8)].copy_from_slice(&rest[..rest.len().min(8)]);
                u64::from_be_bytes(eight)
            }
        };
        let shifted = word << (self.place % 8);
        self.place += count as usize;
        if count == 0 { 0 } else { shifted >> (64 - count) }
    }

    /// The next `count` bits as a number whose least byte comes first.
    #[inline]
    fn take_reversed(&mut self, count: u32) -> u64 {
        let (whole, rest) = (count / 8, count % 8);
        let low = if whole == 0 { 0 } else { self.take(8 * whole).swap_bytes() >> (64 - 8 * whole) };
        low | self.take(rest) << (8 * whole)
    }

    /// The next `count` bits as digits of mixed radix, the last digit least.
    #[inline]
    fn digits(&mut self, count: u32, radices: [u32; 3]) -> [u32; 3] {
        let [_, second, third] = radices;
        if count <= 56 {
            let number = self.take_reversed(count);
            let (rest, last) = (number / u64::from(third), number % u64::from(third));
            return [(rest / u64::from(second)) as u32, (rest % u64::from(second)) as u32, last as u32];
        }
        let low = self.take_reversed(48);
        let number = u128::from(low) | u128::from(self.take_reversed(count - 48)) << 48;
        let (rest, last) = (number / u128::from(third), number % u128::from(third));
        [(rest / u128::from(second)) as u32, (rest % u128::from(second)) as u32, last as u32]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::real_data;
    use molly::{Magic, XTCReader, XTCWriter};

    /// Numbers that look random.
    struct Random(u64);

    impl Random {
        fn below(&mut self, limit: u64) -> u64 {
            self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (self.0 >> 33) % limit
        }
    }

    /// A frame of molecules of three atoms near each other, or of atoms anywhere, in a box of so many nm.
    fn molly_frame(seed: u64, count: usize, size: f32, precision: f32) -> molly::Frame {
        let mut random = Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
        let mut unit = || random.below(1 << 20) as f32 / (1 << 20) as f32;
        let mut center = [0.0; 3];
        let mut positions = Vec::new();
        for atom in 0..count {
            if atom % 3 == 0 || seed % 4 == 3 {
                center = [size * unit() - 0.3 * size, size * unit(), size * unit()];
            }
            positions.extend(center.map(|it| it + 0.2 * unit()));
        }
        let boxvec = [size, 0.0, 0.0, 0.1, size, 0.0, -0.1, 0.2, size];
        molly::Frame { step: seed as u32, time: 0.5 * seed as f32, boxvec, precision, positions }
    }

    fn file(frames: &[molly::Frame], magic: Magic) -> Vec<u8> {
        let mut writer = XTCWriter::new_with_magic(Vec::new(), magic);
        frames.iter().for_each(|frame| writer.write_frame(frame).unwrap());
        writer.file
    }

    #[test]
    fn frames_are_what_another_library_reads() {
        for seed in 0..48u64 {
            println!("seed {seed}");
            let magic = if seed % 2 == 0 { Magic::Xtc1995 } else { Magic::Xtc2023 };
            let count = [0, 1, 9, 10, 11, 12, 300, 1000][seed as usize / 2 % 8];
            let size = [0.5, 4.0, 80.0, 3000.0][seed as usize % 4];
            let precision = [100.0, 1000.0, 10_000.0][seed as usize % 3];
            let frames = [
                molly_frame(seed, count, size, precision),
                molly_frame(seed + 7, count + 20, size, precision),
            ];
            let bytes = file(&frames, magic);
            let ours = real_data::open(&bytes).unwrap();
            assert_eq!(ours.len(), 2);
            let mut theirs = XTCReader::new(&bytes[..]);
            for (ours, written) in ours.iter().map(|it| &it.particles).zip(&frames) {
                let mut frame = molly::Frame::default();
                theirs.read_frame(&mut frame).unwrap();
                assert_eq!(ours.len(), frame.natoms());
                for (id, wanted) in frame.coords().enumerate() {
                    let found = ours.positions().world(id);
                    let wanted = DVec3::from_array(wanted.map(f64::from));
                    assert!(
                        found.abs_diff_eq(wanted, 1e-6 * f64::from(size)),
                        "atom {id}: {found}, wanted {wanted}"
                    );
                }
                assert_eq!(ours.time(), Some(f64::from(written.time)));
                assert_eq!(
                    ours.cell().unwrap().vectors[2],
                    DVec3::from_array([-0.1f32, 0.2, size].map(f64::from))
                );
                assert!(ours.attributes().is_empty());
            }
        }
    }

    #[test]
    fn a_file_that_is_cut_keeps_its_whole_frames() {
        for magic in [Magic::Xtc1995, Magic::Xtc2023] {
            let bytes = file(&[molly_frame(1, 30, 4.0, 1000.0), molly_frame(2, 30, 4.0, 1000.0)], magic);
            let first = index(Path::new("test"), &bytes, &Options::default()).unwrap().frames[0]
                .bytes
                .unwrap() as usize;
            for length in first + 1..bytes.len() {
                let index = index(Path::new("test"), &bytes[..length], &Options::default()).unwrap();
                assert_eq!((index.frames.len(), index.cut), (1, true), "{length}");
            }
        }
    }

    #[test]
    fn hostile_counts_and_damage_are_refused_or_read_without_panic() {
        let bytes = file(&[molly_frame(1, 30, 4.0, 1000.0)], Magic::Xtc1995);
        let mut huge = bytes.clone();
        for place in [4, 52] {
            huge[place..][..4].fill(0xff);
        }
        let message = real_data::open(&huge).unwrap_err().to_string();
        assert!(message.contains("do not fit"), "{message}");
        let open = &real_data::recognised(&bytes).open;
        for bytes in
            [bytes, file(&[molly_frame(3, 12, 3000.0, 1000.0), molly_frame(0, 2, 1.0, 1.0)], Magic::Xtc2023)]
        {
            real_data::damage(&bytes, |file| drop(real_data::frames(open, file, &Options::default())));
        }
    }
}
