"""Pixels times passes, to a picture."""

import json
import platform
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import drjit as dr
import numpy as np

from visray import film as films
from visray import images, integrator, llvm, tables
from visray.errors import UserError
from visray.features import Features, features
from visray.output.image import Image
from visray.progress import Bar, Patience
from visray.quantities import BACKENDS, Arrays
from visray.sampling import Plan
from visray.scene.load import checked, load
from visray.scene.scene import Scene, Settings
from visray.version import __version__

# Passes after the first are fitted to this.
PASS_SECONDS = 0.5
# What tells how well the crossings are known that are searched for.
PROOF = ("unresolved", "residual")
DATA_LAYERS = ("Z", "distance", "N", "P", "UV", "albedo", "id", *PROOF)
LAYERS = ("RGB", "A", "variance", *DATA_LAYERS)


@dataclass(frozen=True)
class Set:
    """A scene set up for rendering: its stage, and the pixels in the order of the lanes."""

    scene: Scene
    a: Arrays
    features: Features
    stage: integrator.Stage
    order: np.ndarray
    x: Any
    y: Any


def set_up(
    scene: Scene,
    backend: str = "llvm",
    everything: bool = False,
    plain: bool = False,
    wrt: tuple[str, ...] = (),
    attach: Callable[[tuple[tables.Kinship, ...], tables.Tables], None] | None = None,
    without: tuple[str, ...] = (),
) -> Set:
    """The scene as a kernel sees it. `everything` and `plain` choose the slow twins of features and search; `without`
    names effects that are left out.

    wrt: the addresses that derivatives are taken by; `attach` enables them in the tables, before anything is computed.
    """
    a = arrays(backend, scene.settings.precision)
    width, height = scene.film.width, scene.film.height
    films.check_size(width, height)
    kin, on = tables.kinships(scene), features(scene, wrt, everything, without)
    packed = tables.pack(scene, a)
    if attach is not None:
        attach(kin, packed)
    ready = tables.prepare(packed, kin, (width, height), a, images.pack(a, scene.textures))
    stage = integrator.stage(ready, kin, scene, on, a, plain)
    return Set(scene, a, on, stage, *lanes(a, width, height))


def arrays(backend: str, precision: str) -> Arrays:
    """The array types of a backend, or one line that says why it cannot be had."""
    if backend not in BACKENDS:
        raise UserError(f"backend = {backend!r}: is none of {', '.join(BACKENDS)}")
    if backend == "llvm":
        llvm.require()
    elif not dr.has_backend(getattr(dr.JitBackend, {"cuda": "CUDA", "metal": "Metal"}[backend])):
        raise UserError(f"backend = {backend!r}: this machine has no such device; use --backend llvm")
    return Arrays.of(backend, precision)


def lanes(a: Arrays, width: int, height: int) -> tuple[np.ndarray, Any, Any]:
    """The pixels in the order of the lanes, and their columns and rows."""
    order = films.tiled(width, height)
    y, x = np.divmod(order, width)
    x, y = (a.put(a.U, v.astype(np.uint32)) for v in (x, y))
    dr.eval(x, y)
    return order, x, y


def render(
    scene: Scene | str | Path,
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
) -> Image:
    """The picture of a scene, or of a scene file. Ctrl-C keeps the passes that are done.

    spp, size, seed and precision replace what the scene says. layers: which of LAYERS to make; the data layers cost a
    kernel of their own. The metadata say how the picture was made.
    """
    scene = load(scene, setup) if isinstance(scene, (str, Path)) else scene
    scene = adjusted(scene, spp=spp, size=size, seed=seed, precision=precision)
    layers = wanted(layers)
    if threads is not None:
        set_threads(threads)
    begun = time.perf_counter()
    made = set_up(scene, backend)
    with Patience() as patience:
        film, done = expose(made, progress, patience)
        check_numbers(made, film)
        pictures = _pictures(made, film, done, layers)
    seconds = time.perf_counter() - begun
    proof = _proof(pictures)
    _warn(proof, len(made.order))
    facts = provenance(made, done, seconds) | proof
    return Image(pictures, facts | {"interrupted": int(patience.asked)})


