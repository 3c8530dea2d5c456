"""200 bars on a globe with visray."""

import sys

import visray as vr

cities = vr.DataLayer(
    source="scenes/data/cities.csv",
    height=vr.SizeRule(column="population", range=(0, 0.4)),
    radius=0.012,
    color=vr.ColorRule(column="rain", palette="plasma", domain=(0, 4000)),
    material="bars",
)
scene = vr.Scene(
    camera=vr.Camera(origin=(1.4, 2.4, -4.5), target=(-0.35, 0, -0.1), fov=30),
    film=vr.Film(width=960, height=540),
    background=(0.93, 0.95, 0.97),
    lights={"sun": vr.SphereLight(position=(4, 6, -4), radius=1, samples=4, Id=(0.6, 0.6, 0.6))},
    textures={"earth": vr.ImageTexture(file="scenes/textures/world-light.png")},
    materials={"earth": vr.Material(texture="earth", ka=(0.45,) * 3), "bars": vr.Material(ka=(0.4,) * 3)},
    data=vr.Data(
        base=vr.GlobeBase(material="earth"),
        layers={"cities": cities},
        legend=vr.Legend(title="Rain in large cities", labels={"rain": "rain in 2016"}, units={"rain": "mm"}),
    ),
)
vr.render(scene, spp=16, layers=("RGB", "legend")).write(sys.argv[1])
