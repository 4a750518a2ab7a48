//! Reads triangles from a COLLADA file, in the scene's frame and metres. Node transforms and
//! `<unit>` are applied; `<up_axis>` is ignored, as by the viewers for which robot vendors draw
//! their meshes.

use super::soup::Soup;
use crate::settings::Settings;
use contract::check_xml;
use nalgebra::{Matrix4, Rotation3, Unit, Vector3};
use roxmltree::{Document, Node};
use std::collections::HashMap;

/// Largest depth of nested nodes; real files have below ten.
const MAX_DEPTH: usize = 64;
/// Largest number of nodes that are visited, since instances may contain instances.
const MAX_VISITS: usize = 100_000;
/// A unit that differs by less from the metre is a rounded metre: a millionth of a robot's size is
/// below the resolution of any scanner.
const SAME_UNIT: f64 = 1e-6;
/// Added to the file's size before it is multiplied by the allowed growth, bytes: small files may
/// draw one bolt a hundred times.
const SMALL: u64 = 1 << 20;

pub(super) fn read(text: &str, settings: &Settings) -> Result<Soup, String> {
    check_xml(text.as_bytes(), &settings.xml())?;
    let document = Document::parse(text).map_err(|e| format!("not well-formed XML ({e})"))?;
    let root = document.root_element();
    if root.tag_name().name() != "COLLADA" {
        return Err(format!("not a COLLADA file, opens with \"{}\"", root.tag_name().name()));
    }
    let mut scene =
        DaeScene::new(root, (text.len() as u64 + SMALL).saturating_mul(settings.max_mesh_growth))?;
    let roots = scene.roots(root);
    for node in &roots {
        scene.node(*node, Matrix4::identity(), 0)?;
    }
    if roots.is_empty() {
        scene.soup.note("there is no scene; all geometries are taken as they are");
        let geometries = scene.all_geometries(root);
        for geometry in geometries {
            scene.geometry(geometry, &Matrix4::identity())?;
        }
    }
    let unit = scene.unit;
    let mut soup = scene.soup;
    if (unit - 1.0).abs() > SAME_UNIT {
        soup.note(&format!(
            "its unit of {unit} m is applied here; most other readers of URDF ignore it and see \
             the mesh {} times as large",
            rounded(unit.recip())
        ));
    }
    for p in &mut soup.vertices {
        *p = p.map(|v| v * unit);
    }
    Ok(soup)
}

/// A ratio rounded to six digits, so that 1/0.0254 is 39.3701.
fn rounded(ratio: f64) -> f64 {
    let digit = 10_f64.powf(5.0 - ratio.log10().floor());
    (ratio * digit).round() / digit
}

struct DaeScene<'a, 'i> {
    by_id: HashMap<&'a str, Node<'a, 'i>>,
    unit: f64,
    soup: Soup,
    n_visits: usize,
    /// Bytes that may still be read or kept. It bounds files that instantiate a geometry again and
    /// again.
    left: u64,
}

fn element<'a, 'i>(node: Node<'a, 'i>, tag: &str) -> Option<Node<'a, 'i>> {
    node.children().find(|n| n.tag_name().name() == tag)
}

fn local<'a>(node: Node<'a, '_>, attribute: &str) -> Option<&'a str> {
    node.attribute(attribute)?.strip_prefix('#')
}

fn numbers(text: &str) -> Result<Vec<f64>, String> {
    (text.split_ascii_whitespace())
        .map(|w| {
            w.parse()
                .map_err(|_| format!("not a number \"{}\"", w.chars().take(30).collect::<String>()))
        })
        .collect()
}

fn index_list(text: &str) -> Result<Vec<usize>, String> {
    (text.split_ascii_whitespace())
        .map(|w| {
            w.parse()
                .map_err(|_| format!("not an index \"{}\"", w.chars().take(30).collect::<String>()))
        })
        .collect()
}

