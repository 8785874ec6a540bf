//! Binary dumps of all versions, both orders of bytes and all kinds of boxes.

use super::*;
use crate::read::{FORMATS, real_data};
use tyndall::Particles;

/// How a file is written.
#[derive(Clone, Copy)]
struct Style {
    order: Order,
    /// 0 for that of old versions, without a name.
    revision: i32,
    tilted: i32,
    name: &'static str,
    columns: &'static str,
}

const NEW: Style =
    Style { order: Order::Little, revision: 2, tilted: 1, name: "DUMPCUSTOM", columns: "id type xs ys zs q" };

/// A frame of so many atoms in each chunk; the values tell atom and column.
fn frame(style: Style, step: i64, chunks: &[usize]) -> Vec<u8> {
    let mut file = Vec::new();
    let mut put = |little: &[u8]| match style.order {
        Order::Little => file.extend_from_slice(little),
        Order::Big => file.extend(little.iter().rev()),
    };
    // A text is not turned around: letter by letter.
    let letters = |put: &mut dyn FnMut(&[u8]), text: &str| text.bytes().for_each(|it| put(&[it]));
    if style.revision > 0 {
        put(&(-(style.name.len() as i64)).to_le_bytes());
        letters(&mut put, style.name);
        [1, style.revision].iter().for_each(|it| put(&it.to_le_bytes()));
    }
    let size = style.columns.split(' ').count();
    let count: usize = chunks.iter().sum();
    [step, count as i64].iter().for_each(|it| put(&it.to_le_bytes()));
    [style.tilted, 0, 0, 1, 1, 0, 2].iter().for_each(|it| put(&it.to_le_bytes()));
    let bounds: &[f64] = match style.tilted {
        0 => &[0.0, 10.0, -5.0, 15.0, 1.0, 31.0],
        1 => &[-1.0, 15.0, -3.0, 20.0, 0.0, 30.0, 2.0, 4.0, -3.0],
        _ => &[10.0, 1.0, 0.0, 2.0, 20.0, 0.0, 4.0, -3.0, 30.0, -1.0, 0.0, 0.5],
    };
    bounds.iter().for_each(|it| put(&it.to_le_bytes()));
    put(&(size as i32).to_le_bytes());
    if style.revision > 1 {
        put(&5i32.to_le_bytes());
        letters(&mut put, "metal");
        put(&[1]);
        put(&0.5f64.to_le_bytes());
        put(&(style.columns.len() as i32).to_le_bytes());
        letters(&mut put, style.columns);
    }
    put(&(chunks.len() as i32).to_le_bytes());
    let mut atom = 0;
    for &chunk in chunks {
        put(&((chunk * size) as i32).to_le_bytes());
        for _ in 0..chunk {
            for (column, name) in style.columns.split(' ').enumerate() {
                let value =
                    if name == "id" { f64::from(atom) + 3e9 } else { f64::from(atom) + column as f64 / 8.0 };
                put(&(if name == "type" { 1.0 } else { value }).to_le_bytes());
            }
            atom += 1;
        }
    }
    file
}

fn read(bytes: &[u8]) -> Vec<Particles> {
    real_data::open(bytes).unwrap().into_iter().map(|it| it.particles).collect()
}

