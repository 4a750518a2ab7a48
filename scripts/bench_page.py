#!/usr/bin/env python3
"""Makes benches/README.md and its plots from benches/page.md and the dated files of benches/runs.

    scripts/bench_page.py            writes the page and the plots
    scripts/bench_page.py --check    compares them with what is there, byte for byte; exits with 1
                                     and names the first file that differs

Standard library only, so that the same files always give the same bytes. A file of figures is
benches/runs/DATE/NAME.csv: lines that begin with '#' say what was measured, by which command, and
what a reader has to know; then columns with a header. Of rows with the same key the newest one
counts: the one of the later date, and within a file the lower one.

In benches/page.md a line "@table NAME", "@plot NAME", "@source NAME" or "@say NAME" is replaced by
a table, a plot, a line on where the figures come from, or a sentence, each made below; "@others" by
links to all other figures.
"""

import csv
import pathlib
import sys
from collections import OrderedDict

BENCHES = pathlib.Path(__file__).resolve().parent.parent / "benches"


class Family:
    """All rows of one name, oldest first, each with its date, and what its newest file says."""

    def __init__(self, name):
        self.name, self.rows, self.about, self.path = name, [], {}, None
        for path in sorted(BENCHES.glob(f"runs/*/{name}.csv")):
            lines = path.read_text(encoding="utf-8").splitlines()
            said = [line[1:].strip().split(": ", 1) for line in lines if line.startswith("#")]
            self.about = {key: text for key, text in said}
            self.path, date = path.relative_to(BENCHES), path.parent.name
            for row in csv.DictReader(line for line in lines if not line.startswith("#")):
                self.rows.append({**row, "date": date})
        if not self.rows:
            raise SystemExit(f"error: there is no benches/runs/DATE/{name}.csv; restore it")

    def newest(self, *keys, **equal):
        """The newest row of each key, in the order in which the keys appeared."""
        out = OrderedDict()
        for row in self.rows:
            if all(row[key] == value for key, value in equal.items()):
                out[tuple(row[key] for key in keys)] = row
        return list(out.values())

    def last(self):
        """All rows of the newest date."""
        return [row for row in self.rows if row["date"] == self.rows[-1]["date"]]


def number(text):
    """The number that a cell holds; None for an empty one."""
    return float(text) if text else None


def escaped(text):
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


COLORS = ["#3b6ea5", "#d98c3f", "#6a9a58"]
LEFT, WIDE, RIGHT, ROW, BAR = 370, 300, 130, 18, 12


