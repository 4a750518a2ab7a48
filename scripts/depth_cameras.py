#!/usr/bin/env python3
"""Runs the program on each frame of real depth-camera clouds with known joints, and prints a table of errors (needs numpy).

    scripts/depth_cameras.py --clouds ../shared/scans --out DIR [--only realsense] [--program stillpoint]

A set is a folder `robot-*` with `scene.json` (where the camera stood), `truth.json` (base, joints of each frame) and LAZ
frames with a label a point; the models lie in `robot-urdf` beside them. The truth is read only to compare. A round foot
leaves open how base and first joint share their turn: the table has the sum of both.
"""
import argparse
import json
import subprocess
import time
from pathlib import Path

import numpy as np

NEAR = 0.1  # metres: a base this near is that of the robot
ROBOT, NOT_ROBOT = 1, 0  # labels of the clouds; 2 is uncertain


def pose(base) -> np.ndarray:
    w, x, y, z = base["quat_wxyz"]
    out = np.eye(4)
    out[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    out[:3, 3] = base["xyz"]
    return out


def turned(degrees: float) -> float:
    return (degrees + 180) % 360 - 180


def run(args, clouds: Path, frame: Path, position) -> tuple[dict, float]:
    out = args.out / f"{clouds.name}-{frame.stem}"
    out.mkdir(parents=True, exist_ok=True)
    scanners = out / "scanners.json"
    scanners.write_text(json.dumps({"scanner": [{"position": position}]}))
    command = [args.program, "run", frame, "--scanners", scanners, "--robots", args.clouds / "robot-urdf"]
    started = time.monotonic()
    command += ["--out", out, "--progress", "none"]
    subprocess.run([str(c) for c in command], check=True, stdout=subprocess.DEVNULL)
    return json.loads((out / "result.json").read_text()), time.monotonic() - started


def errors(robot: dict, base: np.ndarray, joints: dict) -> tuple[float, list[float]]:
    """Distance of the base, mm; errors of base's turn and first joint together and of the other joints, degrees."""
    off = np.linalg.inv(base) @ pose(robot["base_pose"])
    out = [turned(np.degrees(robot["joints"][name] - true)) for name, true in joints.items()]
    out[0] = turned(out[0] + np.degrees(np.arctan2(off[1, 0], off[0, 0])))
    return 1e3 * np.linalg.norm(off[:3, 3]), out


def score(out: Path, truth: np.ndarray) -> float:
    """F1 of the robot's points against the labels of the cloud, without those that are uncertain in it."""
    kind = np.load(out / "labels/0.kind.npy")
    found = np.isin(kind, [1, 2]) & (truth != 2)
    robot = truth == ROBOT
    return 2 * (found & robot).sum() / max(1, found.sum() + robot.sum())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--clouds", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--only", default="")
    parser.add_argument("--program", default="stillpoint")
    args = parser.parse_args()
    print("| frame | verdict | base mm | joints but the last ° (the first with the base's turn) | stated ° | others found | F1 | s |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for clouds in sorted(args.clouds.glob("robot-*")):
        if args.only not in clouds.name or not (clouds / "truth.json").exists():
            continue
        truth = json.loads((clouds / "truth.json").read_text())
        position = json.loads((clouds / "scene.json").read_text())["scanner_position_world"]
        base, all_errors, n_found, n_wrong = np.array(truth["world_from_base"]), [], 0, 0
        for frame in truth["frames"]:
            result, seconds = run(args, clouds, clouds / frame["file"], position)
            names = set(frame["joints_rad"])
            near, others = None, 0
            for robot in result["robots"]:
                is_it = set(robot["joints"]) == names
                off = errors(robot, base, frame["joints_rad"]) if is_it else (np.inf, [])
                if off[0] < 1e3 * NEAR:
                    near = (robot, *off)
                else:
                    others += 1
                worst = max(abs(e) for e in off[1][:-1]) if off[1] else np.inf
                n_wrong += robot["verdict"] == "trusted" and (off[0] > 1e3 * NEAR or worst > 3)
            name = f"{clouds.name.removeprefix('robot-')} {Path(frame['file']).stem}"
            labels = np.fromfile(clouds / frame["labels"], dtype=np.uint8)
            f1 = score(args.out / f"{clouds.name}-{Path(frame['file']).stem}", labels)
            if near is None:
                print(f"| {name} | not found | | | | {others} | | {seconds:.1f} |", flush=True)
                continue
            robot, off, each = near
            n_found += 1
            all_errors += [abs(e) for e in each[:-1]]
            stated = ", ".join(f"{np.degrees(robot['sigma'][j]):.1f}" for j in list(frame["joints_rad"])[:-1])
            joints = ", ".join(f"{e:.1f}" for e in each[:-1])
            print(f"| {name} | {robot['verdict']} | {off:.0f} | {joints} | {stated} | {others} | {f1:.3f} | {seconds:.1f} |", flush=True)
        median = f"{np.median(all_errors):.2f}" if all_errors else "-"
        print(f"| **{clouds.name}** | {n_found} of {len(truth['frames'])} found, {n_wrong} wrong and trusted | | median {median} | | | | |")


if __name__ == "__main__":
    main()
