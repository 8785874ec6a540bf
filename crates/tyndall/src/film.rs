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
    /// A picture without particles: linear RGB `background` if there is one, else transparent.
    pub(crate) fn empty(width: u32, height: u32, background: Option<[f32; 3]>) -> Self {
        let pixels = width as usize * height as usize;
        let color = background.map_or([0.0; 4], |[r, g, b]| [r, g, b, 1.0]);
        let (color, depth, id) = (vec![color; pixels], vec![f32::INFINITY; pixels], vec![-1; pixels]);
        Self { width, height, color, depth, id }
    }

    /// Makes room for a picture of that size; what is in it then has no meaning.
    pub(crate) fn resize(&mut self, width: u32, height: u32) {
        let pixels = width as usize * height as usize;
        (self.width, self.height) = (width, height);
        self.color.resize(pixels, [0.0; 4]);
        self.depth.resize(pixels, f32::INFINITY);
        self.id.resize(pixels, -1);
    }

    /// Fills this picture with another, of which each pixel becomes a block of `edge` by `edge`.
    pub(crate) fn enlarge(&mut self, coarse: &Self, edge: u32) {
        let (width, edge) = (self.width as usize, edge as usize);
        let rows =
            self.color.chunks_mut(width).zip(self.depth.chunks_mut(width)).zip(self.id.chunks_mut(width));
        for (y, ((color, depth), id)) in rows.enumerate() {
            let first = y / edge * coarse.width as usize;
            for x in 0..width {
                let from = first + x / edge;
                (color[x], depth[x], id[x]) = (coarse.color[from], coarse.depth[from], coarse.id[from]);
            }
        }
    }

    /// Whether no sample met a particle: no pixel has an id, and all have the same color.
    pub fn shows_nothing(&self) -> bool {
        self.id.iter().all(|&id| id < 0) && self.color.iter().all(|&color| color == self.color[0])
    }
}
