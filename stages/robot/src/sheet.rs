//! The content of `robot.toml`: what a URDF cannot express (main chain, loops, tool, symmetries).
//! Its format is documented in README.md.

use serde::Deserialize;

/// What a URDF cannot express.
#[derive(Debug, Default, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Sheet {
    /// The main URDF, if it is not called `robot.urdf`.
    pub(crate) urdf: Option<String>,
    /// The links that set the posture; the chain with the most free joints without it.
    #[serde(default)]
    pub(crate) main_chain: Chain,
    /// Closed loops: links that follow the main chain.
    #[serde(default)]
    pub(crate) sub_chain: Vec<SubChain>,
    /// The tool.
    #[serde(default)]
    pub(crate) effector: Effector,
    /// Notes on single links.
    #[serde(default)]
    pub(crate) link: Vec<LinkNote>,
}

/// A chain of links.
#[derive(Debug, Default, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Chain {
    /// Its first link.
    pub(crate) root: Option<String>,
    /// Its last link.
    pub(crate) tip: Option<String>,
}

/// A closed loop.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SubChain {
    /// Name, for messages.
    #[serde(default)]
    pub(crate) name: String,
    /// URDF of the loop; without it its links are in the main URDF.
    pub(crate) urdf: Option<String>,
    /// Link of the main URDF that the root link of `urdf` is; the one of the same name without it.
    pub(crate) root: Option<String>,
    /// How it is solved; `auto` takes the first kind that fits.
    #[serde(default)]
    pub(crate) kind: LoopWord,
    /// Names of the joints that the loop sets; all moving joints of `urdf` without it.
    pub(crate) passive: Option<Vec<String>>,
    /// The pins that the tree leaves open.
    #[serde(default)]
    pub(crate) closures: Vec<Pin>,
}

/// The kind of a loop.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Deserialize)]
pub(crate) enum LoopWord {
    #[default]
    #[serde(rename = "auto")]
    Auto,
    #[serde(rename = "RRR", alias = "rrr")]
    Rrr,
    #[serde(rename = "RPR", alias = "rpr")]
    Rpr,
    #[serde(rename = "RR", alias = "rr")]
    Rr,
    #[serde(rename = "general")]
    General,
}

/// Two points of two links that coincide.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Pin {
    /// The first link.
    pub(crate) link_a: String,
    /// The point in its frame, metres.
    pub(crate) xyz_a: [f64; 3],
    /// The second link.
    pub(crate) link_b: String,
    /// The point in its frame, metres.
    pub(crate) xyz_b: [f64; 3],
}

/// The tool of a robot.
#[derive(Debug, Default, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Effector {
    /// This link and all that it carries are the tool.
    pub(crate) root: Option<String>,
    /// Names of further links of the tool.
    #[serde(default)]
    pub(crate) links: Vec<String>,
}

/// A note on a link.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct LinkNote {
    /// Name of the link.
    pub(crate) name: String,
    /// Rotation under which the link looks the same.
    pub(crate) symmetry: Option<Turn>,
    /// How far the mesh may be from the real surface, metres.
    pub(crate) mesh_sigma: Option<f64>,
    /// A remark for people.
    pub(crate) note: Option<String>,
}

/// A rotation under which a link looks the same.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Turn {
    /// Axis in the frame of the link.
    pub(crate) axis: [f64; 3],
    /// A point on the axis, metres.
    #[serde(default)]
    pub(crate) through: [f64; 3],
    /// The link is unchanged by a turn of 360°/order; 0 for any turn.
    #[serde(default)]
    pub(crate) order: u32,
}
