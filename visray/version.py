"""The installed version of visray."""

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version("visray")
except PackageNotFoundError:  # run from a folder that is not installed
    __version__ = "0+unknown"
