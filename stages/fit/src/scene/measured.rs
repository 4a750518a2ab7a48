//! A point of a scene.

/// A measured point, local frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Measured {
    pub(crate) p: [f32; 3],
    /// Index of its view.
    pub(crate) view: u16,
}
