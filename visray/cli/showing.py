"""What the options --show and --preview do: they show a picture, in a window or in the terminal.

Without -o, a picture that is shown is not written: a short look replaces no file.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from visray.errors import UserError

if TYPE_CHECKING:
    from visray.output.curves import Gamma
    from visray.output.image import Image
    from visray.output.preview import Screen


@dataclass(frozen=True)
class Showing:
    """How a command shows its picture. It is true if the picture is shown at all.

    window: whether in the system's viewer. screen: the terminal that shows it; None: none does.
    """

    window: bool = False
    screen: "Screen | None" = None

    @staticmethod
    def of(show: bool, preview: bool, json: bool, outputs: Sequence[Path]) -> "Showing":
        """What the options ask for. Call this before a long render. Raises a UserError if no window can be opened, or
        if nobody would get the picture, because standard output shows none. If the picture is written or shown in a
        window as well, this is only noted, as scripts have no terminal.

        show, preview, json: whether these options are given. outputs: the files of -o.
        """
        if preview and json:
            raise UserError("--preview and --json: both write to standard output; leave one out, or use --show")
        if show:
            from visray.output.system_viewer import check_viewer

            check_viewer()
        return Showing(show, _screen(needed=not (show or outputs)) if preview else None)

    def __bool__(self) -> bool:
        return self.window or self.screen is not None

    def outputs(self, given: list[Path], usual: list[Path]) -> list[Path]:
        """The files to write. given: those of -o. usual: what is written without -o, unless the picture is shown."""
        return given or ([] if self else usual)

    def in_terminal(self, image: "Image", gamma: "Gamma" = "srgb", exposure: float = 0.0) -> None:
        """Shows the picture in the terminal, with --preview. Call this before the report is printed."""
        if self.screen is not None:
            from visray.output.preview import preview

            preview(image, gamma, exposure, on=self.screen)

    def in_window(
        self, image: "Image", outputs: list[Path], name: str, gamma: "Gamma" = "srgb", exposure: float = 0.0
    ) -> Path | None:
        """Shows the picture in the system's viewer, with --show. Call this last, as the viewer may fail. Returns the
        temporary file that it shows, as it may fail later, too; None if it shows one that was written.

        outputs: the files that were written; the first PNG file is shown. name: of a file that is shown if there is
            none, without its ending.
        """
        if not self.window:
            return None
        from visray.output.system_viewer import show_file, show_png

        if written := [path for path in outputs if path.suffix.lower() == ".png"]:
            show_file(written[0])
            return None
        return show_png(image.png(gamma, exposure), f"{name}.png")


def _screen(needed: bool) -> "Screen | None":
    """The terminal; None, with a note, if it shows no pictures. needed: whether this is an error."""
    from visray.output.preview import obstacle, screen

    found = None if needed else obstacle()
    if found is None:
        return screen()
    warnings.warn(f"preview: {found[0]}", stacklevel=1)
    return None
