//! What colors mean: a bar with ticks for numbers, a list of names for kinds.

use tyndall::scene::color::{Key, Legend, Scale};

use super::font::Font;
use super::mark::{Align, Block, Direction, Ink, Mark, rectangle, stroke, thickness};
use super::place::{Place, margin};
use super::ticks::{superscript, ticks};

/// The heading of a key if nobody says another: the quantity's name and its unit, with raised exponents.
pub fn title(legend: &Legend) -> String {
    match &legend.unit {
        Some(unit) => format!("{} ({})", legend.label, raised(unit)),
        None => legend.label.clone(),
    }
}

/// A unit with `^2`, `**2` and `^-3` as small raised digits.
fn raised(unit: &str) -> String {
    let unit = unit.replace("**", "^");
    let mut parts = unit.split('^');
    let mut text = parts.next().unwrap_or_default().to_string();
    for part in parts {
        let signed = part.strip_prefix('-').map_or(0, |_| 1);
        let digits =
            part[signed..].find(|it: char| !it.is_ascii_digit()).unwrap_or(part.len() - signed) + signed;
        match part[..digits].parse() {
            Ok(exponent) => text += &(superscript(exponent) + &part[digits..]),
            Err(_) => text += &format!("^{part}"),
        }
    }
    text
}

/// Where a key is to stand.
pub(super) struct Room<'a> {
    pub(super) em: f32,
    pub(super) font: &'a Font,
    /// Of the picture.
    pub(super) size: [u32; 2],
    /// None if the key is a picture of its own.
    pub(super) place: Option<Place>,
}

impl Room<'_> {
    /// Whether a key is read from its right edge.
    fn is_right(&self) -> bool {
        matches!(self.place, Some(Place::Right | Place::TopRight | Place::BottomRight))
    }

    /// The length of a bar, in whole pixels.
    fn length(&self) -> f32 {
        let [width, height] = self.size.map(|it| it as f32);
        let share = match self.place {
            None => 1.0,
            Some(Place::Left | Place::Right | Place::Top | Place::Bottom) => 0.5,
            Some(_) => 0.3,
        };
        (share * if self.is_flat() { width } else { height }).round().max(2.0)
    }

    /// Whether a bar lies.
    fn is_flat(&self) -> bool {
        matches!(self.place, Some(Place::Top | Place::Bottom))
    }
}

/// The name of what has no value.
const MISSING: &str = "no value";

/// The names of kinds.
pub(super) fn names(legend: &Legend) -> impl Iterator<Item = &str> {
    let kinds = match &legend.key {
        Key::Kinds(kinds) => &kinds[..],
        Key::Amounts(_) => &[],
    };
    kinds.iter().map(|(name, _)| name.as_str())
}

/// A key under its heading.
pub(super) fn block(legend: &Legend, heading: &str, room: &Room) -> Block {
    let key = match &legend.key {
        Key::Amounts(scale) if room.is_flat() => lying(scale, room),
        Key::Amounts(scale) => standing(scale, legend.missing, room),
        Key::Kinds(kinds) => list(kinds, legend.missing, room),
    };
    headed(heading, key, room)
}

/// A block under a line of text, on the side where the picture ends.
fn headed(heading: &str, block: Block, room: &Room) -> Block {
    if heading.is_empty() {
        return block;
    }
    let Room { em, font, .. } = *room;
    let room_px = room.size[0] as f32 - 2.0 * margin(em);
    let em = if room.place.is_some() { em * (room_px / font.width(heading, em)).min(1.0) } else { em };
    let width = font.width(heading, em);
    let all = width.max(block.size[0]);
    let top = (font.ascent(em) + font.descent(em) + 0.25 * em).round();
    let [start, align] = match (room.is_right(), room.is_flat()) {
        (true, _) => [all, 1.0],
        (false, true) => [0.5 * all, 0.5],
        (false, false) => [0.0, 0.0],
    };
    let at = [start, font.ascent(em)];
    let aligned = if align == 1.0 {
        Align::Right
    } else if align == 0.5 {
        Align::Center
    } else {
        Align::Left
    };
    let mut marks = vec![Mark::Text { text: heading.into(), at, em, align: aligned }];
    let [x, y] = [(align * (all - block.size[0])).round(), top];
    marks.extend(block.marks.into_iter().map(|mark| mark.moved([x, y])));
    Block { size: [all, top + block.size[1]], marks }
}