impl<'a, 'i> DaeScene<'a, 'i> {
    fn new(root: Node<'a, 'i>, left: u64) -> Result<Self, String> {
        let mut by_id = HashMap::new();
        for node in root.descendants() {
            if let Some(id) = node.attribute("id") {
                by_id.entry(id).or_insert(node);
            }
        }
        let unit = match element(root, "asset")
            .and_then(|a| element(a, "unit"))
            .and_then(|u| u.attribute("meter"))
        {
            Some(text) => text
                .trim()
                .parse()
                .ok()
                .filter(|u: &f64| u.is_finite() && *u > 0.0)
                .ok_or_else(|| format!("the unit is no length \"{text}\""))?,
            None => 1.0,
        };
        Ok(Self { by_id, unit, soup: Soup::default(), n_visits: 0, left })
    }

    /// Counts bytes that are read again or kept, and refuses the file when the allowance is spent.
    fn spend(&mut self, n: usize) -> Result<(), String> {
        self.left = self.left.checked_sub(n as u64).ok_or(
            "it instantiates the same geometry so often that it exceeds its size by far; if the file is right, raise --set robot.max_mesh_growth",
        )?;
        Ok(())
    }

    /// The element with this id within a mesh, else anywhere in the file: real files use the same
    /// ids in each geometry.
    fn within(&self, mesh: Node<'a, 'i>, id: &str) -> Option<Node<'a, 'i>> {
        mesh.children()
            .find(|n| n.attribute("id") == Some(id))
            .or_else(|| self.by_id.get(id).copied())
    }

    /// The nodes of the scene that the file instantiates, else those of its first scene.
    fn roots(&self, root: Node<'a, 'i>) -> Vec<Node<'a, 'i>> {
        let shown = element(root, "scene")
            .and_then(|s| element(s, "instance_visual_scene"))
            .and_then(|s| self.by_id.get(local(s, "url")?).copied());
        let first =
            || element(root, "library_visual_scenes").and_then(|l| element(l, "visual_scene"));
        let Some(scene) = shown.or_else(first) else {
            return Vec::new();
        };
        scene.children().filter(|n| n.tag_name().name() == "node").collect()
    }

    fn all_geometries(&self, root: Node<'a, 'i>) -> Vec<Node<'a, 'i>> {
        root.descendants().filter(|n| n.tag_name().name() == "geometry").collect()
    }

    fn node(
        &mut self,
        node: Node<'a, 'i>,
        scene_from_parent: Matrix4<f64>,
        depth: usize,
    ) -> Result<(), String> {
        self.n_visits += 1;
        if depth > MAX_DEPTH || self.n_visits > MAX_VISITS {
            return Err("nodes are nested too deeply, or in a circle".to_owned());
        }
        let mut scene_from_node = scene_from_parent;
        for part in node.children().filter(Node::is_element) {
            if let Some(step) = transform(part)? {
                scene_from_node *= step;
            }
        }
        for part in node.children().filter(Node::is_element) {
            let target = || local(part, "url").and_then(|id| self.by_id.get(id).copied());
            match part.tag_name().name() {
                "node" => self.node(part, scene_from_node, depth + 1)?,
                "instance_node" => match target() {
                    Some(other) => self.node(other, scene_from_node, depth + 1)?,
                    None => self.soup.note("an instance of a node outside the file is ignored"),
                },
                "instance_geometry" => match target() {
                    Some(geometry) => self.geometry(geometry, &scene_from_node)?,
                    None => self.soup.note("an instance of a geometry outside the file is ignored"),
                },
                "instance_controller" => self.soup.note("a skinned geometry is ignored"),
                _ => {}
            }
        }
        Ok(())
    }

