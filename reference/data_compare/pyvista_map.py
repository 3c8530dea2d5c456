"""200 bars on a flat map with pyvista."""

import sys

import numpy as np
import pyvista as pv

lon, lat, population, rain = np.loadtxt(
    "scenes/data/cities.csv", delimiter=",", skiprows=1, usecols=(2, 3, 4, 5), unpack=True
)
x, y, heights = lon / 36, lat / 36, 1.5 * population / population.max()
bars = pv.MultiBlock()
for east, north, height, value in zip(x, y, heights, rain):
    bar = pv.Cylinder(center=(east, north, height / 2), direction=(0, 0, 1), radius=0.04, height=height, resolution=24)
    bar.cell_data["rain in 2016 (mm)\n"] = np.full(bar.n_cells, value)
    bars.append(bar)
land = pv.Plane(i_size=10, j_size=5)
plotter = pv.Plotter(off_screen=True, window_size=(960, 540), lighting="none")
plotter.set_background("#f7f9fc")
plotter.enable_anti_aliasing("ssaa")
plotter.add_light(pv.Light(position=(-12, -4, 20), intensity=0.8))
plotter.add_mesh(land, texture=pv.read_texture("scenes/textures/world-light.png"), ambient=0.4)
key = {"color": "black", "vertical": False, "fmt": "%.0f", "position_x": 0.72, "width": 0.25, "height": 0.15}
plotter.add_mesh(bars, cmap="plasma", clim=(0, 4000), ambient=0.4, scalar_bar_args=key)
plotter.add_text("Rain in large cities", color="black", position="upper_left", font="arial", font_size=12)
plotter.camera_position = [(0, -8.6, 6.2), (0, -0.9, 0), (0, 0, 1)]
plotter.camera.view_angle = 36
plotter.screenshot(sys.argv[1])
