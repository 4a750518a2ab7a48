#!/usr/bin/env python3
"""Scenes that Stillpoint writes, opened by software that is not ours: links must stand within 1e-6 m and 1e-6 rad of result.json,
loops must be closed within 1e-4 m, limits must be those of the library. The table is written to SCENES.md beside this file.

    scripts/cross/scene.py --stillpoint target/release/stillpoint --demo DIR [--library DIR ...] [--work DIR]

DIR of --demo is what `stillpoint demo --out` wrote. Each --library is a folder of models, of which the example `library_scene` of
the crate `scene` writes scenes in drawn places and postures. SDF needs Debian's sdformat-sdf and ignition-tools, glTF npm's
gltf-validator (--validator DIR with node_modules)."""

import argparse
import datetime
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import scene_hazards

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
# Format and reader, with the package that it comes from.
CELLS = [
    ("urdf", "yourdfpy", "yourdfpy"), ("urdf", "pinocchio", "pin"), ("urdf", "pybullet", "pybullet"), ("urdf", "mujoco_urdf", "mujoco"),
    ("srdf", "pinocchio", "pin"), ("moveit", "moveit", "stand-in of MoveIt's reader"), ("mjcf", "mujoco", "mujoco"), ("usd", "usd", "usd-core"), ("sdf", "sdf", "libsdformat 12.3.0"),
    ("gltf", "gltf", "trimesh"), ("robodk", "robodk", "robodk"),
    ("urdf", "shapes_urdf", "trimesh"), ("usd", "shapes_usd", "usd-core"), ("gltf", "shapes_gltf", "trimesh"),
]
METRES = RADIANS = 1e-6
LIMITS = 1e-9
CLOSED = 1e-4
# PyBullet calculates in single precision: 4e-6 m at 50 m from the origin, where the last robot of a library stands.
SINGLE = {"urdf/pybullet": 5e-6}
WHY_SINGLE = "allowed are {:.0e} m and rad: PyBullet calculates in single precision, and robots stand up to 50 m from the origin"
VALIDATOR = """
const v = require('gltf-validator'), fs = require('fs');
v.validateBytes(new Uint8Array(fs.readFileSync(process.argv[1]))).then(r => console.log(JSON.stringify(r.issues)));
"""


def environment(work):
    python = work / "env/bin/python"
    if not (work / "env/made").is_file():
        subprocess.run([sys.executable, "-m", "venv", work / "env"], check=True)
        subprocess.run([python, "-m", "pip", "install", "-q", "-r", HERE / "scene_requirements.txt"], check=True)
        (work / "env/made").touch()
    return python


def ask(python, reader, folder, source, library):
    call = [python, HERE / "scene_readers.py", reader, folder, source, library]
    ran = subprocess.run([str(c) for c in call], capture_output=True, text=True, timeout=900, check=False,
                         env=os.environ | {"PYTHONWARNINGS": "ignore"})
    if ran.returncode:
        last = [line for line in ran.stderr.strip().splitlines() if line.strip()] or ["no word"]
        return None, f"ends with {ran.returncode}: {last[-1][:300]}"
    return json.loads(ran.stdout.strip().splitlines()[-1]), None


def words(format, reader, found):
    """What a cell says: right, with the largest deviations, or what is wrong."""
    most = SINGLE.get(format, SINGLE.get(f"{format}/{reader}", METRES))
    faults = list(found["wrong"])
    if found["metres"] > most or found["radians"] > max(most, RADIANS):
        faults.append("links stand elsewhere")
    if found["limits"] > LIMITS:
        faults.append("limits are others")
    if found["gap"] > CLOSED:
        faults.append("loops are open")
    if not found["n_links"]:
        faults.append("no link was found")
    numbers = f"{found['n_links']} links within {found['metres']:.1e} m and {found['radians']:.1e} rad"
    if found["n_limits"]:
        numbers += f"; {found['n_limits']} joints, limits within {found['limits']:.0e}"
    if found["n_pins"]:
        numbers += f"; {found['n_pins']} pins within {found['gap']:.1e} m"
    if max(found["metres"], found["radians"]) > METRES and not faults:
        numbers += "; " + WHY_SINGLE.format(most)
    numbers += "".join(f"; {said}" for said in found["said"])
    return f"{'; '.join(faults)} ({numbers})" if faults else f"**right**: {numbers}"


