use super::mark::Direction;
use super::*;
use tyndall::scene::color::{Key, Scale};
use tyndall::scene::coloring::Norm;

const SIZE: [u32; 2] = [400, 300];
const WHITE: Behind = Behind::Color([1.0; 3]);

/// A white picture that shows something where `is_data` says so.
fn picture([width, height]: [u32; 2], is_data: impl Fn(u32, u32) -> bool) -> Image {
    let mut image = Image { width, height, ..Image::default() };
    for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
        let data = is_data(x, y);
        image.color.push(if data { [0.5, 0.0, 0.0, 1.0] } else { [1.0; 4] });
        image.depth.push(if data { 1.0 } else { f32::INFINITY });
        image.id.push(if data { 0 } else { -1 });
    }
    image
}

fn legend() -> Legend {
    let colors = (0..255).map(|level| [level as u8, 255 - level as u8, 7]).collect();
    let scale = Scale { norm: Norm::Linear, low: -1.0, high: 3.0, colors, below: None, above: None };
    Legend { label: "c_pe".into(), unit: Some("eV".into()), key: Key::Amounts(scale), missing: None }
}

fn kinds(names: &[&str]) -> Legend {
    let kinds = names.iter().map(|name| (name.to_string(), [200, 10, 10])).collect();
    Legend { label: "type".into(), unit: None, key: Key::Kinds(kinds), missing: None }
}

fn item(what: What) -> Item {
    Item { what, at: None }
}

fn bar() -> Item {
    let legend = legend();
    item(What::Key(legend.clone(), title(&legend)))
}

fn all() -> Annotations {
    let scale_bar = ScaleBar { pixels: 70.5, label: "20 Å".into(), description: String::new() };
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let items = [
        What::Title("Title".into()),
        What::Label("t = 2 ps".into()),
        What::ScaleBar(scale_bar),
        What::Axes(axes),
    ];
    Annotations { style: Style::default(), items: items.into_iter().map(item).chain([bar()]).collect() }
}

/// Left, upper, right and lower edge of each item.
fn edges(annotations: &Annotations, arrangement: &Arrangement, size: [u32; 2]) -> Vec<[f32; 4]> {
    let of = |item: &Item| {
        let (block, [x, y]) = place::placed(annotations, item, arrangement, size).unwrap();
        [x, y, x + block.size[0], y + block.size[1]]
    };
    annotations.items.iter().map(of).collect()
}

#[test]
fn a_bar_has_the_colors_of_the_particles_and_they_rise() {
    let image = picture(SIZE, |_, _| false);
    let annotations = Annotations { style: Style::default(), items: vec![bar()] };
    let mut color = image.color.clone();
    annotations.lay_out(&annotations.arrange(SIZE, &image, WHITE), SIZE, WHITE).draw(0, &mut color);
    let is_of_bar = |color: &[u8; 3]| color[2] == 7 && color[0] == 255 - color[1];
    let bytes: Vec<[u8; 3]> = color
        .iter()
        .map(|pixel| [0, 1, 2].map(|c| (255.0 * tyndall::srgb::encoded_from_linear(pixel[c])).round() as u8))
        .collect();
    let column = (0..SIZE[0])
        .rev()
        .find(|x| bytes.chunks(SIZE[0] as usize).any(|row| is_of_bar(&row[*x as usize])))
        .unwrap();
    let run: Vec<[u8; 3]> =
        bytes.chunks(SIZE[0] as usize).map(|row| row[column as usize]).filter(is_of_bar).collect();
    assert_eq!(run.len(), 150, "half of the picture's height");
    for (row, found) in run.iter().rev().enumerate() {
        let share = (row as f64 + 0.5) / 150.0;
        let level = (share * 255.0) as u8;
        assert_eq!(*found, [level, 255 - level, 7], "row {row}");
    }
}

#[test]
fn places_are_where_no_data_is() {
    let place = |is_data: &dyn Fn(u32, u32) -> bool, item: Item| {
        let image = picture(SIZE, is_data);
        let annotations = Annotations { style: Style::default(), items: vec![item] };
        let [left, top, right, bottom] =
            edges(&annotations, &annotations.arrange(SIZE, &image, WHITE), SIZE)[0];
        [0.5 * (left + right), 0.5 * (top + bottom)]
    };
    let (width, height) = (SIZE[0] as f32, SIZE[1] as f32);
    assert!(place(&|_, _| false, bar())[0] > 0.8 * width, "the right edge, if nothing is there");
    assert!(place(&|x, _| x > 150, bar())[0] < 0.3 * width);
    assert!(place(&|_, y| y < 200, bar())[1] > 0.6 * height);
    assert!(
        place(&|_, _| true, bar())[0] > 0.8 * width,
        "where all is full the first place is as good as any"
    );
    let asked = Item { at: Some(Place::TopLeft), ..bar() };
    let [x, y] = place(&|x, _| x < 200, asked);
    assert!(x < 0.4 * width && y < 0.5 * height, "what is asked for counts");
}

