"""Decoding of coefficients to the smoothest motion that continues what was observed."""

import numpy as np
from jaxtyping import Float
from torch import Tensor

from mwlib.transforms.linear import Constant, Transform

INSIDE = 0.011  # seconds: shorter movements inside a future are damped; below a recording's noise
ENDS = 0.035  # seconds: the same at both ends of the future, where coefficients say least
REACH = 0.08  # seconds: how far from an end its damping falls to a share 1/e


class Continuation:
    """Futures that have the drawn coefficients as far as a smooth motion through the observed frames can have them.

    A transform's own inverse ignores what was observed, and a DWT along time takes frames beyond the window for a repetition of
    it, so that kept levels alone lose the last frames. The coefficients do not: with h the observed frames, c the coefficients
    along time, c = A x of a motion x, and D the third difference, the future is

        f = argmin |A [h; f] - c|^2 + sum_n lambda_n |(D [h; f])_n|^2,    lambda_n = (tau_n fps)^6.

    That is a smoothing spline (Reinsch, 1967) of coefficients in place of values, and linear in c and h: two constant matrices.
    tau is `INSIDE`, and `ENDS` where the future begins and ends; given in seconds, it means the same at every rate. Own choice,
    like these times: the papers cut the future from the inverse. A transform that is not one matrix along time is inverted first.

    Args:
        transform: of whole windows.
        history, frames: H and T.
        fps: frames per second.

    >>> import torch
    >>> from mwlib.transforms.dwt import TimeWaveletTransform
    >>> x = torch.linspace(0, 1, 40)[:, None] ** 2 * torch.ones(3)
    >>> tf = TimeWaveletTransform(40, 3, level=3, omit=1)
    >>> f = Continuation(tf, 10, 40, 20.0)(tf(x), x[:10])
    >>> bool((tf.inverse(tf(x)) - x)[10:].abs().max() > 0.01), bool((f - x[10:]).abs().max() < 1e-3)
    (True, True)
    """

    def __init__(self, transform: Transform, history: int, frames: int, fps: float) -> None:
        self.transform, self.frames = transform, frames
        rows = transform.time_rows()
        self._rows = None if rows is None else Constant(rows)
        a = np.eye(frames) if rows is None else rows
        at = np.arange(frames - 3) + 1.5  # the middle of each third difference
        away = np.minimum(np.abs(at - (history - 0.5)), frames - 1 - at) / (REACH * fps)
        weight = (INSIDE * fps) ** 6 + (ENDS * fps) ** 6 * np.exp(-away)
        d = np.sqrt(weight)[:, None] * np.diff(np.eye(frames), n=3, axis=0)
        (ah, af), (dh, df) = (np.split(m, [history], axis=1) for m in (a, d))
        solved = np.linalg.solve(af.T @ af + df.T @ df, np.concatenate([af.T, -(af.T @ ah + df.T @ dh)], axis=1))
        self.of_coefficients, self.of_history = (Constant(m) for m in np.split(solved, [len(a)], axis=1))

    def __call__(
        self,
        y: Float[Tensor, "*n rows columns"],
        x_history: Float[Tensor, "*m H C"],
        origin: Float[Tensor, "*m _T C"] | float = 0.0,
    ) -> Float[Tensor, "*n F C"]:
        """The futures, as smooth as they are with the history, whatever they are modelled relative to.

        Args:
            y: coefficients of the motions minus their origin.
            x_history: observed frames, metres; its leading axes, and those of the origin, broadcast to those of y.
            origin: what is subtracted from motions before they are transformed, of all frames or for each.
        """
        c = self.transform.along_time(y)
        if isinstance(origin, Tensor):
            origin = origin.expand(*origin.shape[:-2], self.frames, -1)
            c = c + (origin if self._rows is None else self._rows.like(c) @ origin)
        return self.of_coefficients.like(c) @ c + self.of_history.like(c) @ x_history
