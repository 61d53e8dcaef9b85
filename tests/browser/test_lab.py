"""The course in JupyterLab, as a person uses it, in a headless browser. `make test-lab` runs this.

A server on a free port serves a temporary working copy of the course. Screenshots are left in build/browser.
"""

from __future__ import annotations

import os
import re
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path

import nbformat
import pytest
from playwright.sync_api import Browser, Locator, Page

from mwlib.course.notebooks import FOLDED, find_notebook, lay_out, tags
from mwlib.files import write_atomic
from tests.browser.chromium import PATIENCE, SHOTS, asked_for

pytestmark = asked_for
ROOT = Path(__file__).parents[2]
SENTENCES, KEYFRAMES = "sentences.ipynb", "keyframes.ipynb"  # chapters 13 and 11 as far as their boxes
SLOW = 5 * PATIENCE  # milliseconds; JupyterLab needs 20 s to open on an idle core, what comes before a box two minutes
STDERR = re.compile(rb'"name": ?"stderr", ?"text": ?"(?!No such comm)')  # JupyterLab asks for widgets before they are imported
OF_NOBODY = ("JUPYTER_CONFIG_DIR", "JUPYTER_DATA_DIR", "JUPYTER_RUNTIME_DIR", "JUPYTERLAB_WORKSPACES_DIR", "IPYTHONDIR")
NO_NEWS = '{"fetchNews": "false", "checkForUpdates": false}'  # what JupyterLab asks at its first start, answered with No
TOKEN = "for-this-test"

# A rendered text without its code and its formulae: there a dollar or a backslash is a formula that was not rendered.
TEXTS = """() => [...document.querySelectorAll('.jp-MarkdownOutput')].map(part => {
  const copy = part.cloneNode(true);
  copy.querySelectorAll('code, pre, mjx-container, script').forEach(inner => inner.remove());
  return copy.textContent;
})"""
RAW = re.compile(r"\$[^$\n]{1,80}\$|\$\$|\\(?:frac|sum|begin|mathbf|alpha|left|text)\b")
# Sideways only tables and code may be longer than the window: they scroll in their own box.
WIDE = """() => [...document.querySelectorAll('.jp-MarkdownOutput > :not(table), .jp-OutputArea-output img')]
  .filter(part => { const cell = part.closest('.jp-Cell').getBoundingClientRect(), box = part.getBoundingClientRect();
    return box.width && box.right > cell.right + 1; })
  .map(part => part.outerHTML.slice(0, 100))"""
BROKEN = "() => [...document.querySelectorAll('.jp-Notebook img')].filter(i => i.complete && !i.naturalWidth).length"
WIDTH = "part => part.getBoundingClientRect().width"
INKED = "c => c.getContext('2d').getImageData(0, 0, c.width, c.height).data.some(value => value > 0)"
PAGE_DOWN = """() => { const view = document.querySelector('.jp-WindowedPanel-outer'), before = view.scrollTop;
  view.scrollTop += view.clientHeight - 60; return view.scrollTop > before; }"""


@pytest.fixture(scope="module")
def lab(tmp_path_factory) -> Iterator[str]:
    """The address of a JupyterLab of its own, opened as `make lab` does."""
    folder = tmp_path_factory.mktemp("lab")
    lay_out(folder / "course")
    write_box(folder / "course" / "notebooks" / SENTENCES, "13", "widgets.explore(")
    needless = ("clip = split.test[", "ships = mw.load_run(")  # sections 1 to 9: grids of models, trained for many minutes
    write_box(folder / "course" / "notebooks" / KEYFRAMES, "11", "widgets.keyframes(", needless)
    answered = folder / "settings" / "@jupyterlab" / "apputils-extension" / "notification.jupyterlab-settings"
    write_atomic(answered, NO_NEWS)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    env = {name: value for name, value in os.environ.items() if name != "MW_STATIC"} | {"PYTHONPATH": str(ROOT)}
    env |= {name: str(folder / name) for name in OF_NOBODY} | {"JUPYTERLAB_SETTINGS_DIR": str(folder / "settings")}
    command = [sys.executable, "-m", "jupyterlab", "--no-browser", "--allow-root", f"--ServerApp.port={port}"]
    command += ["--ServerApp.port_retries=0", f"--IdentityProvider.token={TOKEN}"]
    command += ["--ServerApp.root_dir=.", "notebooks/00_start_here.ipynb"]  # as in the Makefile: links to texts beside notebooks/
    with (folder / "log").open("w") as log:
        server = subprocess.Popen(command, cwd=folder / "course", env=env, stdout=log, stderr=subprocess.STDOUT)
    try:
        wait_for(f"http://127.0.0.1:{port}/api", server, folder / "log")
        yield f"http://127.0.0.1:{port}/"
    finally:
        server.terminate()
        server.wait(PATIENCE / 1000)


