#!/usr/bin/env bash
# The Python package e57 0.2.3 (July 2026): one invalid point in a file takes intensity and colour of all others away.
#
# E57 marks beams that found nothing by `cartesianInvalidState`; every structured scan has such points.
# Expected: of four points, one of them invalid, three come back with their intensities and colours.
# Seen (2026-11-28, Linux, Python 3.11): three points come back, and arrays of no intensities and no colours, without an error. Without the invalid
#   point all four have both. pye57 0.4.19 gives the three points with their intensities and colours.
# Exits with 1 where that changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv env
env/bin/pip install -q e57==0.2.3 pye57==0.4.19 numpy==2.4.6
env/bin/python - <<'PY'
import e57
import numpy as np
import pye57

AT = np.arange(4.0)
GREY = np.array([10, 20, 30, 255], np.uint8)
found = {}
for name, invalid in (("all valid", [0, 0, 0, 0]), ("one invalid", [0, 0, 0, 2])):
    with pye57.E57("four.e57", mode="w") as file:
        columns = {f"cartesian{axis}": AT for axis in "XYZ"} | {f"color{c}": GREY for c in ("Red", "Green", "Blue")}
        columns |= {"intensity": AT / 4, "cartesianInvalidState": np.array(invalid, np.int8)}
        file.write_scan_raw(columns)
    cloud = e57.read_points("four.e57")
    other = pye57.E57("four.e57").read_scan(0, intensity=True, colors=True, ignore_missing_fields=True)
    found[name] = [len(cloud.points), len(cloud.intensity), len(cloud.color)], [len(other[n]) for n in ("cartesianX", "intensity", "colorRed")]
    print(f"{name}: points, intensities, colours: e57 {found[name][0]}, pye57 {found[name][1]}")
assert found["all valid"] == ([4, 4, 4], [4, 4, 4]), found
assert found["one invalid"] == ([3, 0, 0], [3, 3, 3]), found
PY
