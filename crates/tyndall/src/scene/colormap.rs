//! Color maps by matplotlib's names: from a number between 0 and 1 to a color.
//!
//! A map is either smooth, with 256 levels like matplotlib's, or a list of distinct colors. viridis and its family, cubehelix and
//! most lists come from the crate `colorous`, which agrees with matplotlib 3.11 within 1/255; the rest are knots in
//! `colormap_tables`, within 1/255 too.

use super::colormap_tables::{KNOTS, LISTS};
use crate::error::{Error, Result};
use crate::names::nearest;

/// Levels of a smooth map.
const LEVELS: usize = 256;

/// Smooth maps in `colorous`: those that agree with matplotlib, and a cyclic one of even brightness.
const GRADIENTS: [(&str, colorous::Gradient); 6] = [
    ("viridis", colorous::VIRIDIS),
    ("plasma", colorous::PLASMA),
    ("inferno", colorous::INFERNO),
    ("magma", colorous::MAGMA),
    ("cubehelix", colorous::CUBEHELIX),
    ("sinebow", colorous::SINEBOW),
];

/// Lists of colors in `colorous` that agree with matplotlib, and the newer colors of Tableau.
const SCHEMES: [(&str, &[colorous::Color]); 10] = [
    ("tab10", &colorous::CATEGORY10),
    ("tableau10", &colorous::TABLEAU10),
    ("Set1", &colorous::SET1),
    ("Set2", &colorous::SET2),
    ("Set3", &colorous::SET3),
    ("Paired", &colorous::PAIRED),
    ("Accent", &colorous::ACCENT),
    ("Dark2", &colorous::DARK2),
    ("Pastel1", &colorous::PASTEL1),
    ("Pastel2", &colorous::PASTEL2),
];

/// Other spellings.
const ALIASES: [(&str, &str); 4] =
    [("grey", "gray"), ("gist_gray", "gray"), ("okabe-ito", "okabe_ito"), ("OkabeIto", "okabe_ito")];

/// The names of all maps; each can be followed by `_r` for the reversed map.
pub const NAMES: [&str; GRADIENTS.len() + KNOTS.len() + SCHEMES.len() + LISTS.len()] = {
    let mut names = [""; GRADIENTS.len() + KNOTS.len() + SCHEMES.len() + LISTS.len()];
    let mut place = 0;
    while place < names.len() {
        let (first_scheme, first_list) = (GRADIENTS.len() + KNOTS.len(), names.len() - LISTS.len());
        names[place] = if place < GRADIENTS.len() {
            GRADIENTS[place].0
        } else if place < first_scheme {
            KNOTS[place - GRADIENTS.len()].0
        } else if place < first_list {
            SCHEMES[place - first_scheme].0
        } else {
            LISTS[place - first_list].0
        };
        place += 1;
    }
    names
};

/// A map from numbers to colors.
#[derive(Clone, Debug, PartialEq)]
pub struct Colormap {
    name: String,
    colors: Vec<[u8; 3]>,
}

impl Colormap {
    /// The map of that name, exactly or else ignoring case. A name that ends in `_r` is the reversed map.
    pub fn named(name: &str) -> Result<Self> {
        let (base, reversed) = match name.strip_suffix("_r").or_else(|| name.strip_suffix("_R")) {
            Some(base) => (base, true),
            None => (name, false),
        };
        let alias =
            ALIASES.iter().find(|(alias, _)| alias.eq_ignore_ascii_case(base)).map(|(_, known)| *known);
        let wanted = alias.unwrap_or(base);
        let exact = NAMES.iter().find(|known| **known == wanted);
        let known = exact.or_else(|| NAMES.iter().find(|known| known.eq_ignore_ascii_case(wanted)));
        let Some(known) = known else {
            let meant =
                nearest(base, NAMES).map_or(String::new(), |meant| format!("did you mean '{meant}'? "));
            return Err(Error::setting("--cmap", name, format!("{meant}known: {}", NAMES.join(" "))));
        };
        let mut colors = colors_of(known);
        if reversed {
            colors.reverse();
        }
        Ok(Self { name: format!("{known}{}", if reversed { "_r" } else { "" }), colors })
    }

