"""What accuracy costs for three scenes: `visray cost` on each, as docs/accuracy.md shows it.

    python reference/cost_of_accuracy.py -o reference/cost_of_accuracy.json --plot docs/cost.png --pages pages

penumbra: an area light, with ambient occlusion besides; nested-glass: refraction and reflection; heart: a polynomial
surface with every effect. --repeats: number of quick studies of each after it, to compare their advice.
"""

import argparse
import json
from pathlib import Path

import visray as vr  # isort: skip - before Dr.Jit, because it chooses the LLVM
from machine import machine
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from visray.scene.address import changed
from visray.study.cost.advice import advice
from visray.study.cost.records import Price, Report

SCENES = Path(__file__).resolve().parents[1] / "scenes"
# The scene, a title, and what is set.
CASES = {
    "penumbra": ("penumbra and ambient occlusion", {"settings.occlusion.sky": 4}),
    "nested-glass": ("glass", {}),
    "heart": ("heart", {}),
}
# Okabe and Ito's colours, which all eyes tell apart.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#8B4513")


def priced(h: Price) -> dict:
    """A price as JSON has it: null where the error was not reached."""
    known = h.factor.middle < float("inf")
    return {
        "setting": h.setting,
        "factor": h.factor.middle if known else None,
        "low": h.factor.low if known else None,
        "high": h.factor.high if known and h.factor.high < float("inf") else None,
        "least": h.least,
        "beyond": h.beyond,
    }


def row(title: str, report: Report, others: list[str]) -> dict:
    """The numbers of a study that docs/accuracy.md shows. others: the advice of quick studies."""
    d = report.default
    slopes = {c.setting: c.by_count for c in report.curves if c.by_count is not None}
    by_time = {c.setting: c.by_time for c in report.curves if c.by_time is not None}
    return {
        "title": title,
        "size": [report.width, report.height],
        "seeds": report.seeds,
        "error": report.default.error.rmse.middle,
        "seconds": report.default.seconds.middle,
        "compile_s": report.default.compile_seconds,
        "reference_error": report.reference.error,
        "best_error": min(p.error.rmse.middle for p in report.frontier),
        "study_s": report.seconds,
        "advice": advice(report),
        "savings": [priced(s) for s in report.savings],
        "halvings": [priced(h) for h in report.halvings],
        "by_count": {k: [s.k, s.low, s.high] for k, s in slopes.items()},
        "by_time": {k: [s.k, s.low, s.high] for k, s in by_time.items()},
        "steps": {
            f"{c.setting}: {p.value}": [p.seconds.middle / d.seconds.middle, p.error.rmse.middle / d.error.rmse.middle]
            for c in report.curves if c.kind == "step" for p in c.points if p.settings != d.settings
        },
        "floors": report.floors,
        "advice_of_quick_studies": others,
    }  # fmt: skip


def drawn(reports: dict[str, Report], path: Path) -> None:
    """The three log-log figures side by side: a curve for each setting, the frontier, the scene as it is, 8 bits."""
    figure = Figure(figsize=(13, 5.2), layout="constrained")
    axes = figure.subplots(1, len(reports))
    names = list(dict.fromkeys(c.setting for r in reports.values() for c in r.curves if c.kind != "step"))
    for ax, (title, report) in zip(axes, reports.items()):
        front = [(p.seconds.middle, p.error.rmse.middle) for p in report.frontier]
        ax.step(*zip(*front), where="post", color="#F0E442", linewidth=7, label="frontier", zorder=1)
        for c in report.curves:
            if c.kind == "step":
                continue
            x, y = ([p.seconds.middle for p in c.points], [p.error.rmse for p in c.points])
            off = [[b.middle - b.low for b in y], [b.high - b.middle for b in y]]
            style = {
                "color": COLOURS[names.index(c.setting) % len(COLOURS)],
                "marker": "os^Dvp*h"[names.index(c.setting) % 8],
            }
            ax.errorbar(x, [b.middle for b in y], off, markersize=5, linewidth=1.5, label=c.setting, **style)
        if report.joint:
            x, y = zip(*((p.seconds.middle, p.error.rmse.middle) for p in report.joint))
            ax.plot(x, y, "x", color="black", markersize=7, label="together")
        d = report.default
        ax.plot(
            d.seconds.middle, d.error.rmse.middle, "*", color="black", markersize=17, label="as the scene is", zorder=6
        )
        floor = report.floors["8-bit output"]
        ax.axhline(floor, color="#777777", linestyle="--", linewidth=1)
        ax.text(0.99, floor, "8 bits", transform=ax.get_yaxis_transform(), ha="right", va="bottom", color="#777777")
        ax.set(xscale="log", yscale="log", title=title, xlabel="seconds of one picture, compiled")
        ax.yaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{100 * v:g} %"))
        ax.grid(alpha=0.3)
    axes[0].set_ylabel("relative error (RMSE)")
    handles = {label: h for ax in axes for h, label in zip(*ax.get_legend_handles_labels())}
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=5, frameon=False)
    figure.savefig(path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--plot", type=Path)
    parser.add_argument("--pages", type=Path, help="A folder for the three pages.")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--repeats", type=int, default=0)
    options = parser.parse_args()
    reports, rows = {}, {}
    for name, (title, settings) in CASES.items():
        scene = changed(vr.load(SCENES / f"{name}.json"), settings)
        report = reports[title] = vr.cost(scene, quick=options.quick)
        rows[name] = row(title, report, [advice(vr.cost(scene, quick=True)) for _ in range(options.repeats)])
        print(json.dumps(rows[name], indent=1), flush=True)
        if options.pages:
            options.pages.mkdir(exist_ok=True)
            report.write(options.pages / f"{name}.html")
    if options.output:
        options.output.write_text(json.dumps(machine() | {"scenes": rows}, indent=1) + "\n")
    if options.plot:
        drawn(reports, options.plot)


if __name__ == "__main__":
    main()
