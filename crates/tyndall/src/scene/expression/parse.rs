//! From tokens to a tree, by descent: `or`, `and`, `not`, comparisons, sums, products, signs, powers, from loose to tight.

use super::functions::Function;
use super::tokens::{Token, split};
use super::{Arithmetic, Comparison, Tree, Wanted};

/// How deep expressions may be nested.
const DEEPEST: usize = 64;
/// Names that mean something else.
const KEYWORDS: [&str; 5] = ["and", "or", "not", "in", "to"];

struct Parser {
    tokens: Vec<(usize, Token)>,
    at: usize,
    depth: usize,
}

type Parsed<T = Tree> = Result<T, String>;

/// Reads an expression.
pub(super) fn parse(text: &str) -> Parsed {
    let mut parser = Parser { tokens: split(text)?, at: 0, depth: 0 };
    let tree = parser.any()?;
    match parser.next() {
        Token::End => Ok(tree),
        _ => Err(parser.wrong("an operator such as 'and', '<' or '+' is missing")),
    }
}

/// The tree of two sides.
fn both(left: Tree, right: Tree) -> Box<[Tree; 2]> {
    Box::new([left, right])
}

impl Parser {
    fn next(&self) -> &Token {
        &self.tokens[self.at].1
    }

    /// The next token, which is taken; the end stays.
    fn take(&mut self) -> Token {
        let token = self.next().clone();
        self.at += usize::from(token != Token::End);
        token
    }

    fn wrong(&self, what: &str) -> String {
        match self.tokens[self.at] {
            (_, Token::End) => format!("{what} at the end"),
            (character, _) => format!("{what} at character {character}"),
        }
    }