def chart(title, unit, rows, series, marks=(), low=None):
    """Horizontal bars as SVG: `rows` are (label, [(value, text) for each of `series`]), `marks` are
    (value, words) that are drawn as lines across. With `low` the axis is logarithmic from there."""
    import math

    values = [v for _, bars in rows for v, _ in bars if v is not None] + [v for v, _ in marks]
    most = max(values) * 1.02 or 1.0

    def x(value):
        if low is None:
            return LEFT + WIDE * max(value, 0.0) / most
        return LEFT + WIDE * math.log(max(value, low) / low) / math.log(most / low)

    top = 30 + 16 * bool(series[1:]) + 16 * bool(marks)
    n_bars = [max(1, sum(v is not None or bool(t) for v, t in bars)) for _, bars in rows]
    height = top + sum(n * BAR + ROW - BAR for n in n_bars) + 8
    width = LEFT + WIDE + RIGHT
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
        f'font-family="sans-serif" font-size="11">',
        f'<rect width="{width}" height="{height}" fill="white"/>',
        f'<text x="8" y="18" font-size="13">{escaped(", ".join(part for part in (title, unit) if part))}</text>',
    ]
    y = 34
    if series[1:]:
        at = LEFT
        for color, words in zip(COLORS, series):
            out.append(f'<rect x="{at}" y="{y - 9}" width="9" height="9" fill="{color}"/>')
            out.append(f'<text x="{at + 13}" y="{y}">{escaped(words)}</text>')
            at += 34 + 6 * len(words)
        y += 16
    for value, words in marks:
        out.append(
            f'<line x1="{x(value):.1f}" x2="{x(value):.1f}" y1="{top}" y2="{height - 6}" '
            'stroke="#b03030" stroke-dasharray="3 2"/>'
        )
        anchor = "start" if x(value) < LEFT + WIDE / 2 else "end"
        out.append(
            f'<text x="{x(value):.1f}" y="{top - 4}" fill="#b03030" text-anchor="{anchor}">'
            f"{escaped(words)}</text>"
        )
    y = top
    for (label, bars), n in zip(rows, n_bars):
        middle = y + n * BAR / 2 + 5
        out.append(
            f'<text x="{LEFT - 6}" y="{middle:.1f}" text-anchor="end">{escaped(label)}</text>'
        )
        for color, (value, text) in zip(COLORS, bars):
            if value is None and not text:
                continue
            long = 0.0 if value is None else max(x(value) - LEFT, 0.5)
            if value is not None:
                out.append(
                    f'<rect x="{LEFT}" y="{y + 1}" width="{long:.1f}" height="{BAR - 2}" '
                    f'fill="{color}"/>'
                )
            out.append(f'<text x="{LEFT + long + 4:.1f}" y="{y + BAR - 2}">{escaped(text)}</text>')
            y += BAR
        y += ROW - BAR + (BAR if not any(v is not None or t for v, t in bars) else 0)
    return "\n".join(out + ["</svg>", ""])


def table(head, rows):
    lines = ["| " + " | ".join(head) + " |", "| --- " * len(head) + "|"]
    return lines + ["| " + " | ".join(cell or "–" for cell in row) + " |" for row in rows]


def bar(row, column, text=None):
    value = number(row[column])
    return value, (text or row[column]) if value is not None else ""


# What is asked of postures ------------------------------------------------------------------------

ROBOTS = ["spot welder", "ten real models", "looped models"]


def asked(row):
    unit = row["unit"] if row["unit"] in ("°", "") else " " + row["unit"]
    return f"{row['sense']} {row['asked']}{unit}" if row["asked"] else ""


def goals():
    """The newest row of each goal that has a bound or a note, by robots."""
    out = OrderedDict()
    for row in Family("goals").newest("scene", "quantity", "unit", "robots"):
        if row["asked"] or row["goal"] == "T4":
            out.setdefault((row["goal"], row["scene"], row["quantity"], row["unit"]), []).append(
                row
            )
    # By the number of the goal; those without one last.
    return OrderedDict(sorted(out.items(), key=lambda item: goal_number(item[0][0])))


def goal_number(goal):
    digits = "".join(c for c in goal if c.isdigit())
    return int(digits) if digits else 99


def table_goals():
    rows = []
    for (goal, scene, quantity, unit), found in goals().items():
        by = {row["robots"]: row for row in found}
        welder, others = by.get(ROBOTS[0]), by.get(ROBOTS[1]) or by.get(ROBOTS[2])
        said = [f"{r['reached']} ({r['seed']})" if r else "" for r in (welder, others)]
        what = f"{goal} {scene}: {quantity}".strip()
        bound = "1.3 × T2" if goal == "T4" else asked(found[0])
        rows.append([what, bound or unit, *said])
    return table(["what", "asked", "spot welder (seed)", "real models (seed)"], rows)


