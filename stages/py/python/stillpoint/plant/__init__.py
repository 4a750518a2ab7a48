"""A plant over many machines: the shards of one job as tasks of a Ray cluster.

The machines share a disk with the scans, the robot library and the output folder, and each has the program
``stillpoint``. Only ids and small summaries pass through Ray: everything else lies in the store of the output folder. So
any process, node or head may be lost at any time; what is missing is made again, and the result has the same bytes as
that of ``stillpoint run`` on one machine.

    from stillpoint import plant
    plant.run(["hall/a.e57", "hall/b.e57"], robots="robots", out="out", address="10.0.0.1:6379")

or ``python -m stillpoint.plant hall/*.e57 --robots robots --out out --address 10.0.0.1:6379``.
"""

from ._job import Event, Job, JobFailed, ShardFailed
from ._outer import PlantRun, run

__all__ = ["Event", "Job", "JobFailed", "PlantRun", "ShardFailed", "run"]
