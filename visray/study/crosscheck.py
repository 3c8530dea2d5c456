"""A scene against its twin in Mitsuba: the same rays through both, and what they say compared."""

from dataclasses import replace
from typing import Any

import numpy as np

from visray.errors import UserError
from visray.output.image import Image
from visray.progress import Bar
from visray.render import adjusted
from visray.scene.scene import Scene
from visray.study.answers import Answers, Look, Ours, Rays
from visray.study.findings import Crossings, Pictures, Report, Shadows
from visray.study.rounding import AXES, Shift, Slack, angle, gaps, slack, tied
from visray.study.twin import LARGEST_SQUARE, Theirs, twins

LONGEST_SIDE = 512
EXAMPLES = 3


def check(scene: Scene, *, rays: int = 100_000, seed: int = 0, other: Scene | None = None) -> Report:
    """Compares what visray and Mitsuba say of a scene: pixel centres, shadow rays, `rays` random ones, and the picture.

    Objects that have no twin in Mitsuba are left out of both. `other` is what Mitsuba is given instead of the scene: with
    it the check is checked.
    """
    made, left_out = twins(other or scene)
    if not made:
        why = "; ".join(f"objects.{name}: {reason}" for name, reason in left_out.items()) or "it has no objects"
        raise UserError(f"nothing of the scene can be checked: {why}")
    scene, notes = _reduced(_kept(scene, made))
    other = _kept(other, made) if other else scene
    with Bar("checking", 6) as bar:
        ours = Ours(scene)
        theirs = Theirs(other, ours.names, made, ours.centre)
        bar.at(1)
        seen = _Comparison(ours, theirs, ours.pixel_rays())
        bar.at(2)
        shadows, dim = _shadows(seen)
        bar.at(3)
        spread = _Comparison(ours, theirs, random_rays(scene, ours.centre, rays, seed))
        bar.at(4)
        picture, difference = _pictures(seen, dim)
        bar.at(5)
    crossings = (seen.crossings(), spread.crossings())
    examples = tuple(seen.examples("pixel") + spread.examples("random ray"))
    return Report(
        scene.film.width, scene.film.height, seed, len(made), left_out, tuple(notes), examples, *crossings,
        shadows, picture, difference,
    )  # fmt: skip


def _kept(scene: Scene, made: dict) -> Scene:
    return replace(scene, objects={name: thing for name, thing in scene.objects.items() if name in made})


def _reduced(scene: Scene) -> tuple[Scene, list[str]]:
    """The scene with its picture's longer side at most LONGEST_SIDE, and a note of it."""
    size = (scene.film.width, scene.film.height)
    longest = max(size)
    if longest <= LONGEST_SIDE:
        return scene, []
    small = tuple(max(1, round(side * LONGEST_SIDE / longest)) for side in size)
    note = f"checked at {small[0]} x {small[1]} pixels instead of {size[0]} x {size[1]}"
    return adjusted(scene, size=small), [note]


