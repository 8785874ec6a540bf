//! Numbers beside a color bar: 1, 2, 2.5 or 5 times powers of ten, and how they are written.

use tyndall::scene::color::Scale;
use tyndall::scene::coloring::Norm;
use tyndall::scene::short;

/// A mark beside a color bar.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tick {
    pub(super) value: f64,
    /// What is written there; nothing at small marks between.
    pub(super) label: Option<String>,
}

/// How much of a step a number may be out of range.
const TOLERANCE: f64 = 1e-9;

/// Marks within a scale, of which at most `most` (at least 2) are labeled.
pub(super) fn ticks(scale: &Scale, most: usize) -> Vec<Tick> {
    let Scale { norm, low, high, .. } = *scale;
    let most = most.max(2);
    if low >= high || !(high - low).is_finite() {
        return vec![Tick { value: low, label: Some(minus(&short(low))) }];
    }
    match norm {
        Norm::Linear => linear(low, high, most),
        Norm::Log => logarithmic(low, high, most),
    }
}

/// The power of ten below a number above 0.
fn decade(number: f64) -> i32 {
    let guess = number.log10().floor() as i32;
    if 10_f64.powi(guess + 1) <= number * (1.0 + TOLERANCE) { guess + 1 } else { guess }
}

fn linear(low: f64, high: f64, most: usize) -> Vec<Tick> {
    let count = |step: f64| {
        let first = (low / step - TOLERANCE).ceil();
        let last = (high / step + TOLERANCE).floor();
        (first, last, (last - first + 1.0).max(0.0))
    };
    let finest = decade((high - low) / most as f64) - 1;
    let steps = (finest..).flat_map(|power| [(10, power), (20, power), (25, power), (50, power)]);
    let step_of = |&(tenths, power): &(i32, i32)| f64::from(tenths) * 10_f64.powi(power - 1);
    // Steps grow tenfold: one of the first dozen is wide enough.
    let (tenths, power) =
        steps.take(16).find(|it| count(step_of(it)).2 <= most as f64).unwrap_or((10, finest + 4));
    let step = step_of(&(tenths, power));
    let (first, last, _) = count(step);
    let last_digit = if tenths == 25 { power - 1 } else { power };
    let values: Vec<f64> = (first as i64..=last as i64).map(|k| k as f64 * step).collect();
    let most = low.abs().max(high.abs());
    values.into_iter().map(|value| Tick { value, label: Some(number(value, last_digit, most)) }).collect()
}

fn logarithmic(low: f64, high: f64, most: usize) -> Vec<Tick> {
    let is_inside = |value: &f64| (low * (1.0 - TOLERANCE)..=high * (1.0 + TOLERANCE)).contains(value);
    let (first, last) = (decade(low), decade(high));
    let powers = || (first..=last).filter(|&power| is_inside(&10_f64.powi(power)));
    let between = |digits: &'static [i32]| {
        let values = (first..=last).flat_map(move |power| digits.iter().map(move |&digit| (digit, power)));
        values.filter(move |&(digit, power)| is_inside(&(f64::from(digit) * 10_f64.powi(power))))
    };
    let value = |(digit, power): (i32, i32)| f64::from(digit) * 10_f64.powi(power);
    let decades = powers().count();
    if decades >= 2 {
        let stride = decades.div_ceil(most) as i32;
        let is_plain = powers().all(|power| (-3..=4).contains(&power));
        let label = |power: i32| {
            if is_plain { plain(10_f64.powi(power), power) } else { format!("10{}", superscript(power)) }
        };
        let major = powers().filter(|power| power.rem_euclid(stride) == 0);
        let mut ticks: Vec<Tick> =
            major.map(|power| Tick { value: 10_f64.powi(power), label: Some(label(power)) }).collect();
        let minor: Vec<f64> = match stride {
            1 => between(&[2, 3, 4, 5, 6, 7, 8, 9]).map(value).collect(),
            _ => powers().filter(|power| power.rem_euclid(stride) != 0).map(|it| 10_f64.powi(it)).collect(),
        };
        ticks.extend(minor.into_iter().map(|value| Tick { value, label: None }));
        return ticks;
    }
    let few: Vec<(i32, i32)> = between(&[1, 2, 5]).collect();
    if (2..=most).contains(&few.len()) {
        let label = |(digit, power): (i32, i32)| match power {
            -3..=4 => plain(value((digit, power)), power),
            _ => format!("{digit}×10{}", superscript(power)),
        };
        let mut ticks: Vec<Tick> =
            few.into_iter().map(|it| Tick { value: value(it), label: Some(label(it)) }).collect();
        ticks.extend(between(&[3, 4, 6, 7, 8, 9]).map(|it| Tick { value: value(it), label: None }));
        return ticks;
    }
    // Within a part of a decade numbers in even steps say more.
    linear(low, high, most)
}

