"""The scene that `visray new` writes: a small one to begin with, with a comment on each part, as JSON or in Python."""

SCENE = """\
// A first scene. This command makes its picture:
//
//     visray render NAME.json
//
// Change a number or a colour, save the file, and render again. `visray view NAME.json` shows it live in the browser.
// Lengths have no unit. x goes to the right, y up, z towards you. Every part may be left out; it then has a default.
{
  // The eye, the point it looks at, and how wide it sees, in degrees.
  "camera": {"origin": [0, 2.8, 10], "target": [0, 0.95, 0], "fov": 27},

  // The size of the picture in pixels.
  "film": {"width": 640, "height": 400},

  // What is behind everything: one colour, or one at the top and one at the bottom. A colour is a name of CSS ("gold",
  // "skyblue"), sRGB as in "#cc3333", or three numbers in linear light.
  "background": {"top": "steelblue", "bottom": "white"},

  // Lights. Other types: point, directional, spot, rectangle, disk. A larger radius makes softer shadows.
  // The key light is far away, so it lights the whole floor evenly.
  "lights": {
    "key": {"type": "sphere", "position": [-40, 80, 50], "radius": 10},
    "fill": {"type": "directional", "direction": [-1, -0.6, -0.3], "intensity": 0.25}
  },

  // Light that comes from everywhere, so that shadows are not black.
  "ambient": 0.25,

  // What surfaces are made of, by names that you choose. color is the colour in white light, ks the colour of
  // highlights, shininess how small they are, kr what is reflected as in a mirror.
  "materials": {
    "red": {"color": "tomato", "ks": 0.5, "shininess": 80},
    "gold": {"color": "#8a6420", "ks": 0.6, "shininess": 100, "kr": [0.5, 0.35, 0.12]},
    "blue": {"color": "steelblue", "ks": 0.3, "shininess": 40, "kr": 0.05},
    "tiles": {"texture": "tiles", "kr": 0.06}
  },

  // Patterns and pictures. {"type": "image", "file": "wood.png"} takes a file beside this one.
  "textures": {
    "tiles": {"type": "checker", "a": "white", "b": "silver"}
  },

  // What is to be seen. Other types: disk, rectangle, triangle, cylinder, cone, ellipsoid, capsule, mesh, polynomial,
  // csg.
  "objects": {
    "floor": {"type": "plane", "material": "tiles"},
    "ball": {"type": "sphere", "center": [0, 1, 0], "radius": 1, "material": "red"},
    "ring": {"type": "torus", "center": [-2.1, 0.95, -0.3], "axis": [0.6, 0, 1], "major": 0.7, "minor": 0.25,
              "material": "gold"},
    // A transform moves an object, step by step: first larger, then turned about the y axis, then moved.
    "box": {"type": "box", "material": "blue",
            "transform": [{"scale": 1.1}, {"rotate": 35}, {"translate": [2.1, 0.55, 0.2]}]}
  },

  // Samples per pixel: more give smoother edges and shadows, and take longer. `visray render NAME.json --error 1%`
  // finds out how many are needed.
  "settings": {"spp": 32, "depth": 4}
}
"""

SCRIPT = '''\
"""A first scene: python NAME.py writes its picture to NAME.png."""

import visray as vr

scene = vr.Scene(
    # The eye, the point it looks at, and how wide it sees, in degrees. x goes to the right, y up, z towards you.
    camera=vr.Camera(origin=(0, 2.8, 10), target=(0, 0.95, 0), fov=27),
    # The size of the picture in pixels.
    film=vr.Film(width=640, height=400),
    # What is behind everything. A colour is a name of CSS, sRGB as in "#cc3333", or three numbers in linear light.
    background=vr.SkyGradient(top="steelblue", bottom="white"),
    # Lights. A larger radius makes softer shadows. The key light is far away, so it lights the whole floor evenly.
    lights={
        "key": vr.SphereLight(position=(-40, 80, 50), radius=10),
        "fill": vr.DirectionalLight(direction=(-1, -0.6, -0.3), intensity=0.25),
    },
    # Light that comes from everywhere, so that shadows are not black.
    ambient=0.25,
    # What surfaces are made of: color is the colour in white light, ks that of highlights, shininess how small they
    # are, kr what is reflected as in a mirror.
    materials={
        "red": vr.Material(color="tomato", ks=0.5, shininess=80),
        "gold": vr.Material(color="#8a6420", ks=0.6, shininess=100, kr=(0.5, 0.35, 0.12)),
        "blue": vr.Material(color="steelblue", ks=0.3, shininess=40, kr=0.05),
        "tiles": vr.Material(texture="tiles", kr=0.06),
    },
    # Patterns and pictures. vr.ImageTexture(file="wood.png") takes a file.
    textures={"tiles": vr.CheckerTexture(a="white", b="silver")},
    # What is to be seen.
    objects={
        "floor": vr.Plane(material="tiles"),
        "ball": vr.Sphere(center=(0, 1, 0), radius=1, material="red"),
        "ring": vr.Torus(center=(-2.1, 0.95, -0.3), axis=(0.6, 0, 1), major=0.7, minor=0.25, material="gold"),
        # A transform moves an object, step by step: first larger, then turned about the y axis, then moved.
        "box": vr.Box(
            material="blue",
            transform=(vr.Scale(scale=1.1), vr.Rotate(rotate=35), vr.Translate(translate=(2.1, 0.55, 0.2))),
        ),
    },
    # Samples per pixel: more give smoother edges and shadows, and take longer.
    settings=vr.Settings(spp=32, depth=4),
)

image = vr.render(scene)
image.write("NAME.png")
'''


def starter(name: str, *, python: bool = False) -> str:
    """The text of the file. name: its name without the suffix. python: whether it is a script, and no scene file."""
    return (SCRIPT if python else SCENE).replace("NAME", name)
