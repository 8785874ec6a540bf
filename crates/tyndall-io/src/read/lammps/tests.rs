//! Text dumps, frame by frame: what is read, and what is said about damage.

use super::*;
use crate::sequence::Options;
use tyndall::Values;

const TRICLINIC: &str = "ITEM: UNITS\nmetal\nITEM: TIME\n0.5\nITEM: TIMESTEP\n10\nITEM: NUMBER OF ATOMS\n2\n\
    ITEM: BOX BOUNDS xy xz yz pp ff ps\n-1 15 2\n-3 20 4\n0 30 -3\nITEM: ATOMS id zs ys xs element ix iy iz \n";

fn read_with(text: &str, options: &Options) -> Result<Vec<Frame>> {
    let path = Path::new("a.dump");
    let index = index(&mut Feed::over(path, text.as_bytes()))?;
    let frame = |span: &Span| {
        let mut feed = Feed::over(path, text.as_bytes());
        feed.skip_to(span.offset, span.line, &())?;
        frame(
            &mut feed,
            &Request {
                options,
                bytes: span.bytes,
                units: index.units.as_deref(),
                topology: None,
                others: &(),
            },
            &(),
        )
    };
    index.frames.iter().map(frame).collect()
}

fn read(text: &str) -> Result<Vec<Frame>> {
    read_with(text, &Options::default())
}

#[test]
fn scaled_triclinic_coordinates_go_through_the_cell() {
    let frames = read(&format!("{TRICLINIC}7 0 0 0 Cu 0 1 -1\n3 0.5 0.25 1 O 0 0 0\n")).unwrap();
    let particles = &frames[0].particles;
    // Bounds -1..15 with tilts 2 and 4 are those of -1..9; bounds -3..20 with tilt -3 those of 0..20.
    let cell = particles.cell().unwrap();
    assert_eq!(cell.origin, DVec3::new(-1.0, 0.0, 0.0));
    let vectors = [DVec3::new(10.0, 0.0, 0.0), DVec3::new(2.0, 20.0, 0.0), DVec3::new(4.0, -3.0, 30.0)];
    assert_eq!((cell.vectors, cell.periodic), (vectors, [true, false, true]));
    let wanted = cell.origin + vectors[0] + 0.25 * vectors[1] + 0.5 * vectors[2];
    assert!(particles.positions().world(1).abs_diff_eq(wanted, 1e-6));
    assert_eq!(particles.attribute("id").unwrap().values, Values::I32(vec![7, 3]));
    assert_eq!(particles.attribute("iz").unwrap().values, Values::I32(vec![-1, 0]));
    assert_eq!(particles.attribute("element").unwrap().values.type_name(), "text");
    assert_eq!((particles.time(), particles.length_unit()), (Some(0.5), Some("Å")));
    assert_eq!(frames[0].conventions[0], "coordinates: xs ys zs (scaled by the triclinic cell)");
}

#[test]
fn general_triclinic_boxes_have_vectors() {
    let lines = ["1 2 3 10", "4 5 6 11", "7 8 9 12"].map(str::to_string);
    let cell = cell(" abc origin pp ff pp", &lines).unwrap();
    assert_eq!((cell.origin, cell.vectors[2]), (DVec3::new(10.0, 11.0, 12.0), DVec3::new(7.0, 8.0, 9.0)));
    assert_eq!(cell.periodic, [true, false, true]);
}

fn dump(columns: &str, rows: &[&str]) -> String {
    let count = rows.len();
    let rows: String = rows.iter().map(|row| format!("{row}\r\n")).collect();
    format!(
        "ITEM: TIMESTEP\r\n5\r\nITEM: NUMBER OF ATOMS\r\n{count}\r\nITEM: BOX BOUNDS pp pp pp\r\n0 10\r\n0 10\r\n0 10\r\nITEM: ATOMS {columns}\r\n{rows}"
    )
}

#[test]
fn the_unit_system_is_that_of_velocities_too() {
    let rows = dump("x y z vx q", &["1 2 3 4 5"]);
    let units = |text: &str| {
        let attributes = read(text).unwrap()[0].particles.attributes().to_vec();
        attributes.into_iter().map(|it| it.unit.unwrap_or_default()).collect::<Vec<_>>()
    };
    assert_eq!(units(&format!("ITEM: UNITS\nreal\n{rows}")), ["Å/fs", ""]);
    assert_eq!(units(&rows), ["", ""]);
}

