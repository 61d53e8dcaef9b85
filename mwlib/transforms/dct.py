"""HumanMAC's representation: the first rows of an orthonormal DCT-II over time."""

from __future__ import annotations

import numpy as np
from scipy.fft import dct

from mwlib.transforms.linear import OrthonormalRows


class DCTTransform(OrthonormalRows):
    """Low-pass cosine coefficients of every channel.

    Source: HumanMAC (Chen et al., 2023): orthonormal DCT-II over the T frames, first L rows kept.

    Args:
        frames, channels: T and C of the motions.
        rows: L, number of kept coefficients, at most T; None keeps all (then the inverse is exact).

    Raises:
        ValueError: rows is not between 1 and frames.

    >>> tf = DCTTransform(frames=40, channels=48, rows=8)
    >>> still = torch.ones(40, 48)
    >>> y = tf(still)
    >>> y.shape, torch.allclose(tf.inverse(y), still, atol=1e-5)
    (torch.Size([8, 48]), True)
    """

    def __init__(self, frames: int, channels: int, rows: int | None = None) -> None:
        rows = frames if rows is None else rows
        if not 1 <= rows <= frames:
            raise ValueError(f"rows is {rows}; expected 1 to {frames} (frames)")
        super().__init__(np.asarray(dct(np.eye(frames), norm="ortho", axis=0))[:rows], channels, "dct")
