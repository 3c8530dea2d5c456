"""200 bars on a flat map with matplotlib and basemap."""

import sys

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import PolyCollection
from mpl_toolkits.basemap import Basemap

lon, lat, population, rain = np.loadtxt(
    "scenes/data/cities.csv", delimiter=",", skiprows=1, usecols=(2, 3, 4, 5), unpack=True
)
figure = plt.figure(figsize=(9.6, 5.4), dpi=100, facecolor="#f7f9fc")
axes = figure.add_axes((0, -0.39, 1, 1.78), projection="3d", computed_zorder=False, facecolor="none")
axes.set_axis_off()
axes.set_proj_type("persp")
earth = Basemap(llcrnrlon=-180, urcrnrlon=180, llcrnrlat=-90, urcrnrlat=90, resolution="l", fix_aspect=False, ax=axes)
sea = PolyCollection([[(-180, -90), (180, -90), (180, 90), (-180, 90)]], facecolor="#b5d0e5", zorder=0)
land = PolyCollection([p.get_coords() for p in earth.landpolygons], facecolor="#f3efe6", edgecolor="0.6", zorder=1)
axes.add_collection3d(sea)
axes.add_collection3d(land)
axes.add_collection3d(earth.drawcountries(color="0.75", linewidth=0.4), zs=0, autolim=False)
scale = plt.cm.ScalarMappable(plt.Normalize(0, 4000), "plasma")
# matplotlib sorts the bars by their middles; here from north to south, so that the nearer ones are drawn later.
for i in np.argsort(-lat):
    height = 54 * population[i] / population.max()
    axes.bar3d(lon[i] - 1.44, lat[i] - 1.44, 0, 2.88, 2.88, height, color=scale.to_rgba(rain[i]), zorder=100 - lat[i])
axes.set(xlim=(-180, 180), ylim=(-90, 90), zlim=(0, 54))
axes.set_box_aspect((360, 180, 54), zoom=1.1)
axes.view_init(elev=36, azim=-90)
key = figure.add_axes((0.74, 0.12, 0.22, 0.03))
figure.colorbar(scale, cax=key, label="rain in 2016 (mm)", orientation="horizontal", extend="max")
figure.suptitle("Rain in large cities", x=0.02, ha="left", weight="bold", size=16)
figure.savefig(sys.argv[1])
