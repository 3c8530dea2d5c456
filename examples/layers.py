"""What does a picture contain besides colour? Object ids, depths and normals of the first hits, as NumPy arrays."""

from pathlib import Path

import numpy as np

import visray as vr

scene = vr.load(Path(__file__).parent.parent / "scenes" / "sphere.json")
image = vr.render(scene, size=(320, 200), spp=4)
names = ["nothing", *scene.objects]
for number, count in zip(*np.unique(image["id"], return_counts=True)):
    here = image["id"] == number
    nearest = image["Z"][here].min()
    print(f"{names[number]:8} {count:6} pixels, nearest at depth {nearest:.3f}")
lying = (image["N"][..., 1] > 0.99).mean()
print(f"{lying:.0%} of the picture faces straight up")
image.write("layers.exr")
