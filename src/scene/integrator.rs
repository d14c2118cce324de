//! The integrator that a scene requests.

/// Largest `max_depth` of an integrator. Deeper paths carry no visible light.
pub const MAX_DEPTH: u32 = 1 << 20;

/// The light transport algorithm that the scene requests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Integrator {
    /// Path tracing with up to `max_depth` scattering events (pbrt's `path`, `volpath`).
    Path { max_depth: u32 },
    /// Direct lighting, seen directly or through chains of at most `max_depth` perfectly specular
    /// scattering events (pbrt-v2's `directlighting`).
    Direct { max_depth: u32 },
}

impl Integrator {
    /// The largest number of scattering events of a path.
    pub fn max_depth(self) -> u32 {
        match self {
            Integrator::Path { max_depth } | Integrator::Direct { max_depth } => max_depth,
        }
    }

    /// The same algorithm with paths of up to `max_depth` scattering events.
    pub fn with_max_depth(self, max_depth: u32) -> Self {
        match self {
            Integrator::Path { .. } => Integrator::Path { max_depth },
            Integrator::Direct { .. } => Integrator::Direct { max_depth },
        }
    }
}
