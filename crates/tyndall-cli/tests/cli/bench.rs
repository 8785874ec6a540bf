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

#[test]
fn culling_is_evaluated_as_a_report() {
    let folder = Folder::new();
    let report = folder.path("report");
    let line = format!(
        "bench culling --sets virion,nozzle --fraction 1e-4 --window 32 --frames 2 --picture-frames 1 -q --report {}",
        report.display()
    );
    folder.line(&line).fine();
    let text = std::fs::read_to_string(report.join("report.md")).unwrap();
    for section in ["table 6.3", "tables 6.1 and 6.2", "the ceiling", "PSNR", "Findings"] {
        assert!(text.contains(section), "{section}: {text}");
    }
    // Views in two tables, and the knobs of the virion.
    assert!(text.lines().filter(|line| line.starts_with("| nozzle")).count() >= 12, "{text}");
    assert!(text.contains("3x3, trilinear") && text.contains("treelets"), "{text}");
    for figure in ["figure-6.2.png", "figure-6.3-virion.png"] {
        assert!(text.contains(figure), "{text}");
        assert!(!super::png(&report.join(figure)).0.is_empty());
    }
    folder.line("bench culling --sets packed -q").fails(2, &["--sets", "packed", "virion"]);
    folder.line("bench culling --fraction 2 -q").fails(2, &["--fraction"]);
}

#[test]
fn spheres_in_a_medium_are_measured_against_a_converged_picture() {
    let folder = Folder::new();
    let ran = folder.line("bench bodies --size 16x16");
    let rows: Vec<Vec<&str>> = ran
        .out
        .lines()
        .map(|line| line.split('|').map(str::trim).collect())
        .filter(|row: &Vec<&str>| row.len() == 10)
        .collect();
    let errors = |samples: &str, column: usize| -> Vec<f64> {
        let rows = rows.iter().filter(|row| row[2] == samples);
        rows.map(|row| row[column].parse().unwrap()).collect()
    };
    // Columns of the march and of the path tracer: an error each of three scenes, which falls with the samples.
    for column in [3, 6] {
        let (few, many) = (errors("1", column), errors("64", column));
        assert!(few.len() == 3 && many.len() == 3, "{ran:?}");
        assert!(few.iter().zip(&many).all(|(few, many)| few > many && *many > 0.0), "{ran:?}");
    }
}
