//! Point lights that project an image: `goniometric` and `projection`.

use std::f64::consts::PI;

use glam::{DMat3, DVec3, Vec2, Vec3};

use super::infinite_light::image_filename;
use super::light_power::scale_light;
use crate::image::luminance;
use crate::scene::light::{EnvironmentMap, ImageProjection};
use crate::scene::pbrt::builder::SceneBuilder;
use crate::scene::pbrt::parser::{ParameterDictionary, ParseError, Result};
use crate::scene::{Light, Textures};

impl SceneBuilder {
    /// `goniometric`: a point light with a spherical image; without one, an isotropic point light.
    pub fn goniometric(&mut self, params: &ParameterDictionary) -> Result<Light> {
        let Some(file) = image_filename(params)? else { return self.point(params) };
        let image = self.light_image(file, params)?;
        let map = self.environment_map(image);
        // The axis of the image is y
        let axes = DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::Y);
        self.projector(params, axes, ImageProjection::Spherical(map), self.illuminant())
    }

    /// `projection`: a point light that projects an image.
    pub fn projection(&mut self, params: &ParameterDictionary) -> Result<Light> {
        let Some(file) = image_filename(params)? else {
            let message = "projection without an image; expected \"string filename\"";
            return Err(ParseError::new(params.loc, message));
        };
        let fov = params.float_or("fov", self.dialect.default_projection_fov())?;
        if !(fov > 0.0 && fov < 180.0) {
            let message = format!("\"fov\" is {fov}; expected an angle between 0 and 180 degrees");
            return Err(ParseError::new(params.loc, message));
        }
        let image = self.light_image(file, params)?;
        let tan_half_fov = (fov.to_radians() / 2.0).tan() as f32;
        // Image rows run downwards; the older dialects show images upside down
        let rows = if self.dialect.projections_are_upright() { -1.0 } else { 1.0 };
        let axes = DMat3::from_diagonal(DVec3::new(1.0, rows, 1.0));
        self.projector(params, axes, ImageProjection::Perspective { image, tan_half_fov }, Vec3::ONE)
    }

    /// A light that projects `image`; `axes` maps light space to image space, and `default` is the intensity if none is given.
    fn projector(
        &mut self,
        params: &ParameterDictionary,
        axes: DMat3,
        image: ImageProjection,
        default: Vec3,
    ) -> Result<Light> {
        let to_render = self.to_render();
        let intensity = self.light_colour(params, "I", default)?;
        if let Some(power) = params.positive("power")?
            && intensity != Vec3::ZERO
        {
            self.projectors_with_power.push((self.lights.len(), power, params.loc));
        }
        // Remove the scale of the transform
        let to_render_axes = to_render.matrix3 * to_render.matrix3.determinant().abs().cbrt().recip();
        Ok(Light::Projector {
            position: to_render.translation.as_vec3(),
            intensity,
            from_render: (axes * to_render_axes.inverse()).as_mat3(),
            image,
        })
    }

    /// Scales projectors to their given power.
    ///
    /// # Errors
    /// If a light's colour overflows.
    pub fn scale_projectors_to_power(&mut self) -> Result<()> {
        for (index, power, loc) in std::mem::take(&mut self.projectors_with_power) {
            let Light::Projector { intensity, image, .. } = &mut self.lights[index] else { continue };
            let emitted = emitted_power(&self.textures, *image);
            if emitted > 0.0 {
                *intensity = scale_light(*intensity, power / emitted, loc)?;
            }
        }
        Ok(())
    }
}

