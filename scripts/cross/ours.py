"""Rules that our files keep by themselves, and what our small files must say."""

import json
import struct
import xml.etree.ElementTree as ET
import zlib

import compare
import numpy as np


def copc_rules(path, n_points):
    """The specification of COPC 1.0, and copclib's test that each node's points lie in its cube."""
    raw = path.read_bytes()
    wrong = []
    if raw[:4] != b"LASF" or raw[24:26] != b"\x01\x04" or raw[104] & 0x3F not in (6, 7, 8):
        wrong.append("header is not LAS 1.4 with format 6, 7 or 8")
    if raw[375 + 2:375 + 6] != b"copc" or struct.unpack_from("<HH", raw, 375 + 18) != (1, 160):
        wrong.append("the info record is not the first, at byte 375")
    info = struct.unpack_from("<5d2Q2d11Q", raw, 375 + 54)
    middle, half, page_at, page_size = np.array(info[:3]), info[3], info[5], info[6]
    if any(info[9:]):
        wrong.append("reserved bytes of the info record are not zero")
    low, high = np.array(struct.unpack_from("<6d", raw, 179)).reshape(3, 2)[:, 1], np.array(struct.unpack_from("<6d", raw, 179)).reshape(3, 2)[:, 0]
    if (low < middle - half - 1e-9).any() or (high > middle + half + 1e-9).any():
        wrong.append("the cube does not hold the bounds of the header")
    entries, pages = {}, [(page_at, page_size)]
    while pages:
        at, size = pages.pop()
        for k in range(size // 32):
            *key, offset, n_bytes, n = struct.unpack_from("<4iQ2i", raw, at + 32 * k)
            if n == -1:
                pages.append((offset, n_bytes))
            else:
                entries[tuple(key)] = n
    if sum(entries.values()) != n_points or struct.unpack_from("<Q", raw, 247)[0] != n_points:
        wrong.append(f"nodes hold {sum(entries.values())} points of {n_points}")
    for depth, *place in entries:
        if depth and (depth - 1, *(v >> 1 for v in place)) not in entries:
            wrong.append(f"a node has no parent: {depth}-{'-'.join(map(str, place))}")
            break
    if (0, 0, 0, 0) not in entries:
        wrong.append("there is no root node")
    return "; ".join(wrong) or "right"


def fixed_links(path):
    """The root, which a simulator may fix to the world, and links on fixed joints."""
    root = ET.parse(path).getroot()
    fixed = {j.find("child").get("link") for j in root.findall("joint") if j.get("type") == "fixed"}
    children = {j.find("child").get("link") for j in root.findall("joint")}
    return fixed | {link.get("name") for link in root.findall("link")} - children


def small_files(out):
    """File, path, readers with their packages, what they must say, and how exactly."""
    result = compare.read_json(out / "result.json")
    robot = result["robots"][0]
    values = robot["joints"] | robot["passive"]
    base = robot["base_pose"]
    posture = {"base": {"link": robot["base_link"], "xyz": base["xyz"], "quat_wxyz": base["quat_wxyz"]}, "joints": values}
    folder = out / "robots" / robot["id"]
    yield "`joints.yaml`", folder / "joints.yaml", (("pyyaml", "pyyaml"), ("ruamel", "ruamel-yaml")), posture, 1e-6
    yield from csv_files(folder, robot, values)
    yield "`result.json`", out / "result.json", (("stdlib", None),), json.loads((out / "result.json").read_text()), 0
    yield "`report --junit`", out / "junit.xml", (("junitparser", "junitparser"), ("elementtree", None)), junit(out, result), 0
    picture = out / "pictures/plan_0.png"
    yield "`pictures/*.png`", picture, (("pillow", "pillow"), ("imageio", "imageio"), ("opencv", "opencv-python-headless")), png(picture), 0


def csv_files(folder, robot, values):
    """The table without its empty cells, which each reader has a word of its own for."""
    lines = (folder / "joints.csv").read_text().splitlines()
    head = lines[0].split(",")
    rows = [dict(zip(head, line.replace('"', "").split(","))) for line in lines[1:]]
    full = all(cell for row in rows for cell in row.values())
    assert {row["joint"] for row in rows} == set(values), "joints.csv lacks a joint"
    assert all(abs(float(row["value"]) - values[row["joint"]]) < 1e-8 for row in rows), "joints.csv has another value"
    typed = [{k: number(v) for k, v in row.items()} for row in rows]
    if full:
        yield "`joints.csv`", folder / "joints.csv", (("csv", None), ("pandas", "pandas"), ("polars", "polars")), typed, 1e-9
    else:
        for reader, package, empty in (("csv", None, ""), ("pandas", "pandas", None), ("polars", "polars", None)):
            expected = [{k: empty if v == "" else v for k, v in row.items()} for row in typed]
            yield "`joints.csv`", folder / "joints.csv", ((reader, package),), expected, 1e-9


def number(text):
    try:
        return float(text)
    except ValueError:
        return text


def junit(out, result):
    """From the text of the report itself, without an XML library."""
    text = (out / "junit.xml").read_text()
    cases = []
    for piece in text.split("<testcase ")[1:]:
        body = piece.split("</testcase>")[0] if not piece.split(">")[0].endswith("/") else piece.split(">")[0]
        name = (" " + piece).split(' name="')[1].split('"')[0]
        cases.append([name, sorted(kind for kind in ("failure", "skipped", "error") if f"<{kind}" in body)])
    count = lambda kind: sum(kind in kinds for _, kinds in cases)
    assert all(any(robot["id"] in name for name, _ in cases) for robot in result["robots"]), "a robot has no case"
    return {"tests": len(cases), "failures": count("failure"), "skipped": count("skipped"), "cases": cases}


def png(path):
    """Size, sum and first pixel, decoded by the specification: eight bits, RGB or RGBA, not interlaced."""
    raw, at, data = path.read_bytes(), 8, b""
    while at < len(raw):
        n, kind = struct.unpack_from(">I4s", raw, at)
        if kind == b"IHDR":
            width, height, depth, colour, _, _, interlaced = struct.unpack_from(">IIBBBBB", raw, at + 8)
        data += raw[at + 8:at + 8 + n] if kind == b"IDAT" else b""
        at += 12 + n
    assert depth == 8 and colour in (2, 6) and not interlaced, (depth, colour)
    deep = {2: 3, 6: 4}[colour]
    rows = np.frombuffer(zlib.decompress(data), np.uint8).reshape(height, 1 + width * deep)
    pixels, before = np.zeros((height, width * deep), np.uint8), np.zeros(width * deep, np.uint8)
    for y, row in enumerate(rows):
        before = pixels[y] = unfiltered(int(row[0]), row[1:].astype(int), before.astype(int), deep)
    image = pixels.reshape(height, width, deep)[..., :3]
    return [[height, width], int(image.astype("u8").sum()), image[0, 0].tolist()]


def unfiltered(kind, row, above, deep):
    if kind in (0, 2):
        return ((row + (above if kind == 2 else 0)) % 256).astype(np.uint8)
    if kind == 1:
        return (np.cumsum(row.reshape(-1, deep), axis=0) % 256).astype(np.uint8).ravel()
    out = np.zeros(len(row) + deep, int)
    for x, value in enumerate(row.tolist()):
        a, b, c = int(out[x]), int(above[x]), int(above[x - deep]) if x >= deep else 0
        if kind == 3:
            guess = (a + b) // 2
        else:
            p = a + b - c
            guess = min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2]
        out[x + deep] = (value + guess) % 256
    return out[deep:].astype(np.uint8)
