"""A real browser for tests of the live picture: Chromium without a window. Tests are skipped where there is none."""

import io
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from PIL import Image

# Drawn without a graphics card.
ARGUMENTS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
# Milliseconds that anything may take; the machine may be busy.
PATIENCE = 120_000


@contextmanager
def chromium() -> Iterator[Any]:
    """A browser."""
    playwright = pytest.importorskip("playwright.sync_api")
    pytest.importorskip("viser")
    path = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if path is None:
        pytest.skip("there is no Chromium")
    with playwright.sync_playwright() as play:
        browser = play.chromium.launch(executable_path=path, args=ARGUMENTS)
        yield browser
        browser.close()


def page_of(browser: Any, url: str, width: int = 640, height: int = 480) -> Any:
    """A page that shows a live picture, in a window of its own. Pixels of the picture are those of the screen."""
    page = browser.new_page(viewport={"width": width, "height": height})
    page.set_default_timeout(PATIENCE)
    page.goto(f"{url}/?fixedDpr=1")
    finished(page)
    return page


def finished(page: Any) -> None:
    """Waits until the picture is as good as was asked for."""
    page.wait_for_selector("text=✓")


def seen(page: Any, size: tuple[int, int]) -> np.ndarray:
    """The picture that a page shows, without notices and the panel. Shape: (h, w, 3).

    size: width and height of the picture
    """
    hide = "[class*=Notifications], [class*=mantine-Paper] {visibility: hidden !important}"
    shot = page.screenshot(style=hide)
    return np.array(Image.open(io.BytesIO(shot)).convert("RGB"), float)[: size[1], : size[0]]


def drag(page: Any, start: tuple[int, int], end: tuple[int, int]) -> None:
    """Drags the mouse over the picture."""
    page.mouse.move(*start)
    page.mouse.down()
    for step in range(1, 11):
        page.mouse.move(*(a + (b - a) * step / 10 for a, b in zip(start, end)))
        page.wait_for_timeout(20)
    page.mouse.up()
