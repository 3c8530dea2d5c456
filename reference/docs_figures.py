"""Writes the measured figures and tables into README.md and docs/*.md, between marks such as <!-- figures: speed -->.

They come from the reports reference/*.json, and from the records of layers and shading modes in visray.

    python reference/docs_figures.py

Each function in FIGURES returns the lines of one block.
"""

import json
import re
from pathlib import Path
from textwrap import wrap

from visray import modes
from visray.output import layers

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))
VERSIONS = (("visray", "visray"), ("Mitsuba", "mitsuba"), ("Dr.Jit", "drjit"), ("LLVM", "llvm"), ("Python", "python"))


def loaded(name: str) -> dict:
    return json.loads((HERE / f"{name}.json").read_text())


def table(heads: list, rows: list[list]) -> list[str]:
    """Lines of a Markdown table, with an empty line before and after it. A | in a cell is escaped."""
    head, *body = ("| " + " | ".join(str(cell).replace("|", r"\|") for cell in row) + " |" for row in (heads, *rows))
    return ["", head, "|" + "---|" * len(heads), *body, ""]


def prose(text: str) -> list[str]:
    """A paragraph as lines of at most 120 characters."""
    return wrap(text, 120, break_long_words=False, break_on_hyphens=False)


def measured(report: dict, script: str, between: str = " ", more: str = "") -> str:
    """A sentence with date, machine and versions of a report, and a sentence that says how to run the script.

    between: text between the two sentences; more: end of the second sentence
    """
    tools = ", ".join(f"{name} {report[key]}" for name, key in VERSIONS if key in report)
    threads = f"{report['threads']} thread{'s' * (report['threads'] != 1)}"
    where = f"Measured {report['date']} on {report['cpu']}, {threads}; {tools}."
    return f"{where}{between}Run `python reference/{script}.py`{more}."


# What a report's clock means for the reader.
CPU_CLOCK = {"wall": "", "cpu": " with `--clock cpu`: times are those of the processor, because the machine was busy"}


def lists() -> list[str]:
    """Lines with the speed of many spheres and of meshes, in visray and in Mitsuba."""
    report = loaded("bench_lists")
    rows = []
    for case in report["cases"]:
        sort = "spheres" if "spheres" in case else "triangles"
        speeds = (f"{case[key]:.1f}" for key in ("visray_Msamples_per_s", "mitsuba_Msamples_per_s", "ratio"))
        builds = (f"{case['build_s'][key]:.2f}" for key in ("visray", "mitsuba"))
        rows.append([f"{case[sort]:,} {sort}", case["spp"], *speeds, *builds, f"{case['ratio_with_build']:.1f}"])
    speeds = ["visray, M samples/s", "Mitsuba, M samples/s", "ratio"]
    heads = ["objects", "samples", *speeds, "build, s", "Mitsuba's build, s", "ratio with both builds"]
    return [
        *prose(
            "A plane with random spheres, or with a bumpy ball of triangles, under a point light with hard shadows, "
            "512 x 512 pixels. Mitsuba's integrator is `direct` with one emitter sample; it finds triangles with "
            "Embree. Both run in one process, by turns; kernels are compiled before. Medians:"
        ),
        *table(heads, rows),
        *measured(report, "bench_lists", "\n", more=CPU_CLOCK[report["clock"]]).split("\n"),
    ]


def growth() -> list[str]:
    """Lines with time and memory against the number of objects."""
    report = loaded("growth")
    rows = []
    for case in report["cases"]:
        seconds = (f"{case[stage]:.2f}" for stage in ("load", "prepare", "picture", "second"))
        rows.append([f"{case['objects']:,} {case['sort']}", *seconds, f"{case['memory'] / 1e9:.2f}"])
    return [
        *prose(
            "From nothing to a picture of 512 x 512 pixels with one sample per pixel, with compiled kernels in the "
            "cache. Spheres are objects of Python, one by one; the mesh is a binary PLY file. The second picture has "
            "the light elsewhere, so its lists are new."
        ),
        "",
        "![Seconds and gigabytes against the number of objects, both logarithmic](growth.png)",
        *table(["objects", "load, s", "prepare, s", "first picture, s", "second picture, s", "memory, GB"], rows),
        *measured(report, "growth", "\n", more=CPU_CLOCK[report["clock"]]).split("\n"),
    ]


