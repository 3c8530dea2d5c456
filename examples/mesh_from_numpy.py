"""How do I render a mesh that I compute, and move its vertices from picture to picture?"""

import numpy as np

import visray as vr

SIDE = 80
x, z = (v.ravel() for v in np.mgrid[-2 : 2 : SIDE * 1j, -2 : 2 : SIDE * 1j])
corner = np.arange(SIDE * SIDE).reshape(SIDE, SIDE)[:-1, :-1].ravel()
upper = np.stack([corner, corner + 1, corner + SIDE + 1], axis=1)
lower = np.stack([corner, corner + SIDE + 1, corner + SIDE], axis=1)


def wave(phase: float) -> np.ndarray:
    """Vertices of a round wave, one row of x, y and z for each."""
    radius = np.hypot(x, z)
    return np.stack([x, 0.2 * np.exp(-radius) * np.cos(9 * radius - phase), z], axis=1)


scene = vr.Scene(
    camera=vr.Camera(origin=(0, 2.5, 5), fov=40),
    film=vr.Film(width=480, height=320),
    materials={"water": vr.Material(kd=(0.1, 0.3, 0.5), ks=(0.8, 0.8, 0.8), shininess=100)},
    lights={"lamp": vr.PointLight(position=(-3, 3, -2))},
    objects={"wave": vr.Mesh(vertices=wave(0), faces=np.concatenate([upper, lower]), material="water")},
    ambient=(0.3, 0.3, 0.3),
)
prepared = vr.prepare(scene)
for number in range(4):
    prepared = prepared.updated({"objects.wave.vertices": wave(number * np.pi / 2)})
    image = vr.render(prepared, spp=16, progress=False)
    image.write(f"wave{number}.png")
    depths = image["Z"][image["id"] == 1]
    print(f"picture {number}: {depths.size} pixels of water, the nearest {depths.min():.4f} away")
