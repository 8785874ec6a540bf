//! DCD: coordinates of CHARMM, NAMD, X-PLOR, LAMMPS, OpenMM and others, frame after frame.
//!
//! Fortran records, each between two marks of its size, of 4 or 8 bytes and in either order: both are told by the first, which is
//! 84. A frame is a record for the cell, where there is one, and one each for x, y, z (and a fourth coordinate, left out). Where
//! atoms are fixed, frames after the first have the free ones only. The six numbers of the cell are read by what makes sense: see
//! [`unit_cell`]. Lengths are Å. Sources: NAMD's and VMD's dcdplugin (its layout), CHARMM's documentation of `traj`.

use std::path::Path;

use rayon::prelude::*;
use tyndall::{Cell, Columns, DVec3, Progress, Result};

use super::cursor::Cursor;
use super::numbers::{Kind, Number, Order};
use super::records::{self, Layout, Source};
use super::{Index, Request, Span, finish, molecules};
use crate::sequence::{Frame, Options};

const HINT: &str = "check that it was written and copied to its end, or convert it again";

/// Whether the file begins like DCD.
pub(crate) fn recognise(head: &[u8]) -> bool {
    Style::of(head).is_some_and(|style| {
        let at = style.mark_bytes;
        head.get(at..at + 4).is_some_and(|it| it == b"CORD" || it == b"VELD")
    })
}

/// How records are written.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Style {
    mark_bytes: usize,
    order: Order,
}

impl Style {
    fn of(head: &[u8]) -> Option<Self> {
        let styles: [(&[u8], usize, Order); 4] = [
            (&84u64.to_le_bytes(), 8, Order::Little),
            (&84u64.to_be_bytes(), 8, Order::Big),
            (&84u32.to_le_bytes(), 4, Order::Little),
            (&84u32.to_be_bytes(), 4, Order::Big),
        ];
        let style = styles.iter().find(|(mark, ..)| head.starts_with(mark));
        style.map(|&(_, mark_bytes, order)| Self { mark_bytes, order })
    }

    fn mark(self, cursor: &mut Cursor) -> Result<u64> {
        let what = "the size of a record";
        if self.mark_bytes == 8 { cursor.number(what) } else { cursor.number::<u32>(what).map(u64::from) }
    }

    /// A record: the place of its bytes and how many there are.
    fn record(self, cursor: &mut Cursor) -> Result<(usize, usize)> {
        let bytes = self.mark(cursor)?;
        let start = cursor.place();
        cursor.skip(bytes, "a record")?;
        let again = self.mark(cursor)?;
        if again != bytes {
            return Err(cursor.fault(format!("a record of {bytes} bytes ends as one of {again}")));
        }
        Ok((start, bytes as usize))
    }

    /// A record that has to have so many bytes.
    fn sized(self, cursor: &mut Cursor, wanted: u64, what: &str) -> Result<usize> {
        let place = cursor.place();
        let (start, bytes) = self.record(cursor)?;
        if bytes as u64 != wanted {
            let what =
                format!("{what} (record at byte {place}): {wanted} bytes were wanted, {bytes} are there");
            return Err(cursor.fault(what));
        }
        Ok(start)
    }
}

/// What stands before the frames.
#[derive(Debug)]
struct Header {
    style: Style,
    /// How many frames there should be; 0 if the writer did not know.
    frames: u64,
    first_step: i32,
    steps_between: i32,
    has_cell: bool,
    has_fourth: bool,
    count: u64,
    /// Of the atoms that move, where some do not: their places.
    free: Option<Vec<usize>>,
    /// Where the first frame begins.
    end: usize,
}

