"""Results as Python sees them: robots, masks, points, URDFs."""

import dataclasses
import json
import shutil
import pathlib

import laspy
import numpy as np
import pytest

import stillpoint
from conftest import Demo


def test_robots_are_what_the_result_says(demo: Demo) -> None:
    entries = json.loads((demo.out / "result.json").read_text())["robots"]
    result = demo.result
    assert len(result.robots) == len(entries) == 3
    for robot, entry in zip(result.robots, entries, strict=True):
        assert (robot.id, robot.model, robot.verdict) == (
            entry["id"],
            entry["model"],
            entry["verdict"],
        )
        assert robot.joints == entry["joints"] and robot.sigma == entry["sigma"]
        assert robot.base_pose.shape == (4, 4) and not robot.base_pose.flags.writeable
        np.testing.assert_allclose(robot.base_pose[:3, 3], entry["base_pose"]["xyz"])
        turn = robot.base_pose[:3, :3]
        np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
        np.testing.assert_allclose(robot.link_poses[robot.base_link], robot.base_pose, atol=1e-12)
        assert {link.link for link in robot.evidence} <= set(robot.links)
    assert result.robot("R2") is result.robots[1] is result.robot(1)
    with pytest.raises(dataclasses.FrozenInstanceError):
        result.robots[0].id = "R9"  # type: ignore[misc]
    with pytest.raises(stillpoint.UsageError, match="R1, R2, R3"):
        result.robot("R9")


def test_labels_are_mapped_and_cannot_be_written_to(demo: Demo) -> None:
    result = demo.result
    assert len(result.scans) == 4
    for scan in result.scans:
        labels = result.labels(scan.name)
        for array, kind in [
            (labels.kind, np.uint8),
            (labels.robot, np.int16),
            (labels.link, np.int16),
        ]:
            assert isinstance(array, np.memmap) and array.dtype == kind
            assert len(array) == scan.n_points
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 1
        moving = labels.moving()
        assert (labels.robot[moving] >= 0).all() and 0 < moving.sum() < len(moving)
        assert len(labels.superseded) == 0


def test_points_are_those_of_the_masks(demo: Demo) -> None:
    result = demo.result
    masks = [result.labels(scan) for scan in result.scans]
    kind = np.concatenate([mask.kind for mask in masks])
    robot = np.concatenate([mask.robot for mask in masks])
    everything = result.points()
    for name, number in stillpoint.KINDS.items():
        found = result.points(name)
        assert len(found) == (everything.kind == number).sum()
        # Points that were dropped have an entry of their mask, and are in no cloud.
        assert name == "uncertain" or len(found) == (kind == number).sum()
        assert (found.kind == number).all() and found.xyz.shape == (len(found), 3)
    one = result.points(["link", "attachment"], robot="R2")
    assert len(one) == ((robot == 1) & ((kind == 1) | (kind == 2))).sum() > 0
    at = result.robots[1].base_pose[:3, 3]
    assert np.linalg.norm(one.xyz - at, axis=1).max() < 4.0
    parts = list(result.iter_points(1, robot="R2"))
    assert sum(len(part) for part in parts) == (one.kind == 1).sum()
    with pytest.raises(stillpoint.UsageError, match="fixed, link"):
        result.points("moving")


def test_the_fixed_world_is_mapped(demo: Demo) -> None:
    cloud = demo.result.fixed_world()
    theirs = laspy.read(demo.out / "clouds/fixed.las")
    assert len(cloud) == len(theirs) > 0
    np.testing.assert_array_equal(cloud.xyz(), theirs.xyz)
    np.testing.assert_array_equal(cloud.records["class"], theirs.classification)
    np.testing.assert_array_equal(cloud.records["robot"], theirs.RobotId)
    np.testing.assert_array_equal(cloud.records["gps_time"], theirs.gps_time)
    assert isinstance(cloud.records, np.memmap) and not cloud.records["X"].flags.owndata
    assert sum(len(part) for part in cloud.chunks(1000)) == len(cloud)
    moving = stillpoint.Cloud.open(demo.out / "clouds/robots.las")
    assert set(np.unique(moving.records["class"])) <= {65, 66}


def test_kinematics_of_the_urdfs_are_those_of_the_result(demo: Demo) -> None:
    result = demo.result
    for robot in result.robots:
        urdf = result.urdf(robot)
        theirs = urdf.yourdfpy(load_meshes=False)
        model, data, _ = urdf.pinocchio()
        for link, world_from_link in robot.link_poses.items():
            mine = urdf.base_pose @ theirs.get_transform(link, robot.base_link)
            np.testing.assert_allclose(mine, world_from_link, atol=1e-6, err_msg=f"yourdfpy {link}")
            frame = data.oMf[model.getFrameId(link)].homogeneous
            mine = urdf.base_pose @ frame
            np.testing.assert_allclose(mine, world_from_link, atol=1e-6, err_msg=f"pin {link}")


def test_what_is_damaged_or_missing_is_named(demo: Demo, tmp_path: pathlib.Path) -> None:
    with pytest.raises(stillpoint.BadInputError) as gone:
        stillpoint.Result(tmp_path)
    assert gone.value.file == tmp_path / "result.json"
    copy = tmp_path / "copy"
    shutil.copytree(demo.out, copy, ignore=shutil.ignore_patterns("store"))
    result = stillpoint.Result(copy)
    tile = max((copy / "tiles").iterdir(), key=lambda path: path.stat().st_size)
    bytes_of = bytearray(tile.read_bytes())
    bytes_of[len(bytes_of) // 2] ^= 1
    tile.write_bytes(bytes_of)
    with pytest.raises(stillpoint.BadInputError) as changed:
        result.points("fixed")
    assert changed.value.file == tile
    cloud = copy / "clouds/fixed.las"
    cloud.write_bytes(cloud.read_bytes()[:-7])
    with pytest.raises(stillpoint.BadInputError, match="fixed.las"):
        result.fixed_world()
    mask = copy / "labels/0.kind.npy"
    mask.write_bytes(mask.read_bytes()[:-1])
    with pytest.raises(stillpoint.BadInputError, match="0.kind.npy"):
        result.labels(0)
