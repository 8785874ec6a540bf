//! Annotations as SVG: areas are paths, texts are texts, and each color of a bar is a rectangle of its own, exactly.
//!
//! Source: Scalable Vector Graphics (SVG) 2, W3C 2018.

use std::fmt::Write as _;

use tyndall::scene::color::Legend;

use super::Style;
use super::key::{self, Room};
use super::mark::{Align, Block, Direction, Ink, Mark};

/// The size of text.
const EM: f32 = 16.0;
/// The length of a bar.
const LENGTH: u32 = 256;

/// What colors mean, as a picture of its own under a heading (see [`title`](super::title)), on nothing. Texts stay texts, in DejaVu Sans or
/// a font that is similar; in black if the style says nothing else.
pub fn key_svg(legend: &Legend, heading: &str, style: &Style) -> String {
    let em = EM * style.scale;
    let length = (LENGTH as f32 * style.scale).round() as u32;
    let room = Room { em, font: &style.font, size: [length; 2], place: None };
    svg(&key::block(legend, heading, &room), style.color.unwrap_or_default(), 0.5 * em)
}

fn svg(block: &Block, text: [u8; 3], margin: f32) -> String {
    let [width, height] = block.size.map(|it| (it + 2.0 * margin).ceil());
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" \
         font-family=\"'DejaVu Sans', Verdana, sans-serif\">\n"
    );
    let margin = margin.round();
    for mark in block.marks.iter().cloned().map(|mark| mark.moved([margin; 2])) {
        // Writing to a text cannot fail.
        let _ = match mark {
            Mark::Area { corners, ink } => {
                let points: Vec<String> =
                    corners.iter().map(|[x, y]| format!("{},{}", number(*x), number(*y))).collect();
                let fill = hex(if let Ink::Color(own) = ink { own } else { text });
                writeln!(svg, "<polygon points=\"{}\" fill=\"{fill}\"/>", points.join(" "))
            }
            Mark::Text { text: words, at: [x, y], em, align } => {
                let anchor = match align {
                    Align::Left => "start",
                    Align::Center => "middle",
                    Align::Right => "end",
                };
                let (x, y, em, fill, words) = (number(x), number(y), number(em), hex(text), escaped(&words));
                writeln!(
                    svg,
                    "<text x=\"{x}\" y=\"{y}\" font-size=\"{em}\" text-anchor=\"{anchor}\" fill=\"{fill}\">{words}</text>"
                )
            }
            Mark::Colors { corner, size, colors, direction } => {
                svg += &run(corner, size, &colors, direction);
                Ok(())
            }
        };
    }
    svg + "</svg>\n"
}

/// A rectangle a color. Each reaches to the end of the run and is covered by those after it, so that no seam shows between them.
fn run([x, y]: [f32; 2], [width, height]: [f32; 2], colors: &[[u8; 3]], direction: Direction) -> String {
    let mut svg = String::new();
    let mut before = None;
    for (place, &color) in
        colors.iter().enumerate().filter(|(_, color)| before.replace(**color) != Some(**color))
    {
        let left = 1.0 - place as f32 / colors.len() as f32;
        let [x, y, width, height] = match direction {
            Direction::Up => [x, y, width, left * height],
            Direction::Right => [x + (1.0 - left) * width, y, left * width, height],
        }
        .map(number);
        let fill = hex(color);
        svg +=
            &format!("<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" fill=\"{fill}\"/>\n");
    }
    svg
}

/// With three decimals at most.
fn number(value: f32) -> String {
    let text = format!("{value:.3}");
    text.trim_end_matches('0').trim_end_matches('.').to_string()
}

fn hex([red, green, blue]: [u8; 3]) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

/// What XML allows in a text: its signs are written as entities, control characters as blanks.
fn escaped(text: &str) -> String {
    let letter = |letter: char| match letter {
        '&' => "&amp;".to_string(),
        '<' => "&lt;".to_string(),
        '>' => "&gt;".to_string(),
        letter if letter.is_control() => " ".to_string(),
        letter => letter.to_string(),
    };
    text.chars().map(letter).collect()
}
