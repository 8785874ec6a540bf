//! E57 (ASTM E2807), the exchange format of laser scanners: all scans of a file, each brought to its place by its pose.
//!
//! The crate e57, pure Rust, reads the pages and the packed points. Points that are marked as invalid have no place: they are
//! dropped and counted with those that are NaN. Images are left out.

use std::io::Cursor;
use std::path::Path;

use ::e57::{CartesianCoordinate, E57Reader};
use tyndall::particles::{Attribute, Columns, Positions, Values};
use tyndall::scene::wanted::{Offered, Wanted};
use tyndall::{DVec3, Error, Progress, Result};

use super::{content, records};
use crate::sequence::Frame;

/// Points that are read between two looks at the progress.
const BATCH: usize = 1 << 14;
/// More points than this are not in a byte: a point that takes no bits at all is damage.
const MOST_POINTS: u64 = 64;

/// So many packets after each other may hold no whole point.
const MOST_EMPTY: u32 = 1 << 10;

/// Whether the file begins like E57.
pub(crate) fn recognise(head: &[u8]) -> bool {
    head.starts_with(b"ASTM-E57")
}

/// Reads the points of all scans.
pub(crate) fn read(
    path: &Path,
    bytes: &[u8],
    wanted: Option<&Wanted>,
    progress: &dyn Progress,
) -> Result<Frame> {
    progress.begin("read", Some(bytes.len() as u64), "B");
    let fault =
        |error: ::e57::Error| Error::format(path, "", error.to_string(), "was the file copied to its end?");
    let mut file = E57Reader::new(Cursor::new(content::kept(path, bytes))).map_err(fault)?;
    let scans = file.pointclouds();
    let total: u64 = scans.iter().fold(0, |sum, scan| sum.saturating_add(scan.records));
    if total > (bytes.len() as u64).saturating_mul(MOST_POINTS) {
        let what = format!("{total} points are promised in a file of {} bytes", bytes.len());
        return Err(Error::format(path, "", what, "was the file copied to its end?"));
    }
    let mut has_color = scans.iter().any(|it| it.has_color());
    let mut has_intensity = scans.iter().any(|it| it.has_intensity());
    let mut has_scan = scans.len() > 1;
    if let Some(wanted) = wanted {
        let all = [has_color, has_color, has_color, has_intensity, has_scan];
        let offered = ["red", "green", "blue", "intensity", "scan"].into_iter().zip(all);
        let offered = offered.filter(|it| it.1).map(|(name, _)| Offered {
            name,
            components: 1,
            is_measured: name == "intensity",
        });
        let offered: Vec<Offered> = offered.collect();
        let flags = wanted.flags(&offered);
        let is_wanted =
            |names: &[&str]| offered.iter().zip(&flags).any(|(it, flag)| *flag && names.contains(&it.name));
        has_color = is_wanted(&["red", "green", "blue"]);
        (has_intensity, has_scan) = (is_wanted(&["intensity"]), is_wanted(&["scan"]));
    }
    let posed = scans.iter().any(|it| it.transform.is_some());

    let mut positions = Positions::new();
    let (mut colors, mut intensities, mut scan_numbers) = ([vec![], vec![], vec![]], Vec::new(), Vec::new());
    let mut chunk = Vec::with_capacity(BATCH);
    let mut left_out = 0u64;
    for (number, scan) in scans.iter().enumerate() {
        if !scan.has_cartesian() && !scan.has_spherical() {
            left_out += scan.records;
            continue;
        }
        let mut points = file.pointcloud_simple(scan).map_err(fault)?;
        points.normalize_intensity(false);
        points.intensity_to_color(false);
        let mut empty = 0;
        for point in points {
            let point = match point {
                // A packet may end before a point does: then the next one has the rest.
                Err(::e57::Error::Internal { .. }) if empty < MOST_EMPTY => {
                    empty += 1;
                    continue;
                }
                point => point.map_err(fault)?,
            };
            empty = 0;
            chunk.push(match point.cartesian {
                CartesianCoordinate::Valid { x, y, z } => DVec3::new(x, y, z),
                CartesianCoordinate::Direction { .. } | CartesianCoordinate::Invalid => DVec3::NAN,
            });
            if has_color {
                let color = point.color.map_or([0.0; 3], |it| [it.red, it.green, it.blue]);
                for (column, value) in colors.iter_mut().zip(color) {
                    column.push((255.0 * value.clamp(0.0, 1.0)).round() as u8);
                }
            }
            if has_intensity {
                intensities.push(point.intensity.unwrap_or(f32::NAN));
            }
            if has_scan {
                scan_numbers.push(number as i32);
            }
            if chunk.len() == BATCH {
                if progress.cancelled() {
                    return Err(Error::Interrupted);
                }
                positions.extend(&chunk);
                progress.advance(bytes.len() as u64 * BATCH as u64 / total.max(1));
                chunk.clear();
            }
        }
    }
    positions.extend(&chunk);
    if positions.len() as u64 + left_out != total {
        let what = format!("the file promises {total} points and ends after {}", positions.len());
        return Err(Error::format(path, "", what, "was the file copied to its end?"));
    }

    let mut attributes = Vec::new();
    if has_intensity {
        attributes.push(Attribute::new("intensity", 1, Values::F32(intensities)));
    }
    if has_color {
        let names = ["red", "green", "blue"].into_iter().zip(colors);
        attributes.extend(names.map(|(name, values)| Attribute::new(name, 1, Values::U8(values))));
    }
    if has_scan {
        attributes.push(Attribute::new("scan", 1, Values::I32(scan_numbers)));
    }
    let mut conventions = Vec::new();
    if posed {
        conventions.push("each scan is brought to its place by its pose".to_string());
    }
    if has_color {
        conventions.push("colors are scaled to 0..255 from the limits that the file gives".to_string());
    }
    let mut warnings = Vec::new();
    if left_out > 0 {
        warnings.push(format!("left out: {left_out} points of scans without coordinates"));
    }
    if !file.images().is_empty() {
        warnings.push(format!("left out: {} images", file.images().len()));
    }
    let length_unit = Some("m".to_string());
    records::frame(
        Columns { positions, attributes, length_unit, ..Columns::default() },
        conventions,
        warnings,
    )
}

