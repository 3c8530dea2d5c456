import numpy as np

import visray as vr

n, m = 240, 24
t = np.linspace(0, 2 * np.pi, n, endpoint=False)
curve = np.stack([np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t), -np.sin(3 * t)], axis=1)
tangent = np.roll(curve, -1, axis=0) - np.roll(curve, 1, axis=0)
tangent /= np.linalg.norm(tangent, axis=1)[:, None]
side = np.cross(tangent, [0.0, 0.0, 1.0])
side /= np.linalg.norm(side, axis=1)[:, None]
up = np.cross(side, tangent)
s = np.linspace(0, 2 * np.pi, m, endpoint=False)
ring = np.cos(s)[None, :, None] * side[:, None] + np.sin(s)[None, :, None] * up[:, None]
vertices = (curve[:, None] + 0.45 * ring).reshape(-1, 3)
i, j = np.meshgrid(np.arange(n), np.arange(m), indexing="ij")
a, b = i * m + j, i * m + (j + 1) % m
c, d = (i + 1) % n * m + j, (i + 1) % n * m + (j + 1) % m
faces = np.concatenate([np.stack([a, c, b], -1).reshape(-1, 3), np.stack([b, c, d], -1).reshape(-1, 3)])

scene = vr.Scene(
    materials={"gold": vr.Material(color="gold", ks=(0.9, 0.8, 0.5), shininess=80)},
    objects={"knot": vr.Mesh(vertices=vertices, faces=faces, normals="smooth", material="gold")},
)
