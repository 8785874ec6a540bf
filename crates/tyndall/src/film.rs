//! The finished picture, as plain columns of pixels, row by row from the top left.

/// A picture with its layers. Every column holds `width * height` values.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Image {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Linear RGB (Rec. 709 primaries), premultiplied by the alpha in the fourth place.
    pub color: Vec<[f32; 4]>,
    /// Distance from the eye along the ray (orthographic: from the plane through the eye), of the sample nearest the pixel's
    /// center, in the length unit of the particles; infinity where that sample met nothing.
    pub depth: Vec<f32>,
    /// Place in the file of the particle that the same sample met; -1 where it met nothing.
    pub id: Vec<i64>,
}

impl Image {
    /// Whether no sample met a particle: no pixel has an id, and all have the same color.
    pub fn shows_nothing(&self) -> bool {
        self.id.iter().all(|&id| id < 0) && self.color.iter().all(|&color| color == self.color[0])
    }
}
