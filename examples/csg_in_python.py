"""How is a solid cut in Python? Drills square holes through a cube, thrice as many and a third as wide each time."""

import numpy as np

import visray as vr

LEVELS = 3


def sponge(levels: int) -> vr.Csg:
    """A Menger sponge: a cube without the holes of all levels."""
    holes = []
    for side in 3 ** np.arange(levels):
        middles, half = (np.arange(side) + 0.5) / side - 0.5, 1 / (6 * side)
        for middle in np.stack(np.meshgrid(middles, middles), axis=-1).reshape(-1, 2):
            for axis in range(3):
                low, high = np.insert(middle - half, axis, -1), np.insert(middle + half, axis, 1)
                holes.append(vr.Box(low, high))
    return vr.Csg("difference", [vr.Box(), *holes], material="clay", cut_material="sand")


scene = vr.Scene(
    camera=vr.Camera(origin=(2.2, 1.7, 3.0), target=(0, -0.03, 0), fov=25),
    film=vr.Film(width=480, height=360),
    background=(0.5, 0.6, 0.7), ambient=1.0,
    materials={
        "clay": vr.Material(ka=(0.2, 0.08, 0.05), kd=(0.75, 0.3, 0.2)),
        "sand": vr.Material(ka=(0.3, 0.2, 0.08), kd=(0.9, 0.75, 0.45)),
    },
    lights={"sun": vr.DirectionalLight(direction=(-0.4, -1, -0.7))},
    objects={"sponge": sponge(LEVELS)},
)  # fmt: skip
vr.render(scene, spp=9, progress=False).write("sponge.png")

# Seen straight from the front, each level leaves 8 of 9 squares.
front = vr.replaced(scene, "camera", vr.OrthographicCamera(origin=(0, 0, 2), height=1.0))
for levels in range(1, LEVELS + 1):
    picture = vr.render(vr.replaced(front, "objects.sponge", sponge(levels)), size=(108, 108), spp=1, progress=False)
    share = np.mean(picture["id"] == 1)
    print(f"level {levels}: {share:.6f} of the square is left, and (8/9)^{levels} = {(8 / 9) ** levels:.6f}")
