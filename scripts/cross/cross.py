#!/usr/bin/env python3
"""Where two meet: what Stillpoint writes, opened by the readers that users have, and what their programs write, opened by
Stillpoint. Every cell is compared with the truth, and the table is written to README.md beside this file.

    scripts/cross/cross.py --stillpoint target/release/stillpoint [--demo DIR] [--pdal CALL] [--cloudcompare CALL]

It makes a Python environment of pinned versions (requirements.txt) under --work, about 2 GB; Open3D needs the system's
libusb-1.0, libgomp and libGL. PDAL, CloudCompare and OctoMap's tools are called where they are installed."""

import argparse
import datetime
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
# No reader of these small files needs as long, seconds.
LONGEST = 300


class Setting:
    """Programs, folders and the environment of the readers."""

    def __init__(self, given):
        self.given, self.work = given, given.work
        self.work.mkdir(parents=True, exist_ok=True)
        self.stillpoint = str(given.stillpoint.resolve())
        self.python = str(self.work / "env/bin/python")

    def make_environment(self):
        if not (self.work / "env/made").is_file():
            subprocess.run([sys.executable, "-m", "venv", self.work / "env"], check=True)
            wanted = ["-r", HERE / "requirements.txt"]
            subprocess.run([self.python, "-m", "pip", "install", "-q", *wanted], check=True)
            (self.work / "env/made").touch()
        if Path(sys.prefix).resolve() != (self.work / "env").resolve():
            os.execv(self.python, [self.python, *sys.argv])

    def run(self, *call, check=True):
        """Runs Stillpoint; its standard output."""
        ran = subprocess.run([self.stillpoint, *map(str, call)], capture_output=True, text=True, cwd=self.work, check=False)
        if check and ran.returncode:
            sys.exit(f"stillpoint {' '.join(map(str, call))} ends with {ran.returncode}: {ran.stderr[-1000:]}")
        return ran

    def material(self):
        """The demo's cell scanned coarsely, with colours; its results as LAS, and as LAZ with COPC and PLY."""
        demo, cell = self.given.demo or self.work / "demo", self.work / "cell"
        if not (demo / "result/result.json").is_file():
            self.run("demo", "--out", demo)
        library = demo / "robots"
        if not (cell / "coloured.las").is_file():
            scene = (demo / "scene.toml").read_text().replace("step_deg = 0.11", "step_deg = 0.35")
            (self.work / "scene.toml").write_text(scene)
            self.run("simulate", "scene.toml", "--robots", library, "--out", cell)
            self.probe("writers.py", "coloured", cell / "scans.las", cell / "coloured.las")
        job = ["run", cell / "coloured.las", "--scanners", cell / "scanners.toml", "--robots", library, "--set", "export.bodies=true"]
        plain, packed = self.work / "plain", self.work / "packed"
        if (self.given.only or self.given.keep) and (packed / "junit.xml").is_file():
            return library, cell, plain, packed
        self.run(*job, "--out", plain)
        if not packed.is_dir():
            shutil.copytree(plain, packed)
        self.run(*job, "--out", packed, "--set", "export.compress=true", "--set", "export.copc=true")
        self.run("export", packed, "--to", "ply")
        self.run("report", packed, "--junit", packed / "junit.xml")
        return library, cell, plain, packed

    def probe(self, script, *arguments):
        """Runs one of the scripts beside this one in the environment of the readers; what went wrong, or none."""
        call = [self.python, HERE / script, *map(str, arguments)]
        environment = os.environ | {"PYTHONWARNINGS": "ignore", "QT_QPA_PLATFORM": "offscreen"}
        try:
            ran = subprocess.run(call, capture_output=True, text=True, timeout=LONGEST, env=environment, check=False)
        except subprocess.TimeoutExpired:
            return None, f"does not end within {LONGEST} s"
        if ran.returncode == 0:
            return ran.stdout, None
        last = [line for line in ran.stderr.strip().splitlines() if line.strip()] or [f"ends with {ran.returncode}"]
        return None, last[-1].strip()[:200]

    def versions(self):
        """Versions of the Python packages."""
        call = [self.python, "-m", "pip", "list", "--format=json"]
        listed = json.loads(subprocess.run(call, capture_output=True, text=True, check=True).stdout)
        return {p["name"].lower().replace("_", "-").replace(".", "-"): p["version"] for p in listed}


class Table:
    """Rows by heading: file, reader, what it says."""

    def __init__(self, work):
        self.parts, self.work = {}, f"{work}/"

    def add(self, part, file, reader, said):
        said = " ".join(str(said).replace(self.work, "").replace("|", "\\|").split())
        self.parts.setdefault(part, []).append((file, reader, said))
        print(f"{part}: {file}: {reader}: {said}", flush=True)

    def text(self):
        out = []
        for part, rows in self.parts.items():
            out.append(f"### {part}\n\n| file | program | says |\n| --- | --- | --- |")
            out += [f"| {file} | {reader} | {said if said != 'right' else '**right**'} |" for file, reader, said in rows]
            out.append("")
        return "\n".join(out)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--stillpoint", type=Path, default=Path("target/release/stillpoint"))
    parser.add_argument("--work", type=Path, default=Path(tempfile.gettempdir()) / "stillpoint-cross")
    parser.add_argument("--demo", type=Path, help="what `stillpoint demo --out` wrote, where it is there already")
    for name, what in (("pdal", "PDAL"), ("cloudcompare", "CloudCompare"), ("octomap-tools", "OctoMap's tools")):
        parser.add_argument(f"--{name}", help=f"how {what} is called, such as 'chroot /somewhere {name}'")
        parser.add_argument(f"--{name}-version", help="its version, for the table")
    parser.add_argument("--keep", action="store_true", help="use Stillpoint's files that are under --work already")
    parser.add_argument("--only", help="parts whose name has one of these words, on what was made already; the table is not written", nargs="+")
    given = parser.parse_args()
    setting = Setting(given)
    setting.make_environment()
    # Needs numpy, which the environment has.
    import parts

    table = Table(given.work)
    material = setting.material()
    for part in parts.ALL:
        if not given.only or any(word in part.__name__ for word in given.only):
            part(setting, material, table)
    if given.only:
        return
    version = setting.run("--version").stdout.strip()
    made = f"Made with {version} on {datetime.date.today().isoformat()}, Python {sys.version.split()[0]}."
    page = HERE / "README.md"
    head = page.read_text().split("<!-- table -->")[0]
    page.write_text(f"{head}<!-- table -->\n\n{made}\n\n{table.text()}")


if __name__ == "__main__":
    main()
