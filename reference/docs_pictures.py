"""Renders the pictures of README.md and docs/: the scenes whose code is on these pages, and the gallery.

    python reference/docs_pictures.py                    # the scenes of the pages, and the gallery
    python reference/docs_pictures.py bowl everything    # only these files of scenes/
    python reference/docs_pictures.py barth-turn blur    # strips of animated scenes, and sharp beside blurred
    python reference/docs_pictures.py film-filters       # fine stripes with each filter of pixels
    python reference/docs_pictures.py surfaces           # the contact sheet of the known surfaces
    python reference/docs_pictures.py surface            # surfaces of formulas side by side
    python reference/docs_pictures.py troubles           # a ball as it should be, and what may be wrong with a picture

The scene "everything" is the picture at the top of README.md.
"""

import re
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

import visray as vr
from visray import filters
from visray.surface_picture.sheet import contact_sheet

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
GALLERY_SIZE, LARGE = (390, 260), (640, 400)
# The scenes of the gallery, each with its samples per pixel. They are so many that no noise is visible.
GALLERY = {
    "barth-decic": 64, "glass-heart": 64, "earth-with-stars-and-moon": 64, "many-lights": 36, "field": 100,
    "mirror-hall": 64, "defocus-blur": 400, "scatter": 900, "toon": 64,
    "teapot": 100, "bowl": 64, "mesh-in-glass": 144,
    "data-globe": 64, "data-europe": 64, "data-metal": 100,
    "csg-lens": 64, "csg-heart": 100, "csg-shell": 64, "csg-cheese": 100, "csg-die": 100, "csg-gear": 64,
}  # fmt: skip
# Larger pictures of docs/, each with the options of vr.render.
PICTURES = {
    "everything": {"size": LARGE, "time": 400},
    "heart": {"size": LARGE, "error": 0.01},
    "showcase": {"size": (640, 360)},
    "environment": {"size": (640, 360), "spp": 144},
}
# Strips of docs/: frames of animated scenes side by side, at these seconds.
STRIPS = {
    "bouncing-balls": (0.2, 0.76, 1.32, 1.88, 2.44),
    "heart-beat": (0.0, 0.08, 0.16, 0.26, 0.36),
    "barth-turn": (0.4, 1.1, 1.8, 2.4, 3.0),
    "earth-and-moon": (0.0, 1.6, 3.2, 4.8, 6.4),
    "data-year": (0.0, 2.4, 4.8, 7.2, 9.6),
}
STRIP_SIZE, GAP = (240, 135), 4
# Surfaces that are shown side by side: a formula, or the name of a known surface, and its parameters.
FORMULAS = {"x^2 + y^2 - z^2 - a": {"a": 0.5}, "z = x^3 - 3xy^2": {}, "x²y² + y²z² + z²x² = 1": {}, "clebsch-cubic": {}}
FORMULA_SIZE = (240, 240)
# The frame that is shown sharp and blurred: scene, seconds, size, and frames per second.
BLUR = "bouncing-balls", 0.98, (400, 225), 10.0
# Pictures of docs/troubleshooting.md side by side: for each, changes to the first one, and its samples per pixel.
TROUBLES = (
    ({}, 64),
    ({"lights.lamp.position": (0, -5, 0)}, 64),
    ({"lights.lamp.intensity": 6.0}, 64),
    ({"lights.lamp.radius": 3.0}, 1),
    ({"camera.fov": 12.0}, 64),
)
TROUBLES_SIZE = (190, 150)
# Scenes of pages that have a picture, by the name of the picture: the page, the number of the scene among those of the
# page, and the options of `visray render`.
SCENES = {
    "materials": ("docs/materials-and-lights.md", 0, "--size 480x320 --spp 64"),
    "glass-of-water": ("docs/materials-and-lights.md", 1, "--size 480x400 --spp 256"),
    "csg": ("docs/csg.md", 0, "--spp 64"),
    "csg-open": ("docs/csg.md", 1, "--spp 64"),
    "data": ("docs/data.md", 0, "--spp 64 --allow-outside"),
    "legends": ("docs/legends.md", 0, "--size 720x450 --spp 64 --allow-outside"),
}

# Pictures of filters: their size, and how often each pixel is shown along x and y.
STRIPES_SIZE, ENLARGED = (76, 64), 3
# The contact sheet of the known surfaces: size and columns of its pictures, and their samples per pixel.
SHEET_SIZE, SHEET_COLUMNS, SHEET_SPP = (144, 144), 8, 400


def block(page: str, language: str, number: int = 0) -> str:
    """A code block of a page.

    page: path of the page in the repository.
    language: language of the block, such as "json".
    number: its number among the blocks in this language, from 0.
    """
    return re.findall(rf"^```{language}\n(.*?)^```", (ROOT / page).read_text(), re.DOTALL | re.MULTILINE)[number]


def scenes_of_pages() -> None:
    """Renders the pictures of the scenes on pages: README's JSON scene, script and table, and those of SCENES."""
    command = re.search(r"^(visray render first\.json .*)", (ROOT / "README.md").read_text(), re.MULTILINE)[1]
    table = re.search(r"^(visray data .*)", (ROOT / "README.md").read_text(), re.MULTILINE)[1]
    lines = [
        command,
        f"{table} --spp 64",
        *(f"visray render {name}.json -o {name}.png {options}" for name, (*_, options) in SCENES.items()),
    ]
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "first.json").write_text(block("README.md", "json"))
        (Path(folder) / "spiral.py").write_text(block("README.md", "python"))
        (Path(folder) / "scenes").symlink_to(ROOT / "scenes")
        for name, (page, number, _) in SCENES.items():
            (Path(folder) / f"{name}.json").write_text(block(page, "json", number))
        for words in (["spiral.py"], *(["-m", *line.split()] for line in lines)):
            subprocess.run([sys.executable, *words], cwd=folder, check=True)
        for name in ("first", "spiral", "rain", *SCENES):
            save_small(Path(folder) / f"{name}.png", DOCS / f"{name}.png")