#[cfg(test)]
mod tests {
    use ::e57::{
        E57Writer, Quaternion, Record, RecordDataType, RecordName, RecordValue, Transform, Translation,
    };

    use super::*;
    use crate::read::real_data;

    /// Scans of so many points each, in the place x = id, y = scan; the second scan and later ones are moved by 10 along z.
    fn scans(counts: &[usize]) -> Vec<u8> {
        let mut file = Cursor::new(Vec::new());
        let mut writer = E57Writer::new(&mut file, "file").unwrap();
        for (scan, &count) in counts.iter().enumerate() {
            let byte = RecordDataType::Integer { min: 0, max: 255 };
            let prototype = vec![
                Record::CARTESIAN_X_F64,
                Record::CARTESIAN_Y_F64,
                Record::CARTESIAN_Z_F64,
                Record {
                    name: RecordName::CartesianInvalidState,
                    data_type: RecordDataType::Integer { min: 0, max: 2 },
                },
                Record { name: RecordName::ColorRed, data_type: byte.clone() },
                Record { name: RecordName::ColorGreen, data_type: byte.clone() },
                Record { name: RecordName::ColorBlue, data_type: byte },
            ];
            let mut points = writer.add_pointcloud("scan", prototype).unwrap();
            if scan > 0 {
                points.set_transform(Some(Transform {
                    rotation: Quaternion { w: 1.0, x: 0.0, y: 0.0, z: 0.0 },
                    translation: Translation { x: 0.0, y: 0.0, z: 10.0 },
                }));
            }
            for id in 0..count {
                let float = RecordValue::Double;
                points
                    .add_point(vec![
                        float(id as f64),
                        float(scan as f64),
                        float(0.0),
                        RecordValue::Integer(if id == 1 { 2 } else { 0 }),
                        RecordValue::Integer(id as i64),
                        RecordValue::Integer(255),
                        RecordValue::Integer(0),
                    ])
                    .unwrap();
            }
            points.finalize().unwrap();
        }
        writer.finalize().unwrap();
        drop(writer);
        file.into_inner()
    }

    fn read(bytes: &[u8]) -> Result<Frame> {
        super::read(Path::new("no such file"), bytes, None, &())
    }

    #[test]
    fn scans_are_joined_at_their_places() {
        let bytes = scans(&[3, 2]);
        assert!(recognise(&bytes));
        let frame = read(&bytes).unwrap();
        let particles = &frame.particles;
        // The second point of each scan is invalid.
        assert_eq!((particles.len(), particles.dropped().position), (3, 2));
        assert_eq!(particles.positions().world(1).to_array(), [2.0, 0.0, 0.0]);
        assert_eq!(particles.positions().world(2).to_array(), [0.0, 1.0, 10.0]);
        assert_eq!(particles.attribute("red").unwrap().values, Values::U8(vec![0, 2, 0]));
        assert_eq!(particles.attribute("green").unwrap().values, Values::U8(vec![255; 3]));
        assert_eq!(particles.attribute("scan").unwrap().values, Values::I32(vec![0, 0, 1]));
        assert!(particles.attribute("intensity").is_none() && frame.conventions[0].contains("pose"));
    }

    #[test]
    fn none_and_one_point_are_fine() {
        assert_eq!(read(&scans(&[])).unwrap().particles.len(), 0);
        assert_eq!(read(&scans(&[1])).unwrap().particles.len(), 1);
    }

    #[test]
    fn a_cut_file_is_refused_and_damage_never_panics() {
        let bytes = scans(&[40]);
        assert!(read(&bytes[..bytes.len() - 1]).is_err());
        real_data::damage_some(&bytes, |file| drop(read(file)));
    }
}
