//! The triangles of a scene with their labels, ready for ray casting.

use crate::scene::{Anchor, RobotPlace, Scene, pose};
use crate::solid::{Solid, cuboid};
use crate::{attach, hall};
use contract::{Error, Label, PointKind, Result};
use geometry::{Point, Pose};
use glam::Vec3A;
use robot::{Mesh, Model, Role};

/// The properties that all triangles of one body share.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct BodySurface {
    /// Label of points on it.
    pub(crate) label: Label,
    /// Index of its object in [`SceneTriangles::objects`].
    pub(crate) object: u16,
    /// Share of light that it reflects, 0..1.
    pub(crate) reflectance: f32,
    /// Whether it is thinner than the distance of beams, so that a beam may touch it where its
    /// neighbours do not.
    pub(crate) is_thin: bool,
    /// Index of the link that holds an attachment rigidly; −1 for all others, and for hoses.
    pub(crate) holder: i16,
}

/// A robot of the scene with the poses of its links.
#[derive(Debug, Clone)]
pub(crate) struct PlacedRobot {
    /// Index of its model.
    pub(crate) model: usize,
    /// Value of each free joint, radians or metres.
    pub(crate) posture: Vec<f64>,
    /// Pose of each link in the world without the scene's origin, metres.
    pub(crate) world_from_link: Vec<Pose>,
}

/// Triangles in scene coordinates, each with the index of its surface.
#[derive(Debug, Default)]
pub(crate) struct SceneTriangles {
    pub(crate) triangles: Vec<[Vec3A; 3]>,
    pub(crate) surface_of: Vec<u32>,
    pub(crate) surfaces: Vec<BodySurface>,
    /// Names of the objects of the scene.
    pub(crate) objects: Vec<String>,
    pub(crate) robots: Vec<PlacedRobot>,
}

/// Reflectance of painted steel and concrete.
const GREY: f32 = 0.5;
/// Reflectance of black rubber.
const BLACK: f32 = 0.06;
/// Reflectance of robot paint.
const PAINT: f32 = 0.7;

impl SceneTriangles {
    pub(crate) fn new(scene: &Scene, models: &[Model]) -> Result<Self> {
        let mut out = Self::default();
        out.add_hall(scene);
        for (index, place) in scene.robots.iter().enumerate() {
            out.add_robot(index, place, models)
                .map_err(|e| e.at(format!("robot \"{}\"", place.name)))?;
        }
        out.add_attachments(scene, models)?;
        Ok(out)
    }

    /// Begins an object: all bodies that are added afterwards belong to it.
    fn object(&mut self, kind: &str, name: &str) -> u16 {
        let words = [kind, name].into_iter().filter(|w| !w.is_empty());
        self.objects.push(words.collect::<Vec<_>>().join(" "));
        // Objects beyond the largest index share it.
        u16::try_from(self.objects.len() - 1).unwrap_or(u16::MAX)
    }

    fn add(&mut self, surface: BodySurface, solid: &Solid) {
        self.add_mesh(surface, &solid.vertices, &solid.triangles);
    }