def plot_goals():
    rows = []
    for (goal, scene, quantity, _), found in goals().items():
        if found[0]["sense"] != "at most" or not found[0]["asked"]:
            continue
        by = {"looped models" if r["robots"] == ROBOTS[2] else r["robots"]: r for r in found}
        bars = []
        for robots in ROBOTS[:2]:
            row = by.get(robots) or (by.get(ROBOTS[2]) if robots == ROBOTS[1] else None)
            share = row and 100.0 * float(row["reached"]) / float(row["asked"])
            bars.append((share, f"{share:.0f}") if row else (None, ""))
        scene = scene.split(" (")[0].split(",")[0]
        quantity = quantity.removesuffix(", largest").removesuffix(", median")
        rows.append((f"{goal} {scene}: {quantity}".strip(), bars))
    series = ["spot welder", "real models"]
    return chart("Reached, as a share of what is allowed", "%", rows, series, [(100.0, "allowed")])


# Suites -------------------------------------------------------------------------------------------


def suites():
    return Family("suites_ten_models").newest("suite")


def say_suites():
    rows = suites()
    n, right, trusted = (sum(int(r[k]) for r in rows) for k in ("cases", "right", "trusted"))
    demo = Family("suites_demo_robots").newest("suite")
    m, well = (sum(int(r[k]) for r in demo) for k in ("cases", "right"))
    return [
        f"Newest row of each of {len(rows)} suites, ten real models: {right} of {n} right, "
        f"{trusted} trusted;",
        f"of three demo robots in {len(demo)} suites {well} of {m} are right.",
    ]


def plot_suites():
    rows = [(f"{r['suite']} ({r['seed']})", [bar(r, "largest_deg")]) for r in suites()]
    return chart("Largest error of a determined joint, by suite (seed)", "°", rows, ["largest"])


def plot_baselines():
    rows = []
    for r in Family("baselines").last():
        label = f"{r['suite']} ({r['right']} of {r['cases']} right)"
        rows.append((label, [bar(r, "rms_deg"), bar(r, "largest_deg")]))
    title = "Joints in the cells of registration, by way"
    return chart(title, "°", rows, ["rms", "largest"])


def plot_source_protocol():
    rows = []
    for row in Family("source_protocol").newest("robot"):
        bars = [bar(row, k) for k in ("swept_deg", "registered_deg", "ours_deg")]
        rows.append((row["robot"], bars))
    series = ["source, swept", "source, registered", "Stillpoint"]
    return chart("Largest joint error in the protocol of the source", "°", rows, series)


# Unknown base and posture -------------------------------------------------------------------------


def say_unknown():
    rows = Family("unknown").rows
    n, right, wrong, invented = (
        sum(int(r[k]) for r in rows) for k in ("cases", "right", "wrong_and_trusted", "invented")
    )
    last = rows[-1]
    return [
        f"Last seed ({last['seed']}, {last['date']}): {last['right']} of {last['cases']} right, "
        f"{last['trusted']} trusted, {last['wrong_and_trusted']} wrong and trusted.",
        f"All {len(rows)} seeds on record, each on the build of its day: {right} of {n} right, {wrong} "
        f"wrong and trusted, {invented} invented.",
    ]


def plot_unknown():
    rows = []
    for row in Family("unknown").rows:
        n = int(row["cases"])
        wrong, doubted = n - int(row["right"]), int(row["right"]) - int(row["trusted"])
        bars = [(100.0 * k / n, f"{k} of {n}") for k in (wrong, doubted)]
        rows.append((f"seed {row['seed']}, {row['date']}", bars))
    series = ["not right", "right, but doubtful"]
    return chart(
        "Unknown base and posture: cases that are not right or doubtful", "%", rows, series
    )


def plot_foreign_robots():
    rows = []
    for row in Family("foreign_robots").rows:
        n = int(row["cases"])
        bars = [
            (100.0 * int(row[k]) / n, f"{row[k]} of {n}") if row[k] else (None, "")
            for k in ("right", "trusted")
        ]
        cells = row["cells"].split(", searched")[0].strip("`")
        rows.append((f"{row['arms'].split(',')[0]}: {cells}", bars))
    return chart("Robots that it was not developed with", "%", rows, ["right", "trusted"])


