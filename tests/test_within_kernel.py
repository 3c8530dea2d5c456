"""visray inside a kernel of the caller: while Dr.Jit records a loop or a branch, nothing can be evaluated. Dr.Jit would
end the process; visray refuses."""

from collections.abc import Callable

import drjit as dr
import numpy as np
import pytest
from drjit.llvm.ad import Bool, Float64, UInt32

import visray as vr

SCENE = vr.Scene(
    film=vr.Film(width=4, height=3),
    objects={"ball": vr.Sphere()},
    settings=vr.Settings(spp=1),
    camera=vr.Camera(),
    lights={},
)
CALLS = {
    "render": lambda prepared: vr.render(SCENE),
    "render of a prepared scene": lambda prepared: vr.render(prepared),
    "prepare": lambda prepared: vr.prepare(SCENE),
    "updated": lambda prepared: prepared.updated({"ambient": (0.1, 0.2, 0.3)}),
    "gradient": lambda prepared: vr.gradient(SCENE, "ambient"),
    "derivative": lambda prepared: vr.derivative(SCENE, "ambient"),
    "difference": lambda prepared: vr.difference(SCENE, "ambient"),
}


def in_a_loop(call: Callable, mode: str = "symbolic") -> None:
    def body(i: UInt32, x: Float64) -> tuple:
        call()
        return i + 1, x

    dr.while_loop((dr.opaque(UInt32, 0), dr.opaque(Float64, 1)), lambda i, _: i < 2, body, mode=mode)


def in_a_branch(call: Callable) -> None:
    def body(x: Float64) -> Float64:
        call()
        return x

    dr.if_stmt((dr.opaque(Float64, 1),), dr.opaque(Bool, True), body, lambda x: x, mode="symbolic")


@pytest.mark.parametrize("place", [in_a_loop, in_a_branch])
@pytest.mark.parametrize("name", CALLS)
def test_a_call_within_a_kernel_is_refused(name: str, place: Callable) -> None:
    prepared = vr.prepare(SCENE)
    with pytest.raises(RuntimeError) as refused:
        place(lambda: CALLS[name](prepared))
    assert isinstance(refused.value.__cause__, vr.UserError)
    assert "call it outside" in str(refused.value.__cause__)


def test_a_picture_can_be_rendered_after_a_refusal_and_in_an_evaluated_loop() -> None:
    before = vr.render(SCENE)["RGB"]
    with pytest.raises(RuntimeError):
        in_a_loop(lambda: vr.render(SCENE))
    pictures: list[np.ndarray] = []
    in_a_loop(lambda: pictures.append(vr.render(SCENE)["RGB"]), mode="evaluated")
    assert len(pictures) == 2
    assert all(np.array_equal(p, before) for p in pictures)
