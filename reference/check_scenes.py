"""`visray check` on every scene in scenes/, in one report.

    python reference/check_scenes.py -o reference/check_scenes.json
    python reference/check_scenes.py teapot knot -o reference/check_scenes.json    # only these; the rest stays

The exit code is 1 if a scene fails, otherwise 0.
"""

import json
import sys
from pathlib import Path

import visray as vr  # isort: skip - first, because it chooses the LLVM that Dr.Jit and Mitsuba load
from machine import machine
from report import report_parser

from visray.study.mitsuba import crosscheck

SCENES = Path(__file__).resolve().parent.parent / "scenes"


def main() -> int:
    parser = report_parser(__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="names of scenes; all if none is named")
    chosen = parser.parse_args()
    paths = {path.stem: path for path in sorted(SCENES.glob("*.json")) if path.name != "schema.json"}
    for name in set(chosen.names) - set(paths):
        parser.error(f"there is no {name} in {SCENES}")
    reports = {}
    if chosen.names and chosen.output and chosen.output.exists():
        reports = json.loads(chosen.output.read_text())["scenes"]
    for path in (paths[name] for name in chosen.names or paths):
        report = crosscheck.check(vr.load(path))
        reports[path.stem] = report.as_json()
        sys.stdout.write(f"{path.stem}: {'passed' if report.passed else 'FAILED'}\n")
    text = json.dumps(machine() | {"scenes": dict(sorted(reports.items()))}, indent=2) + "\n"
    if chosen.output:
        chosen.output.write_text(text)
    else:
        sys.stdout.write(text)
    return 0 if all(r["passed"] for r in reports.values()) else 1


if __name__ == "__main__":
    raise SystemExit(main())