impl Header {
    fn read(path: &Path, bytes: &[u8]) -> Result<Self> {
        let cursor = &mut Cursor::new(path, bytes, 0, Order::Little, HINT);
        let style = Style::of(bytes).ok_or_else(|| cursor.fault("a first record of 84 bytes was wanted"))?;
        cursor.order = style.order;
        let start = style.sized(cursor, 84, "the header")?;
        let mut header = Cursor::new(path, bytes, start, style.order, HINT);
        if header.take(4, "the magic word")? == b"VELD" {
            return Err(header.fault("this DCD holds velocities, no coordinates"));
        }
        let mut control = [0i32; 20];
        for number in &mut control {
            *number = header.number("the header")?;
        }
        // X-PLOR leaves the last one 0, and has none of CHARMM's additions.
        let charmm = control[19] != 0;
        style.record(cursor)?; // Titles.
        let start = style.sized(cursor, 4, "the number of atoms")?;
        let count = i32_at(bytes, start, style.order);
        let count = u64::try_from(count).map_err(|_| cursor.fault(format!("{count} atoms")))?;
        let fixed = u64::try_from(control[8]).unwrap_or(0);
        let mut free = None;
        if fixed > 0 {
            let moving = count.saturating_sub(fixed);
            let start = style.sized(cursor, 4 * moving, "which atoms are free")?;
            let place = |k: usize| i64::from(i32_at(bytes, start + 4 * k, style.order)) - 1;
            let places: Vec<i64> = (0..moving as usize).map(place).collect();
            let valid: Option<Vec<usize>> =
                places.iter().map(|&it| usize::try_from(it).ok().filter(|&it| (it as u64) < count)).collect();
            free = Some(
                valid.ok_or_else(|| cursor.fault(format!("free atoms beyond the {count} that there are")))?,
            );
        }
        Ok(Self {
            style,
            frames: u64::try_from(control[0]).unwrap_or(0),
            first_step: control[1],
            steps_between: control[2],
            has_cell: charmm && control[10] != 0,
            has_fourth: charmm && control[11] != 0,
            count,
            free,
            end: cursor.place(),
        })
    }

    /// How many atoms a frame has that is not the first.
    fn moving(&self) -> u64 {
        self.free.as_ref().map_or(self.count, |free| free.len() as u64)
    }

    /// The records of the frame at `cursor`: the cell, and the three axes.
    fn frame(&self, cursor: &mut Cursor, is_first: bool) -> Result<(Option<usize>, [usize; 3])> {
        let style = self.style;
        let cell = if self.has_cell { Some(style.sized(cursor, 48, "the cell")?) } else { None };
        let bytes = 4 * if is_first { self.count } else { self.moving() };
        let mut axes = [0; 3];
        for (axis, what) in axes.iter_mut().zip(["x", "y", "z"]) {
            *axis = style.sized(cursor, bytes, what)?;
        }
        if self.has_fourth {
            style.record(cursor)?;
        }
        Ok((cell, axes))
    }
}

fn i32_at(bytes: &[u8], start: usize, order: Order) -> i32 {
    match order {
        Order::Little => i32::from_bytes::<false>(&bytes[start..start + 4]),
        Order::Big => i32::from_bytes::<true>(&bytes[start..start + 4]),
    }
}

/// Finds the frames.
pub(crate) fn index(path: &Path, bytes: &[u8], _: &Options) -> Result<Index> {
    let header = Header::read(path, bytes)?;
    let mut index = Index::default();
    let mut cursor = Cursor::new(path, bytes, header.end, header.style.order, HINT);
    while cursor.left() > 0 {
        let offset = cursor.place();
        let is_first = index.frames.is_empty();
        if let Err(error) = header.frame(&mut cursor, is_first) {
            index.cut = cursor.ended();
            if index.cut { break } else { return Err(error) }
        }
        let bytes = Some((cursor.place() - offset) as u64);
        index.frames.push(Span { offset: offset as u64, line: index.frames.len() as u64 + 1, bytes });
        // A frame of no atoms and no cell takes no end.
        if header.count == 0 && index.frames.len() as u64 >= header.frames.max(1) {
            break;
        }
    }
    // A file may end between two frames, before those that its header promises.
    index.cut |= (index.frames.len() as u64) < header.frames;
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
    let header = Header::read(path, bytes)?;
    let order = header.style.order;
    let at = |place: usize| Cursor::new(path, bytes, place, order, HINT);
    let is_first = span.line == 1;
    let (cell, axes) = header.frame(&mut at(span.offset as usize), is_first)?;

    let mut conventions = vec!["lengths: Å (DCD convention); time: step".to_string()];
    let mut warnings = Vec::new();
    let mut found = None;
    if let Some(start) = cell {
        let mut numbers = [0.0; 6];
        let mut cursor = at(start);
        for number in &mut numbers {
            *number = cursor.number("the cell")?;
        }
        let (cell, convention) = unit_cell(numbers);
        conventions.extend(cell.is_some().then(|| convention.to_string()));
        found = cell;
    }
    let column = |start: usize| Source { bytes, kind: Kind::F32, order, start, stride: 4, step: 4 };
    let columns = axes.map(column);
    let vector = |columns: &[Source; 3], place: usize| DVec3::from_array(columns.map(|it| it.number(place)));
    let count = header.count as usize;
    let positions = match header.free.as_ref().filter(|_| !is_first) {
        None => {
            let axes = columns.map(Some);
            let total = span.bytes.unwrap_or_default() as usize;
            Layout { count, axes, fields: vec![] }.gather(path, total, progress)?.into_columns().positions
        }
        Some(free) => {
            // Those that are fixed are where they were in the first frame.
            let (_, first) = header.frame(&mut at(header.end), true)?;
            let first = first.map(column);
            let mut all: Vec<DVec3> = (0..count).into_par_iter().map(|id| vector(&first, id)).collect();
            for (place, &id) in free.iter().enumerate() {
                all[id] = vector(&columns, place);
            }
            progress.advance(span.bytes.unwrap_or_default());
            records::positions(count, None, |id| all[id])
        }
    };
    if header.has_fourth {
        warnings.push("left out: the fourth coordinate of every atom".to_string());
    }
    let step = i64::from(header.first_step) + (span.line as i64 - 1) * i64::from(header.steps_between);
    let mut columns = Columns {
        positions,
        cell: found,
        time: Some(step as f64),
        time_unit: Some("step".to_string()),
        length_unit: Some("Å".to_string()),
        ..Columns::default()
    };
    request.complete(&mut columns, path, span, &mut conventions)?;
    finish(columns, conventions, warnings)
}

