"""A click on the picture: the story of its pixel, the focus, and the point around which the mouse turns the camera."""

import math
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from visray import terminal
from visray.camera import OrthographicCamera
from visray.errors import UserError
from visray.live.client import Client
from visray.live.live import Live, Pick
from visray.live.page_script import show_tab
from visray.live.story_page import invitation, looking, story_page
from visray.live.tabs import tab
from visray.setup import Prepared
from visray.study.pixel.why import why

# A lens that is opened where there was none: what is far away is blurred to this share of the picture's height.
BLUR = 0.03


@dataclass
class _Widgets:
    """What one browser shows.

    there: button in the tab of the scene that shows the story
    pick: its newest click
    """

    story: Any
    focus: Any
    turn: Any
    there: Any
    pick: Pick | None = None


class PixelPart:
    """The story of a pixel, for each browser its own."""

    def __init__(self, live: Live):
        self.live = live
        self.tab = tab(live.server, "Pixel")
        self.widgets: dict[int, _Widgets] = {}
        live.on_client(self.came)
        live.on_leave(lambda client: self.widgets.pop(client.number, None))
        live.server.scene.on_click()(live.safely(self.clicked))

    def came(self, client: Client) -> None:
        """A browser has come."""
        gui = client.handle.gui
        with self.tab:
            story = gui.add_html(invitation(), order=0)
            focus = gui.add_button(
                "Focus here", order=1, visible=False, icon="focus-2", hint="Makes what was clicked sharp"
            )
            turn = gui.add_button(
                "Turn around this point", order=2, visible=False, icon="3d-rotate",
                hint="The mouse turns the camera around what was clicked",
            )  # fmt: skip
        with tab(self.live.server, "Scene"):
            there = gui.add_button("", order=-1, visible=False, icon="help", color="gray")
        self.widgets[client.number] = _Widgets(story, focus, turn, there)
        there.on_click(self.live.safely(lambda event: show_tab(client.handle, "Pixel")))
        focus.on_click(self.live.safely(partial(self.focus, client)))
        turn.on_click(self.live.safely(partial(self.turn, client)))

    def clicked(self, event: Any) -> None:
        """A browser was clicked."""
        client = self.live.clients.get(event.client_id)
        if client is None:
            return
        widgets = self.widgets[client.number]
        widgets.story.content = looking()
        story, size = self.live.ask(partial(story_at, position=event.screen_pos), client)
        first = story.surfaces[0]
        pick = Pick(client, (story.x, story.y), size, first.object, first.point, story)
        widgets.pick = pick
        widgets.story.content = story_page(story)
        widgets.there.label = terminal.printable(f"Pixel: why {first.object or 'the background'} looks so")
        widgets.there.visible = True
        widgets.turn.visible = first.point is not None
        widgets.focus.visible = first.point is not None and not isinstance(client.camera, OrthographicCamera)
        self.live.picked(pick)

    def focus(self, client: Client, _: Any) -> None:
        """Makes sharp what was clicked."""
        pick, camera = self.widgets[client.number].pick, client.camera
        values = focused(camera, pick.point)
        self.live.engine.assign(values)
        opened = values.get("camera.aperture")
        more = "" if opened is None else f". The lens had no opening; camera.aperture is now {opened:.3g}"
        self.live.tell(f"In focus: {values['camera.focus']:.4g} from the camera{more}", client)

    def turn(self, client: Client, _: Any) -> None:
        """Makes the camera turn around what was clicked."""
        client.turn_around(self.widgets[client.number].pick.point)


def story_at(prepared: Prepared, position: tuple[float, float]) -> tuple[Any, tuple[int, int]]:
    """The story of the pixel at a position in a picture, and the width and height of the picture.

    position: from (0, 0) at the top left to (1, 1)
    """
    size = prepared.scene.film.size
    x, y = (min(max(int(p * n), 0), n - 1) for p, n in zip(position, size))
    return why(prepared, x, y), size


def focused(camera: Any, point: tuple[float, float, float]) -> dict[str, float]:
    """What gives a camera the focus at a point: values by address. A camera without a lens gets one.

    Raises a UserError if the camera cannot have a lens, or the point is behind it.
    """
    if isinstance(camera, OrthographicCamera):
        raise UserError("camera.focus: an orthographic camera has no lens, so everything is sharp")
    origin, target = np.array(camera.origin, float), np.array(camera.target, float)
    depth = float((np.array(point) - origin) @ (target - origin) / math.dist(origin, target))
    if depth <= 0:
        raise UserError("camera.focus: the point is behind the camera; click on another one")
    values = {"camera.focus": depth}
    if camera.aperture == 0:
        values["camera.aperture"] = 2 * BLUR * math.tan(math.radians(camera.fov) / 2) * depth
    return values
