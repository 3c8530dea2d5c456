"""Makes the pictures of docs/live.md: the page of the live picture in a browser.

    python reference/docs_live.py

Needs Chromium, viser and playwright: pip install -e '.[test]'. Without Chromium it says so and leaves the pictures as
they are.
"""

import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

from docs_pictures import DOCS, ROOT, save_small

import visray as vr

SCENE, NAME, ERROR = "showcase", "showcase", 0.004
WINDOW = {"width": 1060, "height": 600}
ARGUMENTS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
# A notice about missing graphics cards, which readers do not have.
HIDDEN = "[class*=Notification] {display: none !important}"
# Where the red ball is, as shares of the picture.
BALL = 0.5, 0.5


def main() -> None:
    """Makes the pictures."""
    path = shutil.which("chromium") or shutil.which("google-chrome")
    if path is None:
        sys.exit("docs_live: there is no Chromium; the pictures are left as they are")
    from playwright.sync_api import sync_playwright

    with vr.view(ROOT / "scenes" / f"{SCENE}.json", error=ERROR) as shown, sync_playwright() as play:
        browser = play.chromium.launch(executable_path=path, args=ARGUMENTS)
        page = browser.new_page(viewport=WINDOW)
        page.set_default_timeout(600_000)
        page.goto(f"{shown.url}/?fixedDpr=1")
        page.wait_for_selector("text=✓ error")
        shot(page, "live")
        page.get_by_role("tab", name="Pixel").click()
        width, height = next(iter(shown.live.clients.values())).window
        page.mouse.click(BALL[0] * width, BALL[1] * height)
        page.wait_for_selector("text=all numbers")
        page.get_by_text("Handles", exact=True).click()
        page.mouse.move(2, 2)
        shot(page, "live-pixel")
        browser.close()


def shot(page: Any, name: str) -> None:
    """Writes what a page shows to docs/NAME.png."""
    page.wait_for_timeout(2000)
    with tempfile.TemporaryDirectory() as folder:
        page.screenshot(path=Path(folder) / "page.png", style=HIDDEN)
        save_small(Path(folder) / "page.png", DOCS / f"{name}.png")


if __name__ == "__main__":
    main()
