//! What is written over pictures: bars whose colors are the pixels', scale bars, times, layers.

use super::{Folder, dump, line_of, png};

/// Rows of a PNG of that width.
fn rows(folder: &Folder, name: &str, width: usize) -> Vec<Vec<[u8; 3]>> {
    let (pixels, _, _) = png(&folder.path(name));
    let pixels: Vec<[u8; 3]> = pixels.chunks_exact(3).map(|it| [it[0], it[1], it[2]]).collect();
    pixels.chunks(width).map(<[_]>::to_vec).collect()
}

#[test]
fn the_colors_of_the_bar_are_those_of_the_pixels() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(9));
    let line = "a.xyz --look flat --color c_pe --range full --cmap gray --background red --radius 0.3 --view y --samples 1 \
                --device cpu --size 300x600 -q";
    folder.line(&format!("render {line} -o plain.png")).fine();
    folder.line(&format!("render {line} -o bar.png --bar --bar-at left --bar-file bar.svg --axes --title Line --annotation-color #00ff00")).fine();
    // Nine particles of 0.5 to 8.5: of each the one color that it has in the picture.
    let is_gray = |color: &[u8; 3]| color[0] == color[1] && color[1] == color[2];
    let mut colors: Vec<u8> =
        rows(&folder, "plain.png", 300).concat().into_iter().filter(is_gray).map(|it| it[0]).collect();
    colors.sort_unstable();
    colors.dedup();
    assert_eq!(colors.len(), 9, "{colors:?}");
    // The bar is a column of grays, and half as high as the picture; nothing else at the left is gray.
    let picture = rows(&folder, "bar.png", 300);
    let run = (0..150).find_map(|x| {
        let column = picture.iter().rev().map(|row| row[x]).filter(is_gray);
        let bar: Vec<u8> = column.map(|it| it[0]).collect();
        (bar.len() == 300 && bar.is_sorted()).then_some(bar)
    });
    let run = run.expect("a bar");
    for (k, color) in colors.iter().enumerate() {
        // The bar's pixel at the number.
        let at = ((k as f64 / 8.0) * 300.0).min(299.0) as usize;
        assert!(run[at].abs_diff(*color) <= 1, "{k}: {} in the bar, {color} in the picture", run[at]);
    }
    let svg = std::fs::read_to_string(folder.path("bar.svg")).unwrap();
    for color in colors {
        assert!(
            svg.contains(&format!("fill=\"#{color:02x}{color:02x}{color:02x}\"")),
            "{color} is not in the SVG"
        );
    }
    assert!(svg.contains(">c_pe</text>") && svg.contains(">2</text>"), "heading and numbers are texts");
}

#[test]
fn what_annotations_stand_for_is_said() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(9));
    folder.file("a.dump", dump("id x y z", 20.0, &["1 5 5 5", "2 9 9 9"]));
    let said =
        folder.render("a.xyz -o a.png --scalebar --time-label --cell --bar --color red --device cpu").fine();
    for part in [
        "note: scale bar ",
        " Å, at the distance of what the camera looks at",
        "warning: the frame has no time",
        "warning: --cell: the file has no cell",
        "warning: --bar: colors stand for no numbers or kinds (constant",
    ] {
        assert!(said.contains(part), "{part} is not in {said}");
    }
    let texts = png(&folder.path("a.png")).2;
    assert!(
        texts.iter().any(|(key, text)| key == "Annotations" && text.starts_with("scale bar")),
        "{texts:?}"
    );
    let said = folder
        .render("a.dump -o a.png --scalebar 5 --ortho auto --time-label --cell --alpha --device cpu")
        .fine();
    assert!(said.contains("note: scale bar 5, in the file's unit, which it does not say"), "{said}");
    assert!(
        said.contains("note: annotations are black") && !said.contains("warning: the frame has no time"),
        "{said}"
    );
}

#[test]
fn an_exr_has_annotations_as_a_layer_of_its_own() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(9));
    let said = folder.render("a.xyz -o a.exr --title Title --time-label {frame} --device cpu").fine();
    assert!(said.contains("note: annotations are the layer 'annotation' of the EXR"), "{said}");
    let exr = std::fs::read(folder.path("a.exr")).unwrap();
    for name in ["annotation.R", "annotation.G", "annotation.B", "annotation.A"] {
        assert!(exr.windows(name.len()).any(|it| it == name.as_bytes()), "{name}");
    }
}

