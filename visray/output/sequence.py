"""Names of the files of frames. In a pattern such as shot.####.exr, the last run of # stands for the frame's number:
frame 12 is shot.0012.exr."""

import re
from collections.abc import Iterable
from pathlib import Path

from visray.errors import UserError
from visray.output.image import SUFFIXES
from visray.output.lock import LOCK_SUFFIX, locked
from visray.output.movie import ALL as MOVIES
from visray.output.movie import is_movie

HASHES = re.compile(r"#+(?=[^#]*$)")
# The number of a frame in a folder of frames has so many digits.
FOLDER_HASHES = "####"
# The number of a frame as other programs write it: %04d.
PRINTF = re.compile(r"%0?(\d?)d")


def check_unused(path: Path) -> None:
    """Raises UserError if another process writes the sequence to which a file belongs."""
    for lock in path.parent.glob(f"*#*{LOCK_SUFFIX}"):
        pattern = lock.with_name(lock.name.removesuffix(LOCK_SUFFIX))
        if _is_frame_of(path, pattern):
            with locked(pattern):
                pass


def _is_frame_of(path: Path, pattern: Path) -> bool:
    """Whether a file is that of a frame, by its name."""
    digits = HASHES.search(pattern.name)
    before, after = (re.escape(x) for x in (pattern.name[: digits.start()], pattern.name[digits.end() :]))
    return re.fullmatch(rf"{before}\d{{{len(digits[0])},}}{after}", path.name) is not None


def is_pattern(path: Path) -> bool:
    """Whether the name of a file is a pattern of frames."""
    return "#" in path.name


def is_for_frames(output: Path) -> bool:
    """Whether an output is for the frames of an animation: a movie, a pattern or a folder."""
    return is_movie(output) or is_pattern(output) or output.is_dir() or not output.suffix


def frame_file(pattern: Path, number: int) -> Path:
    """The file of one frame. A number with more digits than the pattern has # is written in full.

    Domain: `pattern` is a pattern (is_pattern).
    """
    return pattern.with_name(HASHES.sub(lambda run: f"{number:0{len(run[0])}d}", pattern.name))


def patterns(output: Path, stem: str) -> list[Path]:
    """The patterns of a sequence of pictures. Raises UserError if the output names no sequence.

    output: a pattern, or a folder, which gets EXR and PNG files and need not exist yet.
    stem: beginning of the names of the files in a folder.
    """
    if output.is_dir() or not (output.suffix or is_pattern(output)):
        return [output / f"{stem}.{FOLDER_HASHES}{suffix}" for suffix in SUFFIXES]
    if (numbered := PRINTF.search(output.name)) is not None:
        name = output.name.replace(numbered[0], "#" * int(numbered[1] or len(FOLDER_HASHES)))
        raise UserError(f"{output}: numbers of frames are written with #; write {output.with_name(name)}")
    known = output.suffix.lower() in SUFFIXES
    if known and is_pattern(output):
        return [output]
    if known:
        pattern = output.with_name(f"{output.stem}.{FOLDER_HASHES}{output.suffix}")
        raise UserError(f"{output}: is one file, and each frame needs its own; write {pattern}")
    right = f"a folder, a name such as shot.{FOLDER_HASHES}.exr with {' or '.join(SUFFIXES)}, or a movie: {MOVIES}"
    raise UserError(f"{output}: is no place for frames; right would be {right}")


def existing(pattern_list: Iterable[Path], numbers: Iterable[int]) -> list[Path]:
    """Those files of the frames with these numbers that exist."""
    numbers = list(numbers)
    files = (frame_file(pattern, number) for pattern in pattern_list for number in numbers)
    return [file for file in files if file.exists()]
