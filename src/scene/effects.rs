//! The effects that a scene calls for, and nothing else decides what is simulated.

use super::Scene;

/// What a render of a scene has to simulate. Everything downstream (random numbers drawn,
/// dimensions of the sample vector, planes of the store, terms of the filter) follows from this.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Effects {
    /// The camera has a lens.
    pub lens: bool,
    /// Something moves while the shutter is open.
    pub motion: bool,
    /// Some light has an extent: a surface or an environment, so that light sampling draws numbers
    /// that the colour depends on.
    pub extended_lights: bool,
    /// An environment surrounds the scene.
    pub environment: bool,
    /// Some emission (surface or environment) can be seen by the camera.
    pub visible_emission: bool,
    /// Some material scatters in more than a Lambertian or a perfectly specular way.
    pub glossy: bool,
    /// Some material is perfectly specular.
    pub specular: bool,
    /// Paths are followed beyond the first hit: indirect light, or specular chains.
    pub second_hit: bool,
    /// Light is gathered beyond the first scattering event.
    pub indirect: bool,
    /// Some reflectance varies over a surface or between surfaces, so that the albedo is a feature.
    pub textures: bool,
    /// Some surface is cut out by an alpha texture.
    pub alpha: bool,
}

impl Effects {
    /// Reads off a scene what it calls for.
    pub fn of(scene: &Scene) -> Self {
        let _ = scene;
        todo!()
    }

    /// Names of the effects that are on, in pbrt's and the field's words.
    pub fn names(&self) -> Vec<&'static str> {
        [
            (self.lens, "depth-of-field"),
            (self.motion, "motion-blur"),
            (self.extended_lights, "area-lights"),
            (self.environment, "environment"),
            (self.visible_emission, "visible-emission"),
            (self.glossy, "glossy"),
            (self.specular, "specular"),
            (self.second_hit, "second-hit"),
            (self.indirect, "indirect"),
            (self.textures, "textures"),
            (self.alpha, "alpha"),
        ]
        .into_iter()
        .filter_map(|(on, name)| on.then_some(name))
        .collect()
    }
}
