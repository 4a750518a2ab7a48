//! Writes a robot design (bodies, joints, loops) as the files of its library folder.

use crate::solid::Solid;
use std::fmt::Write;

/// A link with its body.
pub(super) struct DesignPart {
    pub(super) name: &'static str,
    pub(super) body: Option<Solid>,
}

/// A joint as in a URDF; a joint without `limits` is fixed.
#[derive(Clone)]
pub(super) struct Hinge {
    pub(super) name: &'static str,
    pub(super) kind: &'static str,
    pub(super) parent: &'static str,
    pub(super) child: &'static str,
    pub(super) xyz: [f64; 3],
    pub(super) rpy: [f64; 3],
    pub(super) axis: [f64; 3],
    pub(super) limits: Option<[f64; 2]>,
    pub(super) mimic: Option<(&'static str, f64)>,
}

impl Hinge {
    /// A joint that turns.
    pub(super) fn turn(
        name: &'static str,
        parent: &'static str,
        child: &'static str,
        xyz: [f64; 3],
        axis: [f64; 3],
        limits: [f64; 2],
    ) -> Self {
        let limits = Some(limits);
        Self {
            name,
            kind: "revolute",
            parent,
            child,
            xyz,
            rpy: [0.0; 3],
            axis,
            limits,
            mimic: None,
        }
    }

    /// A joint that slides.
    pub(super) fn slide(self) -> Self {
        Self { kind: "prismatic", ..self }
    }

    /// A joint that does not move.
    pub(super) fn fixed(
        name: &'static str,
        parent: &'static str,
        child: &'static str,
        xyz: [f64; 3],
    ) -> Self {
        let axis = [1.0, 0.0, 0.0];
        Self {
            name,
            kind: "fixed",
            parent,
            child,
            xyz,
            rpy: [0.0; 3],
            axis,
            limits: None,
            mimic: None,
        }
    }

    /// A joint that follows another.
    pub(super) fn following(self, joint: &'static str, multiplier: f64) -> Self {
        Self { mimic: Some((joint, multiplier)), ..self }
    }
}

/// A sub chain with a URDF of its own.
pub(super) struct DesignSubChain {
    /// Name of the sub chain; its file is `sub_<name>.urdf`.
    pub(super) name: &'static str,
    pub(super) kind: &'static str,
    /// Link of the main URDF to which it is attached.
    pub(super) root: &'static str,
    pub(super) parts: Vec<DesignPart>,
    pub(super) hinges: Vec<Hinge>,
    /// Link, point, link and point (metres) of the pin that closes the loop.
    pub(super) pin: (&'static str, [f64; 3], &'static str, [f64; 3]),
}

/// A whole robot.
pub(super) struct Design {
    pub(super) name: &'static str,
    pub(super) parts: Vec<DesignPart>,
    pub(super) hinges: Vec<Hinge>,
    pub(super) tip: &'static str,
    pub(super) sub_chains: Vec<DesignSubChain>,
    pub(super) effector: Option<&'static str>,
}

/// A path relative to the library's folder, and the content of the file.
pub type LibraryFile = (String, Vec<u8>);

impl Design {
    /// All files of the robot's folder.
    pub(super) fn files(&self) -> Vec<LibraryFile> {
        let mut out = Vec::new();
        let mut put =
            |path: &str, bytes: Vec<u8>| out.push((format!("{}/{path}", self.name), bytes));
        put("robot.urdf", urdf(self.name, None, &self.parts, &self.hinges).into_bytes());
        put("robot.toml", self.sheet().into_bytes());
        for sub in &self.sub_chains {
            let name = format!("{}_{}", self.name, sub.name);
            let text = urdf(&name, Some(sub.root), &sub.parts, &sub.hinges);
            put(&format!("sub_{}.urdf", sub.name), text.into_bytes());
        }
        for part in self.parts.iter().chain(self.sub_chains.iter().flat_map(|s| &s.parts)) {
            if let Some(body) = &part.body {
                put(&mesh_path(part.name), body.to_stl());
            }
        }
        out
    }

    fn sheet(&self) -> String {
        let mut t = format!(
            "# {}: what a URDF cannot say.\n\n[main_chain]\ntip = \"{}\"\n",
            self.name, self.tip
        );
        for s in &self.sub_chains {
            let passive: Vec<String> = s.hinges.iter().map(|h| format!("\"{}\"", h.name)).collect();
            let (a, xyz_a, b, xyz_b) = &s.pin;
            let _ = write!(
                t,
                "\n[[sub_chain]]\nname = \"{}\"\nurdf = \"sub_{}.urdf\"\nroot = \"{}\"\nkind = \"{}\"\npassive = [{}]\n\
                 closures = [{{ link_a = \"{a}\", xyz_a = {xyz_a:?}, link_b = \"{b}\", xyz_b = {xyz_b:?} }}]\n",
                s.name,
                s.name,
                s.root,
                s.kind,
                passive.join(", "),
            );
        }
        if let Some(root) = self.effector {
            let _ = write!(t, "\n[effector]\nroot = \"{root}\"\n");
        }
        t
    }
}

fn mesh_path(part: &str) -> String {
    format!("meshes/{part}.stl")
}

fn urdf(name: &str, root: Option<&str>, parts: &[DesignPart], hinges: &[Hinge]) -> String {
    let mut t = format!("<?xml version=\"1.0\"?>\n<robot name=\"{name}\">\n");
    if let Some(root) = root {
        let _ = writeln!(t, "  <link name=\"{root}\"/>");
    }
    for part in parts {
        let _ = match part.body {
            None => writeln!(t, "  <link name=\"{}\"/>", part.name),
            Some(_) => writeln!(
                t,
                "  <link name=\"{}\">\n    <visual>\n      <origin xyz=\"0 0 0\" rpy=\"0 0 0\"/>\n      \
                 <geometry>\n        <mesh filename=\"{}\"/>\n      </geometry>\n    </visual>\n  </link>",
                part.name,
                mesh_path(part.name)
            ),
        };
    }
    for h in hinges {
        let row = |v: [f64; 3]| format!("{} {} {}", v[0], v[1], v[2]);
        let _ = write!(
            t,
            "  <joint name=\"{}\" type=\"{}\">\n    <origin xyz=\"{}\" rpy=\"{}\"/>\n    <parent link=\"{}\"/>\n    \
             <child link=\"{}\"/>\n",
            h.name,
            h.kind,
            row(h.xyz),
            row(h.rpy),
            h.parent,
            h.child
        );
        if let Some([lower, upper]) = h.limits {
            let _ = write!(
                t,
                "    <axis xyz=\"{}\"/>\n    <limit lower=\"{lower}\" upper=\"{upper}\" effort=\"1000\" velocity=\"2\"/>\n",
                row(h.axis)
            );
        }
        if let Some((joint, multiplier)) = h.mimic {
            let _ = writeln!(
                t,
                "    <mimic joint=\"{joint}\" multiplier=\"{multiplier}\" offset=\"0\"/>"
            );
        }
        t.push_str("  </joint>\n");
    }
    t.push_str("</robot>\n");
    t
}
