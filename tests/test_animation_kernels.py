"""A prepared scene follows all kinds of tracks without another kernel, and shows what the scene of each moment does."""

import drjit as dr
import numpy as np
import pytest
from track_samples import ADDRESSES, DURATION, TRACK_SAMPLES, keys, moving

import visray as vr
from visray.animation.moment import assignments

KINDS = {kind.type: track for kind, track in TRACK_SAMPLES.items()}
TRACKS = KINDS | ADDRESSES


def picture(scene: vr.Scene | vr.Prepared) -> np.ndarray:
    return vr.render(scene, layers=["RGB"], progress=False)["RGB"]


TABLE = {"lon": [0.0, 30.0, -20.0], "lat": [0.0, 20.0, 40.0], "rain": [1.0, 2.0, 3.0]}
COLOR = vr.ColorRule(column="rain", domain=(0, 4), norm="power", exponent=1.0)
HEIGHT = vr.SizeRule(column="rain", domain=(0, 4))
DATA = vr.Scene(
    camera=vr.Camera(origin=(4, 1.5, 0)),
    film=vr.Film(width=24, height=18),
    lights={"key": vr.PointLight(position=(3, 5, 4))},
    data=vr.Data(layers={"rain": vr.DataLayer(source=TABLE, height=HEIGHT, radius=0.15, color=COLOR)}),
    settings=vr.Settings(spp=1),
)
DATA_TRACKS = {
    "a number of a row": keys("data.rain.0.height", 1.0, 3.0),
    "the range of a palette": keys("data.layers.rain.color.domain", (0, 4), (1, 3)),
    "an exponent of a palette": keys("data.layers.rain.color.exponent", 1.0, 3.0),
    "the globe": vr.SpinTrack(of="data.base", turns=0.3),
}


@pytest.mark.slow
@pytest.mark.parametrize("what", DATA_TRACKS)
def test_a_track_of_data_compiles_nothing_after_the_first_frame(what: str) -> None:
    animation = vr.Animation(duration=DURATION, tracks={"track": DATA_TRACKS[what]})
    follows_without_compiling(vr.replaced(DATA, "animation", animation))


@pytest.mark.parametrize("what", [*KINDS, *(pytest.param(x, marks=pytest.mark.slow) for x in ADDRESSES)])
def test_a_track_compiles_nothing_after_the_first_frame(what: str) -> None:
    follows_without_compiling(moving(TRACKS[what]))


def follows_without_compiling(scene: vr.Scene) -> None:
    """Checks that a prepared scene follows its tracks without another kernel, with the bits of the scene of each
    moment."""
    prepared = vr.prepare(vr.at(scene, 0))
    first = picture(prepared)
    # Compiled once by any update: what puts rows into columns.
    picture(prepared.updated(assignments(scene, 0.3)))
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        later = {t: picture(prepared.updated(assignments(scene, t))) for t in (0.0, 0.7, 1.3, 2.0)}
        made = [k for k in dr.kernel_history([dr.KernelType.JIT]) if not k["cache_hit"] or k["cache_disk"]]
    assert not made
    assert np.array_equal(first, later[0.0])
    assert not np.array_equal(first, later[1.3])
    for t, seen in later.items():
        assert np.array_equal(seen, picture(vr.at(scene, t)))


@pytest.mark.slow
@pytest.mark.parametrize(
    "tracks",
    [
        (TRACKS["keys"], vr.SpinTrack(of="objects.ball")),
        (TRACKS["an instance"], vr.SpinTrack(of="objects.copy", axis=(1, 0, 0), turns=0.7)),
        (TRACKS["a parameter"], vr.SpinTrack(of="objects.wave", axis=(1, 0, 0), turns=0.7)),
    ],
)
def test_what_turns_in_place_while_it_moves_compiles_nothing(tracks: tuple) -> None:
    follows_without_compiling(moving(*tracks))
