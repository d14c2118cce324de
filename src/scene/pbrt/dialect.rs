//! Differences between the scene files of pbrt-v2, v3 and v4. v4 is the reference.

use std::path::Path;

use glam::Vec3;

use super::spectrum::{Spectrum, blackbody_peak_over};
use crate::scene::MeshTangents;
use crate::scene::film::PixelFilter;
use crate::scene::light::SpotFalloff;
use crate::scene::material::RoughnessScale;
use crate::scene::texture::{Content, Encoding};

/// A version of pbrt's scene description format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dialect {
    V2,
    V3,
    V4,
}

impl std::fmt::Display for Dialect {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(match self {
            Dialect::V2 => "pbrt-v2",
            Dialect::V3 => "pbrt-v3",
            Dialect::V4 => "pbrt-v4",
        })
    }
}

impl Dialect {
    /// Whether `AttributeEnd` may close `ObjectBegin`, and `ObjectEnd` may close `AttributeBegin`. The
    /// older dialects use one stack for both.
    pub(super) fn allows_crossed_blocks(self) -> bool {
        self != Dialect::V4
    }

    /// Whether the end of the world closes open blocks.
    pub(super) fn closes_open_blocks_at_end(self) -> bool {
        self != Dialect::V4
    }

    /// Whether surplus texture coordinates of a mesh are dropped; otherwise all of them are.
    pub(super) fn truncates_surplus_uvs(self) -> bool {
        self != Dialect::V4
    }

    /// Whether `TransformEnd` restores the transform only; otherwise it restores all attributes.
    pub(super) fn transform_end_restores_transform_only(self) -> bool {
        self != Dialect::V4
    }

    /// Whether the end of a block of attributes brings back the textures and materials that were redefined in it; otherwise
    /// names hold for the whole scene, and pbrt defines none twice.
    pub(super) fn restores_definitions(self) -> bool {
        self != Dialect::V4
    }

    /// Whether materials and objects may be referenced before their definition.
    pub(super) fn allows_forward_references(self) -> bool {
        self == Dialect::V4
    }

    /// Whether pbrt goes on after unknown names and missing files, without the directive or with a default;
    /// otherwise it ends.
    pub(super) fn goes_on_after_errors(self) -> bool {
        self != Dialect::V4
    }

    /// Whether `NamedMaterial` with an unknown name keeps the current material.
    pub(super) fn ignores_unknown_materials(self) -> bool {
        self != Dialect::V4
    }

    /// The greatest value of a blackbody's spectrum: pbrt-v2 has 1 at 555 nm, later ones at the peak.
    pub(super) fn blackbody_peak(self, kelvin: f64) -> f64 {
        if self == Dialect::V2 { blackbody_peak_over(555.0, kelvin) } else { 1.0 }
    }

