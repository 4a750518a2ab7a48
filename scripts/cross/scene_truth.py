"""What scenes are compared with: places of links from result.json or from the example that writes a library's scenes, limits from
the URDFs of the library as they are written there. Nothing here knows how Stillpoint writes a scene."""

import csv
import json
import tomllib
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np


def pose(entry):
    """A 4 by 4 matrix of `xyz` and `quat_wxyz`."""
    w, x, y, z = entry["quat_wxyz"]
    out = np.eye(4)
    out[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    out[:3, 3] = entry["xyz"]
    return out


def apart(a, b):
    """Distance in metres and turn in radians between two poses."""
    off = np.linalg.inv(a) @ b
    sine = np.linalg.norm([off[2, 1] - off[1, 2], off[0, 2] - off[2, 0], off[1, 0] - off[0, 1]]) / 2
    return float(np.linalg.norm(off[:3, 3])), float(np.arctan2(sine, (np.trace(off[:3, :3]) - 1) / 2))


def number(element, name):
    return float(element.get(name)) if element is not None and element.get(name) else None


def library_joints(folder):
    """Moving joints of a model: type, limits, effort, velocity, and whether another joint or a loop moves them."""
    sheet = tomllib.loads((folder / "robot.toml").read_text()) if (folder / "robot.toml").is_file() else {}
    subs = sheet.get("sub_chain", [])
    main = folder / sheet.get("urdf", "robot.urdf")
    if not main.is_file():
        main = next(folder.glob("*.urdf"))
    passive, out = set(), {}
    for sub in subs:
        passive.update(sub.get("passive", []))
    for path in [main] + [folder / sub["urdf"] for sub in subs if "urdf" in sub]:
        for joint in ET.parse(path).getroot().findall("joint"):
            if joint.get("type") == "fixed":
                continue
            limit = joint.find("limit")
            if path != main:
                passive.add(joint.get("name"))
            low, high = number(limit, "lower"), number(limit, "upper")
            if limit is not None and joint.get("type") != "continuous":
                low, high = low or 0.0, high or 0.0
            is_open = joint.get("type") == "continuous" or limit is None
            out[joint.get("name")] = {
                "type": joint.get("type"),
                "limits": None if is_open else (low, high),
                "effort": number(limit, "effort") or None,
                "velocity": number(limit, "velocity") or None,
                "follows": joint.find("mimic") is not None,
            }
    for name in passive & set(out):
        out[name]["follows"] = True
    return out


def turned(origin):
    """A 4 by 4 matrix of an `<origin>`."""
    xyz, rpy = ([float(v) for v in ((origin.get(k) if origin is not None else None) or "0 0 0").split()] for k in ("xyz", "rpy"))
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    out = np.eye(4)
    out[:3, :3] = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    out[:3, 3] = xyz
    return out


def library_shapes(folder):
    """Triangles (n by 3 corners by 3) of each link in its frame as the URDF says, for links of which all visuals are STL
    meshes or boxes, read by trimesh."""
    import trimesh

    out = {}
    for link in ET.parse(next(iter(sorted(folder.glob("robot.urdf"))))).getroot().findall("link"):
        parts = []
        for visual in link.findall("visual"):
            mesh, box = visual.find("geometry/mesh"), visual.find("geometry/box")
            if box is not None:
                own = trimesh.creation.box([float(v) for v in box.get("size").split()]).triangles
            elif mesh is not None and mesh.get("filename").lower().endswith(".stl") and "://" not in mesh.get("filename"):
                scale = [float(v) for v in (mesh.get("scale") or "1 1 1").split()]
                own = trimesh.load(folder / mesh.get("filename"), force="mesh", process=False).triangles * scale
                if np.prod(scale) < 0:
                    own = own[:, ::-1]
            else:
                break
            at = turned(visual.find("origin"))
            parts.append(own @ at[:3, :3].T + at[:3, 3])
        else:
            if parts:
                out[link.get("name")] = np.concatenate(parts)
    return out


class Robot:
    """A robot as it must stand."""

    def __init__(self, entry, values, library):
        self.id, self.model = entry["id"], entry["model"]
        self.links = {name: pose(at) for name, at in entry["link_poses"].items()}
        self.values = values
        self.joints = library_joints(library / self.model)
        self.folder = library / self.model
        tool = entry.get("tool") if isinstance(entry.get("tool"), str) else (entry.get("tool") or {}).get("model")
        for name, joint in library_joints(library / tool).items() if tool else ():
            self.joints[f"{tool}/{name}" if name in self.joints else name] = joint


def of_result(out, library):
    """The robots of a result that are reported."""
    result = json.loads((out / "result.json").read_text())
    reported = [r for r in result["robots"] if r["verdict"] != "refused"]
    return [Robot(r, r["joints"] | r["passive"], library) for r in reported]


def of_library(truth, library):
    """The robots of the example that writes a library's scenes."""
    return [Robot(r, r["values"], library) for r in json.loads(truth.read_text())["robots"]]


class Names:
    """What links and joints are called in a format, from its names.csv."""

    def __init__(self, path):
        with Path(path).open(newline="") as file:
            rows = list(csv.DictReader(file))
        self.all = {(r["robot"], r["kind"], r["name"].removeprefix("'")): r["written"].removeprefix("'") for r in rows}

    def link(self, robot, name):
        return self.all[robot, "link", name]

    def joint(self, robot, name):
        return self.all[robot, "joint", name]

    def robot(self, robot):
        return self.all[robot, "robot", robot]
