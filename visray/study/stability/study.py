"""How a kernel answers for polynomial surfaces, against exact truth: what it misses, what it sees that is not there,
how far off it is, and what a ray costs.

A solver is asked. The one that counts is the Kernel, visray's own search for the polynomial primitive; any function
(o, d) -> t of arrays can be put in its place.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Column, Table

from visray.errors import UserError
from visray.progress import Bar, Interrupts
from visray.study.stability import ray_sets
from visray.study.stability.exact.certified import Exact
from visray.study.stability.exact.formulas import flint
from visray.study.stability.exact.known_surface import Bundle, Surface
from visray.study.stability.exact.truth import Truth, settled
from visray.study.stability.judging import Row, judged
from visray.study.stability.ray_sets import PARTS, SETS, Leaving, Named, surfaces_of
from visray.study.stability.solvers import Kernel, Solver

RAYS, SAMPLE, MOST = 12_000, 100, 1000 * 36


def tested(named: Named, sets: Sequence[str], rays: int, seed: int, solver: Solver) -> list[Row]:
    """A surface's rows, a set each."""
    surface, found = named.surface, []
    most = max(40, MOST // surface.degree**2)
    sample = min(SAMPLE, most // 4)
    rng = {name: np.random.default_rng([seed, i]) for i, name in enumerate(SETS)}

    def settle(bundle: Bundle) -> Truth:
        return settled(surface, bundle, sample, most, seed)

    def add(name: str, bundle: Bundle | None, truth: Truth | None = None) -> Truth | None:
        if bundle is None:
            return None
        truth = settle(bundle) if truth is None else truth
        if name in sets:
            t, n = solver.first(bundle)
            figures = judged(named, bundle, truth, t, n)
            figures |= {"unresolved": solver.unresolved(bundle), "seconds": solver.seconds(bundle)}
            found.append(Row(named.name, surface.degree, name, **figures))
        return truth

    bundles, truths = [], []
    for name in ("camera", "inside"):
        if name in sets or "grazing" in sets or "secondary" in sets:
            bundles.append(getattr(ray_sets, name)(named, rays, rng[name]))
            truths.append(add(name, bundles[-1]))
    if len(bundles) == 2:
        base = Bundle.joined(*bundles), Truth.joined(*truths)
    if "grazing" in sets:
        add("grazing", ray_sets.grazing(named, rays, rng["grazing"], *base))
    if "singular" in sets:
        add("singular", ray_sets.singular(named, rays, rng["singular"]))
    if "secondary" in sets:
        found += left(named, ray_sets.secondary(named, rays, rng["secondary"], *base), sample, most, seed, solver)
    return found


def left(named: Named, rays: Leaving | None, sample: int, most: int, seed: int, solver: Solver) -> list[Row]:
    """The rows of rays that leave the surface."""
    found = []
    for skims, name in enumerate(PARTS if rays is not None else ()):
        part = rays.part(rays.skimming == bool(skims))
        if not len(part.t):
            continue
        exact = Exact(named.surface)

        def start(i: int, part: Leaving = part, exact: Exact = exact) -> list:
            return exact.point(part.first.o[i], part.first.d[i], part.t[i], part.low[i])

        truth = settled(named.surface, part.rays, sample, most // 2, seed, start)
        t, between = solver.leave(part)
        differs = int((truth.good & ~np.isnan(t) & (np.isfinite(t) != between)).sum())
        figures = judged(named, part.rays, truth, t, None, start)
        found.append(Row(named.name, named.surface.degree, name, any_hit_differs=differs, **figures))
    return found


@dataclass(frozen=True)
class Report:
    """Rows, and surfaces that were left out, with the reason."""

    rays: int
    seed: int
    rows: list[Row]
    left_out: dict[str, str] = field(default_factory=dict)
    stopped: bool = False

    @property
    def passed(self) -> bool:
        """Whether there are rows, and every one is."""
        return bool(self.rows) and all(r.passed for r in self.rows)

    def as_json(self) -> dict[str, Any]:
        """The report as json.dumps takes it."""
        head = {"passed": self.passed, "rays": self.rays, "seed": self.seed, "stopped": self.stopped}
        return head | {"left_out": self.left_out, "rows": [r.as_json() for r in self.rows]}

    def table(self) -> Table:
        """The report for the terminal."""
        title = f"{'passed' if self.passed else 'FAILED'}: against exact answers, {self.rays} rays a set"
        layout = {"title": title, "caption": self._notes(), "caption_justify": "left", "padding": (0, 0, 0, 1)}
        table = Table(*(Column(name, no_wrap=True) for name in ("surface", "rays")), **layout)
        for name in ("judged", "edge", "wrong", "|dt|", "normal", "ns"):
            table.add_column(name, justify="right", no_wrap=True)
        before = ""
        for r in self.rows:
            if r.surface != before:
                table.add_section()
            name = "" if r.surface == before else r.surface
            rays = {"secondary, hemisphere": "leaving", "secondary, grazing": "skimming"}.get(r.rays, r.rays)
            edge = f"{r.near_edge}" + (f"+{r.open}" if r.open else "")
            wrong = f"{r.false_misses}/{r.false_hits}/{r.wrong_roots}" if r.errors else "0"
            wrong += f" ({r.errors_within})" if r.errors_within else ""
            ns = "" if r.seconds is None else f"{1e9 * r.seconds:.0f}"
            figures = (f"{v:.1g}" if v is not None else "" for v in (r.ulps and r.ulps[1], r.degrees and r.degrees[0]))
            style = None if r.passed else "red"
            table.add_row(name, rays, f"{r.judged}", edge, wrong, *figures, ns, style=style)
            before = r.surface
        return table

    def _notes(self) -> str:
        """What a reader of the columns must know."""
        rows = self.rows
        exact, checked, off = (sum(getattr(r, k) for r in rows) for k in ("exact", "checked", "truth_wrong"))
        lines = [
            "judged: answers that double can tell; edge: those it cannot (+ not settled).",
            "wrong: lost/false/other roots; of leaving and skimming rays (on a surface, all around",
            "and at small angles) leaks/self-shadows/other roots; in brackets the shift of f, in",
            "roundings of its terms, that makes them right. 0 of n: below 3/n (95 %).",
            "|dt|: p99.9, units in the last place of t; normal: p99.9, degrees; ns: one ray, one thread.",
            f"Settled exactly: {exact} rays; of the others {checked} checked so, {off} of them off.",
            f"NaN: {sum(r.nan for r in rows)}; unresolved: {sum(r.unresolved or 0 for r in rows)}; "
            f"any hit and first hit differ: {sum(r.any_hit_differs or 0 for r in rows)}.",
        ]
        lines += [f"left out: {name}: {why}" for name, why in self.left_out.items()]
        return "\n".join(lines + ["stopped early"] * self.stopped)


def run(
    surfaces: Path | None = None,
    rays: int = RAYS,
    sets: Sequence[str] = SETS,
    only: Sequence[str] = (),
    seed: int = 0,
    progress: bool = False,
    solver: Callable[[Surface], Solver] = Kernel,
) -> Report:
    """The study of the surfaces of a file, or of the known ones. Ctrl-C keeps what is done so far."""
    flint()
    if unknown := [s for s in sets if s not in SETS]:
        raise UserError(f"sets = {', '.join(unknown)}: must be of {', '.join(SETS)}")
    if not isinstance(rays, int) or rays < 10:
        raise UserError(f"rays = {rays}: must be a whole number, at least 10")
    every = surfaces_of(surfaces)
    if missing := [n for n in only if n not in every]:
        raise UserError(f"only = {', '.join(missing)}: must be of {', '.join(every)}")
    chosen = {n: s for n, s in every.items() if not only or n in only}
    rows, left_out = [], {}
    with Interrupts() as interrupts, Bar("testing", len(chosen), progress) as bar:
        for i, (name, one) in enumerate(chosen.items()):
            if interrupts.requested:
                break
            try:
                rows += tested(one, sets, rays, seed, solver(one.surface))
            except UserError as error:
                left_out[name] = error.lines[0]
            bar.at(i + 1)
        return Report(rays, seed, rows, left_out, interrupts.requested)
