"""Low-pass cosine and sine coefficients along time."""

import numpy as np
from scipy.fft import dct, dst

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


class DSTTransform(OrthonormalRows):
    """Low-pass sine coefficients of every channel, of the frames between the first and the last.

    Source: own choice: the orthonormal DST-I over the T - 2 inner frames. Its sines, sin(pi k n / (T - 1)), are zero at both
    ends. They are the eigenvectors of the Brownian bridge, so that its coefficients are independent.

    Args:
        frames, channels: T and C of the motions.
        rows: number of kept coefficients, at most T - 2; None keeps all.

    Raises:
        ValueError: rows is not between 1 and frames - 2.

    >>> tf = DSTTransform(frames=6, channels=1)
    >>> bridge = torch.tensor([0.0, 1.0, 3.0, 2.0, 1.0, 0.0])[:, None]
    >>> tf(bridge).shape, torch.allclose(tf.inverse(tf(bridge)), bridge, atol=1e-6)
    (torch.Size([4, 1]), True)
    """

    def __init__(self, frames: int, channels: int, rows: int | None = None) -> None:
        rows = frames - 2 if rows is None else rows
        if not 1 <= rows <= frames - 2:
            raise ValueError(f"rows is {rows}; expected 1 to {frames - 2} (frames without the first and the last)")
        sines = np.asarray(dst(np.eye(frames - 2), type=1, norm="ortho", axis=0))[:rows]
        super().__init__(np.pad(sines, ((0, 0), (1, 1))), channels, "dst")
