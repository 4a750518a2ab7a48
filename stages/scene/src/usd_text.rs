//! Text of USD: one statement a line, blocks in braces.

use crate::output::linear;
use crate::text::{num, nums};
use contract::quote;
use geometry::{Pose, Vector};
use nalgebra::UnitQuaternion;
use robot::Mesh;
use std::fmt::Write as _;

/// Writes a layer.
pub(crate) struct UsdText {
    text: String,
    depth: usize,
}

/// A string of USD, in double quotes.
pub(crate) fn string(text: &str) -> String {
    let shown = quote::shown(text);
    format!("\"{}\"", shown.replace('\\', "\\\\").replace('"', "\\\""))
}

/// Three numbers in brackets.
pub(crate) fn point(p: &Vector) -> String {
    format!("({})", nums(p.as_slice(), ", "))
}

/// A quaternion in brackets: w first.
pub(crate) fn quaternion(q: &UnitQuaternion<f64>) -> String {
    format!("({})", nums(&[q.w, q.i, q.j, q.k], ", "))
}

const HEAD: &str = "#usda 1.0\n(\n    defaultPrim = \"World\"\n    kilogramsPerUnit = 1\n    \
                    metersPerUnit = 1\n    upAxis = \"Z\"\n";

impl UsdText {
    /// A stage with its prim `World`, metres, kilograms, z up.
    pub(crate) fn stage(name: &str) -> Self {
        let text = format!("{HEAD}    doc = {}\n)\n\n", string(name));
        Self { text, depth: 0 }
    }

    /// Writes lines at the present depth.
    pub(crate) fn line(&mut self, lines: &str) {
        for line in lines.lines() {
            let _ = writeln!(self.text, "{:1$}{line}", "", 4 * self.depth);
        }
    }

    /// Begins a block.
    pub(crate) fn open(&mut self, head: &str) {
        self.line(head);
        self.line("{");
        self.depth += 1;
    }

    /// Ends a block.
    pub(crate) fn close(&mut self) {
        self.depth = self.depth.saturating_sub(1);
        self.line("}");
    }

    /// Where the prim stands in its parent.
    pub(crate) fn place(&mut self, pose: &Pose) {
        let (p, q) = (point(&pose.translation.vector), quaternion(&pose.rotation));
        self.line(&format!("double3 xformOp:translate = {p}"));
        self.line(&format!("quatd xformOp:orient = {q}"));
        self.line("uniform token[] xformOpOrder = [\"xformOp:translate\", \"xformOp:orient\"]");
    }

    /// A text of our own, such as the name in the library.
    pub(crate) fn custom_text(&mut self, name: &str, value: &str) {
        self.line(&format!("custom string stillpoint:{name} = {}", string(value)));
    }

    pub(crate) fn finish(mut self) -> Vec<u8> {
        while self.depth > 0 {
            self.close();
        }
        self.text.into_bytes()
    }
}

/// A layer with one mesh that is seen and collides; `approximation` says as what.
pub(crate) fn mesh_file(mesh: &Mesh, color: [f64; 4], approximation: &str) -> Vec<u8> {
    let head = HEAD.replace("World", "Body");
    let mut text = UsdText { text: format!("{head})\n\n"), depth: 0 };
    text.open("def Xform \"Body\"");
    text.open(
        "def Mesh \"mesh\" (\n    prepend apiSchemas = [\"PhysicsCollisionAPI\", \"PhysicsMeshCollisionAPI\"]\n)",
    );
    let ends = |pick: fn(f32, f32) -> f32, start: f32| {
        let all = mesh
            .vertices
            .iter()
            .fold([start; 3], |most, v| std::array::from_fn(|i| pick(most[i], v[i])));
        let [x, y, z] = all.map(|v| if v.is_finite() { v } else { 0.0 });
        format!("({x}, {y}, {z})")
    };
    let (low, high) = (ends(f32::min, f32::INFINITY), ends(f32::max, f32::NEG_INFINITY));
    text.line(&format!("float3[] extent = [{low}, {high}]"));
    let counts = vec!["3"; mesh.triangles.len()].join(", ");
    text.line(&format!("int[] faceVertexCounts = [{counts}]"));
    let of = |t: &[u32; 3]| format!("{}, {}, {}", t[0], t[1], t[2]);
    let indices: Vec<String> = mesh.triangles.iter().map(of).collect();
    text.line(&format!("int[] faceVertexIndices = [{}]", indices.join(", ")));
    let of = |v: &[f32; 3]| format!("({}, {}, {})", v[0], v[1], v[2]);
    let points: Vec<String> = mesh.vertices.iter().map(of).collect();
    text.line(&format!("point3f[] points = [{}]", points.join(", ")));
    text.line("uniform token subdivisionScheme = \"none\"");
    text.line(&format!("uniform token physics:approximation = \"{approximation}\""));
    let [r, g, b, a] = linear(color);
    text.line(&format!("color3f[] primvars:displayColor = [({})]", nums(&[r, g, b], ", ")));
    text.line(&format!("float[] primvars:displayOpacity = [{}]", num(a)));
    text.finish()
}
