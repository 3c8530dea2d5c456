"""Derivatives of a picture by finite differences: the slow reference for derivatives (gradients.py)."""

import warnings
from math import inf, prod

import numpy as np

from visray.animation.moment import still_at
from visray.arguments import checked_arguments, shown
from visray.edges import EdgeWarning
from visray.errors import UserError
from visray.number_table import NumberTable
from visray.passes import expose
from visray.scene import address as addresses
from visray.scene.adjusted import adjusted
from visray.scene.edits import canonical
from visray.scene.scene import Scene
from visray.setup import prepare

# With larger steps, differences are meant to contain what moving edges add.
SMALL_STEP = 1e-4
# Weights of pictures at multiples of the step, on both sides of a value and on one side only. Differences with these
# weights are exact for quadratic functions.
CENTRAL, UPWARDS, DOWNWARDS = {1: 0.5, -1: -0.5}, {0: -1.5, 1: 2, 2: -0.5}, {0: 1.5, -1: -2, -2: 0.5}


@checked_arguments
def difference(scene: Scene, address: str, step: float = 1e-6, *, spp: int | None = None) -> np.ndarray:
    """Derivative of every pixel by central differences in double precision, with the same samples in all pictures: a
    slow reference for `derivative`. Shapes: (H, W, 3).

    step: change of the number up and down; it is multiplied by the number's absolute value if this value is larger than
        1
    Error: step^2 / 6 times the third derivative, and about 1e-16 / step of rounding. If the number is at the end of the
        range of its values, such as a colour of 0, the differences are those on one side, with an error of step^2 / 3
        times the third derivative.

    Unlike `derivative`, the result contains what moving edges add. With a small step that is rare and huge: there is an
    EdgeWarning if pixels jump.
    """
    if isinstance(step, bool) or not isinstance(step, (int, float)) or not 0 < step < inf:
        raise UserError(f"step = {shown(step)}: must be a finite number above 0, such as 1e-6")
    if address in ("film", "film.scale"):
        raise UserError(
            f"{address}: decides how many pixels there are, so the pictures cannot be subtracted; name another"
        )
    scene = still_at(adjusted(scene, precision="double", spp=spp), None)
    value = addresses.value(scene, address)
    kd = canonical(address)
    if kd != address and addresses.value(scene, kd.partition(".kd")[0]).ka is not None:
        raise UserError(f"{address}: has no derivative, as it also sets ka, which is written here; name kd")
    address = kd
    if value is None:
        raise UserError(f"{address}: is null, so that there is no number of its own to change")
    value = np.array(value.values if isinstance(value, NumberTable) else value, float)
    step_size = step * max(1.0, float(np.max(np.abs(value))))

    def scenes(weights: dict[int, float]) -> list[tuple[float, Scene]]:
        moved = {k: value + k * step_size for k in weights}
        values = {k: float(v) if v.ndim == 0 else tuple(v) if v.ndim == 1 else v for k, v in moved.items()}
        return [(weight, addresses.replaced(scene, address, values[k])) for k, weight in weights.items()]

    try:
        terms = scenes(CENTRAL)
    except UserError as error:
        for one_sided in (UPWARDS, DOWNWARDS):
            try:
                terms = scenes(one_sided)
                break
            except UserError:
                continue
        else:
            raise error from None
    total, bright = np.zeros((prod(scene.film.raster), 3)), 0.0
    for weight, moved in terms:
        prepared = prepare(moved)
        picture = np.array(expose(prepared)[0].mean, float).T
        total[prepared.order] += weight * picture
        bright = max(bright, float(np.abs(picture).mean()))
    _warn_of_jumps(address, step, np.abs(total).max(axis=1), step_size, bright)
    return (total / step_size).reshape(*scene.film.raster[::-1], 3)


def _warn_of_jumps(address: str, step: float, change: np.ndarray, step_size: float, bright: float) -> None:
    """Warns if pixels jump although the step is small: a sample crosses an edge there, and the difference is its jump
    divided by the step.

    step, step_size: the step as it was given, and the change of the number
    change: largest change of each pixel's colour. Shapes: (N)
    bright: mean of the picture
    """
    # A smooth pixel changes in proportion to the step. More than its root means a derivative of over 1000 of the
    # picture's mean for the default step.
    jumps = change > np.sqrt(step_size) * bright
    if step > SMALL_STEP or not jumps.any():
        return
    size = (
        f"{jumps.sum()} of {len(change)} pixels change by up to {change.max():.2g} although it changes by {step_size:g}"
    )
    advice = "their samples cross edges, and the result there is no derivative; take a larger step, such as step=0.01"
    warnings.warn(f"{address}: {size}: {advice}", EdgeWarning, stacklevel=4)
