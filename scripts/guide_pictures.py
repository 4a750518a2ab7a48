#!/usr/bin/env python3
"""Makes the pictures of README and guide again from results.

  pip install pillow
  stillpoint demo --out demo --beams 300000
  stillpoint run demo/scans/scans.e57 --robots FOLDER_WITH_A_GRIPPER_ONLY --out none
  stillpoint simulate demo/scene_later.toml --robots demo/robots --out later
  stillpoint rescan --base demo/result later/scans.e57 --out changed --robot R3
  scripts/guide_pictures.py demo/result none changed [SHOTS]

`none` is a result of the same scans in which no robot was found: the cell before. SHOTS is the folder of screenshots of
`ONLY=rest node scripts/report_page.mjs` of the page of a hall.
"""
import sys
from pathlib import Path

from PIL import Image

PICTURES = Path(__file__).resolve().parent.parent / "src" / "guide" / "pictures"
# A larger picture is kept with 256 colours, bytes; the test of the guide allows 300 000.
MOST_BYTES = 290_000


def keep(image, name):
    image = image.convert("RGB")
    image.save(PICTURES / name, optimize=True)
    if (PICTURES / name).stat().st_size > MOST_BYTES:
        image.quantize(256, dither=Image.Dither.NONE).save(PICTURES / name, optimize=True)
    print(f"{name}: {image.width} x {image.height}, {(PICTURES / name).stat().st_size} bytes")


def main():
    found, none, changed, *shots = map(Path, sys.argv[1:])
    keep(Image.open(none / "pictures/plan_0.png"), "before.png")
    plan = Image.open(found / "pictures/plan_0.png")
    keep(plan, "after.png")
    keep(plan, "plan.png")
    keep(Image.open(found / "pictures/R1_evidence.png"), "evidence.png")
    views = Image.open(found / "pictures/R1.png")
    keep(views, "views.png")
    # The oblique view alone, without its heading and the legend.
    keep(views.crop((views.width // 2, 630, views.width, 1150)), "robot.png")
    keep(Image.open(changed / "pictures/changes.png"), "changes.png")
    for folder in shots:
        for size in ("1280", "390"):
            for scheme in ("light", "dark"):
                name = f"page_{'narrow_' if size == '390' else ''}{scheme}.png"
                keep(Image.open(folder / f"{size}_{scheme}_rest.png"), name)


if __name__ == "__main__":
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    main()
