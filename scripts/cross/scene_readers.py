#!/usr/bin/env python3
"""Readers of scenes that are not ours. Each takes the folder of a format, the robots as they must stand and the names, and gives
what it found: poses of links, limits of joints, gaps of loops, complaints. Run by scene.py, each in a process of its own."""

import json
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

from scene_stand_ins import moveit, robodk
from scene_truth import Names, apart, of_library, of_result, pose

CLOSED = 1e-4


class Findings:
    """Largest deviations, and what is wrong."""

    def __init__(self):
        self.metres = self.radians = self.limits = self.gap = 0.0
        self.n_links = self.n_limits = self.n_pins = 0
        self.wrong, self.said = [], []

    def link(self, robot, name, found):
        metres, radians = apart(robot.links[name], np.asarray(found))
        self.metres, self.radians = max(self.metres, metres), max(self.radians, radians)
        self.n_links += 1

    def limit(self, robot, name, low, high, effort=None, velocity=None):
        """Compares what a reader takes for limits with the library's; followers without limits may have any."""
        joint = robot.joints[name]
        pairs = []
        # Limits of a follower that its library sets so that it cannot follow are written wider.
        ends = joint["limits"]
        obeys = not joint["follows"] or not ends or ends[0] - 1e-9 <= robot.values[name] <= ends[1] + 1e-9
        if ends and ends[0] < ends[1] and obeys:
            pairs += list(zip(joint["limits"], (low, high)))
        pairs += [(joint[key], value) for key, value in (("effort", effort), ("velocity", velocity)) if joint[key] and value is not None]
        for wanted, found in pairs:
            self.limits = max(self.limits, abs(wanted - found) / max(1.0, abs(wanted)))
        self.n_limits += 1

    def shape(self, name, wanted, found):
        """Compares triangles in a link's frame: bounds, area, and volume, whose sign is that of the outside."""
        def facts(t):
            n = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
            return [t.min((0, 1)), t.max((0, 1)), np.linalg.norm(n, axis=1).sum() / 2, (t[:, 0] * n).sum() / 6]
        ends = [facts(np.asarray(t, dtype=float)) for t in (wanted, found)]
        self.metres = max(self.metres, *(float(np.abs(a - b).max()) for a, b in zip(ends[0][:2], ends[1][:2])))
        for kind, a, b in [("area", ends[0][2], ends[1][2]), ("volume", ends[0][3], ends[1][3])]:
            if abs(a - b) > 1e-4 * max(abs(a), 1e-3):
                self.wrong.append(f"{name}: {kind} {b:.6f} instead of {a:.6f}")
        self.n_links += 1

    def text(self):
        return json.dumps(vars(self))


def rigid(at, turn):
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = np.reshape(turn, (3, 3)), at
    return out


def urdf_values(robot, names):
    """Values by written name of all joints that move."""
    return {names.joint(robot.id, name): robot.values[name] for name in robot.joints}


def yourdfpy(folder, robots, names, out):
    from yourdfpy import URDF

    for robot in robots:
        read = URDF.load(str(folder / robot.id / "robot.urdf"))
        if not read.validate():
            out.wrong += [f"{robot.id}: {error}" for error in read.errors]
        values = urdf_values(robot, names)
        read.update_cfg({name: values[name] for name in read.actuated_joint_names})
        for name in robot.links:
            out.link(robot, name, read.get_transform(names.link(robot.id, name), "world"))
        for name, joint in robot.joints.items():
            limit = read.joint_map[names.joint(robot.id, name)].limit
            if limit is not None:
                out.limit(robot, name, limit.lower, limit.upper, limit.effort, limit.velocity)


