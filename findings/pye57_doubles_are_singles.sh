#!/usr/bin/env bash
# pye57 0.4.19: coordinates go in as doubles and come back as doubles, but were single precision in between.
#
# Expected: a double array is written as FloatNode with double precision, which E57 has, or as scaled integers.
# Seen (2026-11-28, Linux, Python 3.11): at an easting of 500 km a millimetre is lost: 500000.123 comes back as 500000.125, and steps of a millimetre become
#   steps of 0 or 31.25 mm. The arrays that come back are float64, so that nothing tells. The XML of the file says
#   precision="single".
# Exits with 1 where that changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv env
env/bin/pip install -q pye57==0.4.19 numpy==2.4.6
env/bin/python - <<'PY'
import re

import numpy as np
import pye57

east = 500_000 + np.arange(0, 0.1, 0.001)
with pye57.E57("map.e57", mode="w") as file:
    file.write_scan_raw({"cartesianX": east, "cartesianY": east * 0, "cartesianZ": east * 0})
back = pye57.E57("map.e57").read_scan_raw(0)["cartesianX"]
text = open("map.e57", "rb").read().decode("latin-1")
precision = re.search(r'<cartesianX[^>]*precision="(\w+)"', text)
steps = sorted(set(np.round(np.diff(back) * 1000, 3).tolist()))
print("written", east.dtype, "read", back.dtype, "precision in the file:", precision and precision.group(1))
print(f"largest error {np.abs(back - east).max() * 1000:.2f} mm; steps of 1 mm come back as steps of {steps} mm")
assert east.dtype == back.dtype == np.float64 and precision and precision.group(1) == "single", precision
assert steps == [0.0, 31.25], steps
PY
