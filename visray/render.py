"""Pixels times passes, to a picture."""

import json
import platform
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import drjit as dr
import numpy as np

from visray import clock, integrator
from visray import film as films
from visray.adaptive.error_floor import Files
from visray.adaptive.loop import NoNumber, render_adaptively
from visray.adaptive.stopping import Goal
from visray.errors import GoalWarning, UserError
from visray.features import Features, features
from visray.kernel_scene import ray_families
from visray.output.curves import LUMINANCE
from visray.output.image import Image, check_destination
from visray.passes import expose
from visray.primitives.primitive import scalars
from visray.progress import Interrupts
from visray.scene.load import checked, load
from visray.scene.scene import Scene
from visray.setup import Prepared
from visray.setup import prepare as prepare_checked
from visray.version import __version__

# What tells how well the crossings are known that are searched for.
PROOF = ("unresolved", "residual")
DATA_LAYERS = ("Z", "distance", "N", "P", "UV", "albedo", "id", *PROOF)
# What a picture made to an error, or in a time, has besides.
ADAPTIVE_LAYERS = ("error", "samples")
LAYERS = ("RGB", "A", "variance", *ADAPTIVE_LAYERS, *DATA_LAYERS)
ANYWHERE = Files()
# Seconds a pixel that layers take to be put together at the end, and files to be written: of an EXR file each channel.
LAYERING, PNG, CHANNEL = 6e-7, 4e-7, 3e-8


def render(
    scene: Scene | Prepared | str | Path,
    *,
    setup: str | Path | None = None,
    spp: int | None = None,
    size: tuple[int, int] | None = None,
    seed: int | None = None,
    precision: str | None = None,
    threads: int | None = None,
    backend: str = "llvm",
    layers: Sequence[str] = LAYERS,
    progress: bool = True,
    error: float | None = None,
    time: float | None = None,
    files: Files = ANYWHERE,
    begun: float | None = None,
) -> Image:
    """The picture of a scene, of a prepared one, or of a scene file. Ctrl-C keeps the passes that are done.

    A prepared scene (vr.prepare) is looked at again and again: `prepared.updated` pays only for what changes.

    spp, size, seed and precision replace what the scene says. layers: which of LAYERS to make; the data layers cost a
    kernel of their own. The metadata say how the picture was made.

    error: instead of spp, samples until the error is no larger, with a chance of 95 %: the root of the mean square over
    pixels and channels, in linear light, over the picture's mean luminance. time: the best picture in so many seconds,
    with all that is to be set up and compiled. Of both, what comes first. More samples go where there is more noise,
    without bias (adaptive.py). files: what the picture is for; an error below their rounding is refused, and there is
    `time` to write them. begun: from when the time counts (clock.now), else from now.
    """
    now = clock.now()
    goal, layers = Goal.asked(error, time, spp, now if begun is None else begun), wanted(layers)
    if goal is None and (lone := set(layers) & set(ADAPTIVE_LAYERS)) and tuple(layers) != LAYERS:
        raise UserError(f"layers = {', '.join(sorted(lone))}: only a picture to an error or in a time has that")
    for path in files.paths:
        check_destination(path, files.gamma, files.exposure)
    scene = load(scene, setup) if isinstance(scene, (str, Path)) else scene
    ready = scene if isinstance(scene, Prepared) else None
    if ready and backend not in ("llvm", ready.a.backend):
        raise UserError(f"backend = {backend!r}: the scene is prepared for {ready.a.backend}; prepare it for the other")
    scene = adjusted(ready.scene if ready else scene, spp=spp, size=size, seed=seed, precision=precision)
    named = scene.hash()
    if goal:
        goal = replace(goal, reserve=_at_the_end(scene.film.width * scene.film.height, layers, files))
        # Strata need the number of samples beforehand.
        scene = adjusted(scene, sampler="sobol") if scene.settings.sampler == "stratified" else scene
    if threads is not None:
        set_threads(threads)
    prepared = ready.adjusted(scene) if ready else prepare_checked(scene, backend)
    with Interrupts() as interrupts:
        if goal:
            # First, as its kernel takes time too.
            data = _data_layers(prepared, layers)
            try:
                found = render_adaptively(prepared, goal, files, layers, progress, interrupts)
            except NoNumber as none:
                check_numbers(prepared, none.mean)
                raise
            colours, done, more = found.layers, 0, found.facts
        else:
            film, done = expose(prepared, progress, interrupts)
            colours, more = developed(prepared, film)
            # A film of many pixels takes much memory, which the data layers may need.
            del film
            data = _data_layers(prepared, layers)
        check_numbers(prepared, colours["RGB"])
    if goal and not colours["RGB"].any():
        warnings.warn("no sample met any light: nothing is known of the error", GoalWarning, stacklevel=2)
    elif goal and not (goal.seconds or interrupts.asked) and more["error_high"] > error:
        text = f"the error asked for, {error:g}, is not reached with {more['spp_most']} samples of a pixel"
        warnings.warn(text, GoalWarning, stacklevel=2)
    pictures = rasters(prepared, colours | data, layers)
    proof = _proof(pictures)
    _warn(proof, prepared)
    facts = provenance(prepared, named, done, clock.now() - now) | more | proof
    if goal:
        del facts["spp_asked"]
    return Image(pictures, facts | {"interrupted": int(interrupts.asked)})


