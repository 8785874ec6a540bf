//! Houdini's classic BGEO, version 5: what Houdini before 12 and partio write (`.bgeo`, `.bhclassic`).
//!
//! Takes the decompressed file, gives its points with their point attributes; primitives, groups and the attributes of vertices,
//! primitives and the whole are left out, said. All numbers are big-endian. A header of counts is followed by the definitions of
//! the point attributes, then for every point by x y z w and its attributes, 4 bytes each. Source: partio (Disney, BSD), BGEO.cpp.

use std::path::Path;

use rayon::prelude::*;
use tyndall::particles::{Attribute, Values};
use tyndall::scene::wanted::Wanted;
use tyndall::{Progress, Result};

use super::cursor::Cursor;
use super::numbers::{Kind, Order};
use super::records::{self, Field, Layout, Source};
use crate::sequence::Frame;

const HINT: &str = "if the file is not cut off, write it again as .bhclassic, which is version 5, with numbers and indexed strings only";

/// What is said of points whose fourth coordinate is not 1.
pub(super) const WEIGHTS_ARE_KEPT: &str =
    "the fourth coordinate is not 1 everywhere: kept as attribute Pw, positions not divided by it";

/// Whether the file begins like a classic BGEO.
pub(crate) fn recognise(head: &[u8]) -> bool {
    head.starts_with(b"BgeoV")
}

/// Reads the points.
pub(crate) fn read(
    path: &Path,
    bytes: &[u8],
    wanted: Option<&Wanted>,
    progress: &dyn Progress,
) -> Result<Frame> {
    progress.begin("read", Some(bytes.len() as u64), "B");
    let mut cursor = Cursor::new(path, bytes, 0, Order::Big, HINT);
    let header = Header::read(&mut cursor)?;
    let definitions =
        (0..header.point_attributes).map(|_| Definition::read(&mut cursor)).collect::<Result<Vec<_>>>()?;

    let values_per_point = 4 + definitions.iter().map(|it| it.components).sum::<usize>();
    let (points, stride) = (&bytes[cursor.place()..], 4 * values_per_point);
    let needed = (header.points as usize).checked_mul(stride);
    if needed.is_none_or(|needed| needed > points.len()) {
        return Err(records::truncated(path, header.points.into(), stride, points.len()));
    }
    let source =
        |kind, start| Source { bytes: points, kind, order: Order::Big, start: 4 * start, stride, step: 4 };
    let mut start = 4;
    let mut fields = Vec::new();
    for definition in &definitions {
        let (name, components) = (definition.name.clone(), definition.components);
        if components > 0 {
            fields.push(Field { name, components, source: source(definition.kind(), start) });
        }
        start += components;
    }
    let mut conventions = Vec::new();
    let weights = source(Kind::F32, 3);
    if (0..header.points as usize).into_par_iter().any(|id| weights.number(id) != 1.0) {
        conventions.push(WEIGHTS_ARE_KEPT.into());
        fields.push(Field { name: "Pw".into(), components: 1, source: weights });
    }

    let axes = [0, 1, 2].map(|axis| Some(source(Kind::F32, axis)));
    let fields = records::wanted_fields(fields, wanted);
    let layout = Layout { count: header.points as usize, axes, fields };
    let mut columns = layout.gather(path, bytes.len(), progress)?.into_columns();
    for Definition { name, components, names, .. } in definitions.into_iter().filter(|it| it.components > 0) {
        let is_its = |it: &&mut Attribute| it.name == name && it.components == components;
        if let (Some(names), Some(attribute)) = (names, columns.attributes.iter_mut().find(is_its)) {
            spell_out(attribute, names);
        }
    }
    records::frame(columns, conventions, left_out(header.primitives.into(), header.other_attributes))
}

/// The counts at the beginning of the file that matter here.
struct Header {
    points: u32,
    primitives: u32,
    point_attributes: u32,
    other_attributes: u64,
}

