//! Statistics of measurements: means with confidence intervals, rank correlation, Pareto fronts, and curves on
//! logarithmic axes.

use statrs::distribution::{ContinuousCDF, StudentsT};

/// Probability that an interval contains the true mean.
const CONFIDENCE: f64 = 0.95;

/// A mean and its confidence interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    pub mean: f64,
    pub low: f64,
    pub high: f64,
}

/// Mean and 95 % confidence interval by Student's t. The interval of a single value is NaN.
pub fn mean(values: &[f64]) -> Interval {
    mean_with_shared_error(values, 0.0)
}

/// Degrees of freedom of the variance of a shared error: the clock's comes from about as many differences of times.
const SHARED_FREEDOM: f64 = 24.0;

/// The same, if all values share an error of a known variance beside their own spread; by Student's t with the degrees of freedom of a sum
/// of variances (Welch and Satterthwaite).
fn mean_with_shared_error(values: &[f64], variance: f64) -> Interval {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
    let own = squares / (n - 1.0) / n;
    let freedom = if variance > 0.0 {
        (own + variance).powi(2) / (own.powi(2) / (n - 1.0) + variance.powi(2) / SHARED_FREEDOM)
    } else {
        n - 1.0
    };
    let half = StudentsT::new(0.0, 1.0, freedom)
        .map_or(f64::NAN, |t| t.inverse_cdf(0.5 + 0.5 * CONFIDENCE) * (own + variance).sqrt());
    Interval { mean, low: mean - half, high: mean + half }
}

/// Geometric mean of positive values, such as ratios, and its 95 % confidence interval.
pub fn geometric_mean(values: &[f64]) -> Interval {
    geometric_mean_with_shared_error(values, 0.0)
}

/// The same, if the logarithms of all values share an error of a known variance.
pub fn geometric_mean_with_shared_error(values: &[f64], variance: f64) -> Interval {
    let logarithms: Vec<f64> = values.iter().map(|v| v.ln()).collect();
    let Interval { mean, low, high } = mean_with_shared_error(&logarithms, variance);
    Interval { mean: mean.exp(), low: low.exp(), high: high.exp() }
}

/// Ratio of the mean of values v to that of their bases b, and its 95 % interval by Student's t. The delta method gives the interval of the
/// logarithm, from the spread of v ∕ ⟨v⟩ − b ∕ ⟨b⟩ over the pairs (v, b), so that what both share counts. NaN unless both means are positive; single
/// values may be negative, as errors without bias may.
pub fn ratio_of_means(pairs: &[(f64, f64)]) -> Interval {
    let n = pairs.len() as f64;
    let [values, bases] =
        [pairs.iter().map(|p| p.0).sum::<f64>() / n, pairs.iter().map(|p| p.1).sum::<f64>() / n];
    let ratio = if values > 0.0 && bases > 0.0 { values / bases } else { f64::NAN };
    let differences: Vec<f64> = pairs.iter().map(|(value, base)| value / values - base / bases).collect();
    let Interval { low, high, .. } = mean(&differences);
    Interval { mean: ratio, low: ratio * low.exp(), high: ratio * high.exp() }
}

/// Unbiased variance of the values of several groups around the groups' own means; 0 if no group has two values.
pub fn variance_within(groups: &[Vec<f64>]) -> f64 {
    let squares = |group: &Vec<f64>| {
        let mean = group.iter().sum::<f64>() / group.len() as f64;
        group.iter().map(|v| (v - mean).powi(2)).sum::<f64>()
    };
    let freedom = groups.iter().map(|group| group.len().saturating_sub(1)).sum::<usize>();
    groups.iter().map(squares).sum::<f64>() / freedom.max(1) as f64
}

/// Spearman's rank correlation. NaN if one side is constant.
pub fn rank_correlation(a: &[f64], b: &[f64]) -> f64 {
    let [a, b] = [a, b].map(ranks);
    let middle = (a.len() as f64 - 1.0) / 2.0;
    let covariance =
        |x: &[f64], y: &[f64]| -> f64 { x.iter().zip(y).map(|(x, y)| (x - middle) * (y - middle)).sum() };
    covariance(&a, &b) / (covariance(&a, &a) * covariance(&b, &b)).sqrt()
}

