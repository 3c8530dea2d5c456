"""Which glass is it? Finds the index of refraction of a ball in a picture, by the derivative of the picture."""

import numpy as np

import visray as vr

true, guess = 1.5, 1.35
scene = vr.Scene(
    camera=vr.Camera(origin=(0, 0, 5), fov=16.0),
    film=vr.Film(width=32, height=32),
    background=vr.SkyGradient(top=(0.1, 0.2, 0.9), bottom=(1.0, 0.6, 0.2)),
    materials={"glass": vr.Material(kt=(0.9, 0.9, 0.9), ior=true)},
    objects={"ball": vr.Sphere(radius=1.0, material="glass")},
    settings=vr.Settings(spp=4),
    lights={},
)
photograph = vr.render(scene, layers=("RGB",), progress=False)["RGB"]

ior = guess
for step in range(6):
    now = vr.replaced(scene, "materials.glass.ior", ior)
    error = vr.render(now, layers=("RGB",), progress=False)["RGB"] - photograph
    slope = vr.derivative(now, "materials.glass.ior")
    # The Gauss-Newton step: it would be exact if the picture were a linear function of the index.
    ior -= float((error * slope).sum() / (slope**2).sum())
    print(f"step {step + 1}: ior = {ior:.6f}, error of the picture {np.abs(error).max():.1e}")
assert abs(ior - true) < 1e-3
