//! The list of a job's shards, as programs and people read it.

use serde::{Deserialize, Serialize};
use std::path::Path;

/// Name and version of the list's format.
pub(super) const SCHEMA: &str = "stillpoint.shards/1";
/// What a shard makes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ShardKind {
    /// Lattice tiles of an input.
    Tiles,
    /// Local planes and occupied space of an input.
    Planes,
    /// Floor and occupied space of the plant: a join, after which the regions are known.
    Ground,
    /// The search of a region.
    Region,
    /// The chosen robots, their tools, the shared registration, and labels near them: a join, after
    /// which the spaces and labels are known.
    Robots,
    /// Known space around a robot.
    Space,
    /// Masks and records of an input.
    Labels,
    /// A group of tiles or clouds of the result.
    Files,
    /// The result: the last join.
    Gather,
}

/// Whether a shard is made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ShardState {
    /// Its piece lies in the store.
    Done,
    /// All that it needs lies in the store.
    Ready,
    /// It needs shards that are not made yet.
    Waiting,
}

/// A shard of a job.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Shard {
    /// Its identity: kind and digest. It stays the same while job, files and program do.
    pub id: String,
    /// What it makes.
    pub kind: ShardKind,
    /// What it is about, for people.
    pub what: String,
    /// Inputs that it reads.
    pub inputs: Vec<String>,
    /// Ids of the shards that must be made before.
    pub needs: Vec<String>,
    /// Estimated processor time, seconds.
    pub seconds: f64,
    /// Estimated memory, bytes.
    pub memory_bytes: u64,
    /// Whether more shards are known when it is made: then the list is made anew.
    pub opens: bool,
    /// Whether it is made.
    pub state: ShardState,
}

/// The shards of a job that are known.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ShardList {
    /// Name and version of this format.
    pub schema: String,
    /// Whether the result is published, so that nothing is left to do.
    pub finished: bool,
    /// The shards, each after those that it needs.
    pub shards: Vec<Shard>,
    /// Messages about inputs and regions that failed and are left out.
    pub left_out: Vec<String>,
}

impl ShardList {
    pub(super) fn finished(left_out: Vec<String>) -> Self {
        Self { schema: SCHEMA.into(), finished: true, shards: Vec::new(), left_out }
    }
}

impl Shard {
    /// The shard of an input that failed.
    pub(super) fn of_input(id: String, path: &Path) -> Self {
        Self {
            id,
            kind: ShardKind::Tiles,
            what: format!("tiles of {}", path.display()),
            inputs: vec![path.display().to_string()],
            needs: Vec::new(),
            seconds: 0.0,
            memory_bytes: 0,
            opens: false,
            state: ShardState::Ready,
        }
    }
}

impl std::fmt::Display for ShardList {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.finished {
            writeln!(f, "all is done: the result is there")?;
        }
        for shard in &self.shards {
            let state = match shard.state {
                ShardState::Done => "done",
                ShardState::Ready => "ready",
                ShardState::Waiting => "waiting",
            };
            let Shard { id, what, seconds, .. } = shard;
            writeln!(f, "{id:<25} {state:<8} {seconds:>7.1} s  {what}")?;
        }
        self.left_out.iter().try_for_each(|what| writeln!(f, "{what}"))
    }
}
