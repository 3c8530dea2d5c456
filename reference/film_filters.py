"""The error of each filter of pixels with few samples: against a picture of the same filter with very many samples.

    python reference/film_filters.py -o reference/film_filters.json

The scene is the matte scene of reference/bench_mitsuba.py, 128 x 128 pixels. The error is the root mean square over
pixels and channels, divided by the mean luminance, of SEEDS pictures. It depends on no clock.
"""

import visray as vr  # isort: skip - first, because it chooses the LLVM that Dr.Jit and Mitsuba load
import numpy as np
from bench_mitsuba import ours, ring
from machine import machine
from report import report_parser, write_report

from visray import filters
from visray.output.curves import LUMINANCE
from visray.scene.adjusted import adjusted

SIZE, SPP, TRUE_SPP, SEEDS = (128, 128), 16, 4096, 4
SAMPLERS = ("stratified", "sobol", "independent")


def picture(scene: vr.Scene, **settings: object) -> np.ndarray:
    """The colour of a scene with other settings, in double. Shape: (H, W, 3)."""
    made = adjusted(scene, size=SIZE, **settings)
    return vr.render(made, layers="RGB", progress=False)["RGB"].astype(float)


def errors(kind: type) -> dict[str, float]:
    """The error of a filter with its usual numbers, by sampler."""
    scene = vr.replaced(ours(ring(), SPP), "film.filter", kind.type)
    true = picture(scene, spp=TRUE_SPP, sampler="sobol", seed=1000)
    light = float((true @ LUMINANCE).mean())

    def error(sampler: str) -> float:
        squares = [np.square(picture(scene, spp=SPP, sampler=sampler, seed=s) - true).mean() for s in range(SEEDS)]
        return float(np.sqrt(np.mean(squares)) / light)

    return {sampler: error(sampler) for sampler in SAMPLERS}


if __name__ == "__main__":
    options = report_parser(__doc__).parse_args()
    found = {kind.type: errors(kind) for kind in filters.KINDS}
    facts = {"size": SIZE, "spp": SPP, "true_spp": TRUE_SPP, "seeds": SEEDS, "errors": found}
    write_report(machine() | facts, options.output)