def plot_deviations():
    rows = []
    for robots, seed in (("spot welder", "99041"), ("ten real models", "99042")):
        for row in Family("deviations").newest("suites", robots=robots, seed=seed):
            rows.append((f"{robots}: {row['suites']}", [bar(row, "z_rms")]))
    marks = [(0.7, "asked: from 0.7"), (1.5, "to 1.5")]
    return chart("Errors over stated standard deviations, rms", "", rows, ["rms"], marks)


def plot_basin():
    family, rows = Family("basin"), []
    for off in ("2", "5", "8", "12", "16", "20", "30"):
        by = {r["robots"]: r for r in family.newest("robots", off_deg=off)}
        rows.append(
            (f"every joint off by up to {off}°", [bar(by[k], "home_percent") for k in ROBOTS[:2]])
        )
    return chart("Starts from which the refinement alone comes home", "%", rows, ROBOTS[:2])


def mean(row, *keys):
    value = sum(float(row[k]) for k in keys) / len(keys)
    return value, f"{value:.2f}"


def plot_fit_time():
    rows = [
        (
            r["robot"],
            [
                mean(r, "first_s", "second_s"),
                mean(r, "build_before_first_s", "build_before_second_s"),
            ],
        )
        for r in Family("fit_time").last()
    ]
    series = ["measured build", "build before"]
    return chart("Fit of a known model, mean of two turns", "s", rows, series, [(1.5, "asked")])


def plot_joint_places():
    rows = [
        (r["model"], [bar(r, f"offset_{k}_mm") for k in ("true", "one_posture", "all")])
        for r in Family("joint_places").last()
    ]
    series = ["as the model has it", "from one posture", "from four"]
    return chart("Where axes of joints are: offset from the truth", "mm", rows, series)


# Cameras, plants, rescans -------------------------------------------------------------------------


def plot_depth_cameras():
    rows = [(r["set"], [bar(r, "median_error_deg")]) for r in Family("depth_cameras").newest("set")]
    return chart("Real depth cameras: median error of joints 1 to 6", "°", rows, ["median"])


def say_camera_deviations():
    by = {r["quantity"]: r["value"] for r in Family("camera_deviations").last()}
    return [
        f"Of {by['frames']} frames the arm is found in {by['found']}; none is trusted, none wrong and "
        "trusted;",
        f"{by['joints within 3 standard deviations']} of {by['joints']} joints lie within three stated "
        f"deviations (rms {by['z rms']}).",
    ]


def say_plants():
    rows = Family("plants").last()
    n, found, trusted, wrong, invented = (
        sum(int(r[k] or 0) for r in rows if r["found"] != "0")
        for k in ("robots", "found", "trusted", "wrong_and_trusted", "invented")
    )
    least = min(float(r["f1_median"]) for r in rows if r["f1_median"])
    lost = max(float(r["lost_largest_percent"]) for r in rows)
    return [
        f"Of {n} robots that the library knows {found} are found, {trusted} trusted, {wrong} wrong and "
        f"trusted; {invented} are invented.",
        f"The median F1 of moving against fixed points is at least {least:.4f} in each suite; at most "
        f"{lost:.4f} % of the fixed points are lost.",
    ]


def plot_plants():
    rows = []
    for r in Family("plants").last():
        n = int(r["robots"])
        if n and r["found"] != "0":
            bars = [(100.0 * int(r[k]) / n, f"{r[k]} of {n}") for k in ("found", "trusted")]
            rows.append((r["suite"].split(":")[0].split(",")[0], bars))
    return chart("Robots of whole plants", "%", rows, ["found, right model", "trusted"])


def say_at_work():
    rows = Family("at_work").last()
    robots, right, wrong = (
        sum(int(r[k]) for r in rows) for k in ("robots", "right", "wrong_and_trusted")
    )
    return [
        f"Of {robots} robots {right} are found and right, {wrong} wrong and trusted. The median F1 of "
        f"moving against fixed points is {min(float(r['f1_median']) for r in rows):.4f} or more in each "
        f"suite, and of all fixed points at most {max(float(r['lost_largest_percent']) for r in rows):.4f} % "
        "are lost in one case.",
    ]


