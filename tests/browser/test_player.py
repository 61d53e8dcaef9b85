"""Players in a real browser, off the network. `make test-player` runs this. Screenshots are left in build/browser."""

from __future__ import annotations

import io
from collections.abc import Iterator

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Page

from mwlib import plots
from mwlib.synthetic.motions import synthetic_motions
from tests.browser.chromium import PATIENCE, SHOTS, asked_for

pytestmark = asked_for
WALK = synthetic_motions(1, seconds=3)[0].resample(25.0).cut(0, 60)
ROWS = {"truth": WALK, "sample": WALK.cut(10, 60).mirror()}


@pytest.fixture
def opened(browser, tmp_path) -> Iterator:
    """Opens a page of players, and in the end finds that nothing went wrong and nothing was asked of any network."""
    said, asked, windows = [], [], []

    def open_page(*players: plots.Player, width: int = 1280, **context) -> Page:
        first, *others = players
        file = first.save_html(tmp_path / "page.html", *others)
        windows.append(browser.new_context(viewport={"width": width, "height": 700}, **context))
        page = windows[-1].new_page()
        page.set_default_timeout(PATIENCE)
        page.on("console", lambda message: said.append(message.text) if message.type in ("error", "warning") else None)
        page.on("pageerror", lambda error: said.append(str(error)))
        page.on("request", lambda request: asked.append(request.url))
        page.goto(file.as_uri(), timeout=PATIENCE)
        page.wait_for_function(
            "[...document.querySelectorAll('.mwlib-player')].every(host => host.shadowRoot?.querySelector('output')?.value)"
        )
        return page

    yield open_page
    for window in windows:
        window.close()  # one that plays on slows the next test down
    assert [text for text in said if "GPU stall" not in text and "GL Driver" not in text] == []
    assert {url.split(":")[0] for url in asked} <= {"file", "blob"}


def picture(page: Page, name: str = "") -> np.ndarray:
    """Pixels of the first canvas; the whole page is kept under a name."""
    if name:
        page.screenshot(path=SHOTS / f"{name}.png", timeout=PATIENCE)
    shot = page.locator("canvas").first.screenshot(timeout=PATIENCE)
    return np.asarray(Image.open(io.BytesIO(shot)).convert("RGB")).astype(int)


def changed(before: np.ndarray, after: np.ndarray) -> int:
    """How many pixels differ clearly."""
    return int((np.abs(before - after).max(axis=-1) > 40).sum())


def blackest_edge(pixels: np.ndarray) -> int:
    """Black pixels along the left, right or lower edge, whichever has most: the truth is black."""
    black = pixels.max(axis=-1) < 25
    return int(max(black[:, 8].sum(), black[:, -8].sum(), black[-8].sum()))


def settled(page: Page) -> None:
    """Two pictures later."""
    page.evaluate("new Promise(go => requestAnimationFrame(() => requestAnimationFrame(go)))")


def clock(page: Page) -> str:
    return page.locator("output").first.evaluate("node => node.value")


@pytest.mark.parametrize("width", [1280, 390])
def test_it_plays_stops_searches_and_turns(opened, width):
    page = opened(plots.player(ROWS, history=10, keyframes=[9, -1], autoplay=False), width=width, has_touch=width < 500)
    settled(page)
    still = picture(page, f"still_{width}")
    assert clock(page) == "−0.36 s observed" and changed(still, picture(page)) == 0
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    page.get_by_role("button", name="Play").click()
    page.wait_for_function(
        "before => document.querySelector('.mwlib-player').shadowRoot.querySelector('output').value !== before", arg=clock(page)
    )
    page.get_by_role("button", name="Pause").click()
    settled(page)
    assert changed(still, picture(page)) > 100
    page.get_by_label("Time").fill("59")
    settled(page)
    end = picture(page, f"end_{width}")
    assert clock(page) == "+2.00 s" and changed(still, end) > 300
    box = page.locator("canvas").first.bounding_box()
    page.mouse.move(box["x"] + box["width"] / 3, box["y"] + box["height"] / 2)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2 + 15, steps=3)
    page.mouse.up()
    settled(page)
    turned = picture(page, f"turned_{width}")
    assert clock(page) == "+2.00 s" and changed(end, turned) > 300
    page.get_by_role("button", name="Reset").click()
    settled(page)
    assert changed(end, picture(page)) < 50


