//! Puts a page together: data as JSON, points and meshes as one packed block, script and style, and
//! a policy that allows nothing else.

use crate::blocks::{COARSEST, Owner, PagePoints};
use crate::encode::{base64, packed, policy_digest, push_varint};
use crate::input::{PageRobot, PageScanner, PageTexts};
use crate::meshes::{MeshEntry, MeshStore};
use crate::texts::{embedded, filled};
use crate::trees::TreeEntry;
use contract::{Error, Kind, Result, quote};
use serde::Serialize;
use std::collections::BTreeMap;

const TEMPLATE: &str = include_str!("../assets/page.html");
const STYLE: &str = include_str!("../assets/page.css");
const SCRIPTS: [&str; 10] = [
    include_str!("../assets/js/data.js"),
    include_str!("../assets/js/maths.js"),
    include_str!("../assets/js/robots.js"),
    include_str!("../assets/js/picture.js"),
    include_str!("../assets/js/hardware.js"),
    include_str!("../assets/js/software.js"),
    include_str!("../assets/js/view.js"),
    include_str!("../assets/js/panel.js"),
    include_str!("../assets/js/tables.js"),
    include_str!("../assets/js/main.js"),
];

/// Name and version of the data of a page.
pub const PAGE_SCHEMA: &str = "stillpoint.page/1";
/// Most points of a page: a processor without graphics hardware draws them in a quarter of a
/// second, and they take less than a page may have where they lie on surfaces.
pub const MOST_POINTS: usize = 3_200_000;
/// Most bytes of points and meshes as text; texts of the result come on top.
const MOST_PACKED: usize = 12_000_000;
/// Most bytes of data, points, meshes and pictures as text: with script and style the page stays
/// below 15 MB. Pictures that do not fit are left out, and the page refers to their files.
const MOST_TEXT: usize = 14_600_000;

/// A page that is being made: first robots, then points.
#[derive(Debug)]
pub struct ReportPage {
    texts: PageTexts,
    scanners: Vec<PageScanner>,
    robots: Vec<Option<RobotOnPage>>,
    trees: Vec<TreeEntry>,
    meshes: MeshStore,
    bounds: Vec<geometry::Aabb>,
    /// PNG files by the identity of their robot.
    pictures: Vec<(String, Vec<u8>)>,
}

/// Where the body of a robot is found on the page.
#[derive(Debug, Serialize)]
struct RobotOnPage {
    tree: usize,
    mesh: Option<usize>,
    hanging: Option<usize>,
}

/// What the view needs beside the result.
#[derive(Serialize)]
struct ViewData<'a> {
    origin: [f64; 3],
    scanners: &'a [PageScanner],
    robots: &'a [Option<RobotOnPage>],
    trees: &'a [TreeEntry],
    meshes: &'a [MeshEntry],
    edge: BlockEdges,
    coarsest: u32,
    blocks: Vec<Vec<i64>>,
    /// Lengths of places, tags and meshes within the packed block, bytes.
    bytes: [usize; 3],
}

/// Edges of blocks, metres.
#[derive(Serialize)]
struct BlockEdges {
    still: f64,
    robot: f64,
}

impl Serialize for PageScanner {
    fn serialize<S: serde::Serializer>(&self, to: S) -> std::result::Result<S::Ok, S::Error> {
        use serde::ser::SerializeStruct;
        let mut entry = to.serialize_struct("scanner", 2)?;
        entry.serialize_field("name", &self.name)?;
        entry.serialize_field("at", &self.at)?;
        entry.end()
    }
}

impl ReportPage {
    /// A page without robots and points.
    #[must_use]
    pub fn new(texts: PageTexts, scanners: Vec<PageScanner>) -> Self {
        let (robots, trees, bounds) = (Vec::new(), Vec::new(), Vec::new());
        let (meshes, pictures) = (MeshStore::default(), Vec::new());
        Self { texts, scanners, robots, trees, meshes, bounds, pictures }
    }

    /// Adds the next robot of the result; `None` for one without a body on the page.
    pub fn add_robot(&mut self, robot: Option<PageRobot>) {
        let on_page = robot.map(|robot| {
            let tree = TreeEntry::new(&robot.model, &robot.loops);
            let known = self.trees.iter().position(|t| *t == tree);
            let tree = known.unwrap_or_else(|| {
                self.trees.push(tree);
                self.trees.len() - 1
            });
            let mesh = self.meshes.add_robot(&robot.bodies);
            let hanging = self.meshes.add_hanging(&robot.hanging);
            self.bounds.push(robot.bounds());
            RobotOnPage { tree, mesh, hanging }
        });
        self.robots.push(on_page);
    }

    /// Adds the picture of a robot's residuals, a PNG file. Where not all fit, those added first
    /// do.
    pub fn add_picture(&mut self, id: &str, png: Vec<u8>) {
        self.pictures.push((id.into(), png));
    }

    /// Room for the points of the page, once all robots are there; `middle` is any place of the
    /// plant, world, metres.
    #[must_use]
    pub fn points(&self, middle: [f64; 3]) -> PagePoints {
        PagePoints::new(&self.bounds, middle, MOST_POINTS)
    }

