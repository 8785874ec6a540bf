//! What annotations are made of: areas, texts and runs of colors in a block of its own, in pixels from its upper left corner, y down.

/// Marks, in the order in which they are drawn, and the size of what they take.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Block {
    pub(super) size: [f32; 2],
    pub(super) marks: Vec<Mark>,
}

/// A part of an annotation.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Mark {
    /// A polygon.
    Area { corners: Vec<[f32; 2]>, ink: Ink },
    /// A line of text on the height of `at`, which is its beginning, middle or end.
    Text { text: String, at: [f32; 2], em: f32, align: Align },
    /// A rectangle of equal shares of colors, from the left to the right or from below to above. Its corner and size are whole pixels.
    Colors { corner: [f32; 2], size: [f32; 2], colors: Vec<[u8; 3]>, direction: Direction },
}

impl Mark {
    /// The same elsewhere.
    pub(super) fn moved(self, [x, y]: [f32; 2]) -> Self {
        let place = |at: [f32; 2]| [at[0] + x, at[1] + y];
        match self {
            Self::Area { corners, ink } => {
                Self::Area { corners: corners.into_iter().map(place).collect(), ink }
            }
            Self::Text { text, at, em, align } => Self::Text { text, at: place(at), em, align },
            Self::Colors { corner, size, colors, direction } => {
                Self::Colors { corner: place(corner), size, colors, direction }
            }
        }
    }
}

/// With what an area is filled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Ink {
    /// As texts are.
    Text,
    /// An sRGB color.
    Color([u8; 3]),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Align {
    Left,
    Center,
    Right,
}

impl Align {
    /// Where a text of that width begins if it stands at `x`.
    pub(super) fn start(self, x: f32, width: f32) -> f32 {
        match self {
            Self::Left => x,
            Self::Center => x - 0.5 * width,
            Self::Right => x - width,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Direction {
    Right,
    Up,
}

/// A rectangle.
pub(super) fn rectangle([x, y]: [f32; 2], [width, height]: [f32; 2], ink: Ink) -> Mark {
    let corners = vec![[x, y], [x + width, y], [x + width, y + height], [x, y + height]];
    Mark::Area { corners, ink }
}

/// A straight line of that thickness, which goes on by half of it at both ends.
pub(super) fn stroke(from: [f32; 2], to: [f32; 2], thickness: f32, ink: Ink) -> Mark {
    let along = [to[0] - from[0], to[1] - from[1]];
    let length = along[0].hypot(along[1]).max(1e-6);
    let [x, y] = along.map(|it| 0.5 * thickness * it / length);
    let corners = vec![
        [from[0] - x - y, from[1] - y + x],
        [from[0] - x + y, from[1] - y - x],
        [to[0] + x + y, to[1] + y - x],
        [to[0] + x - y, to[1] + y + x],
    ];
    Mark::Area { corners, ink }
}

/// The thickness of lines beside text of that size: whole pixels.
pub(super) fn thickness(em: f32) -> f32 {
    (0.06 * em).round().max(1.0)
}
