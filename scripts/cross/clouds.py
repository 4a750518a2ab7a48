#!/usr/bin/env python3
"""One reader of clouds: a file in, its columns out as .npz, by the names of LAS. Run by cross.py in a process of its own,
so that a reader that dies or hangs takes nothing with it."""

import sys
import tempfile
from pathlib import Path

import numpy as np

LAS = ("intensity", "classification", "point_source_id", "gps_time", "red", "green", "blue", "RobotId", "LinkId", "BodyId")


def of_las(cloud):
    names = set(cloud.point_format.dimension_names)
    columns = {name: np.asarray(cloud[name]) for name in LAS if name in names}
    return {**{c: np.asarray(getattr(cloud, c)) for c in "xyz"}, **columns}


def laspy_lazrs(path):
    import laspy

    return of_las(laspy.read(path, laz_backend=laspy.LazBackend.Lazrs))


def laspy_laszip(path):
    import laspy

    return of_las(laspy.read(path, laz_backend=laspy.LazBackend.Laszip))


def laspy_copc(path):
    import laspy

    with laspy.CopcReader.open(path) as file:
        return of_las(file.query())


def copclib(path):
    import copclib as copc

    reader = copc.FileReader(path)
    points = reader.GetAllPoints()
    columns = {name: np.array(getattr(points, name)) for name in ("classification", "point_source_id", "red", "green", "blue")}
    columns |= {name: np.array([getattr(p, name) for p in points]) for name in ("intensity", "gps_time")}
    # It does not hand out the names of extra fields: they are taken in the order of the file.
    extra = ("RobotId", "LinkId", "BodyId")
    raw = np.stack([np.array(p.extra_bytes, dtype=np.uint8) for p in points])
    at = 0
    for name in extra:
        kind = "<u4" if name == "BodyId" else "<u2"
        size = np.dtype(kind).itemsize
        columns[name] = np.ascontiguousarray(raw[:, at:at + size]).view(kind).ravel()
        at += size
    return {**{c: np.array(getattr(points, c)) for c in "xyz"}, **columns}


def pdal(path, call="pdal", driver=""):
    """`call` reaches PDAL; what it says is read back from text, with all digits."""
    import subprocess

    with tempfile.NamedTemporaryFile(suffix=".csv", dir=Path(path).parent) as out:
        options = ["--writers.text.precision=9", "--writers.text.quote_header=false"]
        if driver == "las":
            options.append("--readers.las.use_eb_vlr=true")
        subprocess.run([*call.split(), "translate", path, out.name, *options], check=True)
        with open(out.name) as text:
            header = text.readline().strip().split(",")
        data = np.loadtxt(out.name, delimiter=",", skiprows=1, ndmin=2)
    ours = {"X": "x", "Y": "y", "Z": "z", "Intensity": "intensity", "Classification": "classification", "Red": "red",
            "PointSourceId": "point_source_id", "GpsTime": "gps_time", "Green": "green", "Blue": "blue"}
    ours |= {name: name for name in ("RobotId", "LinkId", "BodyId")}
    ours |= {f"scalar_{name}": name for name in ("kind", "robot", "link")}
    lower = {"intensity": "intensity", "red": "red", "green": "green", "blue": "blue"}
    return {(ours | lower)[name]: data[:, i] for i, name in enumerate(header) if name in ours | lower}


