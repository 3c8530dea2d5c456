"""A terminal for tests: it runs a script, answers its questions, and what it was sent is decoded to pixels."""

import base64
import io
import os
import re
import select
import struct
import sys
import time
from pathlib import Path

import numpy as np
from PIL import Image as Pillow

ROOT = Path(__file__).resolve().parents[1]
# What a terminal is asked, as patterns, and what terminals answer.
FEATURES, CELL, KITTY = rb"\x1b\[c", rb"\x1b\[16t", rb"\x1b_Gi=\d+,s=1,v=1,a=q"
HAS_SIXEL, HAS_NO_SIXEL, HAS_KITTY = b"\x1b[?62;4;22c", b"\x1b[?62;22c", b"\x1b_Gi=1;OK\x1b\\"
LIMIT = 120  # seconds, after which a script is taken for one that hangs


def in_terminal(words, answers=None, columns=80, rows=24, cell=(10, 20), **environment):
    """Runs Python in a terminal. Returns its exit code, and the bytes that the terminal was sent.

    words: arguments of Python. answers: answer by pattern of the question. cell: width and height of a character in
        pixels, as the system knows them; (0, 0): it does not. environment: variables; None removes one.
    """
    import fcntl
    import pty
    import termios

    variables = {**os.environ, "PYTHONPATH": f"{ROOT}:{ROOT / 'tests'}", "TERM": "xterm-256color"}
    variables |= {"COLORTERM": "truecolor", "NO_COLOR": None, "COLUMNS": None, "LINES": None, **environment}
    variables = {name: value for name, value in variables.items() if value is not None}
    size = struct.pack("HHHH", rows, columns, columns * cell[0], rows * cell[1])
    child, terminal = pty.fork()
    if child == 0:
        fcntl.ioctl(0, termios.TIOCSWINSZ, size)
        os.execve(sys.executable, [sys.executable, *words], variables)
    sent, answered, end = b"", dict.fromkeys(answers or (), 0), time.monotonic() + LIMIT
    while time.monotonic() < end:
        if not select.select([terminal], [], [], 0.1)[0]:
            continue
        try:
            new = os.read(terminal, 1 << 16)
        except OSError:  # the program has ended
            break
        if not new:
            break
        sent += new
        for question in answered:
            count = len(re.findall(question, sent))
            os.write(terminal, answers[question] * (count - answered[question]))
            answered[question] = count
    else:
        os.kill(child, 9)
    os.close(terminal)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), sent


def half_blocks(sent):
    """The pixels of a picture of half blocks. Shape: uint8 (H, W, 3)."""
    rows = []
    for line in sent.decode().split("\r\n"):
        cells = re.findall(r"\x1b\[38;2;(\d+);(\d+);(\d+);48;2;(\d+);(\d+);(\d+)m\u2580", line)
        if cells:
            colours = np.array(cells, np.uint8).reshape(-1, 2, 3)
            rows += [colours[:, 0], colours[:, 1]]
    return np.array(rows)


def sixel(sent):
    """The pixels of a sixel picture. Shape: float (H, W, 3), from 0 to 255."""
    body = re.search(r"\x1bP[\d;]*q(.*?)\x1b\\", sent.decode(), re.DOTALL)[1]
    width, height = map(int, re.match(r'"1;1;(\d+);(\d+)', body).groups())
    palette, pixels = {}, np.full((height + 6, width, 3), np.nan)
    x = y = colour = 0
    for number, red, green, blue, count, character in re.findall(
        r'"[\d;]+|#(\d+)(?:;2;(\d+);(\d+);(\d+))?|(?:!(\d+))?([?-~$-])', body
    ):
        if number:
            colour = int(number)
            if red:
                palette[colour] = np.array([red, green, blue], float) * 2.55
        elif character == "$":
            x = 0
        elif character == "-":
            x, y = 0, y + 6
        elif character:
            run, bits = int(count or 1), ord(character) - ord("?")
            for bit in range(6):
                if bits >> bit & 1:
                    pixels[y + bit, x : x + run] = palette[colour]
            x += run
    return pixels[:height]


def kitty(sent):
    """The pixels of a picture in kitty's protocol, its number, and columns and rows of its place."""
    text = sent.decode()
    parts = re.findall(r"\x1b_Gi=(\d+),m=\d,f=100,q=2;([^\x1b]+)\x1b", text)
    data = base64.b64decode("".join(part for _, part in parts))
    place = re.search(r"a=p,i=(\d+),c=(\d+),r=(\d+)", text)
    assert {number for number, _ in parts} == {place[1]}
    return np.array(Pillow.open(io.BytesIO(data))), *map(int, place.groups())