def speed() -> list[str]:
    """Lines with the speed of visray and of Mitsuba."""
    report = loaded("bench_mitsuba")
    start = report["from_start_s"]
    cold, warm = ((start["visray"][k], start["mitsuba"][k]) for k in ("cold", "warm"))
    keys = ["visray_Msamples_per_s", "mitsuba_Msamples_per_s", "ratio"]
    rows = [[f"{r['spheres']:,}", r["spp"], *(f"{r[key]:.1f}" for key in keys)] for r in report["warm"]]
    return [
        *prose(
            "The same scene in visray and in Mitsuba (integrator `direct`): a plane, spheres, a point light, "
            f"shadows, {report['size']} x {report['size']} pixels. Both run in one process, by turns; kernels are "
            "compiled before. Medians:"
        ),
        *table(["spheres", "samples per pixel", "visray, M samples/s", "Mitsuba, M samples/s", "ratio"], rows),
        *prose(
            "From the start of a process to an EXR file on disk, 16 samples per pixel: with an empty kernel cache "
            f"{cold[0]:.1f} s (Mitsuba {cold[1]:.1f} s); with compiled kernels in the cache {warm[0]:.1f} s "
            f"({warm[1]:.1f} s)."
        ),
        "",
        measured(report, "bench_mitsuba", between="\n"),
    ]


def check() -> list[str]:
    """Lines with the differences between visray and Mitsuba, ray by ray."""
    report = loaded("check_scenes")
    heads = ["scene", "rays", "near an edge", "hit or object mismatches"]
    heads += ["shadow rays", "near an edge", "mismatches", "largest |dt| / distance", "image error"]
    rows = []
    for name, r in report["scenes"].items():
        both, s = (r["pixels"], r["random"]), r["shadows"]
        rays, near = sum(b["rays"] for b in both), sum(b["near_edge"] for b in both)
        wrong = sum(b["hit_mismatches"] + b["object_mismatches"] for b in both)
        row = [name, f"{rays:,}", f"{near:,}", wrong, f"{s['rays']:,}", f"{s['near_edge']:,}", s["mismatches"]]
        rows.append([*row, f"{max(b['dt'] for b in both):.0e}", f"{r['picture']['rms']:.0e}"])
    return [
        *prose(
            "`visray check` sends the same rays through visray and through Mitsuba, which computes in single "
            "precision. A ray is *near an edge* if the rounding of Mitsuba's numbers can change what it hits; "
            "such rays are counted, and not compared. *dt* is the difference of the distances to the hit; *image "
            "error* is the difference of the pictures."
        ),
        *table(heads, rows),
        measured(report, "check_scenes"),
    ]


def effects() -> list[str]:
    """Lines with the cost of each effect."""
    report = loaded("cost_of_effects")
    size, matte_ms, before = report["size"], 1e3 * report["rows"][0]["seconds"], report["before"]
    rows = [[r["scene"], f"{r['operations']:,}", f"{r['compile_s']:.2f}", f"{r['ratio']:.2f}"] for r in report["rows"]]
    compared = [
        [
            name,
            f"{r['operations_before']:,}, {r['operations']:,}",
            f"{r['compile_s_before']:.2f}, {r['compile_s']:.2f}",
            f"{r['ratio']:.2f} ({r['ratio_quartiles'][0]:.2f} to {r['ratio_quartiles'][1]:.2f})",
            f"{r['cpu_ratio']:.2f}",
        ]
        for name, r in before.items()
        if isinstance(r, dict)
    ]
    heads = ["scene", "kernel operations before, now", "compile before, now, s"]
    heads += ["time now over before", "processor time"]
    return [
        *prose(
            "The matte scene is a plane and eight spheres with a point light and shadows. Each other scene has "
            f"one effect more or less. {size} x {size} pixels, {report['spp']} samples per pixel, kernels compiled "
            f"before; the matte scene takes {matte_ms:.0f} ms:"
        ),
        *table(["scene", "kernel operations", "compile, s", "time against matte"], rows),
        *prose(
            f"The same scenes in an earlier visray (commit {before['commit']}) and now: {before['pairs']} pairs of "
            "processes, by turns. Median of the ratios, and quartiles in brackets:"
        ),
        *table(heads, compared),
        measured(report, "cost_of_effects", "\n", "; `visray explain SCENE --cost` measures your scene"),
    ]