    /// Takes one of some signs or keywords.
    fn takes(&mut self, wanted: &[&str]) -> Option<&'static str> {
        let found = match self.next() {
            Token::Sign(sign) => wanted.contains(sign).then_some(*sign),
            Token::Name(name) => KEYWORDS.iter().copied().find(|it| it == name && wanted.contains(it)),
            _ => None,
        };
        self.at += usize::from(found.is_some());
        found
    }

    fn expect(&mut self, sign: &str) -> Parsed<()> {
        self.takes(&[sign]).map(|_| ()).ok_or_else(|| self.wrong(&format!("'{sign}' is missing")))
    }

    /// What is nested, if that is not too deep.
    fn nested(&mut self, part: fn(&mut Self) -> Parsed) -> Parsed {
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err(format!("it is nested deeper than {DEEPEST}"));
        }
        let tree = part(self);
        self.depth -= 1;
        tree
    }

    fn any(&mut self) -> Parsed {
        let mut left = self.all()?;
        while let Some(sign) = self.takes(&["or", "||"]) {
            let right = self.all()?;
            left = Tree::Or(conditions(left, right, sign)?);
        }
        Ok(left)
    }

    fn all(&mut self) -> Parsed {
        let mut left = self.not()?;
        while let Some(sign) = self.takes(&["and", "&&"]) {
            let right = self.not()?;
            left = Tree::And(conditions(left, right, sign)?);
        }
        Ok(left)
    }

    fn not(&mut self) -> Parsed {
        let Some(sign) = self.takes(&["not", "!"]) else { return self.comparison() };
        let inner = self.nested(Self::not)?;
        if !inner.is_condition() {
            return Err(format!("'{sign}' turns a condition around, such as c_pe > 0"));
        }
        Ok(Tree::Not(Box::new(inner)))
    }

    fn comparison(&mut self) -> Parsed {
        let first = self.sum()?;
        if self.takes(&["in"]).is_some() {
            let Tree::Name(name) = first else {
                return Err(self.wrong("before 'in' stands a quantity, before what is"));
            };
            return self.list().map(|values| Tree::Among(name, values));
        }
        let (mut sides, mut signs) = (vec![first], Vec::new());
        while let Some(sign) = self.takes(&["<", "<=", ">", ">=", "==", "=", "!="]) {
            signs.push(match sign {
                "<" => Comparison::Less,
                "<=" => Comparison::LessOrEqual,
                ">" => Comparison::Greater,
                ">=" => Comparison::GreaterOrEqual,
                "!=" => Comparison::Unequal,
                _ => Comparison::Equal,
            });
            sides.push(self.sum()?);
        }
        if signs.is_empty() { Ok(sides.remove(0)) } else { Ok(Tree::Compared(sides, signs)) }
    }

    fn sum(&mut self) -> Parsed {
        let mut left = self.product()?;
        while let Some(sign) = self.takes(&["+", "-"]) {
            let operator = if sign == "+" { Arithmetic::Add } else { Arithmetic::Subtract };
            left = Tree::Arithmetic(operator, both(left, self.product()?));
        }
        Ok(left)
    }

    fn product(&mut self) -> Parsed {
        let mut left = self.signed()?;
        while let Some(sign) = self.takes(&["*", "/", "%"]) {
            let operator = match sign {
                "*" => Arithmetic::Multiply,
                "/" => Arithmetic::Divide,
                _ => Arithmetic::Remainder,
            };
            left = Tree::Arithmetic(operator, both(left, self.signed()?));
        }
        Ok(left)
    }

    fn signed(&mut self) -> Parsed {
        match self.takes(&["-", "+"]) {
            Some("-") => Ok(Tree::Negative(Box::new(self.nested(Self::signed)?))),
            Some(_) => self.nested(Self::signed),
            None => self.power(),
        }
    }

    fn power(&mut self) -> Parsed {
        let base = self.primary()?;
        match self.takes(&["^", "**"]) {
            Some(_) => Ok(Tree::Arithmetic(Arithmetic::Power, both(base, self.nested(Self::signed)?))),
            None => Ok(base),
        }
    }

    fn primary(&mut self) -> Parsed {
        if self.takes(&["("]).is_some() {
            let inner = self.nested(Self::any)?;
            self.expect(")")?;
            return Ok(inner);
        }
        if self.takes(&["|"]).is_some() {
            let Token::Name(name) = self.take() else {
                return Err(self.wrong("between bars stands the name of a vector, before what is"));
            };
            self.expect("|")?;
            return Ok(Tree::Name(format!("|{name}|")));
        }
        let is_keyword = matches!(self.next(), Token::Name(name) if KEYWORDS.contains(&name.as_str()));
        match self.next().clone() {
            Token::Number(value, _) => {
                self.at += 1;
                Ok(Tree::Number(value))
            }
            Token::Length(value, meters) => {
                self.at += 1;
                Ok(Tree::Length(value, meters))
            }
            Token::Word(word) => {
                self.at += 1;
                Ok(Tree::Word(word))
            }
            Token::Name(name) if !is_keyword => {
                self.at += 1;
                self.named(name)
            }
            _ => Err(self.wrong("a number or a name is missing")),
        }
    }

    /// What begins with a name: a call, a list of values, or the name alone.
    fn named(&mut self, name: String) -> Parsed {
        if self.takes(&["("]).is_some() {
            return self.call(&name);
        }
        if name == "pi" {
            return Ok(Tree::Number(std::f64::consts::PI));
        }
        let mut values = Vec::new();
        while let Some(value) = self.value(false)? {
            values.push(value);
        }
        Ok(if values.is_empty() { Tree::Name(name) } else { Tree::Among(name, values) })
    }

    fn call(&mut self, name: &str) -> Parsed {
        let mut given = Vec::new();
        while self.takes(&[")"]).is_none() {
            if !given.is_empty() {
                self.expect(",")?;
            }
            given.push(self.nested(Self::any)?);
        }
        if name == "random" {
            return match given[..] {
                [] => Ok(Tree::Random(0)),
                [Tree::Number(seed)] if seed >= 0.0 && seed.fract() == 0.0 => Ok(Tree::Random(seed as u64)),
                _ => Err("random() takes a whole number, the seed, or nothing".into()),
            };
        }
        let function = Function::find(name)?;
        let [least, most] = function.takes;
        if !(least..=most).contains(&given.len()) {
            let takes = if least == most { least.to_string() } else { format!("{least} to {most}") };
            return Err(format!("{name}() takes {takes} values, not {}", given.len()));
        }
        if function.chooses && !given[0].is_condition() {
            return Err(format!("{name}() begins with a condition, such as c_pe > 0"));
        }
        Ok(Tree::Call(function, given))
    }

    /// Values behind `in`, with commas or blanks between them, in brackets or not.
    fn list(&mut self) -> Parsed<Vec<Wanted>> {
        let close = match self.takes(&["(", "["]) {
            Some("(") => Some(")"),
            Some(_) => Some("]"),
            None => None,
        };
        let mut values = Vec::new();
        while let Some(value) = self.value(true)? {
            values.push(value);
            self.takes(&[","]);
        }
        if values.is_empty() {
            return Err(self.wrong("a value is missing"));
        }
        close.map_or(Ok(()), |close| self.expect(close))?;
        Ok(values)
    }

    /// One value of a list, if there is one: a word, a number, or a range `1:3`, `1 to 3`, `1:`, `:3`.
    fn value(&mut self, may_be_negative: bool) -> Parsed<Option<Wanted>> {
        let word = match self.next() {
            Token::Word(word) => Some(word.clone()),
            Token::Name(name) if !KEYWORDS.contains(&name.as_str()) => Some(name.clone()),
            _ => None,
        };
        if let Some(text) = word {
            self.at += 1;
            return Ok(Some(Wanted { text, interval: None }));
        }
        let low = self.number(may_be_negative);
        if self.takes(&[":", "to"]).is_none() {
            return Ok(low.map(|(value, text)| Wanted { text, interval: Some([value; 2]) }));
        }
        let high = self.number(true);
        let (text, interval) = match (low, high) {
            (Some((low, first)), Some((high, last))) => (format!("{first}:{last}"), [low, high]),
            (Some((low, first)), None) => (format!("{first}:"), [low, f64::INFINITY]),
            (None, Some((high, last))) => (format!(":{last}"), [f64::NEG_INFINITY, high]),
            (None, None) => {
                return Err(self.wrong("a range has a number on one side of ':' at least; one is missing"));
            }
        };
        if interval[0] > interval[1] {
            return Err(format!("the range {text} ends before it begins"));
        }
        Ok(Some(Wanted { text, interval: Some(interval) }))
    }

    /// A number, if one is next.
    fn number(&mut self, may_be_negative: bool) -> Option<(f64, String)> {
        let is_negative = may_be_negative
            && *self.next() == Token::Sign("-")
            && matches!(self.tokens[self.at + 1].1, Token::Number(..));
        self.at += usize::from(is_negative);
        let Token::Number(value, text) = self.next().clone() else { return None };
        self.at += 1;
        Some(if is_negative { (-value, format!("-{text}")) } else { (value, text) })
    }
}

/// Two sides that are both true or false.
fn conditions(left: Tree, right: Tree, sign: &str) -> Parsed<Box<[Tree; 2]>> {
    if left.is_condition() && right.is_condition() {
        return Ok(both(left, right));
    }
    Err(format!("'{sign}' stands between conditions, such as c_pe > 0"))
}