def write_box(path: Path, number: str, box: str, needless: tuple[str, str] | None = None) -> None:
    """A chapter up to its box, cell by cell as it is, without what lies between two cells and is not needed for the box."""
    chapter = nbformat.read(find_notebook(number), as_version=4)
    last, *gap = (
        next(place for place, cell in enumerate(chapter.cells) if text in cell.source) for text in (box, *(needless or ()))
    )
    del chapter.cells[last + 1 :]
    if gap:
        del chapter.cells[gap[0] + 1 : gap[1]]
    write_atomic(path, nbformat.writes(chapter))


def wait_for(address: str, server: subprocess.Popen, log: Path) -> None:
    deadline = time.monotonic() + PATIENCE / 1000
    while server.poll() is None and time.monotonic() < deadline:
        try:
            urllib.request.urlopen(address, timeout=5).close()
            return
        except OSError:
            time.sleep(0.2)
    pytest.fail(f"JupyterLab does not answer:\n{log.read_text()[-2000:]}")


@pytest.fixture
def opened(browser: Browser, lab: str) -> Iterator[Callable[[str, int], Page]]:
    """Opens a notebook; in the end no error or warning was told by the console or the kernel, and no other host was asked."""
    said, asked, pages = [], [], []

    def hear(message: str | bytes) -> None:
        """What a slider sets off has no cell below which its warnings would stand."""
        content = message.encode() if isinstance(message, str) else message
        if STDERR.search(content):
            said.append(content.decode(errors="replace"))

    def open_notebook(name: str, width: int = 1400) -> Page:
        page = browser.new_page(viewport={"width": width, "height": 1000})
        pages.append(page)
        page.set_default_timeout(PATIENCE)
        page.on("console", lambda message: said.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: said.append(str(error)))
        page.on("websocket", lambda socket: socket.on("framereceived", hear))
        page.on("request", lambda request: asked.append(request.url))
        page.goto(f"{lab}lab/tree/notebooks/{name}?token={TOKEN}&reset", timeout=SLOW)
        page.locator(".jp-Notebook h1").first.wait_for(timeout=SLOW)
        return page

    yield open_notebook
    for page in pages:
        page.close()
    assert said == []
    assert [url for url in asked if not url.startswith((lab, lab.replace("http", "ws"), "data:", "blob:"))] == []


def run_all(page: Page) -> None:
    page.get_by_role("menuitem", name="Run", exact=True).click()
    page.get_by_role("menuitem", name="Run All Cells", exact=True).click()


def test_a_sentence_typed_into_the_box_becomes_a_moving_body(opened):
    page = opened(SENTENCES)
    run_all(page)
    box = page.locator(".widget-text input")
    box.wait_for(timeout=SLOW)
    shown = page.locator(".jp-OutputArea-output", has=box).first  # the chapter's other bodies stand elsewhere
    assert shown.locator("canvas").count() == 0  # it waits to be asked
    box.fill("a man waves with the right hand")
    page.get_by_role("button", name="Ask", exact=True).click()
    body = shown.locator("canvas").first
    body.wait_for(timeout=SLOW)
    body.scroll_into_view_if_needed()
    assert shown.locator(".label").first.inner_text() == "your sentence"
    clock = shown.locator("output").first
    before, shot = clock.evaluate("node => node.value"), body.screenshot()
    page.wait_for_function("([node, before]) => node.value !== before", arg=[clock.element_handle(), before])
    page.screenshot(path=SHOTS / "lab_sentences.png")
    assert body.screenshot() != shot