    /// A list of distinct colors under a name that is not in [`NAMES`].
    pub(crate) fn of_list(name: &str, colors: Vec<[u8; 3]>) -> Self {
        Self { name: name.into(), colors }
    }

    /// The name, as matplotlib spells it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The sRGB-encoded color, 0 to 1, at `t` from 0 to 1; beyond that the first or last color, and the first for NaN.
    pub fn at(&self, t: f32) -> [f32; 3] {
        // As matplotlib does it: equal intervals, the last one closed.
        let level = (t * self.colors.len() as f32).max(0.0) as usize;
        self.colors[level.min(self.colors.len() - 1)].map(|byte| byte as f32 / 255.0)
    }

    /// Whether this is a list of distinct colors, for kinds rather than amounts.
    pub fn is_list(&self) -> bool {
        self.colors.len() < LEVELS
    }

    /// The sRGB-encoded colors: 256 of a smooth map, fewer of a list.
    pub fn colors(&self) -> &[[u8; 3]] {
        &self.colors
    }
}

/// The colors of a name in [`NAMES`].
fn colors_of(name: &str) -> Vec<[u8; 3]> {
    let of_crate = |color: colorous::Color| [color.r, color.g, color.b];
    if let Some((_, gradient)) = GRADIENTS.iter().find(|(known, _)| *known == name) {
        return (0..LEVELS).map(|level| of_crate(gradient.eval_rational(level, LEVELS))).collect();
    }
    if let Some((_, scheme)) = SCHEMES.iter().find(|(known, _)| *known == name) {
        return scheme.iter().map(|color| of_crate(*color)).collect();
    }
    if let Some((_, list)) = LISTS.iter().find(|(known, _)| *known == name) {
        return list.split_ascii_whitespace().map(|word| rgb(hex(word))).collect();
    }
    let knots = KNOTS.iter().find(|(known, _)| *known == name).map_or("", |(_, knots)| knots);
    interpolated(knots.split_ascii_whitespace().map(hex).map(|word| (word >> 24, rgb(word))).collect())
}

/// All levels of a map from its knots (level, color), the first at level 0 and the last at 255.
fn interpolated(knots: Vec<(u32, [u8; 3])>) -> Vec<[u8; 3]> {
    let mut colors = Vec::with_capacity(LEVELS);
    for pair in knots.windows(2) {
        let ((from, start), (to, end)) = (pair[0], pair[1]);
        // Each knot belongs to the interval that it starts; the last one is added below.
        for level in from..to {
            let t = (level - from) as f32 / (to - from) as f32;
            let mixed = |c: usize| start[c] as f32 + t * (end[c] as f32 - start[c] as f32);
            colors.push(std::array::from_fn(|c| mixed(c).round() as u8));
        }
    }
    colors.extend(knots.last().map(|(_, color)| *color));
    colors
}

fn hex(word: &str) -> u32 {
    u32::from_str_radix(word, 16).expect("the tables hold hexadecimal words")
}

