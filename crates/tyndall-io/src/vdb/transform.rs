//! Where voxels lie: OpenVDB's maps along the axes.
//!
//! The middle of voxel (i, j, k), which is where its value belongs, lies at `translation + scale * (i, j, k)`. Programs whose voxels are
//! cells between whole numbers have half a voxel in the translation. Source: openvdb/math/Maps.h.

use tyndall::Result;

use super::file;
use crate::read::cursor::Cursor;

/// See the module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transform {
    /// Distances of voxels along x, y, z.
    pub scale: [f64; 3],
    /// Where voxel (0, 0, 0) is.
    pub translation: [f64; 3],
}

impl Transform {
    /// Where a voxel is.
    pub fn position(&self, voxel: [i32; 3]) -> [f64; 3] {
        std::array::from_fn(|axis| self.translation[axis] + self.scale[axis] * f64::from(voxel[axis]))
    }

    /// The bytes of a map of equal scales with a translation.
    pub(super) fn bytes(&self) -> Vec<u8> {
        let inverse = self.scale.map(|it| 1.0 / it);
        let square = inverse.map(|it| it * it);
        let half = inverse.map(|it| 0.5 * it);
        let parts = [self.translation, self.scale, self.scale.map(f64::abs), inverse, square, half];
        parts.as_flattened().iter().flat_map(|it| it.to_le_bytes()).collect()
    }
}

/// The name of the map that [`Transform::bytes`] writes.
pub(super) const WRITTEN: &str = "UniformScaleTranslateMap";

/// Reads a map; if it is not along the axes, what it is. Fails where the file ends or has a map that OpenVDB does not have.
pub(super) fn read(cursor: &mut Cursor) -> Result<std::result::Result<Transform, String>> {
    let name = file::text(cursor, "a transform's name")?;
    if name != "NonlinearFrustumMap" {
        return linear(cursor, &name);
    }
    // Its box, taper and depth, and another map within it.
    cursor.skip(6 * 8 + 2 * 8, "a transform")?;
    let name = file::text(cursor, "a transform's name")?;
    linear(cursor, &name).map(|_| Err("shaped like the view of a camera".to_string()))
}

fn linear(cursor: &mut Cursor, name: &str) -> Result<std::result::Result<Transform, String>> {
    // What follows from the scale is stored with it: voxel size, inverse, and two more.
    const FOLLOWS: u64 = 4 * 24;
    let one = [1.0; 3];
    Ok(match name {
        "ScaleMap" | "UniformScaleMap" => {
            let scale = triple(cursor)?;
            cursor.skip(FOLLOWS, "a transform")?;
            Ok(Transform { scale, translation: [0.0; 3] })
        }
        "ScaleTranslateMap" | "UniformScaleTranslateMap" => {
            let translation = triple(cursor)?;
            let scale = triple(cursor)?;
            cursor.skip(FOLLOWS, "a transform")?;
            Ok(Transform { scale, translation })
        }
        "TranslationMap" => Ok(Transform { scale: one, translation: triple(cursor)? }),
        "AffineMap" | "UnitaryMap" => {
            // Rows of a matrix that stands on the right of row vectors: the last is the translation.
            let mut rows = [[0.0; 4]; 4];
            for number in rows.as_flattened_mut() {
                *number = cursor.number("a matrix")?;
            }
            let turns = (0..3).any(|row| (0..3).any(|column| row != column && rows[row][column] != 0.0));
            if turns || rows[3][3] != 1.0 {
                Err("turned or sheared".to_string())
            } else {
                let [x, y, z, _] = rows[3];
                Ok(Transform { scale: [rows[0][0], rows[1][1], rows[2][2]], translation: [x, y, z] })
            }
        }
        _ => {
            let name: String = name.chars().take(40).collect();
            return Err(cursor.fault(format!("the transform '{name}' is not known")));
        }
    })
}

fn triple(cursor: &mut Cursor) -> Result<[f64; 3]> {
    let mut numbers = [0.0; 3];
    for number in &mut numbers {
        *number = cursor.number("a transform")?;
    }
    Ok(numbers)
}
