"""Image: a picture as named layers, and metadata about how it was made."""

import json
import os
import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime
from difflib import get_close_matches
from math import hypot, inf, isfinite
from pathlib import Path
from typing import Any

import numpy as np

from visray.arguments import checked_arguments
from visray.errors import GoalWarning, UserError
from visray.output import exr, files, png, system_viewer
from visray.output.curves import LUMINANCE, Gamma, curve
from visray.output.overlay import drawn_over
from visray.output.rounding import rounding
from visray.version import __version__

SUFFIXES = (".exr", ".png")
# The layer that is drawn over the colour in PNG files.
LEGEND = "legend"
# Metadata keys. With the prefix `visray/` a key must not be longer than 79 characters, the limit of a PNG keyword.
_KEY = re.compile(r"[A-Za-z][\w./-]{0,71}", re.ASCII)


@dataclass(frozen=True, eq=False)
class Image:
    """A picture of `height` x `width` pixels, with the top row first.

    layers: dict of arrays by name. The layers that visray renders are listed in output/layers.py; others are allowed.
    metadata: dict of facts about how the picture was made. Values are str, int, float or lists of str. `worldToCamera`
        and `worldToNDC` are 4 x 4 matrices, as lists of rows. A row vector is multiplied by them from the right: v M,
        with the translation in the last row of M.

    Shapes: layers (H, W) or (H, W, n).
    """

    layers: dict[str, np.ndarray]
    metadata: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not (isinstance(self.layers, dict) and all(isinstance(x, np.ndarray) for x in self.layers.values())):
            raise UserError("image: its layers are a dict of NumPy arrays by name")
        if not isinstance(self.metadata, dict):
            raise UserError("image: its metadata are a dict by name")
        if not self.layers:
            raise UserError("image: it has no layers; give at least one, such as RGB")
        if next(iter(self.layers.values())).ndim < 2:
            raise UserError("image: a layer has the shape (height, width) or (height, width, n)")
        for name, values in self.layers.items():
            if values.ndim not in (2, 3) or values.shape[:2] != (self.height, self.width) or not values.size:
                first = next(iter(self.layers))
                shape = f"({self.height}, {self.width}) or ({self.height}, {self.width}, n), as '{first}'"
                raise UserError(f"image: layer '{name}' has the shape {values.shape}; right would be {shape}")

    @checked_arguments
    def __getitem__(self, name: str) -> np.ndarray:
        """One layer. Shapes: (H, W) or (H, W, n)."""
        self.check_layers([name])
        return self.layers[name]

    @property
    def height(self) -> int:
        return next(iter(self.layers.values())).shape[0]

    @property
    def width(self) -> int:
        return next(iter(self.layers.values())).shape[1]

    @property
    def objects(self) -> dict[str, int]:
        """Numbers of objects in layer id, by name: of the objects of the scene, and of those rows of data that are seen
        in some pixel. Raises a UserError if the picture does not say them."""
        try:
            return json.loads(self.metadata["objects"])
        except KeyError:
            raise UserError("image: its metadata have no numbers of objects; pictures that visray renders do") from None

    def __repr__(self) -> str:
        return f"<Image {self.width} x {self.height}: {', '.join(self.layers)}>"

    @property
    def rgb(self) -> np.ndarray:
        """The colour in linear light: layer RGB. Shape: (H, W, 3)."""
        return self["RGB"]

    @property
    def alpha(self) -> np.ndarray:
        """The coverage of each pixel: layer A; 1 everywhere if the picture does not have it. Shape: (H, W)."""
        return self.layers["A"] if "A" in self.layers else np.ones((self.height, self.width), np.float32)

    @property
    def interrupted(self) -> bool:
        """Whether Ctrl-C ended the render, so that the picture has fewer samples than were asked for."""
        return bool(self.metadata.get("interrupted"))

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        """The colour in linear light, for NumPy. copy: as in np.array. Shape: (H, W, 3)."""
        return np.asarray(self.rgb, dtype) if copy is None else np.array(self.rgb, dtype, copy=copy)

    def _repr_png_(self) -> bytes | None:
        return self.png() if "RGB" in self.layers else None

    def check_layers(self, names: Sequence[str]) -> None:
        """Raises a UserError, which suggests a similar name, if the picture does not have all of these layers."""
        for name in names:
            if name not in self.layers:
                near = get_close_matches(name, self.layers, 1, 0.5) or get_close_matches(name.upper(), self.layers, 1)
                right = f"did you mean '{near[0]}'?" if near else "it has " + ", ".join(self.layers)
                raise UserError(f"image: there is no layer '{name}'; {right}")

    @checked_arguments
    def write(
        self,
        path: str | os.PathLike[str],
        gamma: Gamma = "srgb",
        exposure: float = 0.0,
        layers: Sequence[str] | None = None,
        float32: bool = False,
        legend: bool = True,
    ) -> None:
        """Writes an .exr file with layers in linear light, or a .png file with the colour in 8 bits.

        path: its suffix chooses the format.
        gamma, exposure: display curve and exposure in stops; only for PNG files.
        layers: names of the layers to write, only for EXR files; None means all.
        float32: whether colours in EXR files are float. By default they are half, which ends at 65504: larger numbers
            are clamped, with a warning.
        legend: whether layer legend is drawn over the colour; only for PNG files.
        """
        check_destination(path, gamma, exposure, layers)
        if _suffix(path) == ".png":
            png.write_png(path, self._encoded(self._facts_for(path, gamma, exposure), gamma, exposure, legend))
            return
        facts = self._facts_for(path, gamma, exposure, float32)
        names = list(self.layers) if layers is None else list(layers)
        if not names:
            raise UserError(f"{path}: no layers were chosen; name some of {', '.join(self.layers)}")
        facts |= {"float32": 1} if float32 else {}
        exr.write_exr(path, {name: _checked(self, name) for name in names}, facts, float32)

    # The name that other libraries have for it.
    save = write

    @staticmethod
    @checked_arguments
    def read(path: str | os.PathLike[str]) -> "Image":
        """The picture in an EXR file of one part. Colours are not converted, whatever colour space the file states."""
        layers, facts = exr.read_exr(path)
        try:
            return Image(layers, facts)
        except UserError as error:
            raise UserError(f"{path}: {error}") from error

    @checked_arguments
    def png(self, gamma: Gamma = "srgb", exposure: float = 0.0, legend: bool = True) -> bytes:
        """The bytes of a PNG file with the colour.

        gamma, exposure, legend: as in `display`.
        """
        return self._encoded(self.provenance(), gamma, exposure, legend)

    @checked_arguments
    def show(self, gamma: Gamma = "srgb", exposure: float = 0.0, legend: bool = True) -> None:
        """Shows the picture: in a notebook there, else in the system's viewer, which is not waited for. Raises a
        UserError if no program shows pictures.

        gamma, exposure, legend: as in `display`.
        """
        data = self.png(gamma, exposure, legend)
        if not system_viewer.show_in_notebook(data):
            system_viewer.check_viewer('write a file, image.write("picture.png")')
            system_viewer.show_png(data)

    def _encoded(self, facts: dict[str, Any], gamma: Gamma, exposure: float, legend: bool) -> bytes:
        """The bytes of a PNG file with the colour, and with the given facts as metadata."""
        facts = facts | {"gamma": gamma, "exposure": exposure}
        return png.encode(self.display(gamma, exposure, legend), facts, gamma == "srgb")

    def legend(self) -> "Image":
        """The legend alone, with a transparent background. Raises a UserError if the picture has none."""
        if LEGEND not in self.layers:
            raise UserError("image: it has no legend; render a scene with data.legend")
        layer = self._legend()
        return Image({"RGB": layer[..., :3], "A": layer[..., 3]})

    def _legend(self) -> np.ndarray:
        """The layer of the legend. Shape: (H, W, 4)."""
        layer = _checked(self, LEGEND)
        if layer.shape[2:] != (4,):
            raise UserError(f"image: layer '{LEGEND}' has the shape {layer.shape}; right would be (height, width, 4)")
        return layer

    @checked_arguments
    def display(self, gamma: Gamma = "srgb", exposure: float = 0.0, legend: bool = True) -> np.ndarray:
        """The colour as 8-bit numbers for a screen. Unless layer A is 1 everywhere, alpha is the fourth number, and the
        colour is not premultiplied by alpha.

        gamma, exposure: display curve and exposure in stops. legend: whether layer legend is drawn over the colour; it
            is not exposed.

        Shapes: uint8 (H, W, 3), or (H, W, 4) with alpha.
        """
        check_curve(gamma, exposure)
        rgb = _checked(self, "RGB").astype(np.float64)
        alpha = np.clip(_checked(self, "A").astype(np.float64), 0, 1) if "A" in self.layers else np.ones(rgb.shape[:2])
        opaque = bool((alpha == 1).all())
        if not opaque:
            rgb = np.divide(rgb, alpha[..., None], out=np.zeros_like(rgb), where=alpha[..., None] > 0)
        display = curve(np.clip(rgb * 2.0**exposure, 0, 1), gamma)
        if legend and LEGEND in self.layers:
            display, alpha = drawn_over(display, alpha, self._legend(), gamma)
        if not opaque:
            display = np.dstack([display, alpha])
        return np.floor(display * 255 + 0.5).astype(np.uint8)

    def _facts_for(
        self, path: str | os.PathLike[str], gamma: Gamma, exposure: float, float32: bool = False
    ) -> dict[str, Any]:
        """The metadata for the file at `path`.

        If the picture was made by adaptive sampling, and its error does not contain the rounding of a file yet, the
        rounding of this file is added. Warns if the sum exceeds the error that was asked for.
        """
        facts = self.provenance()
        if facts.get("file_error") != 0 or "RGB" not in self.layers:
            return facts
        rgb = _checked(self, "RGB").astype(np.float64)
        luminance = float((rgb @ LUMINANCE).mean())
        if luminance <= 0:
            return facts
        off = rounding(rgb, path, gamma, exposure, float32) / luminance
        facts |= {key: hypot(facts[key], off) for key in ("error", "error_low", "error_high")} | {"file_error": off}
        if facts["error_high"] > facts.get("error_asked", inf) >= self.metadata["error_high"]:
            text = f"{os.fspath(path)}: the file rounds, which alone is off by {off:.2g}: its error is up to "
            text += f"{facts['error_high']:.2g}, and {facts['error_asked']:g} was asked for"
            warnings.warn(text, GoalWarning, stacklevel=4)
        return facts

    def provenance(self) -> dict[str, Any]:
        """The metadata of a file: those of the picture, and `software`, `capDate` (local time) and `utcOffset` (in
        seconds)."""
        for key in self.metadata:
            if not _KEY.fullmatch(key):
                raise UserError(f"image: metadata key '{key}' cannot be written; use up to 72 of A-Z a-z 0-9 _ . / -")
        now = datetime.now().astimezone()
        # OpenEXR's sign: UTC = local time + utcOffset.
        offset = -now.utcoffset().total_seconds()
        stamp = {"capDate": f"{now:%Y:%m:%d %H:%M:%S}", "utcOffset": offset}
        given = {key: value.item() if isinstance(value, np.generic) else value for key, value in self.metadata.items()}
        return {"software": f"visray {__version__}"} | ({} if "capDate" in given else stamp) | given


