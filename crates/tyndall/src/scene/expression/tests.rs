//! Expressions against what Rust makes of the same formula, and the texts that are refused.

use glam::DVec3;

use super::{Bound, Tree};
use crate::particles::{Attribute, Columns, Particles, Values};

/// Ten atoms of water and copper in a file in Å; one charge is missing.
fn particles() -> Particles {
    let mut columns = Columns::default();
    columns
        .positions
        .extend(&(0..10).map(|k| DVec3::new(k as f64, 10.0 * k as f64, -1.0)).collect::<Vec<_>>());
    let text = |codes: [u32; 10], names: &[&str]| Values::Text {
        codes: codes.into(),
        names: names.iter().map(|it| it.to_string()).collect(),
    };
    let charges = (0..10).map(|k| if k == 4 { f32::NAN } else { k as f32 - 5.0 }).collect();
    columns.attributes = vec![
        Attribute::new("element", 1, text([0, 1, 1, 0, 1, 1, 2, 2, 2, 2], &["O", "H", "Cu"])),
        Attribute::new("resname", 1, text([0, 0, 0, 0, 0, 0, 1, 1, 1, 1], &["SOL", "CU1"])),
        Attribute::new("name", 1, text([0, 1, 2, 0, 1, 2, 3, 3, 3, 3], &["OW", "HW1", "HW2", "CU"])),
        Attribute::new("type", 1, Values::I32(vec![1, 2, 2, 1, 2, 2, 3, 3, 3, 3])),
        Attribute::new("q", 1, Values::F32(charges)),
        Attribute::new("v", 3, Values::F32((0..30).map(|k| k as f32).collect())),
        Attribute::new("Time (s)", 1, Values::F32(vec![7.0; 10])),
        Attribute::new("c_1[2]", 1, Values::F32(vec![8.0; 10])),
    ];
    columns.length_unit = Some("Å".into());
    Particles::new(columns).unwrap()
}

fn values(text: &str) -> Result<Vec<f64>, String> {
    let particles = particles();
    let bound = Bound::new(&Tree::parse(text)?, &particles)?;
    Ok((0..10).map(|id| bound.value(id)).collect())
}

/// The particles for which a condition holds.
fn chosen(text: &str) -> Vec<usize> {
    assert!(Tree::parse(text).unwrap().is_condition(), "{text}");
    let values = values(text).unwrap_or_else(|why| panic!("{text}: {why}"));
    assert!(values.iter().all(|value| [0.0, 1.0].contains(value)), "{text}");
    (0..10).filter(|&id| values[id] == 1.0).collect()
}

#[test]
fn conditions_choose() {
    for (text, expected) in [
        ("element == O", vec![0, 3]),
        ("'O' = element", vec![0, 3]),
        ("element != O and resname == 'SOL'", vec![1, 2, 4, 5]),
        ("element O Cu", vec![0, 3, 6, 7, 8, 9]),
        ("element == Fe or element cu", vec![6, 7, 8, 9]),
        ("not resname SOL", vec![6, 7, 8, 9]),
        ("! resname in (SOL, 'CU*') || type 1", vec![0, 3]),
        ("name HW*", vec![1, 2, 4, 5]),
        ("name == 'HW?' && name != HW2", vec![1, 4]),
        ("type == 1", vec![0, 3]),
        ("type in 1, 3", vec![0, 3, 6, 7, 8, 9]),
        ("type 1:2 and index 2 to 4", vec![2, 3, 4]),
        ("index in [:1, 8:]", vec![0, 1, 8, 9]),
        ("q in -5:-4, 4", vec![0, 1, 9]),
        ("-2 <= q < 1", vec![3, 5]),
        ("q == q", vec![0, 1, 2, 3, 5, 6, 7, 8, 9]),
        ("missing(q)", vec![4]),
        ("not q > 0", vec![0, 1, 2, 3, 4, 5]),
        ("x > 0.75 nm", vec![8, 9]),
        ("y<1.5e-9 m", vec![0, 1]),
        ("|v| < 10", vec![0, 1]),
        ("v.x == 3 or `Time (s)` != 7", vec![1]),
        ("c_1[2] / 2 == x", vec![4]),
        ("if(type == 1, x > 1, x < 2)", vec![1, 3]),
        ("x > 1 and (y < 30 or z > 0)", vec![2]),
        ("x > 8 or x < 1 and y > 5", vec![9]),
        ("random() <= 1 and random(7) < 0", vec![]),
    ] {
        assert_eq!(chosen(text), expected, "{text}");
    }
}

