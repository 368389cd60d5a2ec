//! Dense records thinned for pictures. The details of an item hold the points that the report draws, not the whole
//! capture.

/// Most points of one curve. A picture of a page's width shows no more.
pub(super) const MOST_POINTS: usize = 400;

/// Places of the smallest and the largest value of each part of a record, in their order, so that outliers stay.
pub(super) fn extremes(values: &[f64]) -> Vec<usize> {
    if values.len() <= MOST_POINTS {
        return (0..values.len()).collect();
    }
    let part = values.len().div_ceil(MOST_POINTS / 2);
    let mut kept = Vec::with_capacity(MOST_POINTS);
    for first in (0..values.len()).step_by(part) {
        let places = || first..(first + part).min(values.len());
        let by_value = |a: &usize, b: &usize| values[*a].total_cmp(&values[*b]);
        let (low, high) = (places().min_by(by_value), places().max_by(by_value));
        kept.extend(low.min(high));
        kept.extend(low.max(high).filter(|_| low != high));
    }
    kept
}

/// Places of the points nearest to the centre and farthest from it in each direction, by direction.
pub(super) fn rim(points: &[(f64, f64)]) -> Vec<usize> {
    const DIRECTIONS: usize = MOST_POINTS / 2;
    let mut ends: Vec<Option<[(usize, f64); 2]>> = vec![None; DIRECTIONS];
    for (place, (x, y)) in points.iter().enumerate() {
        let turn = y.atan2(*x) / std::f64::consts::TAU + 0.5;
        let direction = ((turn * DIRECTIONS as f64) as usize).min(DIRECTIONS - 1);
        let radius = x.hypot(*y);
        let [near, far] = ends[direction].get_or_insert([(place, radius); 2]);
        if radius < near.1 {
            *near = (place, radius);
        }
        if radius > far.1 {
            *far = (place, radius);
        }
    }
    let mut kept: Vec<usize> = ends.into_iter().flatten().flatten().map(|(place, _)| place).collect();
    kept.dedup();
    kept
}

/// Stride with which at most [`MOST_POINTS`] points are kept.
pub(super) fn stride(length: usize) -> usize {
    length.div_ceil(MOST_POINTS).max(1)
}

/// Numbers for a picture, rounded to `decimals` decimals. All digits of an `f64` would only fill the record.
pub(super) fn rounded(values: impl IntoIterator<Item = f64>, decimals: i32) -> Vec<f64> {
    let scale = 10_f64.powi(decimals);
    values.into_iter().map(|value| (value * scale).round() / scale).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One spike among a million samples, at any place, is still visible.
    #[test]
    fn what_sticks_out_stays() {
        for place in [0, 1, 499_999, 999_998, 999_999] {
            let mut values: Vec<f64> = (0..1_000_000).map(|k| f64::from(k % 7)).collect();
            values[place] = -100.0;
            let kept = extremes(&values);
            assert!(kept.len() <= MOST_POINTS && kept.contains(&place), "{place}: {} points", kept.len());
            assert!(kept.is_sorted(), "points out of order");
        }
        assert_eq!(extremes(&[1.0, 1.0, 3.0]), [0, 1, 2]);
        assert_eq!(extremes(&[]), [0_usize; 0]);
    }

    #[test]
    fn the_farthest_and_the_nearest_of_every_direction_stay() {
        let circle = |k: usize| (k as f64 / 5e4 * std::f64::consts::TAU).sin_cos();
        let mut points: Vec<(f64, f64)> = (0..50_000).map(circle).collect();
        points[77] = (0.9 * points[77].0, 0.9 * points[77].1);
        points[40_000] = (1.1 * points[40_000].0, 1.1 * points[40_000].1);
        let kept = rim(&points);
        assert!(kept.len() <= MOST_POINTS && kept.len() >= 200, "{} points", kept.len());
        assert!(kept.contains(&77) && kept.contains(&40_000));
    }

    #[test]
    fn rounding_keeps_what_is_written() {
        assert_eq!(serde_json::json!(rounded([0.123_456, -2.0], 4)).to_string(), "[0.1235,-2.0]");
        assert_eq!((stride(400), stride(401), stride(0)), (1, 2, 1));
    }
}