def test_keyframes_dragged_along_the_clip_get_new_motions_between(opened):
    page = opened(KEYFRAMES)
    run_all(page)
    box = page.locator(".jp-OutputArea-output > .widget-vbox")
    box.get_by_text("made in").wait_for(timeout=SLOW)
    box.scroll_into_view_if_needed()
    samples = ["sample 1", "sample 2"]
    shots = [filmed(box, 5, 36, 30, ["truth", *samples])]
    first, last, between = box.locator(".noUi-handle").all()
    handle, frame = (
        first.bounding_box(),
        box.locator(".noUi-base").first.evaluate(WIDTH) / float(last.get_attribute("aria-valuemax")),
    )
    x, y = handle["x"] + handle["width"] / 2, handle["y"] + handle["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 20 * frame, y, steps=5)
    page.mouse.up()
    shots.append(filmed(box, 25, 36, 10, ["truth", *samples]))
    last.press("ArrowRight")
    shots.append(filmed(box, 25, 37, 11, ["truth", *samples]))
    box.get_by_label("N as in the clip").uncheck()
    box.locator(".noUi-target[disabled]").wait_for(state="detached")
    between.press("ArrowLeft")
    shots.append(filmed(box, 25, 37, 10, samples))
    assert len(set(shots)) == len(shots)


def filmed(box: Locator, first: int, last: int, between: int, names: list[str]) -> bytes:
    """Waits until handles, line and player tell of these keyframes; the player's picture in the middle of its film."""
    box.get_by_text(f"frames {first} and {last}, {between} between: made in").wait_for()
    assert box.locator(".widget-readout").all_inner_texts() == [f"{first} – {last}", str(between)]
    film = box.locator(f'input[aria-label="Time"][max="{between + 1}"]')
    film.wait_for()
    assert box.locator(".label").all_inner_texts() == names
    film.fill(str(between // 2))
    box.page.wait_for_function(INKED, arg=box.locator("canvas").element_handle())
    assert box.locator("canvas").evaluate(WIDTH) > 0.9 * box.evaluate(WIDTH)
    box.page.screenshot(path=SHOTS / f"lab_keyframes_{first}_{last}_{between}.png")
    return box.locator("canvas").screenshot()


@pytest.mark.parametrize("width", [1400, 800])
@pytest.mark.parametrize("number", ["00", "05", "13"])
def test_a_chapter_is_whole(opened, number, width):
    """Scrolled through as it is committed: formulae are set, pictures are there and fit, solutions and guards are folded."""
    chapter = nbformat.read(find_notebook(number), as_version=4)
    hidden = [cell.source for cell in chapter.cells if cell.cell_type == "code" and {*FOLDED} & {*tags(cell)}]
    page, folded, words = opened(find_notebook(number).name, width), set(), 0
    for screen in range(60):
        page.wait_for_timeout(1000)
        page.screenshot(path=SHOTS / f"lab_{number}_{width}_{screen:02d}.png")
        assert [found for text in page.evaluate(TEXTS) for found in RAW.findall(text)] == []
        assert page.locator("mjx-merror").count() == page.evaluate(BROKEN) == 0
        assert page.evaluate(WIDE) == []
        folded |= {" ".join(text.split()) for text in page.locator(".jp-InputPlaceholder").all_inner_texts()}
        words = max(words, page.locator(".jp-Notebook details").count())
        assert page.locator(".jp-Notebook details[open]").count() == 0
        if not page.evaluate(PAGE_DOWN):
            break
    assert folded - {""} == {" ".join(text.split("\n")[0].split()) for text in hidden}
    assert words > 0
