"""Shared fixtures."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import jaxtyping
import matplotlib
import pytest
import torch
from beartype import BeartypeConf, beartype
from xdist.scheduler import LoadFileScheduling

# Shapes in annotations are checked here, never at run time. Settings have no shapes, and checks of their own.
ROOT = Path(__file__).parents[1]
NOTEBOOK_RUNS = "test_figures.py"
ROOMS = "body transforms networks diffusion metrics training matching prediction inbetweening text_to_motion".split()
FILES = [file for room in ROOMS for file in (ROOT / "mwlib" / room).glob("*.py") if file.stem not in ("__init__", "config")]
checker = beartype(conf=BeartypeConf(is_pep484_tower=True))  # 25 is a float, too
jaxtyping.install_import_hook(
    [".".join(file.relative_to(ROOT).with_suffix("").parts) for file in FILES], "tests.conftest.checker"
)

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


@pytest.fixture
def unchecked() -> Iterator[None]:
    """Shapes go unchecked, as for a user: what the functions themselves refuse."""
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)


@pytest.fixture(scope="session")
def finished(tmp_path_factory) -> Path:
    """Folder of a small run that has been trained to its end."""
    from mwlib.experiments import train_run
    from tests.sample_settings import small, two_people

    folder = tmp_path_factory.mktemp("run")
    list(train_run(small(), two_people(), folder))
    return folder


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The notebooks, which take longest, come first."""
    items.sort(key=lambda item: item.path.name != NOTEBOOK_RUNS)


class ByFile(LoadFileScheduling):
    """Parallel workers take whole files, for the sake of their fixtures; of the notebooks' runs one at a time."""

    def _split_scope(self, nodeid: str) -> str:
        return nodeid if NOTEBOOK_RUNS in nodeid else super()._split_scope(nodeid)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> ByFile:
    """What pytest-xdist asks."""
    return ByFile(config, log)