impl Header {
    fn read(cursor: &mut Cursor) -> Result<Self> {
        cursor.take(5, "the magic word")?;
        let version: u32 = cursor.number("the version")?;
        if version != 5 {
            return Err(cursor.fault(format!("version 5 was wanted, {version} was found")));
        }
        let mut counts = [0; 8];
        for count in &mut counts {
            *count = cursor.number("a count")?;
        }
        let [points, primitives, _, _, point_attributes, vertex, primitive, detail] = counts;
        let other_attributes = [vertex, primitive, detail].map(u64::from).iter().sum();
        Ok(Self { points, primitives, point_attributes, other_attributes })
    }
}

/// What of a geometry is not shown.
pub(super) fn left_out(primitives: u64, other_attributes: u64) -> Vec<String> {
    if primitives == 0 && other_attributes == 0 {
        return vec![];
    }
    vec![format!(
        "left out: {primitives} primitives and {other_attributes} attributes of vertices, primitives or the whole; only points are particles"
    )]
}

/// A point attribute: what stands in the file once.
struct Definition {
    name: String,
    components: usize,
    is_integer: bool,
    /// The words that the integers count, for an attribute of words.
    names: Option<Vec<String>>,
}

impl Definition {
    fn read(cursor: &mut Cursor) -> Result<Self> {
        let name = word(cursor)?;
        let components = usize::from(cursor.number::<u16>("how many components")?);
        let code: u32 = cursor.number("a type")?;
        let mut names = None;
        match code {
            0 | 1 | 5 => {
                cursor.take(4 * components, "a default value")?; // The default value, which no point needs.
            }
            4 => {
                let count: u32 = cursor.number("how many words")?;
                names = Some((0..count).map(|_| word(cursor)).collect::<Result<Vec<_>>>()?);
            }
            _ => {
                let what = format!(
                    "attribute '{name}' has type {code}; float 0, integer 1, index 4, vector 5 are known"
                );
                return Err(cursor.fault(what));
            }
        }
        Ok(Self { name, components, is_integer: code == 1 || code == 4, names })
    }

    fn kind(&self) -> Kind {
        if self.is_integer { Kind::I32 } else { Kind::F32 }
    }
}

/// Makes words of the integers of an attribute. One outside of the table means no word: the empty one.
pub(super) fn spell_out(attribute: &mut Attribute, mut names: Vec<String>) {
    let Values::I32(places) = &attribute.values else { return };
    let known = names.len();
    let is_known = |place: &i32| usize::try_from(*place).is_ok_and(|place| place < known);
    let none = match names.iter().position(String::is_empty) {
        Some(place) => place as u32,
        None => known as u32,
    };
    let codes: Vec<u32> =
        places.iter().map(|place| if is_known(place) { *place as u32 } else { none }).collect();
    if none as usize == known && codes.contains(&none) {
        names.push(String::new());
    }
    attribute.values = Values::Text { codes, names };
}

/// A word behind its length.
fn word(cursor: &mut Cursor) -> Result<String> {
    let length: u16 = cursor.number("the length of a word")?;
    cursor.text(length.into(), "a word")
}

#[cfg(test)]
mod tests {
    use tyndall::particles::Radii;

    use super::*;
    use crate::read::real_data;

    fn read(path: &Path, bytes: &[u8], progress: &dyn Progress) -> Result<Frame> {
        super::read(path, bytes, None, progress)
    }

    /// Writes a definition; words carry their table, all else zeros as default.
    fn define(file: &mut Vec<u8>, name: &str, components: u16, code: u32, words: &[&str]) {
        let string = |file: &mut Vec<u8>, text: &str| {
            file.extend((text.len() as u16).to_be_bytes());
            file.extend(text.as_bytes());
        };
        string(file, name);
        file.extend(components.to_be_bytes());
        file.extend(code.to_be_bytes());
        if code == 4 {
            file.extend((words.len() as u32).to_be_bytes());
            words.iter().for_each(|word| string(file, word));
        } else {
            file.extend(vec![0; 4 * usize::from(components)]);
        }
    }

