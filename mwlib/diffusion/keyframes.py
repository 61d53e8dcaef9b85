"""Keyframes as conditions of an unconditional model: the schemes by which a sampler is made to meet given frames."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from mwlib.diffusion.guidance import reconstruction_guided
from mwlib.diffusion.masks import Mask, beside_samples, known, masked, pasted, weights
from mwlib.diffusion.samplers import Denoise, Step, ddim
from mwlib.settings import Count, NotNegative
from mwlib.transforms import Transform


@dataclass(frozen=True)
class KeyframeConfig:
    """How a sampler is made to meet keyframes. The defaults are FreqDiffusionBridge's, as far as the paper tells."""

    # "replacement": noisy keyframes in every y_t; "paste": clean ones in every clean estimate; "none": the gradient alone
    scheme: Literal["replacement", "paste", "none"] = "replacement"
    keyframe_noise: Literal["fresh", "fixed"] = "fresh"  # of "replacement": drawn at every step, or once
    eta: NotNegative = 0.0  # share of the posterior deviation that DDIM draws anew
    repeats: Count = 1  # RePaint's r, how often each step is taken
    reconstruction_weight: NotNegative = 0.0  # w of the gradient that draws the clean estimate to the keyframes


def keyframe_mask(frames: int, keyframes: Sequence[int]) -> Bool[Tensor, " T"]:
    """M over frames, true at the keyframes; negative numbers count from the end.

    Raises:
        ValueError: no keyframe, or one that the motion does not have.

    >>> keyframe_mask(5, [0, -1])
    tensor([ True, False, False, False,  True])
    """
    if not keyframes or not all(-frames <= k < frames for k in keyframes):
        raise ValueError(f"keyframes are {list(keyframes)}; expected one or more of {-frames} to {frames - 1}")
    mask = torch.zeros(frames, dtype=torch.bool)
    mask[list(keyframes)] = True
    return mask


def with_keyframes(x: Float[Tensor, "... T C"], x_target: Float[Tensor, "... T C"], mask: Mask) -> Float[Tensor, "... T C"]:
    """x with the clean target in its masked part, to the bit: the paper's last step, concat_time(s, x_mid, e).

    Args:
        x: sampled motions.
        x_target, mask: as in `masked`.
    """
    m = weights(mask, x)
    return m * beside_samples(known(x_target, mask), x) + (1 - m) * x


def keyframe_steps(
    denoise: Denoise,
    tf: Transform,
    x_target: Float[Tensor, "... T C"],
    mask: Mask,
    alpha_bar: Float[Tensor, " M"],
    indices: Sequence[int],
    noise: Callable[[], Tensor],
    how: KeyframeConfig,
) -> Iterator[Step]:
    """DDIM from noise to a motion that meets keyframes, by the scheme of the settings.

    With "replacement" this is the loop of FreqDiffusionBridge: whatever the network is asked about holds the keyframes at the
    level of the other frames, the first time, too; they are put in over time, and transformed with the rest.

    Args:
        denoise: (y_t, t) -> eps of an unconditional model.
        tf, x_target, mask: as in `masked`. Any number of keyframes may stand anywhere.
        alpha_bar, indices: as in `ddim`.
        noise: draws a tensor like y; its first draw is the start.
        how: the scheme.

    Source: FreqDiffusionBridge, Sec. 3.4 (own reconstruction of its loop); RePaint (Lugmayr et al., 2022);
        MDM (Tevet et al., 2023); Video Diffusion Models (Ho et al., 2022).
    """
    denoise = reconstruction_guided(denoise, tf, x_target, mask, alpha_bar, how.reconstruction_weight)
    y, impose, paste = noise(), None, None
    if how.scheme == "replacement":
        drawn = noise() if how.keyframe_noise == "fixed" else None
        impose = masked(tf, x_target, mask, noise if drawn is None else lambda: drawn)
        y = impose(y, float(alpha_bar[indices[0]]))
    elif how.scheme == "paste":
        paste = pasted(tf, x_target, mask)
    random = {"eta": how.eta, "repeats": how.repeats, "noise": noise}
    yield from ddim(denoise, y, alpha_bar, indices, on_y0_hat=paste, after_step=impose, **random)


def keyframed(
    denoise: Denoise,
    tf: Transform,
    x_target: Float[Tensor, "... T C"],
    mask: Mask,
    alpha_bar: Float[Tensor, " M"],
    indices: Sequence[int],
    noise: Callable[[], Tensor],
    how: KeyframeConfig,
) -> Float[Tensor, "... T C"]:
    """The motion that `keyframe_steps` ends with. Schemes that hold the keyframes give them back to the bit.

    Own choice: the paper does not say how its last step ends. With the scheme "none" the keyframes stay as the sampler left
    them, near the target.

    Args:
        as in `keyframe_steps`.

    >>> from mwlib.diffusion import alpha_bar, ddim_indices, eps_of
    >>> tf, a, clip = mw.DCTTransform(6, 3), alpha_bar("cosine", 100), torch.randn(6, 3)
    >>> knows = lambda y, t: eps_of(y, tf(clip), a[t])  # a denoiser that has seen the answer
    >>> mask, noise = keyframe_mask(6, [0, -1]), lambda: torch.randn(2, 6, 3)
    >>> x = keyframed(knows, tf, clip, mask, a, ddim_indices(100, 5), noise, KeyframeConfig())
    >>> torch.equal(x[1, mask], clip[mask]), torch.allclose(x, clip.expand(2, 6, 3), atol=1e-4)
    (True, True)
    """
    for step in keyframe_steps(denoise, tf, x_target, mask, alpha_bar, indices, noise, how):
        last = step
    x = tf.inverse(last.y)
    return x if how.scheme == "none" else with_keyframes(x, x_target, mask)