#[test]
fn numbers_are_those_of_the_formula() {
    type Formula = fn(f64) -> f64;
    let formulas: [(&str, Formula); 14] = [
        ("2 + 3 * x", |x| 2.0 + 3.0 * x),
        ("(2+3)*x", |x| 5.0 * x),
        ("x - 1 - 2", |x| x - 3.0),
        ("12 / 2 / 3 * x", |x| 2.0 * x),
        ("-x^2", |x| -(x * x)),
        ("2^3^2 - x", |x| 512.0 - x),
        ("2**-1*x", |x| 0.5 * x),
        ("- - x", |x| x),
        ("(x - 5) % 3", |x| (x - 5.0).rem_euclid(3.0)),
        ("sqrt(x) + abs(x - 4)", |x| x.sqrt() + (x - 4.0).abs()),
        ("min(x, 3, 5) + max(x, 2)", |x| x.min(3.0) + x.max(2.0)),
        ("hypot(x, 3, 4)", |x| (x * x + 25.0).sqrt()),
        ("atan2(x, 2) * 180 / pi", |x| x.atan2(2.0).to_degrees()),
        ("if(x > 4, 1, -1) * sign(x - 4)", |x| if x == 4.0 { -0.0 } else { 1.0 }),
    ];
    for (text, formula) in formulas {
        let values = values(text).unwrap_or_else(|why| panic!("{text}: {why}"));
        for (x, value) in values.into_iter().enumerate() {
            assert!((value - formula(x as f64)).abs() < 1e-12, "{text} at {x}: {value}");
        }
    }
    let drawn = values("random(3)").unwrap();
    assert!(drawn.iter().all(|it| (0.0..1.0).contains(it)) && drawn != values("random(4)").unwrap());
}

#[test]
fn what_cannot_be_understood_is_explained() {
    for (text, expected) in [
        ("", "a number or a name is missing at the end"),
        ("x >", "a number or a name is missing at the end"),
        ("x > > 2", "a number or a name is missing at character 5"),
        ("x > 2 y", "an operator such as 'and', '<' or '+' is missing at character 7"),
        ("(x > 2", "')' is missing at the end"),
        ("x > 2 and y", "'and' stands between conditions, such as c_pe > 0"),
        ("not x", "'not' turns a condition around"),
        ("x $ 2", "'$' at character 3 means nothing here"),
        ("name == 'CU", "' at character 9 is not closed"),
        ("type in", "a value is missing at the end"),
        ("2 in 1, 2", "before 'in' stands a quantity"),
        ("type 3:1", "the range 3:1 ends before it begins"),
        ("sqr(x)", "no function 'sqr'; did you mean 'sqrt'? there are: abs, sqrt,"),
        ("sqrt(x, 2)", "sqrt() takes 1 values, not 2"),
        ("random(x)", "random() takes a whole number"),
        ("if(x, 1, 2)", "if() begins with a condition"),
        ("element == Zz", "no 'Zz' in element; it has: Cu, H, O"),
        ("resname == SOLV", "no 'SOLV' in resname; did you mean 'SOL'? it has: CU1, SOL"),
        ("element < O", "element has words, which are equal (==) or not (!=)"),
        ("element + 1", "element has words: compare it"),
        ("type == O", "no attribute 'O'"),
        ("type == 'O'", "'O' is compared with what has no words"),
        ("type O", "'O' is no number, and type has numbers"),
        ("resname == 3", "resname has words, and is compared with a number"),
        ("temp > 3", "no attribute 'temp'; available: element, resname"),
        ("x > 2 kpc and 'a' + 2 > 1", "the word 'a' is not compared with anything"),
    ] {
        let why = values(text).expect_err(text);
        assert!(why.starts_with(expected), "{text}: {why}");
    }
    let deep = format!("{}x{}", "(".repeat(5000), ")".repeat(5000));
    assert!(values(&deep).unwrap_err().contains("nested deeper"));
    assert!(values(&"-".repeat(5000)).is_err());
}

#[test]
fn a_unit_needs_that_of_the_file() {
    for (unit, why) in [(None, "does not say its unit"), (Some("ckpc/h"), "ckpc/h, is not known")] {
        let columns = Columns { length_unit: unit.map(String::from), ..Columns::default() };
        let particles = Particles::new(columns).unwrap();
        let error = Bound::new(&Tree::parse("x > 2 nm").unwrap(), &particles).unwrap_err();
        assert!(error.contains(why), "{error}");
    }
}
