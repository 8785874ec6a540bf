//! Samples and quantiles of columns, the same at every run whatever the thread count.

use rayon::prelude::*;

/// At most this many values stand for a column when its quantiles are asked for.
const SAMPLES: usize = 1_000_000;

/// At most `limit` ids below `count`: all of them in order, or one from each of `limit` equal stretches, at a place in it that looks
/// random, so that no period of the file is met in step.
pub(crate) fn sampled_ids(count: usize, limit: usize) -> impl IndexedParallelIterator<Item = usize> {
    let samples = count.min(limit);
    (0..samples).into_par_iter().with_min_len(1 << 12).map(move |sample| {
        if samples == count {
            return sample;
        }
        // 128 bits, because the count times the number of samples exceeds 64 for the largest files.
        let start = |sample: usize| (sample as u128 * count as u128 / samples as u128) as usize;
        let stretch = start(sample + 1) - start(sample);
        start(sample) + (scrambled(sample as u64) % stretch as u64) as usize
    })
}

/// A fixed pseudo-random function of a number. Source: the output function of splitmix64, Steele et al. 2014.
pub(crate) fn scrambled(value: u64) -> u64 {
    let mut mixed = value.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    mixed ^ (mixed >> 31)
}

/// The values of a sample of the ids below `count` for which `value` has one.
pub(crate) fn sampled(count: usize, value: impl Fn(usize) -> Option<f64> + Sync + Send) -> Vec<f64> {
    sampled_ids(count, SAMPLES).filter_map(value).collect()
}

/// The values that have the `fractions` (0 to 1) of all others below them, by the nearest rank; `None` if there are no values.
/// Reorders the values.
pub(crate) fn quantiles<const N: usize>(values: &mut [f64], fractions: [f64; N]) -> Option<[f64; N]> {
    if values.is_empty() {
        return None;
    }
    let last = (values.len() - 1) as f64;
    Some(
        fractions.map(|fraction| {
            *values.select_nth_unstable_by((fraction * last).round() as usize, f64::total_cmp).1
        }),
    )
}

/// A number for people: four digits that count, no more.
pub fn short(number: f64) -> String {
    let magnitude = number.abs();
    if number == 0.0 || !number.is_finite() {
        return format!("{number}");
    }
    if !(1e-3..1e6).contains(&magnitude) {
        let (mantissa, exponent) = (format!("{number:.3e}"), "e");
        let (digits, power) = mantissa.split_once(exponent).unwrap_or((&mantissa, "0"));
        return format!("{}e{power}", trimmed(digits));
    }
    let decimals = (3 - magnitude.log10().floor() as i32).max(0) as usize;
    trimmed(&format!("{number:.decimals$}")).into()
}

/// Without zeros at the end of the decimals.
fn trimmed(digits: &str) -> &str {
    if digits.contains('.') { digits.trim_end_matches('0').trim_end_matches('.') } else { digits }
}

/// A count for people, with a comma every three digits.
pub fn grouped(count: usize) -> String {
    let digits = count.to_string();
    let mut text = String::new();
    for (place, digit) in digits.char_indices() {
        if place > 0 && (digits.len() - place).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_distinct_ids_in_order() {
        for (count, limit) in [(0, 5), (1, 5), (5, 5), (6, 5), (1000, 7), (u32::MAX as usize, 100_000)] {
            let ids: Vec<usize> = sampled_ids(count, limit).collect();
            assert_eq!(ids.len(), count.min(limit));
            assert!(ids.is_sorted_by(|a, b| a < b) && ids.iter().all(|&id| id < count), "{count} {limit}");
        }
    }

    #[test]
    fn quantiles_are_those_of_the_sorted_values() {
        let mut values: Vec<f64> = (0..=1000).map(|k| ((k * 617) % 1001) as f64).collect();
        assert_eq!(
            quantiles(&mut values, [0.0, 0.01, 0.5, 0.999, 1.0]),
            Some([0.0, 10.0, 500.0, 999.0, 1000.0])
        );
        assert_eq!(quantiles(&mut [3.0], [0.0, 1.0]), Some([3.0, 3.0]));
        assert_eq!(quantiles(&mut [], [0.5]), None);
    }

    #[test]
    fn numbers_are_short() {
        let cases = [(0.0, "0"), (-4.8, "-4.8"), (3.15159, "3.152"), (1234.56, "1235"), (1.5e-7, "1.5e-7")];
        for (number, text) in cases.into_iter().chain([(2e33, "2e33"), (-0.05, "-0.05"), (1e5, "100000")]) {
            assert_eq!(short(number), text);
        }
        assert_eq!(
            (grouped(7), grouped(1204), grouped(8_000_000)),
            ("7".into(), "1,204".into(), "8,000,000".into())
        );
    }
}
