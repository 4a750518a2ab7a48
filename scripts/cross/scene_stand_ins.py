"""Stand-ins for programs that cannot be run here: MoveIt's reader of planning scenes, and RoboDK's API, which records what is
asked of it. Both take the folder of the format, the robots as they must stand, the names, and the findings."""

import importlib
import sys
import types
from pathlib import Path

import numpy as np

from scene_truth import apart, pose


def moveit(folder, robots, names, out):
    """The planning scene, read line by line as PlanningScene::loadGeometryFromStream does: a stand-in that we wrote by its source."""
    order = {robot.id: [name for of, kind, name in names.all if (of, kind) == (robot.id, "link")] for robot in robots}
    by_id = {robot.id: robot for robot in robots}
    for own in robots:
        lines = iter((folder / own.id / "plant.scene").read_text().splitlines())

        def numbers(n):
            found = [float(word) for word in next(lines).split()]
            if len(found) != n:
                raise ValueError(f"{len(found)} numbers instead of {n}")
            return found

        def place():
            xyz, (x, y, z, w) = numbers(3), numbers(4)
            if abs(np.linalg.norm([x, y, z, w]) - 1) > 1e-9:
                raise ValueError("a quaternion is no unit")
            return pose({"xyz": xyz, "quat_wxyz": [w, x, y, z]})

        next(lines)
        n_objects = 0
        while (line := next(lines)) != ".":
            if not line.startswith("* "):
                raise ValueError(f"no object begins with {line!r}")
            name, at = line[2:], place()
            n_objects += 1
            for _ in range(int(numbers(1)[0])):
                kind = next(lines)
                if kind == "box":
                    numbers(3)
                elif kind == "mesh":
                    n_vertices, n_triangles = (int(v) for v in numbers(2))
                    for _ in range(n_vertices):
                        numbers(3)
                    if not all(0 <= corner < n_vertices for _ in range(n_triangles) for corner in numbers(3)):
                        raise ValueError("a triangle names a vertex that is not there")
                else:
                    raise ValueError(f"no shape is {kind!r}")
                place()
                numbers(4)
            if numbers(1) != [0]:
                raise ValueError("frames within an object")
            robot, _, link = name.rpartition("_")
            if robot in by_id:
                out.link(by_id[robot], order[robot][int(link)], at)
        out.said.append(f"{own.id}: {n_objects} objects")


def robodk(folder, robots, names, out):
    """The script, run against a stand-in of RoboDK that records what is asked of it; poses by robodk's own robomath."""
    from robodk import robomath

    calls = []

    class Item:
        def __init__(self, name, parent=None, valid=True):
            self.name, self.parent, self.pose, self.valid, self.scale = name, parent, robomath.eye(4), valid, None
            calls.append(self)

        def Valid(self):
            return self.valid

        def Name(self):
            return self.name

        def setName(self, name):
            self.name = name

        def setPose(self, pose):
            self.pose = pose

        def setParent(self, parent):
            self.parent = parent

        def setJoints(self, joints):
            self.joints = joints

        def Scale(self, scale):
            self.scale = scale

    class Robolink:
        station = []

        def AddFrame(self, name, parent=None):
            return Item(name, parent)

        def AddFile(self, path, parent=None):
            if not Path(path).is_file():
                out.wrong.append(f"{path} is not there")
            return Item(path, parent)

        def Item(self, name, kind=None):
            """As RoboDK does: without an exact match some other one."""
            found = [item for item in self.station if item.name == name] or self.station[:1]
            return found[0] if found else Item(name, valid=False)

    stand_in = types.ModuleType("robodk.robolink")
    stand_in.Robolink, stand_in.ITEM_TYPE_ROBOT = Robolink, 2
    sys.modules["robodk.robolink"] = stand_in
    importlib.import_module("robodk").robolink = stand_in
    sys.path.insert(0, str(folder))
    script = importlib.import_module("plant")

    def world(item):
        own = np.array(item.pose.rows if hasattr(item.pose, "rows") else item.pose, dtype=float).reshape(4, 4)
        own[:3, 3] /= 1000
        return own if item.parent is None else world(item.parent) @ own

    def linked(shown):
        for robot in shown:
            for item in (i for i in calls if i.name.startswith(f"{robot.id}/")):
                out.link(robot, item.name.split("/", 1)[1], world(item))
                if item.scale != 1000:
                    out.wrong.append("a mesh in metres is not scaled to millimetres")

    # A station with one robot of each model: of two robots of one model the second is shown by its links.
    Robolink.station = [Item(name) for name in sorted(set(script.STATION_NAMES.values()))]
    script.main()
    moved = {}
    for robot in robots:
        moved.setdefault(script.STATION_NAMES[robot.id], robot)
    for name, robot in moved.items():
        item = next(i for i in Robolink.station if i.name == name)
        base = world(item.parent)
        root = min(robot.links, key=lambda name: apart(robot.links[name], base)[0] + apart(robot.links[name], base)[1])
        out.link(robot, root, base)
        wanted = [robot.values[name] * (1000 if robot.joints[name]["type"] == "prismatic" else 180 / np.pi)
                  for name, _, _ in script.JOINTS[robot.id]]
        out.limits = max([out.limits] + [abs(w - f) for w, f in zip(wanted, item.joints, strict=True)])
    linked([robot for robot in robots if robot not in moved.values()])
    # A station with some other robot, which must stay where it is.
    calls.clear()
    Robolink.station = [Item("Another robot")]
    script.main()
    if Robolink.station[0].parent is not None:
        out.wrong.append("a robot of the station that is not named was moved")
    linked(robots)
