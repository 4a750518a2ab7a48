#!/usr/bin/env python3
"""Measures the distances of real depth-camera clouds from the robot in its true posture: the errors of the clouds themselves.

    scripts/camera_residuals.py --clouds ../shared/scans [--only zed2i]

Needs numpy, laspy with lazrs, trimesh with embreex and yourdfpy. Each beam of the robot is cast at the posed meshes. What
stands between the two is no error of any fit: a link that a camera has 15 mm off its true place, where its neighbour is not,
costs a joint 0.4 m away 2°.
"""
import argparse
import json
from pathlib import Path

import laspy
import numpy as np
import trimesh
import yourdfpy

ROBOT = 1  # label of its points
MOST = 0.05  # metres: farther off it is another surface
FEWEST = 100  # points that tell where a link is


def posed(urdf: Path, joints: dict, base_link: str, base: np.ndarray):
    """The mesh of the whole robot in the world, and the link of each of its faces."""
    meshes = {path.name: str(path) for path in urdf.parent.rglob("*.stl")}
    robot = yourdfpy.URDF.load(str(urdf), filename_handler=lambda fname: meshes[Path(fname).name])
    robot.update_cfg(joints)
    parts, links = [], []
    for name in robot.link_map:
        world_from_link = base @ robot.get_transform(name, base_link)
        for visual in robot.link_map[name].visuals:
            if visual.geometry.mesh is None:
                continue
            mesh = trimesh.load(meshes[Path(visual.geometry.mesh.filename).name], force="mesh")
            mesh.apply_scale(1.0 if visual.geometry.mesh.scale is None else visual.geometry.mesh.scale)
            mesh.apply_transform(world_from_link if visual.origin is None else world_from_link @ visual.origin)
            parts.append(mesh)
            links += [name] * len(mesh.faces)
    return trimesh.util.concatenate(parts), np.array(links)


def beyond(points: np.ndarray, scanner: np.ndarray, mesh, links: np.ndarray):
    """How far each beam went beyond the surface, metres (nan where it misses), and the link it should have met."""
    beams = points - scanner
    ranges = np.linalg.norm(beams, axis=1)
    starts = np.repeat(scanner[None], len(points), 0)
    met, ray, face = mesh.ray.intersects_location(starts, beams / ranges[:, None], multiple_hits=False)
    off, link = np.full(len(points), np.nan), np.full(len(points), "", dtype=links.dtype)
    off[ray] = ranges[ray] - np.linalg.norm(met - scanner, axis=1)
    link[ray] = links[face]
    return off, link


def smooth(off: np.ndarray, points: np.ndarray, world_from_camera: np.ndarray) -> float:
    """What is left beside a bend of the image, quadratic in its angles and the depth: robust deviation, metres."""
    x, y, z = (np.c_[points, np.ones(len(points))] @ np.linalg.inv(world_from_camera).T)[:, :3].T
    u, v, d = y / x, z / x, x - x.mean()
    terms = np.c_[np.ones(len(u)), u, v, d, u * u, u * v, v * v, u * d, v * d, d * d]
    kept = np.ones(len(off), dtype=bool)
    for _ in range(5):
        left = off - terms @ np.linalg.lstsq(terms[kept], off[kept], rcond=None)[0]
        spread = 1.4826 * np.median(abs(left[kept]))
        kept = abs(left) < 3 * spread
    return spread


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--clouds", type=Path, required=True)
    parser.add_argument("--only", default="")
    args = parser.parse_args()
    print("| frame | points | off the true surface, mm (robust) | beside a bend of the image, mm | links, mm |")
    print("| --- | --- | --- | --- | --- |")
    for clouds in sorted(args.clouds.glob("robot-*")):
        if args.only not in clouds.name or not (clouds / "truth.json").exists():
            continue
        truth = json.loads((clouds / "truth.json").read_text())
        scanner = np.array(json.loads((clouds / "scene.json").read_text())["scanner_position_world"])
        base, camera = np.array(truth["world_from_base"]), np.array(truth["world_from_camera_ros"])
        for frame in truth["frames"]:
            cloud = laspy.read(clouds / frame["file"])
            points = np.c_[cloud.x, cloud.y, cloud.z]
            points = points[np.fromfile(clouds / frame["labels"], dtype=np.uint8) == ROBOT]
            mesh, links = posed(args.clouds / truth["urdf"], frame["joints_rad"], truth["base_link"], base)
            off, link = beyond(points, scanner, mesh, links)
            good = np.abs(np.nan_to_num(off, nan=1.0)) < MOST
            off, link, points = off[good], link[good], points[good]
            each = [off[link == name] for name in dict.fromkeys(links)]
            places = ", ".join(f"{1e3 * np.median(o):.0f}" for o in each if len(o) >= FEWEST)
            spread = 1.4826 * np.median(abs(off - np.median(off)))
            name = f"{clouds.name.removeprefix('robot-')} {Path(frame['file']).stem}"
            left = smooth(off, points, camera)
            print(f"| {name} | {len(points)} | {1e3 * spread:.1f} | {1e3 * left:.1f} | {places} |", flush=True)


if __name__ == "__main__":
    main()
