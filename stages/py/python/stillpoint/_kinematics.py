"""A robot's URDF with the posture that was found, for libraries of kinematics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._robot import Pose


@dataclass(frozen=True, eq=False)
class Urdf:
    """The URDF of one robot; its root link is the base, which stands at ``base_pose``."""

    #: The file; meshes lie beside it.
    path: Path
    #: Pose of the base link in the world, 4 x 4, metres.
    base_pose: Pose
    #: Value of each joint, radians, or metres for slides; those that follow others too.
    joints: Mapping[str, float]

    def values(self, names: Sequence[str]) -> NDArray[np.float64]:
        """Values of joints in the order of these names; 0 for a joint that the result does not name."""
        return np.array([self.joints.get(name, 0.0) for name in names])

    def yourdfpy(self, **options: Any) -> Any:
        """The robot as ``yourdfpy.URDF`` in its posture.

        ``get_transform(link)`` of it is in the base frame: ``base_pose @`` that is in the world.
        Options go to ``yourdfpy.URDF.load``, for example ``load_meshes=False``.
        """
        import yourdfpy

        urdf = yourdfpy.URDF.load(str(self.path), **options)
        urdf.update_cfg(self.values(urdf.actuated_joint_names))
        return urdf

    def pinocchio(self) -> tuple[Any, Any, NDArray[np.float64]]:
        """The robot as ``(model, data, q)`` of Pinocchio, with all frames placed for posture ``q``.

        ``data.oMf[model.getFrameId(link)]`` is in the base frame.
        """
        import pinocchio

        model = pinocchio.buildModelFromUrdf(str(self.path))
        data = model.createData()
        q = pinocchio.neutral(model)
        for name, joint in zip(model.names, model.joints, strict=True):
            value = self.joints.get(name, 0.0)
            if joint.nq == 1:
                q[joint.idx_q] = value
            elif joint.nq == 2:
                # A joint without limits is a point on a circle there.
                q[joint.idx_q : joint.idx_q + 2] = [np.cos(value), np.sin(value)]
        pinocchio.framesForwardKinematics(model, data, q)
        return model, data, q
