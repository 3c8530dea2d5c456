"""Pictures with derivatives for PyTorch: a PictureFunction whose values and picture are tensors of PyTorch.

Dr.Jit's own bridge (dr.wrap) gives the first derivative once more if PyTorch asks one picture for a second one, as for
the rows of a Jacobian. So the bridge here is PyTorch's own.
"""

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np

from visray.errors import UserError


def picture(function: Any, values: Sequence[Any]) -> Any:
    """The picture as a tensor, with derivatives in reverse mode by those values that need them.

    function: the PictureFunction
    values: for each address a tensor on the CPU, or numbers
    """
    import torch

    floating = [v.dtype for v in values if isinstance(v, torch.Tensor) and v.is_floating_point()]
    kind = torch.float64 if torch.float64 in floating else torch.float32
    tensors = []
    for i, value in enumerate(values):
        if not isinstance(value, torch.Tensor):
            value = torch.from_numpy(np.array(function.numbers(i, value)))
        elif value.device.type != "cpu":
            problem = f"the tensor is on the device {value.device}, and pictures are made on the CPU"
            raise UserError(f"{function.addresses[i]}: {problem}; give value.cpu()")
        elif value.is_complex():
            raise UserError(f"{function.addresses[i]}: the tensor has complex numbers; give real ones")
        function.check_shape(i, tuple(value.shape))
        tensors.append(value.to(kind))
    return _operation().apply(function, kind, *tensors)


@cache
def _operation() -> Any:
    """The class of the operation of PyTorch that makes pictures. It is made once, when PyTorch is first needed."""
    import torch

    class Picture(torch.autograd.Function):
        """A picture of numbers as an operation of PyTorch."""

        @staticmethod
        def forward(ctx: Any, function: Any, kind: Any, *numbers: Any) -> Any:
            """The picture of a PictureFunction. kind: type of its numbers"""
            ctx.function, ctx.kind = function, kind
            ctx.numbers = [x.detach().numpy().astype(float) for x in numbers]
            ctx.traced = function.traced(ctx.numbers)
            return torch.from_numpy(ctx.traced.image).to(kind)

        @staticmethod
        @torch.autograd.function.once_differentiable
        def backward(ctx: Any, adjoint: Any) -> tuple:
            """The derivatives of a loss by the numbers. adjoint: the derivative by the picture"""
            # A traced picture serves once.
            traced, ctx.traced = ctx.traced or ctx.function.traced(ctx.numbers), None
            slopes = traced.pull(adjoint.numpy().astype(float))
            return None, None, *(torch.from_numpy(x).to(ctx.kind) for x in slopes)

    return Picture
