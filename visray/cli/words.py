"""The words of a command line before cyclopts reads them: forms that it does not know are written out."""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

# Options of files, of which the word - is standard output.
OUTPUT = ("-o", "--output")
# Options of values that begin with a number, but may be more than a number; and such a value that is below 0.
AMOUNTS = ("--size", "--region", "--why", "--time", "--error", "--at", "--animate")
BELOW_ZERO = re.compile(r"-\.?\d.*", re.DOTALL)


def written_out(words: Sequence[str]) -> list[str]:
    """The same words, with

    - `--set A=1 --set B=2` for `--set A=1 B=2`: assignments that follow an assignment belong to it;
    - `--output=-` for `-o -`, as a word that begins with a hyphen would be an option;
    - `--size=-64x48` for `--size -64x48`, for the same reason, so that its own message says what is right;
    - `render --help` for `help render`.
    """
    if words[:1] == ["__complete"]:  # cyclopts' own command, with the words so far
        return list(words)
    if words[:1] == ["help"]:
        words = [*words[1:2], "--help"]
    return list(_written_out(words))


def _written_out(words: Sequence[str]) -> Iterator[str]:
    """As written_out, one word after the other."""
    setting = False  # whether the word before is the value of --set
    pairs = iter(zip(words, [*words[1:], ""]))
    for word, after in pairs:
        if word == "--":
            yield from (word, *(rest for rest, _ in pairs))
        elif word in OUTPUT and is_standard_output(after):
            yield f"--output={after}"
            next(pairs)
        elif word in AMOUNTS and BELOW_ZERO.fullmatch(after):
            yield f"{word}={after}"
            next(pairs)
        elif word == "--set":
            yield from (word, after) if after else (word,)
            next(pairs, None)
        else:
            yield from ("--set", word) if setting and is_assignment(word) else (word,)
        setting = word == "--set" or word.startswith("--set=") or (setting and is_assignment(word))


def is_standard_output(word: str) -> bool:
    """Whether the name of a file is that of standard output: - for a PNG file, or -.png, or -.exr."""
    return word.lower() in ("-", "-.png", "-.exr")


def is_assignment(word: str) -> bool:
    """Whether a word is ADDRESS=VALUE, and neither an option nor a file."""
    address, equals, _ = word.partition("=")
    return bool(equals and address.strip()) and address[0] != "-" and "/" not in address and not Path(word).exists()