/// The cell of the six numbers that a frame has, and how they were understood.
///
/// A, gamma, B, beta, alpha, C: the angles are cosines if all are within -1 and 1 (CHARMM, NAMD since 2.5), else degrees. Where these make
/// no sense, because one is negative or above 180, the numbers are the lower triangle of CHARMM's symmetric matrix since version 25:
/// xx, xy, yy, xz, yz, zz.
fn unit_cell(numbers: [f64; 6]) -> (Option<Cell>, &'static str) {
    let [a, gamma, b, beta, alpha, c] = numbers;
    let angles = [alpha, beta, gamma];
    if angles.iter().all(|it| it.abs() <= 1.0) {
        // Rounded cosines of right angles are small, but no zeros.
        let degrees = angles.map(|it| 90.0 - it.asin().to_degrees());
        return (molecules::cell_of_angles([a, b, c], degrees), "cell: lengths and cosines of angles");
    }
    if angles.iter().all(|it| (0.0..=180.0).contains(it)) {
        return (molecules::cell_of_angles([a, b, c], angles), "cell: lengths and angles in degrees");
    }
    let [xx, xy, yy, xz, yz, zz] = numbers;
    let rows = [DVec3::new(xx, xy, xz), DVec3::new(xy, yy, yz), DVec3::new(xz, yz, zz)];
    (molecules::cell(rows), "cell: symmetric matrix")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::real_data;

    /// Writes a file: records in any style.
    struct Writer {
        style: Style,
        file: Vec<u8>,
    }

    impl Writer {
        fn bytes(&self, little: &[u8]) -> Vec<u8> {
            match self.style.order {
                Order::Little => little.to_vec(),
                Order::Big => little.iter().rev().copied().collect(),
            }
        }

        fn record(&mut self, content: Vec<u8>) {
            let mark = match self.style.mark_bytes {
                8 => self.bytes(&(content.len() as u64).to_le_bytes()),
                _ => self.bytes(&(content.len() as u32).to_le_bytes()),
            };
            self.file.extend([&mark[..], &content, &mark].concat());
        }

        fn integers(&self, numbers: &[i32]) -> Vec<u8> {
            numbers.iter().flat_map(|it| self.bytes(&it.to_le_bytes())).collect()
        }
    }

    const ALL: [Style; 4] = [
        Style { mark_bytes: 4, order: Order::Little },
        Style { mark_bytes: 4, order: Order::Big },
        Style { mark_bytes: 8, order: Order::Little },
        Style { mark_bytes: 8, order: Order::Big },
    ];

    /// Three frames of so many atoms, the first of which are fixed; numbers tell frame, axis and atom.
    fn sample(
        style: Style,
        count: usize,
        fixed: usize,
        cell: Option<[f64; 6]>,
        charmm: bool,
        fourth: bool,
    ) -> Vec<u8> {
        let mut writer = Writer { style, file: vec![] };
        let mut control = [0; 20];
        control[..3].copy_from_slice(&[3, 100, 50]);
        control[8] = fixed as i32;
        [control[10], control[11], control[19]] =
            [cell.is_some().into(), fourth.into(), if charmm { 24 } else { 0 }];
        writer.record([b"CORD".to_vec(), writer.integers(&control)].concat());
        writer.record([writer.integers(&[1]), vec![b' '; 80]].concat());
        writer.record(writer.integers(&[count as i32]));
        if fixed > 0 {
            writer.record(writer.integers(&(fixed as i32 + 1..=count as i32).collect::<Vec<_>>()));
        }
        for frame in 0..3 {
            if let Some(cell) = cell {
                writer.record(cell.iter().flat_map(|it| writer.bytes(&it.to_le_bytes())).collect());
            }
            let first = if frame == 0 { 0 } else { fixed };
            for axis in 0..if fourth { 4 } else { 3 } {
                let value = |atom: usize| (100 * frame + 10 * axis + atom) as f32 + 0.5;
                writer.record(
                    (first..count).flat_map(|atom| writer.bytes(&value(atom).to_le_bytes())).collect(),
                );
            }
        }
        writer.file
    }

    #[test]
    fn all_styles_are_read_and_fixed_atoms_stay() {
        for style in ALL {
            let frames = real_data::open(&sample(style, 4, 0, None, false, false)).unwrap();
            assert_eq!(frames.len(), 3, "{style:?}");
            let particles = &frames[2].particles;
            assert_eq!(particles.positions().world(3), DVec3::new(203.5, 213.5, 223.5));
            assert_eq!(
                (particles.time(), particles.length_unit(), particles.cell()),
                (Some(200.0), Some("Å"), None)
            );
            let fixed =
                real_data::open(&sample(style, 4, 3, Some([9.0, 0.0, 9.0, 0.0, 0.0, 9.0]), true, true))
                    .unwrap();
            let positions = fixed[1].particles.positions();
            assert_eq!(positions.world(2), DVec3::new(2.5, 12.5, 22.5), "{style:?}");
            assert_eq!(positions.world(3), DVec3::new(103.5, 113.5, 123.5), "{style:?}");
            assert_eq!(fixed[1].warnings.len(), 1);
            assert_eq!(fixed[0].particles.cell().unwrap().vectors[1], 9.0 * DVec3::Y);
            for count in [0, 1] {
                let frames = real_data::open(&sample(style, count, 0, None, true, false)).unwrap();
                assert_eq!(frames[0].particles.len(), count);
            }
        }
    }

    #[test]
    fn cells_are_cosines_degrees_or_a_matrix() {
        let edges = |numbers| unit_cell(numbers).0.unwrap().vectors;
        let degrees = edges([2.0, 60.0, 3.0, 90.0, 90.0, 4.0]);
        let cosines = edges([2.0, 0.5, 3.0, 0.0, 0.0, 4.0]);
        for (one, other) in degrees.into_iter().zip(cosines) {
            assert!(one.abs_diff_eq(other, 1e-12), "{one} {other}");
        }
        assert!(degrees[1].abs_diff_eq(DVec3::new(1.5, 3.0 * 0.75f64.sqrt(), 0.0), 1e-12));
        assert_eq!(edges([5.0, -2.0, 6.0, 1.0, 1.5, 7.0])[1], DVec3::new(-2.0, 6.0, 1.5));
        assert_eq!(edges([5.0, 0.0, 6.0, 0.0, 0.0, 7.0])[2], 7.0 * DVec3::Z);
        assert!(unit_cell([0.0; 6]).0.is_none() && unit_cell([f64::NAN; 6]).0.is_none());
    }

    #[test]
    fn what_is_cut_damaged_or_no_coordinates_is_said() {
        let file = sample(ALL[1], 3, 1, None, true, false);
        let whole = index(Path::new("test"), &file, &Options::default()).unwrap();
        for length in whole.frames[1].offset as usize + 1..whole.frames[2].offset as usize {
            let index = index(Path::new("test"), &file[..length], &Options::default()).unwrap();
            assert_eq!((index.frames.len(), index.cut), (1, true), "{length}");
        }
        let index =
            index(Path::new("test"), &file[..whole.frames[2].offset as usize], &Options::default()).unwrap();
        assert_eq!((index.frames.len(), index.cut, whole.cut), (2, true, false), "the header promises three");
        let mut velocities = file.clone();
        velocities[4..8].copy_from_slice(b"VELD");
        assert!(real_data::open(&velocities).unwrap_err().to_string().contains("velocities"));
        for style in ALL {
            let file = sample(style, 3, 1, Some([9.0, 0.0, 9.0, 0.0, 0.0, 9.0]), true, false);
            let open = &real_data::recognised(&file).open;
            real_data::damage(&file, |file| drop(real_data::frames(open, file, &Options::default())));
        }
    }
}
