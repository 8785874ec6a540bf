//! Pictures of numbers: curves, and panels side by side with their titles, as PNG.

use std::path::Path;

use plotters::prelude::*;
use plotters::style::{FontStyle, register_font};
use tyndall::Image;
use tyndall::srgb::{encoded_from_linear, linear_from_encoded};
use tyndall_io::write::{self, ImageOptions};

use crate::report::{Failure, Outcome};

const FONT: &str = "sans-serif";

/// Makes letters available; none of the system's fonts is asked for.
pub(super) fn load_font() {
    // A font that cannot be read leaves the plots without letters, which the embedded one does not.
    let _ = register_font(FONT, FontStyle::Normal, dejavu::sans::regular());
}

/// Pixels of three bytes, row by row.
pub(super) struct Canvas {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) bytes: Vec<u8>,
}

impl Canvas {
    /// An image's colors, each pixel as a square of `scale` x `scale`.
    pub(super) fn of(image: &Image, scale: u32) -> Self {
        let color = |at: usize| {
            let [r, g, b, _] = image.color[at];
            [r, g, b].map(|value| (255.0 * encoded_from_linear(value).clamp(0.0, 1.0)).round() as u8)
        };
        Self::new(image.width, image.height, scale, color)
    }

    /// A picture of `width` x `height` cells of `scale` x `scale` pixels, by the cells' places.
    pub(super) fn new(width: u32, height: u32, scale: u32, color: impl Fn(usize) -> [u8; 3]) -> Self {
        let row = |y: u32| (0..width * scale).map(move |x| (y / scale * width + x / scale) as usize);
        let bytes = (0..height * scale).flat_map(row).flat_map(color).collect();
        Self { width: width * scale, height: height * scale, bytes }
    }

    /// Writes it as a PNG.
    pub(super) fn save(&self, path: &Path) -> Outcome<()> {
        let linear = |byte: u8| linear_from_encoded(f32::from(byte) / 255.0);
        let color: Vec<[f32; 4]> = self
            .bytes
            .chunks_exact(3)
            .map(|rgb| [linear(rgb[0]), linear(rgb[1]), linear(rgb[2]), 1.0])
            .collect();
        let (depth, id) = (vec![f32::INFINITY; color.len()], vec![-1; color.len()]);
        let image = Image { width: self.width, height: self.height, color, depth, id };
        write::image(path, &image, &ImageOptions::default()).map_err(Failure::Output)
    }
}

/// What a drawing that went wrong is reported as.
fn failed(error: impl std::fmt::Display) -> Failure {
    Failure::Partial(format!("a plot could not be drawn: {error}"))
}

/// Panels side by side, each under its title.
pub(super) fn panels(path: &Path, panels: &[(String, Canvas)]) -> Outcome<()> {
    const TITLE: u32 = 26;
    const GAP: u32 = 8;
    let width = panels.iter().map(|(_, panel)| panel.width + GAP).sum::<u32>() - GAP;
    let height = TITLE + panels.iter().map(|(_, panel)| panel.height).max().unwrap_or(0);
    let mut canvas = Canvas { width, height, bytes: vec![255; (width * height * 3) as usize] };
    let mut left = 0;
    for (_, panel) in panels {
        for y in 0..panel.height {
            let from = (y * panel.width * 3) as usize;
            let to = (((y + TITLE) * width + left) * 3) as usize;
            let length = (panel.width * 3) as usize;
            canvas.bytes[to..to + length].copy_from_slice(&panel.bytes[from..from + length]);
        }
        left += panel.width + GAP;
    }
    {
        let area = BitMapBackend::with_buffer(&mut canvas.bytes, (width, height)).into_drawing_area();
        let mut left = 2;
        for (title, panel) in panels {
            let style = (FONT, 15).into_font().color(&BLACK);
            area.draw_text(title, &style, (left, 5)).map_err(failed)?;
            left += (panel.width + GAP) as i32;
        }
        area.present().map_err(failed)?;
    }
    canvas.save(path)
}

/// A line in a plot.
pub(super) struct Line {
    pub(super) name: String,
    pub(super) color: [u8; 3],
    pub(super) points: Vec<(f64, f64)>,
}

/// Lines over a common axis that starts at 0.
pub(super) fn lines(path: &Path, title: &str, axes: [&str; 2], lines: &[Line]) -> Outcome<()> {
    let (width, height) = (640, 400);
    let points = || lines.iter().flat_map(|line| &line.points);
    let right = points().map(|point| point.0).fold(1.0, f64::max);
    let top = 1.1 * points().map(|point| point.1).filter(|y| y.is_finite()).fold(1e-9, f64::max);
    let mut canvas = Canvas { width, height, bytes: vec![255; (width * height * 3) as usize] };
    {
        let area = BitMapBackend::with_buffer(&mut canvas.bytes, (width, height)).into_drawing_area();
        area.fill(&WHITE).map_err(failed)?;
        let mut chart = ChartBuilder::on(&area)
            .caption(title, (FONT, 16))
            .margin(8)
            .x_label_area_size(36)
            .y_label_area_size(52)
            .build_cartesian_2d(0.0..right, 0.0..top)
            .map_err(failed)?;
        let mesh = &mut chart.configure_mesh();
        mesh.x_desc(axes[0]).y_desc(axes[1]).label_style((FONT, 12)).axis_desc_style((FONT, 13));
        mesh.light_line_style(WHITE).draw().map_err(failed)?;
        for line in lines {
            let style = RGBColor(line.color[0], line.color[1], line.color[2]).stroke_width(2);
            let drawn = chart.draw_series(LineSeries::new(line.points.iter().copied(), style));
            drawn
                .map_err(failed)?
                .label(&line.name)
                .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 18, y)], style));
        }
        let labels = &mut chart.configure_series_labels();
        labels.background_style(WHITE.mix(0.8)).border_style(BLACK).label_font((FONT, 12));
        labels.position(SeriesLabelPosition::LowerRight).draw().map_err(failed)?;
        area.present().map_err(failed)?;
    }
    canvas.save(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plots_have_letters_and_lines() {
        load_font();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("plot.png");
        let line = Line { name: "a".into(), color: [200, 0, 0], points: vec![(0.0, 1.0), (10.0, 2.0)] };
        lines(&path, "title", ["x", "y"], &[line]).unwrap();
        let panel = |value: u8| ("panel".to_string(), Canvas::new(2, 2, 20, |_| [value; 3]));
        let both = folder.path().join("panels.png");
        panels(&both, &[panel(0), panel(128)]).unwrap();
        let read = |path: &Path| {
            let file = std::io::BufReader::new(std::fs::File::open(path).unwrap());
            let mut reader = png::Decoder::new(file).read_info().unwrap();
            let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
            let info = reader.next_frame(&mut bytes).unwrap();
            (info.width, info.height, bytes)
        };
        let (width, height, bytes) = read(&path);
        assert_eq!((width, height), (640, 400));
        assert!(bytes.chunks(3).any(|rgb| rgb == [200, 0, 0]), "no line");
        let (width, height, bytes) = read(&both);
        assert_eq!((width, height), (88, 66));
        assert!(bytes[..88 * 26 * 3].iter().any(|&byte| byte < 100), "no title");
        assert_eq!(&bytes[88 * 26 * 3..][..3], [0; 3]);
        assert_eq!(&bytes[(88 * 26 + 48) * 3..][..3], [128; 3]);
    }
}
