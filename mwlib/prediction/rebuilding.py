"""Errors of coding and rebuilding motions of people held out, as a system without a net.

Its grid is `phase_sweep`. Its rows change the settings of the prediction, and those of `RebuildingConfig`.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import prod
from typing import Any, ClassVar, Literal

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from mwlib.data.sources import Split
from mwlib.data.windows import Windows, windows
from mwlib.metrics import Column, clustered_error, summary
from mwlib.prediction import config
from mwlib.prediction.representation import LEARNING_WINDOWS, learning_windows, transform_of
from mwlib.prediction.system import load_data, make_objective, open_model  # noqa: F401  (what every system has)
from mwlib.settings import Natural, Positive
from mwlib.transforms import PhaseTransform, Transform

METRICS = {
    "numbers": Column("numbers a frame"),
    "error": Column("error (mm)", "lower", 1000.0),
    "rmse": Column("RMSE (m)", "lower"),
    "seen": Column("error, people seen (mm)", "lower", 1000.0),
}
PRINCIPAL_BATCHES = 64  # of 16 windows: components of so many are the same to a tenth of a millimetre

Rebuild = Callable[[Float[Tensor, "N T C"]], Float[Tensor, "N T C"]]
_fitted: dict[tuple[str, ...], Transform] = {}  # what this process fitted: rows that differ in whom they rebuild share it


@dataclass(frozen=True)
class RebuildingConfig:
    """What is rebuilt, and by what."""

    rebuilt: Literal["test", "validation"] = "test"  # whose windows; settings are chosen on those of "validation"
    components: Natural = 0  # principal components of each frame, instead of the transform; 0 = the transform
    phase_lr: Positive = 3e-3  # first learning rate of a periodic autoencoder
    phase_batch: Natural = 0  # windows at a time of which it learns; 0 = as the transform has it


@dataclass(frozen=True)
class Config(config.Config):
    """Everything that a rebuilt motion depends on: the settings of the prediction and four more.

    Raises:
        ValueError: as `mwlib.prediction.config.Config`, or motions are modelled neither as poses nor as displacements.
    """

    system: ClassVar[str] = "rebuilding"
    rebuilding: RebuildingConfig = field(default_factory=RebuildingConfig)

    def check(self) -> None:
        """Refuse what is not rebuilt here, and values that do not fit each other."""
        super().check()
        if self.model.representation == "relaxing" or self.model.heading == "body":
            raise ValueError(
                f"representation is {self.model.representation!r}, heading {self.model.heading!r}; "
                "expected poses or displacements as people face"
            )


def principal(sample: Float[Tensor, "... C"], components: int) -> Rebuild:
    """Rebuild every frame from so many of its principal components, the best linear code of single poses.

    Source: principal component analysis; the mean and the axes are those of the sample, float64.

    Args:
        sample: frames.
        components: numbers for each frame.

    Raises:
        ValueError: there are more components than channels.
    """
    frames = sample.reshape(-1, sample.shape[-1]).double()
    if components > frames.shape[1]:
        raise ValueError(f"components is {components}; expected at most the {frames.shape[1]} channels of a frame")
    mean = frames.mean(0)
    axes = torch.linalg.eigh((frames - mean).T @ (frames - mean)).eigenvectors[:, -components:]
    return lambda x: ((x.double() - mean) @ axes @ axes.T + mean).to(x.dtype)


def evaluate(cfg: Config, get_model: Callable[[], Any], split: Split, progress: bool = False) -> dict[str, Any]:
    """How far motions are from what a representation makes of them, on windows as the prediction models them.

    A displacement from the last observed pose has the errors of the pose itself.

    Args:
        cfg: windows, transform and whom to rebuild.
        get_model: not asked for; a representation needs no network.
        split: the training clips fit what is fitted, and nothing else.
        progress: show nothing; one row takes minutes.

    Returns:
        "mean" and "standard_error" by metric (numbers that stand for a frame; mean distance of a joint, metres; root mean square
        over coordinates, metres; mean distance on the training people), "windows", "values" and "clips" as in prediction.

    Raises:
        ValueError: nobody is held out for the part that is to be rebuilt.
    """
    cut, options = cfg.windows, cfg.rebuilding
    part = split.validation if options.rebuilt == "validation" else split.test
    if not part:
        raise ValueError(f"rebuilt is {options.rebuilt!r}, and nobody is held out for it; expected {options.rebuilt}_subjects")
    held_out = windows(part, cut.history, cut.future, cut.test_stride).thin(cut.test_windows)
    rebuild, numbers = _rebuild(cfg, split)
    errors, squares = _errors(rebuild, held_out, cfg)
    seen = windows(split.train, cut.history, cut.future, cut.frames)
    known, _ = _errors(rebuild, seen, cfg)
    clusters, rmse = _clusters(held_out), float(np.sqrt(squares.mean()))
    mean = {"numbers": numbers, "error": float(errors.mean()), "rmse": rmse, "seen": float(known.mean())}
    of_root = clustered_error(squares, clusters) / max(2 * rmse, 1e-30)  # to first order
    errors_of_means = {"numbers": 0.0, "rmse": of_root, "seen": clustered_error(known, _clusters(seen))}
    return summary({"error": torch.from_numpy(errors)}, clusters, mean, errors_of_means)


def _rebuild(cfg: Config, split: Split) -> tuple[Rebuild, float]:
    """From coefficients back, and how many of them stand for a frame."""
    model, options = cfg.model, cfg.rebuilding
    draw = learning_windows(cfg, split.train, options.phase_batch or LEARNING_WINDOWS.get(model.transform, 16))
    if options.components:
        generator = torch.Generator().manual_seed(0)
        sample = torch.cat([draw(generator) for _ in range(PRINCIPAL_BATCHES)])
        return principal(sample, options.components), float(options.components)
    key = (cfg.override(rebuilt="test").training_hash(), *split.fingerprints())
    if key not in _fitted:
        base = transform_of(cfg, split.train[0].skeleton)
        if isinstance(base, PhaseTransform):
            base.fit(draw, model.phase_steps, options.phase_lr)
        _fitted[key] = base
    base = _fitted[key]
    return lambda x: base.inverse(base(x)), prod(base.shape) / cfg.windows.frames


def _errors(rebuild: Rebuild, held_out: Windows, cfg: Config) -> tuple[Float[np.ndarray, " N"], Float[np.ndarray, " N"]]:
    """Mean distance of a joint in each window, metres, and mean square over its coordinates."""
    x = held_out.x - held_out.x_history[:, -1:] if cfg.model.representation == "displacement" else held_out.x
    apart = (rebuild(x) - x).double().unflatten(-1, (-1, 3))
    return apart.norm(dim=-1).mean((1, 2)).numpy(), apart.square().mean((1, 2, 3)).numpy()


def _clusters(held_out: Windows) -> list[str]:
    """The clip of each window; of one clip alone, its stretches as long as a window."""
    names = [held_out.motions[i].name or str(i) for i in held_out.clip.tolist()]
    if len({*names}) > 1:
        return names
    return [f"{name}, {start // held_out.x.shape[1]}" for name, start in zip(names, held_out.start.tolist(), strict=True)]
