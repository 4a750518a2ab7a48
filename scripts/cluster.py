#!/usr/bin/env python3
"""A cluster of Ray nodes with one core each in network and process namespaces of this machine, on which a job runs while nodes
and the head are killed at random moments. Compares all results byte for byte with that of one run.

    stillpoint bench throughput --points 20M --robots ROBOTS --keep --out hall
    scripts/cluster.py --inputs hall/20000000/scans/scans.las --scanners hall/20000000/scans/scanners.toml --robots ROBOTS \\
        --python VENV/bin/python --node-kills 5 --head-kills 1

Wants Linux, root, and a Python with ray (`pip install ray`). The nodes see each other over a bridge of their own and nothing
else; the disk is that of the machine. A node is killed with all of its processes, and started again three seconds later. The
head is killed with its store, so that all nodes start again: Ray gives up after a minute.

Each row of OUT/rows.jsonl is one job: wall-clock time, processor time of the program, seconds that the processors of the machine
were busy (with other people's work and Ray, too), kills, shards that were made twice, and whether the bytes are the same."""

import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from job import Job

HOME = Path(__file__).resolve().parents[1]
PORT = 6379
#: Seconds after which a node that was killed starts again.
AWAY = 3.0
#: Longest life of a job, seconds.
LONGEST = 3600


