#!/usr/bin/env python3
"""Writes stages/ingest/src/units/epsg.txt: units of length of the EPSG registry, and which of its
projected and vertical systems are not in metres. Needs pyproj, whose database it reads:

    pip install pyproj && scripts/epsg_lengths.py > stages/ingest/src/units/epsg.txt
"""

import pyproj
from pyproj.database import get_units_map, query_crs_info
from pyproj.enums import PJType

METRE = "9001"


def ranges(codes):
    """Codes as text, neighbours in the registry joined."""
    out = []
    for code, is_wanted in codes:
        if not is_wanted:
            out.append(None)
        elif out and out[-1]:
            out[-1][1] = code
        else:
            out.append([code, code])
    return [f"{a}" if a == b else f"{a}-{b}" for a, b in filter(None, out)]


def unit_of(code):
    axes = pyproj.CRS.from_epsg(code).axis_info
    codes = {axis.unit_code for axis in axes}
    return codes.pop() if len(codes) == 1 else None


def main():
    version = pyproj.database.get_database_metadata("EPSG.VERSION")
    print(f"# Units of length of EPSG {version}, and systems that are not in metres; made by")
    print(f"# scripts/epsg_lengths.py with pyproj {pyproj.__version__}.")
    units = [u for u in get_units_map(auth_name="EPSG", category="linear").values() if u.conv_factor]
    for unit in sorted(units, key=lambda unit: int(unit.code)):
        print(f"unit {unit.code} {unit.conv_factor!r} {unit.name}")
    for word, kind in [("projected", PJType.PROJECTED_CRS), ("vertical", PJType.VERTICAL_CRS)]:
        infos = query_crs_info(auth_name="EPSG", pj_types=kind, allow_deprecated=True)
        of = {int(info.code): unit_of(int(info.code)) for info in infos}
        for unit in sorted({unit for unit in of.values() if unit and unit != METRE}):
            text = ranges([(code, of[code] == unit) for code in sorted(of)])
            line = f"{word} {unit}"
            for item in text:
                if len(line) + len(item) >= 99:
                    print(line)
                    line = f"{word} {unit}"
                line += f" {item}"
            print(line)


if __name__ == "__main__":
    main()
