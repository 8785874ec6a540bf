//! What USD's transform operations make together.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3};
use tyndall::particles::Values;

use super::numbers::values;
use super::scan::Property;

/// Where the points of a prim go, by the transforms of all prims from the outermost one to its own; and the operations that are not
/// understood.
pub(super) fn of(prims: &[Arc<Vec<Property>>], time: Option<f64>) -> (DAffine3, Vec<String>) {
    let (mut world, mut left_out) = (DAffine3::IDENTITY, Vec::new());
    for properties in prims.iter().map(|it| &**it) {
        let order = properties.iter().find(|it| it.name == "xformOpOrder").and_then(|it| it.at(time));
        let Some(Ok(Values::Text { codes, names })) = order.map(|it| values("token[]", it)) else { continue };
        for code in codes {
            let name = names[code as usize].as_str();
            if name == "!resetXformStack!" {
                world = DAffine3::IDENTITY;
                continue;
            }
            let (plain, is_inverse) = name.strip_prefix("!invert!").map_or((name, false), |it| (it, true));
            let value = properties.iter().find(|it| it.name == plain).and_then(|it| it.at(time));
            match value.and_then(|it| operation(plain, it)) {
                Some(it) if is_inverse => world *= it.inverse(),
                Some(it) => world *= it,
                None => left_out.push(name.to_string()),
            }
        }
    }
    (world, left_out)
}

/// What an operation does, by its name: `xformOp:rotateXYZ:suffix`.
fn operation(name: &str, value: &[u8]) -> Option<DAffine3> {
    let kind = name.strip_prefix("xformOp:")?.split(':').next()?;
    let column = values("double[]", value).ok()?;
    let numbers: Vec<f64> = (0..column.len()).map(|place| column.number(place)).collect();
    let vector = || Some(DVec3::from_array(numbers.as_slice().try_into().ok()?));
    let around = |axis: char, degrees: f64| {
        let angle = degrees.to_radians();
        match axis {
            'X' => DAffine3::from_rotation_x(angle),
            'Y' => DAffine3::from_rotation_y(angle),
            _ => DAffine3::from_rotation_z(angle),
        }
    };
    let found = match kind {
        "translate" => DAffine3::from_translation(vector()?),
        "scale" => DAffine3::from_scale(vector()?),
        "orient" => {
            let [w, x, y, z] = numbers.as_slice().try_into().ok()?;
            DAffine3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize())
        }
        // Rows of the file act on row vectors: they are our columns.
        "transform" => {
            let matrix = DMat4::from_cols_array(numbers.as_slice().try_into().ok()?);
            DAffine3 { matrix3: DMat3::from_mat4(matrix), translation: matrix.w_axis.truncate() }
        }
        _ => {
            let axes = kind.strip_prefix("rotate")?;
            let degrees =
                if axes.len() == 1 { vec![numbers.first().copied()?] } else { vector()?.to_array().to_vec() };
            if !axes.chars().all(|it| "XYZ".contains(it)) || !matches!(axes.len(), 1 | 3) {
                return None;
            }
            // XYZ turns around x first; angles are always given as those around x, y and z.
            axes.chars().fold(DAffine3::IDENTITY, |all, axis| {
                let place = if axes.len() == 1 { 0 } else { "XYZ".find(axis).unwrap_or(0) };
                around(axis, degrees[place]) * all
            })
        }
    };
    found.is_finite().then_some(found)
}