def table_at_work():
    head = ["suite, library (seed)", "cases", "robots", "right", "trusted", "F1, median", "tenth", "least"]
    head += ["tools (open)", "carried (open)", "hoses (open)", "lost of one thing, most %"]
    rows = []
    for r in Family("at_work").last():
        shares = [f"{r[k]} ({r[f'{k}_open']})" if r[k] else "" for k in ("tools", "carried", "hoses")]
        row = [f"{r['suite']}, {r['library']} ({r['seed']})", r["cases"], r["robots"], r["right"]]
        row += [r["trusted"], r["f1_median"], r["f1_tenth"], r["f1_least"], *shares]
        rows.append([*row, f"{r['lost_of_one_percent']} ({r['of']})" if r["of"] else "0"])
    return table(head, rows)


def plot_shared_scans():
    by = OrderedDict()
    for r in Family("shared_scans").last():
        by.setdefault(r["plants"], []).append(bar(r, "between_robots_rms_mm"))
    series = ["each alone", "together"]
    return chart(
        "Error between the bases of robots of a plant, rms", "mm", list(by.items()), series
    )


def plot_other_simulators():
    rows = []
    for r in Family("other_simulators").rows:
        n = int(r["robots"])
        bars = [
            (100.0 * int(r[k]) / n, f"{r[k]} of {n}") if r[k] else (None, "")
            for k in ("found_right", "trusted")
        ]
        rows.append((f"{r['date']}: {r['scenes'].split(', seeds')[0]}", bars))
    return chart("Robots in scenes of other simulators", "%", rows, ["found, right", "trusted"])


def say_other_simulators():
    rows = Family("other_simulators").rows
    wrong = sum(int(r["wrong_and_trusted"] or 0) for r in rows)
    return [
        f"Robots that were wrong and trusted: {wrong}. Each set was measured on the build of its day."
    ]


def plot_rescans():
    rows = [
        (
            f"seed {r['seed']}: {r['halls']} halls",
            [bar(r, f"share_{k}_percent") for k in ("least", "largest")],
        )
        for r in Family("rescans").rows
    ]
    series = ["least", "largest"]
    return chart(
        "Time of a rescan over that of the whole run", "%", rows, series, [(10.0, "asked")]
    )


def say_rescans():
    rows = Family("rescans").rows
    n = sum(int(r["halls"]) for r in rows)
    found = [sum(int(r[f"{k}_found"]) for r in rows) for k in ("robot", "pallet", "barrel")]
    invented = sum(int(r["invented"]) for r in rows)
    by = {r["quantity"]: r["value"] for r in Family("rescan_frames").last()}
    return [
        f"In {n} halls the robot is found {found[0]} times, the pallet {found[1]} times, the barrel "
        f"{found[2]} times; {invented} changes are invented.",
        f"New scans in another frame are laid on in {by['laid on within tolerance']} of 20 halls, at most "
        f"{by['shift off, largest']} mm and {by['turn off, largest']}° off;",
        f"in lines of equal cells none is laid on a wrong one, and {by['refused, without walls']} of 4 "
        "lines without walls are refused.",
    ]


def say_shift():
    rows = [r for r in Family("shift").last() if r["sides"] == "all" and r["build"] == "after"]
    moved, stated, within = (sum(int(r[k]) for r in rows) for k in ("moved", "stated", "within_3"))
    return [
        f"Of {moved} things that are reported as moved the shift of {stated} is stated, and within three "
        f"deviations for {within}."
    ]


