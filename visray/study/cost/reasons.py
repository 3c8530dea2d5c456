"""Why a tuner turns knobs, in sentences."""

from collections.abc import Iterator
from math import sqrt

from visray.study.cost.knobs import SAMPLER, SPP
from visray.study.cost.model import Model
from visray.study.cost.records import Band
from visray.study.cost.scaled import Scaled
from visray.study.cost.tuned import Settings


def reasons(scaled: Scaled, model: Model, new: Settings) -> Iterator[str]:
    """A sentence for each knob that has another value than the scene's, by the model at the scene's own size; one where
    none has."""
    laws, own, noiseless = model.laws, scaled.own, scaled.report.noiseless
    noise = model.error(own) ** 2 - scaled.bias(own)
    both = {a: new[a] for a in (SPP, SAMPLER)}
    if any(own[a] != both[a] for a in both) and not noiseless:
        turned = own | both
        less = (model.error(turned) ** 2 - scaled.bias(turned)) / noise if noise > 0 else 1.0
        time = model.seconds(turned) / model.seconds(own)
        told = [f"{s[SPP]} {s[SAMPLER]}" for s in (own, new)]
        yield f"samples {told[0]} -> {told[1]}: variance x {less:.2g}, time x {time:.2g}"
    for name, addresses in scaled.groups.items():
        old, now = ([s[a] for a in addresses] for s in (own, new))
        if old == now or (set(addresses) <= {SPP, SAMPLER} and not noiseless):
            continue
        count = next((c for c in laws.counts if c.addresses == addresses), None)
        turned = own | {a: new[a] for a in addresses}
        time = model.seconds(turned) / model.seconds(own)
        if count:
            cost = own[SPP] * count.cost * count.count(own) / model.seconds(own)
            scale = laws.samplers[own[SAMPLER]].scale
            part = min(scale * count.part(own) / noise, 1.0) if noise > 0 else 0.0
            yield f"{name} {sum(old)} -> {sum(now)}: they are {cost:.0%} of the time and {part:.0%} of the variance"
        elif addresses == (SPP,) and noiseless:
            yield f"{name} {old[0]} -> {now[0]}: the picture has no noise, one sample does; time x {time:.2g}"
        else:
            left = remains(scaled.left(turned))
            yield f"{name} {old[0]} -> {now[0]}: {left} is left whatever the samples, time x {time:.2g}"
    # Of more than one sample nothing good can be said where there is no noise.
    if new == own and not (noiseless and own[SPP] > 1):
        yield "the scene's own settings: none that were measured are clearly better"
    if noiseless and new[SPP] == own[SPP]:
        yield "the picture has no noise: one sample does"


def remains(left: Band) -> str:
    """What is left, of its square: the estimate, and how much it may be at most, where that is not the same."""
    middle, high = (f"{sqrt(x):.2g}" for x in (left.middle, left.high))
    return middle if middle == high else f"{middle} (at most {high})"
