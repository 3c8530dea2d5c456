"""200 bars on a globe with pyvista."""

import sys

import numpy as np
import pyvista as pv

lon, lat, population, rain = np.loadtxt(
    "scenes/data/cities.csv", delimiter=",", skiprows=1, usecols=(2, 3, 4, 5), unpack=True
)
a, b = np.radians(lon), np.radians(lat)
up = np.stack([np.cos(b) * np.cos(a), np.cos(b) * np.sin(a), np.sin(b)], axis=1)
heights = 0.4 * population / population.max()
bars = pv.MultiBlock()
for foot, height, value in zip(up, heights, rain):
    bar = pv.Cylinder(center=foot * (1 + height / 2), direction=foot, radius=0.012, height=height, resolution=24)
    bar.cell_data["rain in 2016 (mm)\n"] = np.full(bar.n_cells, value)
    bars.append(bar)
# A grid and not pv.Sphere, whose texture has a seam at 180 degrees.
u, v = np.meshgrid(np.linspace(0, 1, 361), np.linspace(0, 1, 181))
east, north = 2 * np.pi * (u - 0.5), np.pi * (v - 0.5)
globe = pv.StructuredGrid(np.cos(north) * np.cos(east), np.cos(north) * np.sin(east), np.sin(north))
globe.active_texture_coordinates = np.stack([u.ravel("F"), v.ravel("F")], axis=1)
plotter = pv.Plotter(off_screen=True, window_size=(960, 540), lighting="none")
plotter.set_background("#f7f9fc")
plotter.enable_anti_aliasing("ssaa")
plotter.add_light(pv.Light(position=(4, 4, 6), intensity=0.8))
plotter.add_mesh(globe, texture=pv.read_texture("scenes/textures/world-light.png"), ambient=0.4)
key = {"color": "black", "vertical": False, "fmt": "%.0f", "position_x": 0.72, "width": 0.25, "height": 0.15}
plotter.add_mesh(bars, cmap="plasma", clim=(0, 4000), ambient=0.4, scalar_bar_args=key)
plotter.add_text("Rain in large cities", color="black", position="upper_left", font="arial", font_size=12)
plotter.camera_position = [(1.4, 4.5, 2.4), (-0.35, 0.1, 0), (0, 0, 1)]
plotter.camera.view_angle = 30
plotter.screenshot(sys.argv[1])
