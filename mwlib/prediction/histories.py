"""What a predictor may be given: motions, windows or an array of histories; each is made to fit, or refused with the reason."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from mwlib.body.motion import Motion
from mwlib.data.bodies import Bodies
from mwlib.data.windowing import Windows

Histories = Float[Tensor, "N H C"] | Float[np.ndarray, "N H C"] | Windows | Sequence[Motion]


def histories(source: Histories, bodies: Bodies, history: int) -> Float[Tensor, "N H C"]:
    """Observed frames as a model takes them, metres, root-relative.

    Args:
        source: clips, of which the last H frames are taken (turned, carried over to the skeleton and resampled as in training);
            windows of clips in the model's own form; or an array of that form.
        bodies: the model's form.
        history: H.

    Raises:
        ValueError: a clip is too short or of a body that does not fit; windows or an array have another form, or values that are
            no numbers. The message says what to call instead.
    """
    if isinstance(source, Windows):
        return _checked(_of_windows(source, bodies), bodies, history)
    if isinstance(source, (Tensor, np.ndarray)):
        return _checked(torch.as_tensor(source), bodies, history)
    if not source or not all(isinstance(m, Motion) for m in source):
        kinds = sorted({type(m).__name__ for m in source}) or "nothing"
        raise ValueError(f"the source holds {kinds}; expected Motions, Windows or a tensor (N, {history}, C)")
    return _checked(_of_motions(bodies.prepare(source), history), bodies, history)


def _of_motions(motions: Sequence[Motion], history: int) -> Float[Tensor, "N H C"]:
    for m in motions:
        if len(m) < history:
            raise ValueError(
                f"{m.name or 'a clip'} has {len(m)} frames at {m.fps:g} Hz; expected at least {history}, the history"
            )
    return torch.stack([torch.from_numpy(m.cut(len(m) - history, len(m)).root_relative()).float() for m in motions])


def _of_windows(windows: Windows, bodies: Bodies) -> Float[Tensor, "N H C"]:
    found = Bodies.of(windows.motions)
    if found != bodies:
        raise ValueError(
            f"the windows are of {found.skeleton.name} at {found.fps:g} Hz, {found.up} up; the model was trained on "
            f"{bodies.skeleton.name} at {bodies.fps:g} Hz, {bodies.up} up. Give predict the motions instead: it prepares them"
        )
    return windows.x_history


def _checked(x: Tensor, bodies: Bodies, history: int) -> Float[Tensor, "N H C"]:
    channels = 3 * (len(bodies.skeleton) - 1)
    if x.ndim != 3 or tuple(x.shape[1:]) != (history, channels):
        raise ValueError(
            f"x_history has shape {tuple(x.shape)}; expected (N, {history}, {channels}): {history} frames of "
            f"{bodies.skeleton.name} at {bodies.fps:g} Hz, {bodies.up} up, root dropped. Give predict the motions instead: it "
            "prepares them"
        )
    if len(x) == 0:
        raise ValueError("there are no windows; expected at least one history")
    if not x.isfinite().all():
        raise ValueError(f"x_history of window {int((~x.isfinite()).nonzero()[0, 0])} is not finite; expected metres")
    return x


def identities(window_ids: Sequence[int] | None, count: int) -> list[int]:
    """The identity of each window, on which its noise depends: as given, or 0..N-1.

    Raises:
        ValueError: there are more or fewer than windows.
    """
    ids = list(range(count)) if window_ids is None else list(window_ids)
    if len(ids) != count:
        raise ValueError(f"window_ids has {len(ids)} entries for {count} windows; expected one each")
    return ids