def polynomials() -> list[str]:
    """Lines that compare visray with POV-Ray and surf."""
    report = loaded("bench_povray")
    size, larger = report["size"], report["size_of_camera_rays"]
    timed = ["surface (degree)", "POV-Ray, s", "visray, s (4 spp)", "times faster at 1, 4, 16 spp"]
    timed += ["wrong pixels, POV-Ray", "wrong pixels, visray", "pixels judged"]
    times, rates = [], []
    for r in report["surfaces"]:
        s, speeds, wrong = r["shaded"], r["camera_rays"]["Mrays_per_s"], r["wrong"]
        name = f"{r['surface']} ({r['degree']})"
        theirs, ours = s["s"]["povray 2"]["median"], s["visray_s_per_sample"]["4"]
        ratios = ", ".join(f"{s['ratio'][n]:.0f}" for n in ("1", "4", "16"))
        counts = wrong["povray"]["wrong"], wrong["visray"]["wrong"], f"{wrong['visray']['checked']:,}"
        times.append([name, f"{theirs:.2f}", f"{ours:.4f}", ratios, *counts])
        rates.append([name, f"{speeds['surf']:.1f}", f"{speeds['visray picture']:.1f}"])
    return [
        *prose(
            "POV-Ray 3.7 (`poly` with `sturm`) and visray render the same surface, camera, light and shadows, on two "
            f"threads each, {size} x {size} pixels. Times are for one sample per pixel. *Wrong pixels* are judged by "
            "exact arithmetic: all pixels where the programs differ, and 20,000 at random."
        ),
        *table(timed, times),
        *prose(
            "surf draws without shadows, so it is compared on camera rays alone, in millions of rays per second on one "
            f"thread, {larger:,} x {larger:,} pixels:"
        ),
        *table(["surface (degree)", "surf", "visray"], rates),
        measured(report, "bench_povray"),
    ]


def csg() -> list[str]:
    """Lines that compare CSG in visray and in POV-Ray."""
    report = loaded("csg_povray")
    clock = "cpu" if report["load"] > report["threads"] else "wall"
    heads = ["solid (operands)", "POV-Ray, s (4 spp)", "visray, s (4 spp)", "times faster at 4, 16 spp", "compile, s"]
    heads += ["wrong pixels, POV-Ray", "wrong pixels, visray"]
    rows = []
    for r in report["solids"]:
        s, centres, smooth = r[clock]["s"], r["centres"], r["antialiased"]
        theirs = min(s["povray 4"], s["povray larger 4"])
        ratios = ", ".join(f"{r[clock][f'ratio_{n}']:.1f}" for n in (4, 16))
        wrong = (centres[name]["wrong"] + smooth[name] for name in ("povray", "visray"))
        name = f"{r['solid']} ({r['operands']})"
        rows.append([name, f"{theirs:.2f}", f"{s['visray 4']:.3f}", ratios, f"{r['compile_s']:.2f}", *wrong])
    seconds = "of the processor, because the machine was busy" if clock == "cpu" else "of the clock"
    return [
        *prose(
            f"POV-Ray {report['povray']} and visray render the same solid, camera, light and shadows, on two threads "
            f"each, {report['size']} x {report['size']} pixels. POV-Ray's time is the shorter one of two ways to take "
            f"as many samples. Seconds are those {seconds}. *Wrong pixels* are judged by 80-bit arithmetic: all pixels "
            "in their centres, and those with 16 samples where the pictures differ."
        ),
        *table(heads, rows),
        measured(report, "csg_povray"),
    ]


def csg_growth() -> list[str]:
    """Lines about how the cost of CSG grows with the number of operands."""
    report = loaded("csg_growth")
    said = {
        "sponge": "a block without n balls and rods", "merge": "n balls as one merge", "objects": "n balls as objects",
        "half-spaces": "the intersection of n half-spaces",
    }  # fmt: skip
    numbers = sorted({case["operands"] for case in report["cases"]})
    cases = {(case["sort"], case["operands"]): case for case in report["cases"]}
    rows = []
    for sort, name in said.items():
        times = (f"{1e3 * cases[sort, n]['frame_s']:.0f}" for n in numbers)
        most = max(cases[sort, n]["compile_s"] for n in numbers)
        rows.append([name, *times, f"{most:.2f}"])
    return [
        *prose(
            f"Milliseconds of a picture of {report['size']} x {report['size']} pixels with a point light and shadows, "
            f"{report['spp']} samples per pixel, and the longest time to compile one of them:"
        ),
        *table(["n operands", *(f"n = {n}" for n in numbers), "compile, s"], rows),
        measured(report, "csg_growth"),
    ]


