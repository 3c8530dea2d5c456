"""Which diffuse colour does the ball in a picture have? Gradient descent on the squared difference finds it."""

import visray as vr  # isort: skip - first, because it chooses the LLVM that Dr.Jit loads
import drjit as dr
import numpy as np

ball = vr.Sphere(radius=1.0, material="paint")
camera = vr.Camera(origin=(0.0, 0.0, 4.0), fov=24.0)
lamp = vr.PointLight(position=(3.0, 4.0, 5.0), intensity=0.8)
secret = vr.Material(kd=(0.7, 0.3, 0.15), ks=(0.4, 0.4, 0.4), shininess=20.0)
scene = vr.Scene(
    camera=camera, film=vr.Film(width=48, height=48), materials={"paint": secret}, lights={"lamp": lamp},
    objects={"ball": ball}, settings=vr.Settings(spp=4, precision="double"),
)  # fmt: skip
target = vr.render(scene)["RGB"].reshape(-1, 3).T.astype(float)

guess = vr.replaced(scene, "materials.paint.kd", (0.4, 0.4, 0.4))
for _ in range(60):
    loss = lambda rgb: dr.mean(dr.squared_norm(rgb - type(rgb)(target)))  # noqa: E731 - short is clear here
    slope = vr.gradient(guess, ["materials.paint.kd"], loss)["materials.paint.kd"]
    kd = np.clip(np.array(vr.value(guess, "materials.paint.kd")) - 2.0 * slope, 0, None)
    guess = vr.replaced(guess, "materials.paint.kd", tuple(map(float, kd)))
print("found", np.round(vr.value(guess, "materials.paint.kd"), 4), "made with", secret.kd)
