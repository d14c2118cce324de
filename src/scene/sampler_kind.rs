//! The sampler that a scene requests.

/// The source of sample values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SamplerKind {
    /// Owen-scrambled Sobol' points by which neighbouring pixels complement each other, the default; also used for pbrt's
    /// `zsobol`, `paddedsobol`, `halton`, `stratified`, `pmj02bn`, `lowdiscrepancy`.
    Sobol,
    /// Independent uniform random numbers (pbrt's `independent`, v2's `random`).
    Independent,
}
