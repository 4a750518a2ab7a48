import os

from robodk import robolink, robomath

HERE = os.path.dirname(os.path.abspath(__file__))


def shape(station, name, file, pose, frame):
    """Adds a mesh in metres at a pose in a frame."""
    item = station.AddFile(os.path.join(HERE, *file.split("/")), frame)
    item.setName(name)
    item.Scale(1000)
    item.setPose(robomath.xyzrpw_2_pose(pose))
    return item


def robot_of_station(station, robot_id, taken):
    """The robot of the station for one of the plant, or None. Where no name is the same RoboDK gives the closest one."""
    wanted = STATION_NAMES.get(robot_id)
    item = station.Item(wanted, robolink.ITEM_TYPE_ROBOT) if wanted else None
    if wanted in taken:
        why = f"{wanted!r} of the station is {taken[wanted]}; give this one another name in STATION_NAMES"
    elif item is None or not item.Valid() or item.Name() != wanted:
        why = f"the station has no robot {wanted!r}"
    else:
        taken[wanted] = robot_id
        return item
    print(f"{robot_id}: {why}; its links are shown as they stand")
    return None


def main():
    station = robolink.Robolink()
    world = station.AddFrame("Plant")
    for name, file, pose in FIXED:
        shape(station, name, file, pose, world)
    taken = {}
    for robot_id, robot in ROBOTS.items():
        item = robot_of_station(station, robot_id, taken)
        if item is None:
            frame = station.AddFrame(robot_id, world)
            for name, file, pose in LINKS[robot_id]:
                shape(station, f"{robot_id}/{name}", file, pose, frame)
            continue
        base = station.AddFrame(f"{robot_id} base", world)
        base.setPose(robomath.xyzrpw_2_pose(robot["base"]))
        item.setParent(base)
        item.setPose(robomath.eye(4))
        values = robot["joints"]
        item.setJoints([sign * values[name] + added for name, sign, added in JOINTS[robot_id]])


if __name__ == "__main__":
    main()
