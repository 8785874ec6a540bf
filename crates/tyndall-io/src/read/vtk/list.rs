//! Files that name other files: the pieces of a data set (`.pvtp`, `.pvtu`, `.vtm`) and its time steps (`.pvd`, `.series`).
//!
//! Names are relative to the file that has them. Sources: vtkXMLPDataReader.cxx, vtkXMLMultiBlockDataReader.cxx, ParaView's
//! vtkPVDReader and vtkFileSeriesReader.

use std::path::{Path, PathBuf};

use serde_json::Value;
use tyndall::{Error, Result};

use super::xml::Document;

/// A time step.
#[derive(Debug, PartialEq)]
pub(super) struct Step {
    pub(super) time: Option<f64>,
    /// The files that make it up, and the arrays that they have.
    pub(super) files: Vec<PathBuf>,
}

/// Whether this is a list of files in JSON, which ParaView calls a file series.
pub(super) fn recognise_series(head: &[u8]) -> bool {
    head.trim_ascii_start().starts_with(b"{")
        && memchr::memmem::find(head, b"\"file-series-version\"").is_some()
}

/// The time steps of a file series.
pub(super) fn series(path: &Path, bytes: &[u8]) -> Result<Vec<Step>> {
    let fault = |place: String, what: String| {
        let hint = "give the files themselves, for example with a glob";
        Error::format(path, place, what, hint)
    };
    let json: Value = serde_json::from_slice(bytes)
        .map_err(|error| fault(format!("line {}", error.line()), format!("this is no JSON: {error}")))?;
    let files = json["files"].as_array();
    let files = files.ok_or_else(|| fault(String::new(), "the list 'files' is missing".into()))?;
    let step = |(place, file): (usize, &Value)| {
        let name = file["name"].as_str().or(file.as_str());
        let name = name.ok_or_else(|| fault(format!("file {place}"), "it has no name".into()))?;
        Ok(Step { time: file["time"].as_f64(), files: vec![beside(path, name)] })
    };
    files.iter().enumerate().map(step).collect()
}

/// The time steps of a collection (`.pvd`). Parts of one time are one step.
pub(super) fn collection(path: &Path, document: &Document) -> Result<Vec<Step>> {
    let mut steps: Vec<(Step, Vec<String>)> = Vec::new();
    for node in document.body()?.all("DataSet") {
        let Some(file) = node.get("file") else { continue };
        let time = match node.get("timestep").filter(|it| !it.is_empty()) {
            None => None,
            Some(text) => Some(text.parse().map_err(|_| {
                let what = format!("a time was wanted, '{text}' was found");
                Error::format(path, "DataSet", what, "correct the attribute timestep")
            })?),
        };
        let part =
            [node.get("group"), node.get("part"), node.get("name")].map(Option::unwrap_or_default).join("/");
        let file = beside(path, file);
        match steps.last_mut() {
            Some((step, parts)) if step.time == time && !parts.contains(&part) => {
                step.files.push(file);
                parts.push(part);
            }
            _ => steps.push((Step { time, files: vec![file] }, vec![part])),
        }
    }
    Ok(steps.into_iter().map(|(step, _)| step).collect())
}

/// The files of the pieces of a data set; `None` if the file has its points itself.
pub(super) fn pieces(path: &Path, document: &Document) -> Result<Option<Vec<PathBuf>>> {
    let (element, attribute) = match document.kind.as_str() {
        "PPolyData" | "PUnstructuredGrid" | "PStructuredGrid" => ("Piece", "Source"),
        "vtkMultiBlockDataSet"
        | "vtkMultiPieceDataSet"
        | "vtkPartitionedDataSet"
        | "vtkPartitionedDataSetCollection" => ("DataSet", "file"),
        _ => return Ok(None),
    };
    let nodes = document.body()?.all(element);
    Ok(Some(nodes.iter().filter_map(|it| it.get(attribute)).map(|it| beside(path, it)).collect()))
}

/// A file that is named within `path`. No file has control characters in its name, but damage brings them in.
pub(in crate::read) fn beside(path: &Path, name: &str) -> PathBuf {
    let name = name.replace(char::is_control, "\u{fffd}");
    let name = if cfg!(unix) { name.replace('\\', "/") } else { name };
    path.parent().unwrap_or(Path::new("")).join(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step(time: Option<f64>, files: &[&str]) -> Step {
        Step { time, files: files.iter().map(|it| Path::new("a").join(it)).collect() }
    }

    #[test]
    fn parts_of_one_time_are_one_step() {
        let text = br#"<?xml version="1.0"?><VTKFile type="Collection"><Collection>
            <DataSet timestep="0" part="0" file="x/a.vtp"/><DataSet timestep="0" part="1" file="x\b.vtp"/>
            <DataSet timestep="0.5" part="0" file="c.vtp"/><DataSet timestep="0.5" part="0" file="d.vtp"/>
            <DataSet timestep="" file="e.vtp"/></Collection></VTKFile>"#;
        let path = Path::new("a/run.pvd");
        let steps = collection(path, &Document::read(path, text).unwrap()).unwrap();
        let wanted = [
            step(Some(0.0), &["x/a.vtp", "x/b.vtp"]),
            step(Some(0.5), &["c.vtp"]),
            step(Some(0.5), &["d.vtp"]),
            step(None, &["e.vtp"]),
        ];
        assert_eq!(steps, wanted);
    }

    #[test]
    fn a_series_names_files_and_times() {
        let text = br#"{ "file-series-version" : "1.0", "files" : [ { "name" : "a.vtp", "time" : 1 }, {"name": "b.vtp"} ] }"#;
        assert!(recognise_series(text) && !recognise_series(b"{\"files\": []}"));
        let steps = series(Path::new("a/s.series"), text).unwrap();
        assert_eq!(steps, [step(Some(1.0), &["a.vtp"]), step(None, &["b.vtp"])]);
        for bad in ["{", "{}", "{\"files\": [1]}"] {
            assert!(series(Path::new("s"), bad.as_bytes()).is_err(), "{bad}");
        }
    }
}
