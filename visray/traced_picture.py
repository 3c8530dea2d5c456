"""A traced picture as an operation of Dr.Jit, with derivatives in forward and in reverse mode."""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from visray.attached_picture import SampleLoop, Sweeps
from visray.gradients import Derivatives


@dataclass(frozen=True)
class TracedPicture:
    """A picture that was traced with derivatives in reverse mode.

    derivatives: the scene with its numbers
    traced: the traced paths
    image: the picture, in linear light. Shapes: (H, W, 3)
    """

    derivatives: Derivatives
    traced: Sweeps | SampleLoop
    image: np.ndarray

    def pull(self, adjoint: np.ndarray) -> list[np.ndarray]:
        """Derivatives of a loss by the numbers at each address, in the order of the addresses.

        adjoint: derivative of the loss by each number of the picture. Shapes: (H, W, 3)
        """
        self.traced.pull(np.ascontiguousarray(adjoint.reshape(-1, 3)[self.derivatives.prepared.order].T, float))
        return [np.array(x) for x in self.derivatives.read().values()]


class PictureOperation(dr.CustomOp):
    """The picture of a PictureFunction as an operation of Dr.Jit."""

    def eval(self, function: Any, values: list[np.ndarray], traced: TracedPicture, kind: type, tensors: list) -> Any:
        """The picture, a tensor. Shapes: (H, W, 3).

        function: the PictureFunction
        values: numbers of the tensors
        kind: type of the result
        """
        self.function, self.values, self.traced, self.kind, self.tensors = function, values, traced, kind, tensors
        return self._put(traced.image)

    def _put(self, image: np.ndarray) -> Any:
        """A picture as a tensor."""
        return of_kind(self.kind, image)

    def forward(self) -> None:
        """Hands tangents of the values on to the picture."""
        grown = self.grad_in("tensors")
        tangents = [np.array(x, float).reshape(v.shape) for x, v in zip(grown, self.values)]
        with dr.resume_grad():
            tangent = self.function.tangent(self.values, tangents)
        self.set_grad_out(self._put(tangent))

    def backward(self) -> None:
        """Hands the adjoint of the picture on to the values."""
        adjoint = np.array(self.grad_out(), float).reshape(self.function.shape)
        with dr.resume_grad():
            # A traced picture serves once.
            traced, self.traced = self.traced or self.function.traced(self.values), None
            slopes = traced.pull(adjoint)
        kinds = [type(dr.detach(x)) for x in self.tensors]
        self.set_grad_in("tensors", [of_kind(kind, x) for kind, x in zip(kinds, slopes)])

    def name(self) -> str:
        """The name in drawings of a graph."""
        return "visray picture"


def of_kind(kind: Any, numbers: np.ndarray) -> Any:
    """A tensor of a type."""
    return kind(dr.array_t(kind)(np.ravel(numbers)), shape=numbers.shape)
