//! What a user asks to see as color, and how it is written: `c_pe`, `|v|`, `v.x`, `element`, `#ff8800`, `auto`.

use std::str::FromStr;

use super::colormap::Colormap;
use super::quantity::{Component, named};
use crate::error::{Error, Result};
use crate::names::nearest;
use crate::srgb::linear_from_encoded;

/// Where the particles' colors come from.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Coloring {
    /// The best of what the particles have: elements, else types where there is more than one, else colors, else the first float
    /// that varies and is no velocity, coordinate or radius, else one color for all.
    #[default]
    Auto,
    /// One color for all: linear RGB, 0 to 1.
    Constant([f32; 3]),
    /// An attribute, or a coordinate by its name `x`, `y` or `z`.
    Attribute {
        /// Its name.
        name: String,
        /// Which number of a vector; `None`: a scalar itself, a vector's magnitude.
        component: Option<Component>,
    },
    /// The chemical element.
    Element,
    /// The type: an integer or a word.
    Type,
}

impl FromStr for Coloring {
    type Err = Error;

    /// Reads `auto`, `element`, `type`, `#rrggbb`, `#rgb`, a color name of CSS, `|v|`, `v.x`, `v.1` (components count from 0), or the
    /// name of an attribute. An attribute that is named like a color is reached by its component: `red.0`.
    fn from_str(text: &str) -> Result<Self> {
        let text = text.trim();
        match text.to_ascii_lowercase().as_str() {
            "" => {
                return Err(Error::setting(
                    "--color",
                    text,
                    "an attribute, 'element', 'type', 'auto' or a color",
                ));
            }
            "auto" => return Ok(Self::Auto),
            "element" => return Ok(Self::Element),
            "type" => return Ok(Self::Type),
            _ => {}
        }
        match color(text) {
            Ok(color) => return Ok(Self::Constant(linear(color))),
            Err(error) if text.starts_with('#') => return Err(error),
            Err(_) => {}
        }
        let (name, component) = named(text);
        Ok(Self::Attribute { name: name.into(), component })
    }
}

/// How numbers are spread over a color map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Norm {
    /// In proportion.
    Linear,
    /// By their logarithm; numbers that are not positive take the lowest color.
    Log,
}

impl Norm {
    /// The number that grows along a map in proportion.
    pub fn spread(self, number: f64) -> f64 {
        match self {
            Self::Linear => number,
            Self::Log => number.max(f64::MIN_POSITIVE).ln(),
        }
    }
}

impl FromStr for Norm {
    type Err = Error;

    /// Reads `linear` or `log`.
    fn from_str(text: &str) -> Result<Self> {
        match text {
            "linear" | "lin" => Ok(Self::Linear),
            "log" => Ok(Self::Log),
            _ => Err(Error::setting("--norm", text, "known: linear log")),
        }
    }
}

/// Which numbers have the first and the last color of a map.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Range {
    /// The 1st and the 99th percentile, so that a few outliers do not spoil the rest.
    #[default]
    Auto,
    /// The smallest and the largest.
    Full,
    /// These, the first below the second.
    Given(f64, f64),
}

impl FromStr for Range {
    type Err = Error;

    /// Reads `auto`, `full` (or `min:max`), or two numbers `low:high`.
    fn from_str(text: &str) -> Result<Self> {
        let wanted = || {
            Error::setting("--range", text, "low:high, two numbers with the first below, or auto, or full")
        };
        match text {
            "auto" => return Ok(Self::Auto),
            "full" | "min:max" => return Ok(Self::Full),
            _ => {}
        }
        let (low, high) = text.split_once(':').ok_or_else(wanted)?;
        let number =
            |text: &str| text.trim().parse::<f64>().ok().filter(|it| it.is_finite()).ok_or_else(wanted);
        let (low, high) = (number(low)?, number(high)?);
        if low < high { Ok(Self::Given(low, high)) } else { Err(wanted()) }
    }
}

/// The color of particles without a value, and of unknown elements, if nobody says otherwise: sRGB.
pub const MISSING: [u8; 3] = [128; 3];