    fn geometry(
        &mut self,
        geometry: Node<'a, 'i>,
        scene_from_node: &Matrix4<f64>,
    ) -> Result<(), String> {
        let Some(mesh) = element(geometry, "mesh") else {
            self.soup.note("a geometry that is no mesh is ignored");
            return Ok(());
        };
        // A mirroring transform reverses the orientation of triangles, which is undone here.
        let mirrored = scene_from_node.fixed_view::<3, 3>(0, 0).determinant() < 0.0;
        let mut placed: Vec<(&str, usize, usize)> = Vec::new();
        for part in mesh.children().filter(Node::is_element) {
            self.spend(1)?;
            let tag = part.tag_name().name();
            match tag {
                "triangles" | "polylist" | "polygons" | "tristrips" | "trifans" => {}
                "lines" | "linestrips" => {
                    self.soup.note("lines are ignored");
                    continue;
                }
                _ => continue,
            }
            // Each of its sources is looked for among all children, so all of them count.
            self.spend(mesh.children().count() + part.children().count() + placed.len())?;
            let Some(layout) = self.layout(mesh, part)? else {
                continue;
            };
            let (first, n) = match placed.iter().find(|(id, ..)| *id == layout.source) {
                Some(&(_, first, n)) => (first, n),
                None => {
                    let (first, n) = self.positions(mesh, layout.source, scene_from_node)?;
                    placed.push((layout.source, first, n));
                    (first, n)
                }
            };
            let from = self.soup.triangles.len();
            self.faces(part, &layout, first, n)?;
            self.spend((self.soup.triangles.len() - from) * size_of::<[u32; 3]>())?;
            if mirrored {
                for t in &mut self.soup.triangles[from..] {
                    t.swap(1, 2);
                }
            }
        }
        Ok(())
    }

    /// Position of the index of a corner's vertex among the indices of one corner.
    fn layout(
        &self,
        mesh: Node<'a, 'i>,
        part: Node<'a, 'i>,
    ) -> Result<Option<DaeLayout<'a>>, String> {
        let mut stride = 0;
        let mut position = None;
        for input in part.children().filter(|n| n.tag_name().name() == "input") {
            let offset: usize = input
                .attribute("offset")
                .map_or(Ok(0), str::parse)
                .map_err(|_| "an input's offset is no number".to_owned())?;
            if offset > 255 {
                return Err("an input's offset is too large".to_owned());
            }
            stride = stride.max(offset + 1);
            let id = local(input, "source");
            match input.attribute("semantic") {
                Some("POSITION") => position = id.map(|id| (id, offset)),
                Some("VERTEX") => {
                    position = id
                        .and_then(|id| self.within(mesh, id))
                        .and_then(|v| {
                            v.children().find(|i| i.attribute("semantic") == Some("POSITION"))
                        })
                        .and_then(|i| local(i, "source"))
                        .map(|id| (id, offset));
                }
                _ => {}
            }
        }
        match position {
            Some((source, offset)) => Ok(Some(DaeLayout { source, offset, stride })),
            None if part.children().any(|n| n.tag_name().name() == "p") => {
                Err("triangles name no positions".to_owned())
            }
            None => Ok(None),
        }
    }

    /// Adds the positions of a source in the scene's frame and returns the index of the first one
    /// and their number.
    fn positions(
        &mut self,
        mesh: Node<'a, 'i>,
        id: &str,
        scene_from_node: &Matrix4<f64>,
    ) -> Result<(usize, usize), String> {
        let source =
            self.within(mesh, id).ok_or_else(|| format!("a source is missing \"{id}\""))?;
        let array = element(source, "float_array")
            .ok_or_else(|| format!("a source has no numbers \"{id}\""))?;
        let accessor = element(source, "technique_common").and_then(|t| element(t, "accessor"));
        let stride = accessor
            .and_then(|a| a.attribute("stride"))
            .map_or(Ok(3), str::parse::<usize>)
            .map_err(|_| "a stride is no number".to_owned())?;
        let offset = accessor
            .and_then(|a| a.attribute("offset"))
            .map_or(Ok(0), str::parse::<usize>)
            .map_err(|_| "an offset is no number".to_owned())?;
        if stride < 3 {
            return Err(format!("positions need three numbers each \"{stride}\""));
        }
        let text = all_text(array);
        self.spend(text.len())?;
        let values = numbers(&text)?;
        if let Some(claimed) = array.attribute("count").and_then(|c| c.parse::<usize>().ok())
            && claimed > values.len()
        {
            return Err(format!("a list claims {claimed} numbers and holds {}", values.len()));
        }
        let first = self.soup.vertices.len();
        for p in values.get(offset..).unwrap_or_default().chunks_exact(stride) {
            let p = scene_from_node.transform_point(&geometry::Point::new(p[0], p[1], p[2]));
            self.soup.add_vertex([p.x, p.y, p.z])?;
        }
        self.spend((self.soup.vertices.len() - first) * size_of::<[f64; 3]>())?;
        Ok((first, self.soup.vertices.len() - first))
    }

    /// The indices in the text of an element.
    fn indices(&mut self, list: Node<'a, 'i>) -> Result<Vec<usize>, String> {
        let text = all_text(list);
        self.spend(text.len())?;
        index_list(&text)
    }

    fn faces(
        &mut self,
        part: Node<'a, 'i>,
        layout: &DaeLayout,
        first: usize,
        n: usize,
    ) -> Result<(), String> {
        let tag = part.tag_name().name();
        let vcount = element(part, "vcount").filter(|_| tag == "polylist");
        let mut sizes = vcount.map(|list| self.indices(list)).transpose()?.map(Vec::into_iter);
        // A polygon with holes has its outline in <ph><p>.
        let lists = part.children().flat_map(|c| match c.tag_name().name() {
            "p" => Some(c),
            "ph" => element(c, "p"),
            _ => None,
        });
        for list in lists {
            let indices = self.indices(list)?;
            let mut corners = Vec::with_capacity(indices.len() / layout.stride);
            for corner in indices.chunks_exact(layout.stride) {
                let at = corner[layout.offset];
                if at >= n {
                    return Err(format!("a corner is not among the {n} positions \"{at}\""));
                }
                corners.push((first + at) as u32);
            }
            match (tag, &mut sizes) {
                ("polylist", Some(sizes)) => {
                    let mut rest = corners.as_slice();
                    for size in sizes.by_ref() {
                        if size > rest.len() {
                            return Err("a polygon has fewer corners than it counts".to_owned());
                        }
                        super::primitive::fan(&mut self.soup, &rest[..size])?;
                        rest = &rest[size..];
                    }
                }
                ("polygons" | "trifans", _) => super::primitive::fan(&mut self.soup, &corners)?,
                ("tristrips", _) => {
                    for (k, t) in corners.windows(3).enumerate() {
                        self.soup.add_triangle(if k % 2 == 0 {
                            [t[0], t[1], t[2]]
                        } else {
                            [t[1], t[0], t[2]]
                        })?;
                    }
                }
                _ => {
                    for t in corners.chunks_exact(3) {
                        self.soup.add_triangle([t[0], t[1], t[2]])?;
                    }
                }
            }
        }
        Ok(())
    }
}

