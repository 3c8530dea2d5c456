"""Pictures with derivatives for PyTorch: a PictureFunction whose values and picture are tensors of PyTorch."""

from collections.abc import Sequence
from typing import Any

import drjit as dr
import numpy as np

from visray.errors import UserError


def picture(function: Any, values: Sequence[Any]) -> Any:
    """The picture as a tensor, with derivatives by those values that need them.

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
        tensors.append(value.to(kind).contiguous())
    return dr.wrap("torch", "drjit")(function.of_tensors)(*tensors)
