"""A page of the live picture without a browser: it speaks viser's protocol, and answers as a browser does."""

import io
import threading
import time
from typing import Any

import msgspec.msgpack
import numpy as np
import viser
import zstandard
from PIL import Image
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

# Seconds that anything may take before a test gives up; the machine may be busy.
PATIENCE = 120.0


def eventually(what: Any, seconds: float = PATIENCE) -> Any:
    """The first true value of a function."""
    end = time.monotonic() + seconds
    while not (value := what()):
        assert time.monotonic() < end, "it does not happen"
        time.sleep(0.02)
    return value


class Page:
    """A connection. answers: whether it says that pictures have arrived."""

    def __init__(self, url: str, answers: bool = True, **more: Any):
        version = f"viser-v{viser.__version__}"
        self.socket = connect(url.replace("http", "ws"), subprotocols=[version], max_size=None, **more)
        self.answers, self.messages, self.pictures = answers, [], []
        threading.Thread(target=self._read, daemon=True).start()

    def look(
        self,
        position: Any = (0.0, 0.0, 4.0),
        look_at: Any = (0.0, 0.0, 0.0),
        up: Any = (0.0, 1.0, 0.0),
        window: tuple[int, int] = (64, 48),
    ) -> None:
        """Says where its camera is."""
        self.send(
            "ViewerCameraMessage", wxyz=(1.0, 0.0, 0.0, 0.0), position=position, fov=0.7, near=0.01, far=100.0,
            image_height=window[1], image_width=window[0], look_at=look_at, up_direction=up,
        )  # fmt: skip

    def send(self, type: str, **fields: Any) -> None:
        """Sends a message."""
        self.socket.send(msgspec.msgpack.encode({"type": type, **fields}))

    def of(self, type: str) -> list[dict[str, Any]]:
        """All messages of a type so far."""
        return [message for message in list(self.messages) if message["type"] == type]

    def html(self) -> str:
        """The HTML that it shows, all elements joined."""
        shown: dict[str, str] = {}
        for message in list(self.messages):
            if message["type"] == "GuiHtmlMessage":
                shown[message["uuid"]] = message["props"]["content"]
            if message["type"] == "GuiUpdateMessage" and message["uuid"] in shown:
                shown[message["uuid"]] = message["updates"].get("content", shown[message["uuid"]])
        return "\n".join(shown.values())

    def close(self) -> None:
        """Leaves."""
        self.socket.close()

    def _read(self) -> None:
        try:
            for packet in self.socket:
                for message in _decoded(packet):
                    self.messages.append(message)
                    if message["type"] == "BackgroundImageMessage" and message["rgb_data"]:
                        self.pictures.append(np.array(Image.open(io.BytesIO(message["rgb_data"]))))
                    if message["type"] == "LocalStorageGetItemRequestMessage" and self.answers:
                        uuid = message["request_uuid"]
                        self.send("LocalStorageGetItemResponseMessage", value=None, error=None, request_uuid=uuid)
        except ConnectionClosed:
            return


def _decoded(packet: bytes) -> list[dict[str, Any]]:
    """The messages of a packet, with their binary parts."""
    size, length = (int.from_bytes(packet[i : i + 8], "little") for i in (0, 8))
    plain = zstandard.ZstdDecompressor().decompress(packet[16 : 16 + length], max_output_size=size)
    content = msgspec.msgpack.decode(plain)
    buffers, at = [], 16 + length
    for size in content["binaryBufferLengths"]:
        at += -at % 8
        buffers.append(packet[at : at + size])
        at += size

    def filled(value: Any) -> Any:
        if isinstance(value, dict) and "__binary_index" in value:
            return buffers[value["__binary_index"]]
        if isinstance(value, dict):
            return {k: filled(v) for k, v in value.items()}
        return [filled(v) for v in value] if isinstance(value, list) else value

    return filled(content["messages"])