struct DaeLayout<'a> {
    source: &'a str,
    offset: usize,
    stride: usize,
}

/// The whole text of an element, which comments may split into several pieces.
fn all_text(node: Node) -> String {
    node.children().filter(Node::is_text).filter_map(|n| n.text()).collect::<Vec<_>>().join(" ")
}

/// The matrix of a transform element; `None` for any other element.
fn transform(part: Node) -> Result<Option<Matrix4<f64>>, String> {
    let tag = part.tag_name().name();
    let n = match tag {
        "matrix" => 16,
        "rotate" => 4,
        "translate" | "scale" => 3,
        "lookat" | "skew" => return Err(format!("a transform that is not read \"{tag}\"")),
        _ => return Ok(None),
    };
    let v = numbers(&all_text(part))?;
    if v.len() != n || v.iter().any(|v| !v.is_finite()) {
        return Err(format!("<{tag}> needs {n} finite numbers"));
    }
    Ok(Some(match tag {
        "matrix" => Matrix4::from_row_slice(&v),
        "translate" => Matrix4::new_translation(&Vector3::new(v[0], v[1], v[2])),
        "scale" => Matrix4::new_nonuniform_scaling(&Vector3::new(v[0], v[1], v[2])),
        _ => match Unit::try_new(Vector3::new(v[0], v[1], v[2]), 1e-12) {
            Some(axis) => Rotation3::from_axis_angle(&axis, v[3].to_radians()).to_homogeneous(),
            None => Matrix4::identity(),
        },
    }))
}
