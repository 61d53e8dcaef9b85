"""Normalisation of HumanML3D and KIT features."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Literal

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from mwlib.data.formats.humanml import LAYOUTS, FeatureLayout
from mwlib.data.untrusted import MotionFormatError, numbers, read_array, read_bytes
from mwlib.settings import choice

Kind = Literal["mdm", "stablemofusion", "evaluator"]
# By what deviations of the root's features and of contacts are divided, so that these weigh more: Free-T2M's two base models
# and the evaluators of Guo et al. 2022 (code: `feat_bias`, and the ratio of the evaluators' t2m_std.npy to Std.npy).
WEIGHT: dict[str, float] = {"mdm": 1.0, "stablemofusion": 5.0, "evaluator": 25.0}
WEIGHED = ("yaw_rate", "root_velocity", "height", "contacts")
COLUMNS = 64  # features measured together: all of HumanML3D in float64 would take 14 GB
SMALL_ARRAY = 100_000  # bytes; Mean.npy has 3 thousand


@dataclass(frozen=True, eq=False)
class Statistics:
    """Mean and deviation of the features of one data set, and for which model their deviations were made.

    Args:
        kind: "mdm": deviations as measured; "stablemofusion" and "evaluator": those of root and contacts divided by 5 and 25.
        mean, deviation: (D,) float32; deviations are positive.
        layout: of the features.

    Raises:
        ValueError: another width, a deviation that is not positive, or an unknown kind.

    >>> model = Statistics("mdm", torch.zeros(263), torch.ones(263), LAYOUTS[263])
    >>> float(model.of_kind("evaluator").normalise(torch.ones(2, 40, 263))[0, 0, 3])
    25.0
    """

    kind: Kind
    mean: Float[Tensor, " D"]
    deviation: Float[Tensor, " _D"]
    layout: FeatureLayout

    def __post_init__(self) -> None:
        choice("kind", self.kind, WEIGHT)
        width = self.layout.width
        for name, values in (("mean", self.mean), ("deviation", self.deviation)):
            if values.shape != (width,):
                raise ValueError(f"{name} has shape {tuple(values.shape)}; expected ({width},) for {self.layout.name}")
        if not bool((self.deviation > 0).all()):
            raise ValueError(f"the smallest deviation is {float(self.deviation.min()):g}; expected positive numbers")

    @classmethod
    def measured(cls, clips: Sequence[Float[np.ndarray, "_T D"]], layout: FeatureLayout, kind: Kind = "mdm") -> Statistics:
        """Mean of each feature over all frames; deviations are averaged within each block, as HumanML3D's Std.npy is.

        A block in which nothing varies gets the deviation 1 (own choice: it then stays 0).

        Args:
            clips: raw features; T may differ.
            layout: of the features.
            kind: which statistics to make of them.

        Raises:
            ValueError: no clips, or another width.
        """
        if not clips:
            raise ValueError("there are no clips; expected some, to measure mean and deviation")
        mean, deviation = np.empty((2, clips[0].shape[1]))
        for first in range(0, len(mean), COLUMNS):
            part = slice(first, first + COLUMNS)
            frames = np.concatenate([np.asarray(clip[:, part], np.float64) for clip in clips])
            mean[part], deviation[part] = frames.mean(axis=0), frames.std(axis=0)
        for block in layout.blocks.values():
            deviation[block] = deviation[block].mean() or 1.0
        mean, deviation = (torch.from_numpy(values.astype(np.float32)) for values in (mean, deviation))
        return cls("mdm", mean, deviation, layout).of_kind(kind)

    @classmethod
    def read(cls, means: Path, deviations: Path, kind: Kind = "mdm") -> Statistics:
        """Two .npy files as they are, such as Mean.npy and Std.npy of HumanML3D or KIT-ML.

        Args:
            means, deviations: the files.
            kind: for which model they were made.

        Raises:
            MotionFormatError: no such file, or no 263 or 251 finite numbers, or deviations that are not positive.
        """
        mean, deviation = _numbers(means), _numbers(deviations)
        if len(mean) not in LAYOUTS or len(mean) != len(deviation) or not (deviation > 0).all():
            found = f"{len(mean)} means, {len(deviation)} deviations from {deviation.min(initial=0):g}"
            expected = f"{' or '.join(map(str, LAYOUTS))} of each, deviations above 0"
            raise MotionFormatError(means.parent, f"{means.name}, {deviations.name}", found, expected)
        return cls(kind, torch.from_numpy(mean), torch.from_numpy(deviation), LAYOUTS[len(mean)])

    @classmethod
    def from_tensors(cls, kind: Kind, tensors: Mapping[str, Tensor]) -> Statistics:
        """Inverse of `tensors`."""
        return cls(kind, tensors["mean"], tensors["deviation"], LAYOUTS[len(tensors["mean"])])

    def tensors(self) -> dict[str, Tensor]:
        """Mean and deviation, to be saved with a model; `kind` is to be saved beside them."""
        return {"mean": self.mean, "deviation": self.deviation}

    def of_kind(self, kind: Kind) -> Statistics:
        """The same measured numbers as another model scales them.

        The evaluators published with HumanML3D have a mean of their own for the root's height (0.9176 m, not 0.9386 m);
        `read` takes it from their files.
        """
        choice("kind", kind, WEIGHT)
        deviation = self.deviation.clone()
        for name in WEIGHED:
            deviation[self.layout.blocks[name]] *= WEIGHT[self.kind] / WEIGHT[kind]
        return Statistics(kind, self.mean, deviation, self.layout)

    def normalise(self, raw: Float[Tensor, "*lead D"]) -> Float[Tensor, "*lead D"]:
        """Raw features less the mean, by the deviation."""
        return (raw - self.mean.to(raw)) / self.deviation.to(raw)

    def denormalise(self, values: Float[Tensor, "*lead D"]) -> Float[Tensor, "*lead D"]:
        """Inverse of `normalise`: features in their own units. Gradients pass."""
        return values * self.deviation.to(values) + self.mean.to(values)


def _numbers(file: Path) -> Float[np.ndarray, " D"]:
    array = read_array(BytesIO(read_bytes(file, SMALL_ARRAY)), file, "array")
    fits = array.ndim == 1 and array.dtype.kind == "f"
    return numbers(array, fits, file, "array", "numbers of shape (263,) or (251,)").astype(np.float32)
