#!/usr/bin/env python3
"""Compares `check` with contacts in MuJoCo on drawn paths.

    scripts/cross/paths_in_mujoco.py --program target/release/stillpoint OUT...
                                     [--paths 100] [--seed 1] [--bound 0.02] [--csv FILE]

Robots are those of `export --to mjcf`; what stands still is the convex pieces of
`export --to mesh --convex`, which replace the scene's boxes and floor. Paths begin in the posture
that was found and go straight to a drawn one, until there are as many as wanted that `check` calls
free or blocked, half of each where they can be had. Pairs that touch in the found posture, and
parts of one robot, do not count. Joints that follow or close loops are solved in each posture.
Needs mujoco and numpy.
"""

import argparse
import csv
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import mujoco
import numpy as np

# Largest step between compared postures, radians or metres.
STEP = 0.02
# Most paths drawn for each that is wanted.
DRAWS = 12
MARGIN = 0.02


def call(*args, codes=(0,)):
    ended = subprocess.run([str(a) for a in args], capture_output=True, text=True)
    if ended.returncode not in codes:
        sys.exit(f"{' '.join(map(str, args))}: {ended.stderr}")
    return ended.stdout


def pieces(path):
    """Corners of each object of an OBJ."""
    out = []
    for line in path.read_text().splitlines():
        if line.startswith("o "):
            out.append([])
        elif line.startswith("v "):
            out[-1].append([float(v) for v in line.split()[1:]])
    return [np.array(corners) for corners in out]


class Plant:
    """A result in MuJoCo."""

    def __init__(self, program, out, bound, robot):
        quiet = ["--progress", "none"]
        call(program, "export", out, "--to", "mjcf", *quiet)
        mesh = ["--to", "mesh", "--convex", "--bound", bound, "--robot", robot]
        call(program, "export", out, *mesh, *quiet)
        spec = mujoco.MjSpec.from_file(str(out / "export/mjcf/plant.xml"))
        plant = spec.body("plant")
        for body in list(plant.bodies):
            if body.name == "fixed" or body.name.startswith("touching_"):
                for exclude in [e for e in spec.excludes if e.bodyname1 == body.name]:
                    spec.delete(exclude)
                spec.delete(body)
        for geom in list(plant.geoms):
            spec.delete(geom)
        found = pieces(out / "export/mesh/convex.obj")
        for k, corners in enumerate(found):
            middle = corners.mean(axis=0)
            near = (corners - middle).astype(np.float32)
            spec.add_mesh(name=f"piece_{k}", uservert=near.flatten())
            own = plant.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"piece_{k}")
            own.name, own.pos, own.mass = f"piece_{k}", middle, 0
        self.n_pieces = len(found)
        spec.memory = 1 << 29
        self.model = model = spec.compile()
        self.data = mujoco.MjData(model)
        self.start = model.key_qpos[0].copy()
        self.qpos = self.start.copy()
        name = lambda kind, at: mujoco.mj_id2name(model, kind, at)
        self.joints = {
            name(mujoco.mjtObj.mjOBJ_JOINT, j): model.jnt_qposadr[j] for j in range(model.njnt)
        }
        self.links = [name(mujoco.mjtObj.mjOBJ_BODY, model.geom_bodyid[g]) for g in range(model.ngeom)]
        self.pieces = [name(mujoco.mjtObj.mjOBJ_GEOM, g) for g in range(model.ngeom)]
        self.touching = set()
        self.touching = {pair for pair, _ in self.contacts()}

    def contacts(self):
        """Contacts of a robot with what is not its own: names and depth, metres."""
        self.data.qpos[:] = self.qpos
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_collision(self.model, self.data)
        for k in range(self.data.ncon):
            contact = self.data.contact[k]
            links = [self.links[g] for g in contact.geom]
            if links[0].split("/")[0] == links[1].split("/")[0]:
                continue
            pair = tuple(self.pieces[g] or link for g, link in zip(contact.geom, links))
            if pair not in self.touching:
                yield pair, -contact.dist

    def follow(self, own, driven):
        """Moves followers of one robot, and joints of its loops until their pins meet."""
        model, qpos = self.model, self.qpos
        loose = set()
        for e in range(model.neq):
            if model.eq_type[e] == mujoco.mjtEq.mjEQ_JOINT:
                line = model.eq_data[e, :2]
                to, of = (model.jnt_qposadr[j] for j in (model.eq_obj1id[e], model.eq_obj2id[e]))
                if of in own:
                    qpos[to] = line[0] + line[1] * qpos[of]
                    loose.add(to)
        pins = [e for e in range(model.neq) if model.eq_type[e] == mujoco.mjtEq.mjEQ_CONNECT]
        moved = {model.jnt_bodyid[j] for j in range(model.njnt) if model.jnt_qposadr[j] in own}
        tree = {model.body_treeid[b] for b in moved}
        pins = [e for e in pins if model.body_treeid[model.site_bodyid[model.eq_obj1id[e]]] in tree]
        free = [at for at in own if at not in driven and at not in loose]
        if not pins or not free:
            return 0.0

        def gaps():
            self.data.qpos[:] = qpos
            mujoco.mj_kinematics(model, self.data)
            site = self.data.site_xpos
            both = [site[model.eq_obj1id[e]] - site[model.eq_obj2id[e]] for e in pins]
            return np.concatenate(both)

        for _ in range(20):
            off = gaps()
            if np.abs(off).max() < 1e-7:
                break
            jacobian = np.zeros((len(off), len(free)))
            for k, at in enumerate(free):
                qpos[at] += 1e-6
                jacobian[:, k] = (gaps() - off) / 1e-6
                qpos[at] -= 1e-6
            qpos[free] -= np.linalg.lstsq(jacobian, off, rcond=1e-9)[0]
        return float(np.abs(gaps()).max())

    def run(self, at, start, goal, own):
        """Deepest contact along a path, what touches there, and how far pins gaped."""
        n = max(2, int(np.ceil(np.abs(goal - start).max() / STEP)) + 1)
        deepest, gaped = (0.0, None, 0.0), 0.0
        self.qpos = self.start.copy()
        for share in np.linspace(0.0, 1.0, n):
            self.qpos[at] = start + share * (goal - start)
            gaped = max(gaped, self.follow(own, set(at)))
            for pair, depth in self.contacts():
                if deepest[1] is None or depth > deepest[0]:
                    deepest = (depth, pair, share)
        return deepest, gaped


