"""How do I write a scene in Python and look at it?"""

import visray as vr

red = vr.Material(color="firebrick", ks=(0.6, 0.6, 0.6), shininess=60)
scene = vr.Scene(
    camera=vr.Camera((0, 1.5, 6), (0, 0.7, 0), fov=30),
    film=vr.Film(480, 320),
    lights={"key": vr.PointLight((4, 6, 5))},
    objects={
        "floor": vr.Plane(material=vr.Material(kd=(0.5, 0.5, 0.5))),
        "ball": vr.Sphere((0, 0.8, 0), 0.8, material=red),
    },
)
image = vr.render(scene, spp=32)
image.write("hello.png")
print(image)

# A second picture, with a ring around the ball, tilted by 20 degrees.
tilt = [vr.Rotate(20, (1, 0, 0)), vr.Translate((0, 0.8, 0))]
ring = vr.Torus(major=1.15, minor=0.06, material=vr.Material(color="gold"), transform=tilt)
vr.render(scene.with_object("ring", ring), spp=32).write("hello_ring.png")
