use super::sampler::SET_SIZE;
use super::*;
use crate::simd::LANES;

/// Returns one sample value, computed in some lane.
pub(super) fn value<S: Sampler>(sampler: &S, index: u32, dimension: u32) -> f32 {
    let (mut addresses, mut values) = (SampleAddresses::NONE, [[0.0; LANES]; SET_SIZE as usize]);
    let lane = (index + dimension) as usize % LANES;
    addresses.set(lane, sampler.address(index));
    S::values(&addresses, &[dimension / SET_SIZE; LANES], &mut values);
    values[(dimension % SET_SIZE) as usize][lane]
}

fn all<S: Sampler>(seed: u64, index: u32) -> Vec<f32> {
    let sampler = S::for_pixel(seed, 3, 5);
    (0..40).map(|d| value(&sampler, index, d)).collect()
}

#[test]
fn the_same_address_gives_the_same_value() {
    assert_eq!(all::<Sobol>(1, 9), all::<Sobol>(1, 9));
    assert_eq!(all::<Independent>(1, 9), all::<Independent>(1, 9));
}

#[test]
fn another_seed_or_index_gives_other_values() {
    assert!(all::<Sobol>(1, 9).iter().zip(all::<Sobol>(2, 9)).all(|(a, b)| *a != b));
    assert!(all::<Independent>(1, 9).iter().zip(all::<Independent>(1, 10)).all(|(a, b)| *a != b));
}

#[test]
fn values_lie_in_the_unit_interval_and_have_its_moments() {
    fn check<S: Sampler>() {
        let sampler = S::for_pixel(7, 0, 0);
        let n = 4096;
        for dimension in [0, 1, 17, 1000] {
            let values: Vec<f64> = (0..n).map(|i| f64::from(value(&sampler, i, dimension))).collect();
            assert!(values.iter().all(|v| (0.0..1.0).contains(v)));
            let mean = values.iter().sum::<f64>() / f64::from(n);
            let square = values.iter().map(|v| v * v).sum::<f64>() / f64::from(n);
            // Five standard errors of independent values.
            assert!((mean - 0.5).abs() < 5.0 * (1.0 / 12.0 / f64::from(n)).sqrt());
            assert!((square - 1.0 / 3.0).abs() < 5.0 * (4.0 / 45.0 / f64::from(n)).sqrt());
        }
    }
    check::<Sobol>();
    check::<Independent>();
}