def degree() -> list[str]:
    """Lines about how the cost of a polynomial surface grows with the degree, and what precision costs."""
    report = loaded("bench_degree")
    degrees = report["degrees"]
    growth = [
        ["ns per ray", *(f"{r['ns_per_ray']:.0f}" for r in degrees)],
        ["compile, s", *(f"{r['compile_s']:.2f}" for r in degrees)],
    ]
    heads = ["surface", "default", "all double", "rays alone, in double", "in single"]
    heads += ["lost or false, per million", "wrong root"]
    keys = ["single_picture_ns", "double_picture_ns", "single_ns", "inside_single_ns"]
    keys += ["inside_single_wrong_hits_per_million", "inside_single_wrong_roots_per_million"]
    precision = [[r["surface"], *(f"{r[key]:.0f}" for key in keys)] for r in report["precision"]]
    return [
        "![Nanoseconds of a ray against the degree, both logarithmic: less than quadratic](degree.png)",
        "",
        *prose(
            f"The time of a camera ray, on one thread, grows as degree^{report['exponent']:.1f} from degree 4 to "
            f"20 (Banchoff-Chmutov surfaces). Compilation takes at most {max(r['compile_s'] for r in degrees):.2f} "
            "s:"
        ),
        *table(["degree", *(r["degree"] for r in degrees)], growth),
        *prose(
            "What double precision costs. By default the surface is in double and shading in single. The first "
            "two columns are nanoseconds per sample of a picture with light and shadow; the next two are "
            "nanoseconds per camera ray. The surface in single is not offered: the last two columns say why."
        ),
        *table(heads, precision),
        measured(report, "bench_degree"),
    ]


def stability() -> list[str]:
    """Lines that compare visray's hits of polynomial surfaces with exact arithmetic."""
    report = loaded("stability")
    sums = report["sums"]
    heads = ["rays", "judged", "near an edge", "lost", "false", "wrong root", "NaN", "unresolved"]
    keys = ["false_misses", "false_hits", "wrong_roots", "nan", "unresolved"]
    names = {"secondary, grazing": "secondary, skimming"}
    rows = [
        [
            names.get(r["rays"], r["rays"]),
            f"{r['judged']:,}",
            f"{r['near_edge'] + r['open']:,}",
            *(r[key] for key in keys),
        ]
        for r in sums
    ]
    return [
        *prose(
            f"`visray stability` on the {sums[0]['surfaces']} known surfaces, with {report['rays']:,} rays in each "
            "set for each surface. *Judged* are the rays whose exact answer stays the same when f is shifted by "
            "the rounding of double; the others graze an edge."
        ),
        *table(heads, rows),
        measured(report, "stability"),
    ]


def mesh_stability() -> list[str]:
    """Lines that compare visray's hits of meshes with exact arithmetic."""
    report = loaded("stability_meshes")
    names = {"secondary, grazing": "secondary, skimming"}
    rows = []
    for r in report["sums"]:
        errors = [r[key] for key in ("false_misses", "false_hits", "wrong_roots", "nan")]
        ulps = ["", ""]
        if r["ulps_worst"] is not None:
            ulps = [f"{r['median_ulps_worst']:.1f}", f"{r['ulps_worst']:.0f}"]
        rows.append([names.get(r["rays"], r["rays"]), f"{r['judged']:,}", f"{r['near_edge']:,}", *errors, *ulps])
    heads = ["rays", "judged", "past a silhouette", "lost", "false", "wrong triangle", "NaN", "dt, median", "dt, most"]
    return [
        *prose(
            f"`visray stability --kind mesh` on {report['sums'][0]['surfaces']} closed meshes, a ball and a tube with "
            f"slivers a million times as long as wide, near the origin and a million units away, with "
            f"{report['rays']:,} rays in each set for each mesh. *dt* is the error of the distance in units of its "
            "last place; it is largest for grazing rays, and for rays that start close to what they hit."
        ),
        *table(heads, rows),
        measured(report, "stability", more=" with `--kind mesh`"),
    ]


