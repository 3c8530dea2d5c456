"""How fast does the noise fall with more samples? Pictures are compared with a picture of very many samples."""

from pathlib import Path

import numpy as np

import visray as vr

scene = vr.load(Path(__file__).parent.parent / "scenes" / "shadows.json")
size = (160, 100)
truth = vr.render(scene, size=size, spp=1024, seed=1, layers=("RGB",))["RGB"]
counts, errors = [4, 16, 64], []
for spp in counts:
    pictures = [vr.render(scene, size=size, spp=spp, seed=seed, layers=("RGB",))["RGB"] for seed in (2, 3, 4)]
    errors.append(float(np.sqrt(np.mean([(p - truth) ** 2 for p in pictures]))))
    print(f"{spp:4} samples: error {errors[-1]:.5f}")
slope = np.polyfit(np.log(counts), np.log(errors), 1)[0]
print(f"error ~ samples^{slope:.2f} (independent samples would give -0.50)")
