//! What `info` tells, to people and to scripts.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::{Folder, dump, line_of};

fn described(folder: &Folder, words: &str) -> Value {
    let ran = folder.line(&format!("info --json {words}"));
    assert_eq!(ran.code, 0, "{ran:?}");
    serde_json::from_str(&ran.out).unwrap()
}

#[test]
fn json_has_the_keys_that_scripts_rely_on() {
    let folder = Folder::new();
    let rows = ["7 2 Cu 0.8 0.1 1e-3 -3.25", "3 1 Zr 12.7 9.9 4 8"];
    folder.file("a.dump", dump("id type element x y z c_pe", 20.0, &rows).repeat(2));
    let json = described(&folder, "a.dump");
    assert_eq!((&json["frames"], &json["particles"]), (&json!(2), &json!(2)));
    assert!(json["format"].as_str().unwrap().starts_with("LAMMPS dump"));
    assert_eq!(json["bounds"], json!({ "min": [0.8, 0.1, 0.001], "max": [12.7, 9.9, 4.0] }));
    let first = json!({ "position": [0.8, 0.1, 0.001], "id": 7, "type": 2, "element": "Cu", "c_pe": -3.25 });
    assert_eq!(json["first"], first);
    assert_eq!(json["last"]["position"], json!([12.7, 9.9, 4.0]));
    assert_eq!(json["last"]["element"], "Zr");
    let names: Vec<&str> =
        json["attributes"].as_array().unwrap().iter().map(|it| it["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["id", "type", "element", "c_pe"]);
    assert_eq!(
        json["attributes"][3],
        json!({ "name": "c_pe", "type": "f32", "components": 1, "unit": null })
    );
    assert_eq!(json["dropped"], json!({ "position": 0, "radius": 0, "total": 0 }));
    assert_eq!(json["cell"]["periodic"], json!([true, true, true]));
    assert_eq!((&json["time"], &json["paths"]), (&json!(100.0), &json!(["a.dump"])));
    assert!(json["conventions"].is_array() && json["warnings"].is_array());
}

#[test]
fn frames_counts_and_dropped_ones_are_told() {
    let folder = Folder::new();
    folder.file("a.xyz", line_of(3) + &line_of(5));
    assert_eq!(described(&folder, "a.xyz")["particles"], 3);
    assert_eq!(described(&folder, "a.xyz --frame -1")["particles"], 5);
    folder.line("info a.xyz --frame 2").fails(2, &["--frame cannot be '2'", "0 to 1"]);
    folder.file("a.csv", "x,y,z\n0,0,0\nnan,1,1\n2,2,2\n");
    let json = described(&folder, "a.csv");
    assert_eq!(json["dropped"], json!({ "position": 1, "radius": 0, "total": 1 }));
    assert_eq!(described(&folder, "synthetic:packed?n=0")["first"], Value::Null);
}

#[test]
fn people_are_told_the_same() {
    let folder = Folder::new();
    folder.file("a.dump", dump("id x y z vx", 20.0, &["1 3 4 5 6", "2 14 5 6 7"]));
    let ran = folder.line("info a.dump");
    assert_eq!(ran.code, 0, "{ran:?}");
    for part in [
        "LAMMPS dump (text) · 1 frame · 2 particles",
        "cell orthogonal 20×20×20 pp pp pp",
        "bounds x 3..14 · y 4..5",
        "id i32",
        "time 100",
    ] {
        assert!(ran.out.contains(part), "'{part}' is not in {}", ran.out);
    }
}

/// Formats that are implemented, by folder or ending in the collection.
fn is_implemented(name: &str) -> bool {
    let plain = name.trim_end_matches(".gz");
    let endings = [".xyz", ".dump", ".lammpstrj", ".csv", ".ply", ".npy", ".npz", ".bgeo"];
    endings.iter().any(|ending| plain.ends_with(ending))
}

#[test]
fn real_files_are_described_as_other_programs_do() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let Ok(text) = std::fs::read_to_string(root.join("expected.json")) else {
        return println!("skipped: no {}", root.display());
    };
    let expected: Value = serde_json::from_str(&text).unwrap();
    let mut compared = 0;
    for (name, entry) in expected["files"].as_object().unwrap() {
        let path: PathBuf = root.join(name);
        if !is_implemented(name) || !path.exists() {
            println!("skipped: {name}");
            continue;
        }
        let folder = Folder::new();
        let ran = folder.run(&["info", "--json", path.to_str().unwrap()]);
        assert_eq!(ran.code, 0, "{name}: {ran:?}");
        let found: Value = serde_json::from_str(&ran.out).unwrap();
        if let Err(difference) = differs(&found, &entry["expected"]) {
            panic!("{name}: {difference}");
        }
        let mut altered = found.clone();
        altered["bounds"]["min"][2] = json!(found["bounds"]["min"][2].as_f64().unwrap() - 1.0);
        assert!(differs(&altered, &entry["expected"]).is_err(), "{name}: an altered value passes");
        compared += 1;
    }
    assert!(compared >= 15, "only {compared} files were compared");
}

fn differs(found: &Value, expected: &Value) -> Result<(), String> {
    for key in ["frames", "particles"] {
        if found[key] != expected[key] {
            return Err(format!("{key}: {} instead of {}", found[key], expected[key]));
        }
    }
    let numbers =
        |value: &Value| -> Vec<f64> { value.as_array().unwrap().iter().flat_map(Value::as_f64).collect() };
    let bounds = &expected["bounds"];
    let size = numbers(&bounds["max"])
        .iter()
        .zip(numbers(&bounds["min"]))
        .map(|(max, min)| max - min)
        .fold(0.0, f64::max);
    let near = |what: &str, found: &Value, wanted: &Value| {
        let (found, wanted) = (numbers(found), numbers(wanted));
        let same = found.len() == wanted.len()
            && found.iter().zip(&wanted).all(|(a, b)| (a - b).abs() <= 1e-5 * size);
        if same { Ok(()) } else { Err(format!("{what}: {found:?} instead of {wanted:?}")) }
    };
    near("least", &found["bounds"]["min"], &bounds["min"])?;
    near("greatest", &found["bounds"]["max"], &bounds["max"])?;
    for place in ["first", "last"] {
        if expected[place]["position"].is_array() {
            near(place, &found[place]["position"], &expected[place]["position"])?;
        }
    }
    Ok(())
}