def pinocchio(folder, robots, names, out):
    import pinocchio as pin

    for robot in robots:
        path = str(folder / robot.id / "robot.urdf")
        model = pin.buildModelFromUrdf(path, mimic=True)
        q = pin.neutral(model)
        for name, value in urdf_values(robot, names).items():
            joint = model.joints[model.getJointId(name)] if model.existJointName(name) else None
            if joint is not None and joint.nq:
                at = slice(joint.idx_q, joint.idx_q + joint.nq)
                q[at] = [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
        data = model.createData()
        pin.framesForwardKinematics(model, data, q)
        frames = {f.name: data.oMf[i].homogeneous for i, f in enumerate(model.frames) if f.type == pin.FrameType.BODY}
        for name in robot.links:
            out.link(robot, name, frames[names.link(robot.id, name)])
        for name, own in robot.joints.items():
            written = names.joint(robot.id, name)
            joint = model.joints[model.getJointId(written)] if model.existJointName(written) else None
            if joint is not None and joint.nq == 1 and not own["follows"]:
                at, v = joint.idx_q, joint.idx_v
                out.limit(robot, name, model.lowerPositionLimit[at], model.upperPositionLimit[at],
                          model.upperEffortLimit[v], model.upperVelocityLimit[v])
        srdf = folder / robot.id / "robot.srdf"
        if srdf.is_file():
            pin.loadReferenceConfigurations(model, str(srdf), False)
            found = model.referenceConfigurations["as_found"]
            n_wrong = sum(
                abs(found[joint.idx_q] - robot.values[name]) > 1e-9
                for name, own in robot.joints.items()
                if not own["follows"] and own["type"] != "continuous" and model.existJointName(names.joint(robot.id, name))
                for joint in [model.joints[model.getJointId(names.joint(robot.id, name))]] if joint.nq == 1
            )
            out.wrong += [f"{robot.id}: {n_wrong} values of as_found differ"] if n_wrong else []
        if not all(inertia.mass > 0 for inertia in list(model.inertias)[1:]):
            out.wrong.append(f"{robot.id}: a moving joint carries no mass")


def pybullet(folder, robots, names, out):
    import pybullet as b

    b.connect(b.DIRECT)
    for robot in robots:
        body = b.loadURDF(str(folder / robot.id / "robot.urdf"), useFixedBase=True)
        values = urdf_values(robot, names)
        links = {names.link(robot.id, name): name for name in robot.links}
        joints = {names.joint(robot.id, name): name for name in robot.joints}
        for j in range(b.getNumJoints(body)):
            name = b.getJointInfo(body, j)[1].decode()
            if name in values:
                b.resetJointState(body, j, values[name])
        for j in range(b.getNumJoints(body)):
            info = b.getJointInfo(body, j)
            state = b.getLinkState(body, j, computeForwardKinematics=True)
            turn = b.getMatrixFromQuaternion(state[5])
            if info[12].decode() in links:
                out.link(robot, links[info[12].decode()], rigid(state[4], turn))
            if info[1].decode() in joints and robot.joints[joints[info[1].decode()]]["limits"]:
                out.limit(robot, joints[info[1].decode()], info[8], info[9], info[10], info[11])


def mujoco_model(path, robots, names, out, found):
    import mujoco as mj

    model = mj.MjModel.from_xml_path(str(path))
    data = mj.MjData(model)
    found(mj, model, data)
    mj.mj_forward(model, data)
    for robot in robots:
        for name in robot.links:
            at = mj.mj_name2id(model, mj.mjtObj.mjOBJ_BODY, names.link(robot.id, name))
            if at >= 0:
                out.link(robot, name, rigid(data.xpos[at], data.xmat[at]))
        for name, own in robot.joints.items():
            at = mj.mj_name2id(model, mj.mjtObj.mjOBJ_JOINT, names.joint(robot.id, name))
            if at < 0:
                continue
            if own["limits"] and not model.jnt_limited[at]:
                out.wrong.append(f"{robot.id}: {name} has no limits")
            out.limit(robot, name, *model.jnt_range[at])
    return mj, model, data


def mujoco(folder, robots, names, out):
    """MJCF: the key frame, equalities, and half a second in which the arms hang in their brakes."""
    mj, model, data = mujoco_model(folder / "plant.xml", robots, names, out,
                                   lambda mj, model, data: mj.mj_resetDataKeyframe(model, data, 0))
    if (model.nkey, model.key_qpos.shape[1]) != (1, model.nq):
        out.wrong.append("the key frame does not fit")
    out.n_pins = int(sum(model.eq_type == mj.mjtEq.mjEQ_CONNECT))
    rows = [data.efc_pos[i] for i in range(data.nefc) if data.efc_type[i] == mj.mjtConstraint.mjCNSTR_EQUALITY]
    out.gap = float(np.abs(rows).max()) if rows else 0.0
    robot_geoms = [g for g in range(model.ngeom) if model.geom_type[g] == mj.mjtGeom.mjGEOM_MESH]
    pairs = [(c.geom1 in robot_geoms) + (c.geom2 in robot_geoms) for c in data.contact]
    start = data.qpos.copy()
    for _ in range(round(0.1 / model.opt.timestep)):
        mj.mj_step(model, data)
    moved = float(np.abs(data.qpos - start).max()) if len(start) else 0.0
    if moved > 0.01:
        out.wrong.append(f"a joint moves by {moved:.2g} rad or m within 0.1 s")
    out.said.append(f"{model.nbody} bodies, {model.neq} equalities, {model.ngeom} geoms; as found {pairs.count(2)} contacts between links "
                    f"and {pairs.count(1)} with what stands still; joints move {moved:.1e} within 0.1 s")


def mujoco_urdf(folder, robots, names, out):
    for robot in robots:
        def found(mj, model, data):
            values = urdf_values(robot, names)
            for j in range(model.njnt):
                data.qpos[model.jnt_qposadr[j]] = values[model.joint(j).name]

        mujoco_model(folder / robot.id / "robot.urdf", [robot], names, out, found)


def usd(folder, robots, names, out):
    from pxr import Usd, UsdGeom, UsdPhysics, UsdValidation

    stage = Usd.Stage.Open(str(folder / "plant.usda"))
    context = UsdValidation.ValidationContext(UsdValidation.ValidationRegistry().GetOrLoadAllValidators())
    out.wrong += [f"{e.GetName()}: {e.GetMessage()}" for e in context.Validate(stage)]
    if UsdGeom.GetStageMetersPerUnit(stage) != 1 or UsdGeom.GetStageUpAxis(stage) != "Z":
        out.wrong.append("units or axis are others")
    cache = UsdGeom.XformCache()

    def place(prim):
        return np.array(cache.GetLocalToWorldTransform(prim)).T

    def frame(joint, end):
        at = joint.GetAttribute(f"physics:localPos{end}").Get()
        q = joint.GetAttribute(f"physics:localRot{end}").Get()
        return pose({"xyz": list(at), "quat_wxyz": [q.GetReal(), *q.GetImaginary()]})

    for robot in robots:
        path = f"/World/{names.robot(robot.id)}"
        for name in robot.links:
            out.link(robot, name, place(stage.GetPrimAtPath(f"{path}/{names.link(robot.id, name)}")))
        worst = 0.0
        for name, own in robot.joints.items():
            prim = stage.GetPrimAtPath(f"{path}/{names.joint(robot.id, name)}")
            joint = UsdPhysics.Joint(prim)
            a, b = (stage.GetPrimAtPath(rel.GetTargets()[0]) for rel in (joint.GetBody0Rel(), joint.GetBody1Rel()))
            moved = np.eye(4)
            value, slides = robot.values[name], own["type"] == "prismatic"
            if prim.IsA(UsdPhysics.FixedJoint):
                value = 0.0
            c, s = np.cos(value), np.sin(value)
            if slides:
                moved[0, 3] = value
            else:
                moved[1:3, 1:3] = [[c, -s], [s, c]]
            walked = place(a) @ frame(prim, 0) @ moved @ np.linalg.inv(frame(prim, 1))
            worst = max(worst, *apart(walked, place(b)))
            if own["limits"] and not prim.IsA(UsdPhysics.FixedJoint):
                unit = 1.0 if slides else np.pi / 180
                ends = [prim.GetAttribute(f"physics:{end}Limit").Get() * unit for end in ("lower", "upper")]
                # Single precision in degrees.
                out.limit(robot, name, *[w if abs(w - e) < 2e-6 else e for w, e in zip(own["limits"], ends)])
        if worst > 2e-6:
            out.wrong.append(f"{robot.id}: frames of joints do not meet by {worst:.1e}")
        for prim in stage.GetPrimAtPath(path).GetChildren():
            if prim.GetName().startswith("pin_") and prim.IsA(UsdPhysics.RevoluteJoint):
                joint = UsdPhysics.Joint(prim)
                a, b = (stage.GetPrimAtPath(rel.GetTargets()[0]) for rel in (joint.GetBody0Rel(), joint.GetBody1Rel()))
                out.gap = max(out.gap, apart(place(a) @ frame(prim, 0), place(b) @ frame(prim, 1))[0])
                out.n_pins += 1
                if not joint.GetExcludeFromArticulationAttr().Get():
                    out.wrong.append(f"{prim.GetPath()} is in the articulation")


def sdf_pose(element):
    words = [float(w) for w in (element.findtext("pose") or "0 0 0 0 0 0 1").split()]
    return pose({"xyz": words[:3], "quat_wxyz": [words[6], *words[3:6]]})


def sdf(folder, robots, names, out):
    """libsdformat's own check, and a walk over its poses and limits."""
    path = folder / "plant.sdf"
    ran = subprocess.run(["ign", "sdf", "-k", str(path)], capture_output=True, text=True, check=False,
                         env={"IGN_CONFIG_PATH": "/usr/share/ignition", "PATH": "/usr/bin:/bin"})
    lines = (ran.stdout + ran.stderr).strip().splitlines()
    said = "\n".join(line for line in lines if "Improved backtrace" not in line)
    # SDF of a newer version prints an error, then "Valid.", and ends with 0.
    if ran.returncode or said != "Valid.":
        out.wrong.append(f"ign sdf -k: {said[:300]}")
    models = {m.get("name"): m for m in ET.parse(path).getroot().iter("model")}
    for robot in robots:
        model = models[names.robot(robot.id)]
        links = {link.get("name"): sdf_pose(model) @ sdf_pose(link) for link in model.findall("link")}
        joints = {joint.get("name"): joint for joint in model.findall("joint")}
        for name in robot.links:
            out.link(robot, name, links[names.link(robot.id, name)])
        for name, own in robot.joints.items():
            limit = joints[names.joint(robot.id, name)].find("axis/limit")
            if own["limits"] and limit is not None:
                low, high, effort, velocity = (float(limit.findtext(t)) for t in ("lower", "upper", "effort", "velocity"))
                value = robot.values[name]
                out.limit(robot, name, low + value, high + value, effort, velocity)
        n_pins = sum(name.startswith("pin_") for name in joints)
        out.said += [f"{robot.id}: {n_pins} pins, of which SDF states one side"] if n_pins else []


def gltf(folder, robots, names, out):
    import trimesh

    scene = trimesh.load(str(folder / "plant.glb"), force="scene")
    y_up = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1.0]])
    for robot in robots:
        for name in robot.links:
            found, _ = scene.graph.get(names.link(robot.id, name))
            out.link(robot, name, np.linalg.inv(y_up) @ found)
    extras = {child: edge.get("metadata", {}) for (_, child), edge in scene.graph.transforms.edge_data.items()}
    for robot in robots:
        told = [extras.get(names.link(robot.id, name), {}).get("joint") for name in robot.links]
        by_joint = {joint["name"]: joint for joint in told if joint}
        for name, own in robot.joints.items():
            if own["limits"] and by_joint[name].get("limits"):
                joint = by_joint[name]
                out.limit(robot, name, *joint["limits"], joint["effort"], joint["velocity"])


