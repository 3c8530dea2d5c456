"""The public names of visray. `import visray` imports this module when the first of them is used (__init__.py)."""

# ruff: noqa: F403 - lights and primitives list their own public names
from visray import lights, primitives
from visray.animating import animate
from visray.animation.animation import Animation
from visray.animation.ellipse import Ellipse, EllipseTrack
from visray.animation.keys import KeysTrack
from visray.animation.moment import at
from visray.animation.orbit import OrbitTrack
from visray.animation.path import PathTrack
from visray.animation.spin import SpinTrack
from visray.camera import Camera, OrthographicCamera, Shutter
from visray.checkpoint import Checkpoint
from visray.data.base import GlobeBase, MapBase, PlaneBase
from visray.data.color_rule import ColorRule
from visray.data.data_scene import Data
from visray.data.layer import DataLayer, RowEdit
from visray.data.legend import Legend
from visray.data.size_rule import SizeRule
from visray.data_picture import data_scene
from visray.differences import difference
from visray.edges import EdgeWarning
from visray.environment_map import EnvironmentMap
from visray.errors import UserError
from visray.explaining import explain
from visray.filters import BoxFilter, GaussianFilter, MitchellFilter, TentFilter
from visray.gradients import derivative, gradient
from visray.lights import *
from visray.live.view import view
from visray.materials import Material
from visray.output.image import Image
from visray.output.movie_of_images import write_movie
from visray.picture_function import render_function
from visray.polynomials.catalogue import SURFACES, KnownSurface
from visray.primitives import *
from visray.primitives.clips import Ball, Block
from visray.projection import Projected, projected
from visray.renderer import prepare, render
from visray.scene.address import replaced, value
from visray.scene.film import Film
from visray.scene.load import dump, load
from visray.scene.scene import Occlusion, Scatter, Scene, Settings, SkyGradient
from visray.setup import Prepared
from visray.study.cost.study import cost
from visray.study.cost.tuning import tune
from visray.study.pixel.why import why
from visray.surface_picture.scene import surface_scene
from visray.textures import CheckerTexture, ImageTexture
from visray.transforms import Matrix, Rotate, Scale, Translate
from visray.version import __version__

__all__ = [
    *lights.__all__,
    *primitives.__all__,
    "SURFACES",
    "Animation",
    "Ball",
    "Block",
    "BoxFilter",
    "Camera",
    "CheckerTexture",
    "Checkpoint",
    "ColorRule",
    "Data",
    "DataLayer",
    "EdgeWarning",
    "Ellipse",
    "EllipseTrack",
    "EnvironmentMap",
    "GaussianFilter",
    "GlobeBase",
    "Legend",
    "MapBase",
    "MitchellFilter",
    "PlaneBase",
    "RowEdit",
    "SizeRule",
    "TentFilter",
    "Film",
    "Image",
    "ImageTexture",
    "KeysTrack",
    "KnownSurface",
    "Material",
    "Matrix",
    "Occlusion",
    "OrbitTrack",
    "OrthographicCamera",
    "PathTrack",
    "Prepared",
    "Projected",
    "Rotate",
    "Scale",
    "Scatter",
    "Scene",
    "Settings",
    "Shutter",
    "SkyGradient",
    "SpinTrack",
    "Translate",
    "UserError",
    "__version__",
    "at",
    "animate",
    "cost",
    "data_scene",
    "derivative",
    "difference",
    "dump",
    "explain",
    "gradient",
    "load",
    "prepare",
    "projected",
    "render",
    "render_function",
    "replaced",
    "surface_scene",
    "tune",
    "value",
    "view",
    "why",
    "write_movie",
]  # fmt: skip
