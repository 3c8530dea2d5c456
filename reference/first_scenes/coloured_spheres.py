import colorsys

import visray as vr

materials, objects = {}, {"ground": vr.Sphere(center=(0, -1000, 0), radius=1000, material="ground")}
materials["ground"] = vr.Material(kd=(0.5, 0.5, 0.5))
for i in range(24):
    x, z = i % 6 - 2.5, i // 6 - 1.5
    materials[f"m{i}"] = vr.Material(kd=colorsys.hsv_to_rgb(i / 24, 0.8, 0.9), ks=(0.3, 0.3, 0.3))
    objects[f"ball{i}"] = vr.Sphere(center=(x, 0.4, z), radius=0.4, material=f"m{i}")
scene = vr.Scene(materials=materials, objects=objects)
