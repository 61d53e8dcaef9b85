"""Predictions as motions of a body in the world, to be shown or written to files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from torch import Tensor

from mwlib.body.motion import Motion
from mwlib.prediction.predictor import Predictor


def continued(
    predictor: Predictor, motions: Sequence[Motion], samples: int | None = None, seed: int | None = None, progress: bool = False
) -> list[list[Motion]]:
    """Each clip's last H frames and sampled futures of them, as motions in the form that the model was trained on.

    The model knows no root: in the future it stays where it was last seen (own choice).

    Args:
        predictor: a trained model.
        motions: clips of at least H frames after resampling.
        samples, seed, progress: as in `Predictor.predict`.

    Returns:
        For each clip a list of S motions of H + F frames, positions only.

    Raises:
        ValueError: a clip does not fit the model.
    """
    futures = predictor.predict(motions, samples, seed, progress=progress)
    history = predictor.representation.history
    ready = [m.cut(len(m) - history, len(m)) for m in predictor.bodies.prepare(motions)]
    return [[_joined(m, future) for future in row] for m, row in zip(ready, futures, strict=True)]


def _joined(observed: Motion, future: Float[Tensor, "F C"]) -> Motion:
    joints = future.numpy().reshape(len(future), -1, 3)
    root = observed.positions[-1, :1]
    ahead = np.concatenate([np.zeros_like(joints[:, :1]), joints], axis=1) + root
    positions = np.concatenate([observed.positions, ahead.astype(observed.positions.dtype)])
    return replace(observed, positions=positions, rig=None)
