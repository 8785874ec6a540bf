//! RenderMan's point clouds, PTC, as partio writes them.
//!
//! Takes the whole file, gives radius, normal (unpacked from two angles; zero where there is none) and the variables as attributes.
//! Little-endian: a header, a line for each variable, then for each point x y z, the normal's two 16-bit numbers, the radius and the
//! variables, all 32-bit floats. Source: partio (Disney, BSD), PTC.cpp.

use std::f32::consts::TAU;
use std::path::Path;

use rayon::prelude::*;
use tyndall::particles::{Attribute, Values};
use tyndall::scene::wanted::Wanted;
use tyndall::{Progress, Result};

use super::cursor::Cursor;
use super::numbers::{Kind, Order};
use super::records::{self, Field, Layout, Source};
use crate::sequence::Frame;

/// Bytes of a point before the angles of its normal.
const ANGLES: usize = 12;
const HINT: &str = "the file is cut off or damaged: copy it again or write it again";

/// Whether the file begins like one.
pub(crate) fn recognise(head: &[u8]) -> bool {
    head.starts_with(b"pptc")
}

/// Reads the points.
pub(crate) fn read(
    path: &Path,
    bytes: &[u8],
    wanted: Option<&Wanted>,
    progress: &dyn Progress,
) -> Result<Frame> {
    progress.begin("read", Some(bytes.len() as u64), "B");
    let mut cursor = Cursor::new(path, bytes, 0, Order::Little, HINT);
    cursor.take(4, "the magic word")?;
    let version: u32 = cursor.number("the version")?;
    if version > 2 {
        return Err(cursor.fault(format!("version 0 to 2 was wanted, {version} was found")));
    }
    let count: f64 = cursor.number("how many points")?;
    if !(0.0..1e15).contains(&count) || count.fract() != 0.0 {
        return Err(cursor.fault(format!("a count of points was wanted, {count} was found")));
    }
    cursor.take(6 * 4, "the bounds")?;
    // What later versions have besides is not public.
    let besides = [0, 4, 4 + 33][version as usize];
    cursor.take(4 * besides, "numbers of this version")?;
    cursor.take((16 + 16 + 3) * 4, "the camera")?;
    let [variables, values]: [u32; 2] = [cursor.number("how many variables")?, cursor.number("their size")?];
    let definitions = (0..variables).map(|_| variable(&mut cursor)).collect::<Result<Vec<_>>>()?;
    let found: usize = definitions.iter().map(|(_, components)| components).sum();
    if found != values as usize {
        return Err(
            cursor.fault(format!("variables of {values} numbers were wanted, their types have {found}"))
        );
    }
    if version > 0 {
        cursor.take(8, "numbers of this version")?;
    }

    let (points, stride) = (&bytes[cursor.place()..], 20 + 4 * found);
    let count = count as usize;
    if count.checked_mul(stride).is_none_or(|needed| needed > points.len()) {
        return Err(records::truncated(path, count as u64, stride, points.len()));
    }
    let source = |kind: Kind, start| Source {
        bytes: points,
        kind,
        order: Order::Little,
        start,
        stride,
        step: kind.size(),
    };
    // The normal is no field of its own, but what two numbers mean.
    let mut fields = vec![
        Field { name: "normal".into(), components: 3, source: source(Kind::F32, ANGLES) },
        Field { name: "radius".into(), components: 1, source: source(Kind::F32, 16) },
    ];
    let mut start = 20;
    for (name, components) in definitions {
        fields.push(Field { name, components, source: source(Kind::F32, start) });
        start += 4 * components;
    }
    let mut fields = records::wanted_fields(fields, wanted);
    let has_normal = fields.first().is_some_and(|it| it.source.start == ANGLES);
    fields.retain(|it| it.source.start != ANGLES);
    let axes = [0, 1, 2].map(|axis| Some(source(Kind::F32, 4 * axis)));
    let mut columns = Layout { count, axes, fields }.gather(path, bytes.len(), progress)?.into_columns();
    if has_normal {
        let angles = source(Kind::U16, ANGLES);
        let mut normals = vec![0.0; 3 * count];
        let rows = normals.par_chunks_exact_mut(3).enumerate().with_min_len(1 << 12);
        rows.for_each(|(id, out)| {
            out.copy_from_slice(&normal([0, 1].map(|part| angles.component(part).number(id) as u16)));
        });
        columns.attributes.insert(0, Attribute::new("normal", 3, Values::F32(normals)));
    }
    records::frame(columns, vec![], vec![])
}

