//! What renders: the processor, a graphics card, or a program in a card's place where the machine has one.
#![cfg(feature = "gpu")]

use super::{Folder, line_of, png};

/// Whether there is an adapter; if not, it is said that the test is skipped.
fn has_adapter(folder: &Folder) -> bool {
    let listed = folder.line("devices");
    assert!(listed.code == 0 && listed.out.starts_with("cpu · "), "{listed:?}");
    let has = listed.out.contains("\ngpu:");
    if !has {
        println!("skipped: no adapter");
    }
    has
}

#[test]
fn the_card_shows_what_the_processor_shows() {
    let folder = Folder::new();
    folder.file("line.xyz", line_of(9));
    if !has_adapter(&folder) {
        return;
    }
    for look in ["default", "headlight", "flat"] {
        for device in ["cpu", "gpu"] {
            let told =
                folder.render(&format!("line.xyz --look {look} --device {device} -o {device}.png")).fine();
            assert!(told.contains(&format!("bvh, {device} ")), "{told}");
        }
        let [cpu, gpu] = ["cpu.png", "gpu.png"].map(|name| png(&folder.path(name)).0);
        assert_eq!(cpu.len(), gpu.len());
        let differing = cpu.iter().zip(&gpu).filter(|(a, b)| a.abs_diff(**b) > 2).count();
        assert!(differing * 100 < cpu.len(), "{look}: {differing} of {} bytes differ", cpu.len());
    }
}

#[test]
fn the_card_hides_what_the_processor_hides_and_writes_the_same_layers() {
    let folder = Folder::new();
    folder.file("line.xyz", line_of(40));
    if !has_adapter(&folder) {
        return;
    }
    let draw = |selection: &str, device: &str, name: &str| {
        folder.render(&format!("line.xyz {selection} --size 64x48 --device {device} -o {name}")).fine()
    };
    for structure in ["bvh", "bvh --culling confidence --vc 8", "pkd", "treelets"] {
        let selection = format!("--structure {structure} --filter c_pe=3:30 --clip x<20");
        for device in ["cpu", "gpu"] {
            let told = draw(&selection, device, &format!("{device}.png"));
            let kind = structure.split(' ').next().unwrap();
            assert!(told.contains(&format!("{kind}, {device} ")), "{told}");
        }
        draw("", "gpu", "all.png");
        let [cpu, gpu, all] = ["cpu.png", "gpu.png", "all.png"].map(|name| png(&folder.path(name)).0);
        let differing = |a: &[u8], b: &[u8]| {
            assert_eq!(a.len(), b.len());
            a.iter().zip(b).filter(|(a, b)| a.abs_diff(**b) > 2).count()
        };
        assert!(differing(&cpu, &gpu) * 100 < cpu.len(), "{structure}: {} bytes", differing(&cpu, &gpu));
        assert!(differing(&all, &gpu) > 50, "something is hidden");
    }
    // The header names the channels, each with the same length and type.
    let channels = |device: &str| {
        draw("--filter c_pe=3:30", device, "layers.exr");
        let exr = std::fs::read(folder.path("layers.exr")).unwrap();
        let named = exr.windows(8).position(|window| window == b"channels").unwrap();
        let length = u32::from_le_bytes(exr[named + 16..named + 20].try_into().unwrap()) as usize;
        exr[named..named + 20 + length].to_vec()
    };
    let of_card = channels("gpu");
    assert!(of_card.windows(5).any(|window| window == b"depth"), "{of_card:?}");
    assert_eq!(of_card, channels("cpu"));
}

#[test]
fn the_card_builds_what_the_processor_builds() {
    let folder = Folder::new();
    folder.file("line.xyz", line_of(40));
    if !has_adapter(&folder) {
        return;
    }
    for (name, build) in [("cpu", "cpu"), ("gpu", "gpu"), ("packed", "gpu --pack 16")] {
        let line = format!("line.xyz --device gpu --build {build} --look flat -v -o {name}.png");
        let told = folder.render(&line).fine();
        assert_eq!(told.contains("build on the card: "), name != "cpu", "{told}");
        assert_eq!(told.contains("packed: centers off by"), name == "packed", "{told}");
    }
    let [cpu, gpu] = ["cpu.png", "gpu.png"].map(|name| png(&folder.path(name)).0);
    assert_eq!(cpu, gpu);
}

#[test]
fn builders_that_do_not_fit_are_refused() {
    let folder = Folder::new();
    folder.file("line.xyz", line_of(3));
    let refused = folder.render("line.xyz --build gpu --device cpu -o a.png");
    refused.fails(2, &["--build", "'gpu'", "cpu with --device cpu"]);
    let refused = folder.render("line.xyz --build gpu --structure treelets -o a.png");
    refused.fails(2, &["--build", "'gpu'", "other than bvh"]);
    // Without hardware, the processor builds too.
    let told = folder.render("line.xyz --build gpu -v -o a.png").fine();
    assert!(told.contains("build on the card: ") != told.contains("CPU backend, "), "{told}");
}

