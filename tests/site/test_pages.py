"""Every page of the built site in a headless browser, as on a desk and as on a phone. `make test-site` runs this.

MWLIB_BROWSER names the browser; without it, Chromium or Chrome is looked for. A page that asks for anything but
the site's own files fails.
"""

from __future__ import annotations

import re

import pytest

from tests.site.conftest import SITE

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


@pytest.mark.parametrize("word", ["guidance", "wavelet", "blender"])
def test_search_finds_chapters_and_howtos_before_modules(page, address, word):
    page.goto(address + f"search.html?q={word}")
    page.wait_for_function("/found|finished/i.test(document.querySelector('.search-summary')?.textContent)")
    found = page.eval_on_selector_all("ul.search li > a", "links => links.map(link => link.getAttribute('href'))")
    assert found[0].startswith(("notebooks/", "howto/"))


def test_dark_pages_are_dark(browser, address):
    shades = {}
    for scheme in ("light", "dark"):
        page = browser.new_page(color_scheme=scheme)
        page.goto(address)
        shades[scheme] = page.evaluate("getComputedStyle(document.body).backgroundColor.match(/\\d+/g).slice(0, 3).map(Number)")
        page.close()
    assert min(shades["light"]) > 200 and max(shades["dark"]) < 60