def table_shift():
    head = ["build (seed)", "sides that each session sees", "things", "moved", "shift stated"]
    head += ["error, median mm", "90 %", "largest", "within 3 deviations", "turn, median °"]
    rows = []
    for r in Family("shift").last():
        within = f"{r['within_3']} of {r['stated']}" if r["within_3"] else ""
        errors = [r[f"{k}_mm"] for k in ("median", "most", "largest")]
        row = [f"{r['build']} ({r['seed']})", r["sides"], r["things"], r["moved"], r["stated"]]
        rows.append([*row, *errors, within, r["turn_median_deg"]])
    return table(head, rows)


def say_found_scanners():
    rows = Family("found_scanners").last()
    invented = sum(int(r["invented"]) for r in rows)
    ordered = [r for r in rows if int(r["found"])]
    found, setups = (sum(int(r[k]) for r in ordered) for k in ("found", "setups"))
    return [
        f"In files that keep the order of measurement {found} of {setups} setups are found, half of them to "
        f"{max(float(r['error_median_mm']) for r in ordered):.3f} mm; {invented} are invented in all."
    ]


def table_found_scanners():
    head = ["order of the points", "setups", "found", "invented", "error, median mm", "95 %", "worst"]
    head += ["error by deviation, median", "95 %", "points of another setup, %", "s a cloud"]
    keys = ["order", "setups", "found", "invented", "error_median_mm", "error_95_mm", "error_worst_mm"]
    keys += ["by_sigma_median", "by_sigma_95", "points_wrong_percent", "seconds"]
    return table(head, [[r[k] for k in keys] for r in Family("found_scanners").last()])


def table_base_search():
    head = ["pass", "before, ms", "after, ms"]
    return table(head, [[r["pass"], r["ms_before"], r["ms_after"]] for r in Family("base_search").last()])


def say_paths():
    rows = Family("paths").last()
    n, free = (sum(int(r[k] or 0) for r in rows) for k in ("colliding", "colliding_called_free"))
    return [f"Of {n} colliding paths {free} are called free."]


def plot_paths():
    rows = []
    for r in Family("paths").last():
        n, k = int(r["free_in_seen_space"]), int(r["called_free"])
        rows.append(
            (
                f"{r['cells'].split(',')[0]}, {r['places_apart_cm']} cm",
                [(100.0 * k / n, f"{k} of {n}")],
            )
        )
    return chart("Free paths in seen space that are called free", "%", rows, ["called free"])


def plot_ended_early():
    rows = [
        (f"{r['test']}: {r['quantity'].split(', ')[-1]}", [bar(r, "value")])
        for r in Family("ended_early").last()
        if r["quantity"].startswith("work over")
    ]
    return chart("Work of a chain of killed runs over that of one run", "×", rows, ["work"])


def say_ended_early():
    by = {(r["test"], r["quantity"]): r["value"] for r in Family("ended_early").last()}
    return [
        f"{by['kills', 'kills']} kills in {by['kills', 'chains with the bytes of an undisturbed run']} "
        "chains: all end with the bytes of an undisturbed run.",
        f"{by['full disks', 'found no room']} of {by['full disks', 'runs']} runs on small disks find no "
        "room, say how much is missing and end with 5; the next runs end right.",
    ]


# Speed and memory ---------------------------------------------------------------------------------


def table_throughput():
    keys = [
        "points_million",
        "scans",
        "seconds",
        "million_points_per_s",
        "over_copy",
        "resident_gib",
        "note",
    ]
    head = ["M points", "scans", "s", "M points/s", "× copy of the file", "resident, GiB", "note"]
    return table(head, [[r[k] for k in keys] for r in Family("throughput").last()])


def plot_throughput():
    rows = [(r["stage"], [bar(r, "seconds")]) for r in Family("stages").last()]
    return chart("Stages of the run of 998 M points", "s", rows, ["seconds"])


