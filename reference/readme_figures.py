"""Puts the figures of reference/*.json into README.md, between marks such as <!-- figures: speed -->.

python reference/readme_figures.py
"""

import json
import re
from pathlib import Path

HERE = Path(__file__).resolve().parent
README = HERE.parent / "README.md"


def loaded(name: str) -> dict:
    return json.loads((HERE / f"{name}.json").read_text())


def where(report: dict) -> str:
    """Date, machine and versions of a report, in a sentence."""
    tools = ", ".join(f"{name} {report[key]}" for name, key in VERSIONS if key in report)
    return f"Measured {report['date']} on {report['cpu']}, {report['threads']} threads; {tools}."


VERSIONS = (("visray", "visray"), ("Mitsuba", "mitsuba"), ("Dr.Jit", "drjit"), ("LLVM", "llvm"), ("Python", "python"))


def speed() -> str:
    """Against Mitsuba."""
    report = loaded("bench_mitsuba")
    lines = [
        "Mitsuba's `direct` integrator against visray, in one process by turns, same geometry (a plane, spheres, a",
        f"point light with shadows), {report['size']} x {report['size']}, medians of warm renders:",
        "",
        "| spheres | samples per pixel | visray, M samples/s | Mitsuba, M samples/s | ratio |",
        "|---|---|---|---|---|",
    ]
    for row in report["warm"] + report["growth"]:
        a, b = row["visray_Msamples_per_s"], row["mitsuba_Msamples_per_s"]
        lines.append(f"| {row['spheres']:,} | {row['spp']} | {a:.1f} | {b:.1f} | {row['ratio']:.1f} |")
    start = report["from_start_s"]
    cold, warm = ((start["visray"][k], start["mitsuba"][k]) for k in ("cold", "warm"))
    lines += [
        "",
        f"From the start of a process to an EXR on disk, 16 samples: {cold[0]:.1f} s (Mitsuba {cold[1]:.1f} s) with an",
        f"empty kernel cache, {warm[0]:.1f} s ({warm[1]:.1f} s) with a warm one.",
        f"{where(report)}",
        "Run `python reference/bench_mitsuba.py`.",
    ]
    return "\n".join(lines)