/// How values become colors. What is `None` is guessed from the quantity's name and values. Colors are sRGB bytes.
#[derive(Clone, Debug, PartialEq)]
pub struct Mapping {
    /// The colors.
    pub map: Option<Colormap>,
    /// How numbers are spread over them.
    pub norm: Option<Norm>,
    /// Which numbers have the first and the last one.
    pub range: Range,
    /// The color of particles without a value (NaN), and of unknown elements.
    pub missing: [u8; 3],
    /// That of numbers below the range; `None`: the first of the map.
    pub below: Option<[u8; 3]>,
    /// That of numbers above the range; `None`: the last of the map.
    pub above: Option<[u8; 3]>,
}

impl Default for Mapping {
    fn default() -> Self {
        Self { map: None, norm: None, range: Range::Auto, missing: MISSING, below: None, above: None }
    }
}

/// Reads `#rrggbb`, `#rgb` or a color name of CSS: the sRGB bytes. Fails with [`Error::Setting`], which tells the nearest name.
pub fn color(text: &str) -> Result<[u8; 3]> {
    let text = text.trim();
    let found = match text.strip_prefix('#') {
        Some(digits) => hex_color(digits),
        None => css_color(text),
    };
    found.ok_or_else(|| {
        let names = CSS.split_ascii_whitespace().step_by(2);
        let meant = nearest(text, names).filter(|_| !text.starts_with('#'));
        let meant = meant.map_or(String::new(), |it| format!("; did you mean '{it}'?"));
        let allowed =
            format!("a color is #rrggbb or #rgb in hexadecimal digits, or has a name of CSS{meant}");
        Error::setting("--color", text, allowed)
    })
}

/// The linear color of sRGB bytes.
pub fn linear(color: [u8; 3]) -> [f32; 3] {
    color.map(|byte| linear_from_encoded(byte as f32 / 255.0))
}

/// The sRGB bytes of `rrggbb` or `rgb`.
fn hex_color(digits: &str) -> Option<[u8; 3]> {
    let value = u32::from_str_radix(digits, 16).ok().filter(|_| !digits.starts_with('+'))?;
    let [_, r, g, b] = value.to_be_bytes();
    match digits.len() {
        6 => Some([r, g, b]),
        3 => Some([value >> 8, value >> 4 & 15, value & 15].map(|digit| digit as u8 * 17)),
        _ => None,
    }
}

/// The sRGB bytes of a color name, in any case.
fn css_color(name: &str) -> Option<[u8; 3]> {
    let mut words = CSS.split_ascii_whitespace();
    while let (Some(known), Some(digits)) = (words.next(), words.next()) {
        if known.eq_ignore_ascii_case(name) {
            return hex_color(digits);
        }
    }
    None
}

