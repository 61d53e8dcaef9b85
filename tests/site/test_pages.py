"""Every page of the built site in a headless browser, as on a desk and as on a phone. `make test-site` runs this.

MWLIB_BROWSER names the browser; without it, Chromium or Chrome is looked for. A page that asks for anything but
the site's own files fails.
"""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Iterator
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

import pytest
from playwright.sync_api import Browser, Page, sync_playwright

SITE = Path(__file__).parents[2] / "build" / "site"
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "microsoft-edge")
HELP = (
    "no browser found: install Chromium (Debian: apt-get install chromium) or Chrome, or run `playwright install chromium`, "
    "or name one in MWLIB_BROWSER"
)
QUIET = ["--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update", "--no-first-run"]
SIZES = {"desk": (1280, 900), "phone": (390, 844)}
NAMES = sorted(file.relative_to(SITE).as_posix() for file in SITE.rglob("*.html"))

# What a reader sees, without code: there `$` and backslashes are themselves. Text of a formula for screen readers is none either.
SEEN = """() => {
  const copy = document.querySelector('article, [role=main]').cloneNode(true);
  copy.querySelectorAll('code, pre, script, style, .katex').forEach(part => part.remove());
  return copy.textContent;
}"""
WIDE = """() => {
  const wide = document.documentElement.clientWidth, scrolls = part => {
    for (let p = part; p && p !== document.body; p = p.parentElement)
      if (/auto|scroll|hidden/.test(getComputedStyle(p).overflowX) || getComputedStyle(p).position === 'fixed') return true;
    return false;
  };
  return [...document.querySelectorAll('article *')].filter(part => {
    const box = part.getBoundingClientRect();
    return box.width && (box.right > wide + 1 || box.left < -1) && !scrolls(part) && !part.closest('.katex-mathml');
  }).slice(0, 3).map(part => part.outerHTML.slice(0, 120));
}"""
PICTURES = """() => [...document.images].filter(i => !i.closest('.sidebar-logo-container'))
  .map(i => [i.getAttribute('src').slice(0, 80), i.alt.trim(), i.complete && i.naturalWidth > 0])"""
RAW = re.compile(r"\$[^$\n]{1,80}\$|\$\$|\\(?:frac|sum|begin|mathbf|alpha|left|text)\b")


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


@pytest.fixture(scope="module", params=SIZES)
def page(browser, address, request) -> Iterator[Page]:
    """One window, of either size; `troubles` collects what goes wrong in it."""
    wide, high = SIZES[request.param]
    opened = browser.new_page(viewport={"width": wide, "height": high}, is_mobile=request.param == "phone")
    opened.set_default_timeout(120_000)  # a busy machine is slow to open the longest chapter
    opened.troubles = []
    opened.on("console", lambda message: opened.troubles.append(message.text) if message.type in ("error", "warning") else None)
    opened.on("pageerror", lambda error: opened.troubles.append(str(error)))
    opened.on(
        "request", lambda asked: asked.url.startswith((address, "data:")) or opened.troubles.append(f"asks for {asked.url}")
    )
    opened.on(
        "response", lambda answer: answer.ok or answer.status == 304 or opened.troubles.append(f"{answer.status} {answer.url}")
    )
    yield opened
    opened.close()


def test_the_site_is_built():
    assert "index.html" in NAMES and any(name.startswith("notebooks/") for name in NAMES), "make site comes first"
    root = SITE.parents[1]
    modules = {".".join(file.relative_to(root).with_suffix("").parts) for file in (root / "mwlib").rglob("[a-z]*.py")}
    assert {name for name in modules if "_material" not in name} <= {name[4:-5] for name in NAMES if name.startswith("api/")}


@pytest.mark.parametrize("name", NAMES)
def test_a_page_is_whole(page, address, name):
    page.troubles.clear()
    page.goto(address + name, wait_until="load")
    page.evaluate("document.querySelectorAll('details').forEach(part => part.open = true)")
    page.evaluate("document.querySelectorAll('img[loading=lazy]').forEach(picture => picture.loading = 'eager')")
    page.wait_for_function("[...document.images].every(picture => picture.complete)")
    assert page.troubles == []
    wide = page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
    assert wide <= 0 and page.evaluate(WIDE) == [], f"{wide} pixels too wide"
    pictures = page.evaluate(PICTURES)
    assert [picture for picture in pictures if not picture[1]] == [], "no alternative text"
    assert [picture for picture in pictures if not picture[2]] == [], "not loaded"
    assert RAW.findall(page.evaluate(SEEN)) == [], "a raw formula"
    assert page.locator(".katex-error").count() == 0
    assert page.locator("h1").count() == 1 or name == "search.html"  # which gets its title when something is searched


def test_formulae_have_their_fonts(page, address):
    page.goto(address + "notebooks/01_dwt_from_scratch.html")
    assert page.locator(".katex").count() > 50
    assert page.evaluate("document.fonts.ready.then(() => document.fonts.check('16px KaTeX_Math'))")
    assert page.evaluate("[...document.fonts].filter(f => f.family.includes('KaTeX') && f.status === 'loaded').length") > 0


def test_solutions_are_folded_until_asked_for(page, address):
    page.goto(address + "notebooks/01_dwt_from_scratch.html")
    solution = page.locator("div.tag_solution details").first
    code = solution.locator("pre").first
    assert page.locator("div.tag_solution").count() == page.locator("div.tag_solution details:not([open])").count() > 0
    assert not code.is_visible()
    solution.locator("summary").click()
    assert code.is_visible() and "Hide the solution" in solution.locator("summary").inner_text()


def test_search_finds_a_function_without_a_network(page, address):
    page.goto(address + "search.html?q=wavelet_matrices")
    page.wait_for_selector("ul.search li a")
    assert "api/mwlib.transforms" in page.locator("ul.search li a").first.get_attribute("href")


def test_dark_pages_are_dark(browser, address):
    shades = {}
    for scheme in ("light", "dark"):
        page = browser.new_page(color_scheme=scheme)
        page.goto(address)
        shades[scheme] = page.evaluate("getComputedStyle(document.body).backgroundColor.match(/\\d+/g).slice(0, 3).map(Number)")
        page.close()
    assert min(shades["light"]) > 200 and max(shades["dark"]) < 60