    /// The material types of the dialect, for messages.
    pub(super) fn material_names(self) -> &'static str {
        match self {
            Dialect::V2 => {
                "matte, plastic, translucent, glass, mirror, mix, metal, shinymetal, substrate, uber, measured, \
                 subsurface or kdsubsurface"
            }
            Dialect::V3 => {
                "matte, plastic, translucent, glass, mirror, hair, disney, mix, metal, substrate, uber, subsurface, \
                 kdsubsurface, fourier or none"
            }
            Dialect::V4 => {
                "diffuse, coateddiffuse, conductor, coatedconductor, dielectric, thindielectric, diffusetransmission, \
                 measured, hair, subsurface, mix or interface"
            }
        }
    }

    /// Whether parameters of a shape override those of its material.
    pub(super) fn shapes_override_materials(self) -> bool {
        self != Dialect::V4
    }

    /// Whether parameters of a shape override those of a named material, too.
    pub(super) fn shapes_override_named_materials(self) -> bool {
        self == Dialect::V3
    }

    /// Whether area lights on interfaces between media emit; otherwise these lights are left out.
    pub(super) fn interfaces_emit(self) -> bool {
        self != Dialect::V4
    }

    /// Whether a surface is opaque wherever its alpha is not 0; otherwise alpha is its opacity.
    pub(super) fn alpha_is_binary(self) -> bool {
        self != Dialect::V4
    }

    /// Whether solid textures apply the current transform to world-space points, and planar mappings
    /// use world-space points; otherwise both apply the inverse of the current transform.
    pub(super) fn applies_ctm_to_world_points(self) -> bool {
        self != Dialect::V4
    }

    /// Whether cylindrical mappings take the height of the unit vector in a point's direction; otherwise that
    /// of the point.
    pub(super) fn normalises_cylindrical_mappings(self) -> bool {
        self != Dialect::V4
    }

    /// Whether the amount of a mix of materials is a spectrum; otherwise it is a float.
    pub(super) fn mix_amount_is_spectrum(self) -> bool {
        self != Dialect::V4
    }

    /// Whether pixel values are proportional to the time that the shutter is open.
    pub(super) fn shutter_scales_exposure(self) -> bool {
        self == Dialect::V4
    }

    /// Whether the gloss of `plastic` and `uber` has the inverse index of refraction seen from behind, not the same.
    pub(super) fn inverts_gloss_behind(self) -> bool {
        self == Dialect::V3
    }

    /// The tangents of triangle meshes with normals.
    pub(super) fn mesh_tangents(self) -> MeshTangents {
        match self {
            Self::V4 => MeshTangents::Perpendicular,
            Self::V2 | Self::V3 => MeshTangents::Opposite,
        }
    }

    /// Whether v = 0 is the bottom row of an image; otherwise it is the top row.
    pub(super) fn v_starts_at_bottom_row(self) -> bool {
        self != Dialect::V2
    }

    /// Whether environment maps are in latitude-longitude layout; otherwise they are equal-area.
    pub(super) fn environment_maps_are_lat_long(self) -> bool {
        self != Dialect::V4
    }

    /// The meaning of a roughness; `remap` is the parameter `remaproughness`, which v2 ignores.
    pub(super) fn roughness_scale(self, remap: bool) -> RoughnessScale {
        match (self, remap) {
            (Dialect::V2, _) => RoughnessScale::InverseExponent,
            (_, false) => RoughnessScale::Alpha,
            (Dialect::V3, true) => RoughnessScale::Logarithm,
            (Dialect::V4, true) => RoughnessScale::SquareRoot,
        }
    }

    /// The encoding of an image file whose parameters ask for `wanted`, if anything. v4 honours the
    /// parameter for PNG files only and assumes sRGB for other integer formats; the older dialects
    /// honour it for all files.
    pub(super) fn image_encoding(self, path: &Path, wanted: Option<Encoding>) -> Encoding {
        let floats = has_extension(path, &["exr", "hdr", "pfm"]);
        let default = if floats || self == Dialect::V2 { Encoding::Linear } else { Encoding::Srgb };
        let honoured = self != Dialect::V4 || has_extension(path, &["png"]);
        wanted.filter(|_| honoured).unwrap_or(default)
    }

    /// Default field of view of `projection` lights, in degrees.
    pub(super) fn default_projection_fov(self) -> f64 {
        if self == Dialect::V4 { 90.0 } else { 45.0 }
    }

    /// Whether `projection` lights show their image upright; otherwise it is upside down.
    pub(super) fn projections_are_upright(self) -> bool {
        self == Dialect::V4
    }

    /// Whether an image is flipped vertically, as v2 does with TGA and PFM files.
    pub(super) fn flips_rows(self, path: &Path) -> bool {
        self == Dialect::V2 && has_extension(path, &["tga", "pfm"])
    }

    /// Default encoding of the images of lights, if it differs from that of textures.
    pub(super) fn light_encoding(self) -> Option<Encoding> {
        (self != Dialect::V4).then_some(Encoding::Linear)
    }

    /// Encoded value of a texture whose image cannot be read; `None` where that is an error.
    pub(super) fn missing_texture_value(self) -> Option<f32> {
        match self {
            Dialect::V2 => Some(1.0),
            Dialect::V3 => Some(0.5),
            Dialect::V4 => None,
        }
    }

    /// Like [`Self::missing_texture_value`], of the image of a light.
    pub(super) fn missing_light_value(self) -> Option<f32> {
        (self != Dialect::V4).then_some(1.0)
    }

    /// What the image of a float texture is read as.
    pub(super) fn scalar_content(self) -> Content {
        if self == Dialect::V4 { Content::Colour } else { Content::Luminance }
    }

    /// Factor of an image's linear values for the parameter `scale`, which v2 applies before decoding.
    pub(super) fn image_scale(self, scale: f64, encoding: Option<Encoding>) -> f64 {
        match (self, encoding) {
            (Dialect::V2, Some(Encoding::Gamma(gamma))) => scale.max(0.0).powf(gamma.into()),
            _ => scale,
        }
    }

    /// RGB of a reflectance or an index of refraction.
    pub(super) fn reflectance(self, spectrum: &Spectrum) -> Vec3 {
        match self {
            Dialect::V2 | Dialect::V3 => spectrum.unadapted(),
            Dialect::V4 => spectrum.reflectance(),
        }
    }

    /// RGB of a light's emission; in v4 it is normalised to a luminance of 1.
    pub(super) fn light_colour(self, spectrum: &Spectrum) -> Vec3 {
        match self {
            Dialect::V2 | Dialect::V3 => spectrum.unadapted().max(Vec3::ZERO),
            Dialect::V4 => spectrum.illuminant(),
        }
    }

    /// Whether the samples of a spectrum may be unsorted; otherwise their wavelengths must rise.
    pub(super) fn sorts_spectra(self) -> bool {
        self != Dialect::V4
    }

    /// Whether a spectrum is 0 outside the range of its samples; otherwise it is constant there.
    pub(super) fn spectra_are_zero_outside(self) -> bool {
        self == Dialect::V4
    }

    /// The pixel filter of a scene without `PixelFilter`.
    pub(super) fn default_filter(self) -> PixelFilter {
        match self {
            Dialect::V4 => PixelFilter::Gaussian { radius: [1.5; 2], sigma: 0.5 },
            Dialect::V2 | Dialect::V3 => PixelFilter::Box { radius: [0.5; 2] },
        }
    }

    /// Names of the parameters for the radius of a pixel filter.
    pub(super) fn filter_radius_names(self) -> [&'static str; 2] {
        match self {
            Dialect::V4 => ["xradius", "yradius"],
            Dialect::V2 | Dialect::V3 => ["xwidth", "ywidth"],
        }
    }

    /// Default radius of a Gaussian filter.
    pub(super) fn default_gaussian_radius(self) -> f64 {
        if self == Dialect::V4 { 1.5 } else { 2.0 }
    }

    /// Falloff of a spot light between its two angles.
    pub(super) fn spot_falloff(self) -> SpotFalloff {
        if self == Dialect::V4 { SpotFalloff::Smoothstep } else { SpotFalloff::FourthPower }
    }

    /// The integrator of a scene without `Integrator`.
    pub(super) fn default_integrator(self) -> &'static str {
        match self {
            Dialect::V2 => "directlighting",
            Dialect::V3 => "path",
            Dialect::V4 => "volpath",
        }
    }

    /// Largest number of scattering events of a path. v2 allows one more than its parameter says,
    /// because it tests the limit after it has gathered the light of the last event.
    pub(super) fn max_scattering_events(self, max_depth: u32) -> u32 {
        if self == Dialect::V2 { max_depth + 1 } else { max_depth }
    }

    /// Default resolution of the film.
    pub(super) fn default_resolution(self) -> [u32; 2] {
        match self {
            Dialect::V2 => [640, 480],
            Dialect::V3 | Dialect::V4 => [1280, 720],
        }
    }
}

/// Whether a file has one of these extensions, ignoring case.
fn has_extension(path: &Path, extensions: &[&str]) -> bool {
    path.extension().is_some_and(|found| extensions.iter().any(|name| found.eq_ignore_ascii_case(name)))
}
