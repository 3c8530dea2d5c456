"""How many samples does a picture need for a given error? visray finds the number, which is larger in noisy pixels."""

from pathlib import Path

import visray as vr

scene = vr.load(Path(__file__).parent.parent / "scenes" / "penumbra.json")
pictures = []
for error in (0.02, 0.005, 0.002):
    image = vr.render(scene, size=(180, 112), error=error, seed=len(pictures), progress=False)
    facts, samples = image.metadata, image["samples"]
    print(f"asked {error}, got {facts['error']:.4f} ({facts['error_low']:.4f} to {facts['error_high']:.4f}):", end=" ")
    print(f"{facts['spp']} samples per pixel, from {samples.min()} to {samples.max()}")
    pictures.append(image["RGB"].astype(float))
# The last picture has the least error, and another seed. It stands in for the truth.
luminance = (pictures[-1] @ (0.2126, 0.7152, 0.0722)).mean()
off = ((pictures[0] - pictures[-1]) ** 2).mean() ** 0.5 / luminance
print(f"the first picture differs from the last by {off:.4f}")
