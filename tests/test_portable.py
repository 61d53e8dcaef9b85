"""mwlib on Windows and macOS, as far as Linux can tell: nothing of one system at import, no double precision on a device."""

from __future__ import annotations

import ast
import importlib
import os
import pkgutil
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_leaves

import mwlib
from mwlib.data.sources import Split
from mwlib.data.windows import prepare, windows
from mwlib.prediction import system
from mwlib.prediction.config import Config
from mwlib.prediction.objective import PredictionObjective
from mwlib.synthetic.motions import synthetic_motions
from tests.forked import done

ROOT = Path(__file__).parents[1]

ABSENT = ["crypt", "fcntl", "grp", "posix", "pty", "pwd", "resource", "syslog", "termios", "tty"]
OF_OS = "fork forkpty getpgid getuid geteuid killpg mkfifo nice sched_getaffinity setsid uname waitpid".split()
OF_SIGNAL = "SIGALRM SIGCHLD SIGHUP SIGKILL SIGUSR1 SIGUSR2 alarm setitimer".split()


def import_all() -> None:
    """Everything is imported once, so that other packages have what they want of this system; then mwlib alone, without it."""
    names = ["mwlib", *(found.name for found in pkgutil.walk_packages(mwlib.__path__, "mwlib."))]
    for name in names:
        importlib.import_module(name)
    for name in [name for name in sys.modules if name.partition(".")[0] == "mwlib"]:
        del sys.modules[name]
    sys.modules.update(dict.fromkeys(ABSENT))
    for module, gone in ((os, OF_OS), (signal, OF_SIGNAL)):
        for name in gone:
            delattr(module, name)
    for name in names:
        importlib.import_module(name)
    print(len(names))


def test_every_module_can_be_imported_without_posix(tmp_path):
    assert int(done(import_all, log=tmp_path / "log", cwd=ROOT).split()[-1]) > 50


def test_text_files_are_utf8_everywhere():
    """Windows reads and writes another encoding unless told."""
    found = []
    for path in sorted((ROOT / "mwlib").rglob("*.py")):
        calls = [node for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(node, ast.Call)]
        for call in calls:
            text = isinstance(call.func, ast.Attribute) and call.func.attr in ("read_text", "write_text")
            text |= ast.unparse(call.func) == "open" and "b" not in str(ast.unparse(call.args[1]) if call.args[1:] else "")
            if text and not any(keyword.arg == "encoding" for keyword in call.keywords):
                found.append(f"{path.relative_to(ROOT)}:{call.lineno}")
    assert found == []


class SinglePrecision(TorchDispatchMode):
    """Nothing off the CPU is in double precision, which Apple's GPUs do not have."""

    def __torch_dispatch__(self, func: Callable[..., Any], types: Any, args: Any = (), kwargs: Any = None) -> Any:
        out = func(*args, **(kwargs or {}))
        for found in tree_leaves(out):
            if isinstance(found, torch.Tensor) and found.device.type != "cpu":
                assert found.dtype not in (torch.float64, torch.complex128), func
        return out


SMALL = dict(fps=10.0, history=6, future=14, width=16, layers=2, heads=2, feedforward=16, steps=50, ddim_steps=3)


@pytest.fixture(scope="module")
def motions():
    return prepare(synthetic_motions(subjects=1)[:4], 10.0)


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"sampler": "dpmpp", "transform": "dct"},
        {"sampler": "eq6", "representation": "pose"},
        {"wmsg": "every_step", "tabg_scale": 1.0, "guidance_weight": 1.0},
        {"coefficient_scale": "none", "loss_weight": "metric", "bound": 3.0},
    ],
    ids=lambda changes: " ".join(map(str, changes.values())) or "plain",
)
def test_devices_get_single_precision_only(motions, changes):
    """Training and sampling on a device that only knows shapes."""
    cfg = Config.preset("tiny", **SMALL, **changes)
    objective = PredictionObjective(cfg, Split(motions, [], []))
    past = windows(motions, cfg.windows.history, cfg.windows.future, 5).x_history[:2]
    predictor = system.open_model(cfg, objective.network.state_dict(), objective.learnt(), objective.about())
    with SinglePrecision():
        network = objective.network.to("meta")
        objective.to(torch.device("meta"))
        objective.loss(network, objective.draw(4, torch.Generator()), torch.Generator()).backward()
        last = list(predictor.to("meta").steps(past, 3, 0))[-1]
    assert last.y.device.type == "meta" and last.y.dtype == torch.float32
