"""The player's JavaScript, as a page gets it: packed once, and unpacked by the browser without any network."""

from __future__ import annotations

import base64
import gzip
import hashlib
import json
from functools import lru_cache
from pathlib import Path

ASSETS = Path(__file__).with_name("assets")
BUNDLE = ASSETS / "player.js"
SOURCES = ("player.src.js", "scene.src.js", "player.css", "package.json", "package-lock.json")
RECORD = "// sources "  # the bundle's first line: this, and `sources_hash`

# The first copy on a page serves all its players; a page may hold players of several versions, each with its own key.
LOAD = """
function load(key, packed) {
  const unpack = async () => {
    const bytes = Uint8Array.from(atob(packed), (letter) => letter.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    const code = new Blob([await new Response(stream).text()], { type: "text/javascript" });
    return import(URL.createObjectURL(code));
  };
  if (packed) globalThis[key] ??= unpack();
  return globalThis[key];
}
"""
FILL = """
const ready = document.readyState === "loading" && new Promise((go) => document.addEventListener("DOMContentLoaded", go));
Promise.all([load(%(key)s, %(packed)s), ready]).then(([player]) => player?.mountAll(%(key)s));
"""


def sources_hash() -> str:
    """SHA-256 over what the bundle is built of; line ends do not count."""
    digest = hashlib.sha256()
    for name in SOURCES:
        text = (ASSETS / name).read_text(encoding="utf-8")
        digest.update(f"{name}\n{len(text)}\n{text}".encode())
    return digest.hexdigest()


@lru_cache(maxsize=1)
def packed() -> tuple[str, str]:
    """A key that tells bundles apart, and the bundle as base64 of gzip."""
    code = BUNDLE.read_bytes()
    return f"mwlibPlayer_{hashlib.sha256(code).hexdigest()[:12]}", base64.b64encode(gzip.compress(code, 9, mtime=0)).decode()


def script(embed: bool) -> str:
    """A script element that fills the players of its page; without the bundle it needs another that has it."""
    key, code = packed()
    return f"<script>(() => {{{LOAD}{FILL % {'key': json.dumps(key), 'packed': json.dumps(code if embed else '')}}}})();</script>"
