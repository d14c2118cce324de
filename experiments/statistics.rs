//! What measurements of several seeds and scenes say: means with their uncertainty, ranks, fronts, and
//! where a curve passes a value.

use statrs::distribution::{ContinuousCDF, StudentsT};

/// Probability that an interval holds the mean.
const CONFIDENCE: f64 = 0.95;

/// A mean, and how far the true one may be from it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    pub mean: f64,
    pub low: f64,
    pub high: f64,
}

/// Mean with its 95 % interval by Student's t; the interval of a single value is unknown (NaN).
pub fn mean(values: &[f64]) -> Interval {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
    let half = StudentsT::new(0.0, 1.0, n - 1.0)
        .map_or(f64::NAN, |t| t.inverse_cdf(0.5 + 0.5 * CONFIDENCE) * (squares / (n - 1.0) / n).sqrt());
    Interval { mean, low: mean - half, high: mean + half }
}

/// The same of positive values on a logarithmic scale: for ratios.
pub fn geometric_mean(values: &[f64]) -> Interval {
    let logarithms: Vec<f64> = values.iter().map(|v| v.ln()).collect();
    let Interval { mean, low, high } = mean(&logarithms);
    Interval { mean: mean.exp(), low: low.exp(), high: high.exp() }
}

/// Spearman's rank correlation; NaN where one side does not vary.
pub fn rank_correlation(a: &[f64], b: &[f64]) -> f64 {
    let [a, b] = [a, b].map(ranks);
    let middle = (a.len() as f64 - 1.0) / 2.0;
    let covariance =
        |x: &[f64], y: &[f64]| -> f64 { x.iter().zip(y).map(|(x, y)| (x - middle) * (y - middle)).sum() };
    covariance(&a, &b) / (covariance(&a, &a) * covariance(&b, &b)).sqrt()
}

/// From 0; equal values share the mean of their ranks.
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

/// Which points have no other that is at most as large in both coordinates and smaller in one.
pub fn pareto_front(points: &[(f64, f64)]) -> Vec<bool> {
    let beats = |a: &(f64, f64), b: &(f64, f64)| a.0 <= b.0 && a.1 <= b.1 && a != b;
    points.iter().map(|point| !points.iter().any(|other| beats(other, point))).collect()
}

/// A curve of positive numbers at `x`, straight between its points where both axes are logarithmic, and
/// beyond them as its two nearest points say; a single point is the same everywhere. `points` in the order of x,
/// at least one.
pub fn on_curve(points: &[(f64, f64)], x: f64) -> f64 {
    if let [(_, y)] = points {
        return *y;
    }
    let next = points.iter().position(|p| p.0 >= x).unwrap_or(points.len()).clamp(1, points.len() - 1);
    let [(x0, y0), (x1, y1)] = [points[next - 1], points[next]].map(|(x, y)| (x.ln(), y.ln()));
    (y0 + (y1 - y0) * (x.ln() - x0) / (x1 - x0)).exp()
}

/// Where a falling curve passes a value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Passes {
    /// Its first point is below already.
    Before(f64),
    At(f64),
    /// Its last point is above still; the curve's last piece, drawn on, passes there.
    Beyond(f64),
}

/// `points` in the order of x; `None` of fewer than two, or where the last piece does not fall.
pub fn passes(points: &[(f64, f64)], value: f64) -> Option<Passes> {
    let (first, last) = (points.first()?, points.last()?);
    if first.1 <= value {
        return Some(Passes::Before(first.0));
    }
    let between = |[a, b]: [(f64, f64); 2]| on_curve(&[(b.1, b.0), (a.1, a.0)], value);
    if last.1 > value {
        let [.., a, b] = points else { return None };
        return (b.1 < a.1).then(|| Passes::Beyond(between([*a, *b])));
    }
    let piece = points.windows(2).find(|pair| pair[0].1 > value && pair[1].1 <= value)?;
    Some(Passes::At(between([piece[0], piece[1]])))
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
    }

    #[test]
    fn ratios_that_undo_each_other_have_mean_one() {
        let ratio = geometric_mean(&[0.5, 2.0, 1.0]);
        assert!((ratio.mean - 1.0).abs() < 1e-12);
        assert!((ratio.low * ratio.high - 1.0).abs() < 1e-9 && ratio.low < 0.5);
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
    fn the_front_is_what_nothing_beats_in_both() {
        let points = [(1.0, 5.0), (2.0, 3.0), (3.0, 3.0), (4.0, 1.0), (2.0, 6.0)];
        assert_eq!(pareto_front(&points), [true, true, false, true, false]);
        assert_eq!(pareto_front(&[(1.0, 1.0), (1.0, 1.0)]), [true, true], "equals do not beat each other");
    }

    #[test]
    fn curves_are_straight_between_logarithms() {
        let curve = [(1.0, 1.0), (10.0, 0.1), (100.0, 0.05)];
        assert!((on_curve(&curve, 10_f64.sqrt()) - 0.1_f64.sqrt()).abs() < 1e-12);
        assert!((on_curve(&curve, 1000.0) - 0.025).abs() < 1e-12);
        assert!((on_curve(&curve, 0.1) - 10.0).abs() < 1e-9);
        assert_eq!(on_curve(&curve[..1], 7.0), 1.0);
    }

    #[test]
    fn a_curve_passes_a_value_before_within_or_beyond_its_points() {
        let curve = [(1.0, 1.0), (10.0, 0.1)];
        let at = |value| match passes(&curve, value).unwrap() {
            Passes::Before(x) => ("before", x),
            Passes::At(x) => ("at", x),
            Passes::Beyond(x) => ("beyond", x),
        };
        for (value, place, x) in [(2.0, "before", 1.0), (0.2, "at", 5.0), (0.01, "beyond", 100.0)] {
            let found = at(value);
            assert_eq!(found.0, place);
            assert!((found.1 - x).abs() < 1e-9, "{found:?}");
        }
        assert_eq!(passes(&[(1.0, 1.0), (2.0, 1.5)], 0.5), None);
    }
}
