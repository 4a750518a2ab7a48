#!/usr/bin/env python3
"""A discrete model of a plant over many machines: how long the shards of one job take, and how busy the machines are.

    scripts/plant_model.py                                  the plant of the table: 80 billion points, 2,500 scans
    scripts/plant_model.py --events cluster/events-0.jsonl --machines 1 2 --cores 1     what was measured, laid on machines
                                                            again

Shards start in the order of the driver (ready ones, the longest first), each on one core; joins get all cores of one machine,
of which they can use as many as they have independent parts. Costs are those of src/estimate (rates.rs, shard_costs.rs). With
--events they are the processor seconds of a job that was measured (scripts/cluster.py), so that the model can be compared with
its wall-clock time. Storage is one disk with a bandwidth for all machines: no phase ends before its bytes have passed.

What it leaves out: failures, the start of the engine, and that machines differ."""

import argparse
import heapq
import json
import math

#: Rates of src/estimate: points per second and core, seconds.
INGEST, STORE, PLANES, NEAR, LABELS, JOIN, PAGE = 20e6, 30e6, 8e6, 60e6, 4e6, 20e6, 9e6
REGION, AREA, SURFACE, SPACE, CHOICE = 0.6, 0.10, 0.29, 0.2, 0.1
#: Bytes of a point: in an E57 file, in tiles, as labels and records of a piece, in the result.
FILE, TILES, PIECE, RESULT = 17, 18, 73, 73
#: Seconds of a shard before its own work: the program with a library of three models, and each input that is opened. Measured
#: with `stillpoint shards` over 16 and 256 E57 files of one scan whose samples were known.
START, OPEN = 0.06, 0.0075
#: Points of a group of tiles, and the most groups, as src/label/joined_files.rs has them; seconds of the page and of files of robots.
GROUP, GROUPS, GATHER = 20e6, 1024, 10.0


def phases(plant):
    """The phases of a job: their shards as (processor seconds, threads that can be used, bytes), none waiting for another."""
    points, scans, robots = plant.points, plant.scans, plant.robots
    each, start = points / scans, START + OPEN * scans
    regions = round(1.2 * robots)
    region = REGION + AREA * plant.area * plant.models + SURFACE * plant.voxels / 1000
    out = [
        ("tiles, planes", [(2 * start + each * (1 / INGEST + 1 / STORE + 1 / PLANES), 1, each * (FILE + 2 * TILES))] * scans),
        ("ground", [(start + points / PLANES / 100, 1, 0)]),
        ("regions", [(start + region, 1, each * TILES)] * regions),
        ("robots", [(start + CHOICE * regions + points / NEAR, 1e9, points * TILES / 10)]),
        ("spaces, labels", [(start + each / LABELS, 1, each * (FILE + PIECE))] * scans + [(start + SPACE, 1, each * TILES / 4)] * robots),
    ]
    # Tiles in groups, with their points for the page; the cloud of fixed points is one file.
    groups = min(GROUPS, math.ceil(points / GROUP))
    tiles = points / JOIN / 2 + (0 if plant.no_page else points / PAGE)
    bytes_of_file = points * (PIECE + RESULT) / (1 if plant.lean else 2)
    files = [(start + tiles / groups, 1, bytes_of_file / groups)] * groups
    out.append(("files", files if plant.lean else [*files, (start + points / JOIN / 2, 1, bytes_of_file)]))
    out.append(("gather", [(start + GATHER, 1, 0)]))
    return out


def measured(path):
    """The phases of a job that was measured, by the kinds of its shards."""
    joins, out = ("ground", "robots", "gather"), []
    for line in open(path):
        event = json.loads(line)
        if event.get("event") != "shard":
            continue
        name = event["kind"] if event["kind"] in joins else {"tiles": "tiles, planes", "planes": "tiles, planes"}.get(event["kind"], event["kind"])
        name = "spaces, labels" if name in ("space", "labels") else name
        if not out or out[-1][0] != name:
            out.append((name, []))
        out[-1][1].append((event["processor"], 1, 0))
    return out


def lay(shards, machines, cores, disk):
    """Seconds of a phase whose shards are laid on the machines."""
    free = [0.0] * (machines * cores)
    heapq.heapify(free)
    for seconds, threads, _ in sorted(shards, reverse=True):
        # A join with threads runs alone in its phase.
        at = heapq.heappop(free)
        heapq.heappush(free, at + seconds / min(threads, cores))
    return max(max(free), sum(n_bytes for *_, n_bytes in shards) / disk)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--machines", type=int, nargs="+", default=[1, 4, 16, 64])
    parser.add_argument("--cores", type=int, default=16)
    parser.add_argument("--points", type=float, default=80e9)
    parser.add_argument("--scans", type=int, default=2500)
    parser.add_argument("--robots", type=int, default=2000)
    parser.add_argument("--models", type=int, default=60)
    parser.add_argument("--area", type=float, default=20.0, help="area of a region, square metres")
    parser.add_argument("--voxels", type=float, default=10_000, help="voxels above the floor in a region")
    parser.add_argument("--disk", type=float, default=10e9, help="bandwidth of the shared disk, bytes per second")
    parser.add_argument("--lean", action="store_true", help="no cloud of fixed points")
    parser.add_argument("--no-page", action="store_true", help="no page of the result")
    parser.add_argument("--events", help="events of a measured job, in place of the plant")
    plant = parser.parse_args()
    work = measured(plant.events) if plant.events else phases(plant)
    names = list(dict.fromkeys(name for name, _ in work))
    total = sum(seconds for _, shards in work for seconds, *_ in shards)
    print("| machines | cores | hours | busy | machine hours | " + " | ".join(names) + " |")
    print("| --- " * (5 + len(names)) + "|")
    for machines in plant.machines:
        spent = dict.fromkeys(names, 0.0)
        for name, shards in work:
            spent[name] += lay(shards, machines, plant.cores, plant.disk)
        wall = sum(spent.values())
        busy = total / (wall * machines * plant.cores)
        shares = " | ".join(f"{seconds / 3600:.3f}" if plant.events is None else f"{seconds:.1f} s" for seconds in spent.values())
        print(f"| {machines} | {machines * plant.cores} | {wall / 3600:.3f} | {busy:.0%} | {wall * machines / 3600:.2f} | {shares} |")


if __name__ == "__main__":
    main()
