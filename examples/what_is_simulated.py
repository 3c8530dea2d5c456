"""Which effects does a scene need? The kernel leaves out all others."""

from pathlib import Path

import visray as vr

scene = vr.load(Path(__file__).parent.parent / "scenes" / "ambient.json")
for name, changed in {
    "as it is": scene,
    "without shadows": vr.replaced(scene, "settings.shadows", False),
    "without highlights": vr.replaced(vr.replaced(scene, "materials.dark.ks", (0.0, 0.0, 0.0)),
                                      "materials.whole.ks", (0.0, 0.0, 0.0)),
}.items():  # fmt: skip
    print(f"{name}: {', '.join(vr.explain(changed).names())}")
