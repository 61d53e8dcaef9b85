"""The table of the LaFAN1 benchmark: its two baselines, any other predictors, what was published, and whether it is met."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor
from tqdm import tqdm

from mwlib.body.rotation import slerp
from mwlib.inbetweening.lafan1 import PAST, Benchmark, Frames, Predictor, is_quiet, score

LENGTHS = (5, 15, 30, 45)  # frames of a transition
NEAR = 0.01  # 1 - |cos| of half an angle, below which the benchmark's code interpolates quaternions linearly
ALL_WINDOWS, ALL_CLIPS = 2232, 77  # of the whole data set
TOLERANCE = {"L2Q": 5e-3, "L2P": 5e-5, "NPSS": 5e-5}  # half of the last digit published

_HARVEY = "Harvey et al., 2020"
# For each method where it was published, and its errors at 5, 15, 30 and 45 frames; "-" where none was.
_PUBLISHED = {
    "zero velocity": (_HARVEY, "L2Q 0.56 1.10 1.51 1.81 L2P 1.5230 3.6944 6.6002 9.3289 NPSS 0.0053 0.0522 0.2318 0.4918"),
    "interpolation": (_HARVEY, "L2Q 0.22 0.62 0.98 1.25 L2P 0.3729 1.2488 2.3158 3.4469 NPSS 0.0023 0.0391 0.2013 0.4493"),
    "TG-complete": ("Harvey et al., 2020, quoted", "L2Q 0.17 0.42 0.69 0.94 L2P 0.23 0.65 - 2.24 NPSS - - - -"),
    "Δ-interpolator": (
        "Oreshkin et al., 2022, other export",
        "L2Q 0.114 0.317 0.572 - L2P 0.129 0.467 0.995 - NPSS 0.0014 0.0217 0.1217 -",
    ),
    "Two-stage Transformers": (
        "Qin et al., 2022",
        "L2Q 0.0994 0.2839 0.5446 0.8727 L2P 0.1049 0.3943 0.8948 1.6777 NPSS 0.0011 0.0188 0.1124 0.3217",
    ),
}


def table(
    benchmark: Benchmark,
    predictors: Mapping[str, Predictor] | None = None,
    lengths: Sequence[int] = LENGTHS,
    progress: bool = False,
) -> list[dict[str, Any]]:
    """Scores of several predictors at several lengths.

    Args:
        predictors: by name; None = the two baselines of the benchmark.
        lengths: of transitions, frames.
        progress: show a bar on stderr.

    Returns:
        A row for each predictor and length: "method", "N", "windows", "L2Q", "L2P", "NPSS".

    Raises:
        ValueError: as in `score`.
    """
    methods = BASELINES if predictors is None else predictors
    cases = [(name, n) for name in methods for n in lengths]
    rows = []
    for name, n in tqdm(cases, "scoring", unit="row", disable=is_quiet(progress)):
        found = score(benchmark, methods[name], n)
        errors = {"L2Q": float(found.l2q.mean()), "L2P": float(found.l2p.mean()), "NPSS": found.npss}
        rows.append({"method": name, "N": n, "windows": len(benchmark), **errors})
    return rows


def zero_velocity(context: Frames, target: Frames, length: int) -> Frames:
    """The last frame before the transition, repeated."""
    last = context.cut(PAST - 1, PAST)
    return Frames(last.rotations.expand(-1, length, -1, -1), last.root.expand(-1, length, -1))


def interpolation(context: Frames, target: Frames, length: int) -> Frames:
    """From the last frame before the transition to the one after it: the root linearly, local rotations by `benchmark_slerp`."""
    share = torch.arange(1, length + 1).to(target.root) / (length + 1)
    last = context.cut(PAST - 1, PAST)
    root = torch.lerp(last.root, target.root, share[:, None])
    return Frames(benchmark_slerp(last.rotations, target.rotations, share[:, None]), root)


BASELINES: dict[str, Predictor] = {"zero velocity": zero_velocity, "interpolation": interpolation}


def benchmark_slerp(
    a: Float[Tensor, "*#lead 4"], b: Float[Tensor, "*#lead 4"], share: Float[Tensor, "*#lead"]
) -> Float[Tensor, "*lead 4"]:
    """`slerp`, but linear and then normalised where the two are near, as in the benchmark's code. They differ by up to 5e-5."""
    dot = (a * b).sum(dim=-1, keepdim=True)
    line = torch.lerp(a, torch.where(dot < 0, -b, b), share[..., None])
    return torch.where(1 - dot.abs() < NEAR, torch.nn.functional.normalize(line, dim=-1), slerp(a, b, share))


def is_complete(benchmark: Benchmark) -> bool:
    """Whether these are all test windows and all clips, so that numbers may be compared with published ones."""
    return len(benchmark) == ALL_WINDOWS and benchmark.clips == ALL_CLIPS


def published() -> list[dict[str, Any]]:
    """Published rows in the form of `table`, with their "source"; an error that was not published is None."""
    rows = []
    for method, (source, text) in _PUBLISHED.items():
        words = text.split()
        width = len(LENGTHS) + 1
        errors = {words[i]: words[i + 1 : i + width] for i in range(0, len(words), width)}
        for place, n in enumerate(LENGTHS):
            found = {name: None if values[place] == "-" else float(values[place]) for name, values in errors.items()}
            rows.append({"method": method, "N": n, "windows": ALL_WINDOWS, **found, "source": source})
    return rows


def misses(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Where the baselines' errors are not the published digits; only of all windows that means anything.

    Args:
        rows: from `table`.

    Returns:
        A sentence for each error that is off by more than `TOLERANCE`; none if all digits are met.
    """
    expected = {(row["method"], row["N"]): row for row in published() if row["method"] in BASELINES}
    found = []
    for row in rows:
        known = expected.get((row["method"], row["N"]), {})
        for name in TOLERANCE.keys() & known.keys():
            if not abs(row[name] - known[name]) <= TOLERANCE[name]:  # True for nan
                found.append(f"{name} of {row['method']} at {row['N']} frames is {row[name]:.5f}, published {known[name]:g}")
    return sorted(found)
