"""A picture at full quality, as a file. It is made in the thread that asks for it, while the live picture goes on."""

from visray.adaptive.error_floor import Files
from visray.leftovers import passing_folder
from visray.live.reproducing import Seen, Wish
from visray.output.image import Image
from visray.output.layers import layers_of_files
from visray.progress import Follower
from visray.renderer import render


def picture_file(seen: Seen, wish: Wish, suffix: str, follower: Follower) -> tuple[bytes, str] | None:
    """The bytes of the file that `visray render` writes of what a browser sees, and how good the picture is, as a text.
    None if the follower has stopped it.

    suffix: .png or .exr
    """
    scene, at = seen.to_render()
    with passing_folder() as folder, follower.following():
        path = folder / f"picture{suffix}"
        layers, files = layers_of_files((suffix,)), Files((path,))
        image = render(scene, at=at, layers=layers, progress=False, files=files, **wish.arguments())
        if follower.stopped:
            return None
        image.write(path)
        return path.read_bytes(), summary(image)


def summary(image: Image) -> str:
    """How good a picture is, such as `640 x 480, 12 spp, error 0.98 %`."""
    facts = image.metadata
    error = f", error {100 * facts['error_high']:.2g} %" if "error_high" in facts else ""
    return f"{image.width} x {image.height}, {facts['spp']:.3g} spp{error}"
