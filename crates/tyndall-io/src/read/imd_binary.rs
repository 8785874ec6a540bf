//! Configurations of IMD with binary atoms: the header of `imd.rs`, then a record an atom.
//!
//! A record has what `#F` tells: number, type, mass, coordinates, velocities, other data. With `b` (the highest byte first) and `l` (the lowest
//! first) these are 32-bit integers and floats; with `B` and `L` 64-bit floats behind number and type, two 32-bit integers that share the
//! first eight bytes. Nothing tells how many atoms there are. Source: IMD, write_atoms_config and read_atoms of imd_io_3d.c.

use std::path::Path;

use tyndall::{Progress, Result};

use super::column;
use super::feed::Feed;
use super::imd::{self, Header};
use super::numbers::{Kind, Order};
use super::records::{self, Field, Layout, Source};
use super::rows::Role;
use super::{Index, Request, Span};
use crate::sequence::{Frame, Options};

/// Whether the file begins with a line of the format, and has binary atoms.
pub(crate) fn recognise(head: &[u8]) -> bool {
    imd::form(head).is_some_and(|it| it != b'A')
}

/// Takes the header; gives also where the atoms begin.
fn header(path: &Path, bytes: &[u8]) -> Result<(Header, usize)> {
    let mut feed = Feed::over(path, bytes);
    let header = Header::read(&mut feed)?;
    if header.form == 'A' {
        return Err(feed.fault("the atoms are text (#F A)", "leave out --format, or say imd"));
    }
    let is_alone = header.headings.first().is_some_and(|it| it.name == "id")
        && header.headings.get(1).is_none_or(|it| it.name != "type");
    if "BL".contains(header.form) && is_alone {
        let what =
            format!("#F {} tells a number without a type: IMD writes both in eight bytes", header.form);
        return Err(feed.fault(what, "let the columns of #F be those of the records"));
    }
    let start = feed.offset() as usize;
    Ok((header, start))
}

/// A file is one frame.
pub(crate) fn index(path: &Path, bytes: &[u8], _: &Options) -> Result<Index> {
    header(path, bytes)?;
    Ok(Index { frames: vec![Span { offset: 0, line: 1, bytes: None }], ..Index::default() })
}

/// Reads the atoms.
pub(crate) fn frame(
    path: &Path,
    bytes: &[u8],
    _: Span,
    request: &Request,
    progress: &dyn Progress,
) -> Result<Frame> {
    progress.begin("read", Some(bytes.len() as u64), "B");
    let (header, start) = header(path, bytes)?;
    let atoms = &bytes[start..];
    let order = if "Bb".contains(header.form) { Order::Big } else { Order::Little };
    let (float, is_wide) = if "BL".contains(header.form) { (Kind::F64, true) } else { (Kind::F32, false) };
    let integers = header.headings.iter().filter(|it| it.kind == column::Kind::Integer).count();
    // Both integers, or none, are before the first wide float.
    let integer_bytes = if is_wide { 8 * integers.min(1) } else { 4 * integers };
    let record = integer_bytes + (header.roles.len() - integers) * float.size();
    let source = |place: usize| {
        let (kind, start) = match place.checked_sub(integers) {
            Some(place) => (float, integer_bytes + place * float.size()),
            None => (Kind::I32, integer_bytes - 4 * (integers - place)),
        };
        Source { bytes: atoms, kind, order, start, stride: record, step: kind.size() }
    };
    let place = |role: Role| header.roles.iter().position(|it| *it == role);
    let field = |(number, heading): (usize, &super::rows::Heading)| {
        let place = place(Role::Attribute(number)).expect("each heading has a column");
        Field { name: heading.name.clone(), components: heading.components, source: source(place) }
    };
    let fields = header.headings.iter().enumerate().map(field).collect();
    let layout = Layout {
        count: atoms.len() / record,
        axes: std::array::from_fn(|axis| place(Role::Axis(axis)).map(source)),
        fields: records::wanted_fields(fields, request.options.wanted.as_ref()),
    };
    let mut warnings = Vec::new();
    if !atoms.len().is_multiple_of(record) {
        warnings.push(format!(
            "the file ends within an atom, {} of whose {record} bytes are there: {} whole atoms are read",
            atoms.len() % record,
            layout.count
        ));
    }
    let mut columns = layout.gather(path, bytes.len(), progress)?.into_columns();
    columns.cell = header.cell();
    records::frame(columns, header.conventions(), warnings)
}

#[cfg(test)]
mod tests {
    use tyndall::{DVec3, Values};

    use super::*;
    use crate::read::real_data;

    const HEADER: &str =
        "#C number type mass x y z vx vy vz Epot\n#X 10 0 0\n#Y 1 10 0\n#Z 0 0 12\n## by imd\n#E\n";