def links_in_order(robot, names):
    return [name for of, kind, name in names.all if (of, kind) == (robot.id, "link")]


def own_meshes(robot, names, read):
    """Triangles of each link's own mesh as the library and as a scene have them; `read` takes how the name of the mesh begins."""
    from scene_truth import library_shapes

    for name, wanted in library_shapes(robot.folder).items():
        # A model may have another URDF for its loops.
        if name not in robot.links:
            continue
        found = read(f"{links_in_order(robot, names).index(name):02}_")
        if found is not None:
            yield name, wanted, found


def shapes_urdf(folder, robots, names, out):
    import trimesh

    for robot in robots:
        def read(start):
            paths = [p for p in (folder / robot.id / "meshes").glob(f"{start}*.stl") if "_hanging_" not in p.name]
            return trimesh.load(paths[0], process=False).triangles if paths else None

        for name, wanted, found in own_meshes(robot, names, read):
            out.shape(f"{robot.id} {name}", wanted, found)


def shapes_gltf(folder, robots, names, out):
    import trimesh

    scene = trimesh.load(str(folder / "plant.glb"), force="scene", process=False)
    for robot in robots:
        def read(start):
            nodes = [n for n in scene.graph.nodes_geometry if n.startswith(f"{robot.id}/{start}") and "_hanging_" not in n]
            return scene.geometry[scene.graph[nodes[0]][1]].triangles if nodes else None

        for name, wanted, found in own_meshes(robot, names, read):
            out.shape(f"{robot.id} {name}", wanted, found)