def plot_peers():
    rows = []
    for r in Family("peers").last():
        slow = number(r["slowest_s"])
        tool, _, way = r["tool"].partition(" (")
        way = f" ({way.rstrip(')').split(',')[0]})" if way else ""
        label = f"{r['points_million']} M: {tool}{way}"
        if slow is None:
            rows.append((label, [(None, r["note"])]))
        else:
            rows.append((label, [(slow, r["slowest_s"])]))
    rows.sort(key=lambda row: float(row[0].split(" M")[0]))
    return chart(
        "Read, floor, bodies, tiles: slowest run, logarithmic", "s", rows, ["seconds"], low=0.1
    )


def plot_plan():
    rows = [
        (
            f"hall {r['hall']}, {r['robots']} robots, {r['points_million']} M points",
            [bar(r, "over_middle")],
        )
        for r in Family("plan").last()
    ]
    marks = [(0.5, "asked: from 0.5"), (2.0, "to 2")]
    return chart("Processor time over the middle of what plan says", "×", rows, ["ratio"], marks)


def say_kernels():
    rows = [r for r in Family("kernels").last() if r["unit"] == "ms"]
    said = [f"{r['kernel']} ({r['input']}) {r['median']} ms" for r in rows]
    return ["Medians of whole calls: " + ", ".join(said) + "; of items in the plot."]


def plot_kernels():
    rows = []
    for r in Family("kernels").last():
        if r["unit"] == "M items/s":
            rows.append((f"{r['kernel']}, {r['input']}", [bar(r, "median")]))
    return chart("Kernels, median", "M points, samples or beams a second", rows, ["median"])


# The page -----------------------------------------------------------------------------------------


def source(name):
    family = Family(name)
    text = f"Raw: [{family.path}]({family.path})"
    dates = sorted({row["date"] for row in family.rows})
    if dates[1:]:
        text += f" and {len(dates) - 1} earlier"
    command = family.about.get("command")
    return [text + (f". Again: `{command}`." if command else ".")]


def others(page):
    """Links to the newest file of each name that the page does not name yet."""
    newest = {path.stem: path.relative_to(BENCHES) for path in sorted(BENCHES.glob("runs/*/*.csv"))}
    text = "\n".join(page)
    return ", ".join(f"[{n}]({p})" for n, p in sorted(newest.items()) if f"/{n}.csv" not in text)


def made():
    """All files that are made: path below benches/, and text."""
    files, page = {}, []
    here = globals()
    for line in (BENCHES / "page.md").read_text(encoding="utf-8").splitlines():
        word, _, name = line.partition(" ")
        if word == "@plot":
            files[f"plots/{name}.svg"] = svg = here[f"plot_{name}"]()
            title = svg.split('font-size="13">', 1)[1].split("</text>", 1)[0]
            page.append(f"![{title}](plots/{name}.svg)")
        elif word == "@source":
            page += source(name)
        elif word in ("@table", "@say"):
            page += here[f"{word[1:]}_{name}"]()
        elif word == "@others":
            page.append(f"Further figures on record: {others(page)}.")
        else:
            page.append(line)
    files["README.md"] = "\n".join(page) + "\n"
    return files


def main(arguments):
    if arguments not in ([], ["--check"]):
        raise SystemExit(f"error: unknown arguments {arguments}; see the head of this file")
    files = made()
    for name, text in sorted(files.items()):
        path, bytes_ = BENCHES / name, text.encode("utf-8")
        if not arguments:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(bytes_)
        elif not path.is_file() or path.read_bytes() != bytes_:
            raise SystemExit(
                f"error: benches/{name} is not what the runs give; run scripts/bench_page.py"
            )
    odd = {p.name for p in BENCHES.glob("plots/*")} - {n.split("/")[1] for n in files if "/" in n}
    if odd:
        raise SystemExit(f"error: benches/plots/{sorted(odd)[0]} is not on the page; remove it")
    print(f"{len(files)} files {'are as the runs give them' if arguments else 'written'}")


if __name__ == "__main__":
    main(sys.argv[1:])
