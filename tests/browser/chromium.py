"""Which browser is opened, how, and where its screenshots are left. Without MWLIB_CHROMIUM its tests are passed over."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

CHROMIUM = os.environ.get("MWLIB_CHROMIUM", "")  # the command of a Chromium; it draws without a graphics card
SOFTWARE = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]
SHOTS = Path(__file__).parents[2] / "build" / "browser"
PATIENCE = 120_000  # milliseconds; drawing without a graphics card is slow
asked_for = pytest.mark.skipif(not CHROMIUM, reason="make test-player and make test-lab run it")