def shapes_usd(folder, robots, names, out):
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(folder / "plant.usda"))
    for robot in robots:
        by_start = {f"{at:02}_": name for at, name in enumerate(links_in_order(robot, names))}

        def read(start):
            path = f"/World/{names.robot(robot.id)}/{names.link(robot.id, by_start[start])}/body_0/mesh"
            mesh = UsdGeom.Mesh(stage.GetPrimAtPath(path))
            if not mesh:
                return None
            points, corners = np.array(mesh.GetPointsAttr().Get()), np.array(mesh.GetFaceVertexIndicesAttr().Get())
            return points[corners].reshape(-1, 3, 3)

        for name, wanted, found in own_meshes(robot, names, read):
            out.shape(f"{robot.id} {name}", wanted, found)


READERS = {f.__name__: f for f in (yourdfpy, pinocchio, pybullet, moveit, mujoco, mujoco_urdf, usd, sdf, gltf, robodk,
                                shapes_urdf, shapes_gltf, shapes_usd)}

if __name__ == "__main__":
    reader, folder, source, library = sys.argv[1], *map(Path, sys.argv[2:5])
    robots = of_result(source, library) if source.is_dir() else of_library(source, library)
    findings = Findings()
    READERS[reader](folder, robots, Names(folder / "names.csv"), findings)
    print(findings.text())
