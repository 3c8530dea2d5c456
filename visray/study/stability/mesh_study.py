"""The stability study of meshes: visray's hits are compared with exact first hits (exact/triangles.py).

The sets of rays:
camera: from three eyes to all points of the mesh's bounding ball; an eye is 3 radii away from its centre
inside: from points in this ball, in all directions
edges: from outside, at points on edges and at vertices
secondary: from points where camera and inside rays hit, into the side from which these rays came. Half of them are
    spread over the hemisphere. The other half, the skimming rays, leave at less than 3 degrees to the surface.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from visray.errors import UserError
from visray.primitives.mesh import Mesh
from visray.progress import Bar, Interrupts
from visray.study.stability.exact.surface import RayBundle
from visray.study.stability.exact.triangles import ExactHit, ExactMesh
from visray.study.stability.mesh_shapes import NamedMesh, named_meshes
from visray.study.stability.ray_sets import SECONDARY_SETS, SKIMMING_COSINE, SecondaryRays, ball, sphere, unit
from visray.study.stability.scoring import MOST_DEGREES, Score
from visray.study.stability.solvers import PrimitiveSolver
from visray.study.stability.study import Report

SETS = ("camera", "inside", "edges", "secondary")
RAYS = 3_000  # number of rays in a set
# Roundings of a hit point: as in interaction.py, of |o|, t and the size of the mesh.
ROUNDINGS = 2.0**-53 * 16


@dataclass(frozen=True)
class MeshScore(Score):
    """The score for one mesh and one set of rays.

    near_edge: rays past a silhouette, or past an edge close to where they start, for which rounding decides what is hit
    wrong_roots: hits of a triangle that the ray does not meet first
    loose: hits with an error of more than the bound of Triangle
    All other fields are as in Score.
    """

    @property
    def passed(self) -> bool:
        """Whether every judged ray hits the right triangle, at the right distance and with the right normal."""
        wrong_normals = self.degrees is not None and self.degrees[1] > MOST_DEGREES
        return bool(self.judged) and not (self.errors or self.loose or wrong_normals)


class MeshReport(Report):
    """The report of the study of meshes."""

    def _notes(self) -> str:
        lines = [
            "rays: edges are rays at edges and vertices; secondary rays leave the mesh in all directions, skimming "
            "ones at less than 3 degrees.",
            "judged: rays whose hit is defined in double precision; edge: the other rays.",
            "wrong: false misses/false hits/wrong triangles (of secondary and skimming rays: light leaks/self-shadows/"
            "wrong triangles). If 0 of n rays are wrong, the rate is below 3/n (95 %).",
            "|dt|: error of the distance, 99.9 % quantile, in units of the last place.",
            "normal: error of the normal, 99.9 % quantile, in degrees.",
            "ns: nanoseconds a ray, on one thread.",
            "All rays are settled by exact arithmetic.",
            f"NaN: {sum(s.nan for s in self.scores)}; "
            f"first hit and occlusion contradict: {sum(s.any_hit_differs or 0 for s in self.scores)}.",
        ]
        return "\n".join(lines + ["stopped early"] * self.stopped)


def camera(mesh: NamedMesh, n: int, rng: np.random.Generator) -> RayBundle:
    """n rays from three eyes to points of the bounding ball."""
    eyes = mesh.centre + 3 * mesh.radius * sphere(rng, 3)
    o = eyes[np.arange(n) % len(eyes)]
    return RayBundle(o, unit(mesh.centre + mesh.radius * ball(rng, n) - o))


def inside(mesh: NamedMesh, n: int, rng: np.random.Generator) -> RayBundle:
    """n rays from points in the bounding ball, in all directions."""
    return RayBundle(mesh.centre + mesh.radius * ball(rng, n), sphere(rng, n))


def edges(mesh: NamedMesh, n: int, rng: np.random.Generator) -> RayBundle:
    """n rays at points of edges; a quarter of them at vertices."""
    face, k = rng.integers(len(mesh.faces), size=n), rng.integers(3, size=n)
    a, b = (mesh.vertices[mesh.faces[face, (k + i) % 3]] for i in (0, 1))
    w = rng.choice([0.0, 0.5, *rng.uniform(size=2)], (n, 1))
    o = mesh.centre + mesh.radius * (1.5 + 2 * rng.random((n, 1))) * sphere(rng, n)
    return RayBundle(o, unit(a + w * (b - a) - o))


def secondary(exact: ExactMesh, n: int, rng: np.random.Generator, rays: RayBundle, hits: list[ExactHit]) -> tuple:
    """(SecondaryRays, the hits at which they start, errors of the hit points): n rays that leave the mesh.

    rays, hits: the rays that hit, and their exact hits
    """
    certain = np.array([i for i, h in enumerate(hits) if h.crossing and h.crossing.certain and not h.near_edge])
    pick = certain[rng.integers(len(certain), size=n)]
    start, incoming = [hits[i] for i in pick], rays.select(pick)
    t = np.array([h.crossing.t for h in start])
    p = incoming.o + t[:, None] * incoming.d
    normal = exact.unit_normals[[h.crossing.face for h in start]]
    side = np.where([h.crossing.front for h in start], 1.0, -1.0)[:, None]
    is_skimming = np.arange(n) % 2 == 1
    cosine = np.where(is_skimming, SKIMMING_COSINE * (1 - rng.random(n)), 1 - rng.random(n))[:, None]
    across = unit(np.cross(normal, sphere(rng, n)))
    d = unit(normal * side * cosine + across * np.sqrt(1 - cosine**2))
    slack = ROUNDINGS * (np.abs(incoming.o).sum(1) + t + np.abs(exact.vertices).sum(1).max())
    return SecondaryRays(RayBundle(p, d), incoming, t, 0 * t, normal, is_skimming), start, slack


def scores_of_mesh(named: NamedMesh, sets: Sequence[str], rays: int, seed: int) -> list[MeshScore]:
    """The scores for one mesh, one for each set of rays. Parameters as in study.scores_of_surface."""
    solver = PrimitiveSolver(Mesh(vertices=named.vertices, faces=named.faces, normals="face"), 10 * named.radius)
    exact, scores, bundles, found = ExactMesh(named), [], [], []
    rng = {name: np.random.default_rng([seed, i]) for i, name in enumerate(SETS)}
    for name, make in (("camera", camera), ("inside", inside), ("edges", edges)):
        if name not in sets and (name == "edges" or "secondary" not in sets):
            continue
        bundle = make(named, rays, rng[name])
        hits = exact.first_hits(bundle.o, bundle.d)
        if name != "edges":
            bundles, found = [*bundles, bundle], found + hits
        if name in sets:
            ray, hit, surface = solver.trace(bundle)
            dr.eval(ray, hit, surface)
            figures = _figures(hits, np.array(hit.t), np.array(hit.row))
            figures |= _normal_errors(exact, hits, np.array(hit.t), np.array(surface.n, float).T)
            scores.append(MeshScore(named.name, 1, name, **figures, seconds=solver.seconds(bundle)))
    if "secondary" in sets:
        leaving, start, slack = secondary(exact, rays, rng["secondary"], RayBundle.joined(*bundles), found)
        incoming = leaving.incoming
        hits = exact.first_hits_from(start, incoming.o, incoming.d, leaving.p, leaving.rays.d, slack)
        t, is_occluded = solver.secondary(leaving)
        differs = ~np.isnan(t) & (np.isfinite(t) != is_occluded) & ~np.array([h.near_edge for h in hits])
        for skimming, name in enumerate(SECONDARY_SETS):
            lanes = np.flatnonzero(leaving.skimming == bool(skimming))
            figures = _figures([hits[i] for i in lanes], t[lanes], None) | {"ulps": None, "loose": 0}
            scores.append(MeshScore(named.name, 1, name, **figures, any_hit_differs=int(differs[lanes].sum())))
    return scores


def _figures(hits: list[ExactHit], t: np.ndarray, row: np.ndarray | None) -> dict[str, Any]:
    """The counts and errors of a score, as a dict of fields of Score.

    t, row: distances and triangles that visray found; None: triangles are not compared
    """
    judged = np.array([not h.near_edge for h in hits])
    true_hit, solver_hit, nan = np.array([h.crossing is not None for h in hits]), np.isfinite(t), np.isnan(t)
    both = np.flatnonzero(judged & true_hit & solver_hit)
    errors = np.array([abs(hits[i].crossing.error(float(t[i]))) for i in both])
    exact_t = np.array([hits[i].crossing.t for i in both])
    if row is None:
        # These rays start at rounded points, so their distances differ a little.
        wrong = errors > 1e-3 * exact_t
    else:
        wrong = np.array([int(row[i]) not in hits[i].faces for i in both], bool)
    ulps = errors / np.spacing(exact_t)
    return {
        "judged": int(judged.sum()),
        "near_edge": int((~judged).sum()),
        "exact": len(hits),
        "hits": len(both),
        "false_misses": int((judged & true_hit & ~solver_hit & ~nan).sum()),
        "false_hits": int((judged & ~true_hit & solver_hit).sum()),
        "wrong_roots": int(wrong.sum()),
        "loose": int((errors > [hits[i].rounding for i in both]).sum()),
        "nan": int((judged & nan).sum()),
        "ulps": (float(np.median(ulps)), float(np.quantile(ulps, 0.999)), float(ulps.max())) if len(both) else None,
    }


def _normal_errors(exact: ExactMesh, hits: list[ExactHit], t: np.ndarray, n: np.ndarray) -> dict[str, Any]:
    """The fields `degrees` and `nan` of Score. Rays at edges, where there are several normals, are left out."""
    lanes = np.array([i for i, h in enumerate(hits) if not h.near_edge and len(h.faces) == 1 and np.isfinite(t[i])])
    if not len(lanes):
        return {}
    true = exact.unit_normals[[hits[i].faces[0] for i in lanes]]
    sine, cosine = np.linalg.norm(np.cross(true, n[lanes]), axis=1), (true * n[lanes]).sum(1)
    degrees = np.degrees(np.arctan2(sine, cosine))
    return {"degrees": (float(np.quantile(degrees, 0.999)), float(degrees.max()))}


def run(
    rays: int = RAYS, sets: Sequence[str] = SETS, only: Sequence[str] = (), seed: int = 0, progress: bool = False
) -> MeshReport:
    """Runs the study of meshes. Parameters as in study.run."""
    if unknown := [s for s in sets if s not in SETS]:
        raise UserError(f"sets = {', '.join(unknown)}: must be of {', '.join(SETS)}")
    if not isinstance(rays, int) or rays < 10:
        raise UserError(f"rays = {rays}: must be a whole number, at least 10")
    known = named_meshes()
    if missing := [name for name in only if name not in known]:
        raise UserError(f"only = {', '.join(missing)}: must be of {', '.join(known)}")
    chosen, scores = [m for name, m in known.items() if not only or name in only], []
    with Interrupts() as interrupts, Bar("testing", len(chosen), progress) as bar:
        for i, mesh in enumerate(chosen):
            if interrupts.requested:
                break
            scores += scores_of_mesh(mesh, sets, rays, seed)
            bar.update(i + 1)
        return MeshReport(rays, seed, scores, stopped=interrupts.requested)
