#!/usr/bin/env python3
"""Makes a large robot library of a small one: each model at several sizes, for measuring how the time of a search grows.

    scripts/scaled_library.py --robots LIBRARY --out DIR --scales 1 0.8 0.9 1.1 1.25

A copy at another size has the lengths of its URDF multiplied: origins, meshes, primitive shapes, limits of sliding joints.
Masses stay. Models with a robot.toml (loops, tools) are copied at their own size only, since its places are lengths, too."""

import argparse
import shutil
import xml.etree.ElementTree as ET
from pathlib import Path


def times(text: str, scale: float) -> str:
    return " ".join(repr(float(value) * scale) for value in text.split())


def scaled(urdf: Path, scale: float) -> None:
    tree = ET.parse(urdf)
    root = tree.getroot()
    root.set("name", f"{root.get('name')}_{round(100 * scale)}")
    for origin in root.iter("origin"):
        if origin.get("xyz"):
            origin.set("xyz", times(origin.get("xyz"), scale))
    for mesh in root.iter("mesh"):
        mesh.set("scale", times(mesh.get("scale", "1 1 1"), scale))
    for shape, names in (("box", ["size"]), ("cylinder", ["radius", "length"]), ("sphere", ["radius"])):
        for found in root.iter(shape):
            for name in names:
                found.set(name, times(found.get(name), scale))
    for joint in root.iter("joint"):
        limit = joint.find("limit")
        if joint.get("type") == "prismatic" and limit is not None:
            for name in ("lower", "upper"):
                limit.set(name, times(limit.get(name, "0"), scale))
    tree.write(urdf, xml_declaration=True, encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--scales", type=float, nargs="+", default=[1.0, 0.8, 0.9, 1.1, 1.25])
    wanted = parser.parse_args()
    wanted.out.mkdir(parents=True)
    for model in sorted(path for path in wanted.robots.iterdir() if path.is_dir()):
        for scale in wanted.scales:
            if scale != 1.0 and (model / "robot.toml").exists():
                continue
            to = wanted.out / (model.name if scale == 1.0 else f"{model.name}_{round(100 * scale)}")
            shutil.copytree(model, to)
            if scale != 1.0:
                for urdf in to.glob("*.urdf"):
                    scaled(urdf, scale)


if __name__ == "__main__":
    main()