def estimates() -> list[str]:
    """Lines about whether pictures have the errors that they report."""
    report = loaded("error_estimates")
    s = report["summary"]
    scenes = {r["scene"] for r in report["estimates"]}
    asked = [100 * r["asked"] for r in report["estimates"]]
    pictures = s["pictures"]
    within, met = (_of_all(round(s[key] * pictures), pictures) for key in ("within", "met"))
    wider = " (the intervals are wider than needed)" if s["within"] > 0.95 else ""
    return [
        *prose(
            f"{pictures} pictures of {len(scenes)} scenes were made with `--error` from {min(asked):g} to "
            f"{max(asked):g} %, and compared with references of at least 100 times the samples. "
            f"{within} true errors lie in their 95 % intervals{wider}. {met} are no larger than asked. The true error "
            f"is {s['ratio_least']:.2f} to {s['ratio_most']:.2f} times the estimated one."
        ),
        "",
        measured(report, "error_estimates"),
    ]


def small_bright() -> list[str]:
    """Lines about the errors of pictures of small and bright things."""
    report = loaded("small_bright")
    new, old, scenes = report["with"], report["without"], report["scenes"]
    seeds = new["pictures"] // len(scenes)
    percent = lambda x: f"{100 * x:.2g} %" if x < 1 else f"{100 * x:,.0f} %"  # noqa: E731 - a share as text
    rows = [
        [r["scene"], percent(r["asked"]), r["with"]["within"], percent(r["with"]["worst"]), f"{r['with']['spp']:,.0f}",
         *((r["without"]["within"], percent(r["without"]["worst"])) if "without" in r else ("", ""))]
        for r in scenes
    ]  # fmt: skip
    heads = ["scene", "asked", f"of {seeds} within", "largest true error", "spp"]
    return [
        *prose(
            f"{len(scenes)} scenes of small and bright things, on films of 16 x 16 pixels, were made with {seeds} "
            f"seeds each: {_of_all(new['within'], new['pictures'])} true errors lie in their 95 % intervals, and "
            f"{_of_all(new['met'], new['pictures']).lower()} are no larger than asked. *Before*: without samples for "
            "small "
            f"objects and without hidden light in the interval, {_of_all(old['within'], old['pictures'])} did "
            "(an empty field was not measured)."
        ),
        *table([*heads, "before: within", "before: largest true error"], rows),
        measured(report, "small_bright"),
    ]


def _of_all(count: int, total: int) -> str:
    """A count and its total, in words: "All 84", "80 of 84"."""
    return f"All {total}" if count == total else f"{count} of {total}"


def adaptive() -> list[str]:
    """Lines about the time that --error saves."""
    report = loaded("bench_adaptive")
    heads = ["scene", "true error", "`--error`: spp", "`--error`: s", "`--spp`: spp", "`--spp`: s"]
    heads += ["`--spp` over `--error`", "Sobol `--spp`: spp", "Sobol `--spp`: s", "Sobol `--spp` over `--error`"]
    rows = []
    for r in report["rows"]:
        scene, error = f"{r['scene']}, {r['width']} x {r['height']}", f"{100 * r['error_true']:.2g} %"
        own, both = next(iter(r["uniform"].values())), r["uniform"]["sobol"]
        a, b, c = ((f"{x['spp']:.0f}", f"{x['seconds']:.2f}") for x in (r, own, both))
        rows.append([scene, error, *a, *b, f"{own['ratio']:.1f}", *c, f"{both['ratio']:.1f}"])
    return [
        *prose(
            "`--error` is compared with equally many samples in each pixel (`--spp`), at equal true error. "
            "`--error` uses Sobol points; `--spp` uses the scene's own sampler, and Sobol points in the last three "
            "columns. *Over*: how many times longer `--spp` takes than `--error`. Below 1, `--error` is slower. Only "
            "the colour is rendered, and kernels are compiled before:"
        ),
        *table(heads, rows),
        measured(report, "bench_adaptive"),
    ]


