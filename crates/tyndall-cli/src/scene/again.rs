//! `--again PICTURE`: what is written in a picture says how to make it anew.

use std::path::{Path, PathBuf};

use tyndall::Error;
use tyndall_io::read;

use crate::metadata;
use crate::report::Outcome;

/// The one picture that is made anew, of those that were asked for when it was made.
#[derive(Clone, Debug)]
pub(crate) struct Again {
    /// Its name then.
    pub(crate) name: PathBuf,
    /// Where it goes.
    pub(crate) to: PathBuf,
}

/// What a picture remembers.
pub(super) struct Memory {
    /// What was asked for, as a scene file whose paths are relative to the folder in which that was.
    pub(super) scene: String,
    /// The name that it was given.
    pub(super) name: PathBuf,
    /// The files that were read, each with what was known of it.
    inputs: Vec<String>,
    software: String,
}

impl Memory {
    /// Reads what is written in a picture.
    pub(super) fn of(picture: &Path) -> Outcome<Self> {
        let texts = read::picture_texts(picture)?;
        let text = |key: &str| {
            let found = texts.iter().find(|(name, _)| name == key);
            found.map(|(_, text)| text.clone()).ok_or_else(|| {
                let hint = "PNG, EXR and JPEG files that Tyndall wrote say how they were made";
                Error::format(picture, "", format!("the picture has no text '{key}'"), hint)
            })
        };
        Ok(Self {
            scene: text("Scene")?,
            name: text("Picture")?.into(),
            inputs: text("Inputs")?.lines().map(String::from).collect(),
            software: text("Software")?,
        })
    }

    /// What may make the picture another one: another version, files that are not what they were.
    pub(super) fn warnings(&self, same_inputs: bool) -> Vec<String> {
        let software = metadata::software();
        let version = (self.software != software).then(|| {
            format!("the picture was made by {}, this is {software}: it may look otherwise", self.software)
        });
        let changed = self.inputs.iter().filter(|_| same_inputs).filter_map(|was| {
            let path = was.rsplit_once(" (").map_or(&**was, |(path, _)| path);
            let file = Path::new(path);
            let is = metadata::input(file);
            if is != *was && !file.exists() {
                let why = "names are those of the folder in which the picture was made: go there, or name the files";
                return Some(format!("'{path}' is not here — {why}"));
            }
            (is != *was).then(|| {
                format!("'{path}' is not what the picture was made of: that was {was}, this is {is}")
            })
        });
        version.into_iter().chain(changed).collect()
    }
}