/// The named colors of CSS Color Module Level 4: names and sRGB as RRGGBB.
#[rustfmt::skip]
const CSS: &str = "\
    aliceblue f0f8ff antiquewhite faebd7 aqua 00ffff aquamarine 7fffd4 azure f0ffff beige f5f5dc \
    bisque ffe4c4 black 000000 blanchedalmond ffebcd blue 0000ff blueviolet 8a2be2 brown a52a2a \
    burlywood deb887 cadetblue 5f9ea0 chartreuse 7fff00 chocolate d2691e coral ff7f50 cornflowerblue 6495ed \
    cornsilk fff8dc crimson dc143c cyan 00ffff darkblue 00008b darkcyan 008b8b darkgoldenrod b8860b \
    darkgray a9a9a9 darkgreen 006400 darkgrey a9a9a9 darkkhaki bdb76b darkmagenta 8b008b \
    darkolivegreen 556b2f darkorange ff8c00 darkorchid 9932cc darkred 8b0000 darksalmon e9967a \
    darkseagreen 8fbc8f darkslateblue 483d8b darkslategray 2f4f4f darkslategrey 2f4f4f darkturquoise 00ced1 \
    darkviolet 9400d3 deeppink ff1493 deepskyblue 00bfff dimgray 696969 dimgrey 696969 dodgerblue 1e90ff \
    firebrick b22222 floralwhite fffaf0 forestgreen 228b22 fuchsia ff00ff gainsboro dcdcdc ghostwhite f8f8ff \
    gold ffd700 goldenrod daa520 gray 808080 green 008000 greenyellow adff2f grey 808080 honeydew f0fff0 \
    hotpink ff69b4 indianred cd5c5c indigo 4b0082 ivory fffff0 khaki f0e68c lavender e6e6fa \
    lavenderblush fff0f5 lawngreen 7cfc00 lemonchiffon fffacd lightblue add8e6 lightcoral f08080 \
    lightcyan e0ffff lightgoldenrodyellow fafad2 lightgray d3d3d3 lightgreen 90ee90 lightgrey d3d3d3 \
    lightpink ffb6c1 lightsalmon ffa07a lightseagreen 20b2aa lightskyblue 87cefa lightslategray 778899 \
    lightslategrey 778899 lightsteelblue b0c4de lightyellow ffffe0 lime 00ff00 limegreen 32cd32 linen faf0e6 \
    magenta ff00ff maroon 800000 mediumaquamarine 66cdaa mediumblue 0000cd mediumorchid ba55d3 \
    mediumpurple 9370db mediumseagreen 3cb371 mediumslateblue 7b68ee mediumspringgreen 00fa9a \
    mediumturquoise 48d1cc mediumvioletred c71585 midnightblue 191970 mintcream f5fffa mistyrose ffe4e1 \
    moccasin ffe4b5 navajowhite ffdead navy 000080 oldlace fdf5e6 olive 808000 olivedrab 6b8e23 \
    orange ffa500 orangered ff4500 orchid da70d6 palegoldenrod eee8aa palegreen 98fb98 paleturquoise afeeee \
    palevioletred db7093 papayawhip ffefd5 peachpuff ffdab9 peru cd853f pink ffc0cb plum dda0dd \
    powderblue b0e0e6 purple 800080 rebeccapurple 663399 red ff0000 rosybrown bc8f8f royalblue 4169e1 \
    saddlebrown 8b4513 salmon fa8072 sandybrown f4a460 seagreen 2e8b57 seashell fff5ee sienna a0522d \
    silver c0c0c0 skyblue 87ceeb slateblue 6a5acd slategray 708090 slategrey 708090 snow fffafa \
    springgreen 00ff7f steelblue 4682b4 tan d2b48c teal 008080 thistle d8bfd8 tomato ff6347 turquoise 40e0d0 \
    violet ee82ee wheat f5deb3 white ffffff whitesmoke f5f5f5 yellow ffff00 yellowgreen 9acd32";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_way_of_writing_is_understood() {
        let attribute = |name: &str, component| Coloring::Attribute { name: name.into(), component };
        for (text, wanted) in [
            ("auto", Coloring::Auto),
            ("Element", Coloring::Element),
            ("type", Coloring::Type),
            ("#ff0000", Coloring::Constant([1.0, 0.0, 0.0])),
            ("#0F0", Coloring::Constant([0.0, 1.0, 0.0])),
            ("White", Coloring::Constant([1.0; 3])),
            ("c_pe", attribute("c_pe", None)),
            ("vx", attribute("vx", None)),
            ("|v|", attribute("v", Some(Component::Magnitude))),
            ("v.x", attribute("v", Some(Component::Index(0)))),
            ("stress.5", attribute("stress", Some(Component::Index(5)))),
            ("red.0", attribute("red", Some(Component::Index(0)))),
            ("a.b", attribute("a.b", None)),
            ("a + 0.001", attribute("a + 0.001", None)),
        ] {
            assert_eq!(text.parse::<Coloring>().unwrap(), wanted, "{text}");
        }
        for text in ["", "#12345", "#+12", "#é1"] {
            assert!(text.parse::<Coloring>().is_err(), "{text}");
        }
    }

    #[test]
    fn css_knows_its_148_names() {
        assert_eq!(CSS.split_ascii_whitespace().count(), 2 * 148);
        assert_eq!(css_color("RebeccaPurple"), Some([0x66, 0x33, 0x99]));
        assert_eq!(css_color("ff0000"), None);
    }

    #[test]
    fn ranges_and_norms_are_read() {
        assert_eq!("-4.2:-3.1".parse::<Range>().unwrap(), Range::Given(-4.2, -3.1));
        assert_eq!("min:max".parse::<Range>().unwrap(), Range::Full);
        for text in ["1", "2:1", "1:1", "a:b", "nan:1", "0:inf", ":"] {
            assert!(text.parse::<Range>().is_err(), "{text}");
        }
        assert_eq!("log".parse::<Norm>().unwrap(), Norm::Log);
        assert!("cubic".parse::<Norm>().is_err());
    }
}
