//! A font: what texts are as wide as, and the outlines of their characters. DejaVu Sans is built in.

use ab_glyph::{Font as _, FontArc, GlyphId, OutlineCurve, Point};
use tyndall::{Error, Result};

/// See the module.
#[derive(Clone, Debug)]
pub struct Font(FontArc);

/// The piece of an outline, in pixels, y down.
pub(super) type Curve = OutlineCurve;

impl Font {
    /// DejaVu Sans, which is built in.
    pub fn embedded() -> Self {
        Self(FontArc::try_from_slice(dejavu::sans::regular()).expect("the font that is built in is one"))
    }

    /// The font of a TrueType or OpenType file. Fails with [`Error::Setting`] if it is none.
    pub fn from_bytes(bytes: Vec<u8>) -> Result<Self> {
        let face = FontArc::try_from_vec(bytes).ok();
        let face = face.filter(|face| face.units_per_em().is_some_and(|it| it > 0.0));
        let allowed = "the file of a TrueType or OpenType font";
        face.map(Self).ok_or_else(|| Error::setting("--font", "no font", allowed))
    }

    /// The first character that the font has not.
    pub(super) fn missing(&self, text: &str) -> Option<char> {
        text.chars().find(|letter| !letter.is_whitespace() && self.glyph(*letter) == GlyphId(0))
    }

    /// The width of a text, in pixels, where an em has so many.
    pub(super) fn width(&self, text: &str, em: f32) -> f32 {
        let glyphs = self.glyphs(text);
        glyphs.last().map_or(0.0, |&(at, glyph)| self.scale(em) * (at + self.advance(glyph)))
    }

    /// How far text reaches above the line that it stands on.
    pub(super) fn ascent(&self, em: f32) -> f32 {
        0.78 * em
    }

    /// How far text reaches below that line.
    pub(super) fn descent(&self, em: f32) -> f32 {
        0.24 * em
    }

    /// The height of figures, by which they are centered.
    pub(super) fn figure_height(&self, em: f32) -> f32 {
        let bounds = self.0.outline(self.0.glyph_id('0')).map(|outline| outline.bounds);
        bounds.map_or(0.7 * em, |bounds| self.scale(em) * bounds.min.y.abs().max(bounds.max.y.abs()))
    }

    /// The outlines of a text that begins at `at`.
    pub(super) fn outlines(&self, text: &str, em: f32, at: [f32; 2]) -> Vec<Curve> {
        let scale = self.scale(em);
        let mut curves = Vec::new();
        for (start, glyph) in self.glyphs(text) {
            let Some(outline) = self.0.outline(glyph) else { continue };
            let place = |it: Point| Point { x: at[0] + scale * (start + it.x), y: at[1] - scale * it.y };
            curves.extend(outline.curves.into_iter().map(|curve| match curve {
                Curve::Line(a, b) => Curve::Line(place(a), place(b)),
                Curve::Quad(a, b, c) => Curve::Quad(place(a), place(b), place(c)),
                Curve::Cubic(a, b, c, d) => Curve::Cubic(place(a), place(b), place(c), place(d)),
            }));
        }
        curves
    }

    /// Characters and where they begin, in the font's unit.
    fn glyphs(&self, text: &str) -> Vec<(f32, GlyphId)> {
        let mut at = 0.0;
        let mut placed: Vec<(f32, GlyphId)> = Vec::new();
        for glyph in text.chars().map(|letter| self.glyph(letter)) {
            if let Some(&(_, before)) = placed.last() {
                at += self.advance(before) + self.0.kern_unscaled(before, glyph);
            }
            placed.push((at, glyph));
        }
        placed
    }

    fn glyph(&self, letter: char) -> GlyphId {
        self.0.glyph_id(letter)
    }

    fn advance(&self, glyph: GlyphId) -> f32 {
        self.0.h_advance_unscaled(glyph)
    }

    /// Pixels over the font's unit.
    fn scale(&self, em: f32) -> f32 {
        em / self.0.units_per_em().unwrap_or(1000.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_are_as_wide_as_their_characters() {
        let font = Font::embedded();
        // DejaVu Sans 2.37: 2048 units an em; advances of digits 1303, of 'A' 1401, of 'V' 1401, kerning of "AV" negative.
        assert!((font.width("07", 20.48) - 26.06).abs() < 1e-3);
        assert!(font.width("AV", 20.48) < 28.02 && font.width("AV", 20.48) > 24.0);
        assert_eq!((font.width("", 20.0), font.missing("×10⁻³ Å µm −½ z")), (0.0, None));
        assert_eq!(font.missing("ok \u{10fffd}"), Some('\u{10fffd}'));
        assert!(Font::from_bytes(b"no font".to_vec()).is_err());
        let same = Font::from_bytes(dejavu::sans::regular().to_vec()).unwrap();
        assert_eq!(same.width("c_pe (eV)", 12.0), font.width("c_pe (eV)", 12.0));
    }
}