class RootWarning(UserWarning):
    """Double precision does not tell where some rays meet a surface."""


# A residual beyond this many units in the last place is no rounding, nor the blur of a singular point.
LARGEST_RESIDUAL = 1e9


# At edges a few rays are always within rounding; more than this share of them are told.
UNRESOLVED = 1e-3


def _warn(proof: dict[str, Any], prepared: Prepared) -> None:
    """Tells what a certificate cannot certify."""
    pixels = len(prepared.order)
    advice = "a tighter clip helps, or f written in products and powers"
    if proof.get("unresolved", 0) > UNRESOLVED * pixels:
        text = f"{proof['unresolved']} parts of rays could not be told from rounding; {advice}"
        warnings.warn(text, RootWarning, stacklevel=3)
    if proof.get("residual_ulps", 0) <= LARGEST_RESIDUAL:
        return
    if not any(getattr(thing, "tolerance", 0) for thing in prepared.scene.objects.values()):
        text = f"what is seen is up to {proof['residual_ulps']:.2g} ulp off its surface; {advice}"
        warnings.warn(text, RootWarning, stacklevel=3)


def _proof(pictures: dict[str, np.ndarray]) -> dict[str, Any]:
    """The sums of the certificate: how many parts of rays are unresolved, and the largest residual in ulps."""
    found = {}
    if "unresolved" in pictures:
        found["unresolved"] = int(pictures["unresolved"].sum())
    if "residual" in pictures:
        # JSON has no infinity.
        found["residual_ulps"] = min(float(pictures["residual"].max()), float(np.finfo(np.float32).max))
    return found


def _at_the_end(pixels: int, layers: tuple[str, ...], files: Files) -> float:
    """Seconds that are needed when all samples are taken."""
    channels = sum(3 if name in ("RGB", "variance", "error", "N", "P", "albedo") else 1 for name in layers)
    each = [PNG if Path(p).suffix.lower() == ".png" else CHANNEL * channels for p in files.paths]
    return (LAYERING + sum(each)) * pixels


def adjusted(scene: Scene, *, size: tuple[int, int] | None = None, **settings: Any) -> Scene:
    """The scene, checked, with another size or other settings where they are not None."""
    scene = checked(scene)
    changed = {k: v for k, v in settings.items() if v is not None}
    if changed:
        scene = replace(scene, settings=replace(scene.settings, **changed))
    if size is not None:
        if len(size) != 2:
            raise UserError(f"size = {size!r}: must be a width and a height, such as (640, 480)")
        scene = replace(scene, film=replace(scene.film, width=size[0], height=size[1]))
    return checked(scene) if changed or size is not None else scene


def wanted(layers: Sequence[str]) -> tuple[str, ...]:
    """The layers, if all of them are of LAYERS."""
    layers = (layers,) if isinstance(layers, str) else tuple(layers)
    for name in layers:
        if name not in LAYERS:
            raise UserError(f"layers = {name!r}: there is no such layer; choose from {', '.join(LAYERS)}")
    return layers


def prepare(scene: Scene | str | Path, backend: str = "llvm") -> Prepared:
    """A scene, or that of a file, checked, packed and placed, to be rendered again and again:

    prepared = vr.prepare(scene)
    for x in (0.0, 0.1, 0.2):
        prepared = prepared.updated({"objects.ball.center.0": x})
        image = vr.render(prepared)
    """
    return prepare_checked(checked(load(scene) if isinstance(scene, (str, Path)) else scene), backend)


def explain(scene: Scene) -> Features:
    """What is simulated for a scene, what is not, and why; and how its rays find what they hit."""
    scene = checked(scene)
    on = features(scene)
    return replace(on, rays=ray_families(scene, on))


def set_threads(threads: int) -> None:
    """How many threads the LLVM backend uses."""
    if not isinstance(threads, int) or not 1 <= threads <= 1024:
        raise UserError(f"threads = {threads}: must be a whole number from 1 to 1024")
    dr.set_thread_count(threads)


def check_numbers(prepared: Prepared, mean: np.ndarray) -> None:
    """Refuses a picture with a pixel that is not a number, and names the pixel and the object in it."""
    bad = np.flatnonzero(~np.isfinite(mean).all(0))
    if not bad.size:
        return
    names = {i + 1: name for i, name in enumerate(prepared.scene.objects)}
    number = np.broadcast_to(_data(prepared)["id"], len(prepared.order))[bad[0]]
    y, x = divmod(int(prepared.order[bad[0]]), prepared.scene.film.width)
    what = f"objects.{names[int(number)]}" if number else "nothing"
    more = f", and {bad.size - 1} pixels more" if bad.size > 1 else ""
    raise UserError(f"pixel {x}, {y}, which shows {what}{more}: is not a number; this is an error in visray: report it")


