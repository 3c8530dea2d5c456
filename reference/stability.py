"""`visray stability` on all known polynomial surfaces, or on meshes, with sums over them for each set of rays.

python reference/stability.py -o reference/stability.json [--surfaces FILE] [--rays N]
python reference/stability.py --kind mesh -o reference/stability_meshes.json [--rays N]
"""

import argparse
import json
from pathlib import Path

import visray as vr  # isort: skip - first, because it chooses the LLVM that Dr.Jit and Mitsuba load
from machine import machine
from rich.console import Console

from visray.study.stability import mesh_study
from visray.study.stability import study as stability

COUNTS = ("judged", "near_edge", "open", "false_misses", "false_hits", "wrong_roots", "nan", "unresolved", "gross")


def sums(report: stability.Report) -> list[dict]:
    """For each set of rays, a dict with the sums of counts over all surfaces, and the worst of the other figures."""
    entries = []
    for name in dict.fromkeys(s.rays for s in report.scores):
        scores = [s for s in report.scores if s.rays == name]
        total = {k: sum(getattr(s, k) or 0 for s in scores) for k in COUNTS}
        within = max(s.errors_within for s in scores)
        degrees = [s.degrees[0] for s in scores if s.degrees]
        ulps = [s.ulps[0] for s in scores if s.ulps]
        worst = {"median_ulps_worst": max(ulps, default=None), "normal_p999_worst": max(degrees, default=None)}
        worst |= {"ulps_worst": max((s.ulps[2] for s in scores if s.ulps), default=None)}
        entries.append({"rays": name, "surfaces": len(scores), **total, "errors_within": within, **worst})
    return entries


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--surfaces", type=Path)
    parser.add_argument("--rays", type=int)
    parser.add_argument("--kind", choices=["polynomial", "mesh"], default="polynomial")
    args = parser.parse_args()
    if args.kind == "mesh":
        report = mesh_study.run(args.rays or mesh_study.RAYS, progress=True)
    else:
        report = stability.run(args.surfaces, args.rays or stability.RAYS, progress=True)
    Console(width=120).print(report.table())
    result = machine() | {"visray": vr.__version__, "sums": sums(report)} | report.as_json()
    print(json.dumps(result["sums"], indent=2))
    if args.output:
        args.output.write_text(json.dumps(result, indent=2) + "\n")


if __name__ == "__main__":
    main()
