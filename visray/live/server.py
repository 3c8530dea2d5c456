"""The server of the live picture: viser's, which shows a page, with the pictures that the engine renders."""

import json
import math
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from visray import clock, terminal, work_threads
from visray.errors import UserError
from visray.live import guard, parts
from visray.live.client import Client, camera_of_scene
from visray.live.door import guarded_server
from visray.live.engine import Change, Engine
from visray.live.live import Live
from visray.live.viewpoint import Pose, Space, page_fov, pose_of
from visray.scene.scene import Scene
from visray.surface_picture.recipe import Recipe
from visray.tables import silent_rich

# Seconds that everything has to end. Less than a second, after which Ctrl-C would be thought to be unheard.
PATIENCE = 0.7

# Folds the panel of a narrow page, once. If viser's page gets another structure, the panel stays open.
FOLD = """
if (innerWidth < 576 && !window.visrayFolded) {
  window.visrayFolded = true;
  setTimeout(() => [...document.querySelectorAll("div")]
    .find((d) => d.style.cursor === "pointer" && d.style.height === "3.5em")?.click(), 300);
}
"""


def serve(
    scene: Scene,
    *,
    name: str,
    host: str,
    port: int,
    target: float,
    file: Path | None = None,
    command: Sequence[str] = (),
    load: Callable[[], Scene] | None = None,
    recipe: Recipe | None = None,
) -> Live:
    """Starts a live picture. host, port: where its server listens; the port is free."""
    server = guarded_server(host, port, terminal.printable(name))
    if server.get_port() != port:
        with silent_rich():
            server.stop()
        guard.chosen_port(host, port)
        raise UserError(f"--port = {port}: another program has just taken it; try again")
    engine = Engine(scene, target=target).start()
    live = Live(engine, server, name, Space.around(camera_of_scene(engine)), file, list(command), load, recipe)
    _dress(server, name)
    _set_home(live)
    engine.on_scene(lambda change: _scene_changed(live, change))
    engine.on_error(lambda lines: live.say_errors("scene", lines))
    live.parts = parts.build(live)

    @server.on_client_connect
    async def _(handle: Any) -> None:
        client = Client(live, handle)
        _look(client, handle.camera)
        live.came(client)
        engine.add(client.viewer)

        # As a coroutine it is called in the order of the messages.
        @handle.camera.on_update
        async def _(camera: Any) -> None:
            _look(client, camera)

    @server.on_client_disconnect
    async def _(handle: Any) -> None:
        client = live.clients.get(handle.client_id)
        if client is not None:
            client.leave()
            live.left(client)

    return live


def stop(live: Live) -> bool:
    """Ends a live picture. Returns whether all of it has ended: a thread that compiles may go on for a while."""
    latest = clock.now() + PATIENCE
    _begin_to_stop(live)
    thread = threading.Thread(target=_stop_server, args=(live,), daemon=True)
    thread.start()
    thread.join(PATIENCE)
    return not thread.is_alive() and has_ended(live, latest - clock.now())


def stop_at_the_end(live: Live) -> None:
    """Ends the server of a live picture when Python ends, and begins no thread any more. Waits for no other thread."""
    _begin_to_stop(live)
    _stop_server(live)


def has_ended(live: Live, seconds: float = 0.0) -> bool:
    """Whether all threads of a live picture have ended, after some seconds at most. Domain: it is stopped."""
    return live.engine.stop(seconds) and work_threads.have_ended(seconds, live.threads)


def _begin_to_stop(live: Live) -> None:
    """Asks all threads to stop."""
    live.ended.set()
    live.engine.ask_to_stop()
    live.stopped()
    for client in list(live.clients.values()):
        client.sender.close()


def _stop_server(live: Live) -> None:
    """Ends the server. viser would print a line about it."""
    with silent_rich():
        live.server.stop()


def _dress(server: Any, name: str) -> None:
    """What the page looks like. On phones viser puts the panel before the picture, so it is folded at first."""
    from viser._messages import RunJavascriptMessage

    server.gui.configure_theme(show_logo=False, show_share_button=False, control_width="medium")
    server.gui.main_panel.dock_right()
    title = json.dumps(f"{terminal.printable(name)} - visray")
    server._websock_server.queue_message(RunJavascriptMessage(source=f"document.title = {title};\n{FOLD}"))


def _look(client: Client, camera: Any) -> None:
    """A browser says where its camera is. What is no camera is not followed."""
    try:
        place, target, up, (w, x, y, z) = (
            tuple(map(float, v)) for v in (camera.position, camera.look_at, camera.up_direction, camera.wxyz)
        )
        window = int(camera.image_width), int(camera.image_height)
    except (TypeError, ValueError, OverflowError):
        return
    if any(len(v) != 3 for v in (place, target, up)):
        return
    # The second column of the rotation, which is downwards in the picture.
    true_up = (-2 * (x * y - w * z), -(1 - 2 * (x * x + z * z)), -2 * (y * z + w * x))
    client.look(Pose(place, target, up, true_up), window)


def _set_home(live: Live) -> None:
    """Where pages that open begin, and where they return to."""
    base = camera_of_scene(live.engine)
    home, initial = pose_of(base, live.space), live.server.initial_camera
    live.server.scene.set_up_direction(tuple(float(x) for x in base.up))
    initial.position, initial.look_at, initial.up = home.position, home.look_at, home.up
    initial.fov, initial.near, initial.far = math.radians(page_fov(base, 1)), home.distance / 1e3, home.distance * 1e3


def _scene_changed(live: Live, change: Change) -> None:
    """The scene has changed: pages follow its camera."""
    if change.kind != "effects":
        if change.kind == "scene" or any(a.startswith("camera") for a in change.addresses):
            _set_home(live)
        for client in list(live.clients.values()):
            client.rebased(change)
