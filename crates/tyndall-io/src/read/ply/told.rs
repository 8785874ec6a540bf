//! What `convert` tells in comments of a PLY file, which has no place for it: units, times, and the words that numbers stand for.

use tyndall::particles::{Attribute, Columns, Values};

/// The comment before all others.
const MARK: &str = "written by Tyndall";

/// Gives columns what the comments of their file tell.
pub(super) fn take(comments: &[String], columns: &mut Columns) {
    let Some((_, comments)) = comments.split_first().filter(|(first, _)| *first == MARK) else { return };
    for comment in comments {
        if let Some(unit) = comment.strip_prefix("lengths in ") {
            columns.length_unit = Some(unit.to_string());
        } else if let Some(time) = comment.strip_prefix("time ").and_then(|it| it.parse().ok()) {
            columns.time = Some(time);
        }
    }
    for attribute in columns.attributes.iter_mut().filter(|it| it.components == 1) {
        let names = words(comments, &attribute.name);
        if !names.is_empty() {
            restore(attribute, names);
        }
    }
}

/// The words that the numbers of an attribute stand for, from 0 on.
fn words(comments: &[String], attribute: &str) -> Vec<String> {
    let mut names = Vec::new();
    for comment in comments {
        let told = comment.strip_prefix(attribute).and_then(|it| it.strip_prefix(' '));
        if let Some((code, name)) = told.and_then(|it| it.split_once(" is "))
            && code.parse() == Ok(names.len())
        {
            names.push(name.to_string());
        }
    }
    names
}

/// Puts words in the place of numbers, if there is one for each.
fn restore(attribute: &mut Attribute, names: Vec<String>) {
    let code = |place: usize| {
        let number = attribute.values.number(place);
        (number >= 0.0 && number < names.len() as f64 && number.fract() == 0.0).then_some(number as u32)
    };
    if let Some(codes) = (0..attribute.values.len()).map(code).collect() {
        attribute.values = Values::Text { codes, names };
    }
}
