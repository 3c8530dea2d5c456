"""Derivatives by numbers of data: those of differences, or a refusal where there is none."""

import numpy as np
import pytest

import visray as vr
from visray.errors import UserError
from visray.scene.check import checked

HEIGHT = vr.SizeRule(column="rain", range=(0.2, 1.0), domain=(0, 10))
COLOR = vr.ColorRule(column="heat", domain=(0, 30))
TABLE = {
    "lon": [10.0, 60.0, -50.0, 100.0], "lat": [20.0, -10.0, 40.0, 5.0], "rain": [3.0, 5.0, 7.0, 0.0],
    "heat": [4.0, 9.0, 20.0, None], "same": [2.0, 2.0, 2.0, 2.0],
    "wind": [1.0, 6.0, 4.0, 9.0],
}  # fmt: skip


def scene(**fields) -> vr.Scene:
    layer = {"source": TABLE, "gizmo": "box", "height": HEIGHT, "radius": 0.3, "color": COLOR} | fields
    return checked(
        vr.Scene(
            camera=vr.Camera(origin=(3, 2.5, 2.5), fov=45),
            film=vr.Film(width=16, height=12),
            lights={"key": vr.PointLight(position=(4, 6, 5))},
            data=vr.Data(base=vr.MapBase(width=6), layers={"rain": vr.DataLayer(**layer)}),
            settings=vr.Settings(spp=4, precision="double"),
        )
    )


ENDS = "as the domain of its rule changes with it; give the rule a domain"


@pytest.mark.parametrize(
    ("fields", "address", "reason"),
    [
        ({}, "data.rain.3.color", "as this number is missing"),
        ({}, "data.rain.3.height", "as its rule is infinitely steep there"),
        ({"height": vr.SizeRule(column="rain", scale="sqrt", range=(0, 1))}, "data.rain.2.height", ENDS),
        ({"height": "rain"}, "data.rain.2.height", ENDS),
        ({"height": vr.SizeRule(column="wind", scale="log", range=(0.1, 1))}, "data.rain.0.height", ENDS),
        ({"height": vr.SizeRule(column="same", scale="log", range=(0.1, 1))}, "data.rain.0.height", ENDS),
        ({"color": "heat"}, "data.rain.0.color", ENDS),
        ({"color": "heat"}, "data.rain.2.color", ENDS),
        ({"color": "same"}, "data.rain.1.color", ENDS),
        ({"color": vr.ColorRule(column="heat", norm="symmetric", center=0.1)}, "data.rain.2.color", ENDS),
        ({"color": vr.ColorRule(column="heat", norm="quantile")}, "data.rain.1.color", ENDS),
        ({"color": vr.ColorRule(column="heat", norm="quantile", domain=(0, 30))}, "data.rain.1.color", ENDS),
    ],
)
def test_numbers_without_a_derivative_are_refused(fields: dict, address: str, reason: str) -> None:
    with pytest.raises(UserError) as caught:
        vr.derivative(scene(**fields), address, progress=False)
    assert caught.value.lines == (f"{address}: has no derivative, {reason}",)


@pytest.mark.parametrize(
    ("fields", "address"),
    [
        ({"height": "rain"}, "data.rain.1.height"),
        ({"color": "heat"}, "data.rain.1.color"),
        ({"color": vr.ColorRule(column="heat", norm="symmetric", center=0.1)}, "data.rain.1.color"),
        ({"color": vr.ColorRule(column="heat", norm="log")}, "data.rain.1.color"),
        ({"color": vr.ColorRule(column="heat", bands=4)}, "data.rain.1.color"),
    ],
)
def test_other_numbers_have_the_derivative_of_differences(fields: dict, address: str) -> None:
    made = scene(**fields)
    attached, step = vr.derivative(made, address, progress=False), vr.difference(made, address)
    assert attached == pytest.approx(step, rel=1e-4, abs=1e-6 * max(1e-3, np.abs(step).max()))
