"""Makes docs/gallery.md: each scene of scenes/ with its picture and one line.

    python reference/docs_gallery.py              # renders pictures that are missing, and writes the page
    python reference/docs_gallery.py heart torus  # renders these again

A new scene needs its line in SCENES below. Some pictures are larger, as README shows them: those that docs_pictures.py
lists with their own number of samples.
"""

import json
import sys
from pathlib import Path

import docs_pictures

import visray as vr

ROOT = Path(__file__).resolve().parents[1]
PAGE, PICTURES = ROOT / "docs" / "gallery.md", ROOT / "docs" / "gallery"
# Width of a picture in pixels, without and with a legend; the height follows from the scene's film. Largest height, and
# samples per pixel.
WIDTH, LEGEND_WIDTH, HEIGHT, SPP = 320, 480, 240, 100
COLUMNS = 3
# For each idea, its scenes with what their pictures show. A picture of an animated scene is one of its frames.
SCENES = {
    "To begin with": {
        "showcase": "Seven kinds of objects before a wall",
        "two-spheres": "A mirror ball and a grey ball on a large yellow one",
        "everything": "Nearly every effect: glass, juice, a mirror, a globe, a lens in focus",
    },
    "Shapes": {
        "sphere": "Spheres",
        "box": "Boxes, two of them turned",
        "cylinder": "Cylinders, upright, lying and leaning",
        "cone": "Cones",
        "capsule": "Capsules: cylinders with round ends",
        "ellipsoid": "Ellipsoids, as pebbles and an egg",
        "torus": "Tori, as rings and a doughnut",
        "disk": "Disks",
        "rectangle": "Rectangles",
        "triangle": "Triangles, as a tent",
        "plane": "Four planes, as a floor and three walls",
        "transforms": "One sphere, scaled, turned and sheared step by step",
        "far-away": "A scene a million units from the origin, as sharp as at the origin",
    },
    "Lights and shadows": {
        "directional-light": "Sunlight: parallel rays on standing stones",
        "cone-of-light": "A spot light with a sharp edge",
        "spot-soft": "Three spot lights: the edge gets softer with the exponent",
        "attenuation": "Two lamps whose light gets weaker with distance",
        "disk-light": "A disk as a lamp over chess pieces, with soft shadows",
        "sphere-light": "A glowing ball, and soft shadows all round",
        "lamps": "Lamps that are seen, in a mirror and in glass too, and things that glow",
        "area-lights": "A point, a rectangle, a disk and a sphere as lamps, in equal rooms",
        "penumbra": "Light from a window: a shadow is sharp near the object and soft far from it",
        "shadows": "Red, green and blue light: where one is missing, its shadow has the other two's colour",
        "many-lights": "A grey ball amid 30 lights of all colours",
        "ambient": "Light from a lamp only, ambient light only, and both",
        "ambient-occlusion": "Ambient light is weaker where little of the sky is seen",
        "scatter": "A room whose orange and blue-green walls colour each other",
        "shininess": "Highlights of one material, from wide to small",
    },
    "Mirrors and glass": {
        "mirror-hall": "A corridor between two mirrors",
        "hyperboloid-mirrors": "Two curved mirrors on tiles, with balls",
        "transparent-spheres": "Balls that bend light as air, water, glass and diamond do",
        "transparencies": "A thin red and a deep blue ball with coloured shadows",
        "nested-glass": "A ball of glass in a tank of water",
        "fresnel": "Glass, water, varnish, gold and copper that reflect by the angle",
        "absorption": "Coloured glass takes light by its thickness",
        "total-internal-reflection": "Seen from under water: the surface is a mirror at flat angles",
        "environment": "A mirror, glass, gold and matte things under a painted sky at dusk",
        "glass-heart": "A heart of red glass, and its coloured shadow",
        "mesh-in-glass": "A knotted copper tube in a glass ball",
    },
    "Textures and shading": {
        "checker": "Checkers and stripes without files",
        "textures-on-everything": "One numbered picture on each kind of object",
        "wrap-and-filter": "What a texture does at its edge, and near by: sharp or smooth",
        "two-sided": "Another material on the back of a surface",
        "unlit": "A map that shows its own colours, beside a globe in the light",
        "toon": "A snowman and a tree in three tones, as in a cartoon",
        "normals": "The direction of each surface as its colour",
        "earth": "The Earth in sunlight",
        "earth-with-stars": "The Earth before the stars",
        "earth-with-stars-and-moon": "The Earth and the Moon before the stars",
        "stars": "The Milky Way over a lake: a picture on a rectangle",
    },
    "Camera and film": {
        "defocus-blur": "A lens: only what is in focus is sharp",
        "orthographic": "A temple without perspective: parallel lines stay parallel",
        "stripes": "Fine stripes to the horizon, where the filter of the film counts",
        "transparent-film": "A planet without a background, for putting it before another picture",
    },
    "Surfaces f(x, y, z) = 0": {
        "heart": "A heart, of degree 6",
        "quartic": "A vase, of degree 4",
        "cayley": "Cayley's cubic, with four points where it pinches",
        "steiner-roman": "Steiner's Roman surface",
        "kummer": "A Kummer quartic, with 16 double points",
        "tangle-cut": "The tangle cube, cut open by a box",
        "banchoff-chmutov": "A Banchoff-Chmutov surface",
        "barth-sextic": "The Barth sextic, with 65 double points",
        "labs-septic": "The Labs septic, with 99 double points",
        "endrass-octic": "The Endrass octic, with 168 double points",
        "barth-decic": "The Barth decic, with 345 double points",
        "gallery": "Eight known surfaces in a museum",
    },
    "Solids made of solids (CSG)": {
        "csg-rounded-cube": "A cube and a ball, with three cylinders drilled out",
        "csg-die": "Dice: a cube, a ball and 21 pips",
        "csg-gear": "Gears with 24 teeth",
        "csg-cheese": "Cheese with the holes of the Barth sextic",
        "csg-heart": "A heart cut open, with a smaller heart inside",
        "csg-bite": "A teapot from which somebody has bitten a piece",
        "csg-shell": "A lamp with round holes that throws spots of light",
        "csg-lens": "A lens of two balls; the painting behind it is upside down",
        "csg-glass": "Glass balls that overlap, as two bodies and as one",
    },
    "Meshes, and many objects": {
        "teapot": "A mesh of four parts, each with its material",
        "knot": "A knot with a checker texture",
        "field": "1,400 tulips: instances of few meshes",
        "many": "400 balls on a wave",
        "bowl": "10,000 balls in a bowl",
    },
    "Data": {
        "data-one-value": "Bars on a map of the world",
        "data-two-values": "Two values a row: one is the height, one the colour",
        "data-europe": "Columns on a map of Europe, blue in the north and red in the south",
        "data-palettes": "Three layers on one map, each with its palette",
        "data-globe": "Earthquakes on a globe, coloured by depth",
        "data-outlines": "Outlines of countries on a globe",
        "data-zoom": "A map of a city",
        "data-glass": "Glass balls on a map",
        "data-metal": "Metal columns in palette colours on a map",
    },
    "Animation": {
        "bouncing-balls": "Balls that bounce, and a camera that goes round",
        "heart-beat": "A heart that beats: a parameter of its formula moves",
        "barth-turn": "The Barth sextic turns, and the ball that cuts it shrinks and grows",
        "earth-and-moon": "The Moon goes round the Earth",
        "data-year": "Temperatures of a year, month by month",
    },
}
INTRODUCTION = """# Gallery

Every scene of the folder `scenes`, with its picture. A click on a picture leads to the scene file; render it with
`visray render scenes/NAME.json`. What the fields mean is on the page [Scene files](scenes.md). Scenes that move are
shown by one frame; [Animation](animation.md) has more of them.
"""