/// Power of a projector of unit intensity as in pbrt-v4: from the mean of the channels for a spherical
/// image, and from luminance for a projected one.
fn emitted_power(textures: &Textures, image: ImageProjection) -> f64 {
    match image {
        ImageProjection::Spherical(EnvironmentMap::LatLong(id) | EnvironmentMap::EqualArea(id)) => {
            4.0 * PI * f64::from(textures.image(id).mean_light().element_sum() / 3.0)
        }
        ImageProjection::Perspective { image, tan_half_fov } => {
            let image = textures.image(image);
            let size = Vec2::new(image.width() as f32, image.height() as f32);
            let half = ImageProjection::half_extent(tan_half_fov, image.width(), image.height());
            let texels = (0..image.height()).flat_map(|y| (0..image.width()).map(move |x| (x, y)));
            let sum: f64 = texels
                .map(|(x, y)| {
                    let point = half * (2.0 * (Vec2::new(x as f32, y as f32) + 0.5) / size - 1.0);
                    // Convert the area of the image plane to solid angle
                    let solid_angle = (1.0 + f64::from(point.length_squared())).powf(-1.5);
                    f64::from(luminance(image.rgb(x, y).max(Vec3::ZERO).to_array())) * solid_angle
                })
                .sum();
            sum * f64::from(4.0 * half.x * half.y / (size.x * size.y))
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::scene::pbrt::read_str;

    /// A folder with a square image whose upper left texel is green, and a white image of 2x1 texels.
    fn images() -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, header: &str, texels: &[f32]| {
            let bytes = texels.iter().flat_map(|v| v.to_le_bytes());
            std::fs::write(folder.path().join(name), header.bytes().chain(bytes).collect::<Vec<u8>>())
                .unwrap();
        };
        // Rows are stored from the bottom up
        write("square.pfm", "PF\n2 2\n-1\n", &[0., 0., 0., 0., 0., 0., 0., 3., 0., 0., 0., 0.]);
        write("wide.pfm", "Pf\n2 1\n-1\n", &[1.0; 2]);
        folder
    }

    /// The position, the intensity, and the world axes in image space.
    fn projector(header: &str, light: &str, end: &str) -> (Vec3, Vec3, [Vec3; 3], ImageProjection) {
        let text = format!("{header} WorldBegin Translate 1 2 3 LightSource {light} {end}");
        let scene = read_str(&text, images().path()).unwrap_or_else(|error| panic!("{error}"));
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        let [Light::Projector { position, intensity, from_render, image }] = scene.lights[..] else {
            panic!("{:?}", scene.lights)
        };
        (position, intensity, [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| from_render * axis), image)
    }

    #[test]
    fn the_axis_of_goniometric_lights_is_y() {
        let light = "\"goniometric\" \"rgb I\" [1 2 3] \"string filename\" \"square.pfm\"";
        let (position, intensity, axes, image) = projector("", light, "");
        assert_eq!((position, intensity), (Vec3::new(1.0, 2.0, 3.0), Vec3::new(1.0, 2.0, 3.0)));
        assert_eq!(axes, [Vec3::X, Vec3::Z, Vec3::Y]);
        assert!(matches!(image, ImageProjection::Spherical(EnvironmentMap::EqualArea(_))));
        let old = "\"goniometric\" \"string mapname\" \"wide.pfm\"";
        let (.., image) = projector("", old, "WorldEnd");
        assert!(matches!(image, ImageProjection::Spherical(EnvironmentMap::LatLong(_))));
        // The mean of the texels' channels is a quarter
        let (_, intensity, ..) = projector("", &format!("{light} \"float power\" 5"), "");
        let expected = Vec3::new(1.0, 2.0, 3.0) * 5.0 / std::f32::consts::PI;
        assert!((intensity - expected).length() < 1e-4, "{intensity}");
        let plain = read_str("WorldBegin LightSource \"goniometric\"", Path::new("")).unwrap();
        assert!(matches!(plain.lights[..], [Light::Point { .. }]));
    }

    #[test]
    fn projections_stand_upright_in_v4_and_upside_down_before() {
        let light = "\"projection\" \"string filename\" \"wide.pfm\" \"float scale\" 2";
        let (_, intensity, axes, image) = projector("", light, "");
        assert_eq!((intensity, axes), (Vec3::splat(2.0), [Vec3::X, Vec3::NEG_Y, Vec3::Z]));
        let ImageProjection::Perspective { tan_half_fov, .. } = image else { panic!("{image:?}") };
        assert!((tan_half_fov - 1.0).abs() < 1e-6);
        let (.., axes, image) = projector("", light, "WorldEnd");
        assert_eq!(axes, [Vec3::X, Vec3::Y, Vec3::Z]);
        let ImageProjection::Perspective { tan_half_fov, .. } = image else { panic!("{image:?}") };
        assert!((tan_half_fov - 22.5f32.to_radians().tan()).abs() < 1e-6);
    }

    #[test]
    fn the_scale_of_the_transform_does_not_matter() {
        let light = "\"projection\" \"string filename\" \"wide.pfm\"";
        for size in ["1e-40", "1e30"] {
            let scaled =
                format!("{light} TransformBegin Scale {size} {size} {size} LightSource {light} TransformEnd");
            let scene = read_str(&format!("WorldBegin LightSource {scaled}"), images().path()).unwrap();
            let [plain, scaled] = [0, 1].map(|i| match scene.lights[i] {
                Light::Projector { from_render, .. } => from_render,
                ref other => panic!("{other:?}"),
            });
            assert!(plain.abs_diff_eq(scaled, 1e-6), "{scaled}");
        }
    }

    #[test]
    fn the_power_of_a_projection_covers_its_solid_angle() {
        let light = "\"projection\" \"string filename\" \"wide.pfm\" \"float fov\" 2 \"float power\" 7";
        let (_, intensity, ..) = projector("", light, "");
        // The solid angle of a small image is its area: two squares of twice the tangent
        let side = 2.0 * 1f32.to_radians().tan();
        assert!((intensity.x * 2.0 * side * side / 7.0 - 1.0).abs() < 1e-3, "{intensity}");
    }

    #[test]
    fn projections_without_an_image_or_an_angle_are_errors() {
        for light in ["\"projection\"", "\"projection\" \"string filename\" \"wide.pfm\" \"float fov\" 180"] {
            assert!(
                read_str(&format!("WorldBegin LightSource {light}"), images().path()).is_err(),
                "{light}"
            );
        }
        let light = "LightSource \"goniometric\" \"string filename\" \"wide.pfm\"";
        let error =
            read_str(&format!("WorldBegin {light}"), images().path()).expect_err("a wide image around");
        assert!(error.message.contains("square"), "{error}");
    }
}