#[test]
fn all_versions_orders_and_boxes_are_read() {
    for order in [Order::Little, Order::Big] {
        for tilted in 0..3 {
            let style = Style { order, tilted, ..NEW };
            let file = [frame(style, 7, &[2, 0, 3]), frame(style, 8, &[]), frame(style, 9, &[1])].concat();
            let frames = read(&file);
            let counts: Vec<usize> = frames.iter().map(Particles::len).collect();
            assert_eq!(counts, [5, 0, 1], "{order:?} {tilted}");
            let particles = &frames[0];
            let cell = particles.cell().unwrap();
            let edge = if tilted == 2 { DVec3::new(10.0, 1.0, 0.0) } else { DVec3::X * 10.0 };
            assert_eq!((cell.vectors[0], cell.periodic), (edge, [true, false, true]));
            let fraction = [4.25, 4.375, 4.5];
            let wanted = cell.origin + (0..3).map(|axis| fraction[axis] * cell.vectors[axis]).sum::<DVec3>();
            assert!(particles.positions().world(4).abs_diff_eq(wanted, 1e-4), "{order:?} {tilted}");
            assert_eq!(particles.attribute("type").unwrap().values, Values::I32(vec![1; 5]));
            assert_eq!(
                particles.attribute("id").unwrap().values,
                Values::I64((3_000_000_000..3_000_000_005).collect())
            );
            assert_eq!(
                particles.attribute("q").unwrap().values,
                Values::F32([0.625f32, 1.625, 2.625, 3.625, 4.625].to_vec())
            );
            assert_eq!((particles.time(), particles.length_unit()), (Some(0.5), Some("Å")));
        }
    }
}

#[test]
fn old_versions_have_no_names_of_columns() {
    for order in [Order::Little, Order::Big] {
        let old = Style { order, revision: 0, columns: "id type x y z", ..NEW };
        let file = [frame(old, 7, &[2, 1]), frame(old, 9, &[1])].concat();
        let message = real_data::open(&file).unwrap_err().to_string();
        assert!(
            message.contains("does not name its 5 columns") && message.contains("--columns"),
            "{message}"
        );
        let columns = Some(["id", "type", "x", "y", "z"].map(str::to_string).to_vec());
        let options = Options { columns, ..Options::default() };
        let frames = real_data::frames(&real_data::recognised(&file).open, &file, &options).unwrap();
        assert_eq!((frames.len(), frames[1].particles.time()), (2, Some(9.0)));
        assert_eq!(frames[0].particles.positions().world(2), DVec3::new(2.25, 2.375, 2.5));
        let few = Options { columns: Some(vec!["x".into(), "y".into(), "z".into()]), ..Options::default() };
        let message =
            real_data::frames(&real_data::recognised(&file).open, &file, &few).unwrap_err().to_string();
        assert!(message.contains("3 columns are named, an atom has 5"), "{message}");
        // Those of the style atom are known.
        let atom = Style { order, revision: 1, name: "DUMPATOM", columns: "id type xs ys zs", ..NEW };
        assert!(read(&frame(atom, 0, &[1]))[0].attribute("id").is_some());
    }
}

#[test]
fn a_file_that_is_cut_keeps_its_whole_frames() {
    let whole = frame(NEW, 7, &[2, 3]);
    let file = [whole.clone(), whole.clone()].concat();
    for length in whole.len() + 1..file.len() {
        let index = index(Path::new("test"), &file[..length], &Options::default()).unwrap();
        assert_eq!((index.frames.len(), index.cut), (1, true), "{length}");
    }
}

#[test]
fn counts_that_contradict_each_other_are_refused() {
    let file = frame(NEW, 7, &[2, 3]);
    let count_at = 8 + 10 + 8 + 8;
    for hostile in [6i64, -1, i64::MAX] {
        let mut file = file.clone();
        file[count_at..][..8].copy_from_slice(&hostile.to_le_bytes());
        let index = index(Path::new("test"), &file, &Options::default());
        assert!(index.is_err(), "{hostile}");
    }
}

#[test]
fn damage_never_panics_and_other_files_are_not_taken_for_it() {
    let open = &FORMATS.iter().find(|it| it.names[0] == "lammps-binary").unwrap().open;
    for style in [NEW, Style { revision: 0, order: Order::Big, tilted: 0, ..NEW }] {
        let file = [frame(style, 7, &[2, 1]), frame(style, 8, &[])].concat();
        real_data::damage(&file, |file| {
            recognise(file);
            drop(real_data::frames(open, file, &Options::default()));
        });
    }
    assert!(!recognise(&[0; 4096]) && !recognise(&[0xff; 4096]) && !recognise(b"DUMP") && !recognise(b""));
}
