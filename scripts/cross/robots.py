#!/usr/bin/env python3
"""One reader of robots: a URDF and joint values (JSON) in; poses of links against the root, and the box around all surfaces,
out as JSON. Run by cross.py in a process of its own."""

import json
import sys
from pathlib import Path

import numpy as np


def box(points):
    points = np.concatenate(points) if points else np.zeros((0, 3))
    return [points.min(axis=0).tolist(), points.max(axis=0).tolist()] if len(points) else None


def place(pose, points):
    pose = np.asarray(pose)
    return np.asarray(points) @ pose[:3, :3].T + pose[:3, 3]


def yourdfpy(path, joints):
    from yourdfpy import URDF

    robot = URDF.load(path)
    robot.update_cfg({name: joints[name] for name in robot.actuated_joint_names})
    poses = {link: robot.get_transform(link) for link in robot.link_map}
    return poses, np.asarray(robot.scene.bounds).tolist()


def urchin(path, joints):
    from urchin import URDF

    robot = URDF.load(path)
    cfg = {joint.name: joints[joint.name] for joint in robot.actuated_joints}
    poses = {link.name: pose for link, pose in robot.link_fk(cfg=cfg).items()}
    meshes = robot.visual_trimesh_fk(cfg=cfg)
    return poses, box([place(pose, mesh.vertices) for mesh, pose in meshes.items()])


def pytransform3d(path, joints):
    from pytransform3d.urdf import UrdfTransformManager

    robot = UrdfTransformManager()
    robot.load_urdf(Path(path).read_text(), mesh_path=str(Path(path).parent) + "/")
    for name in robot._joints:
        if name in joints:
            robot.set_joint(name, joints[name])
    import xml.etree.ElementTree as ET

    tree = ET.parse(path).getroot()
    links = [link.get("name") for link in tree.findall("link")]
    root = next(iter(set(links) - {c.get("link") for c in tree.findall("joint/child")}))
    return {link: robot.get_transform(link, root) for link in links}, None


def pinocchio(path, joints):
    import pinocchio as pin

    model = pin.buildModelFromUrdf(path)
    q = pin.neutral(model)
    for name, value in joints.items():
        if model.existJointName(name):
            joint = model.joints[model.getJointId(name)]
            q[joint.idx_q:joint.idx_q + joint.nq] = [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    poses = {f.name: data.oMf[i].homogeneous for i, f in enumerate(model.frames) if f.type == pin.FrameType.BODY}
    shapes = pin.buildGeomFromUrdf(model, path, pin.GeometryType.VISUAL, package_dirs=[str(Path(path).parent)])
    placed = shapes.createData()
    pin.updateGeometryPlacements(model, data, shapes, placed)
    points = []
    for shape, pose in zip(shapes.geometryObjects, placed.oMg):
        vertices = shape.geometry.vertices() if callable(shape.geometry.vertices) else shape.geometry.vertices
        points.append(place(pose.homogeneous, vertices))
    return poses, box(points)


def pybullet(path, joints):
    import pybullet as b

    b.connect(b.DIRECT)
    body = b.loadURDF(path, useFixedBase=True)
    names = [b.getJointInfo(body, j)[1].decode() for j in range(b.getNumJoints(body))]
    for j, name in enumerate(names):
        if name in joints:
            b.resetJointState(body, j, joints[name])

    def matrix(at, turn):
        pose = np.eye(4)
        pose[:3, :3] = np.reshape(b.getMatrixFromQuaternion(turn), (3, 3))
        pose[:3, 3] = at
        return pose

    centre = matrix(*b.getBasePositionAndOrientation(body))
    inertial = b.getDynamicsInfo(body, -1)[3:5]
    base = centre @ np.linalg.inv(matrix(*inertial))
    poses = {b.getBodyInfo(body)[0].decode(): np.eye(4)}
    for j in range(len(names)):
        state = b.getLinkState(body, j, computeForwardKinematics=True)
        poses[b.getJointInfo(body, j)[12].decode()] = np.linalg.inv(base) @ matrix(*state[4:6])
    corners = [np.array(b.getAABB(body, j)) for j in range(-1, len(names)) if b.getCollisionShapeData(body, j)]
    return poses, box(corners)


def mujoco(path, joints):
    import mujoco as mj

    model = mj.MjModel.from_xml_path(path)
    data = mj.MjData(model)
    for j in range(model.njnt):
        data.qpos[model.jnt_qposadr[j]] = joints[model.joint(j).name]
    mj.mj_forward(model, data)
    poses = {model.body(i).name: pose_of(data.xpos[i], data.xmat[i]) for i in range(1, model.nbody)}
    points = []
    for g in range(model.ngeom):
        m = model.geom_dataid[g]
        if m >= 0:
            from_, n = model.mesh_vertadr[m], model.mesh_vertnum[m]
            points.append(place(pose_of(data.geom_xpos[g], data.geom_xmat[g]), model.mesh_vert[from_:from_ + n]))
    return poses, box(points)


def pose_of(at, turn):
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = np.reshape(turn, (3, 3)), at
    return pose


READERS = {f.__name__: f for f in (yourdfpy, urchin, pytransform3d, pinocchio, pybullet, mujoco)}

if __name__ == "__main__":
    reader, path, joints, out = sys.argv[1:]
    poses, bounds = READERS[reader](path, json.loads(Path(joints).read_text()))
    poses = {name: np.asarray(pose).tolist() for name, pose in poses.items()}
    Path(out).write_text(json.dumps({"poses": poses, "bounds": bounds}))