def cost() -> list[str]:
    """Lines about what accuracy costs, for three scenes."""
    report = loaded("cost_of_accuracy")
    samplers = {"independent": "independent", "stratified": "stratified", "sobol": "Sobol"}
    slopes, prices = [], []
    for r in report["scenes"].values():
        exponents = (r["by_count"][f"samples, {name}"] for name in samplers)
        shown = (f"{k:.2f} ± {(high - low) / 2:.2f}" for k, low, high in exponents)
        slopes.append([r["title"], f"{100 * r['error']:.2g} %", f"{1e3 * r['seconds']:.0f}", *shown])
        for h in r["halvings"]:
            setting, comma, sampler = h["setting"].partition(", ")
            setting = f"{samplers[sampler]} {setting}" if comma else setting
            prices.append([r["title"], setting, _factor(h)])
    heads = ["scene", "error now", "time now, ms", *(f"k, {name}" for name in samplers.values())]
    return [
        "![Error against seconds for three scenes, both logarithmic: a curve for each setting, their frontier, "
        "the scene as it is](cost.png)",
        *table(heads, slopes),
        *table(["scene", "setting", "times longer for half the error (95 % interval)"], prices)[1:],
        "\\*: extrapolated beyond what was measured.",
        "",
        measured(report, "cost_of_accuracy"),
    ]


def _factor(halving: dict) -> str:
    """How many times longer half the error takes, as text with its interval, and with a star if it is extrapolated."""
    if halving["factor"] is None:
        return "not reached"
    high = "?" if halving["high"] is None else format(halving["high"], ".2g")
    # Older reports lack `beyond`. Their `least` is the least error that was reached, divided by the scene's error.
    star = "\\*" if halving.get("beyond", halving["least"] > 0.5) else ""
    return f"{halving['factor']:.2g}{star} ({halving['low']:.2g} to {high})"


def compare_data() -> list[str]:
    """Lines that compare what programs take for the same picture of data."""
    report = loaded("compare_data")
    titles = {"visray data": "visray, one command", "visray": "visray, a script", "basemap": "matplotlib, basemap"}
    named: dict[str, dict[str, dict]] = {}
    for row in report["rows"]:
        named.setdefault(row["program"], {})[row["picture"]] = row
    rows = []
    for name in sorted(named, key=[*report["programs"], "visray data"].index):
        pair = [named[name][kind] for kind in ("globe", "map")]
        cells = [cell for r in pair for cell in (r["lines"], f"{r['s']:.1f}", f"{r['cpu_s']:.1f}")]
        first = ", ".join(f"{r['first']['s']:.1f}" for r in pair if "first" in r)
        rows.append([titles.get(name, name), *cells, first or "the same"])
    heads = [
        "program",
        "globe: lines",
        "s",
        "processor, s",
        "map: lines",
        "s",
        "processor, s",
        "the very first time, s",
    ]
    peers = ", ".join(f"{name} {version}" for name, version in report["peers"].items())
    busy = " The machine was busy with other work; the seconds of the processor depend less on it."
    busy = busy if report["load"] > report["threads"] else ""
    return [
        *table(heads, rows),
        *prose(
            "Seconds are those from the start of a process to the PNG file of 960 x 540 pixels, the least of "
            f"{report['runs']} runs by turns. visray takes 16 samples per pixel, with soft shadows; the very first "
            f"time, it compiles kernels and keeps them.{busy}"
        ),
        "",
        *prose(measured(report, "compare_data").replace("; visray", f"; {peers}, visray")),
    ]


def bench_data() -> list[str]:
    """Many gizmos on a globe, beside Mitsuba."""
    report = loaded("bench_data")
    heads = ["gizmos", "visray: first picture, s", "a frame, s", "Mitsuba: first picture, s", "a frame, s"]
    rows = [
        [
            f"{r['count']:,} {r['gizmo']}s",
            *(f"{r[f'{name}_{what}_s']:.2g}" for name in ("visray", "mitsuba") for what in ("cold", "frame")),
        ]
        for r in report["rows"]
    ]
    return [
        *table(heads, rows),
        *prose(
            f"{report['width']} x {report['height']} pixels, {report['spp']} samples each, soft shadows. A first "
            "picture is from the start of a process to the PNG file, without kernels of an earlier one. Mitsuba's "
            "cones are meshes."
        ),
        "",
        *prose(measured(report, "bench_data", more=" with `--counts 100 10000 --runs 2`")),
    ]