class RootWarning(UserWarning):
    """Double precision does not tell where some rays meet a surface."""


# A residual beyond this many units in the last place is no rounding, nor the blur of a singular point.
LARGEST_RESIDUAL = 1e9


# At edges a few rays are always within rounding; more than this share of them are told.
UNRESOLVED = 1e-3


def _warn(proof: dict[str, Any], pixels: int) -> None:
    """Tells what a certificate cannot certify."""
    advice = "a tighter clip helps, or f written in products and powers"
    if proof.get("unresolved", 0) > UNRESOLVED * pixels:
        text = f"{proof['unresolved']} parts of rays could not be told from rounding; {advice}"
        warnings.warn(text, RootWarning, stacklevel=3)
    if proof.get("residual_ulps", 0) > LARGEST_RESIDUAL:
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


def explain(scene: Scene) -> Features:
    """What is simulated for a scene, what is not, and why."""
    return features(checked(scene))


def set_threads(threads: int) -> None:
    """How many threads the LLVM backend uses."""
    if not isinstance(threads, int) or not 1 <= threads <= 1024:
        raise UserError(f"threads = {threads}: must be a whole number from 1 to 1024")
    dr.set_thread_count(threads)


def expose(made: Set, progress: bool = False, patience: Patience | None = None) -> tuple[films.Film, int]:
    """The film after all samples, and how many it has: fewer than asked for after Ctrl-C, but at least one pass."""
    patience = patience or Patience()
    settings, n = made.scene.settings, len(made.order)
    film, done = films.Film.blank(made.a, n), 0
    passes = -(-settings.spp * n // max(first_pass(made), n))
    count = -(-settings.spp // passes)
    with Bar("rendering", settings.spp, progress) as bar:
        while done < settings.spp and not (done and patience.asked):
            count = min(count, settings.spp - done)
            begun = time.perf_counter()
            film = exposed_once(made, film, settings, done, count)
            done += count
            bar.at(done)
            # The first pass compiles, so it says little about how fast the next will be.
            if done > count:
                count = max(1, round(count * PASS_SECONDS / max(time.perf_counter() - begun, PASS_SECONDS / 64)))
    return film, done


def check_numbers(made: Set, film: films.Film) -> None:
    """Refuses a film with a pixel that is not a number, and names the pixel and the object in it."""
    bad = np.flatnonzero(~np.isfinite(np.array(film.mean)).all(0))
    if not bad.size:
        return
    names = {i + 1: name for i, name in enumerate(made.scene.objects)}
    number = np.broadcast_to(_data(made)["id"], len(made.order))[bad[0]]
    y, x = divmod(int(made.order[bad[0]]), made.scene.film.width)
    what = f"objects.{names[int(number)]}" if number else "nothing"
    more = f", and {bad.size - 1} pixels more" if bad.size > 1 else ""
    raise UserError(f"pixel {x}, {y}, which shows {what}{more}: is not a number; this is an error in visray: report it")


def first_pass(made: Set) -> int:
    """Samples of a first pass over all pixels: a fraction of a second, by the rays of a sample."""
    s = made.stage.scenery
    on, settings = s.features, s.settings
    rays = sum(getattr(light, "samples", 1) for light in made.scene.lights.values())
    rays += settings.occlusion.sky * on["sky occlusion"] + settings.occlusion.near * on["near occlusion"]
    paths = max(settings.scatter.rays * on["scatter"], 1) * 2 if on["paths"] else 0
    trees = any(g.tree is not None for g in s.groups)
    return 2**25 // ((1 + rays) * (1 + paths) * (8 if trees else 1))


def exposed_once(made: Set, film: films.Film, settings: Settings, done: int, count: int) -> films.Film:
    """The film after one more pass."""
    plan = Plan.of(made.a, settings.seed, settings.spp, done, count)
    film = film.plus(made.a, integrator.sample(made.stage, plan, made.x, made.y), done, count)
    dr.eval(film)
    dr.sync_thread()
    return film


def _pictures(made: Set, film: films.Film, done: int, layers: tuple[str, ...]) -> dict[str, np.ndarray]:
    """The layers asked for, as arrays in the order of rows."""
    found = {"RGB": film.mean, "A": film.coverage / done if made.scene.film.transparent else film.coverage * 0 + 1}
    if done > 1:
        found["variance"] = film.squares / (done - 1)
    asked = set(layers) & set(DATA_LAYERS)
    if asked - set(PROOF) or (asked and any(k.kind.searched for k in made.stage.scenery.kin)):
        found |= _data(made)
    return {name: _raster(made, name, found[name]) for name in LAYERS if name in layers and name in found}


def _data(made: Set) -> dict[str, Any]:
    h = integrator.first_hit(made.stage, made.x, made.y)
    dr.eval(h)
    # File order, not the order of the kernel's families; 0 is no object.
    ids = np.zeros(len(made.scene.objects) + 1, np.uint32)
    place = {name: i + 1 for i, name in enumerate(made.scene.objects)}
    ids[:-1] = [place[name] for k in made.stage.scenery.kin for name in k.names]
    number = ids[np.minimum(np.array(h.index), len(ids) - 1)]
    return {
        "Z": h.depth,
        "distance": h.distance,
        "N": h.n,
        "P": h.p,
        "UV": (h.u, h.v),
        "albedo": h.albedo,
        "id": number,
    } | ({} if h.residual is None else {"unresolved": h.unresolved, "residual": h.residual})


def _raster(made: Set, name: str, values: Any) -> np.ndarray:
    """A layer in the order of rows. Shapes: (H, W) or (H, W, channels)."""
    width, height = made.scene.film.width, made.scene.film.height
    if isinstance(values, tuple):
        values = np.stack([np.array(v) for v in values])
    flat = np.array(values)
    flat = flat.T if flat.ndim == 2 else flat
    picture = np.empty(flat.shape, np.uint32 if name in ("id", "unresolved") else np.float32)
    picture[made.order] = flat  # one entry for all pixels where all are alike
    return picture.reshape(height, width, *picture.shape[1:])


def provenance(made: Set, done: int, seconds: float) -> dict[str, Any]:
    """How the picture was made."""
    s = made.scene.settings
    return {
        "scene_hash": made.scene.hash(),
        "seed": s.seed,
        "spp": done,
        "spp_asked": s.spp,
        "precision": s.precision,
        "backend": made.a.backend,
        "features": made.features.names(),
        "objects": json.dumps({name: i + 1 for i, name in enumerate(made.scene.objects)}, ensure_ascii=False),
        "visray": __version__,
        "drjit": dr.__version__,
        "llvm": ".".join(map(str, dr.detail.llvm_version())) if made.a.backend == "llvm" else "",
        "python": platform.python_version(),
        "threads": dr.thread_count(),
        "render_seconds": seconds,
        **camera_matrices(made.scene),
    }


def camera_matrices(scene: Scene) -> dict[str, list[list[float]]]:
    """worldToCamera (x right, y up, z along the view) and worldToNDC (0, 0 top left to 1, 1), for row vectors."""
    c, f = scene.camera, scene.film
    o = np.array(c.origin, float)
    forward = (np.array(c.target, float) - o) / np.linalg.norm(np.array(c.target, float) - o)
    right = np.cross(forward, c.up) / np.linalg.norm(np.cross(forward, c.up))
    to_camera = np.eye(4)
    to_camera[:3, :3] = np.stack([right, np.cross(right, forward), forward], axis=1)
    to_camera[3, :3] = -o @ to_camera[:3, :3]
    half = np.tan(np.radians(c.fov) / 2)
    to_ndc = np.array(
        [[0.5 * f.height / f.width / half, 0, 0, 0], [0, -0.5 / half, 0, 0], [0.5, 0.5, 1, 1], [0, 0, 0, 0]]
    )
    return {"worldToCamera": to_camera.tolist(), "worldToNDC": (to_camera @ to_ndc).tolist()}