def save_small(source: Path, target: Path) -> None:
    """Writes a PNG picture again, without metadata and with the strongest compression. source, target: files."""
    with Image.open(source) as picture:
        Image.frombytes(picture.mode, picture.size, picture.tobytes()).save(target, optimize=True)
    print(f"{target.relative_to(ROOT)}: {target.stat().st_size / 1000:.0f} kB")


def picture(name: str) -> None:
    """Renders the picture of a scene of scenes/ for docs/."""
    target = DOCS / f"{name}.png" if name in PICTURES else DOCS / "gallery" / f"{name}.png"
    options = PICTURES.get(name) or {"size": GALLERY_SIZE, "spp": GALLERY[name], "seed": 1}
    scene = vr.load(ROOT / "scenes" / f"{name}.json")
    legend = ("legend",) if scene.data and scene.data.legend else ()
    vr.render(scene, layers=("RGB", *legend), **options).write(target)
    save_small(target, target)


def strip(name: str) -> None:
    """Renders frames of an animated scene side by side."""
    scene = vr.load(ROOT / "scenes" / f"{name}.json")
    beside(
        f"animation-{name}",
        list(vr.animate(scene, STRIPS[name], size=STRIP_SIZE, spp=100, layers=("RGB",), legend=False)),
    )


def blur() -> None:
    """Renders a frame with a closed shutter, and with one that is open for the whole frame."""
    name, t, size, fps = BLUR
    scene = vr.replaced(vr.load(ROOT / "scenes" / f"{name}.json"), "animation.fps", fps)
    shutters = (None, vr.Shutter(close=1))
    scenes = [vr.replaced(scene, "camera.shutter", shutter) for shutter in shutters]
    beside("animation-blur", [vr.render(x, at=t, size=size, spp=256, layers=("RGB",)) for x in scenes])


def formulas() -> None:
    """Renders the surfaces of formulas side by side."""
    scenes = [vr.surface_scene(formula, values, size=FORMULA_SIZE) for formula, values in FORMULAS.items()]
    beside("surface", [vr.render(scene, spp=64, layers=("RGB",)) for scene in scenes])


def film_filters() -> None:
    """Renders fine stripes with each filter, side by side and enlarged, so that single pixels are seen."""
    scene = vr.load(ROOT / "scenes" / "stripes.json")
    scenes = [vr.replaced(scene, "film.filter", kind.type) for kind in filters.KINDS]
    shown = [vr.render(x, size=STRIPES_SIZE, spp=256, layers=("RGB",)) for x in scenes]
    beside("film-filters", [vr.Image({"RGB": x["RGB"].repeat(ENLARGED, 0).repeat(ENLARGED, 1)}) for x in shown])


def troubles() -> None:
    """Renders a red ball as it should be, in the dark, too bright, with noise, and cut off by the picture's edge."""
    scene = vr.Scene(
        camera=vr.Camera(origin=(0, 1.7, 6), target=(0, 0.85, 0), fov=28),
        film=vr.Film(width=TROUBLES_SIZE[0], height=TROUBLES_SIZE[1]),
        lights={"lamp": vr.SphereLight(position=(3, 5, 4), radius=0.5)},
        materials={"red": vr.Material(kd=(0.7, 0.06, 0.03))},
        objects={"floor": vr.Plane(), "ball": vr.Sphere(center=(0, 0.8, 0), radius=0.8, material="red")},
    )
    images = []
    for changes, spp in TROUBLES:
        changed = scene
        for address, value in changes.items():
            changed = vr.replaced(changed, address, value)
        images.append(vr.render(changed, spp=spp, layers=("RGB",)))
    beside("troubles", images)


def surfaces() -> None:
    """Makes the contact sheet of the known surfaces."""
    target = DOCS / "surfaces.png"
    contact_sheet(tuple(vr.SURFACES), SHEET_SIZE, SHEET_COLUMNS, SHEET_SPP).write(target)
    save_small(target, target)


def beside(name: str, images: list[vr.Image]) -> None:
    """Writes pictures of one size beside each other to docs/NAME.png."""
    target = DOCS / f"{name}.png"
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder) / f"{i}.png" for i in range(len(images))]
        for image, file in zip(images, files):
            image.write(file)
        pictures = [Image.open(file) for file in files]
        width, height = pictures[0].size
        row = Image.new("RGB", (len(pictures) * (width + GAP) - GAP, height), "white")
        for i, shown in enumerate(pictures):
            row.paste(shown.convert("RGB"), (i * (width + GAP), 0))
        row.save(target)
    save_small(target, target)


if __name__ == "__main__":
    if len(sys.argv) == 1:
        scenes_of_pages()
    own = {"blur": blur, "film-filters": film_filters, "surface": formulas, "surfaces": surfaces, "troubles": troubles}
    for scene_name in sys.argv[1:] or (*GALLERY, *STRIPS, *own):
        if scene_name in own:
            own[scene_name]()
        else:
            (strip if scene_name in STRIPS else picture)(scene_name)
