"""Which index of refraction has the glass ball in a picture? Secant steps with JAX find it."""

import visray as vr  # isort: skip - first, because it chooses the LLVM that Dr.Jit loads
import jax
import jax.numpy as jnp

glass = vr.Material(ka=(0.0, 0.0, 0.0), kd=(0.0, 0.0, 0.0), kt=(1.0, 1.0, 1.0), ior=1.45)
scene = vr.Scene(
    camera=vr.Camera(origin=(0.0, 0.0, 6.0), fov=12.0), film=vr.Film(width=32, height=32),
    background=vr.SkyGradient(top=(1.0, 0.2, 0.1), bottom=(0.1, 0.3, 1.0)), materials={"glass": glass},
    lights={}, objects={"ball": vr.Sphere(radius=1.2, material="glass")}, settings=vr.Settings(spp=4),
)  # fmt: skip
render = vr.render_function(scene, "materials.glass.ior")
target = jnp.array(render(1.45))


def loss(ior):
    return ((render(ior) - target) ** 2).mean()


slope = jax.value_and_grad(loss)
ior, step = jnp.array(1.2), 0.05
before = slope(ior)[1]
for i in range(8):
    ior = ior - step
    value, now = slope(ior)
    print(f"step {i}: ior {ior:.5f}, loss {value:.1e}")
    step, before = now * -step / (now - before), now
