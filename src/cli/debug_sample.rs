//! `prpf render --debug-sample`: prints the events of one path.

use anyhow::ensure;

use crate::render::{PathRadiance, Renderer};

/// A sample: a pixel of the rendered image, and the sample's index in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct DebugSample {
    pub x: usize,
    pub y: usize,
    pub index: u32,
}

impl DebugSample {
    /// Traces the sample's path by the scalar reference path tracer; returns its events, one a line, and its radiance.
    ///
    /// # Errors
    /// A pixel outside the rendered image.
    pub fn describe(&self, renderer: &Renderer) -> anyhow::Result<String> {
        let Self { x, y, index } = *self;
        let (width, height) = renderer.resolution();
        ensure!(
            x < width && y < height,
            "--debug-sample {x},{y},{index}: found a pixel outside the image; accepted are X below {width} and Y below \
             {height}"
        );
        let mut text = String::new();
        let radiance = renderer.reference_radiance(x, y, index, &mut |event| text += &format!("{event}\n"));
        let PathRadiance { light_sampled, bsdf_sampled, visible_emission } = radiance;
        text += &format!(
            "radiance {}: {light_sampled} by light sampling, {bsdf_sampled} by BSDF sampling, {visible_emission} of \
             visible emission\n",
            light_sampled + bsdf_sampled + visible_emission
        );
        Ok(text)
    }
}
