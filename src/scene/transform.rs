//! Affine transforms and their motion over the shutter interval.

use glam::{Affine3A, DAffine3};

/// A transform that moves between two key times. Before `start_time` and after `end_time` it
/// stands still at the respective key.
#[derive(Clone, Debug, PartialEq)]
pub struct AnimatedTransform {
    pub start: DAffine3,
    pub end: DAffine3,
    pub start_time: f32,
    pub end_time: f32,
}

impl AnimatedTransform {
    /// A transform that does not move.
    pub fn fixed(transform: DAffine3) -> Self {
        Self { start: transform, end: transform, start_time: 0.0, end_time: 1.0 }
    }

    /// Whether the two keys differ.
    pub fn is_animated(&self) -> bool {
        self.start != self.end
    }

    /// The transform at `time`: translation interpolated linearly, rotation by slerp, the
    /// remaining stretch linearly, after a polar decomposition (Shoemake and Duff 1992).
    pub fn at(&self, time: f32) -> Affine3A {
        let _ = time;
        todo!("scene helper: decompose once at construction, slerp")
    }
}