/// Ranks from 0. Equal values get the mean of their ranks.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&i, &j| values[i].total_cmp(&values[j]));
    let mut ranks = vec![0.0; values.len()];
    let mut first = 0;
    for equal in order.chunk_by(|&i, &j| values[i] == values[j]) {
        let rank = first as f64 + (equal.len() as f64 - 1.0) / 2.0;
        equal.iter().for_each(|&i| ranks[i] = rank);
        first += equal.len();
    }
    ranks
}

/// Whether each point is on the Pareto front: no other point is at most as large in both coordinates and smaller
/// in one.
pub fn pareto_front(points: &[(f64, f64)]) -> Vec<bool> {
    let dominates = |a: &(f64, f64), b: &(f64, f64)| a.0 <= b.0 && a.1 <= b.1 && a != b;
    points.iter().map(|point| !points.iter().any(|other| dominates(other, point))).collect()
}

/// Interpolates a curve of positive values at `x`, linearly in the logarithms of both coordinates. Extrapolates
/// the first or last segment beyond the points; a single point is a constant. `points` are one or more, ascending
/// in x.
pub fn interpolate_log_log(points: &[(f64, f64)], x: f64) -> f64 {
    if let [(_, y)] = points {
        return *y;
    }
    let next = points.iter().position(|p| p.0 >= x).unwrap_or(points.len()).clamp(1, points.len() - 1);
    let [(x0, y0), (x1, y1)] = [points[next - 1], points[next]].map(|(x, y)| (x.ln(), y.ln()));
    (y0 + (y1 - y0) * (x.ln() - x0) / (x1 - x0)).exp()
}

/// Returns the slope of the same curve at `x`, in logarithms.
pub fn slope_log_log(points: &[(f64, f64)], x: f64) -> f64 {
    const STEP: f64 = 1.001;
    let [before, after] = [x / STEP, x * STEP].map(|x| interpolate_log_log(points, x));
    (after / before).ln() / (2.0 * STEP.ln())
}

/// Where a falling curve crosses a value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Crossing {
    /// Before the first point, which is below the value.
    Before(f64),
    At(f64),
    /// Beyond the last point, which is above the value: where the extrapolated last segment crosses it.
    Beyond(f64),
}

