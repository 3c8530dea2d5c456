"""Lines and numbers of text files: whole columns at a time, with the number of the line that is wrong."""

import re
import warnings
from dataclasses import dataclass

import numpy as np

from visray.meshes.triangle_mesh import MeshError

SPACE = np.zeros(256, bool)
SPACE[list(b" \t\n\v\f")] = True


@dataclass(frozen=True, eq=False)
class Text:
    """Words of a text, and the lines that they stand on.

    data: the characters; comments are gone, and each line ends with a line feed
    word: place of the first character of each word
    word_end: place after its last character
    line_of: line of each word, counted from 0
    first: the first word of each line that has words, and the number of all words at the end
    joints: places where a backslash joined two lines

    Shapes: data (C), word, word_end and line_of (W), first (L + 1), joints (J).
    """

    data: np.ndarray
    word: np.ndarray
    word_end: np.ndarray
    line_of: np.ndarray
    first: np.ndarray
    joints: np.ndarray

    @staticmethod
    def of(raw: bytes) -> "Text":
        """The words of a file. A backslash at the end of a line joins it with the next one; # begins a comment."""
        if b"\0" in raw:
            raise MeshError("file", "is not a text; it is damaged, or of another format than its name says")
        if b"\r" in raw:
            raw = raw.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        if b"#" in raw:
            raw = re.sub(rb"(?<!\S)#[^\n]*", b"", raw)
        # Two spaces for two characters: places stay as they are, and the numbers of lines can be corrected.
        joints = [m.start() for m in re.finditer(rb"\\\n", raw)] if b"\\\n" in raw else []
        data = np.frombuffer((raw.replace(b"\\\n", b"  ") if joints else raw) + b"\n", np.uint8)
        space = SPACE[data]
        word = np.flatnonzero(~space & np.concatenate(([True], space[:-1])))
        word_end = np.flatnonzero(space & np.concatenate(([False], ~space[:-1])))
        line_of = np.searchsorted(np.flatnonzero(data == ord("\n")), word)
        new = np.flatnonzero(np.diff(line_of, prepend=-1))
        return Text(data, word, word_end, line_of, np.append(new, len(word)), np.array(joints, int))

    def __getitem__(self, number: int) -> str:
        """A word."""
        return bytes(self.data[self.word[number] : self.word_end[number]]).decode("utf-8", "replace")

    def rest(self, number: int) -> str:
        """The words from `number` to the end of its line."""
        stop = self.first[np.searchsorted(self.first, number, side="right")] - 1
        return bytes(self.data[self.word[number] : self.word_end[stop]]).decode("utf-8", "replace").strip()

    def line(self, number: int) -> int:
        """The line of a word as editors number it, from 1."""
        return int(self.line_of[number] + np.searchsorted(self.joints, self.word[number])) + 1

    def numbers(self, words: np.ndarray, kind: type = np.float64) -> np.ndarray:
        """The numbers that some words are, such as `1.5e3`.

        words: indices of the words, ascending.

        Shapes: words (N); result (N).
        """
        return self.parsed_words(self.characters(words), words, len(words), kind)

    def parsed_words(self, characters: np.ndarray, words: np.ndarray, count: int, kind: type) -> np.ndarray:
        """The numbers in some characters of the text, of which there must be `count`.

        words: indices of the words that the characters come from, for the error message.
        """
        values = parsed(characters.tobytes(), kind)
        if len(values) != count:
            raise self.not_a_number(words, kind)
        return values

    def characters(self, words: np.ndarray) -> np.ndarray:
        """The characters of some words, and all spaces between the first and the last of them.

        words: indices of the words, ascending.
        """
        if not len(words):
            return np.empty(0, np.uint8)
        begin, end = self.word[words[0]], self.word_end[words[-1]]
        # +1 where a chosen word begins, -1 where it ends: the sum is 1 inside of them.
        step = np.zeros(end - begin + 1, np.int8)
        step[self.word[words] - begin] += 1
        step[self.word_end[words] - begin] -= 1
        inside = np.cumsum(step[:-1], dtype=np.int8).view(bool)
        return np.where(inside, self.data[begin:end], np.uint8(ord(" ")))

    def not_a_number(self, words: np.ndarray, kind: type) -> MeshError:
        """The error for the first of some words that is not made of numbers, which may have slashes between them."""
        for number in words:
            first, *rest = self[number].replace("_", "?").split("/")
            try:
                for part in (first, *filter(None, rest)):
                    (int if kind is np.int64 else float)(part)
            except ValueError:
                wanted = "a whole number" if kind is np.int64 else "a number"
                return MeshError("file", f"line {self.line(number)} has {self[number][:40]!r} where {wanted} must be")
        return MeshError("file", "has a number that cannot be read")


def parsed(characters: bytes, kind: type) -> np.ndarray:
    """The numbers of a text up to the first word that is none."""
    if not characters:
        return np.empty(0, kind)
    # NumPy reads up to the first character that fits no number; today it warns there, later it is to raise an error.
    with warnings.catch_warnings(action="ignore", category=DeprecationWarning):
        try:
            return np.fromstring(characters, kind, sep=" ")
        except ValueError:
            return np.empty(0, kind)
