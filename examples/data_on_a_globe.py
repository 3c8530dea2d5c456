"""How do I show a table as bars on a globe, change the scene, and find which pixels show a city?"""

from dataclasses import replace
from pathlib import Path

import numpy as np

import visray as vr

table = Path(__file__).parent.parent / "scenes" / "data" / "cities.csv"
title = "Large cities and their rain"
scene = vr.data_scene(table, height="population", color="rain", base="globe", title=title, size=(640, 360))
# What is not fitted as you like it is changed: bars twice as thick, with a highlight, and a unit in the legend.
scene = vr.replaced(scene, "data.layers.cities.radius", 2 * scene.data.layers["cities"].radius)
scene = vr.replaced(scene, "materials.data.ks", (0.3, 0.3, 0.3))
legend = replace(scene.data.legend, units={"rain": "mm"})
scene = replace(scene, data=replace(scene.data, legend=legend))

image = vr.render(scene, spp=16)
image.write("data_on_a_globe.png")
for city in ("Istanbul", "Delhi"):
    row = scene.data.row("cities", city)
    pixels = image["id"] == image.objects[f"data.cities.{row}"]
    y, x = np.argwhere(pixels).mean(axis=0)
    people = vr.value(scene, f"data.cities.{row}.height")
    print(f"{city}: row {row}, {people:,.0f} people, {pixels.sum()} pixels around ({x:.0f}, {y:.0f})")