/// A number whose last digit that counts is at that power of ten; with a power of ten where the largest number, `most`, is very large or
/// small.
fn number(value: f64, last_digit: i32, most: f64) -> String {
    let power = decade(most.max(f64::MIN_POSITIVE));
    if (-4..6).contains(&power) && last_digit > -7 {
        return plain(value, last_digit);
    }
    if value == 0.0 {
        return "0".into();
    }
    let mantissa = plain(value / 10_f64.powi(power), last_digit - power);
    format!("{mantissa}×10{}", superscript(power))
}

/// With as many decimals as that last digit needs.
fn plain(value: f64, last_digit: i32) -> String {
    let decimals = (-last_digit).max(0) as usize;
    // Adding 0 makes -0 positive.
    minus(&format!("{:.decimals$}", value + 0.0))
}

/// With the sign for minus in place of the hyphen.
fn minus(text: &str) -> String {
    text.replace('-', "\u{2212}")
}

/// An exponent in small raised digits.
pub(super) fn superscript(exponent: i32) -> String {
    let raised = |letter: char| match letter {
        '-' => '⁻',
        _ => ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'][letter.to_digit(10).unwrap_or(0) as usize],
    };
    exponent.to_string().chars().map(raised).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(norm: Norm, low: f64, high: f64, most: usize) -> Vec<String> {
        let scale = Scale { norm, low, high, colors: vec![[0; 3]; 2], below: None, above: None };
        ticks(&scale, most).into_iter().filter_map(|it| it.label).collect()
    }

    #[test]
    fn numbers_are_round_and_written_alike() {
        for (low, high, most, wanted) in [
            (0.0, 1.0, 6, &["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"][..]),
            (0.0, 1.0, 5, &["0.00", "0.25", "0.50", "0.75", "1.00"]),
            (-4.2, -3.1, 6, &["−4.2", "−4.0", "−3.8", "−3.6", "−3.4", "−3.2"]),
            (-3.0, 3.0, 7, &["−3", "−2", "−1", "0", "1", "2", "3"]),
            (0.0, 3e7, 4, &["0", "1×10⁷", "2×10⁷", "3×10⁷"]),
            (2e-9, 7e-9, 3, &["2×10⁻⁹", "4×10⁻⁹", "6×10⁻⁹"]),
            (1000.0, 1000.5, 3, &["1000.0", "1000.2", "1000.4"]),
            (3.5, 3.5, 5, &["3.5"]),
        ] {
            assert_eq!(labels(Norm::Linear, low, high, most), wanted, "{low}:{high}");
        }
    }

    #[test]
    fn logarithms_have_decades_with_small_marks_between() {
        for (low, high, most, wanted) in [
            (1.0, 1000.0, 6, &["1", "10", "100", "1000"][..]),
            (1e-8, 1e7, 6, &["10⁻⁶", "10⁻³", "10⁰", "10³", "10⁶"]),
            (20.0, 700.0, 6, &["20", "50", "100", "200", "500"]),
            (2e9, 6e10, 6, &["2×10⁹", "5×10⁹", "1×10¹⁰", "2×10¹⁰", "5×10¹⁰"]),
            (0.02, 0.03, 4, &["0.020", "0.025", "0.030"]),
        ] {
            assert_eq!(labels(Norm::Log, low, high, most), wanted, "{low}:{high}");
        }
        let scale =
            Scale { norm: Norm::Log, low: 1.0, high: 100.0, colors: vec![], below: None, above: None };
        let all = ticks(&scale, 6);
        assert_eq!((all.len(), all.iter().filter(|it| it.label.is_some()).count()), (3 + 16, 3));
        assert!((scale.place(10.0) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn ticks_of_any_range_are_few_and_inside() {
        for step in 0..2000_u32 {
            let magnitude = 10_f64.powi((step % 41) as i32 - 20);
            let low = magnitude * (f64::from(step * 7919 % 1000) / 250.0 - 2.0);
            let high = low + magnitude * (0.001 + f64::from(step * 104_729 % 997) / 300.0);
            for (norm, low, high) in
                [(Norm::Linear, low, high), (Norm::Log, magnitude, magnitude + high - low)]
            {
                let scale = Scale { norm, low, high, colors: vec![], below: None, above: None };
                let all = ticks(&scale, 7);
                let labeled = all.iter().filter(|it| it.label.is_some()).count();
                assert!((1..=7).contains(&labeled), "{low}:{high} {labeled}");
                let mut labels: Vec<_> = all.iter().filter_map(|it| it.label.clone()).collect();
                labels.dedup();
                assert_eq!(labels.len(), labeled, "{low}:{high} {labels:?}");
                assert!(
                    all.iter().all(|it| (-1e-6..=1.0 + 1e-6).contains(&scale.place(it.value))),
                    "{low}:{high}"
                );
            }
        }
    }
}
