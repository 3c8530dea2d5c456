"""Renders the pictures of README.md and docs/: README's two scenes, by the commands that stand there, and the gallery.

python reference/docs_pictures.py                    # README's two scenes and the gallery
python reference/docs_pictures.py many everything    # some scenes; everything is the picture on top of README
"""

import re
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

import visray as vr

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
GALLERY_SIZE, LARGE = (390, 260), (640, 400)
# The scenes of the gallery, each with its samples per pixel: enough that no noise is seen.
GALLERY = {
    "barth-decic": 64, "glass-heart": 64, "earth-with-stars-and-moon": 64, "many-lights": 36, "many": 64,
    "mirror-hall": 64, "defocus-blur": 400, "scatter": 900, "toon": 64,
}  # fmt: skip
# Larger pictures of docs/: what to give vr.render for them.
PICTURES = {
    "everything": {"size": LARGE, "time": 400},
    "heart": {"size": LARGE, "error": 0.01},
    "showcase": {"size": (640, 360)},
}


def first_block(page: str, language: str) -> str:
    """The first code block of a page in a language."""
    return re.search(rf"^```{language}\n(.*?)^```", (ROOT / page).read_text(), re.DOTALL | re.MULTILINE)[1]


def scenes_of_pages() -> None:
    """The pictures of README's JSON scene, rendered by its command, of its Python script, and of the materials."""
    command = re.search(r"^(visray render first\.json .*)", (ROOT / "README.md").read_text(), re.MULTILINE)[1]
    materials = "visray render materials.json -o materials.png --size 480x320 --spp 64"
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "first.json").write_text(first_block("README.md", "json"))
        (Path(folder) / "spiral.py").write_text(first_block("README.md", "python"))
        (Path(folder) / "materials.json").write_text(first_block("docs/materials-and-lights.md", "json"))
        for words in (["-m", *command.split()], ["spiral.py"], ["-m", *materials.split()]):
            subprocess.run([sys.executable, *words], cwd=folder, check=True)
        for name in ("first", "spiral", "materials"):
            save_small(Path(folder) / f"{name}.png", DOCS / f"{name}.png")


def save_small(source: Path, target: Path) -> None:
    """Writes the same picture without metadata, compressed as far as PNG goes."""
    with Image.open(source) as picture:
        Image.frombytes(picture.mode, picture.size, picture.tobytes()).save(target, optimize=True)
    print(f"{target.relative_to(ROOT)}: {target.stat().st_size / 1000:.0f} kB")


def picture(name: str) -> None:
    """A picture of a scene of scenes/."""
    target = DOCS / f"{name}.png" if name in PICTURES else DOCS / "gallery" / f"{name}.png"
    options = PICTURES.get(name) or {"size": GALLERY_SIZE, "spp": GALLERY[name], "seed": 1}
    vr.render(ROOT / "scenes" / f"{name}.json", layers=("RGB",), **options).write(target)
    save_small(target, target)


if __name__ == "__main__":
    if len(sys.argv) == 1:
        scenes_of_pages()
    for scene_name in sys.argv[1:] or GALLERY:
        picture(scene_name)
