"""What explain says of animated scenes."""

import visray as vr

GO = vr.KeysTrack(address="objects.ball.center", times=(0, 1), values=((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)))
CLEAR = vr.KeysTrack(address="materials.m.kt", times=(0, 1, 2), values=((0.0,) * 3, (0.0,) * 3, (1.0,) * 3))


def notes(*tracks, shutter=None, duration=2.0):
    scene = vr.Scene(
        camera=vr.Camera(shutter=shutter),
        materials={"m": vr.Material()},
        objects={"ball": vr.Sphere(material="m")},
        animation=vr.Animation(duration=duration, fps=4, tracks={f"t{i}": x for i, x in enumerate(tracks)}),
        lights={},
    )
    return [text for text in vr.explain(scene).notes if "animation" in text or "motion" in text]


def test_what_moves_and_how_long():
    moves, blur = notes(GO)
    assert moves.startswith("animation: 2 s, 8 frames, 4 a second; moves objects.ball.center;")
    assert blur == "motion blur: off, as camera.shutter is null"


def test_motion_blur_says_why():
    assert (
        "on, from 0 to 0.5 of a frame; the scene is made for 8 moments" in notes(GO, shutter=vr.Shutter(moments=8))[1]
    )
    rest = vr.KeysTrack(address="objects.ball.radius", times=(0, 1), values=(1.0, 1.0))
    assert notes(rest, shutter=vr.Shutter())[1] == "motion blur: off, as nothing moves while the shutter is open"
    plain = vr.explain(vr.Scene(camera=vr.Camera(shutter=vr.Shutter()), lights={})).notes
    assert plain[0] == "camera.shutter: blurs nothing, as the scene has no animation"


def test_effects_that_come_are_told_with_their_time():
    found = notes(GO, CLEAR)[2:]
    assert len(found) == 1
    assert found[0].startswith("animation: from 1 to 2 s, ") and "refraction begins" in found[0].replace(",", "")