class Node:
    """A node: its network namespace, and the first process of its process namespace."""

    def __init__(self, cluster, name, number, core=None):
        self.cluster, self.name, self.ip, self.core = cluster, name, f"10.63.0.{number}", core
        self.net, self.init = f"{cluster.prefix}{name}", None
        ip("netns", "add", self.net)
        ip("link", "add", f"v{name}", "netns", self.net, "type", "veth", "peer", "name", f"b{name}", "netns", cluster.bridge)
        ip("-n", self.net, "addr", "add", f"{self.ip}/24", "dev", f"v{name}")
        for device in ("lo", f"v{name}"):
            ip("-n", self.net, "link", "set", device, "up")
        ip("-n", cluster.bridge, "link", "set", f"b{name}", "master", "br0", "up")

    def start(self):
        """Starts the node with a new process namespace."""
        line = ["ip", "netns", "exec", self.net, "unshare", "--pid", "--fork", "--kill-child", "--mount-proc", "sleep", "infinity"]
        self.outer = subprocess.Popen(line, stdout=subprocess.DEVNULL)
        for _ in range(200):
            children = Path(f"/proc/{self.outer.pid}/task/{self.outer.pid}/children").read_text().split()
            if children and Path(f"/proc/{children[0]}/comm").read_text().strip() == "sleep":
                self.init = int(children[0])
                break
            time.sleep(0.02)
        self.start_ray()

    def start_ray(self):
        cluster = self.cluster
        own = [f"--node-ip-address={self.ip}", "--object-store-memory=100000000", "--disable-usage-stats"]
        if self is cluster.head:
            own += ["--head", f"--port={PORT}", "--num-cpus=0", "--include-dashboard=false", f"--temp-dir={cluster.temp}"]
        else:
            own += [f"--address={cluster.head.ip}:{PORT}", f"--num-cpus={0 if self.core is None else 1}"]
        for _ in range(5):
            done = subprocess.run(self.inside([cluster.ray, "start", *own]), env=cluster.environment, capture_output=True, text=True)
            if done.returncode == 0:
                return
            time.sleep(2)
        raise RuntimeError(f"node {self.name} does not start: {done.stdout[-1500:]} {done.stderr[-1500:]}")

    def inside(self, line):
        """A command line that runs in the namespaces of the node, on its core."""
        pin = [] if self.core is None else ["taskset", "-c", str(self.core)]
        return ["nsenter", "-t", str(self.init), "-n", "-p", "-m", "--wd=" + os.getcwd(), *pin, *line]

    def processes(self):
        """Numbers of the node's processes, without the first, and their command lines."""
        space = os.readlink(f"/proc/{self.init}/ns/pid") if self.init and Path(f"/proc/{self.init}").exists() else None
        out = {}
        for entry in Path("/proc").iterdir():
            try:
                if entry.name.isdigit() and int(entry.name) != self.init and os.readlink(entry / "ns/pid") == space:
                    out[int(entry.name)] = (entry / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
            except OSError:
                pass
        return out

    def has_raylet(self):
        return any("/raylet " in line for line in self.processes().values())

    def kill(self):
        """Kills all processes of the node."""
        os.kill(self.init, signal.SIGKILL)
        self.outer.wait()


class Cluster:
    """Head, two nodes of one core, and a node without cores for the driver."""

    def __init__(self, python, folder):
        self.ray = str(Path(python).parent / "ray")
        self.temp = tempfile.mkdtemp(prefix="ray63-", dir="/tmp")
        home = folder / "home"
        home.mkdir(parents=True, exist_ok=True)
        self.environment = {**os.environ, "HOME": str(home), "RAY_AUTH_MODE": "disabled", "RAY_DISABLE_DOCKER_CPU_WARNING": "1"}
        # Workers would stand back behind everything else that the machine does (nice 15), and times would mean nothing.
        self.environment["RAY_worker_niceness"] = "0"
        self.prefix = f"sp{os.getpid() % 10000}"
        self.bridge = self.prefix + "br"
        ip("netns", "add", self.bridge)
        ip("-n", self.bridge, "link", "add", "br0", "type", "bridge")
        ip("-n", self.bridge, "link", "set", "br0", "up")
        self.head = None
        self.head = Node(self, "h", 1)
        self.workers = [Node(self, "a", 2, core=0), Node(self, "b", 3, core=1)]
        self.driver = Node(self, "d", 4)

    def nodes(self):
        return [self.head, *self.workers, self.driver]

    def start(self):
        for node in self.nodes():
            node.start()

    def rest(self):
        """Ends all processes of all nodes, so that a run on this machine has it for itself."""
        for node in self.nodes():
            if node.init:
                quietly(node.kill)

    def heal(self, keep):
        """Starts nodes again whose Ray has ended. `keep` is the command line of the process that the driver's node keeps."""
        for node in [*self.workers, self.driver]:
            if node.has_raylet():
                continue
            if node is self.driver:
                for pid, line in node.processes().items():
                    if not line.startswith(keep):
                        quietly(os.kill, pid, signal.SIGKILL)
                quietly(node.start_ray)
            else:
                node.kill()
                node.start()

    def stop(self):
        for node in self.nodes():
            if node.init:
                quietly(node.kill)
            subprocess.run(["ip", "netns", "del", node.net], capture_output=True)
        subprocess.run(["ip", "netns", "del", self.bridge], capture_output=True)
        shutil.rmtree(self.temp, ignore_errors=True)


def ip(*args):
    subprocess.run(["ip", *args], check=True)


def quietly(work, *args):
    try:
        work(*args)
    except (OSError, RuntimeError, subprocess.SubprocessError) as error:
        print(f"# {error}", file=sys.stderr)


def busy():
    """Seconds that all processors have worked since the machine started, for whomever."""
    first = Path("/proc/stat").read_text().split("\n", 1)[0].split()[1:]
    idle = int(first[3]) + int(first[4])
    return (sum(map(int, first[:8])) - idle) / os.sysconf("SC_CLK_TCK")


def files(out):
    """All files of a result with their bytes' digests, except the store."""
    import hashlib

    every = (path for path in out.rglob("*") if path.is_file() and path.relative_to(out).parts[0] != "store")

    def digest(path):
        with open(path, "rb") as file:
            return hashlib.file_digest(file, "blake2b").hexdigest()

    return {str(path.relative_to(out)): digest(path) for path in every}


def plant(cluster, job, out, python, node_kills, head_kills, draw, length):
    """Does the job on the cluster while nodes and the head are killed; returns the row of the job."""
    flags = job.flags
    line = [python, "-m", "stillpoint.plant", *map(str, flags.inputs), "--robots", str(flags.robots), "--out", str(out)]
    line += ["--address", f"{cluster.head.ip}:{PORT}", "--program", str(Path(flags.program).resolve()), "--events"]
    line += ["--"] + (["--scanners", str(flags.scanners)] if flags.scanners else [])
    environment = {**cluster.environment, "PYTHONPATH": str(flags.package)}
    begun, worked, events = time.monotonic(), busy(), open(out.with_suffix(".events"), "w")
    process = subprocess.Popen(cluster.driver.inside(line), env=environment, stdout=events)
    kills = [(draw.uniform(0, length), "node") for _ in range(node_kills)] + [(draw.uniform(0, length), "head") for _ in range(head_kills)]
    kills, away, done = sorted(kills), [], {"node": 0, "head": 0}
    while process.poll() is None and time.monotonic() - begun < LONGEST:
        now = time.monotonic() - begun
        while kills and kills[0][0] <= now:
            kind = kills.pop(0)[1]
            node = cluster.head if kind == "head" else draw.choice(cluster.workers)
            if node in [n for _, n in away]:
                continue
            node.kill()
            done[kind] += 1
            away.append((now + AWAY, node))
            print(f"# {now:.1f} s: {kind} {node.name} is killed", file=sys.stderr, flush=True)
        for at, node in list(away):
            if at <= now:
                away.remove((at, node))
                node.start()
        if done["head"] and not away:
            cluster.heal(" ".join(line[:3]) + " " + str(flags.inputs[0]))
        time.sleep(0.2)
    for _, node in away:
        node.start()
    seconds, worked = time.monotonic() - begun, busy() - worked
    if process.poll() is None:
        process.kill()
    events.close()
    said = [json.loads(text) for text in Path(events.name).read_text().splitlines() if text.startswith("{")]
    ends = [event for event in said if event["event"] == "shard"]
    made = [event["id"] for event in ends]
    return {"seconds": round(seconds, 2), "code": process.returncode, **{f"{kind}_kills": n for kind, n in done.items()},
            "processor": round(sum(e["processor"] for e in ends), 2), "busy": round(worked, 2), "shards": len(set(made)), "ends": len(made), "failures": sum(e["event"] == "failure" for e in said),
            "drivers": 1 + sum(e["event"] == "restart" for e in said)}


def main():
    def add_flags(parser):
        parser.add_argument("--python", default=sys.executable, help="a Python with ray")
        parser.add_argument("--package", type=Path, default=HOME / "stages/py/python", help="folder with the package stillpoint")
        parser.add_argument("--jobs", type=int, default=1, help="jobs without kills, each after a run on one machine")
        parser.add_argument("--node-kills", type=int, default=0, help="jobs in which one node is killed")
        parser.add_argument("--head-kills", type=int, default=0, help="jobs in which the head is killed")
        parser.add_argument("--out", type=Path, help="where rows and results go (else a temporary folder)")

    job = Job(__doc__, add_flags)
    flags, draw = job.flags, random.Random(job.flags.seed)
    folder = flags.out or Path(tempfile.mkdtemp(prefix="cluster-"))
    folder.mkdir(parents=True, exist_ok=True)
    rows = open(folder / "rows.jsonl", "a")
    expected = {}

    def row(**entry):
        print(json.dumps(entry), file=rows, flush=True)
        print(json.dumps(entry), flush=True)

    def single():
        shutil.rmtree(folder / "one", ignore_errors=True)
        begun, worked, before = time.monotonic(), busy(), resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(job.command(folder / "one", "--threads", "2"), check=True, stdout=subprocess.DEVNULL)
        after, seconds, worked = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic() - begun, busy() - worked
        processor = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        # Its digests are enough: a large result fills the disk.
        expected.clear()
        expected.update(files(folder / "one"))
        shutil.rmtree(folder / "one", ignore_errors=True)
        row(job="one machine, two threads", seconds=round(seconds, 2), processor=round(processor, 2), busy=round(worked, 2))

    cluster = Cluster(flags.python, folder)
    try:
        length = 60.0
        kinds = ["plain"] * flags.jobs + ["node"] * flags.node_kills + ["head"] * flags.head_kills
        for number, kind in enumerate(kinds):
            if kind == "plain":
                cluster.rest()
                single()
            if kind == "plain" or not number:
                cluster.start()
            out = folder / "many"
            shutil.rmtree(out, ignore_errors=True)
            entry = plant(cluster, job, out, flags.python, kind == "node", kind == "head", draw, length)
            length = entry["seconds"] if kind == "plain" else length
            same = entry["code"] == 0 and files(out) == expected
            row(job=f"two nodes, {kind}", number=number, **entry, same=same)
            shutil.move(out.with_suffix(".events"), folder / f"events-{number}.jsonl")
    finally:
        cluster.stop()
    shutil.rmtree(folder / "many", ignore_errors=True)
    shutil.rmtree(folder / "one", ignore_errors=True)


if __name__ == "__main__":
    main()
