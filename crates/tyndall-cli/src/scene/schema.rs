//! The JSON schema of scene files: made from the keys, with the help texts as descriptions. Editors complete and check scenes by it.
//!
//! Source: JSON Schema draft 2020-12.

use serde_json::{Map, Value, json};

use super::grid;
use super::keys::{FILES, Key, Keys, Values};
use super::layer;
use super::values::LIGHTS;
use crate::report::{Outcome, print as print_bytes};

/// Prints the schema.
pub(crate) fn print() -> Outcome<()> {
    print_bytes(text().as_bytes())
}

/// The schema, as a file has it.
fn text() -> String {
    format!("{:#}\n", schema(&Keys::new()))
}

fn schema(keys: &Keys) -> Value {
    let mut tables = Map::new();
    tables
        .insert("grid".into(), table(grid_keys(), "A density from a file, in place of particles", &["file"]));
    tables.insert(
        "light".into(),
        json!({ "type": "array", "items": light(), "description": "Lights of a medium, or an image or sky that lights spheres" }),
    );
    tables.insert(
        "layer".into(),
        json!({ "type": "array", "items": layer(keys), "description": "More particles in the same picture" }),
    );
    for name in keys.tables() {
        let of_table = keys.iter().filter(|key| key.table == name);
        let properties = of_table.map(|key| (key.name.clone(), described(key))).collect();
        tables.insert(name.into(), table(properties, &format!("Flags of tyndall render: {name}"), &[]));
    }
    // Keys of a camera that moves stand beside the tables.
    if let Some(camera) = tables.get_mut("camera") {
        *camera = json!({ "anyOf": [camera.take(), { "type": "array", "items": camera_key() }] });
    }
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Tyndall scene",
        "description": "What to render: the flags of tyndall render, by their long names, in tables named after the headings of its help text",
        "type": "object",
        "properties": tables,
        "additionalProperties": false,
    })
}

fn table(properties: Map<String, Value>, description: &str, required: &[&str]) -> Value {
    let mut table = json!({
        "type": "object",
        "description": description,
        "properties": properties,
        "additionalProperties": false,
    });
    if !required.is_empty() {
        table["required"] = json!(required);
    }
    table
}

fn grid_keys() -> Map<String, Value> {
    let key = |&(name, kind, text): &(&str, &str, &str)| {
        (name.into(), json!({ "type": kind, "description": text }))
    };
    grid::KEYS.iter().map(key).collect()
}

/// A table of `[[light]]`.
fn light() -> Value {
    let kinds = LIGHTS.iter().map(|(kind, keys)| {
        let value = |key: &str| match key {
            "file" => json!({ "type": "string" }),
            _ => json!({ "type": ["number", "array"] }),
        };
        let mut properties: Map<String, Value> =
            keys.iter().map(|key| (key.to_string(), value(key))).collect();
        properties.insert("kind".into(), json!({ "const": kind }));
        let required: Vec<&str> =
            keys.iter().copied().filter(|key| *key != "factor").chain(["kind"]).collect();
        table(properties, &format!("A light of kind {kind}"), &required)
    });
    json!({ "anyOf": kinds.collect::<Vec<_>>() })
}

/// A table of `[[camera]]`.
fn camera_key() -> Value {
    let number = || json!({ "type": "number" });
    let point = || json!({ "type": ["array", "string"], "items": { "type": "number" } });
    json!({
        "type": "object",
        "properties": {
            "at": number(), "eye": point(), "look-at": point(), "up": point(), "fov": number(), "ortho": number(),
            "move": { "enum": ["smooth", "straight"] },
            "file": { "type": "string", "description": "A USD stage (.usda) that has the camera" },
            "prim": { "type": "string", "description": "The path of the camera's prim" },
        },
        "additionalProperties": false,
    })
}

/// A table of `[[layer]]`.
fn layer(keys: &Keys) -> Value {
    let own = keys.iter().filter(|key| layer::may_have(key)).map(|key| (key.name.clone(), described(key)));
    table(own.collect(), "Files, with flags of their own", &[FILES[1]])
}

/// What a key's value may be, and its help text.
fn described(key: &Key) -> Value {
    let text = json!({ "type": "string" });
    let names = key.arg.get_possible_values();
    let one = match key.values() {
        Values::Switch => json!({ "type": "boolean" }),
        _ if !names.is_empty() => {
            json!({ "enum": names.iter().flat_map(|it| forms(it.get_name())).collect::<Vec<_>>() })
        }
        _ if key.may_be_bare() => json!({ "type": ["boolean", "string", "number"] }),
        _ if key.is_integer() => json!({ "type": ["integer", "string"] }),
        _ if key.is_number() => json!({ "type": ["number", "string"] }),
        _ if key.is_path() || key.values() == Values::Several => text.clone(),
        _ => json!({ "type": ["string", "number", "array"] }),
    };
    let is_list = key.values() == Values::Several || key.arg.get_value_delimiter().is_some();
    let mut described = match (&*key.name, is_list) {
        ("light", _) => list_of(json!({ "anyOf": [text, light()] })),
        ("camera", _) => list_of(json!({ "anyOf": [text, camera_key()] })),
        ("layer", _) => list_of(json!({ "type": ["string", "object"] })),
        (_, true) => list_of(one),
        _ => one,
    };
    if let Some(help) = key.arg.get_help() {
        described["description"] = json!(help.to_string());
    }
    let defaults: Vec<String> =
        key.arg.get_default_values().iter().map(|it| it.to_string_lossy().into_owned()).collect();
    if key.values() != Values::Switch && !defaults.is_empty() {
        described["default"] = json!(defaults.join(","));
    }
    described
}

/// A word, which may be a number as well.
fn forms(word: &str) -> impl Iterator<Item = Value> {
    let number = word.parse::<i64>().ok().map(|number| json!(number));
    std::iter::once(json!(word)).chain(number)
}

/// One, or a list.
fn list_of(one: Value) -> Value {
    json!({ "anyOf": [one, { "type": "array", "items": one }] })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::path::Path;

    #[test]
    fn the_schema_beside_the_documentation_is_this_one() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/scene.schema.json");
        let shipped = fs::read_to_string(&path).unwrap();
        assert!(shipped == text(), "write it anew: tyndall schema > docs/scene.schema.json");
    }

    #[test]
    fn the_keys_of_examples_are_in_the_schema() {
        let schema = schema(&Keys::new());
        let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
        let mut count = 0;
        for path in fs::read_dir(examples).unwrap().map(|entry| entry.unwrap().path()) {
            if path.extension().is_none_or(|it| it != "toml") {
                continue;
            }
            let tables: toml::Table = fs::read_to_string(&path).unwrap().parse().unwrap();
            for (table, keys) in &tables {
                let known = &schema["properties"][table];
                let known = known.get("anyOf").map_or(known, |any| &any[0]);
                let names = keys.as_table().into_iter().flatten().map(|(name, _)| name);
                assert!(known.is_object(), "{}: [{table}]", path.display());
                for name in names {
                    let key = &known["properties"][name.replace('_', "-")];
                    assert!(key.is_object(), "{}: [{table}] {name}", path.display());
                    count += 1;
                }
            }
        }
        assert!(count > 10, "{count} keys of examples");
    }
}