/// The unit vector that two numbers mean; zero for the largest.
fn normal([angle, height]: [u16; 2]) -> [f32; 3] {
    if angle == u16::MAX && height == u16::MAX {
        return [0.0; 3];
    }
    let [angle, height] = [angle, height].map(|it| f32::from(it) / 65535.0);
    let (angle, z) = (TAU * (angle - 0.5), 2.0 * height - 1.0);
    let radius = (1.0 - z * z).max(0.0).sqrt();
    [radius * angle.sin(), radius * angle.cos(), z]
}

/// A variable: `color velocity`.
fn variable(cursor: &mut Cursor) -> Result<(String, usize)> {
    let mut line = Vec::new();
    loop {
        match cursor.number("a variable")? {
            b'\n' => break,
            byte => line.push(byte),
        }
    }
    let line = String::from_utf8_lossy(&line).trim().to_string();
    let (kind, name) = line.split_once(' ').unwrap_or((line.as_str(), ""));
    let components = match kind {
        "float" => 1,
        "point" | "vector" | "normal" | "color" => 3,
        "matrix" => 16,
        _ => {
            return Err(cursor.fault(format!("a variable such as 'color Cs' was wanted, '{line}' was found")));
        }
    };
    Ok((name.trim().to_string(), components))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::real_data;

    fn file(version: u32, count: f64) -> Vec<u8> {
        let mut bytes = b"pptc".to_vec();
        bytes.extend(version.to_le_bytes());
        bytes.extend(count.to_le_bytes());
        bytes.extend(vec![0; 24 + 4 * [0, 4, 37][version as usize] + 35 * 4]);
        bytes.extend([2u32, 4].iter().flat_map(|it| it.to_le_bytes()));
        bytes.extend(b"color Cs\nfloat  area\n");
        bytes.extend(vec![0; if version > 0 { 8 } else { 0 }]);
        for (id, angles) in [[65535, 65535], [32768, 32768], [0, 65535]].iter().enumerate() {
            bytes.extend([id as f32, 1.0, 2.0].iter().flat_map(|it| it.to_le_bytes()));
            bytes.extend(angles.iter().flat_map(|it: &u16| it.to_le_bytes()));
            bytes.extend([0.5 + id as f32, 0.1, 0.2, 0.3, 4.0].iter().flat_map(|it: &f32| it.to_le_bytes()));
        }
        bytes
    }

    #[test]
    fn points_of_all_versions_have_radius_normal_and_variables() {
        for version in 0..3 {
            let particles = read(Path::new("test"), &file(version, 3.0), None, &()).unwrap().particles;
            assert_eq!(particles.positions().world(2).to_array(), [2.0, 1.0, 2.0]);
            let number =
                |name: &str, id: usize, part: usize| particles.attribute(name).unwrap().number(id, part);
            assert_eq!(
                (number("radius", 2, 0), number("Cs", 1, 2), number("area", 0, 0)),
                (2.5, f64::from(0.3f32), 4.0)
            );
            assert_eq!([0, 1, 2].map(|part| number("normal", 0, part)), [0.0; 3]);
            assert!((number("normal", 1, 1) - 1.0).abs() < 1e-4 && number("normal", 2, 2) == 1.0);
        }
    }

    #[test]
    fn a_file_cut_anywhere_is_refused_and_damage_never_panics() {
        let bytes = file(1, 3.0);
        for length in 0..bytes.len() {
            assert!(read(Path::new("test"), &bytes[..length], None, &()).is_err(), "{length}");
        }
        for count in [f64::NAN, -1.0, 0.5, 1e14, 1e300] {
            assert!(read(Path::new("test"), &file(0, count), None, &()).is_err(), "{count}");
        }
        assert_eq!(read(Path::new("test"), &file(0, 0.0), None, &()).unwrap().particles.len(), 0);
        real_data::damage(&bytes, |file| drop(read(Path::new("test"), file, None, &())));
    }

    #[test]
    fn a_real_file_is_read_as_partio_reads_it() {
        real_data::compare("partio/fluid50.ptc", recognise, |path, bytes, progress| {
            read(path, bytes, None, progress)
        });
    }
}
