"""Robots in arrays: the same as a run finds in a file of the same points."""

import pathlib
import tomllib
from typing import Any

import laspy
import numpy as np
import pytest
from numpy.typing import NDArray

import stillpoint
from conftest import Demo
from stillpoint._robot import pose

#: Largest difference of joints and positions, radians and metres: arrays are brought to the frame of
#: their scanner in another order of additions than steps of a file, which may round a coordinate in
#: single precision the other way.
SAME = 1e-6


def scanned(demo: Demo) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]]:
    """Points of each scanner, and its pose."""
    las = laspy.read(demo.las)
    stated = tomllib.loads(demo.scanners.read_text())["scanner"]
    xyz, ids = np.asarray(las.xyz), np.asarray(las.point_source_id)
    points = [np.ascontiguousarray(xyz[ids == one["point_source_id"]]) for one in stated]
    entries = [{"xyz": one["position"], "quat_wxyz": one["quaternion_wxyz"]} for one in stated]
    return points, [pose(entry) for entry in entries]


def test_arrays_give_the_robots_of_a_run_on_the_same_points(
    demo: Demo, tmp_path: pathlib.Path
) -> None:
    points, scanners = scanned(demo)
    robots = stillpoint.fit(points, scanners, demo.models)
    result = stillpoint.run(
        demo.las, robots=demo.robots, scanners=demo.scanners, out=tmp_path / "out"
    )
    assert [r.model for r in robots] == [r.model for r in result.robots]
    assert len(robots) == 3
    for mine, theirs in zip(robots, result.robots, strict=True):
        assert mine.verdict == theirs.verdict
        np.testing.assert_allclose(mine.base_pose, theirs.base_pose, atol=SAME)
        for name, value in theirs.joints.items():
            assert mine.joints[name] == pytest.approx(value, abs=SAME), name
            assert mine.sigma[name] == pytest.approx(theirs.sigma[name], rel=1e-3, abs=SAME)


def test_one_robot_is_found_about_its_place(demo: Demo) -> None:
    points, scanners = scanned(demo)
    known = demo.result.robots[1]
    at = known.base_pose[:3, 3]
    near = [part[np.linalg.norm(part - at, axis=1) < 4.0] for part in points]
    model = demo.robots / known.model
    (robot,) = stillpoint.fit(near, scanners, model, about=at, radius=0.6)
    np.testing.assert_allclose(robot.base_pose[:3, 3], at, atol=0.005)
    assert not stillpoint.fit(near, scanners, model, about=at + [0.0, 0.0, 30.0])
    # Positions alone do as well: these scanners stood upright.
    places = [scanner[:3, 3] for scanner in scanners]
    (other,) = stillpoint.fit(near, places, model, about=at, radius=0.6)
    np.testing.assert_allclose(other.base_pose, robot.base_pose, atol=0.002)


def test_columns_of_packed_records_are_read_right(demo: Demo) -> None:
    points, scanners = scanned(demo)
    known = demo.result.robots[1]
    at = known.base_pose[:3, 3]
    near = [p[np.linalg.norm(p - at, axis=1) < 4.0] for p in points]
    part, scanner = max(zip(near, scanners, strict=True), key=lambda one: len(one[0]))
    model = demo.robots / known.model
    packed = np.zeros(len(part), np.dtype([("xyz", "<f8", 3), ("kind", "u1")]))
    assert packed.dtype.itemsize == 25
    packed["xyz"] = part
    single = np.zeros(len(part), np.dtype([("xyz", "<f4", 3), ("kind", "u1")]))
    assert single.dtype.itemsize == 13
    single["xyz"] = part

    def of(array: Any) -> list[Any]:
        return [robot.entry for robot in stillpoint.fit(array, scanner, model, about=at)]

    plain = of(part)
    assert plain
    assert of(packed["xyz"]) == plain
    assert of(np.asfortranarray(part)) == plain
    assert of(part.astype(">f8")) == plain
    assert of(single["xyz"]) == of(part.astype(np.float32))
    # The compiled module refuses what the package copies.
    with pytest.raises(stillpoint.UsageError, match="packed"):
        from stillpoint import _stillpoint

        given = ("array", None, packed["xyz"])
        _stillpoint.fit([given], [str(model)], None, None, (None, None, None, []))


def test_arrays_that_cannot_be_are_refused_by_name(demo: Demo, tmp_path: pathlib.Path) -> None:
    good = np.zeros((300, 3))
    model = demo.models[0]
    for points, scanner, word in [
        (good.astype(int), [0, 0, 0], "float64"),
        (np.zeros((300, 4)), [0, 0, 0], "shape"),
        (np.zeros((0, 3)), [0, 0, 0], "no points"),
        (good, [[0, 0]], "metres"),
        (good, [0, 0, np.nan], "no rotation and place"),
        (good, 2 * np.eye(4), "no rotation and place"),
        ([good, good], [[0, 0, 0]], "2 arrays"),
        ([], [], "arrays"),
        (good, [1e9, 0, 0], "scanner"),
    ]:
        with pytest.raises(stillpoint.Error, match=word):
            stillpoint.fit(points, scanner, model)  # type: ignore[arg-type]
    with pytest.raises(stillpoint.BadInputError) as missing:
        stillpoint.fit(good, [0, 0, 0], tmp_path / "none")
    assert missing.value.place == str(tmp_path / "none")
    with pytest.raises(stillpoint.UsageError, match="fit.bean"):
        stillpoint.fit(good, [0, 0, 0], model, set={"fit.bean": 3})
    with pytest.raises(stillpoint.AccessError):
        stillpoint.fit(good, [0, 0, 0], model, scratch="/proc/none")
