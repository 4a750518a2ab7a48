#!/usr/bin/env python3
"""One writer that users have: points or a robot in, its file out. Run by cross.py in a process of its own."""

import sys
from pathlib import Path

import numpy as np


def coloured(path, out):
    """A LAS of the virtual scanner with colours that follow from the coordinates."""
    import laspy

    scans = laspy.read(path)
    header = laspy.LasHeader(point_format=7, version="1.4")
    header.scales, header.offsets = scans.header.scales, scans.header.offsets
    made = laspy.LasData(header)
    for name in ("X", "Y", "Z", "intensity", "gps_time", "point_source_id"):
        made[name] = np.asarray(scans[name])
    for name, axis, factor in (("red", "X", 7), ("green", "Y", 5), ("blue", "Z", 3)):
        made[name] = (np.asarray(scans[axis], np.int64) * factor) & 0xFFFF
    made.write(out)


def las(points, out, version, point_format, backend=None):
    import laspy

    header = laspy.LasHeader(point_format=int(point_format), version=version)
    header.scales, header.offsets = [1e-4] * 3, np.floor([points[c].min() for c in "xyz"])
    made = laspy.LasData(header)
    made.x, made.y, made.z = points["x"], points["y"], points["z"]
    names = set(made.point_format.dimension_names)
    for name in ("intensity", "red", "green", "blue", "gps_time", "point_source_id"):
        if name in names:
            made[name] = points[name]
    made.write(out, laz_backend=getattr(laspy.LazBackend, backend) if backend else None)


def copc(points, out):
    import copclib

    config = copclib.CopcConfigWriter(7, [1e-4] * 3, np.floor([points[c].min() for c in "xyz"]).tolist())
    low, high = ([float(f(points[c])) for c in "xyz"] for f in (np.min, np.max))
    config.las_header.min, config.las_header.max = low, high
    config.copc_info.spacing = 1.0
    writer = copclib.FileWriter(out, config)
    made = copclib.Points(config.las_header)
    for i in range(len(points["x"])):
        point = made.CreatePoint()
        point.x, point.y, point.z = (float(points[c][i]) for c in "xyz")
        point.intensity, point.point_source_id = int(points["intensity"][i]), int(points["point_source_id"][i])
        point.gps_time = float(points["gps_time"][i])
        point.red, point.green, point.blue = (int(points[c][i]) for c in ("red", "green", "blue"))
        made.AddPoint(point)
    writer.AddNode(copclib.VoxelKey(0, 0, 0, 0), made)
    writer.Close()


def pye57(points, out):
    import pye57

    with pye57.E57(out, mode="w") as file:
        data = {f"cartesian{c.upper()}": points[c] for c in "xyz"}
        data["intensity"] = points["intensity"] / 65535
        data |= {f"color{c.capitalize()}": (points[c] >> 8).astype(np.uint8) for c in ("red", "green", "blue")}
        file.write_scan_raw(data, name="scan_1", rotation=np.array([1.0, 0, 0, 0]), translation=np.zeros(3))


def open3d(points, out):
    import open3d

    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(np.stack([points[c] for c in "xyz"], axis=1)))
    if not open3d.io.write_point_cloud(out, cloud):
        raise RuntimeError("it writes no such file")


def yourdfpy(path, out):
    from yourdfpy import URDF

    # Its own handler of names would write absolute paths.
    robot = URDF.load(path, load_meshes=False, build_scene_graph=False, filename_handler=lambda name: name)
    robot.write_xml_file(out)


def urchin(path, out):
    from urchin import URDF

    URDF.load(path).save(out)


def mesh(path, out):
    import trimesh

    trimesh.load(path, force="mesh").export(out)


def open3d_mesh(path, out):
    import open3d

    made = open3d.io.read_triangle_mesh(path)
    made.compute_triangle_normals()
    if not open3d.io.write_triangle_mesh(out, made):
        raise RuntimeError("it writes no such file")


def meshio_mesh(path, out):
    import meshio

    meshio.write(out, meshio.read(path), **({"binary": True} if out.endswith(".stl") else {}))


def meshes(folder, kind, by):
    """All meshes of a model in another format, each beside the old one, which goes."""
    for path in sorted(Path(folder).iterdir()):
        WRITERS[by](str(path), str(path.with_name(f"{path.stem}_new.{kind}")))
        path.unlink()


WRITERS = {f.__name__: f for f in (coloured, las, copc, pye57, open3d, yourdfpy, urchin, mesh, open3d_mesh, meshio_mesh, meshes)}

if __name__ == "__main__":
    writer, source, out, *more = sys.argv[1:]
    if source.endswith(".npz"):
        with np.load(source) as read:
            source = dict(read)
    WRITERS[writer](source, out, *more)
