"""Shared fixtures."""

from __future__ import annotations

import os
from pathlib import Path

import matplotlib
import pytest
import torch
from jaxtyping import install_import_hook

# Shapes in annotations are checked here, never at run time.
CHECKED = "transforms diffusion schedule sampling guidance denoisers predictor metrics multimodal baselines".split()
install_import_hook([f"mwlib.{name}" for name in CHECKED], "beartype.beartype")

matplotlib.use("Agg")
torch.set_num_threads(1)


@pytest.fixture(scope="session")
def data_folder() -> Path:
    """The folder of real motion capture; with MWLIB_DATA set, a missing file is a failure."""
    if "MWLIB_DATA" not in os.environ:
        pytest.skip("set MWLIB_DATA to the folder of real motion capture")
    return Path(os.environ["MWLIB_DATA"])


@pytest.fixture
def generator() -> torch.Generator:
    """A seeded source of randomness."""
    return torch.Generator().manual_seed(0)