def lines() -> dict[str, str]:
    """For each scene, what its picture shows."""
    return {name: line for group in SCENES.values() for name, line in group.items()}


def names() -> set[str]:
    """Names of the scenes of scenes/."""
    return {path.stem for path in (ROOT / "scenes").glob("*.json")} - {"schema"}


def cell(name: str) -> str:
    """The picture of a scene, which links to the scene's file."""
    return f"[![{lines()[name]}](gallery/{name}.png)](../scenes/{name}.json)"


def table(scenes: list[str]) -> list[str]:
    """Lines of a Markdown table: rows of pictures, each above a row with what they show."""
    rows = ["| " * COLUMNS + "|", "|---" * COLUMNS + "|"]
    for start in range(0, len(scenes), COLUMNS):
        row = scenes[start : start + COLUMNS]
        for cells in ([cell(name) for name in row], [f"`{name}`: {lines()[name]}" for name in row]):
            rows.append(f"| {' | '.join(cells + [''] * (COLUMNS - len(row)))} |")
    return rows


def markdown() -> str:
    """The text of the page."""
    parts = [INTRODUCTION]
    for group, scenes in SCENES.items():
        parts.append("\n".join([f"## {group}", "", *table(list(scenes)), ""]))
    return "\n".join(parts)


def size_of(name: str, legend: bool) -> tuple[int, int]:
    """Width and height of the picture of a scene, of the shape of its film."""
    film = json.loads((ROOT / "scenes" / f"{name}.json").read_text()).get("film", {})
    shape = film.get("height", vr.Film().height) / film.get("width", vr.Film().width)
    width = LEGEND_WIDTH if legend else round(min(WIDTH, HEIGHT / shape))
    return width, round(width * shape)


def picture(name: str) -> None:
    """Renders the picture of a scene; of an animated one, the frame after 30 % of its time."""
    if name in docs_pictures.GALLERY:
        return docs_pictures.picture(name)
    scene = vr.load(ROOT / "scenes" / f"{name}.json")
    legend = ("legend",) if scene.data and scene.data.legend else ()
    moment = {"at": 0.3 * scene.animation.duration} if scene.animation else {}
    target = PICTURES / f"{name}.png"
    image = vr.render(scene, size=size_of(name, bool(legend)), spp=SPP, seed=1, layers=("RGB", "A", *legend), **moment)
    image.write(target)
    docs_pictures.save_small(target, target)


def main() -> None:
    if missing := sorted(names() ^ set(lines())):
        sys.exit(f"{__file__}: SCENES and the folder scenes differ in {', '.join(missing)}")
    PICTURES.mkdir(exist_ok=True)
    for name in sys.argv[1:] or sorted(n for n in names() if not (PICTURES / f"{n}.png").exists()):
        picture(name)
    PAGE.write_text(markdown())


if __name__ == "__main__":
    main()
