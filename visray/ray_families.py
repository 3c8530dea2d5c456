"""How each family of rays in a scene, such as camera rays, finds what it hits."""

from collections import Counter

from visray.accel import policy
from visray.camera import OrthographicCamera
from visray.data_columns import layer_sizes
from visray.features import Features, RayFamily
from visray.lights.light import Light
from visray.pack import BatchKeys
from visray.prepared_lights import too_many_lights
from visray.scene.scene import Scene


def ray_families(scene: Scene, features: Features) -> tuple[RayFamily, ...]:
    """How each family of rays in a scene, such as camera rays, finds what it hits, and why: a RayFamily for each."""
    kinds = [type(light) for light in scene.lights.values()]
    batch_sizes: Counter = Counter()
    batch_key = BatchKeys(scene)
    for obj in scene.bodies.values():
        key = batch_key(obj)
        batch_sizes[key] += obj.row_count() if key[0].many_rows else 1
    sizes = [policy.BatchSize(n, kind.bounded) for (kind, _), n in batch_sizes.items()]
    sizes += [policy.BatchSize(n, kind.bounded) for kind, n in layer_sizes(scene)]
    looped = too_many_lights(len(kinds), (size.rows for size in sizes))
    shared = shared_by(features, kinds, looped, isinstance(scene.camera, OrthographicCamera))
    plans = {name: policy.plan(sizes, scene.settings.accelerator, by) for name, by in shared.items()}
    return tuple(RayFamily(name, plan.name, plan.reason) for name, plan in plans.items())


def shared_by(features: Features, kinds: list[type[Light]], looped: bool, parallel: bool) -> dict[str, policy.SharedBy]:
    """What the rays of each family share: a dict from the names of all families of a scene.

    kinds: kinds of the scene's lights
    looped: whether lights are looped over, if there are several of a kind
    parallel: whether the camera is orthographic
    """
    # A single light of its kind is never looped over.
    point_like = [k for k in kinds if k.has_position and not k.has_area and not (looped and kinds.count(k) > 1)]
    families: dict[str, policy.SharedBy] = {"camera, parallel": "direction"}
    if not parallel:
        families = {"camera": "nothing" if features["defocus"] else "origin"}
    if features["shadows"] and point_like:
        families["shadow rays of point and spot lights"] = "origin"
    sunny = [k for k in kinds if not k.has_position and not (looped and kinds.count(k) > 1)]
    if features["shadows"] and sunny:
        families["shadow rays of directional lights"] = "direction"
    other_rays = {
        "shadow rays of other lights": features["shadows"] and len(point_like) + len(sunny) < len(kinds),
        "occlusion rays": features["sky occlusion"] or features["near occlusion"],
        "reflected, refracted and scattered rays": features["paths"],
    }
    return families | {name: "nothing" for name, present in other_rays.items() if present}
