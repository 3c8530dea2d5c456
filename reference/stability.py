"""The known polynomial surfaces against exact arithmetic, as `visray stability` does it, with the sums of each set.

python reference/stability.py -o reference/stability.json [--surfaces FILE] [--rays N]
"""

import argparse
import json
from pathlib import Path

import visray as vr  # isort: skip - first, because it chooses the LLVM that Dr.Jit and Mitsuba load
from machine import machine
from rich.console import Console

from visray.study.stability import study as stability

COUNTS = ("judged", "near_edge", "open", "false_misses", "false_hits", "wrong_roots", "nan", "unresolved", "gross")


def sums(report: stability.Report) -> list[dict]:
    """All surfaces together, a set of rays each."""
    found = []
    for name in dict.fromkeys(r.rays for r in report.scores):
        rows = [r for r in report.scores if r.rays == name]
        total = {k: sum(getattr(r, k) or 0 for r in rows) for k in COUNTS}
        within = max(r.errors_within for r in rows)
        degrees = [r.degrees[0] for r in rows if r.degrees]
        ulps = [r.ulps[0] for r in rows if r.ulps]
        worst = {"median_ulps_worst": max(ulps, default=None), "normal_p999_worst": max(degrees, default=None)}
        found.append({"rays": name, "surfaces": len(rows), **total, "errors_within": within, **worst})
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--surfaces", type=Path)
    parser.add_argument("--rays", type=int, default=stability.RAYS)
    args = parser.parse_args()
    report = stability.run(args.surfaces, args.rays, progress=True)
    Console(width=120).print(report.table())
    found = machine() | {"visray": vr.__version__, "sums": sums(report)} | report.as_json()
    print(json.dumps(found["sums"], indent=2))
    if args.output:
        args.output.write_text(json.dumps(found, indent=2) + "\n")


if __name__ == "__main__":
    main()
