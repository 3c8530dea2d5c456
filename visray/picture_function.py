"""A picture as a differentiable function of numbers of its scene, for Dr.Jit, PyTorch and JAX.

An address is the dotted name of a value in a scene, such as `objects.ball.radius` (scene/address.py).
"""

from collections.abc import Sequence
from typing import Any

import drjit as dr
import numpy as np

from visray import jax_picture, torch_picture
from visray.animation.moment import still_at
from visray.arguments import checked_arguments, shown
from visray.errors import UserError
from visray.gradients import Derivatives
from visray.number_table import NumberTable
from visray.progress import Bar, Interrupts
from visray.quantities import Arrays, Quantity
from visray.scene import address as addresses_of
from visray.scene.adjusted import adjusted
from visray.scene.edits import canonical, within
from visray.scene.scene import Scene
from visray.setup import arrays
from visray.traced_picture import PictureOperation, TracedPicture, of_kind

# By the first part of the name of a type's module: the function that makes a picture of arrays of this type.
FRAMEWORKS = {"torch": torch_picture.picture, "jax": jax_picture.picture, "jaxlib": jax_picture.picture}


class PictureFunction:
    """A picture as a function of the numbers at some addresses; `vr.render_function` makes one.

    addresses: the addresses, in the order of the function's arguments
    shapes: shape of each argument: () for a number, (3) for a triple, (N, 3) for the N vertices of a mesh
    """

    def __init__(self, scene: Scene, addresses: Sequence[str], backend: str, progress: bool):
        """Raises UserError if a number has no derivative."""
        self.scene, self.addresses, self.progress = scene, tuple(addresses), progress
        self.a: Arrays = arrays(backend, scene.settings.precision)
        for address in self.addresses:
            _check_numeric(scene, address)
        self.shapes = tuple(x.shape for x in self.start)

    def __repr__(self) -> str:
        height, width, _ = self.shape
        return f"PictureFunction({', '.join(self.addresses)}) -> picture of {width} x {height} pixels"

    @property
    def start(self) -> tuple[np.ndarray, ...]:
        """The numbers that the scene has at the addresses, as arrays in double."""
        found = (addresses_of.value(self.scene, address) for address in self.addresses)
        return tuple(np.array(x.values if isinstance(x, NumberTable) else x, float) for x in found)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Shape of the picture: (H, W, 3)."""
        return *self.scene.film.raster[::-1], 3

    def __call__(self, *values: Any, seed: int | None = None) -> Any:
        """The picture with other numbers, in linear light. Shapes: (H, W, 3).

        values: for each address a number or an array of its shape: of PyTorch, of JAX, or of Dr.Jit. The picture is an
            array of the same library, and carries derivatives by those values that do. With plain numbers and arrays of
            NumPy alone, the picture is an array of NumPy.
        seed: seed of the random numbers; None: that of the scene
        """
        if len(values) != len(self.addresses):
            names = ", ".join(self.addresses)
            raise UserError(f"values: there are {len(values)}; give one for each of {names}")
        function = self if seed is None else self._with_seed(seed)
        libraries = {type(v).__module__.partition(".")[0] for v in values} & set(FRAMEWORKS)
        pictures = {FRAMEWORKS[name] for name in libraries}
        if len(pictures) > 1 or (pictures and any(map(dr.is_array_v, values))):
            raise UserError("values: are arrays of several libraries; give those of one, or plain numbers")
        if pictures:
            return pictures.pop()(function, values)
        if any(map(dr.is_array_v, values)):
            return function._of_arrays(values)
        return function.traced([function.numbers(i, v) for i, v in enumerate(values)]).image

    def _with_seed(self, seed: int) -> "PictureFunction":
        """The function with another seed."""
        return PictureFunction(adjusted(self.scene, seed=seed), self.addresses, self.a.backend, self.progress)

    def check_shape(self, i: int, shape: tuple[int, ...]) -> None:
        """Raises UserError if the value number i has another shape than it must."""
        if tuple(shape) != self.shapes[i]:
            right = self.shapes[i] or "() for a single number"
            raise UserError(f"{self.addresses[i]}: the value has the shape {tuple(shape)}; it must be {right}")

    def numbers(self, i: int, value: Any) -> np.ndarray:
        """The value number i as an array in double. Raises UserError if it is of another shape, or no array."""
        try:
            if np.iscomplexobj(np.asarray(value)):
                raise TypeError
            made = np.asarray(value, float)
        except (TypeError, ValueError):
            raise UserError(f"{self.addresses[i]} = {shown(value)}: must be numbers") from None
        self.check_shape(i, made.shape)
        return made

    def tensor(self, i: int, value: Any) -> Any:
        """The value number i as a tensor of Dr.Jit, with derivatives if the value has them."""
        if not dr.is_array_v(value):
            return of_kind(dr.tensor_t(self.a.D), self.numbers(i, value))
        if not dr.is_tensor_v(value):
            flat, shape = dr.ravel(value), self.shapes[i]
            if len(shape) > 1 or dr.width(flat) != int(np.prod(shape)):
                self.check_shape(i, dr.shape(value))
            value = dr.tensor_t(type(flat))(flat, shape=shape)
        self.check_shape(i, value.shape)
        return value

    def _of_arrays(self, values: Sequence[Any]) -> Any:
        """The picture as a tensor of Dr.Jit, with derivatives by those values that have them. It has double precision
        if an array of Dr.Jit among the values has, else single."""
        double = any(dr.is_array_v(v) and dr.type_v(v) == dr.VarType.Float64 for v in values)
        tensors = [self.tensor(i, v) for i, v in enumerate(values)]
        numbers = [np.array(dr.detach(x), float).reshape(shape) for x, shape in zip(tensors, self.shapes)]
        kind = dr.tensor_t(self.a.D if double else self.a.F32)
        # Traced here, because Dr.Jit would hide an error of the user's in one of its own.
        return dr.custom(PictureOperation, self, numbers, self.traced(numbers), kind, tensors)

    def traced(self, values: Sequence[np.ndarray]) -> TracedPicture:
        """The picture with these numbers, traced for reverse mode."""
        return self._traced(values, None)[0]

    def tangent(self, values: Sequence[np.ndarray], tangents: Sequence[np.ndarray]) -> np.ndarray:
        """Derivative of the picture along a direction, in forward mode. Shapes: (H, W, 3).

        tangents: how much each of the values grows
        """
        return self._traced(values, dict(zip(self.addresses, tangents)))[1]

    def _traced(
        self, values: Sequence[np.ndarray], tangents: dict[str, np.ndarray] | None
    ) -> tuple[TracedPicture, np.ndarray]:
        """The traced picture and its tangent. tangents: as for Derivatives"""
        new = {canonical(address): _plain(value) for address, value in zip(self.addresses, values)}
        scene = addresses_of.changed(self.scene, new)
        with (
            Interrupts() as interrupts,
            Bar("differentiating", 1, self.progress, before="compiling derivatives") as bar,
        ):
            derivatives = Derivatives(scene, self.addresses, self.a.backend, tangents)
            traced = derivatives.traced(interrupts, bar)
            pictures = traced.picture()
        images = np.empty((2, len(derivatives.prepared.order), 3))
        images[:, derivatives.prepared.order] = np.stack(pictures).swapaxes(1, 2)
        image, tangent = images.reshape(2, *self.shape)
        return TracedPicture(derivatives, traced, image), tangent


def _plain(value: np.ndarray) -> Any:
    """Numbers as a scene holds them: a number, a triple, or a table."""
    return float(value) if value.ndim == 0 else tuple(map(float, value)) if value.ndim == 1 else value


def _check_numeric(scene: Scene, address: str) -> None:
    """Raises UserError if an address names no numbers."""
    value = addresses_of.value(scene, address)
    known: Quantity | None = addresses_of.numeric_addresses(scene).get(canonical(address))
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if is_number and known is None and address.startswith("settings."):
        raise UserError(f"{address}: the picture does not depend on it smoothly; name a number of a part of the scene")
    if not (known or is_number or isinstance(value, NumberTable)):
        raise UserError(f"{address}: is not one number or three; name one of its parts")


@checked_arguments
def render_function(
    scene: Scene,
    addresses: Sequence[str],
    *,
    spp: int | None = None,
    size: tuple[int, int] | None = None,
    precision: str = "double",
    backend: str = "llvm",
    progress: bool = True,
) -> PictureFunction:
    """A picture as a differentiable function of the numbers at some addresses, for PyTorch, JAX and Dr.Jit.

    render = vr.render_function(scene, ["materials.red.kd", "objects.ball.center"], spp=16)
    kd, center = (torch.tensor(x, requires_grad=True) for x in render.start)
    picture = render(kd, center)                # a tensor, shape (H, W, 3), in linear light
    ((picture - target) ** 2).mean().backward()  # kd.grad, center.grad

    addresses: the addresses, or a single one
    spp: samples per pixel; like `size` (width, height) and `precision`, it replaces the value of the scene
    progress: whether a progress bar is shown, after two seconds

    All calls take the same samples, unless a call has another `seed`. Derivatives are those of `gradient`: they leave
    out moving edges, with an EdgeWarning. No call after the first compiles anything. PyTorch and JAX have
    reverse mode, Dr.Jit has forward mode too. Arrays must be on the CPU.
    """
    names = [addresses] if isinstance(addresses, str) else list(addresses)
    if not names:
        raise UserError("addresses: there is none; name the numbers, such as materials.red.kd")
    for i, name in enumerate(names):
        if (other := next((x for x in names[:i] if within(name, x) or within(x, name)), None)) is not None:
            twice = "is there twice" if name == other else f"overlaps {other}"
            raise UserError(f"addresses: {name} {twice}; name each number once")
    scene = still_at(adjusted(scene, precision=precision, spp=spp, size=size), None)
    return PictureFunction(scene, names, backend, progress)
