//! Arrays of words in XML files: the numbers of their letters between blanks, a zero behind each word.

use tyndall::particles::Attribute;

use super::Piece;
use super::data::{show, tokens};
use crate::read::column::{Column, Words};

/// An array of words, not decoded yet.
#[derive(Clone, Debug)]
pub(super) struct WordArray<'a> {
    pub(super) name: String,
    pub(super) components: usize,
    pub(super) text: &'a [u8],
}

/// The arrays of words that all pieces have alike, and for the others why they are left out.
pub(super) fn attributes(pieces: &[Piece], warnings: &mut Vec<String>) -> Vec<Attribute> {
    let Some(first) = pieces.first() else { return Vec::new() };
    let mut attributes: Vec<Attribute> = Vec::new();
    for array in &first.words {
        let taken = |name: &str| attributes.iter().any(|it| it.name == name);
        if taken(&array.name) || first.attributes.iter().any(|it| it.name == array.name) {
            warnings.push(format!("left out: a second array '{}'", array.name));
            continue;
        }
        match attribute(array, pieces) {
            Ok(attribute) => attributes.push(attribute),
            Err(why) => warnings.push(format!("left out: words '{}' ({why})", array.name)),
        }
    }
    attributes
}

fn attribute(array: &WordArray, pieces: &[Piece]) -> Result<Attribute, String> {
    let mut words = Words::default();
    for piece in pieces {
        let alike = |it: &&WordArray| it.name == array.name && it.components == array.components;
        let found = piece.words.iter().find(alike).ok_or("not all pieces have them alike")?;
        let (before, mut word) = (words.len(), Vec::new());
        for token in tokens(found.text) {
            let letter = std::str::from_utf8(token).ok().and_then(|it| it.parse::<i16>().ok());
            match letter.filter(|it| (-128..256).contains(it)) {
                None => {
                    return Err(format!("the number of a letter was wanted, '{}' was found", show(token)));
                }
                Some(0) => {
                    words.push(&word);
                    word.clear();
                }
                Some(letter) => word.push(letter as u8),
            }
        }
        let (found, wanted) = (words.len() - before, piece.count.saturating_mul(array.components));
        if found != wanted || !word.is_empty() {
            return Err(format!("{wanted} were wanted, {found} are there"));
        }
    }
    Ok(Attribute::new(array.name.clone(), array.components, Column::Text(words).into_values()))
}
