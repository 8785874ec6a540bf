//! What USD's transform operations make together.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3};
use tyndall::particles::Values;

use super::numbers::values;
use super::scan::{Around, Property};

/// Where a prim and its points go, by the transforms of all prims from the outermost one to its own; and the operations that are not
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
            let property = properties.iter().find(|it| it.name == plain);
            if property.is_some_and(|it| it.at(time).is_none()) {
                continue; // What has no value then does nothing.
            }
            match property.and_then(|it| operation(plain, it, time)) {
                Some(it) if is_inverse => world *= it.inverse(),
                Some(it) => world *= it,
                None => left_out.push(name.to_string()),
            }
        }
    }
    (world, left_out)
}

/// The numbers of a value.
fn numbers(value: &[u8]) -> Option<Vec<f64>> {
    let column = values("double[]", value).ok()?;
    Some((0..column.len()).map(|place| column.number(place)).collect())
}

/// The numbers of a property at a time, which between two samples go straight from one to the other.
pub(super) fn numbers_at(property: &Property, time: Option<f64>) -> Option<Vec<f64>> {
    let Around { before, next } = property.around(time)?;
    let from = numbers(before)?;
    let Some((after, share)) = next else { return Some(from) };
    let to = numbers(after).filter(|to| to.len() == from.len())?;
    Some(from.iter().zip(to).map(|(from, to)| from + share * (to - from)).collect())
}

/// A turn at a time, which between two samples goes the short way round at one speed.
fn turn_at(property: &Property, time: Option<f64>) -> Option<DQuat> {
    let turn = |value: &[u8]| {
        let [w, x, y, z] = numbers(value)?.as_slice().try_into().ok()?;
        Some(DQuat::from_xyzw(x, y, z, w).normalize())
    };
    let Around { before, next } = property.around(time)?;
    let from = turn(before)?;
    Some(match next {
        Some((after, share)) => from.slerp(turn(after)?, share),
        None => from,
    })
}

/// What an operation does at a time, by its name: `xformOp:rotateXYZ:suffix`.
fn operation(name: &str, property: &Property, time: Option<f64>) -> Option<DAffine3> {
    let kind = name.strip_prefix("xformOp:")?.split(':').next()?;
    let numbers = numbers_at(property, time)?;
    let vector = || Some(DVec3::from_array(numbers.as_slice().try_into().ok()?));
    let along = |usual: DVec3| {
        let axis = "XYZ".find(kind.chars().last()?)?;
        let mut vector = usual;
        vector[axis] = *numbers.first()?;
        Some(vector)
    };
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
        "translateX" | "translateY" | "translateZ" => DAffine3::from_translation(along(DVec3::ZERO)?),
        "scaleX" | "scaleY" | "scaleZ" => DAffine3::from_scale(along(DVec3::ONE)?),
        "orient" => DAffine3::from_quat(turn_at(property, time)?),
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
