//! What is measured, as tables.

use super::Folder;

const LINE: &str = "bench --n 2000 --sets packed --size 32x32";

#[test]
fn pictures_and_single_rays_are_measured() {
    let folder = Folder::new();
    let ran = folder.line(LINE);
    let headings: Vec<&str> = ran.out.split('|').map(str::trim).collect();
    // `benches/beside_embree.py` looks for these.
    for heading in [
        "camera",
        "build s",
        "B/particle",
        "1 sample ms",
        "16 samples ms",
        "16 + 1 AO ms",
        "incoherent Mrays/s",
    ] {
        assert!(headings.contains(&heading), "{heading}: {ran:?}");
    }
    let json: serde_json::Value = serde_json::from_str(&folder.line(&format!("{LINE} --json")).out).unwrap();
    for (table, heading) in [("pictures", "16 + 1 AO ms"), ("rays", "incoherent bvh : pkd")] {
        assert!(
            json[table].as_array().unwrap().iter().all(|row| row[heading].as_f64().unwrap() > 0.0),
            "{json}"
        );
        assert_eq!(
            (&json[table][1]["camera"], &json[table][1]["particles"]),
            (&"perspective".into(), &2000.into())
        );
    }
    let json: serde_json::Value =
        serde_json::from_str(&folder.line(&format!("{LINE} --json --structure pkd")).out).unwrap();
    assert_eq!(json["rays"], serde_json::json!([]), "there is nothing to compare with");
}

#[test]
fn every_structure_is_measured() {
    let folder = Folder::new();
    let ran = folder.line("bench structures --n 2000 --sets packed,ablation --size 32x32");
    assert_eq!(ran.code, 0, "{ran:?}");
    for set in ["packed", "ablation"] {
        for structure in ["bvh", "bvh packed 16 bits", "pkd"] {
            let begin = format!("| {set}");
            let rows = ran.out.lines().filter(|line| line.starts_with(&begin));
            let of = rows.filter(|line| line.split('|').any(|cell| cell.trim() == structure));
            assert_eq!(of.count(), 1, "{set} {structure}: {ran:?}");
        }
    }
    let line = "bench structures --n 2000 --sets packed --size 32x32 --json";
    let json: serde_json::Value = serde_json::from_str(&folder.line(line).out).unwrap();
    let rows = json.as_array().unwrap();
    assert!(rows.iter().all(|row| row["incoherent Mrays/s"].as_f64().unwrap() > 0.0), "{json}");
    let sizes =
        rows.iter().filter(|row| row["cut"] == "middle").map(|row| row["treelets of"].as_u64().unwrap());
    assert_eq!(sizes.collect::<Vec<_>>(), [16, 64, 256, 1024, 4096]);
}