def cloudcompare(path, call="CloudCompare"):
    """`call` reaches CloudCompare, which writes what it read as text."""
    import subprocess

    with tempfile.TemporaryDirectory(dir=Path(path).parent) as folder:
        copy = Path(folder) / Path(path).name
        copy.write_bytes(Path(path).read_bytes())
        line = [*call.split(), "-SILENT", "-AUTO_SAVE", "OFF", "-C_EXPORT_FMT", "ASC", "-PREC", "9", "-SEP", "COMMA",
                "-ADD_HEADER", "-NO_TIMESTAMP", "-O", "-GLOBAL_SHIFT", "0", "0", "0", str(copy), "-MERGE_CLOUDS", "-SAVE_CLOUDS"]
        said = subprocess.run(line, capture_output=True, text=True, timeout=240, check=False).stdout
        if not list(Path(folder).glob("*.asc")):
            raise RuntimeError("this build has no plugin for the format")
        made = max(Path(folder).glob("*.asc"), key=lambda p: p.stat().st_size)
        with open(made) as text:
            header = text.readline().lstrip("/").strip().split(",")
        data = np.loadtxt(made, delimiter=",", skiprows=1, ndmin=2)
    ours = {"X": "x", "Y": "y", "Z": "z", "R": "red", "G": "green", "B": "blue", "Intensity": "intensity",
            "Classification": "classification", "Point Source ID": "point_source_id", "PointSourceId": "point_source_id",
            "GpsTime": "gps_time", "Gps Time": "gps_time", "Original cloud index": None}
    return {ours.get(n, n): data[:, i] for i, n in enumerate(header) if ours.get(n, n)}


def ply_columns(points):
    return {name: np.asarray(points[name]) for name in points.dtype.names}


def plyfile(path):
    from plyfile import PlyData

    return ply_columns(PlyData.read(path)["vertex"].data)


def open3d_legacy(path):
    import open3d

    cloud = open3d.io.read_point_cloud(path)
    return with_colours(np.asarray(cloud.points), np.asarray(cloud.colors) * 255)


def with_colours(xyz, rgb, **more):
    columns = dict(zip("xyz", xyz.T)) | {k: np.asarray(v).ravel() for k, v in more.items()}
    if len(rgb):
        columns |= dict(zip(("red", "green", "blue"), np.round(rgb).T))
    return columns


def open3d_tensor(path):
    import open3d

    points = open3d.t.io.read_point_cloud(path).point
    more = {name: points[name].numpy() for name in points if name not in ("positions", "colors")}
    rgb = points["colors"].numpy() if "colors" in points else []
    return with_colours(points["positions"].numpy(), rgb, **more)


def pyntcloud(path):
    from pyntcloud import PyntCloud

    return {name: column.to_numpy() for name, column in PyntCloud.from_file(path).points.items()}


def trimesh(path):
    import trimesh

    cloud = trimesh.load(path)
    raw = cloud.metadata.get("_ply_raw", {}).get("vertex", {}).get("data")
    if raw is not None and not isinstance(raw, dict):
        more = {n: np.asarray(raw[n]).ravel() for n in raw.dtype.names if n not in ("x", "y", "z")}
    else:
        more = {n: np.asarray(v).ravel() for n, v in (raw or {}).items() if n not in ("x", "y", "z")}
    return dict(zip("xyz", np.asarray(cloud.vertices).T)) | more


def meshio(path):
    import meshio

    mesh = meshio.read(path)
    return dict(zip("xyz", mesh.points.T)) | {k: np.asarray(v).ravel() for k, v in mesh.point_data.items()}


def pye57(path):
    import pye57

    file = pye57.E57(path)
    scans = [file.read_scan(i, intensity=True, ignore_missing_fields=True) for i in range(file.scan_count)]
    names = {"cartesianX": "x", "cartesianY": "y", "cartesianZ": "z", "intensity": "intensity"}
    return {ours: np.concatenate([s[theirs] for s in scans]) for theirs, ours in names.items()}


def e57(path):
    import e57

    cloud = e57.read_points(path)
    return dict(zip("xyz", np.asarray(cloud.points).T)) | {"intensity": np.asarray(cloud.intensity).ravel()}


READERS = {f.__name__: f for f in (laspy_lazrs, laspy_laszip, laspy_copc, copclib, pdal, cloudcompare, plyfile, open3d_legacy,
                                   open3d_tensor, pyntcloud, trimesh, meshio, pye57, e57)}

if __name__ == "__main__":
    reader, path, out, *more = sys.argv[1:]
    np.savez(out, **READERS[reader](path, *more))
