"""How do I cut an object open, and move the cut from picture to picture?"""

import math

import visray as vr

radii = {"crust": 1.0, "mantle": 0.8, "core": 0.45}
colours = {"crust": (0.15, 0.3, 0.6), "mantle": (0.8, 0.3, 0.1), "core": (0.95, 0.8, 0.3)}
front = vr.Plane(normal=(0, 0, -1))  # as a solid: all that lies before it

layers = {}
for (name, radius), inner in zip(radii.items(), [0.8, 0.45, None]):
    hollow = {} if inner is None else {"hollow": vr.Sphere(radius=inner)}
    layers[name] = vr.Sphere(radius=radius, material=name, cut=hollow | {"front": front})

scene = vr.Scene(
    camera=vr.OrthographicCamera(origin=(0, 0, 5), height=2.4),
    film=vr.Film(width=240, height=240),
    materials={name: vr.Material(kd=colour) for name, colour in colours.items()},
    lights={"sun": vr.DirectionalLight(direction=(-1, -1, -2))},
    objects=layers,
)
prepared = vr.prepare(scene)
for z in (0.6, 0.3, 0.0):
    prepared = prepared.updated({f"objects.{name}.cut.front.point.2": z for name in layers})
    image = vr.render(prepared, spp=16, progress=False)
    image.write(f"slice_{z:.1f}.png")
    pixels = (image["id"] == image.objects["core"]).sum()
    seen, true = math.sqrt(pixels / math.pi) * 2.4 / 240, math.sqrt(max(0.45**2 - z * z, 0))
    print(f"cut at {z:.1f}: the core has the radius {seen:.3f} in the picture, and {true:.3f} by its formula")
