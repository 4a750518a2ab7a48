//! The content of `robot.toml`: what a URDF cannot express (main chain, loops, tool, symmetries).
//! Its format is documented in README.md.

use serde::Deserialize;

#[derive(Debug, Default, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Sheet {
    pub(crate) urdf: Option<String>,
    #[serde(default)]
    pub(crate) main_chain: Chain,
    #[serde(default)]
    pub(crate) sub_chain: Vec<SubChain>,
    #[serde(default)]
    pub(crate) effector: Effector,
    #[serde(default)]
    pub(crate) link: Vec<LinkNote>,
}

#[derive(Debug, Default, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Chain {
    pub(crate) root: Option<String>,
    pub(crate) tip: Option<String>,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SubChain {
    #[serde(default)]
    pub(crate) name: String,
    pub(crate) urdf: Option<String>,
    pub(crate) root: Option<String>,
    #[serde(default)]
    pub(crate) kind: LoopWord,
    pub(crate) passive: Option<Vec<String>>,
    #[serde(default)]
    pub(crate) closures: Vec<Pin>,
}

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

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Pin {
    pub(crate) link_a: String,
    pub(crate) xyz_a: [f64; 3],
    pub(crate) link_b: String,
    pub(crate) xyz_b: [f64; 3],
}

#[derive(Debug, Default, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Effector {
    pub(crate) root: Option<String>,
    #[serde(default)]
    pub(crate) links: Vec<String>,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct LinkNote {
    pub(crate) name: String,
    pub(crate) symmetry: Option<Turn>,
    pub(crate) mesh_sigma: Option<f64>,
    pub(crate) note: Option<String>,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Turn {
    pub(crate) axis: [f64; 3],
    #[serde(default)]
    pub(crate) through: [f64; 3],
    #[serde(default)]
    pub(crate) order: u32,
}
