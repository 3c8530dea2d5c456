"""Who is answered by the live picture's server, and what strangers can send: nothing that is read."""

import base64
import gc
import http.server
import logging
import os
import socket
import threading
from contextlib import suppress
from dataclasses import replace

import msgspec.msgpack
import pytest
from browser import chromium, page_of
from live_support import small_scene

import visray as vr
from visray.cli import view as view_command
from visray.errors import UserError
from visray.live import door, guard

pytest.importorskip("viser")
import viser
from page import Page, eventually
from websockets.exceptions import ConnectionClosed

SHARE = msgspec.msgpack.encode({"type": "ShareUrlRequest"})
# Ends a script, and has quotes, line ends of all kinds, and characters that steer a terminal.
NAME = "</script><script>window.bad = 1</script> \"'`${window.bad = 1} \\ \n\u2028\x1b[31m"


@pytest.fixture(scope="module")
def shown():
    with vr.view(small_scene(film=vr.Film(width=32, height=24)), error=0.2, name=NAME + "\udcff") as shown:
        yield shown


@pytest.fixture
def handled(shown, monkeypatch):
    """Types of the messages that the server handles."""
    websockets, types = shown.live.server._websock_server, []
    handle = websockets._handle_incoming_message

    async def spy(client, message):
        types.append(type(message).__name__)
        await handle(client, message)

    monkeypatch.setattr(websockets, "_handle_incoming_message", spy)
    return types


def port_of(shown):
    return int(shown.url.rpartition(":")[2])


def settled(shown, handled):
    """Waits until the server has handled a message that a page of its own sends now."""
    page = Page(shown.url)
    page.look()
    eventually(lambda: "ViewerCameraMessage" in handled)
    page.close()
    eventually(lambda: not shown.live.clients)


def asked(shown, host=None, more=()):
    """Asks for a connection and sends messages along, without waiting. Returns the first line of the answer."""
    lines = [
        "GET / HTTP/1.1", f"Host: {host or shown.url.partition('//')[2]}", "Upgrade: websocket", "Connection: Upgrade",
        f"Sec-WebSocket-Key: {base64.b64encode(os.urandom(16)).decode()}", "Sec-WebSocket-Version: 13",
        f"Sec-WebSocket-Protocol: viser-v{viser.__version__}", *more,
    ]  # fmt: skip
    messages = 5 * (bytes([0x82, 0x80 | len(SHARE)]) + bytes(4) + SHARE)
    with socket.create_connection(("127.0.0.1", port_of(shown))) as connection:
        connection.sendall("\r\n".join([*lines, "", ""]).encode() + messages)
        connection.settimeout(120)
        return connection.recv(1000).decode(errors="replace").partition("\r\n")[0]


@pytest.mark.parametrize(
    ("host", "more"),
    [
        (None, ["Origin: http://evil.example"]),
        (None, ["Origin: null"]),
        ("evil.example:8080", ["Origin: http://evil.example:8080"]),
        ("evil.example:8080", []),
        ("127.0.0.1:8080", ["Host: evil.example"]),
        ("[::1", []),
    ],
)
def test_nothing_that_a_stranger_sends_at_once_is_handled(shown, handled, host, more):
    assert " 403 " in asked(shown, host, more)
    settled(shown, handled)
    assert set(handled) <= {"ViewerCameraMessage", "LocalStorageGetItemResponseMessage"}


def test_the_same_is_handled_from_one_of_its_own(shown, handled):
    assert " 101 " in asked(shown, more=[f"Origin: {shown.url}"])
    eventually(lambda: handled.count("ShareUrlRequest") == 5)