#[test]
fn real_coordinates_come_before_unwrapped_and_scaled_ones() {
    let frame = &read(&dump("xs ys zs xu yu zu x y z", &["0.1 0.1 0.1 11 1 1 1 2 3"])).unwrap()[0];
    assert_eq!(frame.particles.positions().world(0), DVec3::new(1.0, 2.0, 3.0));
    assert_eq!(frame.particles.attributes().len(), 6);
    let frame = &read(&dump("xsu ysu zsu", &["1.5 0.5 -0.5"])).unwrap()[0];
    assert_eq!(frame.particles.positions().world(0), DVec3::new(15.0, 5.0, -5.0));
}

#[test]
fn two_dimensional_dumps_may_lack_z() {
    let frame = &read(&dump("id x y xs ys zs", &["1 11 12 0.1 0.2 0.3"])).unwrap()[0];
    assert_eq!(frame.particles.positions().world(0), DVec3::new(1.0, 2.0, 3.0), "all three before two");
    let frame = &read(&dump("id x y q", &["1 1 2 7"])).unwrap()[0];
    assert_eq!(frame.particles.positions().world(0), DVec3::new(1.0, 2.0, 0.0));
    assert_eq!(frame.conventions, ["coordinates: x y", "two-dimensional: at z = 0"]);
    let frame =
        &read(&dump("xs ys", &["0.1 0.2"]).replace("0 10\r\nITEM: A", "-1 10\r\nITEM: A")).unwrap()[0];
    assert_eq!(frame.particles.positions().world(0), DVec3::new(1.0, 2.0, -1.0));
    assert_eq!(frame.conventions[1], "two-dimensional: at the lower face of the cell");
    assert!(read(&dump("xu yu zs", &["1 2 0.3"])).is_err(), "there is a z, which does not belong to x and y");
}

#[test]
fn counts_may_change_and_frames_may_be_empty() {
    let text =
        [dump("x y z vx", &["1 2 3 0", "1 2 3 1"]), dump("x y z", &[]), dump("x y z", &["1 2 3"])].concat();
    let frames = read(&text).unwrap();
    let counts: Vec<usize> = frames.iter().map(|it| it.particles.len()).collect();
    assert_eq!(counts, [2, 0, 1]);
    assert_eq!(frames[0].particles.attribute("vx").unwrap().values, Values::F32(vec![0.0, 1.0]));
}

#[test]
fn coordinates_that_look_scaled_are_warned_about() {
    let rows: Vec<String> = (0..9).map(|k| format!("0.{k} 0.5 0.9")).collect();
    let rows: Vec<&str> = rows.iter().map(String::as_str).collect();
    let frame = &read(&dump("x y z", &rows)).unwrap()[0];
    assert!(
        frame.warnings[0].contains("look scaled (0..1) but the columns are 'x y z'"),
        "{:?}",
        frame.warnings
    );
    let options = Options { scaled: true, ..Options::default() };
    let frame = &read_with(&dump("x y z", &rows), &options).unwrap()[0];
    assert!(frame.warnings.is_empty());
    assert_eq!(frame.particles.positions().world(0), DVec3::new(0.0, 5.0, 9.0));
}

#[test]
fn truncation_and_hostile_counts_are_noticed() {
    let cut = |text: &str| {
        let index = index(&mut Feed::over(Path::new("a.dump"), text.as_bytes())).unwrap();
        (index.frames.len(), index.cut)
    };
    let whole = dump("id x y z", &["1 0 0 0"]);
    assert_eq!(cut(&format!("{whole}{}", &whole[..30])), (1, true));
    assert_eq!(cut(&format!("{whole}{}", whole.trim_end().strip_suffix('0').unwrap())), (1, true));
    assert_eq!(cut(whole.trim_end()), (1, false));
    assert_eq!(cut(&whole.replacen("ATOMS\r\n1", "ATOMS\r\n1152921504606846976", 1)), (0, true));
}

#[test]
fn what_is_wrong_is_said() {
    let message = |text: &str| read(text).err().unwrap().to_string();
    assert!(message(&dump("id type", &["1 1"])).contains("no coordinates among the columns: id type"));
    let short = message(&dump("x y z", &["1 1"]));
    assert!(short.contains("wanted 3 values, found 2") && short.contains("a.dump: line 10"), "{short}");
    assert!(
        message(&dump("x y z", &["1 1 1"]).replace("0 10\r\n0 10", "0 10\r\n0 ten"))
            .contains("bounds of the box along y")
    );
    assert!(message(&(dump("x y z", &["1 1 1"]) + "2 2 2\n")).contains("found '2 2 2'"));
}
