"""How do I write a scene in Python and look at it?"""

import visray as vr

scene = vr.Scene(
    camera=vr.Camera(origin=(0.0, 1.5, 6.0), target=(0.0, 0.7, 0.0), fov=30.0),
    film=vr.Film(width=480, height=320),
    materials={
        "red": vr.Material(color="firebrick", ks=(0.6, 0.6, 0.6), shininess=60.0),
        "floor": vr.Material(kd=(0.5, 0.5, 0.5)),
    },
    lights={"key": vr.PointLight(position=(4.0, 6.0, 5.0))},
    objects={
        "floor": vr.Plane(material="floor"),
        "ball": vr.Sphere(center=(0.0, 0.8, 0.0), radius=0.8, material="red"),
    },
)
image = vr.render(scene, spp=32)
image.write("hello.png")
print(image)
