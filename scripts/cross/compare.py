"""What a reader gave against the truth, in words: `right`, or what is missing and what is wrong, with numbers."""

import json
import struct
from pathlib import Path

import numpy as np

# Bytes and fields of the two record formats that Stillpoint writes (LAS 1.4, formats 6 and 7).
BASE = [("X", "<i4"), ("Y", "<i4"), ("Z", "<i4"), ("intensity", "<u2"), ("returns", "u1"), ("flags", "u1"),
        ("classification", "u1"), ("user_data", "u1"), ("angle", "<i2"), ("point_source_id", "<u2"), ("gps_time", "<f8")]
COLOUR = [("red", "<u2"), ("green", "<u2"), ("blue", "<u2")]
LABELS = [("RobotId", "<u2"), ("LinkId", "<u2"), ("BodyId", "<u4")]
# The URDF has nine digits, so that ten links in a row agree to these: metres, degrees.
SAME_PLACE, SAME_TURN = 1e-7, 1e-5
# Readers keep meshes in single precision; boxes around turned boxes are wider by parts of a link, metres.
SAME_BOX, LOOSE = 1e-5, 0.5
SHOWN = ("intensity", "classification", "point_source_id", "gps_time", "red", "green", "blue", "RobotId", "LinkId", "BodyId")


def las(path):
    """Columns of an uncompressed LAS, by the specification and no library; beside it the step of its coordinates, metres."""
    raw = Path(path).read_bytes()
    at, = struct.unpack_from("<I", raw, 96)
    kind, length = struct.unpack_from("<BH", raw, 104)
    n, = struct.unpack_from("<Q", raw, 247)
    scale, offset = np.array(struct.unpack_from("<6d", raw, 131)).reshape(2, 3)
    fields = BASE + (COLOUR if kind == 7 else [])
    for extra in LABELS:
        if np.dtype(fields + [extra]).itemsize <= length:
            fields.append(extra)
    assert kind in (6, 7) and np.dtype(fields).itemsize == length, (path, kind, length)
    rows = np.frombuffer(raw, fields, n, at)
    xyz = np.stack([rows[c] for c in "XYZ"], axis=1) * scale + offset
    names = [name for name in SHOWN if name in rows.dtype.names]
    return dict(zip("xyz", xyz.T)) | {name: rows[name] for name in names}, float(scale.max())


def sorted_rows(columns, step):
    keys = [np.round(np.asarray(columns[c], float) / step) for c in "xyz"]
    keys += [columns[name] for name in ("gps_time", "point_source_id", "intensity", "classification") if name in columns]
    order = np.lexsort(keys[::-1])
    return {name: np.asarray(column)[order] for name, column in columns.items()}


def clouds(truth, got, step, in_order=True, names=None, coarse=None):
    """`coarse`: names that the format cannot hold more exactly, and their step."""
    n, n_got = len(truth["x"]), len(got["x"])
    got = {name: column for name, column in got.items() if len(column) == n_got}
    if n != n_got:
        return f"{n_got} of {n} points"
    names = names or {}
    got = {names.get(name, name): column for name, column in got.items()}
    if not in_order:
        truth, got = sorted_rows(truth, step), sorted_rows(got, step)
    said = []
    xyz = [np.abs(np.asarray(got[c], float) - truth[c]).max() for c in "xyz"]
    if max(xyz) > 0.51 * step:
        said.append(f"coordinates off by up to {max(xyz):.3g} m")
    elif max(xyz) > 1e-8 and all(np.asarray(got[c]).dtype == np.float32 for c in "xyz"):
        said.append(f"coordinates in single precision (off by up to {max(xyz) * 1e6:.2g} µm)")
    lost = [name for name in truth if name not in "xyz" and name not in got]
    if lost:
        said.append("does not give " + ", ".join(lost))
    for name in (name for name in truth if name not in "xyz" and name in got):
        off = np.abs(np.asarray(got[name], float) - np.asarray(truth[name], float))
        bad = off > (coarse or {}).get(name, 0)
        if bad.any():
            at = int(np.argmax(bad))
            said.append(f"{name} wrong at {int(bad.sum())} of {n} points (first: {got[name][at]} for {truth[name][at]})")
    return "; ".join(said) or "right"