def test_keys_step_turn_lay_over_and_follow(opened):
    page = opened(plots.player(ROWS, history=10, autoplay=False))
    page.locator(".box").focus()
    page.keyboard.press("ArrowRight")
    settled(page)
    assert clock(page) == "−0.32 s observed"
    page.keyboard.press("End")
    settled(page)
    side = picture(page)
    for key, name in (("Shift+ArrowRight", "orbit"), ("o", "overlay"), ("f", "follow")):
        page.keyboard.press(key)
        settled(page)
        after = picture(page, name)
        assert changed(side, after) > 200, name
        assert blackest_edge(after) < 4, name  # a dot of the path may be there, no body
        side = after
    assert page.locator(".label").all_inner_texts() == ["truth · sample"]
    page.keyboard.press("Space")
    assert page.get_by_role("button", name="Pause").count() == 1


def test_it_plays_by_itself_unless_the_reader_wants_less_motion(opened):
    page = opened(plots.player(WALK))
    assert page.get_by_role("button", name="Pause").count() == 1
    calm = opened(plots.player(WALK), reduced_motion="reduce")
    assert calm.get_by_role("button", name="Play").count() == 1


def test_two_players_share_one_context_and_each_keeps_its_own_time(opened):
    page = opened(plots.player(WALK, autoplay=False, height=200), plots.player(ROWS, autoplay=False, height=240))
    page.get_by_label("Time").nth(1).fill("30")
    settled(page)
    assert [node.evaluate("node => node.value") for node in page.locator("output").all()] == ["0.00 s", "1.20 s"]
    inked = "[...document.querySelectorAll('.mwlib-player')].map(h => { const c = h.shadowRoot.querySelector('canvas');" \
        " return c.getContext('2d').getImageData(0, 0, c.width, c.height).data.some(value => value > 0) })"  # fmt: skip
    assert page.evaluate(inked) == [True, True]
    names = page.evaluate("Object.keys(globalThis).filter(name => name.startsWith('mwlibPlayer_')).length")
    assert names == 1 and page.locator("canvas").count() == 2


def test_a_dark_page_gets_light_bodies(opened):
    page = opened(plots.player({"truth": WALK}, autoplay=False), color_scheme="dark")
    settled(page)
    dark = picture(page, "dark")
    assert np.median(dark) < 60 and (dark.min(axis=-1) > 150).sum() > 500


MODEL = """
async ([esm, state]) => {
  const heard = {}, el = document.body.appendChild(document.createElement("div"));
  const model = {
    get: (name) => state[name], save_changes: () => (state.saved = (state.saved ?? 0) + 1),
    set: (name, value) => { state[name] = value; heard[name]?.(); },
    on: (name, act) => (heard[name.slice("change:".length)] = act),
  };
  Object.assign(globalThis, { model, state, el });
  const module = await import(URL.createObjectURL(new Blob([esm], { type: "text/javascript" })));
  globalThis.leave = await module.default.render({ model, el });
}
"""


def test_the_widget_tells_python_and_is_steered_by_it(opened):
    """Own choice: a stand-in for the notebook's model, so that no notebook server has to run."""
    page = opened(plots.player(WALK, autoplay=False, height=150))
    widget = plots.player(WALK, autoplay=False, height=150).widget()
    state = {name: getattr(widget, name) for name in ("key", "bundle", "payload", "frame", "playing", "speed")}
    page.evaluate(MODEL, [widget._esm, state])
    told = "frame => el.shadowRoot.querySelector('output')?.value === frame"
    page.wait_for_function(told, arg="0.00 s")
    page.evaluate("model.set('frame', 30)")
    page.wait_for_function(told, arg="1.20 s")
    page.evaluate("el.shadowRoot.querySelector('.box').dispatchEvent(new KeyboardEvent('keydown', { key: 'ArrowRight' }))")
    page.wait_for_function("state.frame === 31 && state.saved > 0")
    page.evaluate("model.set('playing', true)")
    page.wait_for_function("state.frame !== 31")
    page.evaluate("leave()")
