"""Pictures on standard output, for other programs: the output - is a PNG file there, -.exr an EXR file."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from visray import terminal
from visray.cli.words import is_standard_output
from visray.errors import UserError
from visray.leftovers import passing_folder

# Name of the temporary file whose bytes go to standard output.
STEM = "picture"


def is_aside(output: Path) -> bool:
    """Whether an output is standard output."""
    return is_standard_output(str(output))


def reserve(outputs: Sequence[Path], *, json: bool = False, preview: bool = False) -> None:
    """If one of the outputs is standard output, lines of reports go to standard error from now on. Raises a UserError
    if a picture cannot go there. Call this before anything is printed.

    json, preview: whether the options --json and --preview are given, which write there too.
    """
    aside = [path for path in outputs if is_aside(path)]
    if not aside:
        return
    if len(aside) > 1:
        raise UserError(f"-o {aside[1]}: standard output takes one picture; write the other to a file")
    if json or preview:
        option = "--json" if json else "--preview"
        raise UserError(f"-o {aside[0]}: writes the picture to standard output, and so does {option}; leave one out")
    if terminal.is_terminal():
        raise UserError(
            f"-o {aside[0]}: a terminal shows no bytes of a picture; pipe them to a program, or use --preview"
        )
    terminal.keep_output_free(True)


def refuse(outputs: Sequence[Path]) -> None:
    """Raises a UserError if one of the outputs is standard output. For commands that write many files."""
    for path in filter(is_aside, outputs):
        raise UserError(f"-o {path}: standard output takes one picture, and frames are many; write a file or a folder")


@contextmanager
def files_for(outputs: Sequence[Path]) -> Iterator[list[Path]]:
    """Yields the outputs, with a temporary file in place of standard output. At the end of the block, unless it fails,
    the bytes of this file go to standard output."""
    aside = next(filter(is_aside, outputs), None)
    if aside is None:
        yield list(outputs)
        return
    with passing_folder() as folder:
        file = folder / f"{STEM}{aside.suffix.lower() or '.png'}"
        yield [file if path == aside else path for path in outputs]
        if file.exists():
            terminal.write_bytes(file.read_bytes())