def test_nobody_can_have_it_published(shown, handled, monkeypatch):
    published, server = [], shown.live.server
    monkeypatch.setattr(server, "request_share_url", lambda *more: published.append("on"))
    monkeypatch.setattr(server, "disconnect_share_url", lambda *more: published.append("off"))
    page = Page(shown.url)
    for kind in ("ShareUrlRequest", "ShareUrlDisconnect"):
        page.send(kind)
    eventually(lambda: {"ShareUrlRequest", "ShareUrlDisconnect"} <= set(handled))
    settled(shown, handled)
    page.close()
    # Whatever the messages have started in threads has ended when this many others have.
    for job in [server._thread_executor.submit(threading.Event().wait, 0.05) for _ in range(64)]:
        job.result()
    assert published == []


def test_no_server_is_left_that_cannot_refuse(monkeypatch):
    """As with a version of viser that starts its server in another way."""
    stopped = []

    class Server:
        def __init__(self, **more):
            self.more = more

        def stop(self):
            stopped.append(self.more["port"])

    monkeypatch.setattr(viser, "ViserServer", Server)
    with pytest.raises(UserError, match=r"^the live picture cannot be kept to this machine with viser \d.*pip install"):
        door.guarded_server("127.0.0.1", 8099, "x")
    assert stopped == [8099]


def test_others_that_use_websockets_are_not_guarded(shown):
    """The question is put only to servers of visray's making."""
    from viser.infra import _infra
    from websockets.asyncio import server

    assert _infra.websockets.asyncio.server is server and server.serve.__module__ == server.__name__


def test_what_cannot_be_read_makes_no_noise(shown, caplog, capfd):
    no_camera = [{"position": (0.0,)}, {"window": (1e999, 3)}, {"up": None}, {"position": (None,) * 3}]
    for each in no_camera:
        page = Page(shown.url)
        page.look(**each)
        with suppress(ConnectionClosed):
            page.look()
        eventually(lambda page=page: page.socket.close_code or shown.live.clients)
        page.close()
        eventually(lambda: not shown.live.clients)
    for data in ("text", b"\xc1\xff", msgspec.msgpack.encode({"type": "Nothing"}), msgspec.msgpack.encode([1])):
        page = Page(shown.url)
        page.socket.send(data)
        eventually(lambda page=page: page.socket.close_code == 1011)
    page = Page(shown.url)
    page.look()
    slider = eventually(lambda: page.of("GuiSliderMessage"))[0]["uuid"]
    for value in ("many", [1], None):
        page.send("GuiUpdateMessage", uuid=slider, updates={"value": value})
    page.send("GuiUpdateMessage", uuid=slider, updates={"nothing": 1})
    with socket.create_connection(("127.0.0.1", port_of(shown))) as connection:
        connection.sendall(b"POST \x00\r\n\r\n")
        assert b"101" not in connection.recv(100)
    said = ""

    def told():
        nonlocal said
        # What has failed is told when it is deleted.
        gc.collect()
        said += capfd.readouterr().err
        return "\n" in said

    eventually(told)
    page.close()
    eventually(lambda: not shown.live.clients)
    gc.collect()
    said = (said + capfd.readouterr().err).splitlines()
    assert len(said) == 1 and said[0].startswith("visray: note: a message of a browser cannot be used, ")
    assert {record.name for record in caplog.records if record.levelno >= logging.WARNING} <= {door.LOG.name}
    assert not door.LOG.propagate


@pytest.mark.parametrize(
    ("name", "welcome"),
    [
        ("192.168.1.5:8080", True),
        ("[fe80::1]:8080", True),
        ("localhost:8080", True),
        ("big:8080", True),
        ("BIG.local:8080", True),
        ("big.example.:8080", True),
        ("evil.example:8080", False),  # its name has this machine's address
        ("192.168.1.5.evil.example:8080", False),
        ("big.evil.example:8080", False),
        ("", False),
    ],
)
def test_names_by_which_other_machines_ask(monkeypatch, name, welcome):
    monkeypatch.setattr(socket, "gethostname", lambda: "big")
    monkeypatch.setattr(socket, "getfqdn", lambda: "big.example")
    names = guard.own_names("0.0.0.0")
    eventually(lambda: "big.example" in names)
    for headers in ({"Host": name}, {"Host": name, "Origin": f"http://{name}"}):
        assert guard.is_welcome("0.0.0.0", headers, names) is welcome
    assert not guard.is_welcome("0.0.0.0", {"Host": name, "Origin": "http://evil.example"}, names)


