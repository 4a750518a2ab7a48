#!/usr/bin/env python3
"""Measures a collision mesh of a simulated cell against the truth.

    scripts/mesh_quality.py OUT EXACT [--poisson]

OUT is a result with `export/mesh/fixed.ply` (`stillpoint export OUT --to mesh --mesh-format ply`).
EXACT is the same scene simulated with `noise = 0`, `jitter = 0`, no `[scanner.mixed]` and no
registration error: its points lie on the true surfaces that beams met. Prints one line of CSV for
each measure. `--poisson` also reconstructs OUT's fixed points by Open3D's Poisson. Needs numpy and
open3d.
"""

import glob
import json
import struct
import sys
import time

import numpy as np
import open3d as o3d


def read_las(path):
    """Coordinates and classes of a LAS 1.4 file."""
    data = open(path, "rb").read()
    offset = struct.unpack("<I", data[96:100])[0]
    length = struct.unpack("<H", data[105:107])[0]
    n = struct.unpack("<Q", data[247:255])[0]
    scale = np.frombuffer(data[131:155], "<f8")
    origin = np.frombuffer(data[155:179], "<f8")
    records = np.frombuffer(data, np.uint8, n * length, offset).reshape(n, length)
    xyz = np.ascontiguousarray(records[:, :12]).view("<i4") * scale + origin
    return xyz, records[:, 16].copy()


def distances(mesh, points):
    """Distances of points from a mesh, metres; single precision about the middle of the points."""
    middle = points.mean(axis=0)
    moved = o3d.geometry.TriangleMesh(mesh).translate(-middle)
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3d.t.geometry.TriangleMesh.from_legacy(moved))
    near = (points - middle).astype(np.float32)
    parts = [scene.compute_distance(near[k : k + 1_000_000]).numpy() for k in range(0, len(near), 1_000_000)]
    return np.concatenate(parts)


def spaces(out):
    """Voxel grids of known space: edge, origin, kinds."""
    for robot in json.load(open(f"{out}/result.json"))["robots"]:
        space = robot.get("space")
        if space:
            yield space["edge"], np.array(space["origin"]), np.load(f"{out}/{space['grid']}")


def share_in_free(mesh, grids, n=1_000_000, depth=0.0):
    """Share of the area that lies in voxels that are free in one grid and filled in none.

    With `depth` only what is farther than that, in metres, from all voxels that are filled.
    """
    o3d.utility.random.seed(1)
    points = np.asarray(mesh.sample_points_uniformly(n).points)
    steps = np.array(np.meshgrid(*[[-1, 0, 1]] * 3)).reshape(3, -1).T if depth else [[0, 0, 0]]
    free, filled = np.zeros(n, bool), np.zeros(n, bool)
    for edge, origin, kinds in grids:
        for step in np.asarray(steps):
            at = np.floor((points + depth * step - origin) / edge + 1e-9).astype(int)
            inside = ((at >= 0) & (at < kinds.shape)).all(axis=1)
            own = kinds[tuple(at[inside].T)]
            if not step.any():
                free[inside] |= own == 1
            filled[inside] |= own >= 2
    return float((free & ~filled).mean())


def row(what, value):
    print(f"{what},{value}")


def measure(name, mesh, true, objects, out):
    off = distances(mesh, true)
    row(f"{name}: triangles", len(mesh.triangles))
    row(f"{name}: true points", len(true))
    row(f"{name}: farthest true point mm", round(float(off.max()) * 1e3, 2))
    for share in (50, 99, 99.9):
        row(f"{name}: {share} % of true points within mm", round(float(np.percentile(off, share)) * 1e3, 2))
    row(f"{name}: true points beyond 10 mm", int((off > 0.01).sum()))
    for label, is_it in objects.items():
        if is_it.any():
            row(f"{name}: farthest of {label} mm", round(float(off[is_it].max()) * 1e3, 2))
    row(f"{name}: area in free space %", round(100 * share_in_free(mesh, list(spaces(out))), 3))


def main():
    out, exact = sys.argv[1:3]
    truth = json.load(open(f"{exact}/truth/truth.json"))
    xyz, _ = read_las(f"{exact}/scans.las")
    load = lambda what: np.concatenate(
        [np.load(f"{exact}/truth/labels/{k}.{what}.npy") for k in range(len(truth["scans"]))]
    )
    kind, thing = load("kind"), load("object")
    stands = (kind == 0) | (kind == 3)
    names = truth["objects"]
    things = {
        label: np.isin(thing[stands], [k for k, name in enumerate(names) if word in name.lower()])
        for label, word in (("fences", "fence"), ("pipes", "pipe"), ("wires", "wire"))
    }
    mesh = o3d.io.read_triangle_mesh(f"{out}/export/mesh/fixed.ply")
    measure("stillpoint", mesh, xyz[stands], things, out)
    if "--poisson" in sys.argv:
        tiles = [read_las(path) for path in sorted(glob.glob(f"{out}/tiles/*.las"))]
        points = np.concatenate([xyz[(kinds != 65) & (kinds != 66)] for xyz, kinds in tiles])
        started = time.time()
        cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points)).voxel_down_sample(0.01)
        cloud.estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(0.05, 30))
        scanners = np.array([scan["pose"]["xyz"] for scan in truth["scans"]])
        # Normals towards the nearest scanner, since Poisson needs a side.
        at, normals = np.asarray(cloud.points), np.asarray(cloud.normals)
        nearest = scanners[np.argmin(((at[:, None] - scanners[None]) ** 2).sum(axis=2), axis=1)]
        flip = ((nearest - at) * normals).sum(axis=1) < 0
        normals[flip] *= -1
        cloud.normals = o3d.utility.Vector3dVector(normals)
        poisson, density = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(cloud, depth=10)
        row("Poisson: seconds", round(time.time() - started, 1))
        measure("Poisson", poisson, xyz[stands], things, out)


if __name__ == "__main__":
    main()
