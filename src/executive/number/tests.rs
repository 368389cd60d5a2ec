use proptest::prelude::*;

use super::*;

#[test]
fn people_see_few_digits() {
    for (number, expected) in [
        (0.1 + 0.2, "0.3"),
        (0.0, "0"),
        (-0.0, "0"),
        (9.806_65, "9.80665"),
        (1.0 / 3.0, "0.333333"),
        (-2.0, "-2"),
        (33_554_432.0, "33554432"),
        (1_234_567.8, "1234568"),
        (999_999.96, "1000000"),
        (0.000_012_345_67, "0.0000123457"),
        (1.5e-9, "1.5e-9"),
        (1e300, "1e300"),
        (f64::NAN, "NaN"),
        (f64::INFINITY, "inf"),
        (f64::NEG_INFINITY, "-inf"),
    ] {
        assert_eq!(plain(number, 6), expected);
    }
    assert_eq!(plain(39.904_212_345, 9), "39.9042123");
}

#[test]
fn a_value_never_seems_to_be_on_the_other_side_of_its_bound() {
    assert_eq!(beside(2.000_000_4, 6, &[2.0]), "2.0000004");
    assert_eq!(beside(1.999_999_9, 6, &[2.0]), "1.9999999");
    assert_eq!(beside(2.0, 6, &[2.0]), "2");
    assert_eq!(beside(0.1 + 0.2, 6, &[0.3]), "0.30000000000000004");
    assert_eq!(beside(2.1, 6, &[2.0]), "2.1");
}

#[test]
fn noise_of_arithmetic_is_cut() {
    assert_eq!(denoised(0.49 + 0.49 * 0.05), 0.5145);
    assert_eq!(denoised(0.49 - 0.49 * 0.05), 0.4655);
    assert_eq!(denoised(0.0), 0.0);
    assert!(denoised(f64::NAN).is_nan());
    assert_eq!(denoised(f64::INFINITY), f64::INFINITY);
}

#[test]
fn bounds_print_as_written() {
    assert_eq!(exact(0.5145), "0.5145");
    assert_eq!(exact(-2.0), "-2");
    assert_eq!(exact(0.0), "0");
    assert_eq!(exact(1e-9), "1e-9");
    assert_eq!(exact(1e300), "1e300");
}

proptest! {
    #[test]
    fn printing_keeps_the_side(bound in -1e6..1e6f64, steps in -3i32..=3) {
        // The value is a neighbour of the bound in the last place.
        let mut value = bound;
        for _ in 0..steps.abs() {
            value = if steps > 0 { value.next_up() } else { value.next_down() };
        }
        let text = beside(value, 6, &[bound]);
        let printed: f64 = text.parse().unwrap();
        let shown_bound: f64 = exact(bound).parse().unwrap();
        prop_assert_eq!(printed.partial_cmp(&shown_bound), value.partial_cmp(&bound));
    }

    #[test]
    fn any_number_prints_short_and_near(number in proptest::num::f64::NORMAL) {
        let text = plain(number, 6);
        prop_assert!(text.len() <= 24, "{}", text);
        let printed: f64 = text.parse().unwrap();
        prop_assert!(((printed - number) / number).abs() < 1e-5);
    }
}

#[test]
fn the_ends_of_an_interval_show_its_width() {
    let check = |low: f64, high: f64, expected: (&str, &str)| {
        let (one, other) = interval(low, high);
        assert_eq!((one.as_str(), other.as_str()), expected);
    };
    check(0.149_851, 0.150_149, ("0.14985", "0.15015"));
    check(2.9, 11.4, ("2.9", "11.4"));
    check(0.15, 0.15, ("0.15", "0.15"));
    check(-1e-9, 1e-9, ("-1e-9", "1e-9"));
    check(999.999_96, 1_000.000_04, ("999.99996", "1000.00004"));
    check(0.0, 0.003, ("0", "0.003"));
    check(f64::NEG_INFINITY, 1.0, ("-inf", "1"));
}
