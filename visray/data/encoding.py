"""The encoding of a text file: UTF-8, UTF-16 or UTF-32 with a byte order mark, or Windows-1252.

A file is read as Windows-1252 only if no character of it is UTF-8 beyond ASCII: a file that mixes both is refused.
"""

import codecs
import re
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from visray.errors import UserError
from visray.terminal import printable

# Byte order marks, the longest first, and the encodings that they announce.
MARKS = {
    codecs.BOM_UTF32_LE: "utf-32",
    codecs.BOM_UTF32_BE: "utf-32",
    codecs.BOM_UTF8: "utf-8-sig",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}
# First bytes of files that are no text, what they are, and what would be right.
OTHERS = {
    b"PK\x03\x04": "is a workbook or an archive; save the sheet as CSV",
    b"\xd0\xcf\x11\xe0": "is an old Excel workbook; save the sheet as CSV",
    b"\x1f\x8b": "is compressed; unpack it first",
    b"BZh": "is compressed; unpack it first",
    b"\xfd7zXZ": "is compressed; unpack it first",
    b"(\xb5/\xfd": "is compressed; unpack it first",
    b"PAR1": "is a Parquet file; read it in Python and hand over its columns, or save it as CSV",
    b"\x89HDF": "is an HDF5 or NetCDF file; read it in Python and hand over its arrays, or save it as CSV",
    b"CDF": "is a NetCDF file; read it in Python and hand over its arrays, or save it as CSV",
    b"SQLite": "is a database; save the table as CSV",
    b"%PDF": "is a PDF; save the table as CSV",
}
# Bytes that are read at once.
BLOCK = 1 << 20
# A character of UTF-8 beyond ASCII.
MULTIBYTE = re.compile(rb"[\xc2-\xdf][\x80-\xbf]|[\xe0-\xef][\x80-\xbf]{2}|[\xf0-\xf4][\x80-\xbf]{3}")
# The first two characters of a character of UTF-8 that is read as Windows-1252.
_TWICE = re.compile(r"[\u00c2-\u00f4][\u0080-\u00bf\u0152-\u0192\u02c6\u02dc\u2013-\u203a\u20ac\u2122]")
# Longest text of a line that a note shows.
SHOWN = 40


class Encoding(NamedTuple):
    """Encoding of a file.

    codec: its name in Python
    name: its name for people
    notes: sentences about it, if it is not UTF-8
    """

    codec: str
    name: str
    notes: list[str]


def encoding_of(path: Path) -> Encoding:
    """The encoding of a text file. Raises a UserError if it is no text, or if no encoding fits the whole file."""
    with open(path, "rb") as file:
        head = file.read(BLOCK)
        if kind := next((text for magic, text in OTHERS.items() if head.startswith(magic)), None):
            raise UserError(f"{path}: {kind}")
        codec = next((codec for mark, codec in MARKS.items() if head.startswith(mark)), "utf-8")
        # The decoder that drops the mark would not count its bytes.
        decoder = codecs.getincrementaldecoder(codec.removesuffix("-sig"))()
        start, block, nul = 0, head, codec.startswith("utf-8")
        while True:
            if nul and b"\0" in block:
                raise UserError(_nul(path, start + block.index(b"\0")))
            try:
                held = len(decoder.getstate()[0])
                decoder.decode(block, final=not block)
            except UnicodeDecodeError as error:
                return _other(path, codec, max(0, start - held + error.start))
            if not block:
                return Encoding(codec, codec.removesuffix("-sig").upper(), [])
            start, block = start + len(block), file.read(BLOCK)


def misread(texts: Iterable[str]) -> str:
    """A sentence if a text looks like UTF-8 that another program has read as Windows-1252 and saved so; else ""."""
    for text in dict.fromkeys(texts):
        if not text.isascii() and _TWICE.search(text):
            try:
                right = text.encode("cp1252").decode("utf-8")
            except UnicodeError:
                continue
            return printable(f"{text!r} looks like {right!r} in a wrong encoding; save the file anew as UTF-8")
    return ""


def _nul(path: Path, place: int) -> str:
    """Message about a file with a NUL character at a place."""
    wide = place < 4
    what = "looks like UTF-16 without a byte order mark" if wide else "holds a NUL character: it is no text, or damaged"
    return f"{path}: line {_line(path, place)[0]}: {what}; save it as UTF-8 text"


def _other(path: Path, codec: str, place: int) -> Encoding:
    """The encoding of a file that is not in the encoding that its first bytes announce.

    place: the first byte that does not fit
    """
    number, raw = _line(path, place)
    if codec != "utf-8":
        name = codec.removesuffix("-sig").upper()
        raise UserError(f"{path}: line {number}: is not {name}, as the file's first bytes say; save it anew as UTF-8")
    data = path.read_bytes()
    if wide := MULTIBYTE.search(data):
        other = data.count(b"\n", 0, wide.start()) + 1
        mixed = f"has characters of two encodings: UTF-8 in line {other}, and another one in line {number}"
        raise UserError(f"{path}: {mixed} {_shown(raw)}; save the whole file as UTF-8")
    try:
        data.decode("cp1252")
    except UnicodeDecodeError as error:
        number, raw = _line(path, error.start)
        text = f"line {number}: is neither UTF-8 nor Windows-1252 {_shown(raw)}; save the file as UTF-8"
        raise UserError(f"{path}: {text}") from None
    note = f"is not UTF-8; it is read as Windows-1252, which makes line {number} {_shown(raw)}"
    return Encoding("cp1252", "Windows-1252", [note])


def _line(path: Path, place: int) -> tuple[int, bytes]:
    """Number and bytes of the line with the byte at a place."""
    data = path.read_bytes()
    begin, end = data.rfind(b"\n", 0, place) + 1, data.find(b"\n", place)
    return data.count(b"\n", 0, place) + 1, data[begin : end if end >= 0 else len(data)]


def _shown(raw: bytes) -> str:
    """The bytes of a line as Windows-1252, in quotation marks, and cut if they are many."""
    text = raw.decode("cp1252", "replace").strip()
    return f'"{printable(text if len(text) <= SHOWN else text[: SHOWN - 3] + "...")}"'
