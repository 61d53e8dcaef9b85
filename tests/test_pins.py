"""Numbers that the whole library gave for fixed seeds; a change of code that is no change of behaviour leaves them alone.

`pins.safetensors` holds, of every tensor below, eight entries, the sum and the sum of magnitudes. It was written by the code
before the library was laid out in rooms. Where behaviour changes on purpose, write it again, and say so in the commit:
``python -m tests.test_pins``.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
import torch
from safetensors.torch import load_file, save_file
from torch import Tensor

from mwlib.body.skeleton import H36M17
from mwlib.data import windows
from mwlib.experiments import load_run, train_run
from mwlib.prediction import baselines
from mwlib.prediction.config import EvaluationConfig
from mwlib.prediction.control import controlled, feathered, frame_mask, joint_mask
from mwlib.prediction.system import METRICS, score
from mwlib.transforms import DCTTransform, WaveletTransform, fit_scale
from tests.sample_settings import small, two_people

FILE = Path(__file__).with_name("pins.safetensors")
ENTRIES = 8
# What another CPU may change, as a share of the tensor's mean magnitude. One float32 operation is off by 6e-8, a product of
# matrices summed in another order by 1e-6. Without vector instructions and with its libraries in their compatible mode, the
# machine that wrote the pins differs from itself by 3e-6 at most; in what is trained by 5e-4, as AdamW's steps are as long for
# gradients that are mere rounding as for large ones; and in the phase codes, which are trained twice, by 1e-4.
TOLERANCE, TRAINED = 1e-4, 2e-3

TRAININGS = {
    "tiny": {},
    "displacement": dict(representation="displacement", loss_weight="metric", clip_gradient=1.0),
    "raw": dict(
        prediction="eps", coefficient_scale="none", lr_schedule="multistep", augment="humanmac", window_sampling="subject_action",
        drop_per="batch",
    ),
    "dct": dict(transform="dct", dct_rows=8, prediction="v"),
    "phase": dict(transform="phase", phase_steps=20, phases=4),
}  # fmt: skip
SAMPLINGS = {
    "plain": dict(wmsg="off"),
    "cfg": dict(guidance_weight=0.3),
    "alg1": dict(guidance_weight=0.7, guidance_form="alg1"),
    "tabg": dict(guidance_weight=0.3, tabg_scale=1.0),
    "tabg_eps": dict(guidance_weight=0.3, tabg_scale=1.0, tabg_space="eps", tabg_noise="shared"),
    "tabg_hat": dict(guidance_weight=0.3, tabg_scale=1.5, tabg_noise="eps_hat", tabg_sigma_place="alg1", tabg_steps=0.5),
    "wmsg": dict(wmsg="every_step"),
    "y0_hat": dict(wmsg="y0_hat"),
    "bound": dict(bound=0.4),
    "eta": dict(eta=0.5),
    "dpmpp": dict(sampler="dpmpp"),
    "eq6": dict(sampler="eq6"),
    "leading": dict(spacing="leading", ddim_steps=10),
    "complete": dict(complete_history=True),
    "all": dict(guidance_weight=0.3, tabg_scale=1.0, wmsg="every_step"),
}


def transforms() -> Iterator[tuple[str, Tensor]]:
    """Coefficients, inverses, projections, scales."""
    x = torch.randn(3, 20, 48, generator=torch.Generator().manual_seed(0)).cumsum(1) * 0.05
    for wavelet, mode, level in (("bior2.8", "zero", 1), ("haar", "symmetric", 1), ("db4", "periodization", 2)):
        tf, name = WaveletTransform(20, 48, wavelet, mode, level), f"{wavelet}/{mode}/{level}"
        y = tf(x)
        noise = torch.randn(y.shape, generator=torch.Generator().manual_seed(1))
        yield from {f"wavelet/{name}": y, f"inverse/{name}": tf.inverse(y), f"project/{name}": tf.project(noise)}.items()
    dct = DCTTransform(20, 48, 8)
    yield from {"dct": dct(x), "dct/inverse": dct.inverse(dct(x))}.items()
    for kind in ("band", "coefficient"):
        mean, deviation = fit_scale(tf, x, kind)
        yield from {f"scale/{kind}/mean": mean, f"scale/{kind}/deviation": deviation}.items()


def data() -> Iterator[tuple[str, Tensor]]:
    """The synthetic people."""
    for motion in two_people().train:
        yield f"synthetic/{motion.action}", torch.from_numpy(motion.positions)


@cache
def trained(name: str):
    """Losses and predictor of one of the trainings."""
    cfg = small(train_steps=20, checkpoint_every=10, **TRAININGS[name])
    with TemporaryDirectory() as folder:
        steps = list(train_run(cfg, two_people(), Path(folder)))
        return steps, load_run(folder)


@cache
def cut():
    """Windows of both people."""
    people = two_people()
    return windows([*people.train, *people.validation], 6, 14, 9)


def training(name: str) -> Iterator[tuple[str, Tensor]]:
    """Losses, weights, futures."""
    steps, predictor = trained(name)
    yield f"train/{name}/loss", torch.tensor([s.loss for s in steps], dtype=torch.float64)
    yield f"train/{name}/validation", torch.tensor([s.validation for s in steps if s.validation is not None], dtype=torch.float64)
    yield f"train/{name}/weights", torch.cat([weight.detach().flatten() for weight in predictor.net.parameters()])
    if name in ("dct", "phase"):
        yield f"sample/{name}/plain", predictor.predict(cut().x_history[:5], 3, 1)


def sampling(name: str) -> Iterator[tuple[str, Tensor]]:
    """Futures by every guidance and solver."""
    _, predictor = trained(name)
    for kind, changes in SAMPLINGS.items():
        yield f"sample/{name}/{kind}", predictor.with_sampling(**changes).predict(cut().x_history[:5], 3, 1)


def control() -> Iterator[tuple[str, Tensor]]:
    """Futures under masks, hard and feathered."""
    (_, predictor), w = trained("displacement"), cut()
    arm, end = joint_mask(H36M17, ["left_arm"], 20), frame_mask(20, 48, 15)
    cases = {"joint": (arm, {}), "switch": (end, {}), "feather": (feathered(end, 3), {"active": 1.0})}
    cases["y0_hat"] = end, {"space": "y0_hat"}
    for name, (mask, options) in cases.items():
        yield f"control/{name}", controlled(predictor, w.x[7:10], mask, 2, 3, x_history=w.x_history[:3], **options)


def evaluation() -> Iterator[tuple[str, Tensor]]:
    """Metrics of a predictor, and baselines."""
    (_, predictor), w = trained("displacement"), cut()
    found = score(lambda past, ids: predictor.predict(past, 4, 0, window_ids=ids), w.thin(20), w, EvaluationConfig())
    for kind in ("mean", "standard_error"):
        yield f"metrics/{kind}", torch.tensor([found[kind][name] for name in sorted(METRICS)], dtype=torch.float64)
    yield "metrics/cmd", torch.tensor([found["cmd"]], dtype=torch.float64)
    yield "baseline/nearest", baselines.NearestHistory(w.x[20:], 6, 4).predict(w.x_history[:5])
    yield "baseline/constant", baselines.constant_velocity(w.x_history[:5], 14)


PARTS = {
    "transforms": transforms, "data": data, "control": control, "evaluation": evaluation,
    **{f"training {name}": lambda name=name: training(name) for name in TRAININGS},
    **{f"sampling {name}": lambda name=name: sampling(name) for name in ("tiny", "displacement", "raw")},
}  # fmt: skip


def pin(tensor: Tensor) -> Tensor:
    """Sum, sum of magnitudes, and entries spread over the tensor, float64; only the sums of a shorter one."""
    flat = tensor.detach().double().flatten()
    at = torch.linspace(0, len(flat) - 1, min(ENTRIES, len(flat))).long()
    return torch.cat([flat.sum()[None], flat.abs().sum()[None], flat[at]])


def deviation(found: Tensor, expected: Tensor, size: int) -> float:
    """Largest difference of two pins of tensors of so many values, as a share of the mean magnitude (a metre where all are 0)."""
    share = (found - expected).abs() / (float(expected[1]) / size or 1.0)
    share[:2] /= size
    return float(share.max())


@cache
def pins() -> dict[str, Tensor]:
    return load_file(FILE)


@pytest.mark.parametrize("part", PARTS)
def test_numbers_are_what_they_were(part):
    for name, tensor in PARTS[part]():
        expected, found = pins()[name], pin(tensor)
        assert len(found) == len(expected), name
        off = deviation(found, expected, tensor.numel())
        allowed = TRAINED if name.startswith("train/") or "phase" in name else TOLERANCE
        assert off < allowed, f"{name} is off by {off:.1e} of its mean magnitude"


def test_the_file_is_small_and_holds_nothing_that_is_not_looked_at():
    assert FILE.stat().st_size < 60_000
    samples = {f"sample/{name}/{kind}" for name in ("tiny", "displacement", "raw") for kind in SAMPLINGS}
    samples |= {"sample/dct/plain", "sample/phase/plain"}
    assert {name for name in pins() if name.startswith("sample/")} == samples
    assert {name.split("/")[1] for name in pins() if name.startswith("train/")} == set(TRAININGS)


def write() -> None:
    """Pin today's numbers."""
    save_file({name: pin(tensor) for part in PARTS.values() for name, tensor in part()}, FILE)


if __name__ == "__main__":
    torch.set_num_threads(1)
    write()