/// A bar from below to above, with numbers at its right.
fn standing(scale: &Scale, missing: Option<[u8; 3]>, room: &Room) -> Block {
    let Room { em, font, .. } = *room;
    let (length, wide, line) = (room.length(), em.round(), thickness(em));
    let arrow = (0.9 * em).round();
    let [below, above] = [scale.below, scale.above].map(|it| if it.is_some() { arrow } else { 0.0 });
    // Numbers at the ends are as high as the bar is longer.
    let half = (0.5 * font.figure_height(em)).ceil();
    let top = above.max(half);
    let bottom = top + length;
    let mut marks = vec![Mark::Colors {
        corner: [line, top],
        size: [wide, length],
        colors: scale.colors.clone(),
        direction: Direction::Up,
    }];
    let [left, middle, right] = [0.5 * line, line + 0.5 * wide, wide + 1.5 * line];
    let (low, high) = (bottom + 0.5 * line, top - 0.5 * line);
    let mut corners = vec![[left, low], [left, high]];
    if let Some(color) = scale.above {
        let tip = [middle, top - above];
        marks
            .push(Mark::Area { corners: vec![[line, top], tip, [line + wide, top]], ink: Ink::Color(color) });
        corners.push(tip);
    }
    corners.extend([[right, high], [right, low]]);
    if let Some(color) = scale.below {
        let tip = [middle, bottom + below];
        marks.push(Mark::Area {
            corners: vec![[line, bottom], tip, [line + wide, bottom]],
            ink: Ink::Color(color),
        });
        corners.push(tip);
    }
    marks.extend(outline(&corners, line));

    let (outer, tick, gap) = (wide + 2.0 * line, (0.35 * em).round().max(2.0), (0.3 * em).round());
    let most = (length / (2.2 * em)) as usize;
    let mut widest = 0.0_f32;
    for mark in ticks(scale, most.clamp(2, 7)) {
        let y = bottom - scale.place(mark.value) as f32 * length;
        let reach = if mark.label.is_some() { tick } else { (0.5 * tick).round() };
        marks.push(rectangle([outer, (y - 0.5 * line).round()], [reach, line], Ink::Text));
        if let Some(text) = mark.label {
            widest = widest.max(font.width(&text, em));
            let at = [outer + tick + gap, y + 0.5 * font.figure_height(em)];
            marks.push(Mark::Text { text, at, em, align: Align::Left });
        }
    }
    let mut size = [outer + tick + gap + widest, bottom + below.max(half)];
    if let Some(color) = missing {
        let swatch = swatch([0.0, size[1] + (0.5 * em).round()], MISSING, color, room);
        size = [size[0].max(swatch.size[0]), swatch.size[1]];
        marks.extend(swatch.marks);
    }
    Block { size, marks }
}

/// A bar from the left to the right, with numbers below.
fn lying(scale: &Scale, room: &Room) -> Block {
    let Room { em, font, .. } = *room;
    let (length, high, line) = (room.length(), em.round(), thickness(em));
    let arrow = (0.9 * em).round();
    let [below, above] = [scale.below, scale.above].map(|it| if it.is_some() { arrow } else { 0.0 });
    let (tick, gap) = ((0.35 * em).round().max(2.0), (0.25 * em).round());
    // As many numbers as stand apart from each other.
    let fits = |most: &usize| {
        let labels = ticks(scale, *most).into_iter().filter_map(|it| it.label);
        let widest = labels.map(|it| font.width(&it, em)).fold(0.0, f32::max);
        *most as f32 * (widest + 1.2 * em) <= length
    };
    let most = (2..=7).rev().find(fits).unwrap_or(2);
    let all = ticks(scale, most);
    let half = |value: f64| {
        let label = all.iter().find(|it| it.value == value).and_then(|it| it.label.as_ref());
        label.map_or(0.0, |text| 0.5 * font.width(text, em))
    };
    let over = |text: f32, at: f32| (text - at).max(0.0).ceil();
    let labeled = || all.iter().filter(|it| it.label.is_some());
    let x_of = |value: f64| scale.place(value) as f32 * length;
    let before = labeled().map(|it| over(half(it.value), x_of(it.value))).fold(below, f32::max);
    let behind = labeled().map(|it| over(half(it.value), length - x_of(it.value))).fold(above, f32::max);
    let (left, right) = (before, before + length);
    let mut marks = vec![Mark::Colors {
        corner: [left, line],
        size: [length, high],
        colors: scale.colors.clone(),
        direction: Direction::Right,
    }];
    let [top, middle, bottom] = [0.5 * line, line + 0.5 * high, high + 1.5 * line];
    let (first, last) = (left - 0.5 * line, right + 0.5 * line);
    let mut corners = vec![[first, top], [last, top]];
    if let Some(color) = scale.above {
        let tip = [right + above, middle];
        marks.push(Mark::Area {
            corners: vec![[right, line], tip, [right, line + high]],
            ink: Ink::Color(color),
        });
        corners.push(tip);
    }
    corners.extend([[last, bottom], [first, bottom]]);
    if let Some(color) = scale.below {
        let tip = [left - below, middle];
        marks.push(Mark::Area {
            corners: vec![[left, line], tip, [left, line + high]],
            ink: Ink::Color(color),
        });
        corners.push(tip);
    }
    marks.extend(outline(&corners, line));
    let outer = high + 2.0 * line;
    let baseline = outer + tick + gap + font.figure_height(em);
    for mark in &all {
        let x = left + x_of(mark.value);
        let reach = if mark.label.is_some() { tick } else { (0.5 * tick).round() };
        marks.push(rectangle([(x - 0.5 * line).round(), outer], [line, reach], Ink::Text));
        if let Some(text) = &mark.label {
            marks.push(Mark::Text { text: text.clone(), at: [x, baseline], em, align: Align::Center });
        }
    }
    Block { size: [right + behind, baseline + font.descent(em)], marks }
}