#[test]
fn devices_that_are_not_there_are_errors_but_for_auto() {
    let folder = Folder::new();
    folder.file("line.xyz", line_of(3));
    folder.render("line.xyz --device cuda -o a.png").fails(2, &["--device", "'cuda'", "auto, cpu, gpu"]);
    folder.render("line.xyz --device gpu:nonsense -o a.png").fails(5, &["no GPU adapter"]);
    let told = folder.render("line.xyz -o a.png").fine();
    // On hardware nothing is said; without it one line is.
    assert!(told.contains("bvh, gpu") || told.contains("CPU backend, "), "{told}");
    let told = folder.render("line.xyz --structure pkd -o a.png").fine();
    assert!(told.contains("pkd") && !told.contains("GPU"), "{told}");
    if has_adapter(&folder) {
        for structure in ["pkd", "treelets"] {
            let told =
                folder.render(&format!("line.xyz --structure {structure} --device gpu -o a.png")).fine();
            assert!(told.contains(&format!("{structure}, gpu ")), "{told}");
        }
        folder
            .render("line.xyz --structure brute --device gpu -o a.png")
            .fails(2, &["--structure", "bvh, treelets or pkd on the GPU"]);
    }
}

#[test]
fn the_card_leaves_out_what_is_hidden() {
    let folder = Folder::new();
    if !has_adapter(&folder) {
        return;
    }
    let told = |culling: &str| {
        let line = format!(
            "synthetic:packed?n=3000 --size 40x30 --samples 64 --device gpu -v --culling {culling} -o picture.png"
        );
        let told = folder.render(&line).fine();
        (told, png(&folder.path("picture.png")).0)
    };
    let ((certified, found), (_, expected)) = (told("certified"), told("off"));
    assert!(certified.contains("visible-set: "), "{certified}");
    assert!(found == expected, "the picture is another");
    let (told, _) = told("confidence --vc 8");
    assert!(told.contains("culling by confidence (vc 8") && told.contains("voxels in"), "{told}");
}

#[test]
fn cards_are_measured_and_figures_are_kept() {
    let folder = Folder::new();
    if !has_adapter(&folder) {
        return;
    }
    let line = "bench gpu --device gpu --sets packed,nozzle --n 300 --size 16x16 --figures figures.json";
    let ran = folder.line(line);
    for heading in ["4 samples frames/s", "incoherent Mrays/s", "tests a sample", "incoherent Grays/s"] {
        assert!(ran.code == 0 && ran.out.contains(heading), "{heading}: {ran:?}");
    }
    let json: serde_json::Value =
        serde_json::from_slice(&std::fs::read(folder.path("figures.json")).unwrap()).unwrap();
    let rows = json["pictures"].as_array().unwrap();
    assert_eq!(rows.len(), 4, "two sets by two cameras");
    assert!(rows.iter().all(|row| row["4 samples frames/s"].as_f64().unwrap() > 0.0), "{json}");
    let structures = json["structures"].as_array().unwrap();
    for structure in ["bvh", "pkd", "treelets of 64"] {
        let rows = structures.iter().filter(|row| row["structure"] == structure);
        let fine = rows.filter(|row| row["1 sample frames/s"].as_f64().is_some_and(|rate| rate > 0.0));
        assert!(fine.count() >= 2, "{structure}: {json}");
    }
    let builds = json["builds"].as_array().unwrap();
    let builders: Vec<_> = builds.iter().map(|row| row["builder"].as_str().unwrap()).collect();
    assert_eq!(builders, ["cpu", "gpu", "cpu", "gpu"]);
    assert!(builds.iter().all(|row| row["build Mparticles/s"].as_f64().unwrap() > 0.0), "{json}");
    let rows = json["culling"].as_array().unwrap();
    assert_eq!(rows.len(), 12, "by three numbers of samples too");
    for row in rows {
        let of = |heading: &str| row[heading].as_f64().filter(|&number| number > 0.0);
        assert!(of("off frames/s").and(of("certified frames/s")).is_some(), "{row}");
        let learned = of("confidence learning frames/s").and(of("confidence learned frames/s"));
        assert_eq!(learned.is_some(), row["samples"] != 64, "{row}");
    }
    let late = folder.line("bench gpu --device gpu --sets packed --n 300 --size 16x16 --time 1 --json");
    assert_eq!(late.code, 0, "{late:?}");
}