#[test]
fn bands_of_rows_are_the_rows_of_the_picture() {
    let annotations = all();
    let image = picture(SIZE, |x, y| x > 100 && y > 90);
    // Places by a picture of a quarter of the size.
    let small = picture([100, 75], |x, y| x > 25 && y > 22);
    let arrangement = annotations.arrange(SIZE, &small, WHITE);
    assert_eq!(arrangement, annotations.arrange(SIZE, &image, WHITE));
    let layout = annotations.lay_out(&arrangement, SIZE, WHITE);
    let mut whole = image.color.clone();
    layout.draw(0, &mut whole);
    let mut bands = image.color.clone();
    let mut first = 0;
    for rows in [1, 7, 60, 31, 200, 1] {
        let start = (SIZE[0] * first) as usize;
        layout.draw(first, &mut bands[start..start + (SIZE[0] * rows) as usize]);
        first += rows;
    }
    assert_eq!(first, SIZE[1]);
    assert!(bands == whole && whole != image.color);
}

#[test]
fn items_do_not_overlap_and_stay_inside_at_any_size() {
    for size in [[160, 120], [480, 270], [400, 800], [1280, 720]] {
        let mut annotations = all();
        for at in [None, Some(Place::BottomLeft)] {
            annotations.items.iter_mut().take(4).for_each(|item| item.at = at);
            let image = picture([size[0], size[1]], |x, y| {
                x.abs_diff(size[0] / 2) + y.abs_diff(size[1] / 2) < size[1] / 3
            });
            let found = edges(&annotations, &annotations.arrange(size, &image, WHITE), size);
            for (place, a) in found.iter().enumerate() {
                assert!(
                    a[0] >= 0.0 && a[1] >= 0.0 && a[2] <= size[0] as f32 && a[3] <= size[1] as f32,
                    "{size:?} {a:?}"
                );
                for b in &found[..place] {
                    let apart = a[2] <= b[0] || b[2] <= a[0] || a[3] <= b[1] || b[3] <= a[1];
                    assert!(apart, "{size:?} {at:?}: {a:?} {b:?}");
                }
            }
        }
    }
}

#[test]
fn annotations_grow_with_the_picture() {
    let annotations = all();
    for item in annotations.items.iter().filter(|item| !matches!(item.what, What::ScaleBar(_))) {
        let [small, large] =
            [[1920, 1080], [7680, 4320]].map(|size| annotations.block(item, Place::Right, size).size);
        for axis in 0..2 {
            assert!((large[axis] / small[axis] - 4.0).abs() < 0.1, "{small:?} {large:?}");
        }
    }
    assert!(annotations.em([480, 270]) >= LEAST_EM, "small pictures stay legible");
}

#[test]
fn texts_stand_out_from_data_and_change_nothing_elsewhere() {
    let title = Annotations { style: Style::default(), items: vec![item(What::Title("mmm".into()))] };
    let draw = |behind: Behind, start: [f32; 4]| {
        let image = picture(SIZE, |_, _| false);
        let mut color = vec![start; image.color.len()];
        title.lay_out(&title.arrange(SIZE, &image, behind), SIZE, behind).draw(0, &mut color);
        color
    };
    // On what is behind the data there is the text and nothing else.
    let plain = draw(WHITE, [1.0; 4]);
    assert!(plain.iter().all(|it| it[0] == it[1] && it[1] == it[2] && it[3] == 1.0));
    assert!(plain.iter().any(|it| it[0] < 0.01), "black on white");
    let layer = draw(WHITE, [0.0; 4]);
    for (on_white, alone) in plain.iter().zip(&layer) {
        assert!((on_white[0] - (1.0 - alone[3])).abs() < 1e-5, "the layer is the same text");
        assert!(alone[..3].iter().all(|it| *it == 0.0));
    }
    // Over data it has a bright rim.
    let over = draw(WHITE, [0.1, 0.0, 0.0, 1.0]);
    let bright = over.iter().filter(|it| it[1] > 0.5).count();
    assert!(bright > 100, "{bright}");
    assert!(
        draw(Behind::Color([0.0; 3]), [0.0, 0.0, 0.0, 1.0]).iter().any(|it| it[0] > 0.99),
        "white on black"
    );
    assert_eq!((title.ink(Behind::Nothing), title.ink(Behind::Color([0.3; 3]))), ([0; 3], [0; 3]));
}