    /// Atoms as IMD writes them: floats `1.5 id + place`.
    fn written(form: char, count: i32) -> Vec<u8> {
        let mut file = format!("#F {form} 1 1 1 3 3 1\n{HEADER}").into_bytes();
        let is_big = form.eq_ignore_ascii_case(&'b');
        let mut put = |bytes: &[u8]| {
            let reversed = bytes.iter().rev();
            if is_big { file.extend(reversed) } else { file.extend_from_slice(bytes) }
        };
        for id in 0..count {
            put(&(id + 1).to_le_bytes());
            put(&(id % 2).to_le_bytes());
            for place in 0..8 {
                let value = 1.5 * f64::from(id) + f64::from(place);
                if form.is_ascii_uppercase() {
                    put(&value.to_le_bytes())
                } else {
                    put(&(value as f32).to_le_bytes())
                }
            }
        }
        file
    }

    fn read(file: &[u8]) -> Result<Frame> {
        let (path, options) = (Path::new("a.imd"), Options::default());
        let request = Request { options: &options, bytes: None, units: None, topology: None, others: &() };
        let index = index(path, file, &options)?;
        frame(path, file, index.frames[0], &request, &())
    }

    #[test]
    fn all_forms_hold_the_same_atoms() {
        for form in ['b', 'l', 'B', 'L'] {
            let file = written(form, 5);
            assert!(recognise(&file) && !imd::recognise(&file));
            let frame = read(&file).unwrap();
            let particles = &frame.particles;
            assert_eq!((particles.len(), frame.warnings.len()), (5, 0), "{form}");
            assert_eq!(particles.positions().world(3), DVec3::new(5.5, 6.5, 7.5));
            assert_eq!(particles.attribute("id").unwrap().values, Values::I32((1..6).collect()));
            assert_eq!(particles.attribute("type").unwrap().values, Values::I32(vec![0, 1, 0, 1, 0]));
            assert_eq!(particles.attribute("mass").unwrap().number(4, 0), 6.0);
            assert_eq!(particles.attribute("velocity").unwrap().number(1, 2), 7.5);
            assert_eq!(particles.attribute("Epot").unwrap().number(0, 0), 7.0);
            assert_eq!(particles.cell().unwrap().vectors[1], DVec3::new(1.0, 10.0, 0.0));
        }
    }

    #[test]
    fn columns_that_are_not_there_have_no_bytes() {
        let body = |numbers: &[f64]| numbers.iter().flat_map(|it| it.to_le_bytes()).collect::<Vec<u8>>();
        let flat =
            [b"#F L 0 0 0 2 0 1\n#X 4 0\n#Y 0 5\n#E\n".to_vec(), body(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0])]
                .concat();
        let frame = read(&flat).unwrap();
        assert_eq!(frame.particles.positions().world(1), DVec3::new(4.0, 5.0, 0.0));
        assert_eq!(frame.particles.attribute("c3").unwrap().number(1, 0), 6.0);
        assert_eq!(frame.conventions, ["two-dimensional: z = 0"]);
        // A type alone still has the room of both.
        let pair = [7i32.to_le_bytes(), 2i32.to_le_bytes()].concat();
        let typed = [b"#F L 0 1 0 3 0 0\n#E\n".to_vec(), pair, body(&[1.0, 2.0, 3.0])].concat();
        let particles = read(&typed).unwrap().particles;
        assert_eq!(particles.attribute("type").unwrap().values, Values::I32(vec![2]));
        assert_eq!(particles.positions().world(0), DVec3::new(1.0, 2.0, 3.0));
        assert_eq!(read(b"#F l 1 1 0 3 0 0\n#E\n").unwrap().particles.len(), 0);
    }

    #[test]
    fn what_is_wrong_is_said() {
        let file = written('l', 3);
        let frame = read(&file[..file.len() - 1]).unwrap();
        assert_eq!(frame.particles.len(), 2);
        assert!(frame.warnings[0].contains("39 of whose 40 bytes"), "{:?}", frame.warnings);
        let message = |file: &[u8]| read(file).err().unwrap().to_string();
        assert!(message(b"#F B 1 0 0 3 0 0\n#E\n").contains("a number without a type"));
        assert!(message(b"#F A 1 0 0 3 0 0\n#E\n").contains("the atoms are text"));
        let end = HEADER.find("#X").unwrap() + "#F l 1 1 1 3 3 1\n".len();
        assert!(message(&file[..end]).contains("ends before #E"));
    }

    #[test]
    fn damage_never_panics() {
        for form in ['b', 'L'] {
            real_data::damage(&written(form, 3), |file| drop(read(file)));
        }
    }
}
