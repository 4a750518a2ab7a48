#!/usr/bin/env python3
"""Makes the pictures of README and guide again from results.

  pip install pillow
  stillpoint demo --out demo
  stillpoint run demo/scans/scans.e57 --robots FOLDER_WITH_A_GRIPPER_ONLY --out none
  stillpoint simulate demo/scene_later.toml --robots demo/robots --out later
  stillpoint rescan --base demo/result later/scans.e57 --out changed --robot R3
  scripts/guide_pictures.py demo/result none changed [--shots FOLDER] [--terminal FILE] [--before FOLDER]

`none` is a result of the same scans in which no robot was found: the cell before. `--shots` is the folder of screenshots of
`ONLY=rest node scripts/report_page.mjs` of the page of a hall. `--terminal` is what a run shows on a terminal of 80 columns:

  script -qec "stty cols 80; stillpoint run demo/scans/scans.e57 --robots demo/robots --out new" terminal.txt

`--before` has the same of an earlier program, for the page that compares them: `result`, `changed` and `terminal.txt`.
"""
import argparse
import re
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

PICTURES = Path(__file__).resolve().parent.parent / "src" / "guide" / "pictures"
# A larger picture is kept with 256 colours, bytes; the test of the guide allows 300 000.
MOST_BYTES = 290_000
# A page of the guide is so wide, pixels: what is wider is shown smaller.
PAGE = 740
FONT = "/usr/share/fonts/truetype/dejavu/DejaVuSansMono.ttf"
COLORS = {"31": "#ff7b72", "32": "#7ee787", "33": "#e3b341", "36": "#79c0ff", "1": "#ffffff", "2": "#8b949e"}


def keep(image, name):
    image = image.convert("RGB")
    image.save(PICTURES / name, optimize=True)
    if (PICTURES / name).stat().st_size > MOST_BYTES:
        image.quantize(256, dither=Image.Dither.NONE).save(PICTURES / name, optimize=True)
    print(f"{name}: {image.width} x {image.height}, {(PICTURES / name).stat().st_size} bytes")


def screen(text, n_lines):
    """The lines that stand on a terminal at the end, with the last state of a bar above what follows it."""
    lines, bar = [], ""
    for line in text.splitlines():
        states = [s for s in re.split(r"\r|\x1b\[\d*[ABGK]|\x1b\[2K", line) if s.strip()]
        if line.startswith("Script "):
            continue
        # A bar that was wiped away was there all the time before.
        bars = [s for s in states if re.search(r"\[[=> ]{16}\]", s)]
        bar = next((s for s in bars if "finding" in s), bar) if bars else bar
        rest = [s for s in states if s not in bars]
        lines += rest[-1:] or ([""] if not states else [])
    return ([bar, ""] if bar else []) + lines[:n_lines - 2 * bool(bar)]


def terminal(path, n_lines=34):
    """What a terminal showed, as a picture."""
    font, height = ImageFont.truetype(FONT, 13), 18
    lines = screen(path.read_text(), n_lines)
    image = Image.new("RGB", (PAGE, 20 + height * len(lines)), "#14181c")
    draw = ImageDraw.Draw(image)
    for row, line in enumerate(lines):
        color, x = "#dfe5ea", 14.0
        for part in re.split(r"(\x1b\[[0-9;]*m)", line):
            if part.startswith("\x1b"):
                codes = [c for c in part[2:-1].split(";") if c in COLORS]
                color = COLORS[codes[-1]] if codes else "#dfe5ea"
                continue
            draw.text((x, 10 + height * row), part, font=font, fill=color)
            x += font.getlength(part)
    return image


def pairs(folder, prefix, text):
    """The five pictures of one program on the page that compares two."""
    pictures = folder / "pictures"
    plan = Image.open(pictures / "plan_0.png")
    keep(plan.crop((0, 0, min(PAGE, plan.width), plan.height)), f"{prefix}_plan.png")
    views = Image.open(pictures / "R1.png")
    keep(views.crop((0, 0, views.width // 2, 590)), f"{prefix}_views.png")
    evidence = Image.open(pictures / "R1_evidence.png")
    keep(evidence.crop((0, 590, 690, evidence.height)), f"{prefix}_joints.png")
    keep(terminal(text), f"{prefix}_terminal.png")


def main():
    args = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    args.add_argument("results", type=Path, nargs=3, metavar="RESULT")
    for flag in ("--shots", "--terminal", "--before"):
        args.add_argument(flag, type=Path)
    args = args.parse_args()
    found, none, changed = args.results
    keep(Image.open(none / "pictures/plan_0.png"), "before.png")
    plan = Image.open(found / "pictures/plan_0.png")
    keep(plan, "after.png")
    keep(Image.open(found / "pictures/R1_evidence.png"), "evidence.png")
    views = Image.open(found / "pictures/R1.png")
    keep(views, "views.png")
    # The oblique view alone, without its heading and the legend.
    keep(views.crop((views.width // 2, 630, views.width, 1150)), "robot.png")
    changes = Image.open(changed / "pictures/changes.png")
    keep(changes, "changes.png")
    if args.shots:
        for size in ("1280", "390"):
            for scheme in ("light", "dark"):
                name = f"page_{'narrow_' if size == '390' else ''}{scheme}.png"
                keep(Image.open(args.shots / f"{size}_{scheme}_rest.png"), name)
    if args.terminal and args.before:
        pairs(found, "now", args.terminal)
        # The view from above, with its scale and legend.
        above, legend = changes.crop((0, 0, PAGE, 1010)), changes.crop((0, 1780, PAGE, changes.height))
        both = Image.new("RGB", (PAGE, above.height + legend.height), "white")
        both.paste(above, (0, 0))
        both.paste(legend, (0, above.height))
        keep(both, "now_changes.png")
        pairs(args.before / "result", "then", args.before / "terminal.txt")
        earlier = Image.open(args.before / "changed/pictures/changes.png")
        keep(earlier.crop((0, 0, PAGE, 600)), "then_changes.png")


if __name__ == "__main__":
    main()
