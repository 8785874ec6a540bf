//! From the pixels' confidences to the depths at which their rays end (Walloner 2022, sections 4.2 and 5.3.3).
//!
//! Pixels decide together: where the mean of their confidences is high enough, what lies behind the largest of their depths is
//! culled. The thesis' neighborhood is a square around each pixel; that of Ibrahim et al. is a level of a pyramid in which each
//! pixel of a level has the mean confidence and the largest depth of 2 x 2 of the level below.

use super::{Neighborhood, Options};

/// The cull buffers of a picture's pixels after a frame, row by row.
pub(crate) struct Map {
    width: usize,
    height: usize,
    /// Depth and confidence.
    pairs: Vec<[f32; 2]>,
    /// Squares along an edge of a square that decides, on the level of `pairs` that decides.
    kernel: usize,
    /// Edge of what a pair stands for, in pixels, as a power of 2.
    level: u32,
}

impl Map {
    /// From the pairs of all pixels of a picture that is `width` wide.
    pub(crate) fn new(width: usize, pairs: Vec<[f32; 2]>, neighborhood: Neighborhood) -> Self {
        let height = pairs.len() / width.max(1);
        let (kernel, level) = match neighborhood {
            Neighborhood::Kernel(edge) => (edge as usize, 0),
            Neighborhood::Pyramid(level) => (1, level),
        };
        let base = Self { width, height, pairs, kernel, level: 0 };
        (0..level).fold(base, |map, _| map.halved())
    }

    /// The next level of the pyramid. At the border a pixel stands for those that there are.
    fn halved(&self) -> Self {
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let pairs = (0..width * height).map(|at| {
            let (x, y) = (at % width * 2, at / width * 2);
            self.over(x, x + 2, y, y + 2)
        });
        Self { width, height, pairs: pairs.collect(), kernel: self.kernel, level: self.level + 1 }
    }

    /// Largest depth and mean confidence of the pixels in [x0, x1) x [y0, y1) that there are.
    fn over(&self, x0: usize, x1: usize, y0: usize, y1: usize) -> [f32; 2] {
        let (x1, y1) = (x1.min(self.width), y1.min(self.height));
        let (mut depth, mut sum) = (0.0_f32, 0.0);
        for y in y0..y1 {
            for pair in &self.pairs[y * self.width + x0..y * self.width + x1] {
                depth = depth.max(pair[0]);
                sum += pair[1];
            }
        }
        [depth, sum / ((x1 - x0) * (y1 - y0)) as f32]
    }

    /// The depth behind which the pixel's rays meet nothing that would be seen; none if that is not sure enough.
    pub(crate) fn clip(&self, x: usize, y: usize, options: &Options) -> Option<f32> {
        let (x, y) = (x >> self.level, y >> self.level);
        let reach = self.kernel / 2;
        let [depth, confidence] =
            self.over(x.saturating_sub(reach), x + reach + 1, y.saturating_sub(reach), y + reach + 1);
        (confidence >= options.occlusion_confidence).then_some(depth)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(neighborhood: Neighborhood) -> Map {
        // 5 x 3: confidence 1 but for one pixel, depths by place.
        let mut pairs: Vec<[f32; 2]> = (0..15).map(|at| [at as f32, 1.0]).collect();
        pairs[6][1] = 0.5;
        Map::new(5, pairs, neighborhood)
    }

    fn clip(map: &Map, x: usize, y: usize, confidence: f32) -> Option<f32> {
        map.clip(x, y, &Options { occlusion_confidence: confidence, ..Options::default() })
    }

    #[test]
    fn one_pixel_decides_for_itself() {
        let map = map(Neighborhood::Kernel(1));
        assert_eq!(clip(&map, 1, 1, 0.95), None);
        assert_eq!(clip(&map, 2, 1, 0.95), Some(7.0));
    }

    #[test]
    fn a_kernel_takes_the_mean_confidence_and_the_largest_depth_of_the_pixels_that_there_are() {
        let map = map(Neighborhood::Kernel(3));
        // Eight of one and one of a half: 0.944.
        assert_eq!(clip(&map, 1, 1, 0.95), None);
        assert_eq!(clip(&map, 1, 1, 0.94), Some(12.0));
        // In the corner four pixels: 0.875.
        assert_eq!(clip(&map, 0, 0, 0.88), None);
        assert_eq!(clip(&map, 0, 0, 0.87), Some(6.0));
        assert_eq!(clip(&map, 4, 2, 0.95), Some(14.0));
    }

    #[test]
    fn a_level_of_the_pyramid_decides_for_squares() {
        let map = map(Neighborhood::Pyramid(1));
        // Pixels 0, 1, 5, 6.
        assert_eq!(clip(&map, 0, 0, 0.88), None);
        assert_eq!(clip(&map, 1, 1, 0.87), Some(6.0));
        // The last column and the last row stand alone.
        assert_eq!(clip(&map, 4, 2, 0.95), Some(14.0));
        assert_eq!(clip(&map, 4, 0, 0.95), Some(9.0));
        assert_eq!(clip(&self::map(Neighborhood::Pyramid(8)), 3, 1, 0.87), Some(14.0));
    }
}
