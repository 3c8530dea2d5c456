"""The kinds of tracks. A new kind is one file in this folder, its class in KINDS, and one sample in
tests/track_samples.py."""

from visray.animation.ellipse import EllipseTrack
from visray.animation.keys import KeysTrack
from visray.animation.orbit import OrbitTrack
from visray.animation.path import PathTrack
from visray.animation.spin import SpinTrack

KINDS = (KeysTrack, OrbitTrack, SpinTrack, PathTrack, EllipseTrack)