    /// A file of `count` points with a radius, a color, a number and a word each.
    fn sample(count: u32) -> Vec<u8> {
        let mut file = b"BgeoV".to_vec();
        for number in [5, count, 0, 0, 0, 4, 0, 0, 0] {
            file.extend(u32::to_be_bytes(number));
        }
        define(&mut file, "pscale", 1, 0, &[]);
        define(&mut file, "Cd", 3, 5, &[]);
        define(&mut file, "id", 1, 1, &[]);
        define(&mut file, "kind", 1, 4, &["water", "air"]);
        for id in 0..count {
            let at = id as f32;
            for value in [at, 2.0 * at, -at, 1.0, 0.5 + at, 0.1, 0.2, 0.3] {
                file.extend(value.to_be_bytes());
            }
            file.extend((7 - id as i32).to_be_bytes());
            file.extend((id as i32 - 1).to_be_bytes());
        }
        file
    }

    #[test]
    fn points_keep_their_attributes() {
        let frame = read(Path::new("test"), &sample(4), &()).unwrap();
        let particles = &frame.particles;
        assert_eq!(particles.positions().world(3).to_array(), [3.0, 6.0, -3.0]);
        assert_eq!(particles.radii(), Some(&Radii::PerParticle { attribute: 0, scale: 1.0 }));
        let color = particles.attribute("Cd").unwrap();
        assert_eq!((color.components, color.number(2, 1)), (3, f64::from(0.2f32)));
        assert_eq!(particles.attribute("id").unwrap().values, Values::I32(vec![7, 6, 5, 4]));
        let names = ["water", "air", ""].map(String::from).to_vec();
        assert_eq!(
            particles.attribute("kind").unwrap().values,
            Values::Text { codes: vec![2, 0, 1, 2], names }
        );
        assert!(frame.conventions.is_empty() && frame.warnings.is_empty());
    }

    #[test]
    fn none_and_one_point_are_fine() {
        assert_eq!(read(Path::new("test"), &sample(0), &()).unwrap().particles.len(), 0);
        assert_eq!(read(Path::new("test"), &sample(1), &()).unwrap().particles.len(), 1);
    }

    #[test]
    fn weights_other_than_one_are_said() {
        let mut file = sample(2);
        let weight = file.len() - 7 * 4;
        file[weight..][..4].copy_from_slice(&2f32.to_be_bytes());
        let frame = read(Path::new("test"), &file, &()).unwrap();
        assert_eq!(frame.particles.attribute("Pw").unwrap().values, Values::F32(vec![1.0, 2.0]));
        assert_eq!(frame.conventions.len(), 1);
    }

    #[test]
    fn a_file_cut_anywhere_is_refused() {
        let file = sample(3);
        for length in 0..file.len() {
            assert!(read(Path::new("test"), &file[..length], &()).is_err(), "{length} bytes");
        }
        let message = read(Path::new("test"), &file[..file.len() - 1], &()).unwrap_err().to_string();
        assert!(
            message.contains("promises 3 particles of 40 bytes, 119 bytes are there: enough for 2"),
            "{message}"
        );
    }

    #[test]
    fn hostile_counts_are_refused() {
        for place in (9..41).step_by(4) {
            let mut file = sample(3);
            file[place..][..4].fill(0xff);
            let result = read(Path::new("test"), &file, &());
            assert!(result.is_err() || (13..25).contains(&place) || place >= 29, "count at {place}");
        }
    }

    #[test]
    fn damage_never_panics() {
        real_data::damage(&sample(3), |file| drop(read(Path::new("test"), file, &())));
    }

    #[test]
    fn real_files_are_read_as_partio_reads_them() {
        for name in [
            "ParticleData_Fluid_50",
            "dam_break_frame_23_24389_particles",
            "hilbert_46843_particles",
            "partio_base",
            "partio_scatter",
            "splish_bunny",
        ] {
            real_data::compare(&format!("houdini/{name}.bgeo"), recognise, read);
        }
    }
}