def paths(args, out, wanted, draw, writer):
    result = json.load(open(out / "result.json"))
    trusted = [r for r in result["robots"] if r["verdict"] == "trusted" and r.get("space")]
    counts = {"free": 0, "blocked": 0}
    per_robot = -(-wanted // max(len(trusted), 1))
    for robot in trusted:
        plant = Plant(args.program, out, args.bound, robot["id"])
        names = list(robot["joints"])
        at = np.array([plant.joints[f"{robot['id']}/{name}"] for name in names])
        own = [at for name, at in plant.joints.items() if name.startswith(f"{robot['id']}/")]
        start = plant.start[at]
        ranges = []
        for name in names:
            j = mujoco.mj_name2id(plant.model, mujoco.mjtObj.mjOBJ_JOINT, f"{robot['id']}/{name}")
            has = plant.model.jnt_limited[j]
            ranges.append(plant.model.jnt_range[j] if has else [-np.pi, np.pi])
        low, high = np.array(ranges).T
        done = {"free": 0, "blocked": 0}
        for _ in range(DRAWS * per_robot):
            if sum(done.values()) >= per_robot:
                break
            far = draw.uniform(0.05, 1.0) * np.minimum(high - low, 2.0)
            goal = np.clip(start + draw.uniform(-0.5, 0.5, len(at)) * far, low, high)
            goal = np.clip(goal, low + 1e-6 * (high - low), high - 1e-6 * (high - low))
            with tempfile.NamedTemporaryFile("w", suffix=".csv") as file:
                file.write(",".join(names) + "\n")
                for posture in (start, goal):
                    file.write(",".join(repr(float(v)) for v in posture) + "\n")
                file.flush()
                command = [args.program, "check", out, "--trajectory", file.name, "--json"]
                command += ["--robot", robot["id"], "--margin", MARGIN, "--progress", "none"]
                said = json.loads(call(*command, codes=(0, 1, 3)))
            outcome = said["outcome"]
            if outcome not in done or said["impossible"]:
                counts[outcome] = counts.get(outcome, 0) + 1
                continue
            if done[outcome] >= -(-per_robot // 2):
                continue
            done[outcome] += 1
            counts[outcome] += 1
            (depth, pair, share), gaped = plant.run(at, start, goal, own)
            hits = [c for c in said["contacts"] if c["level"] in ("hit", "inside")]
            row = {
                "plant": out.name if out.name != "result" else out.parent.name,
                "robot": f"{robot['id']} {robot['model']}", "pieces": plant.n_pieces,
                "check": outcome, "mujoco": "contact" if pair else "none",
                "deepest_mm": round(depth * 1e3, 1) if pair else "",
                "between": " and ".join(pair) if pair else "", "at": round(share, 3) if pair else "",
                "check_says": "; ".join(f"{c['link']} {c['level']} {c['what']}" for c in hits)[:160],
                "same": (outcome == "blocked") == bool(pair), "pins_gape_mm": round(gaped * 1e3, 4),
            }  # fmt: skip
            if writer.fieldnames is None:
                writer.fieldnames = list(row)
                writer.writeheader()
            writer.writerow(row)
            args.csv.flush()
        print(f"{out} {robot['id']}: {done}; all draws so far {counts}", file=sys.stderr)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--program", type=Path, required=True)
    parser.add_argument("out", type=Path, nargs="+", metavar="OUT")
    parser.add_argument("--paths", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--bound", type=float, default=0.02)
    parser.add_argument("--csv", type=argparse.FileType("w"), default=sys.stdout)
    args = parser.parse_args()
    args.program = args.program.resolve()
    draw = np.random.default_rng(args.seed)
    writer = csv.DictWriter(args.csv, None)
    for out in args.out:
        paths(args, out.resolve(), -(-args.paths // len(args.out)), draw, writer)


main()
