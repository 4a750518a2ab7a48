#!/usr/bin/env python3
"""Compares `check` with contacts in MuJoCo on drawn paths.

    scripts/cross/paths_in_mujoco.py --program target/release/stillpoint OUT...
                                     [--paths 100] [--seed 1] [--bound 0.02] [--csv FILE]
                                     [--truth SCANS...]

Robots are those of `export --to mjcf`; what stands still is the convex pieces of
`export --to mesh --convex`, which replace the scene's boxes and floor. Paths begin in the posture
that was found and go straight to a drawn one; of each robot as many are taken that `check` calls
free as blocked, where they can be had. Parts of one robot do not count, nor do pairs that touch in
the found posture and go no deeper. Joints that follow or close loops are solved in each posture.

A path differs if `check` calls it free and something touches, or blocked and nothing does. The
cause is one of these, or the path is a fault:

    hull      MuJoCo collides the hull of a link; the link's own triangles, in the same postures,
              keep out of all pieces
    margin    the link enters a piece, but is farther than the margin of `check` from all points:
              the piece stands out from the points by that much
    grazed    `check` calls it blocked, and in the posture that it names the link's own triangles are
              as near to a fixed point as what it adds to the distance: half a step, the ball of a cell
    as found  `check` lists the link as no nearer than as found: most points beside a link are its
              own and move with it, and the mesh has them as fixed
    touching  all links that hit something touch a piece as found, and pairs that do are left out
    beside    what it hits are not fixed points, but uncertain ones or another robot
    own       the point there is one of a robot by the truth, which masks missed: `check` has proof
              that it is a stray, and the mesh keeps it. Told with `--truth` only: for each OUT the
              folder of its drawn scans, with scans.e57 and truth/

Needs mujoco, open3d, scipy and numpy; with `--truth` pye57, too.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import mujoco
import numpy as np
import open3d as o3d
from scipy.spatial import ConvexHull, cKDTree

sys.path.insert(0, str(Path(__file__).parent.parent))
from figures import Figures  # noqa: E402
from mesh_quality import read_las  # noqa: E402

# Largest step between compared postures, radians or metres: 16 mm at a reach of 2 m.
STEP = 0.008
# Paths drawn for each that is wanted.
DRAWS = 16
MARGIN = 0.02
# By how much `check` brings a link nearer to a point: half a step of a path of 10 mm, and the ball
# about a cell of 4 mm in which the point lies anywhere.
ADDED = 0.005 + 2 * 0.00347
# Distance up to which MuJoCo tells gaps, metres.
LOOKED = 0.035
# How much deeper than as found a pair must go to touch anew, metres.
DEEPER = 0.001
# Mean distance between places on a link that are compared with a piece, metres.
SPACING = 0.003
# Distance up to which points are the same, for registration may move scans, metres.
SAME = 0.003
# LAS classes of points of robots and of what hangs on them.
MOVING = (65, 66)
# Those of the floor and of what is known to stand still.
STANDING = (2, 64)


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
        mesh = ["--to", "mesh", "--mesh-format", "ply", "--convex", "--bound", bound, "--robot", robot]
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
        self.corners = pieces(out / "export/mesh/convex.obj")
        for k, corners in enumerate(self.corners):
            middle = corners.mean(axis=0)
            near = (corners - middle).astype(np.float32)
            spec.add_mesh(name=f"piece_{k}", uservert=near.flatten())
            own = plant.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"piece_{k}")
            own.name, own.pos, own.mass, own.margin = f"piece_{k}", middle, 0, LOOKED
        self.n_pieces = len(self.corners)
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
        self.robot = f"{robot}/"
        self.touching = {}
        for pair, depth, _ in list(self.contacts()):
            if depth > 0:
                self.touching[pair] = max(depth, self.touching.get(pair, 0.0))
        self.places, self.trees, self.hulls = {}, {}, {}
        self.mesh = o3d.t.geometry.RaycastingScene()
        fixed = o3d.io.read_triangle_mesh(str(out / "export/mesh/fixed.ply"))
        self.middle = np.asarray(fixed.vertices).mean(axis=0)
        fixed.translate(-self.middle)
        self.mesh.add_triangles(o3d.t.geometry.TriangleMesh.from_legacy(fixed))

    def contacts(self):
        """Pairs of the robot and what is not its own up to LOOKED apart: names, depth, contact."""
        self.data.qpos[:] = self.qpos
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_collision(self.model, self.data)
        for k in range(self.data.ncon):
            contact = self.data.contact[k]
            links = [self.links[g] for g in contact.geom]
            if sum(link.startswith(self.robot) for link in links) != 1:
                continue
            pair = tuple(self.pieces[g] or link for g, link in zip(contact.geom, links))
            if -contact.dist > self.touching.get(pair, -1.0) + DEEPER:
                yield pair, -contact.dist, contact

    def surface(self, geom):
        """Places on the triangles of a geom, in its own frame."""
        if geom not in self.places:
            model, mesh = self.model, self.model.geom_dataid[geom]
            first, n = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
            vertices = model.mesh_vert[first : first + n]
            first, n = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
            triangles = o3d.utility.Vector3iVector(model.mesh_face[first : first + n])
            own = o3d.geometry.TriangleMesh(o3d.utility.Vector3dVector(vertices), triangles)
            o3d.utility.random.seed(1)
            drawn = own.sample_points_uniformly(int(own.get_surface_area() / SPACING**2) + 1)
            self.places[geom] = np.concatenate([vertices, np.asarray(drawn.points)])
            self.trees[geom] = cKDTree(self.places[geom])
        return self.places[geom]

    def own_depth(self, geoms):
        """How deep a link's own triangles are in a piece, and where; negative outside."""
        names = [self.pieces[g] or "" for g in geoms]
        own = next((k for k, name in enumerate(names) if name.startswith("piece_")), None)
        if own is None:
            return None
        piece, geom = int(names[own].split("_")[1]), geoms[1 - own]
        if piece not in self.hulls:
            self.hulls[piece] = ConvexHull(self.corners[piece]).equations
        planes, places = self.hulls[piece], self.surface(geom)
        turn, at = self.data.geom_xmat[geom].reshape(3, 3), self.data.geom_xpos[geom]
        corners = self.corners[piece]
        middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
        far = np.linalg.norm(corners - middle, axis=1).max() + LOOKED
        near = self.trees[geom].query_ball_point((middle - at) @ turn, far)
        if not near:
            return -LOOKED, at
        places = places[near]
        above = np.full(len(places), -np.inf)
        for plane in planes:
            above = np.maximum(above, places @ (turn.T @ plane[:3]) + (at @ plane[:3] + plane[3]))
        deepest = np.argmin(above)
        return float(-above[deepest]), turn @ places[deepest] + at

    def distances(self, place, points):
        """How far a place is from all points and from the mesh, metres; class of the point."""
        near = (place - self.middle).astype(np.float32)[None]
        from_mesh = float(self.mesh.compute_distance(near).numpy()[0])
        off, at = points[0].query(place)
        is_own = points[3] is not None and points[3].query(points[0].data[at])[0] < SAME
        return float(off), from_mesh, int(points[1][at]), is_own

    def from_points(self, said, at, start, goal, own, points):
        """The least distance of a link's own triangles from fixed points and the floor, in the
        postures in which `check` names a hit of that link."""
        least = None
        for contact in hits(said)[1]:
            self.qpos = self.start.copy()
            self.qpos[at] = start + contact["worst"] * (goal - start)
            self.follow(own, set(at))
            self.data.qpos[:] = self.qpos
            mujoco.mj_kinematics(self.model, self.data)
            for geom, link in enumerate(self.links):
                if link != self.robot + contact["link"] or self.model.geom_dataid[geom] < 0:
                    continue
                turn, to = self.data.geom_xmat[geom].reshape(3, 3), self.data.geom_xpos[geom]
                off = points[2].query(self.surface(geom) @ turn.T + to, distance_upper_bound=0.1)[0]
                least = float(off.min()) if least is None else min(least, float(off.min()))
        return least

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

    def run(self, at, start, goal, own, points):
        """What comes nearest along a path: of MuJoCo's bodies, and of the links' own triangles in
        the same pieces; and how far pins gaped."""
        n = max(2, int(np.ceil(np.abs(goal - start).max() / STEP)) + 1)
        nearest = {"depth": -LOOKED, "pair": None, "at": 0.0}
        links = {"depth": -LOOKED, "from": None, "link": ""}
        gaped = 0.0
        self.qpos = self.start.copy()
        for share in np.linspace(0.0, 1.0, n):
            self.qpos[at] = start + share * (goal - start)
            gaped = max(gaped, self.follow(own, set(at)))
            found = {}
            for pair, depth, contact in self.contacts():
                if depth > nearest["depth"]:
                    nearest = {"depth": depth, "pair": pair, "at": share}
                found[tuple(contact.geom)] = max(depth, found.get(tuple(contact.geom), -LOOKED))
            # Own triangles lie within the hull.
            for geoms, depth in sorted(found.items(), key=lambda pair: -pair[1]):
                if depth <= links["depth"]:
                    break
                inside = self.own_depth(geoms)
                if inside is None:
                    links = {"depth": depth, "from": None, "link": ""}
                elif min(inside[0], depth) > links["depth"]:
                    own_link = next(self.links[g] for g in geoms if self.links[g] != "plant")
                    links = {
                        "depth": min(inside[0], depth),
                        "from": self.distances(inside[1], points),
                        "link": own_link.split("/")[-1],
                    }
        return nearest, links, gaped


