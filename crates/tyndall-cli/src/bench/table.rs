//! Measured numbers in rows under headings: as Markdown for people, as JSON for scripts.

use serde_json::{Map, Value, json};

/// What stands in a table.
pub(crate) enum Cell {
    Word(String),
    Count(usize),
    /// A number, and how many decimals people want of it.
    Number(f64, usize),
    /// What the system does not tell.
    Unknown,
}

/// Rows of cells under headings, of which no two are alike.
pub(crate) struct Table {
    headings: Vec<&'static str>,
    rows: Vec<Vec<Cell>>,
}

impl Table {
    /// Without rows yet.
    pub(crate) fn new(headings: &[&'static str]) -> Self {
        Self { headings: headings.to_vec(), rows: Vec::new() }
    }

    /// Adds a row: a cell for each heading.
    pub(crate) fn add(&mut self, row: impl IntoIterator<Item = Cell>) {
        self.rows.push(row.into_iter().collect());
    }

    /// Whether it has no rows.
    pub(crate) fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// An object a row, by heading.
    pub(crate) fn json(&self) -> Value {
        let value = |cell: &Cell| match cell {
            Cell::Word(word) => json!(word),
            Cell::Count(count) => json!(count),
            Cell::Number(number, _) => json!(number),
            Cell::Unknown => Value::Null,
        };
        let object = |row: &Vec<Cell>| {
            let cells = self.headings.iter().zip(row);
            Value::Object(
                cells.map(|(heading, cell)| (heading.to_string(), value(cell))).collect::<Map<_, _>>(),
            )
        };
        self.rows.iter().map(object).collect()
    }

    /// Words to the left, numbers to the right.
    pub(crate) fn markdown(&self) -> String {
        let text = |cell: &Cell| match cell {
            Cell::Word(word) => word.clone(),
            Cell::Count(count) => tyndall::scene::grouped(*count),
            Cell::Number(number, decimals) => format!("{number:.decimals$}"),
            Cell::Unknown => "–".into(),
        };
        let cells: Vec<Vec<String>> = self.rows.iter().map(|row| row.iter().map(text).collect()).collect();
        let is_word =
            |column: usize| self.rows.first().is_some_and(|row| matches!(row[column], Cell::Word(_)));
        let columns: Vec<(usize, bool)> = (0..self.headings.len())
            .map(|column| {
                let widest = cells.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
                (widest.max(self.headings[column].chars().count()), is_word(column))
            })
            .collect();
        let line = |cells: Vec<&str>| {
            let padded = cells.iter().zip(&columns).map(|(cell, &(width, is_word))| match is_word {
                true => format!("| {cell:<width$} "),
                false => format!("| {cell:>width$} "),
            });
            padded.collect::<String>() + "|\n"
        };
        let rule = columns.iter().map(|&(width, is_word)| {
            format!("|{}{}", "-".repeat(width + 1), if is_word { '-' } else { ':' })
        });
        let mut text = line(self.headings.clone());
        text += &(rule.collect::<String>() + "|\n");
        cells.iter().for_each(|row| text += &line(row.iter().map(String::as_str).collect()));
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_markdown_and_json() {
        let mut table = Table::new(&["set", "particles", "ms", "peak"]);
        assert!(table.is_empty());
        table.add([Cell::Word("a".into()), Cell::Count(1000), Cell::Number(2.25, 1), Cell::Unknown]);
        let text = "| set | particles |  ms | peak |\n|-----|----------:|----:|-----:|\n| a   |     1,000 | 2.2 |    – |\n";
        assert_eq!(table.markdown(), text);
        assert_eq!(table.json(), json!([{ "set": "a", "particles": 1000, "ms": 2.25, "peak": null }]));
    }
}
