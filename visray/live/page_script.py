"""Small scripts for pages, for what viser has no function for. If its page gets another structure, they do nothing."""

import json
from typing import Any

# Enter in a line with an assignment presses the button that assigns it, once it is there. The last letters are on their
# way for a moment.
ENTER = """
if (!window.visrayEnter) {
  window.visrayEnter = true;
  addEventListener("keydown", (event) => {
    const box = event.target;
    if (event.key !== "Enter" || box.tagName !== "INPUT" || !box.value.includes("=")) return;
    let tries = 40;
    const press = () => {
      const button = [...document.querySelectorAll("button")]
        .find((b) => b.textContent.trim() === LABEL && b.offsetParent !== null);
      if (button) button.click(); else if (--tries > 0) setTimeout(press, 100);
    };
    setTimeout(press, 300);
  });
}
"""
# Tabs can be dragged, so they do not follow clicks that a script makes, but they follow keys.
SHOW_TAB = """
[...document.querySelectorAll("[role=tab]")].find((t) => t.textContent.trim() === LABEL)
  ?.dispatchEvent(new KeyboardEvent("keydown", {key: "Enter", bubbles: true}));
"""


def enter_presses(server: Any, label: str) -> None:
    """In all pages, Enter in a line with "=" presses a button. label: what is written on it. server: the ViserServer"""
    _run(server._websock_server, ENTER, label)


def show_tab(handle: Any, name: str) -> None:
    """Shows a tab in one page. handle: viser's handle of the browser"""
    _run(handle._websock_connection, SHOW_TAB, name)


def _run(connection: Any, source: str, label: str) -> None:
    from viser._messages import RunJavascriptMessage

    connection.queue_message(RunJavascriptMessage(source=source.replace("LABEL", json.dumps(label))))
