"""How many samples does a soft shadow need? The noise of a penumbra, for numbers of light samples and for samplers."""

import numpy as np

import visray as vr

light = vr.RectangleLight(position=(0, 4, 0), width=(2, 0, 0), height=(0, 0, 2))
scene = vr.Scene(
    camera=vr.Camera(origin=(0, 6, 4), fov=30.0),
    film=vr.Film(width=64, height=64),
    lights={"lamp": light},
    objects={"floor": vr.Plane(), "ball": vr.Sphere(center=(0, 1.5, 0), radius=0.7)},
    settings=vr.Settings(spp=1),
)


def picture(samples: int, seed: int, sampler: str) -> np.ndarray:
    made = vr.replaced(vr.replaced(scene, "lights.lamp.samples", samples), "settings.sampler", sampler)
    return vr.render(made, seed=seed, layers=("RGB",), progress=False)["RGB"]


for sampler in ("independent", "stratified", "sobol"):
    # The difference of two pictures with different seeds contains the noise of both: twice the variance of one.
    noise = {n: np.std(picture(n, 1, sampler) - picture(n, 2, sampler)) / np.sqrt(2) for n in (1, 4, 16, 64)}
    print(f"{sampler:12}", "  ".join(f"{n:2} samples {x:.4f}" for n, x in noise.items()))
