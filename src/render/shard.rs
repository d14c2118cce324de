//! Divides the sample sequence of every pixel into shards, so that several machines can render one image.
//!
//! Samples are distributed by pairs, because even and odd indices are the two halves of a pixel's samples: the K-th of
//! N shards has the pairs K−1, K−1+N, … . All shards together are the whole sequence.

/// The `index`-th (from 0) of `count` shards.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(try_from = "Unchecked")]
pub struct Shard {
    index: u32,
    count: u32,
}

/// A shard as a file states it, which may not exist: the first of no shards.
#[derive(serde::Deserialize)]
struct Unchecked {
    index: u32,
    count: u32,
}

impl TryFrom<Unchecked> for Shard {
    type Error = String;

    fn try_from(Unchecked { index, count }: Unchecked) -> Result<Self, String> {
        let shard = index.checked_add(1).and_then(|k| Self::new(k, count));
        shard.ok_or_else(|| format!("shard {index} of {count}, counted from 0"))
    }
}

impl Shard {
    /// All samples.
    pub const WHOLE: Self = Self { index: 0, count: 1 };

    /// Most shards: of the 2³¹ pairs after which the sequence repeats, each has 32,768 then.
    pub const MOST: u32 = 1 << 16;

    /// Returns the `k`-th of `n` shards, counted from 1; `None` if there is no such shard, or more than [`Self::MOST`].
    pub fn new(k: u32, n: u32) -> Option<Self> {
        (n <= Self::MOST && (1..=n).contains(&k)).then(|| Self { index: k - 1, count: n })
    }

    /// Returns the number of shards.
    pub fn count(self) -> u32 {
        self.count
    }

    /// Returns the index in the whole sequence of this shard's `index`-th sample.
    #[inline]
    pub fn sequence_index(self, index: u32) -> u32 {
        // After 2³² samples of a pixel the sequence repeats.
        (index >> 1).wrapping_mul(self.count).wrapping_add(self.index) << 1 | (index & 1)
    }

    /// Returns how many of the first `samples` of the sequence belong to this shard.
    pub fn samples_among(self, samples: u32) -> u32 {
        let pairs = samples / 2;
        let own = (u64::from(pairs) + u64::from(self.count - 1 - self.index)) / u64::from(self.count);
        let odd = samples % 2 == 1 && pairs % self.count == self.index;
        own as u32 * 2 + u32::from(odd)
    }

    /// Tests whether some samples are in both shards.
    pub fn overlaps(self, other: Self) -> bool {
        // k + iN = l + jM has a solution if and only if gcd(N, M) divides k − l.
        let (mut a, mut b) = (self.count, other.count);
        while b > 0 {
            (a, b) = (b, a % b);
        }
        self.index % a == other.index % a
    }

    /// Returns the shards that are missing beside these; none if these do not have the same number of shards.
    pub fn missing(shards: &[Self]) -> Vec<Self> {
        let Some(&Self { count, .. }) = shards.first() else { return Vec::new() };
        if shards.iter().any(|shard| shard.count != count) {
            return Vec::new();
        }
        let mut is_there = vec![false; count as usize];
        shards.iter().for_each(|shard| is_there[shard.index as usize] = true);
        (0..count).filter(|&index| !is_there[index as usize]).map(|index| Self { index, count }).collect()
    }

    /// Tests whether these are all shards of a sequence, each once.
    pub fn are_complete(shards: &[Self]) -> bool {
        let mut indices: Vec<u32> = shards.iter().map(|shard| shard.index).collect();
        indices.sort_unstable();
        indices.iter().copied().eq(0..shards.len() as u32)
            && shards.iter().all(|shard| shard.count as usize == shards.len())
    }
}

impl std::fmt::Display for Shard {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(f, "{}/{}", self.index + 1, self.count)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    #[test]
    fn shards_are_disjoint_and_make_up_the_sequence() {
        for (n, samples) in [(1, 7), (2, 16), (3, 17), (4, 64), (5, 3)] {
            let mut all: Vec<u32> = Vec::new();
            for k in 1..=n {
                let shard = Shard::new(k, n).unwrap();
                all.extend((0..shard.samples_among(samples)).map(|i| shard.sequence_index(i)));
            }
            all.sort_unstable();
            assert_eq!(all, (0..samples).collect::<Vec<_>>(), "{n} {samples}");
        }
        assert_eq!(
            (0..9).map(|i| Shard::WHOLE.sequence_index(i)).collect::<Vec<_>>(),
            (0..9).collect::<Vec<_>>()
        );
        assert!(Shard::new(0, 2).is_none() && Shard::new(3, 2).is_none());
    }

    #[test]
    fn a_shard_that_does_not_exist_is_refused() {
        let read = |text| serde_json::from_str::<Shard>(text).ok();
        assert_eq!(read(r#"{"index":1,"count":2}"#), Shard::new(2, 2));
        for text in [
            r#"{"index":0,"count":0}"#,
            r#"{"index":2,"count":2}"#,
            r#"{"index":4294967295,"count":3}"#,
            r#"{"index":0,"count":2147483648}"#,
        ] {
            assert_eq!(read(text), None, "{text}");
        }
    }

    #[test]
    fn samples_of_the_most_shards_differ() {
        let last = Shard::new(Shard::MOST, Shard::MOST).unwrap();
        let pairs: HashSet<u32> = (0..1 << 15).map(|pair| last.sequence_index(2 * pair)).collect();
        assert_eq!(pairs.len(), 1 << 15);
        assert_eq!(Shard::new(1, Shard::MOST + 1), None);
    }

    #[test]
    fn overlaps_are_those_of_the_samples() {
        let shards: Vec<Shard> =
            (1..=6).flat_map(|n| (1..=n).filter_map(move |k| Shard::new(k, n))).collect();
        for (&a, &b) in shards.iter().flat_map(|a| shards.iter().map(move |b| (a, b))) {
            let samples = |shard: Shard| {
                (0..120).map(|i| shard.sequence_index(i)).filter(|&i| i < 120).collect::<Vec<_>>()
            };
            let (in_a, in_b) = (samples(a), samples(b));
            assert_eq!(a.overlaps(b), in_a.iter().any(|i| in_b.contains(i)), "{a} {b}");
        }
    }

    #[test]
    fn missing_shards_are_those_of_one_division() {
        let shard = |k, n| Shard::new(k, n).unwrap();
        assert_eq!(Shard::missing(&[shard(3, 3), shard(1, 3)]), [shard(2, 3)]);
        assert!(Shard::missing(&[shard(2, 2), shard(1, 2)]).is_empty());
        assert!(Shard::missing(&[shard(1, 2), shard(2, 3)]).is_empty());
        assert!(Shard::missing(&[Shard::WHOLE]).is_empty() && Shard::missing(&[]).is_empty());
    }

    #[test]
    fn a_whole_has_each_shard_once() {
        let shard = |k, n| Shard::new(k, n).unwrap();
        assert!(Shard::are_complete(&[shard(2, 2), shard(1, 2)]) && Shard::are_complete(&[Shard::WHOLE]));
        assert!(!Shard::are_complete(&[shard(1, 2), shard(1, 2)]) && !Shard::are_complete(&[shard(1, 2)]));
        assert!(!Shard::are_complete(&[shard(1, 2), shard(2, 3)]));
    }
}
