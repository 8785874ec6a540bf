//! Colors that the particles bring along: a vector (`Cd`, `Color`, `rgb`) or three scalars (`red`, `green`, `blue`).
//!
//! Integers are sRGB-encoded, of 8 or of 16 bits (lidar) by the largest. Floats are linear light up to 1, as effects programs write
//! them, unless they run to 255 or 65535: then they are such integers.

use rayon::prelude::*;

use crate::particles::{Attribute, Particles};
use crate::srgb::encoded_from_linear;

/// Names of attributes with three or four components that hold colors.
const VECTORS: [&str; 8] = ["cd", "color", "colour", "colors", "rgb", "rgba", "vertex_color", "vertexcolor"];
/// Names of scalars that hold colors together.
const SCALARS: [[&str; 3]; 4] = [
    ["red", "green", "blue"],
    ["r", "g", "b"],
    ["diffuse_red", "diffuse_green", "diffuse_blue"],
    ["cd_r", "cd_g", "cd_b"],
];

/// Whether an attribute of this name may hold colors.
pub(super) fn is_named(name: &str) -> bool {
    let names = VECTORS.iter().chain(SCALARS.as_flattened());
    names.into_iter().any(|known| known.eq_ignore_ascii_case(name))
}

/// The columns that hold the particles' own colors.
pub(crate) struct Rgb<'a> {
    /// The attribute and component of red, green and blue.
    channels: [(&'a Attribute, usize); 3],
    label: String,
}

impl<'a> Rgb<'a> {
    /// The colors that the particles bring along.
    pub(crate) fn find(particles: &'a Particles) -> Option<Self> {
        let vector = particles.attributes().iter().find_map(Self::of_vector);
        vector.or_else(|| {
            SCALARS.iter().find_map(|names| {
                let [r, g, b] = names.map(|name| particles.attribute(name).filter(|it| it.components == 1));
                let channels = [(r?, 0), (g?, 0), (b?, 0)];
                Some(Self { channels, label: channels.map(|(it, _)| it.name.as_str()).join(" ") })
            })
        })
    }

    /// The colors in `attribute`, if it is named and shaped like them.
    pub(crate) fn of_vector(attribute: &'a Attribute) -> Option<Self> {
        let named = VECTORS.iter().any(|name| name.eq_ignore_ascii_case(&attribute.name));
        let channels = [0, 1, 2].map(|component| (attribute, component));
        (named && (3..=4).contains(&attribute.components))
            .then(|| Self { channels, label: attribute.name.clone() })
    }

    /// The sRGB bytes of every particle, and how they were understood. NaN is black.
    pub(crate) fn bytes(&self, count: usize) -> (Vec<[u8; 3]>, String) {
        let number =
            |id: usize, channel: usize| self.channels[channel].0.number(id, self.channels[channel].1);
        let ids = || (0..count).into_par_iter().with_min_len(1 << 14);
        let largest = |id: usize| (0..3).map(|channel| number(id, channel)).fold(0.0, f64::max);
        let largest = ids().map(largest).reduce(|| 0.0, f64::max);
        let floats = !self.channels[0].0.values.is_discrete();
        // Light may exceed 1; a table of bytes that is kept as floats has values far beyond.
        let linear = floats && largest <= 16.0;
        let full = if largest <= 255.0 { 255.0 } else { 65535.0 };
        let byte = |number: f64| {
            let encoded = if linear { encoded_from_linear(number as f32) } else { (number / full) as f32 };
            (255.0 * encoded.clamp(0.0, 1.0)).round() as u8
        };
        let bytes = ids().map(|id| std::array::from_fn(|channel| byte(number(id, channel)))).collect();
        let kind = match (linear, full) {
            (true, _) if largest > 1.0 => "linear light, clipped at 1",
            (true, _) => "linear light",
            (false, 255.0) => "sRGB, 8 bit",
            _ => "sRGB, 16 bit",
        };
        (bytes, format!("color {} as it is ({kind})", self.label))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::particles::{Columns, Values};
    use glam::DVec3;

    fn particles(attributes: Vec<Attribute>) -> Particles {
        let mut columns = Columns::default();
        columns.positions.extend(&[DVec3::ZERO, DVec3::ONE]);
        columns.attributes = attributes;
        Particles::new(columns).unwrap()
    }

    fn bytes(values: Values) -> (Vec<[u8; 3]>, String) {
        Rgb::find(&particles(vec![Attribute::new("Cd", 3, values)])).unwrap().bytes(2)
    }

    #[test]
    fn bytes_words_and_light_are_told_apart() {
        assert_eq!(bytes(Values::U8(vec![1, 2, 3, 200, 0, 255])).0, [[1, 2, 3], [200, 0, 255]]);
        assert_eq!(bytes(Values::I32(vec![0, 32768, 65535, 257, 0, 0])).0, [[0, 128, 255], [1, 0, 0]]);
        assert_eq!(
            bytes(Values::F32(vec![0.0, 1.0, 0.215_861, f32::NAN, -1.0, 2.0])).0,
            [[0, 255, 128], [0, 0, 255]]
        );
        assert_eq!(bytes(Values::F64(vec![0.0, 128.0, 255.0, 0.0, 0.0, 1.0])).0, [[0, 128, 255], [0, 0, 1]]);
        assert!(bytes(Values::F32(vec![2.0; 6])).1.contains("clipped"));
    }

    #[test]
    fn three_scalars_are_colors_and_two_are_not() {
        let scalar = |name: &str| Attribute::new(name, 1, Values::U8(vec![7, 9]));
        let all = particles(vec![scalar("Blue"), scalar("Red"), scalar("Green")]);
        let (bytes, description) = Rgb::find(&all).unwrap().bytes(2);
        assert_eq!(
            (bytes, description.as_str()),
            (vec![[7; 3], [9; 3]], "color Red Green Blue as it is (sRGB, 8 bit)")
        );
        assert!(Rgb::find(&particles(vec![scalar("red"), scalar("green")])).is_none());
    }
}
