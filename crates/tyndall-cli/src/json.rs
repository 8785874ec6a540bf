//! A frame as one JSON object, for scripts. Keys do not change; numbers have as many digits as the file's type holds.

use serde_json::{Map, Value, json};
use tyndall::particles::{Attribute, Particles, Values, View};
use tyndall_io::{Frame, Sequence};

/// The object, and a line end.
pub(crate) fn describe(sequence: &Sequence, number: usize, frame: &Frame) -> String {
    let particles = &frame.particles;
    let dropped = particles.dropped();
    let paths: Vec<String> = sequence.paths().iter().map(|path| path.display().to_string()).collect();
    let bounds = particles.world_bounds().map(|[min, max]| json!({ "min": min, "max": max }));
    let cell = particles.cell().map(|cell| {
        let vectors = cell.vectors.map(|vector| vector.to_array());
        json!({ "origin": cell.origin.to_array(), "vectors": vectors, "periodic": cell.periodic })
    });
    let attribute = |it: &Attribute| json!({ "name": it.name, "type": it.values.type_name(), "components": it.components, "unit": it.unit });
    let object = json!({
        "format": sequence.format(),
        "paths": paths,
        "frames": sequence.len(),
        "frame": number,
        "name": sequence.name(number),
        "particles": particles.len(),
        "bounds": bounds,
        "cell": cell,
        "time": particles.time(),
        "time_unit": particles.time_unit(),
        "length_unit": particles.length_unit(),
        "bonds": particles.bonds().len(),
        "attributes": particles.attributes().iter().map(attribute).collect::<Vec<_>>(),
        "first": particle(particles, 0),
        "last": particles.len().checked_sub(1).and_then(|last| particle(particles, last)),
        "dropped": { "position": dropped.position, "radius": dropped.radius, "total": dropped.total() },
        "conventions": frame.conventions,
        "given": frame.given,
        "warnings": frame.warnings,
    });
    format!("{object:#}\n")
}

/// A particle's position and attributes by name; `None` if there is no such particle.
fn particle(particles: &Particles, id: usize) -> Option<Value> {
    if id >= particles.len() {
        return None;
    }
    let mut object = Map::new();
    object.insert("position".into(), json!(particles.world_position(id)));
    for attribute in particles.attributes() {
        let values: Vec<Value> = (0..attribute.components)
            .map(|at| value(&attribute.values, id * attribute.components + at))
            .collect();
        let value =
            if attribute.components == 1 { values.into_iter().next() } else { Some(Value::from(values)) };
        object.entry(attribute.name.clone()).or_insert(value.unwrap_or_default());
    }
    Some(object.into())
}

/// One value; what is no number has none in JSON.
fn value(values: &Values, place: usize) -> Value {
    match values.view() {
        // Through its shortest digits, so that 0.8 is not told as 0.800000011920929.
        View::F32(column) => {
            json!(column[place].to_string().parse::<f64>().ok().filter(|it| it.is_finite()))
        }
        View::F64(column) => json!(Some(column[place]).filter(|it| it.is_finite())),
        View::I32(column) => json!(column[place]),
        View::I64(column) => json!(column[place]),
        View::U8(column) => json!(column[place]),
        View::Text { codes, names } => json!(names.get(codes[place] as usize)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_told_with_the_digits_of_their_type() {
        let told = |values: Values| value(&values, 0).to_string();
        assert_eq!(told(Values::F32(vec![0.8])), "0.8");
        assert_eq!(told(Values::F32(vec![1e-30])), "1e-30");
        assert_eq!(told(Values::F64(vec![0.1 + 0.2])), "0.30000000000000004");
        assert_eq!(told(Values::F32(vec![f32::NAN])), "null");
        assert_eq!(told(Values::I64(vec![i64::MAX])), "9223372036854775807");
        let names = vec!["Cu".to_string()];
        assert_eq!(told(Values::Text { codes: vec![0], names }), "\"Cu\"");
    }
}