def random_rays(scene: Scene, centre: np.ndarray, count: int, seed: int) -> Rays:
    """Rays in and around the bounds of the scene's bounded objects: half of them anyhow, half aimed at an object."""
    rng = np.random.default_rng(seed)
    boxes = [b for b in (thing.bounds() for thing in scene.objects.values()) if b is not None]
    if not boxes:
        points = np.array([scene.camera.origin, scene.camera.target, *(l.position for l in scene.lights.values())], float)
        boxes = [(points.min(0), points.max(0))]
    low, high = (np.array(side) - centre for side in zip(*boxes))
    least, most = low.min(0), high.max(0)
    margin = 0.5 * (most - least).max()
    o = rng.uniform(least - margin, most + margin, (count, 3))
    at = rng.integers(len(boxes), size=count // 2)
    d = rng.normal(size=(count, 3))
    d[: count // 2] = rng.uniform(low[at], high[at]) - o[: count // 2]
    length = np.linalg.norm(d, axis=1, keepdims=True)
    d = np.where(length > 0, d / np.where(length > 0, length, 1), (0, 1, 0))
    return Rays(o.astype(np.float32), d.astype(np.float32))


class _Comparison:
    """The same rays through both, lane by lane."""

    def __init__(self, ours: Ours, theirs: Theirs, rays: Rays):
        self.ours, self.theirs, self.rays = ours, theirs, rays
        self.look: Look = ours.trace(rays)
        self.a: Answers = self.look.answers
        self.si, self.b = theirs.trace(rays)
        self.slack: Slack = slack(ours, rays, self.a, self.b.index, theirs.extents)
        a, b = self.a, self.b
        self.beyond = self._beyond()
        self.apart = (a.index != b.index) & ~self.slack.edge & ~self.beyond
        self.tied = np.zeros(len(a.t), bool)
        if (doubtful := np.flatnonzero(self.apart & a.hit & b.hit)).size:
            self.tied[doubtful] = tied(ours, *(_part(x, doubtful) for x in (rays, a, b)), self.slack.t[doubtful])
        self.apart &= ~self.tied
        self.same = (a.index == b.index) & a.hit & ~self.slack.edge & ~self.beyond

    def _beyond(self) -> np.ndarray:
        """Hits of planes farther away than half their twins, the largest of their squares, are long."""
        unbounded = np.append(~self.theirs.extents.bounded, False)[self.a.index]
        return unbounded & (np.linalg.norm(self.rays.o, axis=1) + self.a.t > LARGEST_SQUARE / 2)

    def crossings(self) -> Crossings:
        a, b, allowed, same = self.a, self.b, self.slack, self.same
        size = np.broadcast_to(np.linalg.norm(self.rays.o, axis=1), a.t.shape) + np.where(a.hit, a.t, 0)
        dt, turn, duv = gaps(a.t, b.t), angle(a.n, b.n), np.abs(a.uv - b.uv).max(1)
        share = dt / np.maximum(size, np.finfo(float).tiny)
        sided = np.append(self.theirs.extents.sided, False)[a.index]
        turn = np.where(sided, turn, np.minimum(turn, np.pi - turn))
        known = same & ~allowed.seam
        both = self.apart & a.hit & b.hit
        return Crossings(
            rays=len(a.t), hits=int(a.hit.sum()), near_edge=int((allowed.edge & ~self.beyond).sum()),
            tied=int(self.tied.sum()), beyond=int(self.beyond.sum()),
            hit_mismatches=int((self.apart & ~both).sum()), object_mismatches=int(both.sum()),
            uv_unknown=int((same & allowed.seam).sum()),
            dt=_most(share, same), dt_bound=_most(dt, same, allowed.t),
            angle=_most(turn, same), angle_bound=_most(turn, same, allowed.angle),
            uv=_most(duv, known), uv_bound=_most(duv, known, allowed.uv),
        )  # fmt: skip

    def examples(self, title: str) -> list[str]:
        """A line each for the first few rays of which the two say something else."""
        names = (*self.ours.names, "nothing")
        found = []
        for lane in np.flatnonzero(self.apart)[:EXAMPLES]:
            o = self.ours.centre + self.rays.o[min(lane, len(self.rays.o) - 1)]
            says = [f"{names[x.index[lane]]} at {x.t[lane]:.9g}" for x in (self.a, self.b)]
            d = self.rays.d[lane]
            found.append(f"{title} {lane}, from {o.tolist()} along {d.tolist()}: visray {says[0]}, Mitsuba {says[1]}")
        return found


def _part(x: Any, lanes: np.ndarray) -> Any:
    """Some lanes of Rays or Answers; what all lanes share stays."""
    values = {name: getattr(x, name) for name in x.__dataclass_fields__}
    return replace(x, **{name: v if len(v) == 1 else v[lanes] for name, v in values.items()})


def _most(values: np.ndarray, mask: np.ndarray, bound: np.ndarray | None = None) -> float:
    """The largest of the values where the mask holds, or of their shares of a bound."""
    chosen = values[mask]
    return float((chosen if bound is None else chosen / bound[mask]).max(initial=0.0))


def _shadows(seen: _Comparison) -> tuple[Shadows, np.ndarray]:
    """The shadow rays of both, and the pixels that are near the edge of a shadow."""
    ours, theirs, a = seen.ours, seen.theirs, seen.a
    n = len(a.t)
    dim, counts = np.zeros(n, bool), np.zeros(4, int)
    if not ours.made.scene.settings.shadows:
        return Shadows(0, 0, 0, 0), dim
    p = _points(seen)
    shift = theirs.extents.shift(a.index, seen.b.index)
    ends = list(zip(ours.made.scene.lights.values(), theirs.scene.lights.values()))
    for (light, twin), (reached, cosine) in zip(ends, ours.beams(seen.look)):
        lit = a.hit & ~seen.beyond & (cosine > 0)
        # A surface in single precision is off by the shift, and light that grazes it meets it that much earlier.
        margin = np.where(lit, shift.start(p) / np.where(lit, cosine, 1), 0)
        met = theirs.reaches(p, np.array(twin.position, float) - ours.centre, margin)
        differs = lit & (reached != met)
        wide = shift.where(differs, theirs.extents.largest(n))
        ray_end = np.broadcast_to(np.array(light.position, float) - ours.centre, p.shape)
        # The cosine in Mitsuba may be less than ours, and the margin larger then.
        least = cosine - seen.slack.angle
        longest = wide.start(p) / np.where(least > 0, least, np.inf)
        near = lit & ((least <= 0) | _wavers(seen, ray_end, p, lit, reached, wide, longest))
        dim |= near
        counts += [lit.sum(), (lit & reached).sum(), near.sum(), (differs & ~near).sum()]
    return Shadows(*map(int, counts)), dim


def _points(seen: _Comparison) -> np.ndarray:
    """Where the rays hit, from the centre; the rays' origins where they hit nothing. Shapes: (N, 3)."""
    return seen.rays.o + np.where(seen.a.hit, seen.a.t, 0)[:, None] * seen.rays.direction()


def _wavers(
    seen: _Comparison, light: np.ndarray, p: np.ndarray, lit: np.ndarray, reached: np.ndarray, shift: Shift, margin: Any
) -> np.ndarray:
    """Whether visray's answer changes for a shadow ray moved by Mitsuba's rounding, or ending `margin` before the point."""
    start = shift.start(p)
    distance = np.linalg.norm(light - p, axis=1)
    end = (start + shift.slope() * distance)[:, None]
    toward = (light - p) / np.maximum(distance, np.finfo(float).tiny)[:, None]
    short = p + np.minimum(margin, distance)[:, None] * toward
    changes = seen.ours.clear(seen.look, light, short, lit, arrives=False) != reached
    for e in AXES:
        changes |= seen.ours.clear(seen.look, light + end * e, p + start[:, None] * e, lit) != reached
    return changes


def _pictures(seen: _Comparison, dim: np.ndarray) -> tuple[Pictures, Image]:
    """The pictures of both, compared where neither an edge nor that of a shadow is within rounding."""
    ours, film = seen.ours, seen.ours.made.scene.film
    mine = ours.colours(seen.look)
    shift = seen.theirs.extents.shift(seen.a.index, seen.b.index)
    yours = seen.theirs.colours(seen.rays, seen.si, seen.b, shift)
    compared = ~(seen.slack.edge | seen.beyond | seen.tied | dim)
    difference = (mine - yours)[compared]
    rms, scale = (np.sqrt(np.mean(x**2)) if x.size else 0.0 for x in (difference, mine[compared]))
    found = Pictures(
        len(mine), int(compared.sum()), float(rms / scale if scale else rms), float(np.abs(difference).max(initial=0.0))
    )
    layers = {"RGB": mine - yours, "visray": mine, "mitsuba": yours, "compared": compared[:, None]}
    shape = (film.height, film.width)
    pictures = {name: v.reshape(*shape, -1).squeeze(-1) if v.shape[1] == 1 else v.reshape(*shape, 3) for name, v in layers.items()}
    return found, Image({name: v.astype(np.float32) for name, v in pictures.items()}, {"scene_hash": ours.made.scene.hash()})