def developed(prepared: Prepared, film: films.Film) -> tuple[dict[str, Any], dict[str, Any]]:
    """Colour, coverage and variance of a film, and what it tells of its error: no more than that of independent
    samples."""
    transparent = prepared.scene.film.transparent
    found = {"RGB": np.array(film.mean)}
    found |= {"A": np.array(film.coverage) / film.counts if transparent else np.ones(len(prepared.order))}
    if film.counts.min() == 1:
        return found, {}
    found["variance"] = np.array(film.squares) / (film.counts - 1)
    luminance = float((LUMINANCE @ found["RGB"]).mean())
    if luminance <= 0:
        return found, {}
    square = float((found["variance"] / film.counts).mean())
    return found, {"error_at_most": float(np.sqrt(square) / luminance)}


def _data_layers(prepared: Prepared, layers: tuple[str, ...]) -> dict[str, Any]:
    """The data layers, if any are asked for."""
    asked = set(layers) & set(DATA_LAYERS)
    if asked - set(PROOF) or (asked and any(b.kind.searched for b in prepared.kernel.batches)):
        return _data(prepared)
    return {}


def _data(prepared: Prepared) -> dict[str, Any]:
    h = integrator.first_hit(prepared.kernel, prepared.x, prepared.y)
    dr.eval(h)
    # 0 is no object, which NO_ROW + 1 is as well.
    number = np.array(h.object) + np.uint32(1)
    return {
        "Z": h.depth,
        "distance": h.distance,
        "N": h.n,
        "P": h.p,
        "UV": (h.u, h.v),
        "albedo": h.albedo,
        "id": number,
    } | ({} if h.residual is None else {"unresolved": h.unresolved, "residual": h.residual})


def rasters(prepared: Prepared, found: dict[str, Any], layers: tuple[str, ...]) -> dict[str, np.ndarray]:
    """The layers asked for, of those in the order of lanes that were found, in the order of rows."""
    return {name: _raster(prepared, name, found[name]) for name in LAYERS if name in layers and name in found}


def _raster(prepared: Prepared, name: str, values: Any) -> np.ndarray:
    """A layer in the order of rows. Shapes: (H, W) or (H, W, channels)."""
    width, height = prepared.scene.film.width, prepared.scene.film.height
    if isinstance(values, tuple):
        values = np.stack([np.array(v) for v in values])
    flat = np.array(values)
    flat = flat.T if flat.ndim == 2 else flat
    picture = np.empty(flat.shape, np.uint32 if name in ("id", "unresolved", "samples") else np.float32)
    picture[prepared.order] = flat  # one entry for all pixels where all are alike
    return picture.reshape(height, width, *picture.shape[1:])


def provenance(prepared: Prepared, named: str, done: int, seconds: float) -> dict[str, Any]:
    """How the picture was made; `named`: the hash of the scene as it was asked for."""
    s = prepared.scene.settings
    return {
        "scene_hash": named,
        "seed": s.seed,
        "sampler": s.sampler,
        "spp": done,
        "spp_asked": s.spp,
        "precision": s.precision,
        "backend": prepared.a.backend,
        "features": prepared.features.names(),
        "objects": json.dumps({name: i + 1 for i, name in enumerate(prepared.scene.objects)}, ensure_ascii=False),
        "visray": __version__,
        "drjit": dr.__version__,
        "llvm": ".".join(map(str, dr.detail.llvm_version())) if prepared.a.backend == "llvm" else "",
        "python": platform.python_version(),
        "threads": dr.thread_count(),
        "render_seconds": seconds,
        **camera_matrices(prepared.scene),
    }


def camera_matrices(scene: Scene) -> dict[str, list[list[float]]]:
    """worldToCamera (x right, y up, z along the view) and worldToNDC (0, 0 top left to 1, 1), for row vectors."""
    c, f = scene.camera, scene.film
    right, up, forward, _ = (np.array(v, float) for v in scalars(c).axes())
    o = np.array(c.origin, float)
    to_camera = np.eye(4)
    to_camera[:3, :3] = np.stack([right, up, forward], axis=1)
    to_camera[3, :3] = -o @ to_camera[:3, :3]
    half = np.tan(np.radians(c.fov) / 2)
    to_ndc = np.array(
        [[0.5 * f.height / f.width / half, 0, 0, 0], [0, -0.5 / half, 0, 0], [0.5, 0.5, 1, 1], [0, 0, 0, 0]]
    )
    return {"worldToCamera": to_camera.tolist(), "worldToNDC": (to_camera @ to_ndc).tolist()}
