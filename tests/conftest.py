"""Shared fixtures."""

from __future__ import annotations

import os
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import jaxtyping
import matplotlib
import pytest
import torch
from beartype import BeartypeConf, beartype
from xdist.scheduler import LoadFileScheduling

from tests import unchanged

# Shapes in annotations are checked here, never at run time. Settings have no shapes, and checks of their own.
ROOT = Path(__file__).parents[1]
NOTEBOOK_RUNS = "test_figures.py"
REAL_CLIPS = ("tests/data/test_real.py", "tests/data/test_fetching.py")  # one worker reads them for both
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


@pytest.fixture(scope="module")
def grids_read_once() -> Iterator[None]:
    """The course's grids are read once for all tests of a file, as that takes a second."""
    from mwlib.experiments import claims, grids

    known = cache(grids.read_grids)
    with pytest.MonkeyPatch.context() as patch:
        for module in (claims, grids):
            patch.setattr(module, "read_grids", known)
        yield


@pytest.fixture(scope="session")
def finished(tmp_path_factory) -> Path:
    """Folder of a small run that has been trained to its end."""
    from mwlib.experiments import train_run
    from tests.sample_settings import small, two_people

    folder = tmp_path_factory.mktemp("run")
    list(train_run(small(), two_people(), folder))
    return folder


def pytest_addoption(parser: pytest.Parser) -> None:
    """The option of `make test`."""
    text = "leave out the test files for which nothing has changed since all their tests passed with this option"
    parser.addoption("--changed", action="store_true", help=text)


class Changed:
    """Which files are left out is decided once, before anything runs; the workers of pytest-xdist are told."""

    def __init__(self) -> None:
        self.keys = unchanged.keys()
        self.left_out = unchanged.unchanged(self.keys)
        self.passed: dict[str, bool] = {}

    @pytest.hookimpl(optionalhook=True)
    def pytest_configure_node(self, node) -> None:
        node.workerinput["left_out"] = self.left_out

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        place = report.nodeid.partition("::")[0]
        self.passed[place] = self.passed.get(place, True) and not report.failed

    def pytest_sessionfinish(self, session: pytest.Session, exitstatus: int) -> None:
        if not hasattr(session.config, "workerinput") and exitstatus in (0, 1) and not session.shouldstop:
            unchanged.keep(self.keys, [place for place, passed in self.passed.items() if passed])

    def pytest_terminal_summary(self, terminalreporter) -> None:
        if self.left_out:
            told = f"{len(self.left_out)} test files are as when they passed and were left out; make test ALL=1 runs them, too"
            terminalreporter.write_line(told)


def pytest_configure(config: pytest.Config) -> None:
    """With a choice of tests nothing is stamped: their files may hold others."""
    whole = not config.option.keyword and not config.option.markexpr and not any("::" in word for word in config.args)
    if config.getoption("changed") and whole and not hasattr(config, "workerinput"):
        config.pluginmanager.register(Changed(), "changed")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """The notebooks, which take longest, come first; files for which nothing has changed go."""
    items.sort(key=lambda item: item.path.name != NOTEBOOK_RUNS)
    plugin = config.pluginmanager.get_plugin("changed")
    left_out = {ROOT / place for place in (plugin.left_out if plugin else getattr(config, "workerinput", {}).get("left_out", ()))}
    if gone := [item for item in items if item.path in left_out]:
        config.hook.pytest_deselected(items=gone)
        items[:] = [item for item in items if item.path not in left_out]


class ByFile(LoadFileScheduling):
    """Parallel workers take whole files, for the sake of their fixtures; of the notebooks' runs one at a time."""

    def _split_scope(self, nodeid: str) -> str:
        file = super()._split_scope(nodeid)
        return nodeid if NOTEBOOK_RUNS in nodeid else REAL_CLIPS[0] if file in REAL_CLIPS else file


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> ByFile:
    """What pytest-xdist asks."""
    return ByFile(config, log)