#[test]
fn what_is_out_of_range_or_missing_is_shown_beside_the_bar() {
    let mut legend = legend();
    let Key::Amounts(scale) = &mut legend.key else { unreachable!("it is a bar") };
    (scale.below, scale.above) = (Some([1, 2, 3]), Some([4, 5, 6]));
    legend.missing = Some([9, 9, 9]);
    for place in [Place::Right, Place::Bottom] {
        let annotations = Annotations {
            style: Style::default(),
            items: vec![item(What::Key(legend.clone(), String::new()))],
        };
        let block = annotations.block(&annotations.items[0], place, SIZE);
        for color in [[1, 2, 3], [4, 5, 6]] {
            let corners = block.marks.iter().find_map(|mark| match mark {
                Mark::Area { corners, ink: mark::Ink::Color(own) } if *own == color => Some(corners),
                _ => None,
            });
            assert_eq!(corners.map(Vec::len), Some(3), "a triangle at {place:?}");
        }
    }
    let svg = key_svg(&legend, "", &Style::default());
    assert!(
        svg.contains("#010203")
            && svg.contains("#040506")
            && svg.contains("#090909")
            && svg.contains("no value")
    );
}

#[test]
fn lists_of_kinds_take_columns_where_they_are_long() {
    let names: Vec<String> = (0..40).map(|kind| format!("kind {kind}")).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let block = |names: &[&str]| {
        let annotations = Annotations {
            style: Style::default(),
            items: vec![item(What::Key(kinds(names), "type".into()))],
        };
        annotations.block(&annotations.items[0], Place::TopRight, SIZE)
    };
    let (few, many) = (block(&names[..5]), block(&names));
    assert!(many.size[1] <= SIZE[1] as f32 && many.size[0] > 2.0 * few.size[0]);
    let swatches = |block: &Block| block.marks.iter().filter(|it| matches!(it, Mark::Colors { .. })).count();
    assert_eq!((swatches(&few), swatches(&many)), (5, 40));
    assert_eq!(key::names(&kinds(&["O", "H"])).collect::<Vec<_>>(), ["O", "H"]);
}

#[test]
fn svg_is_well_formed_and_has_every_color_in_its_place() {
    let svg = key_svg(&legend(), "a < b & c_pe (eV)", &Style::default());
    let mut reader = quick_xml::Reader::from_str(&svg);
    let mut rectangles = Vec::new();
    let mut texts = Vec::new();
    loop {
        match reader.read_event().unwrap() {
            quick_xml::events::Event::Eof => break,
            quick_xml::events::Event::Empty(node) if node.name().as_ref() == "rect" => {
                let value = |name: &str| {
                    let found = node.try_get_attribute(name).unwrap().unwrap();
                    found.value.to_string()
                };
                let [y, height] = ["y", "height"].map(|name| value(name).parse::<f32>().unwrap());
                rectangles.push((y, height, value("fill")));
            }
            quick_xml::events::Event::Text(text) => texts.push(text.to_string()),
            _ => {}
        }
    }
    let colors: Vec<&(f32, f32, String)> = rectangles.iter().filter(|it| it.2.ends_with("07")).collect();
    assert_eq!(colors.len(), 255);
    for (level, (y, height, fill)) in colors.into_iter().enumerate() {
        assert_eq!(*fill, format!("#{level:02x}{:02x}07", 255 - level));
        let wanted = (255 - level) as f32 / 255.0 * 256.0;
        assert!(
            (height - wanted).abs() < 2e-3 && (*y - rectangles[0].0).abs() < 2e-3,
            "{level}: {y} {height}"
        );
    }
    assert!(texts.iter().any(|text| text.contains("c_pe (eV)")), "{texts:?}");
    assert!(texts.iter().any(|text| text == "\u{2212}1"), "{texts:?}");
}

#[test]
fn a_run_of_colors_is_read_at_the_middle_of_each_pixel() {
    let colors = vec![[0; 3], [10; 3], [20; 3], [30; 3]];
    let block = |direction, size| Block {
        size,
        marks: vec![Mark::Colors { corner: [0.0; 2], size, colors: colors.clone(), direction }],
    };
    let canvas = raster::Canvas { size: [4, 4], first_row: 0, text: [0; 3], rim: [0.0; 3] };
    let mut pixels = vec![[0.0; 4]; 16];
    let mut draw = |block: &Block, corner| {
        canvas.draw(&canvas.marks(block, corner, &Font::embedded()), &mut pixels);
    };
    draw(&block(Direction::Right, [4.0, 1.0]), [0.0; 2]);
    draw(&block(Direction::Up, [1.0, 2.0]), [0.0, 2.0]);
    let wanted = [0, 10, 20, 30].map(|byte| linear([byte; 3])[0]);
    assert_eq!(pixels[..4].iter().map(|it| it[0]).collect::<Vec<_>>(), wanted);
    assert_eq!([pixels[12][0], pixels[8][0]], [wanted[1], wanted[3]]);
}