/// Finds where a curve crosses `value`. `points` are ascending in x. `None` for fewer than two points, or if the
/// last segment would have to be extrapolated and does not fall.
pub fn crossing(points: &[(f64, f64)], value: f64) -> Option<Crossing> {
    let (first, last) = (points.first()?, points.last()?);
    if first.1 <= value {
        return Some(Crossing::Before(first.0));
    }
    let between = |[a, b]: [(f64, f64); 2]| interpolate_log_log(&[(b.1, b.0), (a.1, a.0)], value);
    if last.1 > value {
        let [.., a, b] = points else { return None };
        return (b.1 < a.1).then(|| Crossing::Beyond(between([*a, *b])));
    }
    let segment = points.windows(2).find(|pair| pair[0].1 > value && pair[1].1 <= value)?;
    Some(Crossing::At(between([segment[0], segment[1]])))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_are_those_of_students_t() {
        let Interval { mean, low, high } = mean(&[1.0, 2.0, 3.0, 4.0, 5.0]);
        // t(0.975; 4) = 2.776445, s = 1.581139.
        assert_eq!(mean, 3.0);
        assert!((high - 3.0 - 2.776_445 * 1.581_139 / 5_f64.sqrt()).abs() < 1e-4, "{high}");
        assert!((low + high - 6.0).abs() < 1e-12);
        assert!(super::mean(&[1.0]).high.is_nan());
        // An error of variance 0.6² beside one of 0.8² is one of 1, with 2.41 degrees of freedom
        let own = geometric_mean_with_shared_error(&[1.0, 1.6_f64.exp()], 0.36);
        assert!((own.high.ln() - 0.8 - 3.672_41).abs() < 1e-3, "{}", own.high.ln());
    }

    #[test]
    fn variances_are_those_within_groups() {
        assert_eq!(variance_within(&[vec![1.0, 3.0], vec![11.0, 13.0], vec![7.0]]), 2.0);
        assert_eq!(variance_within(&[vec![1.0], vec![]]), 0.0);
    }

    #[test]
    fn ratios_that_undo_each_other_have_mean_one() {
        let ratio = geometric_mean(&[0.5, 2.0, 1.0]);
        assert!((ratio.mean - 1.0).abs() < 1e-12);
        assert!((ratio.low * ratio.high - 1.0).abs() < 1e-9 && ratio.low < 0.5);
    }

    #[test]
    fn a_ratio_of_means_is_that_of_the_sums_with_an_interval_by_the_pairs() {
        let ratio = ratio_of_means(&[(2.0, 1.0), (6.0, 3.0)]);
        assert!((ratio.mean - 2.0).abs() < 1e-12 && (ratio.high - ratio.low).abs() < 1e-9, "{ratio:?}");
        // 2 ∕ 3 − ½ and 4 ∕ 3 − 3 ∕ 2: ± ⅙, a standard error of ⅙, and t(0.975; 1) = 12.7062
        let ratio = ratio_of_means(&[(2.0, 1.0), (4.0, 3.0)]);
        assert!((ratio.mean - 1.5).abs() < 1e-12, "{ratio:?}");
        assert!(((ratio.high / 1.5).ln() - 12.706_2 / 6.0).abs() < 1e-3, "{ratio:?}");
        // One error below 0 does not spoil the mean, and a mean below 0 has no ratio
        assert!((ratio_of_means(&[(-1.0, 1.0), (2.0, 1.0)]).mean - 0.5).abs() < 1e-12);
        assert!(ratio_of_means(&[(-1.0, 1.0), (0.5, 1.0)]).mean.is_nan());
        assert!(ratio_of_means(&[(2.0, 1.0)]).high.is_nan());
    }

    #[test]
    fn ranks_correlate_whatever_the_scale_and_with_ties() {
        assert!((rank_correlation(&[1.0, 2.0, 3.0], &[1.0, 10.0, 1000.0]) - 1.0).abs() < 1e-12);
        assert!((rank_correlation(&[1.0, 2.0, 3.0], &[9.0, 4.0, 1.0]) + 1.0).abs() < 1e-12);
        // Ranks 0, 1.5, 1.5, 3 against 0, 1, 2, 3.
        let expected = 4.5 / (4.5_f64 * 5.0).sqrt();
        assert!((rank_correlation(&[0.0, 1.0, 1.0, 2.0], &[0.0, 1.0, 2.0, 3.0]) - expected).abs() < 1e-12);
        assert!(rank_correlation(&[1.0, 1.0], &[1.0, 2.0]).is_nan());
    }

    #[test]
    fn the_front_holds_the_points_that_no_other_dominates() {
        let points = [(1.0, 5.0), (2.0, 3.0), (3.0, 3.0), (4.0, 1.0), (2.0, 6.0)];
        assert_eq!(pareto_front(&points), [true, true, false, true, false]);
        assert_eq!(
            pareto_front(&[(1.0, 1.0), (1.0, 1.0)]),
            [true, true],
            "equal points do not dominate each other"
        );
    }

    #[test]
    fn curves_are_interpolated_in_logarithms() {
        let curve = [(1.0, 1.0), (10.0, 0.1), (100.0, 0.05)];
        assert!((interpolate_log_log(&curve, 10_f64.sqrt()) - 0.1_f64.sqrt()).abs() < 1e-12);
        assert!((interpolate_log_log(&curve, 1000.0) - 0.025).abs() < 1e-12);
        assert!((interpolate_log_log(&curve, 0.1) - 10.0).abs() < 1e-9);
        assert_eq!(interpolate_log_log(&curve[..1], 7.0), 1.0);
        assert!((slope_log_log(&curve, 3.0) + 1.0).abs() < 1e-9 && slope_log_log(&curve[..1], 3.0) == 0.0);
    }

    #[test]
    fn a_curve_crosses_a_value_before_within_or_beyond_its_points() {
        let curve = [(1.0, 1.0), (10.0, 0.1)];
        let at = |value| match crossing(&curve, value).unwrap() {
            Crossing::Before(x) => ("before", x),
            Crossing::At(x) => ("at", x),
            Crossing::Beyond(x) => ("beyond", x),
        };
        for (value, place, x) in [(2.0, "before", 1.0), (0.2, "at", 5.0), (0.01, "beyond", 100.0)] {
            let found = at(value);
            assert_eq!(found.0, place);
            assert!((found.1 - x).abs() < 1e-9, "{found:?}");
        }
        assert_eq!(crossing(&[(1.0, 1.0), (2.0, 1.5)], 0.5), None);
    }
}