/// The line around a polygon.
fn outline(corners: &[[f32; 2]], line: f32) -> impl Iterator<Item = Mark> {
    let next = corners.iter().cycle().skip(1);
    corners.iter().zip(next).map(move |(&from, &to)| stroke(from, to, line, Ink::Text))
}

/// A square of a color before its name, at `corner`; the block reaches from the origin to its end.
fn swatch([x, y]: [f32; 2], name: &str, color: [u8; 3], room: &Room) -> Block {
    let Room { em, font, .. } = *room;
    let (edge, line) = (em.round(), thickness(em));
    let inner = [edge - 2.0 * line; 2];
    let text = [x + edge + (0.45 * em).round(), y + 0.5 * (edge + font.figure_height(em))];
    let marks = vec![
        rectangle([x, y], [edge; 2], Ink::Text),
        Mark::Colors {
            corner: [x + line, y + line],
            size: inner,
            colors: vec![color],
            direction: Direction::Up,
        },
        Mark::Text { text: name.into(), at: text, em, align: Align::Left },
    ];
    Block { size: [text[0] + font.width(name, em), y + edge], marks }
}

/// Kinds that a list names, at most.
const MOST: usize = 60;

/// Colors and names, in as many columns as are needed.
fn list(kinds: &[(String, [u8; 3])], missing: Option<[u8; 3]>, room: &Room) -> Block {
    let Room { em, font, size, place } = *room;
    let (row, gap) = ((1.5 * em).round(), (1.2 * em).round());
    let missing = missing.map(|color| (MISSING.to_string(), color));
    let entries: Vec<&(String, [u8; 3])> = kinds.iter().take(MOST).chain(&missing).collect();
    let room_px = size[1] as f32 - if place.is_some() { 6.0 * em } else { 0.0 };
    let rows = match place {
        Some(Place::Top | Place::Bottom) => 1,
        _ => ((room_px / row) as usize).clamp(1, entries.len().max(1)),
    };
    let mut block = Block::default();
    let mut x = 0.0;
    for column in entries.chunks(rows) {
        let mut widest = 0.0_f32;
        for (place, (name, color)) in column.iter().enumerate() {
            let swatch = swatch([x, place as f32 * row], name, *color, room);
            widest = widest.max(swatch.size[0]);
            block.size[1] = block.size[1].max(swatch.size[1]);
            block.marks.extend(swatch.marks);
        }
        block.size[0] = widest;
        x = (widest + gap).round();
    }
    if kinds.len() > MOST {
        let text = format!("and {} more", kinds.len() - MOST);
        let at = [0.0, block.size[1] + 1.3 * em];
        block.size = [block.size[0].max(font.width(&text, em)), at[1] + font.descent(em)];
        block.marks.push(Mark::Text { text, at, em, align: Align::Left });
    }
    block
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headings_have_the_unit_with_raised_exponents() {
        for (unit, wanted) in [
            ("kg/m^3", "kg/m³"),
            ("m^-2 s", "m⁻² s"),
            ("cm**2", "cm²"),
            ("a^b", "a^b"),
            ("x^", "x^"),
            ("K", "K"),
        ] {
            assert_eq!(raised(unit), wanted);
        }
    }
}
