"""Direct light with derivatives: one loop over all samples of all lights.

The kernel contains the code of a light once for each kind of light, and the code of a shadow ray once. So it does not
grow with the number of lights or samples. All shadow rays run from the surface to the light.

In a coloured shadow, the transmittance T is a product of a factor for each row that the shadow ray meets, and its
derivative is a sum over these rows: dT = sum of (derivative of the factor) x (product of all other factors). The loop
runs over samples and, for each of them, over rows. The products are found without derivatives when a sample begins.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr

from visray.accel.intersect import Target, TintProduct, occluded, tint_of_row, tint_product
from visray.accel.tint import Tint
from visray.direct import DIMENSION, LightSample, rounding_of_point, to_area, to_far, to_point
from visray.interaction import Interaction
from visray.kernel_scene import KernelScene
from visray.prepared_lights import LightSteps
from visray.pytree import leaves, rebuilt, rows
from visray.sampling import SampleSet


@dataclass(frozen=True)
class LightColours:
    """The numbers of a light that reflection reads."""

    intensity: Any
    Id: Any
    Is: Any


def direct(s: KernelScene, si: Interaction, reflected: Callable) -> Any:
    """Light from all lights that a surface point reflects, a colour. Arguments are those of direct.direct."""
    colour = dr.zeros(s.a.V, dr.width(si.surface.p))
    for steps in s.light_steps:
        colour = colour + _steps(s, si, steps, reflected)
    return colour


def _steps(s: KernelScene, si: Interaction, steps: LightSteps, reflected: Callable) -> Any:
    """The light of some lights that a surface point reflects."""
    a, n, coloured = s.a, dr.width(si.surface.p), s.features["coloured shadows"]
    zeros = dr.zeros(a.U, n)

    def step(i: Any, row: Any, product: Any, dark: Any, total: Any) -> tuple:
        colours, sample, ray, target = _sample(s, si, steps, i)
        if not s.features["shadows"]:
            return i + 1, row, product, dark, total + reflected(s, si, colours, sample)
        arrives = dr.detach(sample.arrives)
        if not coloured:
            hidden = occluded(si.origin, ray, target, arrives, s.brute_force)
            lit = LightSample(sample.l, sample.cosine, sample.arrives & ~hidden, sample.weight)
            return i + 1, row, product, dark, total + reflected(s, si, colours, lit)
        tints, first = tuple(map(Tint.of, s.batches)), row == 0
        new = tint_product(si.origin, ray, target, arrives & first, tints, s.brute_force)
        tint = TintProduct(*(dr.select(first, x, y) for x, y in ((new.product, product), (new.zeros, dark))))
        transmittance = dr.select(first, tint.whole(), 0) + _change(s, si, ray, target, arrives, tints, tint, row)
        lit = LightSample(sample.l, sample.cosine, sample.arrives, sample.weight, transmittance)
        total = total + reflected(s, si, colours, lit)
        last = row + 1 >= s.most_rows
        return dr.select(last, i + 1, i), dr.select(last, 0, row + 1), tint.product, tint.zeros, total

    black = dr.zeros(a.V, n)
    row, product, dark = (zeros, dr.full(a.V, 1, n), black) if coloured else (None, None, None)
    more = lambda i, *_: (i < steps.count) & si.hit.valid  # noqa: E731 - the condition
    start = dr.zeros(a.U, n), row, product, dark, black
    return dr.while_loop(start, more, step, label="light samples", max_iterations=-1)[-1]


def _change(
    s: KernelScene, si: Interaction, ray: Any, target: Target, arrives: Any, tints: tuple, tint: TintProduct, row: Any
) -> Any:
    """0, with the derivatives of the transmittance that it has from one row of each batch.

    row: number of the row in its batch, one for each lane
    """
    change = s.a.V(0)
    for number, batch in enumerate(s.batches):
        present = row < len(batch)
        at = dr.select(present, row, 0)
        hit, factor = tint_of_row(si.origin, ray, target, arrives & present, tints, number, at)
        fixed = dr.detach(factor)
        change = change + dr.select(hit, (factor - fixed) * tint.without(fixed), 0)
    return change


def _sample(s: KernelScene, si: Interaction, steps: LightSteps, i: Any) -> tuple:
    """Sample i of the lights: (colours of the light, light sample without shadows, shadow ray, its target)."""
    kind, row, j, salt, number = (
        dr.gather(s.a.U, x, i) for x in (steps.batch, steps.row, steps.j, steps.salt, steps.number)
    )
    points, share = rows((steps.points, steps.share), i)
    state: tuple | None = None
    for k, batch in enumerate(steps.batches):
        light = rows(batch.table, dr.select(kind == k, row, 0))
        new = _connection(s, si, batch.kind, light, j, points, salt, number)
        state = new if state is None else rebuilt(state, tuple(
            dr.select(kind == k, x, y) for x, y in zip(leaves(new), leaves(state))
        ))  # fmt: skip
    colours, l, cosine, arrives, weight, to_light, slope, distance, error = state
    sample, zeros = LightSample(l, cosine, arrives, weight * share), dr.zeros(s.a.F, dr.width(si.surface.p))
    target = Target(distance + zeros, error + zeros, may_touch=steps.batches[0].kind.has_position)
    return colours, sample, si.spawn_ray(to_light, slope), target


def _connection(
    s: KernelScene, si: Interaction, kind: type, light: Any, j: Any, points: SampleSet, salt: Any, number: Any
) -> tuple:
    """A light of one kind, seen from a surface point: (colours; l, cosine, mask and weight of the light sample;
    direction, cosine, length and error of the shadow ray).

    light: numbers of the light
    j: number of the sample among `points`
    salt, number: what determines the random numbers of the light
    """
    a, extent = s.a, 0
    if not kind.has_position:
        c, _ = to_far(s, si, light)
    elif not kind.has_area:
        c, _, _ = to_point(s, si, light, kind)
    else:
        to_centre, dimension = a.V(light.position - si.surface.p), si.sample.derived(salt).dimension(DIMENSION + number)
        centre = None if s.settings.area == "samples" else to_area(s, si, light, to_centre, None).sample
        to_light = to_centre + light.point_offset(a.V, *dimension.set_point(j, points))
        c, extent = to_area(s, si, light, to_light, centre), a.F(light.radius_bound())
    sample, distance = c.sample, a.F(c.distance)
    error = rounding_of_point(s, light, distance, extent) if kind.has_position else a.F(0)
    weight = a.F(1) if sample.weight is None else sample.weight
    colours = LightColours(light.intensity, light.Id, light.Is)
    return colours, sample.l, sample.cosine, sample.arrives, weight, c.l, c.cosine, distance, error
