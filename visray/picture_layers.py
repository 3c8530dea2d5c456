"""The layers of a rendered picture: from a film and from the first hit to arrays of pixels.

A lane is one pixel in the arrays of a kernel. The order of lanes is not the order of pixels in a picture
(Prepared.order).
"""

import warnings
from typing import Any

import drjit as dr
import numpy as np

from visray import film as films
from visray import integrator
from visray.data.all_objects import address_of
from visray.errors import LegendWarning, StoppedWarning, UserError
from visray.legend.layer import drawn_legend
from visray.motion_vectors import forward, has_motion
from visray.output.curves import LUMINANCE
from visray.output.layers import BY_NAME, NAMES, names_from
from visray.setup import Prepared


def check_numbers(prepared: Prepared, mean: np.ndarray) -> None:
    """Raises a UserError if a colour is not finite. The message names the pixel and the object that the pixel shows.

    mean: colours of the pixels, in the order of lanes.

    Shapes: mean (3, N).
    """
    bad = np.flatnonzero(~np.isfinite(mean).all(0))
    if not bad.size:
        return
    names = {i + 1: name for i, name in enumerate(prepared.scene.all_objects)}
    number = np.broadcast_to(np.array(_first_hit(prepared)["id"]), len(prepared.order))[bad[0]]
    x, y = (int(np.array(v)[bad[0]]) for v in (prepared.x, prepared.y))
    what = address_of(names[int(number)]) if number else "nothing"
    more = f", and {bad.size - 1} pixels more" if bad.size > 1 else ""
    raise UserError(f"pixel {x}, {y}, which shows {what}{more}: is not a number; this is an error in visray: report it")


def developed(prepared: Prepared, film: films.Film) -> tuple[dict[str, Any], dict[str, Any]]:
    """The layers of a film by name (colour, coverage, variance), and a dict of facts about the error.

    The fact `error_at_most` is the error that independent samples would have. With other samplers the error is smaller.
    It is left out if these spread the negative weights of a filter evenly: it would be about ten times the error.
    After Ctrl-C, pixels may have no sample; they are transparent.
    """
    present = film.counts > 0
    layers = {"RGB": np.array(film.mean), "A": alpha_of(prepared, film)}
    if not present.all():
        text = f"stopped when {present.sum():,} of {present.size:,} pixels had a sample; the others are transparent"
        warnings.warn(text, StoppedWarning, stacklevel=5)
    if film.counts.min() <= 1:
        return layers, {}
    layers["variance"] = np.array(film.squares) / (film.counts - 1)
    luminance = float((LUMINANCE @ layers["RGB"]).mean())
    places, sampler = prepared.kernel.filter, prepared.scene.settings.sampler
    if luminance <= 0 or (places is not None and places.is_signed and sampler != "independent"):
        return layers, {}
    square = float((layers["variance"] / film.counts).mean())
    return layers, {"error_at_most": float(np.sqrt(square) / luminance)}


def alpha_of(prepared: Prepared, film: films.Film) -> np.ndarray:
    """The coverage (alpha) of the pixels of a film. Pixels without a sample are transparent."""
    if prepared.scene.film.transparent:
        return np.array(film.coverage) / np.maximum(film.counts, 1)
    return (film.counts > 0).astype(float)


def first_hit_layers(prepared: Prepared, layers: tuple[str, ...]) -> dict[str, Any]:
    """Dict of the layers of the first hit by name, of the certificate, and of the motion vectors. It is empty if no
    layer in `layers` is one of these."""
    needed = set(layers) & set(names_from("first hit"))
    moves = has_motion(layers) and prepared.after is not None
    if set(layers) & set(names_from("certificate")) and any(b.kind.finds_roots for b in prepared.kernel.batches):
        needed.add("certificate")
    found = _first_hit(prepared) if needed or moves else {}
    return found | {"forward": forward(prepared, found)} if moves else found


def _first_hit(prepared: Prepared) -> dict[str, Any]:
    """Dict of the layers of the first hit along the ray through each pixel's centre. Their arrays are evaluated."""
    layers = integrator.first_hit(prepared.kernel, prepared.x, prepared.y)
    dr.eval(layers)
    return layers


def rasters(prepared: Prepared, values: dict[str, Any], layers: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Dict of layers as pictures, by name.

    values: layers by name, with pixels in the order of lanes.
    layers: names of the layers that are wanted. Those without values are left out.
    """
    return {name: _raster(prepared, name, values[name]) for name in NAMES if name in layers and name in values}


def overlay(prepared: Prepared, values: dict[str, Any], layers: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Dict of the layer legend as a picture, if it is wanted. Notes about it become warnings.

    values, layers: as in `rasters`.
    """
    if not set(layers) & set(names_from("overlay")):
        return {}
    opaque = {"A": np.ones(len(prepared.order))}
    rgb, alpha = (_raster(prepared, name, (opaque | values)[name]) for name in ("RGB", "A"))
    picture = drawn_legend(prepared.scene, rgb, alpha)
    for note in picture.notes:
        warnings.warn(note, LegendWarning, stacklevel=4)
    return {"legend": picture.pixels}


def _raster(prepared: Prepared, name: str, values: Any) -> np.ndarray:
    """One layer as a picture.

    name: name of the layer.
    values: values of the layer, with pixels in the order of lanes.

    Shapes: values (N,) or (n, N); result (H, W) or (H, W, n).
    """
    width, height = prepared.scene.film.raster
    if isinstance(values, tuple):
        values = np.stack([np.array(v) for v in values])
    flat = np.array(values)
    flat = flat.T if flat.ndim == 2 else flat
    picture = np.empty(flat.shape, BY_NAME[name].memory_dtype)
    picture[prepared.order] = flat  # if all pixels are equal, `flat` may have a single entry for all of them
    return picture.reshape(height, width, *picture.shape[1:])
