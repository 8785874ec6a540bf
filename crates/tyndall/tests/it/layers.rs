//! What knows what: every `use crate::` in the library follows an arrow that is drawn in ARCHITECTURE.md.

use std::fs;
use std::path::{Path, PathBuf};

/// Known to all, and knowing only each other.
const GROUND: [&str; 11] =
    ["curve", "error", "frozen", "math", "names", "pages", "progress", "random", "simd", "source", "srgb"];

/// A module and what it may know besides the ground.
const ARROWS: [(&str, &[&str]); 9] = [
    ("particles", &[]),
    ("film", &[]),
    ("environment", &[]),
    ("periodic", &["particles"]),
    ("synthetic", &["particles"]),
    ("structure", &["particles"]),
    ("scene", &["structure", "periodic", "particles", "environment"]),
    ("medium", &["particles", "environment"]),
    ("render", &["scene", "medium", "structure", "particles", "environment", "film"]),
];

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

/// The modules that a source file names after `crate::`, outside its tests.
fn known(text: &str) -> Vec<&str> {
    let body = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or(text);
    let named = body.lines().filter(|line| !line.trim_start().starts_with("//")).flat_map(|line| {
        line.split("crate::")
            .skip(1)
            .map(|rest| rest.split(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap_or_default())
    });
    named.filter(|name| name.starts_with(|c: char| c.is_lowercase())).collect()
}

/// What a file breaks, if anything.
fn violation(module: &str, text: &str) -> Option<String> {
    let allowed = ARROWS.iter().find(|(name, _)| *name == module).map_or(&[][..], |(_, allowed)| allowed);
    let forbidden = known(text)
        .into_iter()
        .find(|name| *name != module && !GROUND.contains(name) && !allowed.contains(name));
    forbidden.map(|name| format!("{module} must not know {name}"))
}

#[test]
fn every_arrow_is_drawn() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    for file in files {
        let inside = file.strip_prefix(&root).unwrap();
        let module = inside.iter().next().unwrap().to_str().unwrap().trim_end_matches(".rs");
        let is_test = inside.iter().any(|part| part == "tests" || part == "tests.rs");
        if module == "lib" || is_test {
            continue;
        }
        assert!(
            GROUND.contains(&module) || ARROWS.iter().any(|(name, _)| *name == module),
            "{module} is not on the map"
        );
        let text = fs::read_to_string(&file).unwrap();
        assert_eq!(violation(module, &text), None, "{}", inside.display());
    }
}

#[test]
fn an_arrow_that_is_not_drawn_raises_the_alarm() {
    assert!(violation("structure", "use crate::render::Settings;").is_some());
    assert!(violation("math", "    let x = crate::scene::camera();").is_some());
    assert!(violation("scene", "use crate::structure::Bvh;\n// use crate::render").is_none());
}
