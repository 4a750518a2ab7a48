//! Checks a scene and refuses the first error. Limits keep a typing error from exhausting memory.

use crate::scene::{Scanner, Scene};
use contract::{Error, Result};
use std::collections::BTreeSet;

/// Largest coordinate inside a scene, metres; beyond it, triangles in single precision are coarser
/// than 0.1 mm.
const MAX_COORDINATE: f64 = 1000.0;
/// Largest difference between true and stated poses, metres; stated ones may be map coordinates.
const MAX_STATED: f64 = 1e8;
/// Largest number of rows or columns of one scanner.
const MAX_SIDE: u32 = 1 << 16;
/// Longest fence, metres; each metre has 60 wires.
const MAX_FENCE: f64 = 500.0;

fn finite(what: &str, place: &str, values: &[f64], low: f64, high: f64) -> Result<()> {
    match values.iter().find(|v| !(**v >= low && **v <= high)) {
        None => Ok(()),
        Some(v) => {
            Err(Error::bad_input(format!("{what} must be between {low} and {high}: \"{v}\""))
                .at(place))
        }
    }
}

impl Scene {
    /// Reads a scene file's text.
    ///
    /// # Errors
    /// `BadInput` where the text is no scene: unknown names, missing values, numbers out of range.
    pub fn from_toml(text: &str) -> Result<Self> {
        let scene: Self = toml::from_str(text).map_err(|e| {
            Error::bad_input("scene cannot be read")
                .because(e)
                .hint("the keys of a scene file are listed in stages/simulate/README.md")
        })?;
        check(&scene)?;
        Ok(scene)
    }
}

/// Refuses numbers out of range and references to names that do not exist.
///
/// # Errors
/// `BadInput` at the first thing that is wrong.
pub(crate) fn check(scene: &Scene) -> Result<()> {
    hall(scene)?;
    bodies(scene)?;
    robots(scene)?;
    let mut names = BTreeSet::new();
    for (i, s) in scene.scanners.iter().enumerate() {
        let place = format!("scanner {} \"{}\"", i + 1, s.name);
        scanner(s, &place)?;
        if !names.insert(&s.name) {
            return Err(Error::bad_input("two scanners have the same name").at(place));
        }
    }
    Ok(())
}

fn hall(scene: &Scene) -> Result<()> {
    if let Some(hall) = &scene.hall {
        finite("size", "hall", &hall.size, 0.5, MAX_COORDINATE)?;
    }
    if let Some(floor) = &scene.floor {
        finite("size", "floor", &floor.size.unwrap_or([1.0; 2]), 0.5, 2.0 * MAX_COORDINATE)?;
        finite("tilt", "floor", &floor.tilt_deg, -20.0, 20.0)?;
        finite("wave amplitude", "floor", &[floor.wave_amplitude], 0.0, 1.0)?;
        finite("wave length", "floor", &[floor.wave_length], 0.5, 1e6)?;
        for level in &floor.levels {
            finite(
                "corner",
                "floor level",
                &[level.min, level.max].concat(),
                -MAX_COORDINATE,
                MAX_COORDINATE,
            )?;
            finite("height", "floor level", &[level.height], 0.001, 50.0)?;
            if level.min[0] >= level.max[0] || level.min[1] >= level.max[1] {
                return Err(
                    Error::bad_input("smallest corner is not below the largest").at("floor level")
                );
            }
        }
    }
    finite("coordinate", "origin", &scene.origin, -1e9, 1e9)
}

fn bodies(scene: &Scene) -> Result<()> {
    let at = |what: &str, name: &str| format!("{what} \"{name}\"");
    let place = |what: &str, name: &str, xyz: &[f64], size: &[f64]| -> Result<()> {
        finite("place", &at(what, name), xyz, -MAX_COORDINATE, MAX_COORDINATE)?;
        finite("size", &at(what, name), size, 1e-4, MAX_COORDINATE)
    };
    for b in &scene.boxes {
        place("box", &b.name, &b.xyz, &b.size)?;
        finite("turn", &at("box", &b.name), &b.rpy_deg, -360.0, 360.0)?;
        finite("reflectance", &at("box", &b.name), &[b.reflectance], 0.0, 1.0)?;
    }
    for c in &scene.columns {
        place("column", &c.name, &c.xy, &[c.radius, c.height])?;
    }
    for f in &scene.fences {
        let length = (f.to[0] - f.from[0]).hypot(f.to[1] - f.from[1]);
        place("fence", &f.name, &[f.from, f.to].concat(), &[f.height])?;
        finite("length", &at("fence", &f.name), &[length], 0.1, MAX_FENCE)?;
        finite("height", &at("fence", &f.name), &[f.height], 0.1, 10.0)?;
    }
    for (what, f) in scene
        .conveyors
        .iter()
        .map(|f| ("conveyor", f))
        .chain(scene.benches.iter().map(|f| ("bench", f)))
    {
        place(what, &f.name, &f.xy, &f.size)?;
        finite("size", &at(what, &f.name), &f.size, 0.1, 200.0)?;
        finite("turn", &at(what, &f.name), &[f.yaw_deg], -360.0, 360.0)?;
    }
    for s in &scene.stands {
        place("stand", &s.name, &s.xy, &[s.side])?;
        finite("top", &at("stand", &s.name), &[s.top, s.yaw_deg], -360.0, 360.0)?;
    }
    for h in &scene.hoses {
        if h.anchors.len() < 2 || h.anchors.len() > 1000 {
            return Err(Error::bad_input(format!(
                "a hose needs 2 to 1000 anchors: \"{}\"",
                h.anchors.len()
            ))
            .at(at("hose", &h.name)));
        }
        finite("radius", &at("hose", &h.name), &[h.radius], 0.001, 1.0)?;
        finite("sag", &at("hose", &h.name), &[h.sag], -2.0, 2.0)?;
        for a in &h.anchors {
            finite("anchor", &at("hose", &h.name), &a.xyz, -MAX_COORDINATE, MAX_COORDINATE)?;
        }
    }
    for c in &scene.carried {
        place("carried", &c.name, &c.xyz, &c.size)?;
    }
    Ok(())
}

