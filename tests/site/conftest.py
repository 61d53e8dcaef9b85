"""A browser without a network, the site served to it, and a window as on a desk and as on a phone."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

import pytest
from playwright.sync_api import Browser, ConsoleMessage, Page, sync_playwright

SITE = Path(__file__).parents[2] / "build" / "site"
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "microsoft-edge")
HELP = (
    "no browser found: install Chromium (Debian: apt-get install chromium) or Chrome, or run `playwright install chromium`, "
    "or name one in MWLIB_BROWSER"
)
QUIET = [
    "--no-sandbox",
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
    "--disable-component-update",
    "--no-first-run",
    "--enable-unsafe-webgpu",
    "--use-webgpu-adapter=swiftshader",  # a graphics card made of software: pages use it only where the address asks for it
    "--enable-features=Vulkan",
]
SIZES = {"desk": (1280, 900), "phone": (390, 844)}


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """A browser with no network: all that it can reach is this machine."""
    found = os.environ.get("MWLIB_BROWSER") or next(filter(None, map(shutil.which, BROWSERS)), None)
    with sync_playwright() as play:
        if found is None and not Path(play.chromium.executable_path).exists():
            pytest.fail(HELP)
        opened = play.chromium.launch(executable_path=found, args=QUIET)
        yield opened
        opened.close()


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """Where the site is served: search reads its index by http only."""

    class Silent(SimpleHTTPRequestHandler):
        def __init__(self, *words):
            super().__init__(*words, directory=str(SITE))

        def log_message(self, *words):
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Silent) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()


def trouble(message: ConsoleMessage) -> bool:
    """Whether a line of the console is one; that software draws in three dimensions slowly is none."""
    return message.type in ("error", "warning") and "GPU stall" not in message.text


@pytest.fixture(scope="module", params=SIZES)
def page(browser, address, request) -> Iterator[Page]:
    """One window, of either size; `troubles` collects what goes wrong in it."""
    wide, high = SIZES[request.param]
    opened = browser.new_page(viewport={"width": wide, "height": high}, is_mobile=request.param == "phone")
    opened.set_default_timeout(120_000)  # a busy machine is slow to open the longest chapter
    opened.troubles = []
    opened.on("console", lambda message: trouble(message) and opened.troubles.append(message.text))
    opened.on("pageerror", lambda error: opened.troubles.append(str(error)))
    opened.on(
        "request", lambda asked: asked.url.startswith((address, "data:")) or opened.troubles.append(f"asks for {asked.url}")
    )
    opened.on(
        "response", lambda answer: answer.ok or answer.status == 304 or opened.troubles.append(f"{answer.status} {answer.url}")
    )
    yield opened
    opened.close()