def _checked(image: Image, name: str) -> np.ndarray:
    """The array of a layer. If one of its numbers is NaN, raises a UserError that names the first such pixel."""
    values = image[name]
    bad = np.isnan(values) if np.issubdtype(values.dtype, np.floating) else np.zeros(1, bool)
    if bad.any():
        y, x = np.argwhere(bad)[0][:2]
        count = int(bad.reshape(image.height, image.width, -1).any(axis=2).sum())
        where = f"pixel (x {x}, y {y})" + (f" and {count - 1} more" if count > 1 else "")
        raise UserError(f"image: layer '{name}' is not a number (NaN) at {where}; nothing was written")
    return values


def check_curve(gamma: Gamma, exposure: float) -> None:
    """Raises a UserError if `gamma` or `exposure` is not valid."""
    if not (isinstance(gamma, str) and gamma == "srgb") and not (_real(gamma) and gamma > 0):
        raise UserError(f"gamma: {gamma!r} cannot be used; give 'srgb' or a number above 0, such as 2.2")
    if not (_real(exposure) and abs(exposure) <= 100):
        raise UserError(f"exposure: {exposure!r} cannot be used; give a number of stops from -100 to 100, such as -1")


def check_destination(
    path: str | os.PathLike[str],
    gamma: Gamma = "srgb",
    exposure: float = 0.0,
    layers: Sequence[str] | None = None,
) -> None:
    """Raises a UserError if `Image.write` would fail with these arguments. Call this before a long render."""
    check_curve(gamma, exposure)
    if _suffix(path) == ".png" and layers is not None:
        raise UserError(f"{path}: a PNG file holds the colour alone, so layers do not apply; write an .exr")
    files.check_writable(path)


def _suffix(path: str | os.PathLike[str]) -> str:
    """The suffix of a file name, .exr or .png. Raises a UserError for any other suffix."""
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise UserError(f"{path}: the name says no format visray writes; end it in {' or '.join(SUFFIXES)}")
    return suffix


def _real(value: Any) -> bool:
    """Whether a value is a finite number."""
    return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)