fn robots(scene: &Scene) -> Result<()> {
    let mut names = BTreeSet::new();
    for r in &scene.robots {
        let at = format!("robot \"{}\"", r.name);
        finite("place", &at, &r.xyz, -MAX_COORDINATE, MAX_COORDINATE)?;
        finite("turn", &at, &r.rpy_deg, -360.0, 360.0)?;
        for (joint, value) in &r.posture {
            finite("value", &format!("{at}, joint \"{joint}\""), &[*value], -1000.0, 1000.0)?;
        }
        for then in &r.later {
            let known = |s: &&String| scene.scanners.iter().any(|k| k.name == **s);
            if let Some(odd) = then.scanners.iter().find(|s| !known(s)) {
                return Err(Error::bad_input(format!("no scanner has this name: \"{odd}\"")).at(at));
            }
            for (joint, value) in &then.posture {
                finite("value", &format!("{at}, joint \"{joint}\""), &[*value], -1000.0, 1000.0)?;
            }
        }
        if let Some(tool) = &r.tool {
            finite("tool length", &at, &[tool.length], 0.01, 5.0)?;
        }
        if !names.insert(r.name.as_str()) {
            return Err(Error::bad_input("two robots have the same name").at(at));
        }
    }
    let used =
        scene.carried.iter().map(|c| &c.robot).chain(
            scene.hoses.iter().flat_map(|h| h.anchors.iter().filter_map(|a| a.robot.as_ref())),
        );
    for name in used {
        if !names.contains(name.as_str()) {
            return Err(Error::bad_input(format!("no robot has this name: \"{name}\"")).at("scene"));
        }
    }
    Ok(())
}

fn scanner(s: &Scanner, place: &str) -> Result<()> {
    let r = &s.raster;
    finite("position", place, &s.position, -MAX_COORDINATE, MAX_COORDINATE)?;
    finite("turn", place, &s.rpy_deg, -360.0, 360.0)?;
    finite("elevation", place, &r.elevation_deg, -90.0, 90.0)?;
    finite("azimuth", place, &r.azimuth_deg, -360.0, 360.0)?;
    finite("step", place, &[r.step_deg], 0.001, 90.0)?;
    finite("range", place, &[s.min_range, s.max_range], 0.0, 10_000.0)?;
    finite("noise", place, &[s.noise, s.noise_per_metre, s.jitter], 0.0, 1.0)?;
    finite("share", place, &[s.dropouts, s.dark_dropouts], 0.0, 1.0)?;
    finite("bias", place, &[s.range_bias], -10.0, 10.0)?;
    finite("registration", place, &s.registration.xyz, -MAX_STATED, MAX_STATED)?;
    finite("registration", place, &s.registration.rpy_deg, -360.0, 360.0)?;
    if let Some(m) = &s.mixed {
        finite("sub-beams", place, &[f64::from(m.sub_beams)], 1.0, 64.0)?;
        finite("beam", place, &[m.radius, m.divergence, m.depth], 0.0, 10.0)?;
    }
    let width = r.azimuth_deg[1] - r.azimuth_deg[0];
    if r.elevation_deg[0] >= r.elevation_deg[1] || width <= 0.0 || width > 360.0 {
        return Err(
            Error::bad_input("elevation and azimuth must grow, by a turn at most").at(place)
        );
    }
    if r.n_beams == Some(0) || r.n_rows() > MAX_SIDE || r.n_cols() > MAX_SIDE {
        return Err(Error::bad_input(format!(
            "a raster holds at most {MAX_SIDE} rows and columns: \"{} x {}\"",
            r.n_rows(),
            r.n_cols()
        ))
        .at(place));
    }
    s.world_from_scan().map(|_| ())
}
