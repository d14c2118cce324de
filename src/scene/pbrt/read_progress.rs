//! Progress reports of the reader.

/// Progress of reading a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReadProgress {
    /// Shapes read so far.
    pub shapes: usize,
    /// Triangles of these shapes.
    pub triangles: usize,
}