def test_a_name_that_was_given_is_answered():
    assert guard.is_welcome("Big.Lab", {"Host": "big.lab:8080"}, guard.own_names("Big.Lab"))
    assert "--host" in guard.refusal("0.0.0.0") and "--host" not in guard.refusal("127.0.0.1")


def test_two_at_once_have_their_own_scenes(shown):
    dark = replace(
        small_scene(film=vr.Film(width=32, height=24)), ambient=(0.0, 0.0, 0.0), background=(0.0, 0.0, 0.0), lights={}
    )
    with vr.view(dark, error=0.2) as other:
        pages = [Page(shown.url), Page(other.url)]
        for page in pages:
            page.look((0.0, 1.0, 5.0), (0.0, 0.5, 0.0), window=(32, 24))
        for page in pages:
            eventually(lambda page=page: page.pictures and "✓ error" in page.html())
        shown.live.engine.assign({"objects.ball.radius": 0.5})
        eventually(lambda: shown.live.engine.scene.objects["ball"].radius == 0.5)
        assert other.live.engine.scene.objects["ball"].radius == 0.6
        assert pages[0].pictures[-1].max() > 50 and pages[1].pictures[-1].max() < 10
        pages[1].close()
    count = len(pages[0].pictures)
    pages[0].look((0.0, 1.5, 5.0), (0.0, 0.5, 0.0), window=(32, 24))
    eventually(lambda: len(pages[0].pictures) > count)
    pages[0].close()


def test_without_a_browser_the_address_is_all(shown, monkeypatch, capsys):
    monkeypatch.setattr("webbrowser.open", lambda url: False)
    assert shown.open() is False

    class Shown:
        url, live = shown.url, shown.live
        open, wait, stop = shown.open, (lambda self: None), (lambda self: True)

    monkeypatch.setattr("visray.live.view.started", lambda *more, **fields: Shown())
    monkeypatch.setattr(view_command, "_has_windows", lambda: True)
    code = view_command.show_live(small_scene, name="ball", port=None)
    said = capsys.readouterr()
    assert code == 0 and said.out == f"ball: {shown.url} (Ctrl-C ends)\n"
    assert said.err == "visray: note: no browser opens here; open the address in one yourself\n"


@pytest.fixture(scope="module")
def browser():
    with chromium() as browser:
        yield browser


def test_a_name_is_a_title_and_no_script(shown, browser):
    page = page_of(browser, shown.url, 320, 240)
    eventually(lambda: "visray" in page.title())
    # A browser makes one blank of several.
    assert page.title() == " ".join(f"{vr.terminal.printable(NAME)}\\udcff - visray".split())
    assert page.evaluate("window.bad") is None
    page.close()


def test_a_page_of_another_site_in_a_browser(shown, browser, handled):
    """It sends as soon as a connection is open, of which there is none."""

    class Site(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200)
            self.end_headers()
            self.wfile.write(b"<title>other</title>")

        def log_message(self, *more):
            pass

    script = """([port, version, bytes]) => Promise.all([...Array(20)].map(() => new Promise(done => {
        const socket = new WebSocket(`ws://127.0.0.1:${port}/`, version), data = Uint8Array.from(bytes);
        socket.onopen = () => { for (let i = 0; i < 50; i++) socket.send(data); opened = true; };
        let opened = false;
        socket.onclose = () => done(opened);
    })))"""
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Site) as site:
        threading.Thread(target=site.serve_forever, daemon=True).start()
        page = browser.new_page()
        page.goto(f"http://127.0.0.1:{site.server_port}/")
        opened = page.evaluate(script, [port_of(shown), f"viser-v{viser.__version__}", list(SHARE)])
        page.close()
        site.shutdown()
    assert opened == 20 * [False]
    settled(shown, handled)
    assert "ShareUrlRequest" not in handled
