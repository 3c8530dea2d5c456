"""One sample for each kind of track, in a scene in which all kinds can move something.

A new kind of track needs an entry in TRACK_SAMPLES, and nothing else in the tests that run over
visray.animation.kinds.KINDS.
"""

import visray as vr
from visray.animation.kinds import KINDS

DURATION = 2.0
SCENE = vr.Scene(
    camera=vr.Camera(origin=(0, 1, 7), fov=45),
    film=vr.Film(width=24, height=18),
    materials={"red": vr.Material(kd=(0.8, 0.1, 0.1))},
    lights={
        "key": vr.PointLight(position=(3, 5, 4)),
        "sun": vr.DirectionalLight(direction=(-1, -2, -1), intensity=0.4),
    },
    geometries={"drop": vr.Sphere(radius=0.3)},
    objects={
        "ball": vr.Sphere(radius=0.7, material="red"),
        "box": vr.Box(min=(-2, -0.5, -0.5), max=(-1.2, 0.5, 0.5), transform=(vr.Rotate(rotate=20.0),)),
        "still": vr.Cylinder(center=(1.5, -1, 0), radius=0.3, height=1),
        "copy": vr.Instance(geometry="drop", transform=(vr.Translate(translate=(1.5, 0.5, 0)),)),
        "bite": vr.Csg(
            op="difference", of=(vr.Box(min=(-0.5, 1.2, -0.5), max=(0.5, 2.2, 0.5)), vr.Sphere(center=(0.5, 1.7, 0.5)))
        ),
        "wave": vr.Polynomial(
            expression="x^2 + y^2 + z^2 - a", parameters={"a": 0.5}, transform=(vr.Translate(translate=(-1, 1.5, 0)),)
        ),
        "mesh": vr.Mesh(vertices=[[1, 1, 0], [2, 1, 0], [1, 2, 0]], faces=[[0, 1, 2]]),
    },
    settings=vr.Settings(spp=1),
)  # fmt: skip
TRACK_SAMPLES = {
    vr.KeysTrack: vr.KeysTrack(
        address="objects.ball.center", times=(0, 1, 2), values=((0, 0, 0), (0.4, 0, 0), (0, 0.5, 0))
    ),
    # Not a quarter: the camera would come to lie in the plane of the mesh, which is another kernel.
    vr.OrbitTrack: vr.OrbitTrack(turns=0.2),
    vr.SpinTrack: vr.SpinTrack(of="objects.box", axis=(1, 2, 0), center=(-1.6, 0, 0)),
    vr.PathTrack: vr.PathTrack(address="objects.ball.center", points=((0, 0, 0), (0.5, 0.1, 0), (0.5, 0.5, 0.3))),
    vr.EllipseTrack: vr.EllipseTrack(address="objects.ball.center", radii=(0.5, 0.3), period=2.0),
}  # fmt: skip
assert set(TRACK_SAMPLES) == set(KINDS)


def keys(address: str, *values: object, interpolation: str = "linear") -> vr.KeysTrack:
    """A track whose keys are evenly spread over the whole animation."""
    times = tuple(DURATION * i / (len(values) - 1) for i in range(len(values)))
    return vr.KeysTrack(address=address, times=times, values=values, interpolation=interpolation)


# Tracks of keys on all sorts of addresses.
ADDRESSES = {
    "a number": keys("objects.ball.radius", 0.7, 0.4),
    "a component": keys("objects.ball.center.1", 0.0, 0.4, interpolation="smooth"),
    "a colour": keys("materials.red.kd", (0.8, 0.1, 0.1), (0.1, 0.2, 0.9)),
    "the background": keys("background.top", (0.5, 0.7, 1.0), (0.1, 0.2, 0.3)),
    "the field of view": keys("camera.fov", 45.0, 30.0, interpolation="smooth"),
    "up": keys("camera.up", (0, 1, 0), (1, 1, 0)),
    "a light": keys("lights.key.position", (3, 5, 4), (-3, 5, 4)),
    "a direction": keys("lights.sun.direction", (-1, -2, -1), (1, -2, 0)),
    "held values": keys("lights.sun.intensity", 0.4, 0.8, 0.2, interpolation="step"),
    "a step": keys("objects.box.transform.0", vr.Rotate(rotate=20), vr.Rotate(rotate=70, axis=(1, 0, 0))),
    "an angle": keys("objects.box.transform.0.rotate", 0.0, 360.0),
    "steps": keys(
        "objects.still.transform",
        [{"scale": 1.0}, {"rotate": 0}, {"translate": (0, 0, 0)}],
        [{"scale": (1, 2, 1)}, {"rotate": 90}, {"translate": (0, 0.2, 0)}],
    ),
    "matrices": keys(
        "objects.still.transform",
        [{"matrix": ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0))}],
        [{"matrix": ((0, -1, 0, 0.5), (2, 0, 0, 0), (0, 0, 1, 0))}],
    ),
    "an instance": keys("objects.copy.transform.0.translate", (1.5, 0.5, 0), (1.2, 0.8, 0)),
    "a geometry": keys("geometries.drop.radius", 0.3, 0.5),
    "an operand": keys("objects.bite.of.1.center", (0.5, 1.7, 0.5), (0.2, 1.7, 0.5)),
    "a parameter": keys("objects.wave.parameters.a", 0.5, 0.2),
    "vertices": keys("objects.mesh.vertices", ((1, 1, 0), (2, 1, 0), (1, 2, 0)), ((1, 1, 0), (2, 1.5, 0), (1.5, 2, 0))),
}  # fmt: skip


def moving(*tracks: object) -> vr.Scene:
    """The scene with some tracks."""
    named = {f"track{i}": track for i, track in enumerate(tracks)}
    return vr.replaced(SCENE, "animation", vr.Animation(duration=DURATION, fps=10, tracks=named))
