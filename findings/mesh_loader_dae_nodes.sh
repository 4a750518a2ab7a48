#!/usr/bin/env bash
# mesh-loader (Rust, of urdf-viz) scales the corners of a COLLADA mesh by `<unit>`, but not where its node is; by
# `instance_node` neither the place nor the unit is applied.
#
# Expected: a triangle of 10 inches whose node is moved by 100 inches has corners at 2.54 and 2.794 m, whether the scene
#   names its geometry in a node of its own or through `instance_node`; or all lengths stay as the file has them.
# Seen (2026-11-29, Linux, mesh-loader 0.1.13): own node: 100 and 100.254, the place in inches and the triangle in metres.
#   `instance_node`: 0 and 10, in inches, without the node's place. Without a unit the second is wrong, too (0 and 10
#   instead of 100 and 110). Nothing is reported. A robot of several parts falls apart or grows by 39.37.
# Exits with 1 where that changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
mkdir src
cat > Cargo.toml <<'TOML'
[package]
name = "probe"
version = "0.0.0"
edition = "2021"

[dependencies]
mesh-loader = { version = "=0.1.13", default-features = false, features = ["collada"] }
TOML
cat > src/main.rs <<'RUST'
const MESH: &str = r##"<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count="9">0 0 0 10 0 0 0 10 0</float_array><technique_common>
<accessor source="#pa" count="3" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles>
</mesh></geometry></library_geometries>"##;
const CONTENT: &str = r##"<matrix>1 0 0 100 0 1 0 0 0 0 1 0 0 0 0 1</matrix><instance_geometry url="#g"/>"##;

fn xs(unit: &str, scene: &str) -> Vec<f32> {
    let text = format!(
        r##"<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset>{unit}<up_axis>Z_UP</up_axis></asset>{MESH}{scene}<scene><instance_visual_scene url="#s"/></scene></COLLADA>"##
    );
    let scene = mesh_loader::Loader::default().load_from_slice(text.as_bytes(), "part.dae").expect("is read");
    scene.meshes[0].vertices[..2].iter().map(|v| v[0]).collect()
}

fn main() {
    let visual = |inner: &str| {
        format!("<library_visual_scenes><visual_scene id=\"s\"><node id=\"n\">{inner}</node></visual_scene></library_visual_scenes>")
    };
    let own = visual(CONTENT);
    let shared = format!("<library_nodes><node id=\"l\">{CONTENT}</node></library_nodes>{}", visual("<instance_node url=\"#l\"/>"));
    let inch = "<unit name=\"inch\" meter=\"0.0254\"/>";
    let seen = [xs("", &own), xs("", &shared), xs(inch, &own), xs(inch, &shared)];
    println!("x of two corners, no unit: own node {:?}, instance_node {:?}; inches: {:?}, {:?}", seen[0], seen[1], seen[2], seen[3]);
    assert_eq!(seen, [vec![100.0, 110.0], vec![0.0, 10.0], vec![100.0, 100.254], vec![0.0, 10.0]]);
}
RUST
CARGO_TARGET_DIR="$folder/target" cargo run -q
