"""How does the picture change when a light moves? Pixels that get brighter are red, pixels that get darker are blue.

visray's derivatives do not contain the motion of a shadow's edge, so visray warns.
"""

import warnings
from pathlib import Path

import numpy as np

import visray as vr

scene = vr.load(Path(__file__).parent.parent / "scenes" / "sphere.json")
scene = vr.replaced(vr.replaced(scene, "film.width", 320), "film.height", 200)
with warnings.catch_warnings(record=True) as notes:
    warnings.simplefilter("always", vr.EdgeWarning)
    slope = vr.derivative(scene, "lights.key.position.0", spp=4).mean(axis=2)
print(*(n.message for n in notes))
scale = np.percentile(np.abs(slope), 99)
picture = np.stack([np.clip(slope / scale, 0, 1), 0 * slope, np.clip(-slope / scale, 0, 1)], axis=2)
vr.Image({"RGB": picture.astype(np.float32)}).write("moving_light.png")
