//! Angles stored as cosine and sine, with a difference that needs no inverse trigonometric function
//! (pbrt-v4's `CosSubClamped` and `SinSubClamped`).

/// An angle in [0, π] by its cosine and sine.
#[derive(Clone, Copy, Debug)]
pub struct Angle {
    pub cos: f32,
    pub sin: f32,
}

impl Angle {
    pub const ZERO: Self = Self { cos: 1.0, sin: 0.0 };

    #[inline(always)]
    pub fn from_cos(cos: f32) -> Self {
        Self { cos, sin: (1.0 - cos * cos).max(0.0).sqrt() }
    }

    /// The difference, clamped to 0 from below.
    #[inline(always)]
    pub fn minus(self, other: Self) -> Self {
        let cos = self.cos * other.cos + self.sin * other.sin;
        let sin = self.sin * other.cos - self.cos * other.sin;
        if self.cos >= other.cos { Self::ZERO } else { Self { cos, sin } }
    }
}
