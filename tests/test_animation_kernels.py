"""A prepared scene follows all kinds of tracks without another kernel, and shows what the scene of each moment does."""

import drjit as dr
import numpy as np
import pytest
from track_samples import ADDRESSES, TRACK_SAMPLES, moving

import visray as vr
from visray.animation.moment import assignments

TRACKS = {kind.type: track for kind, track in TRACK_SAMPLES.items()} | ADDRESSES


def picture(scene: vr.Scene | vr.Prepared) -> np.ndarray:
    return vr.render(scene, layers=["RGB"], progress=False)["RGB"]


@pytest.mark.slow
@pytest.mark.parametrize("what", TRACKS)
def test_a_track_compiles_nothing_after_the_first_frame(what: str) -> None:
    scene = moving(TRACKS[what])
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
