#!/usr/bin/env python3
"""Copies a robot library whose loops are described in `loops.md`, and writes a `robot.toml` for each of these models.

    scripts/looped_library.py --robots ../shared/robots --out DIR

A `loops.md` has a section a loop and in it a JSON block: `type`, `passive` joints, `closures` (pairs of links and points).
Where a `robot_loop.urdf` stands beside it, that is the tree that these names belong to. Models without loops, and tools,
are copied as they are. Then: stillpoint bench accuracy --suite loops --robots DIR
"""
import argparse
import json
import re
import shutil
from pathlib import Path

N_FREE = 3  # fewer free joints: a tool, whose fingers follow by <mimic>


def free_joints(urdf: str) -> int:
    joints = re.findall(r"<joint\b[^>]*type=\"(?:revolute|continuous|prismatic)\"[^>]*>.*?</joint>", urdf, re.S)
    return sum("<mimic" not in joint for joint in joints)


def sheet(model: Path) -> str:
    tree = model / "robot_loop.urdf"
    lines = ['urdf = "robot_loop.urdf"'] if tree.exists() else []
    text = (model / "loops.md").read_text()
    for title, block in re.findall(r"^## (.*?)$.*?```json\n(.*?)```", text, re.S | re.M):
        loop = json.loads(block)
        pins = ",\n".join(
            f'  {{ link_a = "{c["link_a"]}", xyz_a = {c["xyz_a"]}, link_b = "{c["link_b"]}", xyz_b = {c["xyz_b"]} }}'
            for c in loop["closures"]
        )
        lines += [
            "",
            "[[sub_chain]]",
            f"name = {json.dumps(title)}",
            f"kind = {json.dumps(loop['type'])}",
            f"passive = {json.dumps(loop['passive'])}",
            f"closures = [\n{pins},\n]",
        ]
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args()
    for model in sorted(p for p in args.robots.iterdir() if (p / "robot.urdf").exists()):
        copy = args.out / model.name
        shutil.copytree(model, copy, dirs_exist_ok=True)
        if (model / "loops.md").exists() and free_joints((model / "robot.urdf").read_text()) >= N_FREE:
            (copy / "robot.toml").write_text(sheet(model))
            print(f"{model.name}: robot.toml")


if __name__ == "__main__":
    main()