def bench_animation() -> list[str]:
    """Frames per minute, and updates beside Mitsuba's."""
    report = loaded("bench_animation")
    rows = [
        [name, f"{r['frames_per_minute']:.0f}", f"{r['share_of_kernels']:.0%}", r["compiled_after_first_frame"]]
        for name, r in report["scenes"].items()
    ]
    width, height = report["size"]
    balls = report["moving_spheres"]
    low, high = (f"{x:.2g}" for x in balls["ratio_range"])
    return [
        *table(["scene", "frames a minute", "of it, kernels run", "kernels compiled after the first frame"], rows),
        *prose(
            f"{width} x {height} pixels, {report['spp']} samples each, from the second frame on, without motion blur. "
            "The rest of the time goes into what moves: values, arrays and trees, and into tracing kernels. A plane "
            f"and eight spheres that move, under a point light: {balls['visray_s']:.2g} s a frame, and Mitsuba with "
            f"updates by `mi.traverse` {balls['mitsuba_s']:.2g} s, {balls['ratio']:.1f} times as long "
            f"({low} to {high})."
        ),
        "",
        *prose(measured(report, "bench_animation")),
    ]


def motion_blur() -> list[str]:
    """Motion blur against the mean of sharp frames, and what it costs."""
    report = loaded("motion_blur")
    small, large = (" x ".join(map(str, report[key])) for key in ("small", "large"))
    few, many = (row["spp"] for row in report["scenes"][0]["difference"])
    rows = [
        [
            r["scene"],
            *(f"{row['ratio']:.2f}" for row in r["difference"]),
            r["cost"][0]["moments"],
            *(f"{row['ratio']:.1f}" for row in r["cost"]),
        ]
        for r in report["scenes"]
    ]
    heads = ["scene", f"error, {few} spp", f"{many} spp", "moments", f"times longer, {few} spp", f"{many} spp"]
    return [
        *table(heads, rows),
        *prose(
            f"Error: the root mean square of the difference between a blurred frame of {report['moments']} moments and "
            f"the mean of {report['moments']} sharp frames, {small} pixels, over its standard error; 1 is what noise "
            f"alone gives. Times longer: a blurred frame of {large} pixels against a sharp one, by turns."
        ),
        "",
        *prose(measured(report, "motion_blur")),
    ]


def layer_records() -> list[str]:
    """Lines of a table of all layers of a picture."""
    return table(*layers.table())


def mode_records() -> list[str]:
    """Lines of a table of all shading modes."""
    return table(*modes.table())


def cluster_costs() -> list[str]:
    """Lines with the cost of a task, and the bytes that travel."""
    report = loaded("cluster_scale")
    heads = ["result of a task", "scheduler, ms", "client, ms", "worker, ms"]
    rows = [
        [f"{r['bytes']:,} bytes", *(f"{1e3 * r[f'{who}_seconds']:.1f}" for who in ("scheduler", "client", "worker"))]
        for r in report["tasks"]
    ]
    sizes, large, cache = report["sizes"], report["large_picture"], report["kernel_cache"]
    return [
        *prose("Processor time of one task, without its work, with two workers, through the scheduler:"),
        *table(heads, rows),
        *prose(
            f"So tasks of {large['task_seconds']:g} s keep a scheduler busy with about {large['scheduler_limit']:.0f} "
            f"workers. A tile comes back with {sizes['film_bytes']:.0f} bytes per pixel, whatever its number of "
            f"samples; sample blocks with {sizes['block_bytes']:.0f} bytes per pixel and block of 16 samples. A frame "
            f"comes back with {sizes['.png']['layer_bytes']:.0f} bytes per pixel for PNG files, and "
            f"{sizes['.exr']['layer_bytes']:.0f} for EXR files with all layers of box.json. "
            f"{cache['processes'] - 1} processes that compiled the same kernels at once into one empty cache left a "
            f"whole cache in {cache['rounds']} of {cache['rounds']} rounds, and all pictures were the same."
        ),
        "",
        *prose(measured(report, "cluster_scale")),
    ]


def cluster_jobs() -> list[str]:
    """Lines with the simulated large job."""
    report, rows = loaded("cluster_scale"), []
    for job in report["jobs"]:
        what = f"{job['files'].removeprefix('.').upper()}{'' if job['written'] else ', not written'}"
        runs = [f"{run['hours']:.2f} h, {100 * run['idle_share']:.0f} %" for run in job["runs"]]
        seconds = f"{job['frame_seconds']:.0f}", f"{job['scheduler_seconds']:.2f}", f"{job['client_seconds']:.2f}"
        rows.append([job["scene"], what, *seconds, *runs, f"{job['limit']:,.0f}"])
    workers = [f"{run['workers']:,} workers" for run in report["jobs"][0]["runs"]]
    busiest = max(run["scheduler_busy"] for job in report["jobs"] for run in job["runs"])
    text = f"The scheduler, through which all frames go, is busy for at most {100 * busiest:.0f} % of the time."
    return [*table(["scene", "files", "frame, s", "scheduler, s", "client, s", *workers, "limit, workers"], rows), text]


