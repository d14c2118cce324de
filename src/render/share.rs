//! A share of the sample sequence of every pixel, so that several programs can render one image.
//!
//! Samples are dealt out by pairs, as even and odd indices are the two halves of a pixel's samples: the
//! K-th of N shares has the pairs K−1, K−1+N, … . All shares together are the whole sequence.

/// The `index`-th (from 0) of `of` shares.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(try_from = "Unchecked")]
pub struct Share {
    index: u32,
    of: u32,
}

/// A share as a file has it, which may be none: the first of no shares.
#[derive(serde::Deserialize)]
struct Unchecked {
    index: u32,
    of: u32,
}

impl TryFrom<Unchecked> for Share {
    type Error = String;

    fn try_from(Unchecked { index, of }: Unchecked) -> Result<Self, String> {
        if index < of {
            Ok(Self { index, of })
        } else {
            Err(format!("share {index} of {of}, counted from 0"))
        }
    }
}

impl Share {
    /// All samples.
    pub const WHOLE: Self = Self { index: 0, of: 1 };

    /// The `k`-th of `n` shares, counted from 1; `None` if there is no such share.
    pub fn new(k: u32, n: u32) -> Option<Self> {
        (1..=n).contains(&k).then(|| Self { index: k - 1, of: n })
    }

    /// How many shares there are.
    pub fn of(self) -> u32 {
        self.of
    }

    /// Index in the whole sequence of this share's sample with this index.
    #[inline]
    pub fn in_sequence(self, index: u32) -> u32 {
        // Beyond 2³² samples of a pixel the sequence starts again.
        (index >> 1).wrapping_mul(self.of).wrapping_add(self.index) << 1 | (index & 1)
    }

    /// How many of the first `samples` of the sequence are this share's.
    pub fn of_first(self, samples: u32) -> u32 {
        let pairs = samples / 2;
        let own = (u64::from(pairs) + u64::from(self.of - 1 - self.index)) / u64::from(self.of);
        let odd = samples % 2 == 1 && pairs % self.of == self.index;
        own as u32 * 2 + u32::from(odd)
    }

    /// Whether some samples are in both shares.
    pub fn overlaps(self, other: Self) -> bool {
        // k + iN = l + jM has a solution if and only if gcd(N, M) divides k − l.
        let (mut a, mut b) = (self.of, other.of);
        while b > 0 {
            (a, b) = (b, a % b);
        }
        self.index % a == other.index % a
    }

    /// Whether these are all shares of a whole, each once.
    pub fn are_whole(shares: &[Self]) -> bool {
        let mut indices: Vec<u32> = shares.iter().map(|share| share.index).collect();
        indices.sort_unstable();
        indices.iter().copied().eq(0..shares.len() as u32)
            && shares.iter().all(|share| share.of as usize == shares.len())
    }
}

impl std::fmt::Display for Share {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(f, "{}/{}", self.index + 1, self.of)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_disjoint_and_make_up_the_sequence() {
        for (n, samples) in [(1, 7), (2, 16), (3, 17), (4, 64), (5, 3)] {
            let mut all: Vec<u32> = Vec::new();
            for k in 1..=n {
                let share = Share::new(k, n).unwrap();
                all.extend((0..share.of_first(samples)).map(|i| share.in_sequence(i)));
            }
            all.sort_unstable();
            assert_eq!(all, (0..samples).collect::<Vec<_>>(), "{n} {samples}");
        }
        assert_eq!(
            (0..9).map(|i| Share::WHOLE.in_sequence(i)).collect::<Vec<_>>(),
            (0..9).collect::<Vec<_>>()
        );
        assert!(Share::new(0, 2).is_none() && Share::new(3, 2).is_none());
    }

    #[test]
    fn a_share_in_a_file_is_one_that_there_is() {
        let read = |text| serde_json::from_str::<Share>(text).ok();
        assert_eq!(read(r#"{"index":1,"of":2}"#), Share::new(2, 2));
        for text in [r#"{"index":0,"of":0}"#, r#"{"index":2,"of":2}"#, r#"{"index":4294967295,"of":3}"#] {
            assert_eq!(read(text), None, "{text}");
        }
    }

    #[test]
    fn overlaps_are_those_of_the_samples() {
        let shares: Vec<Share> =
            (1..=6).flat_map(|n| (1..=n).filter_map(move |k| Share::new(k, n))).collect();
        for (&a, &b) in shares.iter().flat_map(|a| shares.iter().map(move |b| (a, b))) {
            let samples = |share: Share| {
                (0..120).map(|i| share.in_sequence(i)).filter(|&i| i < 120).collect::<Vec<_>>()
            };
            let (in_a, in_b) = (samples(a), samples(b));
            assert_eq!(a.overlaps(b), in_a.iter().any(|i| in_b.contains(i)), "{a} {b}");
        }
    }

    #[test]
    fn a_whole_has_each_share_once() {
        let share = |k, n| Share::new(k, n).unwrap();
        assert!(Share::are_whole(&[share(2, 2), share(1, 2)]) && Share::are_whole(&[Share::WHOLE]));
        assert!(!Share::are_whole(&[share(1, 2), share(1, 2)]) && !Share::are_whole(&[share(1, 2)]));
        assert!(!Share::are_whole(&[share(1, 2), share(2, 3)]));
    }
}
