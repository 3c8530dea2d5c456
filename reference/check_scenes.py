"""`visray check` on every scene in scenes/, in one report.

    python reference/check_scenes.py -o reference/check_scenes.json

The exit code is 1 if a scene fails, otherwise 0.
"""

import argparse
import json
import sys
from pathlib import Path

import visray as vr  # isort: skip - first, because it chooses the LLVM that Dr.Jit and Mitsuba load
from machine import machine

from visray.study.mitsuba import crosscheck

SCENES = Path(__file__).resolve().parent.parent / "scenes"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path)
    chosen = parser.parse_args()
    reports = {}
    for path in sorted(SCENES.glob("*.json")):
        if path.name == "schema.json":
            continue
        report = crosscheck.check(vr.load(path))
        reports[path.stem] = report.as_json()
        sys.stdout.write(f"{path.stem}: {'passed' if report.passed else 'FAILED'}\n")
    text = json.dumps(machine() | {"scenes": reports}, indent=2) + "\n"
    if chosen.output:
        chosen.output.write_text(text)
    else:
        sys.stdout.write(text)
    return 0 if all(r["passed"] for r in reports.values()) else 1


if __name__ == "__main__":
    raise SystemExit(main())
