"""The worker's side of packages: the scenes that a worker has unpacked and prepared, kept for further tasks."""

import tempfile
import threading
import warnings
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from visray.animation.moment import still_at
from visray.cluster.scene_package import ScenePackage
from visray.moving import moving
from visray.scene.scene import Scene
from visray.setup import Prepared, prepare

# Number of packages that a worker keeps: that of a job, and that of the job before.
KEPT = 2
# A worker does one task after the other: Dr.Jit uses all its threads for each.
ONE_AT_A_TIME = threading.RLock()
_kept: OrderedDict[str, "KeptScene"] = OrderedDict()


@dataclass
class KeptScene:
    """An unpacked scene.

    folder: the folder of its files, which ends with it
    scene: the scene
    prepared: the scene as it was prepared last, for a backend and a moment
    made: what was made of it last, by what was asked for
    """

    folder: tempfile.TemporaryDirectory
    scene: Scene
    prepared: dict[tuple[str, float | None], Prepared] = field(default_factory=dict)
    made: dict[Any, Any] = field(default_factory=dict)

    def made_once(self, key: Any, make: Callable[[], Any]) -> Any:
        """What `make` returned when it was last called with this key. Only the last one is kept."""
        if key not in self.made:
            self.made.clear()
            self.made[key] = make()
        return self.made[key]


def kept_scene(package: ScenePackage) -> KeptScene:
    """The scene of a package, unpacked when it is first asked for. Domain: ONE_AT_A_TIME is held."""
    kept = _kept.pop(package.digest, None)
    if kept is None:
        folder = tempfile.TemporaryDirectory(prefix="visray-", dir=_folder_of_worker())
        kept = KeptScene(folder, package.unpacked(Path(folder.name)))
    _kept[package.digest] = kept
    while len(_kept) > KEPT:
        _kept.popitem(last=False)
    return kept


def _folder_of_worker() -> str:
    """Folder of Dask's worker. Dask removes those of workers that were killed, when another one starts there."""
    from distributed import get_worker

    return get_worker().local_directory


def kept_prepared(package: ScenePackage, backend: str, at: float | None) -> Prepared:
    """The prepared scene of a package. Domain: ONE_AT_A_TIME is held.

    at: moment of an animated scene, as in vr.render

    Notes about the scene are left out, because the client makes them too.
    """
    kept = kept_scene(package)
    if (backend, at) not in kept.prepared:
        with warnings.catch_warnings(action="ignore"):
            prepared = prepare(still_at(kept.scene, at), backend)
            if kept.scene.animation is not None:
                prepared = moving(prepared, kept.scene, at or 0.0)
        kept.prepared = {(backend, at): prepared}
    return kept.prepared[backend, at]