    fn add_mesh(&mut self, surface: BodySurface, vertices: &[Point], triangles: &[[u32; 3]]) {
        let at = self.surfaces.len() as u32;
        self.surfaces.push(surface);
        for t in triangles {
            let corners = t.map(|i| vertices[i as usize]);
            let triangle = corners.map(|p| Vec3A::new(p.x as f32, p.y as f32, p.z as f32));
            // Triangles without area have no plane.
            if (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]).length_squared() > 0.0 {
                self.triangles.push(triangle);
                self.surface_of.push(at);
            }
        }
    }

    fn add_hall(&mut self, scene: &Scene) {
        let object = self.object("floor", "");
        let fixed = BodySurface {
            label: Label::FIXED,
            object,
            reflectance: GREY,
            is_thin: false,
            holder: -1,
        };
        let (ground, faces) = hall::ground(scene);
        let lowest = ground.vertices.iter().map(|p| p.z).fold(0.0, f64::min);
        self.add(BodySurface { label: Label::FLOOR, ..fixed }, &ground);
        self.add(fixed, &faces);
        if let Some(building) = &scene.hall {
            let object = self.object("building", "");
            let surface = BodySurface { object, reflectance: 0.8, ..fixed };
            self.add(surface, &hall::building(building, lowest));
        }
        for b in &scene.boxes {
            let object = self.object("box", &b.name);
            let surface = BodySurface { object, reflectance: b.reflectance as f32, ..fixed };
            self.add(surface, &cuboid(b.size, 0.002).posed(&pose(b.xyz, b.rpy_deg)));
        }
        let z = |xy: [f64; 2]| scene.ground(xy[0], xy[1]);
        for c in &scene.columns {
            let object = self.object("column", &c.name);
            self.add(BodySurface { object, ..fixed }, &hall::column(c, z(c.xy)));
        }
        for f in &scene.fences {
            let (posts, wires) = hall::fence(f, |x, y| scene.ground(x, y));
            let object = self.object("fence", &f.name);
            self.add(BodySurface { object, ..fixed }, &posts);
            self.add(BodySurface { object, is_thin: true, ..fixed }, &wires);
        }
        for f in &scene.conveyors {
            let object = self.object("conveyor", &f.name);
            self.add(BodySurface { object, ..fixed }, &hall::conveyor(f, z(f.xy)));
        }
        for f in &scene.benches {
            let object = self.object("bench", &f.name);
            self.add(BodySurface { object, ..fixed }, &hall::bench(f, z(f.xy)));
        }
        for s in &scene.stands {
            let object = self.object("stand", &s.name);
            self.add(BodySurface { object, ..fixed }, &hall::stand(s, z(s.xy)));
        }
    }

    fn add_robot(&mut self, index: usize, place: &RobotPlace, models: &[Model]) -> Result<()> {
        let at = models.iter().position(|m| m.name == place.model).ok_or_else(|| {
            Error::bad_input(format!("no model of the library has this name: \"{}\"", place.model))
        })?;
        let model = &models[at];
        let posture = posture_of(place, model)?;
        let world_from_base = place.world_from_base();
        let poses: Vec<Pose> = model.poses(&posture).iter().map(|p| world_from_base * p).collect();
        let object = self.object("robot", &place.name);
        for (link, part) in model.links.iter().enumerate() {
            let kind =
                if part.role == Role::Effector { PointKind::Attachment } else { PointKind::Link };
            let label = Label { kind, robot: index_i16(index)?, link: index_i16(link)? };
            let vertices = place_mesh(&part.mesh, &poses[link]);
            let surface =
                BodySurface { label, object, reflectance: PAINT, is_thin: false, holder: -1 };
            self.add_mesh(surface, &vertices, &part.mesh.triangles);
        }
        self.robots.push(PlacedRobot { model: at, posture, world_from_link: poses });
        Ok(())
    }

    fn add_attachments(&mut self, scene: &Scene, models: &[Model]) -> Result<()> {
        for (index, place) in scene.robots.iter().enumerate() {
            if let Some(tool) = &place.tool {
                let link = self.link_pose(scene, models, &place.name, Some(&tool.link))?;
                let body = attach::tool(tool).posed(&(link * pose(tool.xyz, tool.rpy_deg)));
                let object = self.object("tool of", &place.name);
                let holder = self.holder(models, index, &tool.link)?;
                self.add(BodySurface { holder, ..attachment(index, object, GREY)? }, &body);
            }
        }
        for part in &scene.carried {
            let link = self.link_pose(scene, models, &part.robot, Some(&part.link))?;
            let index = robot_index(scene, &part.robot)?;
            let body = cuboid(part.size, 0.002).posed(&(link * pose(part.xyz, part.rpy_deg)));
            let object = self.object("carried", &part.name);
            let holder = self.holder(models, index, &part.link)?;
            self.add(BodySurface { holder, ..attachment(index, object, GREY)? }, &body);
        }
        for hose in &scene.hoses {
            let held = hose
                .anchors
                .iter()
                .map(|a| self.anchor(scene, models, a))
                .collect::<Result<Vec<_>>>();
            let held = held.map_err(|e| e.at(format!("hose \"{}\"", hose.name)))?;
            // A hose that is held only by links that no joint moves stands still.
            let moves: Vec<bool> =
                hose.anchors.iter().map(|a| self.is_moving(scene, models, a)).collect();
            let owner = hose.anchors.iter().zip(&moves).find(|(_, moves)| **moves);
            let owner = owner.and_then(|(anchor, _)| anchor.robot.as_ref());
            for (moves, body) in attach::hose(hose, &held, &moves) {
                let surface = match owner.filter(|_| moves) {
                    Some(name) => {
                        let object = self.object("hose", &hose.name);
                        attachment(robot_index(scene, name)?, object, BLACK)?
                    }
                    None => BodySurface {
                        label: Label::FIXED,
                        object: self.object("line", &hose.name),
                        reflectance: BLACK,
                        is_thin: false,
                        holder: -1,
                    },
                };
                self.add(surface, &body);
            }
        }
        Ok(())
    }

    /// Index of the link of a robot of the scene that holds something, by its name.
    fn holder(&self, models: &[Model], robot: usize, link: &str) -> Result<i16> {
        let links = &models[self.robots[robot].model].links;
        index_i16(links.iter().position(|l| l.name == link).unwrap_or(0))
    }

    fn anchor(&self, scene: &Scene, models: &[Model], anchor: &Anchor) -> Result<Point> {
        let xyz = Point::from(anchor.xyz);
        match &anchor.robot {
            None => Ok(xyz),
            Some(robot) => Ok(self.link_pose(scene, models, robot, anchor.link.as_deref())? * xyz),
        }
    }

    /// Whether an anchor is on a link that a joint moves.
    fn is_moving(&self, scene: &Scene, models: &[Model], anchor: &Anchor) -> bool {
        let index = anchor.robot.as_ref().and_then(|name| robot_index(scene, name).ok());
        let on = index.zip(anchor.link.as_ref());
        on.is_some_and(|(robot, name)| {
            let model = &models[self.robots[robot].model];
            let link = model.links.iter().position(|link| link.name == *name);
            link.is_some_and(|link| model.moving()[link])
        })
    }

    fn link_pose(
        &self,
        scene: &Scene,
        models: &[Model],
        robot: &str,
        link: Option<&str>,
    ) -> Result<Pose> {
        let placed = &self.robots[robot_index(scene, robot)?];
        let model = &models[placed.model];
        let Some(link) = link else {
            return Ok(placed.world_from_link[0]);
        };
        let at = model.links.iter().position(|l| l.name == link).ok_or_else(|| {
            let names: Vec<&str> = model.links.iter().map(|l| l.name.as_str()).collect();
            Error::bad_input(format!("model \"{}\" has no such link: \"{link}\"", model.name))
                .at(format!("robot \"{robot}\""))
                .hint(format!("its links are {}", names.join(", ")))
        })?;
        Ok(placed.world_from_link[at])
    }
}