def hits(said):
    """Contacts for which `check` calls a path blocked, with what is known to stand still."""
    deep = [c for c in said["contacts"] if c["level"] in ("hit", "inside") and not c["as_found"]]
    return deep, [c for c in deep if c["what"] in ("fixed", "floor")]


def cause(said, nearest, links, touching, from_points):
    """Why a path differs; empty where it does not."""
    depth, own = nearest["depth"], links["depth"]
    if (said["outcome"] == "blocked") == (depth > 0):
        return ""
    if said["outcome"] == "free":
        if own <= 0:
            return "hull"
        if any(c["link"] == links["link"] and c["as_found"] for c in said["contacts"]):
            return "as found"
        if links["from"] and links["from"][3]:
            return "own"
        return "margin" if links["from"] and links["from"][0] >= MARGIN else "fault"
    _, standing = hits(said)
    if not standing:
        return "beside"
    if all(c["link"] in touching for c in standing):
        return "touching"
    return "grazed" if from_points is not None and from_points < ADDED + SPACING else "fault"


def goals(plant, robot, names, draw, n):
    """Postures at random distances from the one that was found."""
    at = np.array([plant.joints[f"{robot['id']}/{name}"] for name in names])
    ranges = []
    for name in names:
        j = mujoco.mj_name2id(plant.model, mujoco.mjtObj.mjOBJ_JOINT, f"{robot['id']}/{name}")
        ranges.append(plant.model.jnt_range[j] if plant.model.jnt_limited[j] else [-np.pi, np.pi])
    low, high = np.array(ranges).T
    start = plant.start[at]
    far = draw.uniform(0.05, 1.0, (n, 1)) * np.minimum(high - low, 4.0)
    goal = start + draw.uniform(-0.5, 0.5, (n, len(at))) * far
    return at, start, np.clip(goal, low + 1e-6 * (high - low), high - 1e-6 * (high - low))


