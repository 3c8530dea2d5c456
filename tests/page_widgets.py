"""Widgets of a page of the live picture without a browser (page.py): buttons are pressed, and files arrive."""

from typing import Any

from page import Page, eventually

from visray.live.viewpoint import pose_of


def widget(page: Page, label: str) -> str:
    """The number of the newest widget with a label, once it is there."""

    def found() -> str | None:
        labels: dict[str, str] = {}
        for message in list(page.messages):
            props = message.get("props") or message.get("updates") or {}
            if isinstance(props, dict) and "label" in props and "uuid" in message:
                labels[message["uuid"]] = props["label"]
            if message["type"] == "GuiRemoveMessage":
                labels.pop(message["uuid"], None)
        return next((number for number, text in reversed(labels.items()) if text == label), None)

    return eventually(found)


def value_of(page: Page, label: str, name: str = "value") -> Any:
    """The newest value of a widget, or another of its properties."""
    uuid, value = widget(page, label), None
    for message in list(page.messages):
        if message.get("uuid") == uuid:
            fields = message | (message.get("props") or {}) | (message.get("updates") or {})
            value = fields.get(name, value)
    return value


def press(page: Page, label: str) -> None:
    """Presses a button."""
    write(page, label, True)


def write(page: Page, label: str, value: Any) -> None:
    """Gives a widget another value, as a user does."""
    page.send("GuiUpdateMessage", uuid=widget(page, label), updates={"value": value})


def downloads(page: Page) -> dict[str, bytes]:
    """The files that have arrived as a whole, by name."""
    files = {}
    for start in page.of("FileTransferStartDownload"):
        parts = [m for m in page.of("FileTransferPart") if m["transfer_uuid"] == start["transfer_uuid"]]
        if len(parts) == start["part_count"]:
            files[start["filename"]] = b"".join(m["content"] for m in sorted(parts, key=lambda m: m["part_index"]))
    return files


def told(page: Page) -> str:
    """All sentences that were told in passing."""
    return "\n".join(message["props"]["body"] for message in page.of("NotificationShowMessage"))


def look_from(page: Page, live: Any, position: tuple[float, float, float]) -> Any:
    """Opens as a browser does, where the scene's camera is, and then looks from elsewhere. Returns the browser, as the
    server knows it. position: in units of the page"""
    home = pose_of(live.engine.scene.camera, live.space)
    page.look(home.position, home.look_at)
    page.look(position=position)
    client = eventually(lambda: next(iter(live.clients.values()), None))
    eventually(lambda: not client.at_home)
    return client
