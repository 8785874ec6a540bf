//! The words, numbers and signs of an expression.

use crate::scene::units::meters;

/// What a text is made of.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Token {
    /// A number, as it is written too.
    Number(f64, String),
    /// A number with a unit of length, which is so many meters.
    Length(f64, f64),
    /// A word in quotes, or one that ends with `*`.
    Word(String),
    Name(String),
    Sign(&'static str),
    End,
}

/// Signs, the longer ones first.
const SIGNS: [&str; 24] = [
    "<=", ">=", "==", "!=", "&&", "||", "**", "<", ">", "=", "!", "+", "-", "*", "/", "%", "^", "(", ")",
    "[", "]", ",", ":", "|",
];

/// Splits a text; each token with the character, counted from 1, at which it begins.
pub(super) fn split(text: &str) -> Result<Vec<(usize, Token)>, String> {
    let mut tokens = Vec::new();
    let mut rest = text;
    let place = |rest: &str| text[..text.len() - rest.len()].chars().count() + 1;
    loop {
        rest = rest.trim_start();
        let at = place(rest);
        let Some(first) = rest.chars().next() else {
            tokens.push((at, Token::End));
            return Ok(tokens);
        };
        let is_number =
            first.is_ascii_digit() || (first == '.' && rest[1..].starts_with(|it: char| it.is_ascii_digit()));
        let (token, after) = match first {
            '\'' | '"' | '`' => {
                let end = rest[1..]
                    .find(first)
                    .ok_or_else(|| format!("{first} at character {at} is not closed"))?;
                let inner = rest[1..=end].to_string();
                (if first == '`' { Token::Name(inner) } else { Token::Word(inner) }, &rest[end + 2..])
            }
            _ if is_number => number(rest),
            _ if first.is_alphabetic() || first == '_' => name(rest),
            _ => match SIGNS.iter().find(|sign| rest.starts_with(**sign)) {
                Some(sign) => (Token::Sign(sign), &rest[sign.len()..]),
                None => return Err(format!("'{first}' at character {at} means nothing here")),
            },
        };
        tokens.push((at, token));
        rest = after;
    }
}

/// The letters at the beginning of a text that belong to a name: `v.x`, `c_1[2]`, `Vel:0`.
fn name_length(text: &str) -> usize {
    let is_letter = |it: char| it.is_alphanumeric() || it == '_';
    let mut length = 0;
    loop {
        let rest = &text[length..];
        let letters = rest.find(|it| !is_letter(it)).unwrap_or(rest.len());
        length += letters;
        let mut next = text[length..].chars();
        match (next.next(), next.next()) {
            (Some('.' | ':'), Some(letter)) if is_letter(letter) => length += 1,
            (Some('['), Some(digit)) if digit.is_ascii_digit() => match text[length..].find(']') {
                Some(end) if text[length + 1..length + end].bytes().all(|it| it.is_ascii_digit()) => {
                    length += end + 1;
                }
                _ => return length,
            },
            _ => return length,
        }
    }
}

fn name(text: &str) -> (Token, &str) {
    let (name, rest) = text.split_at(name_length(text));
    // `H*` is a word if nothing follows that it could be multiplied with.
    if let Some(after) = rest.strip_prefix('*')
        && after.chars().next().is_none_or(|it| it.is_whitespace() || ",)]".contains(it))
        && !after.trim_start().starts_with(|it: char| it.is_ascii_digit() || it == '(')
    {
        return (Token::Word(format!("{name}*")), after);
    }
    (Token::Name(name.into()), rest)
}

fn number(text: &str) -> (Token, &str) {
    let digits = |text: &str| text.find(|it: char| !it.is_ascii_digit()).unwrap_or(text.len());
    let mut length = digits(text);
    if text[length..].starts_with('.') {
        length += 1 + digits(&text[length + 1..]);
    }
    if let Some(exponent) = text[length..].strip_prefix(['e', 'E']) {
        let unsigned = exponent.strip_prefix(['+', '-']).unwrap_or(exponent);
        if digits(unsigned) > 0 {
            length += 1 + exponent.len() - unsigned.len() + digits(unsigned);
        }
    }
    let (written, rest) = text.split_at(length);
    // Digits with a point and an exponent are a number.
    let value = written.parse().unwrap_or(f64::NAN);
    let after = rest.trim_start();
    let (unit, behind) = after.split_at(name_length(after));
    match meters(unit) {
        Some(meters) => (Token::Length(value, meters), behind),
        None => (Token::Number(value, written.into()), rest),
    }
}
