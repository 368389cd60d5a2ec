//! The transforms against the sums that define them.

#![allow(clippy::unwrap_used, reason = "what cannot be set up fails the test that needs it")]

use std::f64::consts::TAU;

use gnc_fourier::{forward, inverse};

/// Samples without a pattern, by a linear congruence of Knuth.
fn samples(length: usize) -> Vec<f64> {
    let mut state = 1_u64;
    let next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    std::iter::repeat_with(next).take(length).collect()
}

/// Lengths with small factors, small and large primes (1009 = 2^4 3^2 7 + 1), and 1019 = 2 * 509 + 1, which needs a chirp.
#[test]
fn transforms_are_the_sums_of_their_definition() {
    for length in [8, 12, 31, 400, 1009, 1019] {
        let values = samples(length);
        let plan = forward(length);
        let (mut input, mut output) = (values.clone(), plan.make_output_vec());
        plan.process(&mut input, &mut output).unwrap();
        assert_eq!(output.len(), length / 2 + 1);
        for (k, found) in output.iter().enumerate() {
            let turn = |j: usize| TAU * ((j * k) % length) as f64 / length as f64;
            let sum = |part: fn(f64) -> f64| values.iter().enumerate().map(|(j, v)| v * part(turn(j))).sum::<f64>();
            let (re, im) = (sum(f64::cos), -sum(f64::sin));
            assert!((found.re - re).abs() < 1e-10 && (found.im - im).abs() < 1e-10, "{length} {k}: {found}");
        }
        let mut back = vec![0.0; length];
        inverse(length).process(&mut output, &mut back).unwrap();
        for (back, value) in back.iter().zip(&values) {
            assert!((back / length as f64 - value).abs() < 1e-14, "{length}: {back} {value}");
        }
    }
}
