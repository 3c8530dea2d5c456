"""Pictures with derivatives for JAX: a PictureFunction whose values and picture are arrays of JAX.

Dr.Jit's own bridge (dr.wrap) does not lead from JAX to Dr.Jit. So JAX calls back into Python, under jax.jit too.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from visray.errors import UserError


def picture(function: Any, values: Sequence[Any]) -> Any:
    """The picture as an array, with derivatives in reverse mode.

    function: the PictureFunction
    values: for each address an array, or numbers
    """
    import jax
    import jax.numpy as jnp

    for i, value in enumerate(values):
        if not isinstance(value, jax.Array):
            value = function.numbers(i, value)
        elif not isinstance(value, jax.core.Tracer) and any(d.platform != "cpu" for d in value.devices()):
            problem = "the array is on another device than the CPU, on which pictures are made"
            raise UserError(f"{function.addresses[i]}: {problem}; give jax.device_put(value, jax.devices('cpu')[0])")
        elif jnp.iscomplexobj(value):
            raise UserError(f"{function.addresses[i]}: the array has complex numbers; give real ones")
        function.check_shape(i, np.shape(value))
    # Halves would round the picture to 3 digits.
    kind = jnp.result_type(jnp.float32, *(v.dtype for v in values if isinstance(v, jax.Array)))
    arrays = tuple(jnp.asarray(v, kind) for v in values)
    shape = jax.ShapeDtypeStruct(function.shape, kind)
    kept: dict[bytes, Any] = {}

    def called(f: Callable, shapes: Any, *numbers: Any) -> Any:
        """Calls a function of numbers: at once if they are known, else when they are, as under jax.jit. An error of the
        user's is seen as it is only if they are known."""
        if any(isinstance(x, jax.core.Tracer) for x in numbers):
            return jax.pure_callback(f, shapes, *numbers, vmap_method="sequential")
        return jax.tree.map(jnp.asarray, f(*numbers))

    def key(numbers: Sequence[Any]) -> bytes:
        return b"".join(np.asarray(x, float).tobytes() for x in numbers)

    def traced(numbers: Sequence[Any]) -> Any:
        return function.traced([np.asarray(x, float) for x in numbers])

    def rendered(*numbers: Any) -> np.ndarray:
        # Reverse mode comes next with the same numbers, and takes this picture.
        kept.clear()
        kept[key(numbers)] = made = traced(numbers)
        return made.image.astype(kind)

    def pulled(adjoint: Any, *numbers: Any) -> tuple[np.ndarray, ...]:
        made = kept.pop(key(numbers), None) or traced(numbers)
        return tuple(x.astype(kind) for x in made.pull(np.asarray(adjoint, float)))

    @jax.custom_vjp
    def render(*numbers: Any) -> Any:
        return called(rendered, shape, *numbers)

    def forward(*numbers: Any) -> tuple[Any, tuple]:
        return render(*numbers), numbers

    def backward(numbers: tuple, adjoint: Any) -> Any:
        shapes = tuple(jax.ShapeDtypeStruct(x.shape, kind) for x in numbers)
        return called(pulled, shapes, adjoint, *numbers)

    render.defvjp(forward, backward)
    return render(*arrays)