def live() -> list[str]:
    """Lines with how fast the live picture follows, and jsurf beside it."""
    report = loaded("bench_live")
    names = {
        "heart": "`heart.json`: a surface of degree 6, mirrors, soft shadows, occlusion, a lens",
        "showcase": "`showcase.json`: ten objects, two lights",
        "bowl": "`bowl.json`: 10,000 balls",
        "ring": "a mesh of 100,000 triangles, soft shadows",
        "data-globe": "`data-globe.json`: a table on a globe",
    }
    rows = []
    for name, case in report["scenes"].items():
        followed = (f"{case[key]['frames_per_second']:.0f} ({case[key]['grain']:.0f})" for key in ("orbit", "slider"))
        rests = ("more than 40" if s is None else f"{s:.1f}" for s in case["rest"].values())
        rows.append([names[name], *followed, f"{1000 * case['slider']['seconds']:.0f}", *rests])
    errors = [f"s to {percent} %" for percent in next(iter(report["scenes"].values()))["rest"]]
    heads = ["scene", "camera turns: pictures/s (grain)", "slider moves", "slider to picture, ms", *errors]
    lines = [
        *prose(
            "512 x 512 pixels, without the browser. The grain is the side in pixels of the squares that a picture "
            "consists of while something moves; 1 is every pixel. The last columns are seconds from the last move to "
            "an error so small."
        ),
        *table(heads, rows),
    ]
    if report["jsurf"]:
        pairs = report["jsurf"].items()
        rows = [[name, *(f"{c[k]['frames_per_second']:.1f}" for k in ("jsurf", "plain"))] for name, c in pairs]
        rows = [[*row, f"{float(row[2]) / float(row[1]):.1f}"] for row in rows]
        lines += [
            *prose(
                "Beside jsurf, the core of SURFER: both redraw the same surface with one ray for each pixel, one light "
                "and no shadows, by turns, on all cores. Pictures per second:"
            ),
            *table(["surface", "jsurf", "visray", "ratio"], rows),
        ]
    return [*lines, *prose(measured(report["machine"], "bench_live"))]


def film() -> list[str]:
    """Lines with the error of each filter of pixels."""
    report = loaded("film_filters")
    samplers = list(report["errors"]["box"])
    rows = [
        [
            f"`{name}`",
            *(f"{100 * row[s]:.2f} %" for s in samplers),
            f"{row['sobol'] / report['errors']['box']['sobol']:.1f}",
        ]
        for name, row in report["errors"].items()
    ]
    return [
        *prose(
            f"Error of a matte scene with {report['spp']} samples per pixel, against {report['true_spp']} samples with "
            "the same filter, for each sampler:"
        ),
        *table(["filter", *(f"`{s}`" for s in samplers), "`sobol`, times that of the box"], rows),
        *measured(report, "film_filters", "\n").split("\n"),
    ]


FIGURES = {
    "film": film,
    "cluster_costs": cluster_costs,
    "cluster_jobs": cluster_jobs,
    "layers": layer_records,
    "modes": mode_records,
    "estimates": estimates,
    "small_bright": small_bright,
    "adaptive": adaptive,
    "cost": cost,
    "speed": speed,
    "lists": lists,
    "growth": growth,
    "compare_data": compare_data,
    "bench_data": bench_data,
    "bench_animation": bench_animation,
    "motion_blur": motion_blur,
    "effects": effects,
    "check": check,
    "polynomials": polynomials,
    "csg": csg,
    "csg_growth": csg_growth,
    "degree": degree,
    "stability": stability,
    "mesh_stability": mesh_stability,
    "live": live,
}


def filled(text: str) -> str:
    """The text of a page with the new figures between the marks."""
    for name, figure in FIGURES.items():
        marks = f"<!-- figures: {name} -->", f"<!-- /figures: {name} -->"
        block = "\n".join([marks[0], *figure(), marks[1]])
        text = re.sub(f"{marks[0]}.*?{marks[1]}", lambda _, b=block: b, text, flags=re.DOTALL)
    return text


if __name__ == "__main__":
    for page in PAGES:
        page.write_text(filled(page.read_text()))