def check() -> str:
    """Against Mitsuba, ray by ray."""
    report = loaded("check_scenes")
    lines = [
        "`visray check` on every scene: the same rays through Mitsuba (single precision). A ray is *near an edge* if",
        "what it meets changes within the rounding of Mitsuba's numbers; it is counted, not compared.",
        "",
        "| scene | rays | near an edge | hit or object mismatches | shadow rays | near an edge | mismatches "
        "| largest \\|dt\\| / distance | image error |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for name, r in report["scenes"].items():
        both, s = (r["pixels"], r["random"]), r["shadows"]
        rays, near = sum(b["rays"] for b in both), sum(b["near_edge"] for b in both)
        wrong = sum(b["hit_mismatches"] + b["object_mismatches"] for b in both)
        dt = max(b["dt"] for b in both)
        lines.append(
            f"| {name} | {rays:,} | {near:,} | {wrong} | {s['rays']:,} | {s['near_edge']:,} | {s['mismatches']} "
            f"| {dt:.0e} | {r['picture']['rms']:.0e} |"
        )
    lines += ["", f"{where(report)} Run `python reference/check_scenes.py`."]
    return "\n".join(lines)


def effects() -> str:
    """What each effect costs."""
    report = loaded("cost_of_effects")
    matte, *others = report["rows"]
    size = f"{report['size']} x {report['size']}"
    lines = [
        "The matte scene with eight spheres above, and the same with one effect more or less: warm renders by turns,",
        f"{size}, {report['spp']} samples per pixel, for which the matte scene takes {1e3 * matte['seconds']:.0f} ms:",
        "",
        "| scene | kernel operations | compile, s | time against matte |",
        "|---|---|---|---|",
    ]
    for row in (matte, *others):
        lines.append(f"| {row['scene']} | {row['operations']:,} | {row['compile_s']:.2f} | {row['ratio']:.2f} |")
    b = report["before"]
    low, high = b["ratio_quartiles"]
    spread = f"median of {b['pairs']} pairs of processes, quartiles {low:.2f} and {high:.2f}"
    lines += [
        "",
        f"Effects that are there and not called for: the matte scene takes {b['ratio']:.2f} of the time that it took",
        f"before most of them were built ({b['commit']}; {spread}; processor time {b['cpu_ratio']:.2f}),",
        f"{b['operations']:,} operations instead of {b['operations_before']:,}.",
        f"{where(report)}",
        "Run `python reference/cost_of_effects.py`; `visray explain SCENE --cost` tells of any scene.",
    ]
    return "\n".join(lines)


def polynomials() -> str:
    """Against POV-Ray and surf."""
    report = loaded("bench_povray")
    lines = [
        "The same surface, camera, light and shadows in POV-Ray 3.7 (`poly` with `sturm`) and in visray, two",
        f"threads each, {report['size']} x {report['size']}; the time of a sample per pixel at 1, 4 and 16 of them. Against surf, which",
        f"draws without shadows, on one thread: camera rays alone, {report['size_of_camera_rays']:,} x {report['size_of_camera_rays']:,}. Wrong pixels by exact",
        "arithmetic, of those at edges, where programs differ, and 20,000 at random:",
        "",
        "| surface | POV-Ray, s | visray, s (4 spp) | times faster at 1, 4, 16 spp | surf, M rays/s | visray, M rays/s "
        "| wrong pixels: POV-Ray, visray |",
        "|---|---|---|---|---|---|---|",
    ]
    for row in report["surfaces"]:
        s, c, w = row["shaded"], row["camera_rays"], row["wrong"]
        theirs, mine = s["s"]["povray 2"]["median"], s["visray_s_per_sample"]["4"]
        ratios = ", ".join(f"{s['ratio'][n]:.0f}" for n in ("1", "4", "16"))
        rates = c["Mrays_per_s"]
        lines.append(
            f"| {row['surface']} ({row['degree']}) | {theirs:.2f} | {mine:.4f} | {ratios} | {rates['surf']:.1f} "
            f"| {rates['visray picture']:.1f} | {w['povray']['wrong']}, {w['visray']['wrong']} "
            f"of {w['visray']['checked']:,} |"
        )
    lines += ["", f"{where(report)} Run `python reference/bench_povray.py`."]
    return "\n".join(lines)


def degree() -> str:
    """How the cost grows with the degree, and what precision costs."""
    report = loaded("bench_degree")
    lines = [
        "![Nanoseconds of a ray against the degree, both logarithmic: less than quadratic](docs/degree.png)",
        "",
        f"A camera ray on one thread grows as degree^{report['exponent']:.1f} from degree 4 to 20 (Banchoff-Chmutov surfaces); compilation takes",
        f"{max(r['compile_s'] for r in report['degrees']):.2f} s at most:",
        "",
        "| degree | " + " | ".join(str(r["degree"]) for r in report["degrees"]) + " |",
        "|---|" + "---|" * len(report["degrees"]),
        "| ns per ray | " + " | ".join(f"{r['ns_per_ray']:.0f}" for r in report["degrees"]) + " |",
        "| compile, s | " + " | ".join(f"{r['compile_s']:.2f}" for r in report["degrees"]) + " |",
        "",
        "What precision costs: the surface in double with the rest in single (the default) or in double, ns per sample of a",
        "picture with light and shadow; and the surface in single, which is not offered, ns per camera ray:",
        "",
        "| surface | default | all double | rays alone, in double | in single | lost or false, per million | wrong root |",
        "|---|---|---|---|---|---|---|",
    ]
    for r in report["precision"]:
        lines.append(
            f"| {r['surface']} | {r['single_picture_ns']:.0f} | {r['double_picture_ns']:.0f} | {r['single_ns']:.0f} "
            f"| {r['inside_single_ns']:.0f} | {r['inside_single_wrong_hits_per_million']:.0f} "
            f"| {r['inside_single_wrong_roots_per_million']:.0f} |"
        )
    lines += ["", f"{where(report)} Run `python reference/bench_degree.py`."]
    return "\n".join(lines)


def stability() -> str:
    """Polynomial surfaces against exact arithmetic."""
    report = loaded("stability")
    lines = [
        f"`visray stability` on the {report['sums'][0]['surfaces']} known surfaces, {report['rays']:,} rays a set: the kernel against exact rational arithmetic.",
        "*Judged* are rays whose exact answer stays the same when f is shifted by the rounding of double; the others graze an edge.",
        "",
        "| rays | judged | near an edge | lost | false | wrong root | NaN | unresolved |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for r in report["sums"]:
        lines.append(
            f"| {r['rays']} | {r['judged']:,} | {r['near_edge'] + r['open']:,} | {r['false_misses']} | {r['false_hits']} "
            f"| {r['wrong_roots']} | {r['nan']} | {r['unresolved']} |"
        )
    lines += ["", f"{where(report)} Run `python reference/stability.py`."]
    return "\n".join(lines)


def estimates() -> str:
    """Whether pictures have the errors that they say."""
    report = loaded("error_estimates")
    s = report["summary"]
    lines = [
        f"Is it true? {s['pictures']} pictures of {len({r['scene'] for r in report['estimates']})} scenes, with errors from "
        f"{100 * min(r['asked'] for r in report['estimates']):g} to {100 * max(r['asked'] for r in report['estimates']):g} % asked for, "
        "against references of at least 100 times the samples:",
        f"{100 * s['within']:.0f} % of the true errors lie in the 95 % interval, {100 * s['met']:.0f} % are no larger than asked, "
        f"and true over estimated error is {s['ratio_least']:.2f} to {s['ratio_most']:.2f}.",
    ]
    lines += ["", f"{where(report)} Run `python reference/error_estimates.py`."]
    return "\n".join(lines)


def adaptive() -> str:
    """What --error saves."""
    report = loaded("bench_adaptive")
    lines = [
        "What it saves: `--error` against equally many samples everywhere, at equal true error, by turns in one run; with the",
        "scene's own sampler, as `--spp` has it, and with Sobol points for both (time ratios; the picture's colour alone, compiled):",
        "",
        "| scene | true error | `--error`: spp, s | `--spp`: spp, s | ratio | Sobol everywhere: spp, s | ratio |",
        "|---|---|---|---|---|---|---|",
    ]
    for r in report["rows"]:
        own = next(iter(r["uniform"].values()))
        both = r["uniform"]["sobol"]
        lines.append(
            f"| {r['scene']}, {r['width']} x {r['height']} | {100 * r['error_true']:.2g} % | {r['spp']:.0f}, {r['seconds']:.2f} "
            f"| {own['spp']:.0f}, {own['seconds']:.2f} | {own['ratio']:.1f} | {both['spp']:.0f}, {both['seconds']:.2f} | {both['ratio']:.1f} |"
        )
    lines += ["", f"{where(report)} Run `python reference/bench_adaptive.py`."]
    return "\n".join(lines)


def cost() -> str:
    """What accuracy costs for three scenes."""
    report = loaded("cost_of_accuracy")
    lines = [
        "![Error against seconds for three scenes, both logarithmic: a curve for each knob, their frontier, the scene as it is](docs/cost.png)",
        "",
        "| scene | error, ms as it is | half of the error costs, times the time (95 %) | k of error ~ samples^-k: independent, stratified, Sobol |",
        "|---|---|---|---|",
    ]
    for r in report["scenes"].values():
        halves = [
            f"{h['knob']} {h['factor']:.2g} ({h['low']:.2g} to {'?' if h['high'] is None else format(h['high'], '.2g')})"
            for h in r["halvings"]
            if h["factor"] is not None
        ]
        cannot = [h["knob"] for h in r["halvings"] if h["factor"] is None]
        text = ", ".join(halves) + (f"; alone cannot: {', '.join(cannot)}" if cannot else "")
        slopes = [r["by_count"][f"samples, {name}"] for name in ("independent", "stratified", "sobol")]
        shown = ", ".join(f"{k:.2f} ± {(high - low) / 2:.2f}" for k, low, high in slopes)
        lines.append(f"| {r['title']} | {100 * r['error']:.2g} %, {1e3 * r['seconds']:.0f} | {text} | {shown} |")
    lines += ["", f"{where(report)} Run `python reference/cost_of_accuracy.py`."]
    return "\n".join(lines)


TABLES = {
    "estimates": estimates,
    "adaptive": adaptive,
    "cost": cost,
    "speed": speed,
    "effects": effects,
    "check": check,
    "polynomials": polynomials,
    "degree": degree,
    "stability": stability,
}


def filled(text: str) -> str:
    """README with the figures in their places."""
    for name, table in TABLES.items():
        marks = f"<!-- figures: {name} -->", f"<!-- /figures: {name} -->"
        block = f"{marks[0]}\n{table()}\n{marks[1]}"
        text = re.sub(f"{marks[0]}.*?{marks[1]}", lambda _, b=block: b, text, flags=re.DOTALL)
    return text


if __name__ == "__main__":
    README.write_text(filled(README.read_text()))
