#!/usr/bin/env python3
"""Fits the rates that `plan` predicts with to rows of `bench plan`, and prints how well they predict these and other rows.

    stillpoint bench plan --halls 12 --seed 1 --robots LIBRARY --out DEVELOPED --threads 1
    stillpoint bench plan --halls 10 --seed 2 --robots LIBRARY --out FRESH
    scripts/plan_rates.py DEVELOPED/plan.jsonl [FRESH/plan.jsonl]

The rates go into src/estimate/rates.rs by hand. They are least squares of relative errors, none below zero: processor seconds of
stages against points, models and what a glance saw of the regions. Needs numpy.
"""
import json
import sys

import numpy as np

STREAM = ["ingest", "digest", "store", "surfaces", "segment", "write", "space", "list", "review"]


def features(row: dict) -> dict:
    """What the search is predicted from; as in src/estimate/search_time.rs."""
    regions = row["planned"]["stand"]["regions"]
    return {
        "REGION, a region": len(regions),
        "AREA, a m2 and model": sum(r["size"][0] * r["size"][1] for r in regions) * len(row["models"]),
        "SURFACE, 1000 voxels": sum(r["n_voxels"] for r in regions) / 1e3,
    }


def cpu(row: dict, stages: list) -> float:
    return sum(s["cpu_seconds"] for s in row["measured"]["stages"] if s["stage"] in stages)


def least_squares(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """x >= 0 with the least relative errors of a x = b, coordinate by coordinate."""
    a, b = a / b[:, None], np.ones_like(b)
    x = np.zeros(a.shape[1])
    for _ in range(20_000):
        for j in range(len(x)):
            left = b - a @ x + a[:, j] * x[j]
            x[j] = max(0.0, a[:, j] @ left / max(a[:, j] @ a[:, j], 1e-12))
    return x


def main() -> None:
    developed, *others = [[json.loads(line) for line in open(path)] for path in sys.argv[1:]]
    for name in STREAM:
        rows = [r for r in developed if cpu(r, [name]) > 0]
        if rows:
            points = sum(r["planned"]["n_points"] for r in rows)
            print(f"{name:<10} {points / sum(cpu(r, [name]) for r in rows) / 1e6:8.1f} M points a second of a processor")
    load = sum(cpu(r, ["robots"]) for r in developed) / sum(r["library_bytes"] for r in developed)
    print(f"{'LOAD':<10} {load * 1e6:8.2f} s a megabyte of the library")
    names = list(features(developed[0]))
    a = np.array([[features(r)[n] for n in names] for r in developed], float)
    b = np.array([cpu(r, ["fit", "tools"]) for r in developed])
    x = least_squares(a, b)
    for name, rate in zip(names, x):
        print(f"{name:<20} {rate:.4f} s")
    for rows in (developed, *others):
        print("\nhall, robots, models, processor seconds of the search, predicted / measured")
        for r in rows:
            f = features(r)
            ratio = sum(f[n] * v for n, v in zip(names, x)) / cpu(r, ["fit", "tools"])
            print(r["seed"], r["n_robots"], len(r["models"]), f"{cpu(r, ['fit', 'tools']):.1f}", f"{ratio:.2f}")


if __name__ == "__main__":
    main()