def validated(glb, modules):
    ran = subprocess.run(["node", "-e", VALIDATOR, str(glb)], capture_output=True, text=True, cwd=modules, check=False)
    if ran.returncode:
        return f"could not be run: {ran.stderr.strip()[-200:]}"
    issues = json.loads(ran.stdout)
    if issues["numErrors"] or issues["numWarnings"]:
        return "; ".join(f"{m['code']} {m['pointer']}" for m in issues["messages"][:5])
    return f"**right**: 0 errors, 0 warnings, {issues['numInfos']} informations"


def cells(name, folder, source, library, python, given):
    rows = []
    for format, reader, package in CELLS:
        found, failed = ask(python, reader, folder / format, source, library)
        rows.append((name, format, package, failed or words(format, reader, found)))
        print(*rows[-1], sep=": ", flush=True)
    if given.validator:
        package = json.loads((given.validator / "node_modules/gltf-validator/package.json").read_text())
        rows.append((name, "gltf", f"gltf-validator {package['version']}", validated(folder / "gltf/plant.glb", given.validator)))
        print(*rows[-1], sep=": ", flush=True)
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--stillpoint", type=Path, default=Path("target/release/stillpoint"))
    parser.add_argument("--demo", type=Path, help="what `stillpoint demo --out` wrote")
    parser.add_argument("--library", type=Path, action="append", default=[], help="a library whose scenes the example writes")
    parser.add_argument("--example", type=Path, default=Path("target/release/examples/library_scene"))
    parser.add_argument("--seed", default="1")
    parser.add_argument("--validator", type=Path, help="folder in which npm installed gltf-validator")
    parser.add_argument("--work", type=Path, default=Path(tempfile.gettempdir()) / "stillpoint-scenes")
    given = parser.parse_args()
    # The validator runs in a folder of its own.
    given.work, given.demo = given.work.resolve(), given.demo and given.demo.resolve()
    given.work.mkdir(parents=True, exist_ok=True)
    python = environment(given.work)
    rows = []
    if given.demo:
        result = given.demo / "result"
        for format in dict.fromkeys(format for format, _, _ in CELLS):
            call = [given.stillpoint.resolve(), "export", result, "--to", format, "--robots", given.demo / "robots"]
            subprocess.run([str(c) for c in call], check=True, capture_output=True)
        rows += cells("demo", result / "export", result, given.demo / "robots", python, given)
    # Models that readers and writers get wrong come from scene_hazards.py.
    scene_hazards.write(given.work / "odd-models")
    for library in [given.work / "odd-models", *given.library]:
        out = given.work / "scenes" / library.resolve().name
        subprocess.run([given.example.resolve(), library, out, given.seed], check=True)
        rows += cells(library.resolve().name, out, out / "truth.json", library, python, given)
    versions = subprocess.run([python, "-m", "pip", "list", "--format=json"], capture_output=True, text=True, check=True).stdout
    versions = {p["name"]: p["version"] for p in json.loads(versions)}
    lines = [f"| {name} | {format} | {f'{package} {versions.get(package, str())}'.strip()} | {said} |" for name, format, package, said in rows]
    page = HERE / "SCENES.md"
    head = page.read_text().split("<!-- table -->")[0] if page.is_file() else ""
    table = "| robots | format | read by | says |\n| --- | --- | --- | --- |\n" + "\n".join(lines)
    told = f"Run on {datetime.date.today()}, Python {sys.version.split()[0]}; `--seed {given.seed}`."
    page.write_text(f"{head}<!-- table -->\n\n{told}\n\n{table}\n")
    sys.exit(any("**right**" not in row[3] for row in rows))


if __name__ == "__main__":
    main()
