//! Choice among many in constant time, with given probabilities: the alias method (Walker 1977;
//! built as by Vose 1991).

/// A discrete distribution.
#[derive(Clone, Debug)]
pub struct AliasTable {
    bins: Vec<Bin>,
}

#[derive(Clone, Copy, Debug)]
struct Bin {
    /// Probability of this index.
    probability: f32,
    /// Share of the bin that stays with its own index.
    keep: f32,
    /// Index that the rest of the bin goes to.
    alias: u32,
}

impl AliasTable {
    /// Probabilities in proportion to `weights`; those that are not positive and finite count as 0.
    pub fn new(weights: &[f64]) -> Self {
        let weight = |w: &f64| if w.is_finite() { w.max(0.0) } else { 0.0 };
        let total: f64 = weights.iter().map(weight).sum();
        if total <= 0.0 {
            return Self { bins: Vec::new() };
        }
        let n = weights.len() as f64;
        let probabilities: Vec<f64> = weights.iter().map(|w| weight(w) / total).collect();
        let mut bins: Vec<Bin> = (0..)
            .zip(&probabilities)
            .map(|(i, &p)| Bin { probability: p as f32, keep: 1.0, alias: i })
            .collect();
        // Bins that are not full are filled up from those that overflow.
        let mut fill: Vec<f64> = probabilities.iter().map(|p| p * n).collect();
        let (mut under, mut over): (Vec<usize>, Vec<usize>) = (0..fill.len()).partition(|&i| fill[i] < 1.0);
        while let (Some(&small), Some(&large)) = (under.last(), over.last()) {
            under.pop();
            bins[small].keep = fill[small] as f32;
            bins[small].alias = large as u32;
            fill[large] -= 1.0 - fill[small];
            if fill[large] < 1.0 {
                over.pop();
                under.push(large);
            }
        }
        // What rounding leaves over in `under` is full but for rounding; a bin of probability 0
        // must not be chosen even then.
        for i in under {
            if probabilities[i] == 0.0 {
                bins[i].keep = 0.0;
                bins[i].alias = largest(&probabilities);
            }
        }
        Self { bins }
    }

    /// An index for a number in [0, 1), with its probability; `None` if all weights are 0.
    #[inline]
    pub fn sample(&self, u: f32) -> Option<(usize, f32)> {
        let position = u * self.bins.len() as f32;
        let i = (position as usize).min(self.bins.len().checked_sub(1)?);
        let bin = self.bins[i];
        let i = if position - (i as f32) < bin.keep { i } else { bin.alias as usize };
        Some((i, self.bins[i].probability))
    }

    /// Probability of an index.
    #[inline]
    pub fn probability(&self, index: usize) -> f32 {
        self.bins.get(index).map_or(0.0, |bin| bin.probability)
    }
}

fn largest(probabilities: &[f64]) -> u32 {
    let best = probabilities.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1));
    best.map_or(0, |(i, _)| i as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(weights: &[f64]) {
        let table = AliasTable::new(weights);
        let total: f64 = weights.iter().sum();
        let n = 1_000_000;
        let mut counts = vec![0.0; weights.len()];
        for i in 0..n {
            let (chosen, probability) = table.sample((i as f32 + 0.5) / n as f32).unwrap();
            assert_eq!(probability, table.probability(chosen));
            counts[chosen] += 1.0 / f64::from(n);
        }
        for (i, (count, weight)) in counts.iter().zip(weights).enumerate() {
            assert!((count - weight / total).abs() < 1e-5, "{i}: {count}");
            assert!((f64::from(table.probability(i)) - weight / total).abs() < 1e-7);
            assert!(*weight > 0.0 || *count == 0.0);
        }
    }

    #[test]
    fn indices_are_chosen_in_proportion_to_their_weights() {
        check(&[1.0]);
        check(&[1.0, 3.0]);
        check(&[0.0, 1e-3, 5.0, 0.0, 2.0, 1e3, 7.0]);
        check(&[0.1; 10]);
        check(&(0..97).map(|i| f64::from(i * i % 13)).collect::<Vec<_>>());
    }

    #[test]
    fn nothing_is_chosen_where_all_weights_are_zero() {
        assert_eq!(AliasTable::new(&[]).sample(0.5), None);
        assert_eq!(AliasTable::new(&[0.0, f64::NAN, -1.0]).sample(0.5), None);
        assert_eq!(AliasTable::new(&[0.0]).probability(0), 0.0);
    }
}