def checked(args, out, robot, names, start, goals):
    """What `check` says of each path, in one call."""
    with tempfile.TemporaryDirectory() as folder:
        files = []
        for k, goal in enumerate(goals):
            rows = [",".join(repr(float(v)) for v in posture) for posture in (start, goal)]
            files.append(Path(folder) / f"{k}.csv")
            files[-1].write_text("\n".join([",".join(names), *rows]) + "\n")
        command = [args.program, "check", out, "--json", "--robot", robot["id"], "--margin", MARGIN]
        command += ["--progress", "none", "--trajectory", *files]
        return json.loads(call(*command, codes=(0, 1, 3)))["paths"]


def paths(args, out, robot, wanted, draw, points, figures):
    plant = Plant(args.program, out, args.bound, robot["id"])
    names = list(robot["joints"])
    at, start, drawn = goals(plant, robot, names, draw, DRAWS * wanted)
    own = [at for name, at in plant.joints.items() if name.startswith(f"{robot['id']}/")]
    said = checked(args, out, robot, names, start, drawn)
    outcomes = [path["outcome"] for path in said]
    touching = {link.split("/")[-1] for pair in plant.touching for link in pair if "/" in link}
    taken = []
    for outcome in ("free", "blocked"):
        able = [k for k, path in enumerate(said) if path["outcome"] == outcome and not path["impossible"]]
        taken += able[: -(-wanted // 2)]
    for k in sorted(taken):
        nearest, links, gaped = plant.run(at, start, drawn[k], own, points)
        differs = (said[k]["outcome"] == "blocked") != (nearest["depth"] > 0)
        from_points = None
        if differs and said[k]["outcome"] == "blocked":
            from_points = plant.from_points(said[k], at, start, drawn[k], own, points)
        mm = lambda v: f"< {-LOOKED * 1e3:.0f}" if v <= -LOOKED else round(v * 1e3, 1)
        row = {
            "plant": out.name if out.name not in ("result", "out") else out.parent.name,
            "robot": f"{robot['id']} {robot['model']}", "pieces": plant.n_pieces,
            "bound_mm": mm(args.bound), "margin_mm": mm(MARGIN),
            "check": outcomes[k], "mujoco": "contact" if nearest["depth"] > 0 else "none",
            "depth_mm": mm(nearest["depth"]), "between": " and ".join(nearest["pair"] or ()),
            "at": round(nearest["at"], 3) if nearest["pair"] else "",
            "links_own_depth_mm": mm(links["depth"]),
            "there_from_points_mm": mm(links["from"][0]) if links["from"] else "",
            "there_from_mesh_mm": mm(links["from"][1]) if links["from"] else "",
            "there_class": links["from"][2] if links["from"] else "",
            "check_hits": "; ".join(sorted({f"{c['link']} {c['what']}" for c in hits(said[k])[0]}))[:120],
            "hit_from_points_mm": mm(from_points) if from_points is not None else "",
            "differs": cause(said[k], nearest, links, touching, from_points),
            "pins_gape_mm": round(gaped * 1e3, 4),
        }  # fmt: skip
        figures.add(row)
    counts = {outcome: outcomes.count(outcome) for outcome in sorted(set(outcomes))}
    print(f"{out} {robot['id']}: {len(taken)} taken of {counts}", file=sys.stderr)


def true_moving(folder):
    """Points of robots and of what hangs on them by the truth, world frame, metres."""
    from mesh_cells import scans

    parts = []
    for k, (at, is_there) in enumerate(scans(folder)):
        kind = np.load(folder / f"truth/labels/{k}.kind.npy")
        parts.append(at[is_there][(kind == 1) | (kind == 2)])
    return np.concatenate(parts)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--program", type=Path, required=True)
    parser.add_argument("out", type=Path, nargs="+", metavar="OUT")
    parser.add_argument("--paths", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--bound", type=float, default=0.02)
    parser.add_argument("--csv", type=argparse.FileType("w"), default=sys.stdout)
    parser.add_argument("--truth", type=Path, nargs="+", default=[])
    args = parser.parse_args()
    truths = dict(zip(map(Path.resolve, args.out), args.truth))
    args.program = args.program.resolve()
    draw = np.random.default_rng(args.seed)
    figures = Figures(args.csv)
    robots = []
    for out in map(Path.resolve, args.out):
        found = json.load(open(out / "result.json"))["robots"]
        robots += [(out, r) for r in found if r["verdict"] == "trusted" and r.get("space")]
    for k, (out, robot) in enumerate(robots):
        if k == 0 or out != robots[k - 1][0]:
            call(args.program, "export", out, "--to", "mjcf", "--progress", "none")
            tiles = [read_las(path) for path in sorted((out / "tiles").glob("*.las"))]
            stands = [~np.isin(kinds, MOVING) for _, kinds in tiles]
            xyz, kinds = (np.concatenate([t[i][own] for t, own in zip(tiles, stands)]) for i in (0, 1))
            moving = cKDTree(true_moving(truths[out])) if out in truths else None
            points = cKDTree(xyz), kinds, cKDTree(xyz[np.isin(kinds, STANDING)]), moving
        paths(args, out, robot, -(-args.paths // len(robots)), draw, points, figures)


main()
