"""Ten first scenes, as newcomers write them from memory of other programs, with this visray and with an earlier one.

Most of them say nothing of camera and lights. The sheet docs/first-scenes.png shows each scene rendered by the earlier
program (left) and by this one (right); where a program refuses a scene, it shows the line of the refusal. A scene in
the folder `earlier` says the same in the words of the earlier program. The report first_scenes.json has for each the
notes, the mean and the share of pixels that are clipped.

    git worktree add ../before 55d2c90
    python reference/first_scenes.py --before ../before
"""

import argparse
import json
import os
import runpy
import shutil
import subprocess
import sys
import tempfile
import textwrap
import warnings
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SCENES = ROOT / "reference" / "first_scenes"
SHEET, REPORT = ROOT / "docs" / "first-scenes.png", ROOT / "reference" / "first_scenes.json"
SIZE, SPP, SEED = (240, 160), 64, 1
# Space between pictures and height of a line of text, in pixels.
GAP, LINE = 8, 14


def one(scene: str, picture: str) -> None:
    """Renders a scene file, or the `scene` of a script, with the visray that Python finds. Prints a report."""
    import numpy as np

    import visray as vr

    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            given = runpy.run_path(scene)["scene"] if scene.endswith(".py") else scene
            image = vr.render(given, size=SIZE, spp=SPP, seed=SEED, layers=("RGB",), progress=False)
        except (vr.UserError, TypeError) as error:
            print(json.dumps({"refused": str(error).splitlines()[0]}))
            return
    image.write(picture)
    rgb = np.asarray(image["RGB"], float)
    facts = {"mean": float(rgb.mean()), "clipped": float((rgb > 1).any(axis=-1).mean())}
    print(json.dumps(facts | {"notes": list(dict.fromkeys(str(w.message) for w in said))}))


def told(scene: Path, folder: Path, checkout: Path, picture: Path) -> dict:
    """The report of `one` in a process of its own, with the visray of a checkout. folder: a copy of the scenes."""
    name = scene.name
    if checkout != ROOT and (folder / "earlier" / name).exists():
        name = f"earlier/{name}"
    command = [sys.executable, str(Path(__file__).resolve()), "--one", name, str(picture)]
    place = {**os.environ, "PYTHONPATH": str(checkout.resolve())}
    done = subprocess.run(command, cwd=folder, env=place, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{scene.name}: {done.stderr.splitlines()[-1]}")
    return json.loads(done.stdout.splitlines()[-1])


def sheet(rows: dict[str, dict[str, dict]], pictures: Path) -> None:
    """Writes the sheet. rows: reports by scene and by program."""
    from PIL import Image, ImageDraw

    programs = list(next(iter(rows.values())))
    width, height = SIZE
    pair = len(programs) * (width + GAP)
    size = 2 * pair + GAP, -(-len(rows) // 2) * (height + GAP + LINE) + LINE + GAP
    whole = Image.new("RGB", size, "white")
    pen = ImageDraw.Draw(whole)
    for k, (name, reports) in enumerate(rows.items()):
        left, top = GAP + (k % 2) * pair, LINE + GAP + (k // 2) * (height + GAP + LINE)
        for i, program in enumerate(programs):
            x = left + i * (width + GAP)
            if k < 2:
                pen.text((x, 4), program, fill="black")
            if "refused" in reports[program]:
                pen.rectangle((x, top, x + width - 1, top + height - 1), fill="#eeeeee")
                text = "\n".join(textwrap.wrap(reports[program]["refused"], 38))
                pen.text((x + 6, top + 6), text, fill="#802020")
            else:
                with Image.open(pictures / f"{program}-{name}.png") as picture:
                    whole.paste(picture, (x, top))
        pen.text((left, top + height + 1), name.replace("_", " "), fill="black")
    whole.save(SHEET, optimize=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--before", type=Path, help="a checkout of an earlier version")
    parser.add_argument("--one", nargs=2, metavar=("SCENE", "PICTURE"), help=argparse.SUPPRESS)
    parser.add_argument("--only", nargs="*", help="names of scenes")
    asked = parser.parse_args()
    if asked.one:
        return one(*asked.one)
    checkouts = ({"before": asked.before} if asked.before else {}) | {"now": ROOT}
    rows: dict[str, dict[str, dict]] = {}
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place, "scenes")
        shutil.copytree(SCENES, folder)
        shutil.copy(ROOT / "scenes" / "meshes" / "teapot.obj", folder)
        for scene in sorted(p for p in SCENES.iterdir() if p.suffix in (".py", ".json")):
            if asked.only and scene.stem not in asked.only:
                continue
            rows[scene.stem] = {
                program: told(scene, folder, checkout, Path(place, f"{program}-{scene.stem}.png"))
                for program, checkout in checkouts.items()
            }
            print(scene.stem, json.dumps(rows[scene.stem]), flush=True)
        sheet(rows, Path(place))
    if not asked.only:
        REPORT.write_text(json.dumps({"size": SIZE, "spp": SPP, "scenes": rows}, indent=1) + "\n")


if __name__ == "__main__":
    main()
