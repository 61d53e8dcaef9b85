"""Settings of the forward process, and of keyframes as conditions of sampling."""

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Interval

from mwlib.settings import Count, NotNegative

Steps = Annotated[int, Interval(ge=1, le=100_000)]  # of noising; own choice: far more than any paper's


@dataclass(frozen=True)
class DiffusionConfig:
    """The forward process and what the network predicts."""

    schedule: Literal["linear", "cosine", "sigmoid", "sqrt"] = "cosine"  # of the noise, see `alpha_bar`
    steps: Steps = 1000  # M, noising steps
    prediction: Literal["eps", "y0", "v"] = "eps"  # what the network says: noise, clean coefficients, or both mixed


@dataclass(frozen=True)
class KeyframeConfig:
    """How a sampler is made to meet keyframes. The defaults are FreqDiffusionBridge's, as far as the paper tells."""

    # "replacement": noisy keyframes in every y_t; "paste": clean ones in every clean estimate; "none": the gradient alone
    scheme: Literal["replacement", "paste", "none"] = "replacement"
    keyframe_noise: Literal["fresh", "fixed"] = "fresh"  # of "replacement": drawn at every step, or once
    eta: NotNegative = 0.0  # share of the posterior deviation that DDIM draws anew
    repeats: Count = 1  # RePaint's r, how often each step is taken
    reconstruction_weight: NotNegative = 0.0  # w of the gradient that draws the clean estimate to the keyframes
