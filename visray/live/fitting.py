"""The part of the page of a live picture that fits clip, camera and lights to a surface again, after it has changed."""

from typing import Any

from visray.errors import UserError
from visray.live.client import Client
from visray.live.engine import Change
from visray.live.live import Live
from visray.live.tabs import tab
from visray.live.viewpoint import Pose, pose_of
from visray.scene.scene import Scene
from visray.surface_picture.reading import SURFACE
from visray.surface_picture.recipe import Recipe, fitted_values, recipe_of


class FittingPart:
    """A button that shows a surface as `visray surface` would show it now, with its parameters as they are.

    The fitted camera becomes that of the scene. The browser in which the button is pressed goes there, and those that
    nobody has moved; others stay where they are.
    """

    def __init__(self, live: Live):
        self.live = live
        self._staying: list[tuple[Client, Pose]] = []
        found = recipe_of(live.engine.scene)
        if found is None:
            return
        self._formula = found.formula
        with tab(live.server, "Scene"):
            self.button = live.server.gui.add_button(
                "Fit to the surface", hint="Clip, camera and lights, as a new picture with these parameters has them"
            )
        self.button.on_click(live.safely(self.fit))
        live.engine.on_scene(self.changed)

    def fit(self, event: Any) -> None:
        """Fits clip, camera and lights."""
        scene, asking = self.live.engine.scene, self.live.client_of(event)
        values = fitted_values(scene, self._recipe(scene).picture()[0])
        if not values:
            if asking is not None:
                asking.go_home()
            return
        others = [client for client in self.live.clients.values() if client is not asking and not client.at_home]
        self._staying = [(client, pose_of(client.camera, self.live.space)) for client in others]
        self.live.engine.assign(values)
        if asking is not None and not any(address.startswith("camera") for address in values):
            asking.go_home()

    def changed(self, change: Change) -> None:
        """The scene has changed: browsers that others have moved return to where they were."""
        if self._staying and any(address.startswith("camera") for address in change.addresses):
            staying, self._staying = self._staying, []
            for client, pose in staying:
                client.go_to(pose)

    def _recipe(self, scene: Scene) -> Recipe:
        """How the surface of a scene is shown anew. Raises a UserError if the scene shows something else by now."""
        found = recipe_of(scene)
        if found is None:
            raise UserError(f"objects.{SURFACE}: is no surface of a formula with a ball as its clip any more")
        if self.live.recipe is None or found.formula != self._formula:
            return found
        return self.live.recipe.with_values(found.parameters, found.wishes.size)
