//! The events of one path, for people who debug a sample.

use std::fmt;

use glam::Vec3;

/// An event of a path. Positions are in render space, radiance is linear RGB.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PathEvent {
    /// A ray begins, after `depth` scattering events.
    Ray { depth: u32, origin: Vec3, direction: Vec3 },
    /// The ray leaves the scene.
    Miss,
    /// The ray hits a surface at this distance.
    Hit { distance: f32, position: Vec3, normal: Vec3, primitive: u32, material: u32 },
    /// Emission reaches the ray's origin; what it adds to the path's radiance is the product of all three.
    Emission { emitted: Vec3, mis_weight: f32, throughput: Vec3 },
    /// The surface has no BSDF: the path goes straight on.
    Interface,
    /// The path has its greatest depth.
    GreatestDepth,
    /// Light sampling adds this to the path's radiance; zero where the light is occluded.
    LightSample { radiance: Vec3 },
    /// BSDF sampling gives no direction.
    Absorbed,
    /// BSDF sampling gives a direction. `weight` is the BSDF times the cosine over the density.
    Scatter { direction: Vec3, weight: Vec3, pdf: f32, is_specular: bool },
    /// Russian roulette with this probability of survival.
    Roulette { survival: f32, survives: bool },
}

impl fmt::Display for PathEvent {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Ray { depth, origin, direction } => {
                write!(f, "ray {depth}: from {origin} in direction {direction}")
            }
            Self::Miss => f.write_str("  leaves the scene"),
            Self::Hit { distance, position, normal, primitive, material } => write!(
                f,
                "  hits primitive {primitive} of material {material} at {position}, distance {distance}, normal {normal}"
            ),
            Self::Emission { emitted, mis_weight, throughput } => write!(
                f,
                "  emission {emitted}, MIS weight {mis_weight}, throughput {throughput}: adds {}",
                *throughput * *emitted * *mis_weight
            ),
            Self::Interface => f.write_str("  passes an interface"),
            Self::GreatestDepth => f.write_str("  ends at the greatest depth"),
            Self::LightSample { radiance } => write!(f, "  light sampling adds {radiance}"),
            Self::Absorbed => f.write_str("  BSDF sampling absorbs the path"),
            Self::Scatter { direction, weight, pdf, is_specular } => {
                let kind = if *is_specular { "specular, " } else { "" };
                write!(f, "  scatters in direction {direction}: {kind}weight {weight}, density {pdf}")
            }
            Self::Roulette { survival, survives } => {
                let outcome = if *survives { "goes on" } else { "ends" };
                write!(f, "  Russian roulette with survival {survival}: {outcome}")
            }
        }
    }
}
