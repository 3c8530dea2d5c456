"""The stability study: a solver intersects rays with polynomial surfaces. Its hits are compared with exact hits.

The study counts false misses, false hits and wrong roots. It measures the errors of distances and normals, and the time
of a ray. The solver is KernelSolver, which is visray's own search; FunctionSolver makes a solver of any function
(o, d) -> t.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from visray.errors import UserError
from visray.progress import Bar, Interrupts
from visray.study.stability import ray_sets
from visray.study.stability.exact.certified_roots import CertifiedSolver
from visray.study.stability.exact.expressions import flint
from visray.study.stability.exact.surface import RayBundle, Surface
from visray.study.stability.exact.truth import Truth, first_hits
from visray.study.stability.ray_sets import SECONDARY_SETS, SETS, NamedSurface, SecondaryRays, named_surfaces
from visray.study.stability.scoring import Score, score
from visray.study.stability.solvers import KernelSolver, Solver
from visray.tables import Column, Table

# RAYS: number of rays in a set. SAMPLE: number of the rays settled by NumPy that python-flint repeats as a check.
# MOST_BY_FLINT: python-flint settles about MOST_BY_FLINT / degree^2 other rays at most, because its time grows with the
# degree.
RAYS, SAMPLE, MOST_BY_FLINT = 12_000, 100, 1000 * 36


def scores_of_surface(named: NamedSurface, sets: Sequence[str], rays: int, seed: int, solver: Solver) -> list[Score]:
    """The scores of a solver for one surface, one score for each set of rays.

    sets: names of the sets; rays: number of rays in a set; seed: seed of the rays
    """
    surface, scores = named.surface, []
    most = max(40, MOST_BY_FLINT // surface.degree**2)
    sample = min(SAMPLE, most // 4)
    rng = {name: np.random.default_rng([seed, i]) for i, name in enumerate(SETS)}

    def add(name: str, bundle: RayBundle | None) -> Truth | None:
        """Adds the score of a set of rays if `sets` contains its name. Returns the exact hits; None without rays."""
        if bundle is None:
            return None
        truth = first_hits(surface, bundle, sample, most, seed)
        if name in sets:
            t, n = solver.first_hits(bundle)
            figures = score(named, bundle, truth, t, n)
            figures |= {"unresolved": solver.unresolved(bundle), "seconds": solver.seconds(bundle)}
            scores.append(Score(named.name, surface.degree, name, **figures))
        return truth

    bundles, truths = [], []
    for name in ("camera", "inside"):
        if name in sets or "grazing" in sets or "secondary" in sets:
            bundles.append(getattr(ray_sets, name)(named, rays, rng[name]))
            truths.append(add(name, bundles[-1]))
    if len(bundles) == 2:
        camera_and_inside = RayBundle.joined(*bundles), Truth.joined(*truths)
    if "grazing" in sets:
        add("grazing", ray_sets.grazing(named, rays, rng["grazing"], *camera_and_inside))
    if "singular" in sets:
        add("singular", ray_sets.singular(named, rays, rng["singular"]))
    if "secondary" in sets:
        secondary = ray_sets.secondary(named, rays, rng["secondary"], *camera_and_inside)
        scores += scores_of_secondary(named, secondary, sample, most, seed, solver)
    return scores


def scores_of_secondary(
    named: NamedSurface, secondary: SecondaryRays | None, sample: int, most: int, seed: int, solver: Solver
) -> list[Score]:
    """The scores for secondary rays: one score for the rays over the hemisphere, one for the skimming rays.

    secondary: None if there are no secondary rays
    sample, most, seed: see truth.first_hits
    """
    scores = []
    for skimming, name in enumerate(SECONDARY_SETS if secondary is not None else ()):
        selected = secondary.select(secondary.skimming == bool(skimming))
        if not len(selected.t):
            continue
        certified = CertifiedSolver(named.surface)

        def start(i: int, s: SecondaryRays = selected, certified: CertifiedSolver = certified) -> list:
            return certified.hit_point(s.incoming.o[i], s.incoming.d[i], s.t[i], s.low[i])

        truth = first_hits(named.surface, selected.rays, sample, most // 2, seed, start)
        t, is_occluded = solver.secondary(selected)
        contradictions = int((truth.judged & ~np.isnan(t) & (np.isfinite(t) != is_occluded)).sum())
        figures = score(named, selected.rays, truth, t, None, start)
        scores.append(Score(named.name, named.surface.degree, name, any_hit_differs=contradictions, **figures))
    return scores


@dataclass(frozen=True)
class Report:
    """The report of the study.

    rays: number of rays in a set
    seed: seed of the rays
    scores: a score for each surface and set of rays
    left_out: by the name of a surface that the solver does not accept, the reason
    stopped: whether Ctrl-C ended the study early
    """

    rays: int
    seed: int
    scores: list[Score]
    left_out: dict[str, str] = field(default_factory=dict)
    stopped: bool = False

    @property
    def passed(self) -> bool:
        """Whether there is at least one score, and all scores pass."""
        return bool(self.scores) and all(s.passed for s in self.scores)

    def as_json(self) -> dict[str, Any]:
        """The report as a dict for json.dumps."""
        head = {"passed": self.passed, "rays": self.rays, "seed": self.seed, "stopped": self.stopped}
        return head | {"left_out": self.left_out, "rows": [s.as_json() for s in self.scores]}

    def table(self) -> Table:
        """The report as a table for the terminal."""
        title = f"{'passed' if self.passed else 'FAILED'}: compared with exact results, {self.rays} rays a set"
        layout = {"title": title, "caption": self._notes(), "caption_justify": "left", "padding": (0, 0, 0, 1)}
        table = Table(*(Column(name, no_wrap=True) for name in ("surface", "rays")), **layout)
        for name in ("judged", "edge", "wrong", "|dt|", "normal", "ns"):
            table.add_column(name, justify="right", no_wrap=True)
        previous = ""
        for s in self.scores:
            if s.surface != previous:
                table.add_section()
            name = "" if s.surface == previous else s.surface
            rays = {"secondary, hemisphere": "secondary", "secondary, grazing": "skimming"}.get(s.rays, s.rays)
            edge = f"{s.near_edge}" + (f"+{s.open}" if s.open else "")
            wrong = f"{s.false_misses}/{s.false_hits}/{s.wrong_roots}" if s.errors else "0"
            wrong += f" ({s.errors_within})" if s.errors_within else ""
            ns = "" if s.seconds is None else f"{1e9 * s.seconds:.0f}"
            figures = (f"{v:.1g}" if v is not None else "" for v in (s.ulps and s.ulps[1], s.degrees and s.degrees[0]))
            style = None if s.passed else "red"
            table.add_row(name, rays, f"{s.judged}", edge, wrong, *figures, ns, style=style)
            previous = s.surface
        return table

    def _notes(self) -> str:
        """Text below the table: the meaning of its columns, and totals."""
        scores = self.scores
        exact, checked, contradicted = (sum(getattr(s, k) for s in scores) for k in ("exact", "checked", "truth_wrong"))
        lines = [
            "rays: secondary rays leave the surface in all directions, skimming ones at less than 3 degrees.",
            "judged: rays whose hit is defined in double precision; edge: the other rays (+ those not settled).",
            "wrong: false misses/false hits/wrong roots (of secondary and skimming rays: light leaks/self-shadows/"
            "wrong roots), in brackets the shift of f, in roundings of its terms, that explains them. If 0 of n rays "
            "are wrong, the rate is below 3/n (95 %).",
            "|dt|: error of the distance, 99.9 % quantile, in units of the last place.",
            "normal: error of the normal, 99.9 % quantile, in degrees.",
            "ns: nanoseconds a ray, on one thread.",
            f"Settled by exact arithmetic: {exact} rays; by NumPy: the others, of which {checked} were checked exactly "
            f"and {contradicted} differed.",
            f"NaN: {sum(s.nan for s in scores)}; unresolved: {sum(s.unresolved or 0 for s in scores)}; "
            f"first hit and occlusion contradict: {sum(s.any_hit_differs or 0 for s in scores)}.",
        ]
        lines += [f"left out: {name}: {reason}" for name, reason in self.left_out.items()]
        return "\n".join(lines + ["stopped early"] * self.stopped)


def run(
    surfaces: Path | None = None,
    rays: int = RAYS,
    sets: Sequence[str] = SETS,
    only: Sequence[str] = (),
    seed: int = 0,
    progress: bool = False,
    solver: Callable[[Surface], Solver] = KernelSolver,
) -> Report:
    """Runs the study. If Ctrl-C ends the study early, the report contains the scores of the finished surfaces.

    surfaces: a JSON file of surfaces; None: the surfaces of the catalogue
    rays: number of rays in a set
    sets: names of the sets of rays
    only: names of the surfaces to test; empty: all surfaces
    seed: seed of the rays
    progress: whether a progress bar is shown
    solver: function from a surface to the solver that is tested
    """
    flint()
    if unknown := [s for s in sets if s not in SETS]:
        raise UserError(f"sets = {', '.join(unknown)}: must be of {', '.join(SETS)}")
    if not isinstance(rays, int) or rays < 10:
        raise UserError(f"rays = {rays}: must be a whole number, at least 10")
    known = named_surfaces(surfaces)
    if missing := [name for name in only if name not in known]:
        raise UserError(f"only = {', '.join(missing)}: must be of {', '.join(known)}")
    chosen = {name: named for name, named in known.items() if not only or name in only}
    scores, left_out = [], {}
    with Interrupts() as interrupts, Bar("testing", len(chosen), progress) as bar:
        for i, (name, named) in enumerate(chosen.items()):
            if interrupts.requested:
                break
            try:
                scores += scores_of_surface(named, sets, rays, seed, solver(named.surface))
            except UserError as error:
                left_out[name] = error.lines[0]
            bar.update(i + 1)
        return Report(rays, seed, scores, left_out, interrupts.requested)