fn rgb(word: u32) -> [u8; 3] {
    [(word >> 16) as u8, (word >> 8) as u8, word as u8]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `matplotlib.colormaps[name](level)` of matplotlib 3.11, as bytes.
    const MATPLOTLIB: [(&str, [[u8; 3]; 6]); 10] = [
        (
            "viridis",
            [[68, 1, 84], [72, 26, 108], [42, 118, 142], [33, 145, 140], [112, 207, 87], [253, 231, 37]],
        ),
        ("turbo", [[48, 18, 59], [65, 67, 167], [63, 246, 138], [164, 252, 60], [244, 102, 23], [122, 4, 3]]),
        (
            "RdBu",
            [[103, 0, 31], [153, 16, 39], [252, 215, 194], [246, 247, 247], [79, 155, 199], [5, 48, 97]],
        ),
        (
            "coolwarm",
            [[59, 76, 192], [79, 105, 217], [190, 210, 246], [221, 220, 220], [240, 139, 110], [180, 4, 38]],
        ),
        ("jet", [[0, 0, 128], [0, 0, 205], [35, 255, 212], [125, 255, 122], [255, 119, 0], [128, 0, 0]]),
        ("hot", [[11, 0, 0], [55, 0, 0], [255, 18, 0], [255, 92, 0], [255, 255, 38], [255, 255, 255]]),
        (
            "cividis",
            [[0, 34, 78], [0, 46, 108], [101, 104, 112], [125, 124, 120], [196, 180, 104], [254, 232, 56]],
        ),
        (
            "twilight",
            [[226, 217, 226], [191, 204, 211], [86, 33, 130], [48, 20, 55], [188, 107, 89], [226, 217, 226]],
        ),
        ("hsv", [[255, 0, 0], [255, 100, 0], [0, 255, 81], [0, 255, 246], [161, 0, 255], [255, 0, 24]]),
        (
            "Spectral",
            [[158, 1, 66], [195, 42, 75], [254, 220, 136], [255, 255, 190], [113, 198, 165], [94, 79, 162]],
        ),
    ];
    const SAMPLED: [usize; 6] = [0, 17, 100, 128, 200, 255];

    fn differ(a: [u8; 3], b: [u8; 3]) -> u8 {
        (0..3).map(|c| a[c].abs_diff(b[c])).max().unwrap()
    }

    #[test]
    fn maps_are_those_of_matplotlib() {
        for (name, colors) in MATPLOTLIB {
            let map = Colormap::named(name).unwrap();
            for (level, wanted) in SAMPLED.into_iter().zip(colors) {
                assert!(differ(map.colors()[level], wanted) <= 1, "{name} level {level}");
                let at = map.at(level as f32 / 255.0).map(|value| (255.0 * value).round() as u8);
                assert_eq!(at, map.colors()[level], "{name} level {level}");
            }
        }
        assert_eq!(Colormap::named("tab20").unwrap().colors()[1], [0xae, 0xc7, 0xe8]);
    }

    #[test]
    fn the_comparison_notices_another_map() {
        let (_, viridis) = MATPLOTLIB[0];
        assert!(differ(Colormap::named("plasma").unwrap().colors()[SAMPLED[2]], viridis[2]) > 1);
    }

    #[test]
    fn every_name_has_all_its_colors_and_a_reverse() {
        for name in NAMES {
            let map = Colormap::named(name).unwrap();
            assert_eq!(map.name(), name);
            assert!(map.colors().len() == LEVELS || (7..=20).contains(&map.colors().len()), "{name}");
            let mut reversed = Colormap::named(&format!("{name}_r")).unwrap().colors().to_vec();
            reversed.reverse();
            assert_eq!(map.colors(), reversed, "{name}");
        }
    }

    #[test]
    fn case_and_spelling_are_forgiven_and_errors_suggest() {
        assert_eq!(Colormap::named("rdbu_R").unwrap().name(), "RdBu_r");
        assert_eq!(Colormap::named("Grey").unwrap().name(), "gray");
        let message = Colormap::named("virdis").unwrap_err().to_string();
        assert!(message.contains("did you mean 'viridis'?") && message.contains("turbo"), "{message}");
    }

    #[test]
    fn numbers_outside_are_clamped() {
        let map = Colormap::named("gray").unwrap();
        assert_eq!((map.at(-3.0), map.at(f32::NAN), map.at(7.0)), ([0.0; 3], [0.0; 3], [1.0; 3]));
        assert_eq!(map.at(0.5), [128.0 / 255.0; 3]);
    }
}