def matrix(pose):
    w, x, y, z = pose["quat_wxyz"]
    made = np.eye(4)
    made[:3, :3] = [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                    [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                    [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]
    made[:3, 3] = pose["xyz"]
    return made


def stl(path):
    raw = Path(path).read_bytes()
    n, = struct.unpack_from("<I", raw, 80)
    return np.frombuffer(raw, [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")], n, 84)["corners"].reshape(-1, 3)


def robot_truth(out, robot):
    """Poses of links against the base, and the box around all surfaces of its URDF so placed."""
    import xml.etree.ElementTree as ET

    base = np.linalg.inv(matrix(robot["link_poses"][robot["base_link"]]))
    poses = {name: base @ matrix(pose) for name, pose in robot["link_poses"].items()}
    folder = Path(out) / "robots" / robot["id"]
    points = []
    for link in ET.parse(folder / "robot.urdf").getroot().findall("link"):
        pose = poses[link.get("name")]
        for mesh in link.findall("visual/geometry/mesh"):
            points.append(stl(folder / mesh.get("filename")) @ pose[:3, :3].T + pose[:3, 3])
    points = np.concatenate(points)
    return poses, np.array([points.min(axis=0), points.max(axis=0)])


def robots(truth, got, fixed, loose=False):
    """`fixed`: links on fixed joints; `loose`: the reader's boxes are around turned boxes."""
    (poses, bounds), said, known = truth, [], []
    off, turned = 0.0, 0.0
    for name, pose in got["poses"].items():
        if name not in poses:
            continue
        step = np.linalg.inv(poses[name]) @ np.array(pose)
        off = max(off, float(np.linalg.norm(step[:3, 3])))
        sine = np.linalg.norm(step[:3, :3] - step[:3, :3].T) / np.sqrt(8)
        turned = max(turned, float(np.degrees(np.arctan2(sine, (np.trace(step[:3, :3]) - 1) / 2))))
    if off > SAME_PLACE or turned > SAME_TURN:
        said.append(f"links off by up to {off * 1e3:.3g} mm and {turned:.3g}°")
    lost = {name for name in poses if name not in got["poses"]}
    if lost and lost <= fixed:
        known.append(f"joins {', '.join(sorted(lost))} with the links that they are fixed to")
    elif lost:
        said.append("has no link " + ", ".join(sorted(lost)))
    if got["bounds"] is None:
        known.append("meshes not compared, since it hands out none")
    elif loose:
        wider = np.array([[1], [-1]]) * (bounds - np.array(got["bounds"]))
        if wider.min() < -1e-4 or wider.max() > LOOSE:
            said.append(f"box of its surfaces off by {np.abs(wider).max() * 1e3:.3g} mm")
        known.append("boxes of surfaces are wider, being around turned boxes")
    else:
        wide = float(np.abs(np.array(got["bounds"]) - bounds).max())
        if wide > SAME_BOX:
            said.append(f"box of its surfaces off by {wide * 1e3:.3g} mm")
    return "; ".join(said + known if said else ["right", *known])


def voxels(truth, known, leaves, edge, tells_free=True):
    expected = truth if tells_free else np.where(truth == 1, 1, 254)
    said = []
    wrong = int((expected != known).sum())
    if wrong:
        said.append(f"{wrong} of {len(truth)} voxels wrong")
    if len(leaves):
        off = np.abs((leaves / edge) % 1.0 - 0.5).max() * edge
        if off > 1e-6:
            said.append(f"middles of single voxels off by {off * 1e3:.3g} mm, searched at their places they are right")
    return "; ".join(said) or "right"


def numbers(expected, got, digits):
    """Nested lists and dicts of numbers; texts that are numbers count as such."""
    if isinstance(expected, dict):
        return isinstance(got, dict) and expected.keys() == got.keys() and all(numbers(v, got[k], digits) for k, v in expected.items())
    if isinstance(expected, list):
        return isinstance(got, list) and len(expected) == len(got) and all(map(lambda a, b: numbers(a, b, digits), expected, got))
    if isinstance(expected, bool) or isinstance(got, bool):
        return str(expected).lower() == str(got).lower()
    if isinstance(expected, (int, float)):
        try:
            return abs(float(got) - expected) <= digits
        except (TypeError, ValueError):
            return False
    return str(expected) == str(got)


def read_json(path):
    return json.loads(Path(path).read_text())