fn attachment(robot: usize, object: u16, reflectance: f32) -> Result<BodySurface> {
    let label = Label { kind: PointKind::Attachment, robot: index_i16(robot)?, link: -1 };
    Ok(BodySurface { label, object, reflectance, is_thin: false, holder: -1 })
}

fn index_i16(index: usize) -> Result<i16> {
    i16::try_from(index).map_err(|_| {
        Error::new(contract::Kind::Unsupported, format!("labels count to 32767: \"{index}\""))
    })
}

fn robot_index(scene: &Scene, name: &str) -> Result<usize> {
    scene
        .robots
        .iter()
        .position(|r| r.name == name)
        .ok_or_else(|| Error::bad_input(format!("no robot has this name: \"{name}\"")))
}

fn place_mesh(mesh: &Mesh, pose: &Pose) -> Vec<Point> {
    mesh.vertices.iter().map(|v| pose * Point::new(v[0].into(), v[1].into(), v[2].into())).collect()
}

/// The posture of a robot of the scene: named values, and the model's home for the rest.
///
/// # Errors
/// `BadInput` for a name that is no free joint of the model.
pub(crate) fn posture_of(place: &RobotPlace, model: &Model) -> Result<Vec<f64>> {
    let mut posture = model.home();
    for (name, value) in &place.posture {
        let free =
            model.free.iter().position(|&j| model.joints[j].name == *name).ok_or_else(|| {
                let names: Vec<&str> =
                    model.free.iter().map(|&j| model.joints[j].name.as_str()).collect();
                Error::bad_input(format!(
                    "model \"{}\" has no such free joint: \"{name}\"",
                    model.name
                ))
                .hint(format!("its free joints are {}", names.join(", ")))
            })?;
        posture[free] = *value;
    }
    Ok(posture)
}
