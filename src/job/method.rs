//! How postures are found: by the stage `fit`, or by the stage `baseline` that it is measured
//! against.

/// How postures are found.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Method {
    /// Beam search over the whole chain with free space, then one adjustment of everything.
    #[default]
    Beam,
    /// That of the method's source: link after link.
    Paper,
}
