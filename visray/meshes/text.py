"""Lines and numbers of text files: whole columns at a time, with the number of the line that is wrong."""

import re
import warnings
from dataclasses import dataclass

import numpy as np

from visray.meshes.triangle_mesh import MeshError

# For each character 1 if it is a space, else 0.
SPACE = bytes(character in b" \t\n\v\f" for character in range(256))
# Words up to this length are blanked character by character.
SHORT = 8


@dataclass(frozen=True, eq=False)
class Text:
    """Words of a text, and the lines that they stand on.

    data: the characters between two line feeds; comments are gone
    word: place of the first character of each word
    word_end: place after its last character
    first: the first word of each line that has words, and the number of all words at the end
    line_feeds: places of the line feeds
    joints: places where a backslash joined two lines

    Shapes: data (C), word and word_end (W), first (L + 1), line_feeds (N), joints (J).
    """

    data: np.ndarray
    word: np.ndarray
    word_end: np.ndarray
    first: np.ndarray
    line_feeds: np.ndarray
    joints: np.ndarray

    @staticmethod
    def of(raw: bytes) -> "Text":
        """The words of a file. A backslash at the end of a line joins it with the next one; # begins a comment, unless
        it stands within a word."""
        if b"\0" in raw:
            raise MeshError("file", "is not a text; it is damaged, or of another format than its name says")
        raw = b"\n" + raw.removeprefix(b"\xef\xbb\xbf") + b"\n"
        if b"\r" in raw:
            raw = raw.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        if b"#" in raw:
            text = raw
            raw = re.sub(rb"#[^\n]*", lambda m: b"" if SPACE[text[m.start() - 1]] else m.group(), text)
        joints = [m.start() for m in re.finditer(rb"\\\n", raw)]
        if joints:
            # Two spaces for two characters: places stay as they are, and the numbers of lines can be corrected.
            raw = raw.replace(b"\\\n", b"  ")
        data = np.frombuffer(raw, np.uint8)
        space = np.frombuffer(raw.translate(SPACE), bool)
        # Words and spaces alternate; the text begins and ends with a space.
        change = np.flatnonzero(space[1:] != space[:-1]) + 1
        word = change[0::2]
        line_feeds = np.flatnonzero(data == ord("\n"))
        begins = np.searchsorted(word, line_feeds)
        first = np.append(begins[:-1][begins[1:] > begins[:-1]], len(word))
        return Text(data, word, change[1::2], first, line_feeds, np.array(joints, int))

    def __getitem__(self, number: int) -> str:
        """A word."""
        return bytes(self.data[self.word[number] : self.word_end[number]]).decode("utf-8", "replace")

    def rest(self, number: int) -> str:
        """The words from `number` to the end of its line."""
        stop = self.first[np.searchsorted(self.first, number, side="right")] - 1
        return bytes(self.data[self.word[number] : self.word_end[stop]]).decode("utf-8", "replace").strip()

    def line(self, number: int) -> int:
        """The line of a word as editors number it, from 1."""
        place = self.word[number]
        return int(np.searchsorted(self.line_feeds, place) + np.searchsorted(self.joints, place))

    def lines_by_keyword(self, known: set[str], format: str) -> dict[str, np.ndarray]:
        """For each keyword of the text, the lines that begin with it. A line is an index into `first`.

        known: the keywords that there are
        format: name of the format, for the error if a line begins with anything else
        """
        heads = self.first[:-1]
        begin, length = self.word[heads], np.minimum(self.word_end[heads] - self.word[heads], 8)
        # The first seven characters and the length in one number tell all known keywords apart.
        code = length << 56
        for i in range(7):
            character = self.data[np.minimum(begin + i, len(self.data) - 1)].astype(np.int64)
            code |= np.where(i < length, character, 0) << 8 * i
        codes, firsts = np.unique(code, return_index=True)
        lines = {}
        for line, value in sorted(zip(firsts, codes)):
            word = self[heads[line]]
            if word not in known:
                place = f"line {self.line(heads[line])} begins with {word[:20]!r}"
                raise MeshError("file", f"is damaged or no {format} file: its {place}")
            lines[word] = np.flatnonzero(code == value)
        return lines

    def after_keyword(self, lines: np.ndarray) -> np.ndarray:
        """The words of some lines without the first of each."""
        sizes = np.diff(self.first)[lines] - 1
        offset = np.arange(sizes.sum()) - np.repeat(np.cumsum(sizes) - sizes, sizes)
        return np.repeat(self.first[lines] + 1, sizes) + offset

    def numbers(self, words: np.ndarray, kind: type = np.float64) -> np.ndarray:
        """The numbers that some words are, such as `1.5e3`.

        words: indices of the words, ascending.

        Shapes: words (N); result (N).
        """
        return self.parsed(self.characters(words), words, len(words), kind)

    def parsed(self, characters: np.ndarray, words: np.ndarray, count: int, kind: type) -> np.ndarray:
        """The numbers in some characters of the text, of which there must be `count`.

        words: indices of the words that the characters come from, for the error message.
        """
        values = _parsed(characters.tobytes(), kind)
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
        other = np.ones(words[-1] - words[0] + 1, bool)
        other[words - words[0]] = False
        other = np.flatnonzero(other) + words[0]
        places, lengths = self.word[other] - begin, self.word_end[other] - self.word[other]
        longest = lengths.max(initial=0)
        if longest <= SHORT:
            characters = self.data[begin:end].copy()
            for i in range(longest):
                characters[places[lengths > i] + i] = ord(" ")
            return characters
        # +1 where a word to be blanked begins, -1 where it ends: the sum is 1 inside of them.
        step = np.zeros(end - begin + 1, np.int8)
        step[places] += 1
        step[places + lengths] -= 1
        blank = np.cumsum(step[:-1], dtype=np.int8).view(bool)
        return np.where(blank, np.uint8(ord(" ")), self.data[begin:end])

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


def _parsed(characters: bytes, kind: type) -> np.ndarray:
    """The numbers of a text up to the first word that is none."""
    if not characters:
        return np.empty(0, kind)
    # NumPy reads up to the first character that fits no number; today it warns there, later it is to raise an error.
    with warnings.catch_warnings(action="ignore", category=DeprecationWarning):
        try:
            return np.fromstring(characters, kind, sep=" ")
        except ValueError:
            return np.empty(0, kind)