#[test]
fn parts_and_pictures_for_two_eyes_are_annotated_as_pictures_of_their_own() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(9));
    let draw = |name: &str, words: &str| {
        let camera = "--eye 4,-20,0 --look-at 4,0,0 --radius 0.4 --look flat --samples 1 --size 200x120";
        folder.line(&format!("render a.xyz -o {name} {camera} {words} -q")).fine();
    };
    let over =
        "--scalebar 2 --scalebar-at bottom --title Line --title-at top-left --annotation-color #00ff00";
    // Rows that have something green, and the longest run of it.
    let green = |name: &str, width: usize| {
        let is_green = |color: &[u8; 3]| color[1] > color[0].max(color[2]);
        let run = |row: &[[u8; 3]]| row.split(|it| *it != [0, 255, 0]).map(<[_]>::len).max();
        let rows = rows(&folder, name, width);
        let longest = rows.iter().filter_map(|row| run(row)).max().unwrap();
        (rows.iter().filter(|row| row.iter().any(is_green)).count(), longest)
    };
    draw("whole.png", over);
    draw("part.png", &format!("{over} --crop 30,20,150,90"));
    let [whole, part] = [green("whole.png", 200), green("part.png", 150)];
    // A length is as many pixels in both.
    assert_eq!(whole.1, part.1);
    assert!(whole.0 > 10 && part.0 > 10, "{whole:?} {part:?}");

    draw("both.png", &format!("{over} --stereo side-by-side"));
    let both = rows(&folder, "both.png", 400);
    let differ = |(left, right): (&[u8; 3], &[u8; 3])| (left[1] > 200) != (right[1] > 200);
    // The same at the same places for both eyes: where the line of particles is not.
    for row in both[..40].iter().chain(&both[80..]) {
        let (left, right) = row.split_at(200);
        assert!(!left.iter().zip(right).any(differ));
    }
    assert_eq!(green("both.png", 400).1, whole.1);
    draw("glasses.png", &format!("{over} --stereo anaglyph"));
    draw("around.exr", "--panorama --title Line --axes --time-label {frame}");
    folder
        .render("a.xyz -o a.png --panorama --scalebar 1")
        .fails(2, &["--scalebar", "panoramas, which have no scale"]);
}

#[test]
fn movies_and_scene_files_have_annotations_too() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(9).repeat(3));
    folder.file("scene.toml", "[particles]\nfiles = ['a.xyz']\n[annotations]\ntitle = 'A < B'\nbar = true\naxes = true\nscalebar = 4\n");
    folder
        .render("scene.toml -o a.%d.png --device cpu --frames : --color c_pe --bar-file bar.%02d.svg")
        .fine();
    assert_eq!(
        folder.names(),
        ["a.0.png", "a.1.png", "a.2.png", "a.xyz", "bar.00.svg", "bar.01.svg", "bar.02.svg", "scene.toml"]
    );
    let plain = rows(&folder, "a.0.png", 48);
    folder.render("a.xyz -o b.png --device cpu --frame 0 --color c_pe").fine();
    assert_ne!(plain, rows(&folder, "b.png", 48), "something is written over it");
    folder.render("a.xyz -o a.gif --device cpu --color c_pe --bar --time-label {frame}").fine();
}

#[test]
fn what_cannot_be_annotated_is_refused_before_the_work() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(9));
    for (words, parts) in [
        ("--title x --title-at middle", &["--title-at", "known: left right top"][..]),
        ("--bar-at left", &["--bar"]),
        ("--bar-file bar.png", &["--bar-file", "NAME.svg"]),
        ("--scalebar 1Mpcc", &["--scalebar", "1 Mpcc", "in Å or a unit of its kind"]),
        ("--scalebar 0", &["--scalebar", "above 0"]),
        ("--scalebar 1e9", &["--scalebar", "fits the picture"]),
        ("--time-label {step}", &["--time-label", "{time:.2}"]),
        ("--missing gry", &["--missing", "did you mean 'gray'"]),
        ("--font a.xyz --title x", &["--font", "TrueType"]),
        ("--mode medium --bar", &["--bar is for colors that stand for numbers"]),
    ] {
        folder.render(&format!("a.xyz -o a.png --device cpu {words}")).fails(2, parts);
    }
    folder.render("-o a.png --bar a.xyz").fails(2, &["'a.xyz' was taken for the value of --bar"]);
    folder.render("a.xyz -o a.png --font none.ttf --title x").fails(3, &["none.ttf"]);
    assert_eq!(folder.names(), ["a.xyz"]);
}
