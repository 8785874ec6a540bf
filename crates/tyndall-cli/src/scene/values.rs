//! Values of TOML as the command line writes them.

use std::path::Path;

use toml::de::{DeTable, DeValue};

use crate::medium::values::LightSpec;

/// A value; the parts of a list are joined by `separator`. Numbers keep their digits.
pub(super) fn word(value: &DeValue, separator: char) -> Result<String, String> {
    match value {
        DeValue::String(text) => Ok(text.to_string()),
        DeValue::Integer(number) if number.radix() == 10 => Ok(number.as_str().into()),
        DeValue::Integer(number) => {
            let read = i64::from_str_radix(number.as_str(), number.radix());
            read.map(|it| it.to_string()).map_err(|_| format!("{number} is too large"))
        }
        DeValue::Float(number) => Ok(number.as_str().into()),
        DeValue::Array(values) => {
            let words = values.iter().map(|value| word(value.get_ref(), separator));
            Ok(words.collect::<Result<Vec<_>, _>>()?.join(&separator.to_string()))
        }
        other => Err(format!("a {} is no value", other.type_str())),
    }
}

/// The kinds of lights and what each says after its name, in this order.
pub(super) const LIGHTS: [(&str, &[&str]); 5] = [
    ("sun", &["along", "irradiance"]),
    ("point", &["position", "intensity"]),
    ("spot", &["position", "along", "angle", "intensity"]),
    ("sky", &["radiance"]),
    ("image", &["factor", "file"]),
];

/// What `--light` says, from a table; files are relative to `folder`.
pub(super) fn light_words(light: &DeTable, folder: &Path) -> Result<String, String> {
    let kind = match light.get("kind").map(|kind| kind.get_ref()) {
        Some(DeValue::String(kind)) => &**kind,
        _ => return Err("a light needs kind = \"sun\", \"point\", \"spot\", \"sky\" or \"image\"".into()),
    };
    let found = LIGHTS.iter().find(|(name, _)| *name == kind);
    let Some((_, keys)) = found else {
        return Err(format!("no light is called '{kind}': sun, point, spot, sky or image"));
    };
    let mut words = kind.to_string();
    for &key in *keys {
        words += &match (key, light.get(key).map(|value| value.get_ref())) {
            ("factor", None) => ":1".into(),
            ("file", Some(DeValue::String(file))) => format!(":{}", folder.join(&**file).display()),
            (_, Some(value)) => format!(":{}", word(value, ',')?),
            (_, None) => return Err(format!("a light of kind {kind} needs '{key}'")),
        };
    }
    let mut names = light.keys().map(|key| &**key.get_ref());
    let unknown = names.find(|key| *key != "kind" && !keys.contains(key));
    unknown.map_or(Ok(words), |key| Err(format!("a light of kind {kind} has no '{key}'")))
}

/// A text of `--light`, of which a file that it names is where `place` puts it.
pub(super) fn light_with_file(text: &str, place: impl Fn(&Path) -> String) -> String {
    match text.parse() {
        Ok(LightSpec::Image(_, file)) => {
            let before = text.strip_suffix(&*file.to_string_lossy()).unwrap_or("image:");
            format!("{before}{}", place(&file))
        }
        _ => text.into(),
    }
}

/// What `--camera` says, from a table; files are relative to `folder`.
pub(super) fn camera_words(camera: &DeTable, folder: &Path) -> Result<String, String> {
    let text = |name: &str| match camera.get(name).map(|value| value.get_ref()) {
        None => Ok(None),
        Some(DeValue::String(text)) => Ok(Some(&**text)),
        Some(_) => Err(format!("the {name} of a camera is a text")),
    };
    if let Some(file) = text("file")? {
        if let Some((name, _)) = camera.iter().find(|(name, _)| !matches!(&**name.get_ref(), "file" | "prim"))
        {
            return Err(format!("a camera of a file has no '{}'", name.get_ref()));
        }
        let prim = text("prim")?.map_or(String::new(), |prim| format!(":{prim}"));
        return Ok(format!("{}{prim}", folder.join(file).display()));
    }
    let words = camera.iter().map(|(name, value)| {
        Ok(format!("{}={}", name.get_ref().replace('_', "-"), word(value.get_ref(), ',')?))
    });
    Ok(words.collect::<Result<Vec<_>, String>>()?.join(" "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lights_are_written_like_the_flag() {
        let light = |text: &str| light_words(DeTable::parse(text).unwrap().get_ref(), Path::new("a/b"));
        assert_eq!(light("kind = 'sun'\nalong = [0, -1, 0]\nirradiance = 3.5").unwrap(), "sun:0,-1,0:3.5");
        assert_eq!(light("kind = 'sky'\nradiance = [1, 2, 3]").unwrap(), "sky:1,2,3");
        let image = "kind = 'image'\nfile = 'x.hdr'\nfactor = 2";
        assert_eq!(light(image).unwrap(), "image:2:a/b/x.hdr");
        for bad in
            ["", "kind = 'image'", "kind = 'moon'", "kind = 'sky'", "kind = 'sky'\nradiance = 1\ncolor = 2"]
        {
            assert!(light(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn files_of_lights_can_be_elsewhere() {
        let moved = |text: &str| light_with_file(text, |file| format!("b/{}", file.display()));
        assert_eq!(moved("image:a.hdr"), "image:b/a.hdr");
        assert_eq!(moved("image:2,1,1:a.hdr"), "image:2,1,1:b/a.hdr");
        assert_eq!(moved("sky:1"), "sky:1");
    }

    #[test]
    fn numbers_keep_their_digits() {
        let table = DeTable::parse("a = 1_000\nb = 0.10\nc = 0x10\nd = [1, 'x']\ne = {}\nf = 1e3").unwrap();
        let text = |name: &str| word(table.get_ref().get(name).unwrap().get_ref(), 'x');
        assert_eq!(
            ["a", "b", "c", "d", "f"].map(|name| text(name).unwrap()),
            ["1000", "0.10", "16", "1xx", "1e3"]
        );
        assert!(text("e").is_err());
    }
}
