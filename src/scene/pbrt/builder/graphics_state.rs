//! The graphics state: attributes that directives set and blocks restore.

use std::collections::HashMap;
use std::rc::Rc;

use glam::DAffine3;

use super::MaterialRef;
use crate::scene::AreaLight;
use crate::scene::color_space::ColorSpace;
use crate::scene::pbrt::parser::AttributeDefaults;

/// Transforms at the two key times, `start` and `end` (pbrt's `TransformSet`).
pub type TransformSet = [DAffine3; 2];

/// The current area light, not yet attached to a shape.
#[derive(Clone, Copy)]
pub struct AreaLightSource {
    pub light: AreaLight,
    /// Power in watts that the shape is scaled to emit, if given.
    pub power: Option<f64>,
}

/// Attributes that `AttributeBegin` saves and `AttributeEnd` restores.
#[derive(Clone)]
pub struct GraphicsState {
    /// The current transform at the two key times.
    pub ctm: TransformSet,
    /// Which of the two transforms the transform directives change.
    pub active: [bool; 2],
    pub reverse_orientation: bool,
    pub material: MaterialRef,
    pub area_light: Option<AreaLightSource>,
    pub color_space: ColorSpace,
    /// Parameters set by `Attribute`, by target (`shape`, `light`, ...).
    pub defaults: Rc<HashMap<String, Rc<AttributeDefaults>>>,
}

impl GraphicsState {
    /// The state at the start of a scene, with `material` as the current material.
    pub fn new(material: MaterialRef) -> Self {
        Self {
            ctm: [DAffine3::IDENTITY; 2],
            active: [true; 2],
            reverse_orientation: false,
            material,
            area_light: None,
            color_space: ColorSpace::Srgb,
            defaults: Rc::default(),
        }
    }

    /// Whether the current transform moves.
    pub fn is_animated(&self) -> bool {
        self.ctm[0] != self.ctm[1]
    }
}
