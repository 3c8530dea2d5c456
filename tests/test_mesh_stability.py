"""Exact first hits of meshes against plain fractions, and whether the study of meshes catches what is wrong."""

import json
from fractions import Fraction

import numpy as np
import pytest

from visray.cli import main
from visray.errors import UserError
from visray.study.stability import mesh_study
from visray.study.stability.exact.triangles import ExactMesh
from visray.study.stability.mesh_shapes import named_meshes
from visray.study.stability.solvers import PrimitiveSolver

MESHES = named_meshes()


def by_fractions(mesh, o: np.ndarray, d: np.ndarray) -> tuple[Fraction, set[int]] | None:
    """Distance of the first hit and the triangles that are hit there, by Cramer's rule."""
    exact = lambda v: [Fraction(float(x)) for x in v]  # noqa: E731
    o, d, found = exact(o), exact(d), []
    for face, (a, b, c) in enumerate(mesh.vertices[mesh.faces]):
        a, b, c = exact(a), exact(b), exact(c)
        x, y, z = ([p - q for p, q in zip(v, a)] for v in (b, c, o))
        det = lambda p, q, r: sum(  # noqa: E731
            p[i] * (q[(i + 1) % 3] * r[(i + 2) % 3] - q[(i + 2) % 3] * r[(i + 1) % 3]) for i in range(3)
        )
        whole = det(x, y, [-k for k in d])
        if not whole:
            continue
        u, v, t = det(z, y, [-k for k in d]) / whole, det(x, z, [-k for k in d]) / whole, det(x, y, z) / whole
        if u >= 0 and v >= 0 and u + v <= 1 and t > 0:
            found.append((t, face))
    if not found:
        return None
    first = min(found)[0]
    return first, {face for t, face in found if t == first}


@pytest.mark.parametrize("name", MESHES)
def test_meshes_are_closed_and_turned_outwards(name: str) -> None:
    mesh = MESHES[name]
    sides = [(a, b) for face in mesh.faces.tolist() for a, b in zip(face, np.roll(face, -1).tolist())]
    assert len(set(sides)) == len(sides) and {(b, a) for a, b in sides} == set(sides)
    a, b, c = (mesh.vertices[mesh.faces] - mesh.centre).transpose(1, 0, 2)
    assert np.einsum("ij,ij->", a, np.cross(b, c)) > 0


@pytest.mark.parametrize("name", ["slivers", "ball far away"])
def test_exact_hits_are_those_of_fractions(name: str) -> None:
    """Also at edges and vertices, where all triangles that meet there count."""
    mesh, rng, hits = MESHES[name], np.random.default_rng(2), 0
    exact = ExactMesh(mesh)
    for make, n in ((mesh_study.camera, 3), (mesh_study.edges, 5)):
        rays = make(mesh, n, rng)
        for hit, o, d in zip(exact.first_hits(rays.o, rays.d), rays.o, rays.d):
            truth = by_fractions(mesh, o, d)
            assert (truth is None) == (hit.crossing is None)
            if truth:
                crossing = hit.crossing
                assert Fraction(crossing.numerator, crossing.denominator) == truth[0]
                assert crossing.face in truth[1] and truth[1] <= set(hit.faces)
                assert crossing.error(float(truth[0]) * 1.5) == pytest.approx(0.5 * float(truth[0]))
                hits += 1
    assert hits > 3


def test_a_ray_leaves_from_the_exact_hit() -> None:
    """On the convex ball no ray that leaves outwards meets it again; inwards, all do."""
    mesh, rng = MESHES["ball"], np.random.default_rng(3)
    exact, rays = ExactMesh(mesh), mesh_study.camera(mesh, 100, rng)
    leaving, start, slack = mesh_study.secondary(exact, 100, rng, rays, exact.first_hits(rays.o, rays.d))
    for sign in (1, -1):
        found = exact.first_hits_from(
            start, leaving.incoming.o, leaving.incoming.d, leaving.p, sign * leaving.rays.d, slack
        )
        judged = [h for h in found if not h.near_edge]
        assert len(judged) > 90 and all((h.crossing is None) == (sign > 0) for h in judged)


def scores(monkeypatch: pytest.MonkeyPatch, **changes) -> list:
    """The scores of a solver some of whose methods are replaced."""
    for name, method in changes.items():
        monkeypatch.setattr(PrimitiveSolver, name, method)
    monkeypatch.setattr(PrimitiveSolver, "seconds", lambda self, rays: None)
    return mesh_study.run(40, only=("ball",)).scores


def test_the_kernel_is_right_and_wrong_solvers_are_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    good = scores(monkeypatch)
    assert all(s.passed and s.judged for s in good) and [s.rays for s in good][:3] == ["camera", "inside", "edges"]
    right = PrimitiveSolver.secondary

    def shadows_itself(self, rays):
        t, hidden = right(self, rays)
        return np.where(np.arange(len(t)) % 4 < 2, 1e-9, t), hidden | True

    wrong = scores(monkeypatch, secondary=shadows_itself)
    assert [s.passed for s in wrong] == [True, True, True, False, False] and wrong[-1].false_hits > 0


def test_what_is_wrong_with_hits_is_counted() -> None:
    mesh = MESHES["slivers"]
    exact, rays = ExactMesh(mesh), mesh_study.camera(mesh, 60, np.random.default_rng(4))
    hits = exact.first_hits(rays.o, rays.d)
    t = np.array([h.crossing.t if h.crossing else np.inf for h in hits])
    row = np.array([h.crossing.face if h.crossing else 0 for h in hits])
    right = mesh_study._figures(hits, t, row)
    hit = np.isfinite(t)
    assert hit.sum() > 15 and (~hit).sum() > 15 and right["ulps"][2] <= 0.5
    assert not any(right[k] for k in ("false_misses", "false_hits", "wrong_roots", "loose", "nan"))
    for count, figures in (
        ("false_misses", mesh_study._figures(hits, np.where(hit, np.inf, t), row)),
        ("false_hits", mesh_study._figures(hits, np.where(hit, t, 1.0), row)),
        ("wrong_roots", mesh_study._figures(hits, t, row + 1)),
        ("loose", mesh_study._figures(hits, t * (1 + 1e-12), row)),
        ("nan", mesh_study._figures(hits, t * np.nan, row)),
    ):
        assert figures[count] >= right["judged"] / 5, count


@pytest.mark.slow
def test_the_command(capsys: pytest.CaptureFixture) -> None:
    assert main(["stability", "--kind", "mesh", "--rays", "100", "--only", "slivers", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["passed"] and {r["surface"] for r in report["rows"]} == {"slivers"} and len(report["rows"]) == 5
    assert main(["stability", "--kind", "mesh", "--rays", "20", "--only", "ball", "--sets", "edges"]) == 0
    assert "edges" in capsys.readouterr().out


def test_wrong_questions() -> None:
    wrong = ({"sets": ("grazing",)}, "sets = grazing"), ({"only": ("egg",)}, "only = egg"), ({"rays": 3}, "rays = 3")
    for more, line in wrong:
        with pytest.raises(UserError, match=line):
            mesh_study.run(**more)
    assert main(["stability", "--kind", "mesh", "--surfaces", "a.json"]) == 2


@pytest.mark.nightly
def test_meshes_on_many_rays() -> None:
    assert mesh_study.run(20_000).passed