    /// The data of the page as JSON, without what only its 3D view needs; counts of points by kind
    /// are null without points.
    ///
    /// # Errors
    /// If a text of the result is no JSON.
    pub fn data(&self, points: Option<&PagePoints>) -> Result<String> {
        let changes = match &self.texts.changes {
            Some(text) => embedded(text, "changes.json")?,
            None => "null".into(),
        };
        let kinds = ["fixed", "link", "attachment", "floor", "uncertain"];
        let counts = |points: &PagePoints| {
            let each =
                kinds.iter().zip(points.n_of_kind).map(|(kind, n)| format!("\"{kind}\":{n}"));
            format!("{{{}}}", each.collect::<Vec<_>>().join(","))
        };
        let counts = points.map_or_else(|| "null".into(), counts);
        let scanners = json(&self.scanners)?;
        let joined = format!(
            "{{\"schema\":\"{PAGE_SCHEMA}\",\"title\":{},\"program\":{},\"summary\":{},\
             \"is_partial\":{},\"run\":{},\"n_points\":{counts},\"scanners\":{scanners},\"result\":{},\
             \"changes\":{changes}",
            json(&self.texts.title)?,
            json(&self.texts.program)?,
            json(&self.texts.summary)?,
            self.texts.is_partial,
            json(&self.texts.run)?,
            embedded(&self.texts.result, "result.json")?,
        );
        embedded(&format!("{joined}}}"), "the page's data")
    }

    /// The page. The same content gives the same bytes.
    ///
    /// # Errors
    /// If a text of the result is no JSON.
    pub fn html(&self, points: &PagePoints) -> Result<String> {
        let data = self.data(Some(points))?;
        let mut most = MOST_POINTS;
        let (view, packed) = loop {
            let (view, packed) = self.view(points, most)?;
            // Fewer points until it is short enough; bytes go with points.
            if packed.len() <= MOST_PACKED || most < 1_000 {
                break (view, packed);
            }
            most = (most.min(points.n_points()) as f64 * 0.95 * MOST_PACKED as f64
                / packed.len() as f64) as usize;
        };
        let pictures =
            self.pictures(MOST_TEXT.saturating_sub(data.len() + view.len() + packed.len()));
        let script = format!("(() => {{\n\"use strict\";\n{}}})();\n", SCRIPTS.join("\n"));
        let policy = format!(
            "default-src 'none'; script-src {}; style-src {}; img-src data: blob:; \
             base-uri 'none'; form-action 'none'",
            policy_digest(&script),
            policy_digest(STYLE)
        );
        let title = quote::xml(&quote::shown(&self.texts.title)).into_owned();
        Ok(filled(
            TEMPLATE,
            &[
                ("policy", &policy),
                ("title", &title),
                ("style", STYLE),
                ("script", &script),
                ("data", &data),
                ("view", &view),
                ("pictures", &embedded(&json(&pictures)?, "the pictures")?),
                ("packed", &packed),
            ],
        ))
    }

    /// As many pictures as so many bytes of text hold, the first ones.
    fn pictures(&self, most: usize) -> BTreeMap<&str, String> {
        let mut room = most;
        let fits = |(_, png): &&(String, Vec<u8>)| {
            let takes = png.len().div_ceil(3) * 4;
            let fits = takes <= room;
            room -= if fits { takes } else { 0 };
            fits
        };
        self.pictures.iter().filter(fits).map(|(id, png)| (&**id, base64(png))).collect()
    }

    /// The view's data as JSON, and points and meshes as text.
    fn view(&self, points: &PagePoints, most: usize) -> Result<(String, String)> {
        let (mut places, mut tags, mut blocks) = (Vec::new(), Vec::new(), Vec::new());
        for ((owner, at), block) in points.finish(most) {
            let mut row = vec![i64::from(owner.number())];
            row.extend(at.map(i64::from));
            row.push(i64::from(block.shift));
            row.extend(block.counts.map(i64::from));
            blocks.push(row);
            let mut rest = &block.points[..];
            for n in block.counts {
                let (level, behind) = rest.split_at(n as usize);
                let mut before = 0;
                for (place, _) in level {
                    push_varint(&mut places, place - before);
                    before = *place;
                }
                rest = behind;
            }
            if owner != Owner::Unknown {
                block.points.iter().for_each(|(_, tag)| push_varint(&mut tags, u32::from(*tag)));
            }
        }
        let bytes = [places.len(), tags.len(), self.meshes.bytes.len()];
        let edge = BlockEdges { still: Owner::Still.edge(), robot: Owner::Robot(0).edge() };
        let view = ViewData {
            origin: points.origin(),
            scanners: &self.scanners,
            robots: &self.robots,
            trees: &self.trees,
            meshes: &self.meshes.entries,
            edge,
            coarsest: COARSEST,
            blocks,
            bytes,
        };
        places.append(&mut tags);
        places.extend_from_slice(&self.meshes.bytes);
        Ok((embedded(&json(&view)?, "the view")?, packed(&places)))
    }
}

fn json(value: &impl Serialize) -> Result<String> {
    serde_json::to_string(value)
        .map_err(|e| Error::new(Kind::Bug, "the page's data cannot be written").because(e))
}

#[cfg(test)]
mod tests;
