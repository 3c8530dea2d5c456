"""200 bars on a globe with matplotlib and basemap.

basemap draws a globe as a flat picture, seen from far away. There, a bar that stands on the globe is a line from its
foot away from the middle of the globe.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import LineCollection
from mpl_toolkits.basemap import Basemap

lon, lat, population, rain = np.loadtxt(
    "scenes/data/cities.csv", delimiter=",", skiprows=1, usecols=(2, 3, 4, 5), unpack=True
)
figure = plt.figure(figsize=(9.6, 5.4), dpi=100, facecolor="#f7f9fc")
axes = figure.add_axes((0.02, 0.03, 0.68, 0.84))
globe = Basemap(projection="ortho", lon_0=72, lat_0=28, resolution="l", ax=axes)
globe.drawmapboundary(fill_color="#b5d0e5", linewidth=0)
globe.fillcontinents(color="#f3efe6", lake_color="#b5d0e5")
globe.drawcountries(color="0.75", linewidth=0.4)
x, y = globe(lon, lat)
seen = x < 1e20
foot, middle = np.stack([x, y], axis=1)[seen], np.array(globe(72, 28))
heights = 0.4 * population[seen, None] / population.max()
lines = np.stack([foot, middle + (foot - middle) * (1 + heights)], axis=1)
bars = LineCollection(lines, array=rain[seen], cmap="plasma", clim=(0, 4000), linewidths=4, zorder=5)
axes.add_collection(bars)
axes.set(xlim=(-2.2e6, 14.9e6), ylim=(-1e6, 13.8e6))
key = figure.add_axes((0.74, 0.2, 0.22, 0.03))
figure.colorbar(bars, cax=key, label="rain in 2016 (mm)", orientation="horizontal", extend="max")
figure.suptitle("Rain in large cities", x=0.02, ha="left", weight="bold", size=16)
figure.savefig(sys.argv[1])
