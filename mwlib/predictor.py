"""A trained model: history in, futures out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import reduce

import torch
from jaxtyping import Float
from torch import Tensor
from tqdm import tqdm

from .baselines import history_completion
from .config import Config, SamplingConfig
from .denoisers import TransLinear
from .diffusion import to_eps
from .guidance import TABG, guided
from .sampling import AfterStep, Shape, Step, WindowNoise, ddim, dpm_solver, posterior_mean
from .schedule import alpha_bar, ddim_indices
from .transforms import DCTTransform, PhaseTransform, ScaledTransform, Transform, WaveletTransform, pad_history


def make_transform(cfg: Config, channels: int) -> Transform:
    """The frequency view that a configuration names, for motions of `channels` channels; "phase" is yet untrained."""
    m = cfg.model
    if m.transform == "phase":
        window = 2 * int(m.phase_seconds * cfg.data.fps / 2) + 1
        return PhaseTransform(cfg.frames, channels, m.phases, max(window, 3), cfg.data.fps, cfg.training.seed)
    if m.transform == "dct":
        return DCTTransform(cfg.frames, channels, m.dct_rows)
    return WaveletTransform(cfg.frames, channels, m.wavelet, m.mode, m.level)


def make_network(cfg: Config, shape: tuple[int, int]) -> TransLinear:
    """The untrained network that a configuration names, for latents of `shape`."""
    m = cfg.model
    return TransLinear(*shape, m.latent, m.layers, m.heads, m.feedforward, m.dropout, m.attention_dropout)


@dataclass(frozen=True)
class NetworkBranches:
    """The network's evaluations as noise estimates; the windows' conditions are embedded once.

    Args:
        net: in evaluation mode.
        added: (N, 1, D) embedded conditions, shared by the samples of a window.
        alpha_bar: schedule.
        prediction: what the network predicts.
    """

    net: TransLinear
    added: Tensor
    alpha_bar: Tensor
    prediction: str

    def _evaluate(self, y: Tensor, t: int, added: Tensor | None, attention_rows: int = 0) -> tuple[Tensor, Tensor | None]:
        rows = y.flatten(0, -3)
        output, attention = self.net.evaluate(rows, t, added, attention_rows)
        return to_eps(self.prediction, output, rows, self.alpha_bar[t]), attention

    def _conditions(self, y: Tensor) -> Tensor:
        return self.added.expand(*y.shape[:2], -1).flatten(0, 1)

    def conditional(self, y: Float[Tensor, "N S K D"], t: int) -> Float[Tensor, "N S K D"]:
        """eps_theta(y, y_pad, t)."""
        return self._evaluate(y, t, self._conditions(y))[0].reshape(y.shape)

    def unconditional(self, y: Float[Tensor, "N S K D"], t: int) -> Float[Tensor, "N S K D"]:
        """eps_theta(y, t)."""
        return self._evaluate(y, t, None)[0].reshape(y.shape)

    def both(self, y: Float[Tensor, "N S K D"], t: int, with_attention: bool) -> tuple[Tensor, Tensor, Tensor | None]:
        """Unconditional and conditional estimate in one batch; attention of the unconditional half."""
        conditions = self._conditions(y)
        added = torch.cat([torch.zeros_like(conditions), conditions])
        count = len(conditions)
        eps, attention = self._evaluate(torch.cat([y, y]), t, added, count if with_attention else 0)
        attention = None if attention is None else attention.reshape(*y.shape[:2], *attention.shape[1:])
        return eps[:count].reshape(y.shape), eps[count:].reshape(y.shape), attention


class Predictor:
    """A network with the transform and schedule it was trained for.

    Args:
        cfg: the configuration it was trained with.
        net: trained weights (the moving average).
        scales: mean and deviation of latent and condition, each of the latent's shape: keys "mean", "deviation",
            "condition_mean", "condition_deviation".
        channels: C.
        base: the frequency view; None = the configured one, which serves unless it is one that is trained.
    """

    def __init__(
        self, cfg: Config, net: TransLinear, scales: dict[str, Tensor], channels: int, base: Transform | None = None
    ) -> None:
        self.cfg, self.net, self.channels, self.scales = cfg, net.eval(), channels, scales
        base = base or make_transform(cfg, channels)
        self.latent = ScaledTransform(base, scales["mean"], scales["deviation"])
        self.conditioning = ScaledTransform(base, scales["condition_mean"], scales["condition_deviation"])
        self.alpha_bar = alpha_bar(cfg.diffusion.schedule, cfg.diffusion.steps)

    @property
    def device(self) -> torch.device:
        """Where the network lives."""
        return self.net.position.device

    def to(self, device: torch.device | str) -> Predictor:
        """Move the network."""
        self.net.to(device)
        return self

    def origin(self, x_history: Float[Tensor, "N H C"]) -> Float[Tensor, "N 1 C"]:
        """What the latent's motion is relative to: nothing, or the last observed pose."""
        last = x_history[:, -1:]
        return last if self.cfg.model.target == "displacement" else torch.zeros_like(last)

    def decode(self, y: Float[Tensor, "N S K D"], x_history: Float[Tensor, "N H C"]) -> Float[Tensor, "N S T C"]:
        """Latents to whole motions (T frames), metres."""
        return self.latent.inverse(y) + self.origin(x_history)[:, None]

    @torch.inference_mode()
    def steps(
        self,
        x_history: Float[Tensor, "N H C"],
        samples: int,
        seed: int = 0,
        *,
        window_ids: Sequence[int] | None = None,
        sampling: SamplingConfig | None = None,
        after_step: AfterStep | None = None,
        clean: Shape | None = None,
    ) -> Iterator[Step]:
        """Algorithm 1 as a generator over denoising steps; the last item holds the latents (N, S, K, D).

        Args:
            x_history: observed frames, metres.
            samples: S.
            seed: of the noise.
            window_ids: identity of each window in the whole set (default 0..N-1): the noise depends on seed and
                identity only.
            sampling: guidance and sampler settings; None = those of the configuration.
            after_step: applied after each step, after manifold shaping (control masks).
            clean: applied to every clean estimate, after the bound or projection that the settings ask for.

        Raises:
            ValueError: the history's shape does not fit the model.
        """
        self._check(x_history)
        s = sampling or self.cfg.sampling
        x_history = x_history.to(self.device, torch.float32)
        noise = WindowNoise(seed, window_ids or range(len(x_history)), (samples, *self.latent.shape), self.device)
        indices = ddim_indices(self.cfg.diffusion.steps, s.ddim_steps, s.spacing)
        padded = pad_history(x_history, self.cfg.frames)
        added = self.net.embed_condition(self.conditioning(padded))[:, None]
        branches = NetworkBranches(self.net, added, self.alpha_bar, self.cfg.diffusion.prediction)
        active = frozenset(indices[: round(s.tabg_steps * len(indices))])
        tabg = TABG(
            s.tabg_scale, s.tabg_sigma, s.tabg_threshold, s.tabg_window, s.tabg_noise, s.tabg_sigma_place, s.tabg_space, active
        )
        denoise = guided(branches, self.alpha_bar, weight=s.cfg_weight, form=s.cfg_form, tabg=tabg, draw=noise)
        after = [after_step] if after_step else []
        if s.complete_history:
            known = (padded - self.origin(x_history))[:, None]
            after.insert(0, history_completion(self.latent, known, self.cfg.data.history, noise))
        if s.wmsg == "every_step":
            after.insert(0, lambda y, _: self.latent.project(y))
        start = noise()
        cleaning = [function for function in (self._clean(s, x_history), clean) if function]
        shared = dict(clean=_compose(cleaning), after_step=_chain(after))
        if s.sampler == "ddim":
            yield from ddim(denoise, start, self.alpha_bar, indices, eta=s.eta, noise=noise, **shared)
        elif s.sampler == "dpmpp":
            yield from dpm_solver(denoise, start, self.alpha_bar, indices, **shared)
        else:
            yield from posterior_mean(denoise, start, self.alpha_bar, indices, **shared)

    @torch.inference_mode()
    def predict(
        self,
        x_history: Float[Tensor, "N H C"],
        samples: int | None = None,
        seed: int = 0,
        *,
        window_ids: Sequence[int] | None = None,
        sampling: SamplingConfig | None = None,
        chunk: int = 8,
        progress: bool = False,
    ) -> Float[Tensor, "N S F C"]:
        """Sampled futures, metres, root-relative, on the CPU.

        Args:
            x_history: observed frames (N, H, C), metres, z up if trained so.
            samples: S; None = the configuration's.
            seed: of the noise; the result for a window depends on it and the window's identity, not on `chunk`.
            window_ids: identity of each window (default 0..N-1).
            sampling: other guidance settings than the configuration's.
            chunk: windows sampled together.
            progress: show a bar.

        Raises:
            ValueError: the history's shape does not fit the model.
        """
        self._check(x_history)
        samples = samples or (sampling or self.cfg.sampling).samples
        ids = list(window_ids) if window_ids is not None else list(range(len(x_history)))
        futures = []
        for first in tqdm(range(0, len(x_history), chunk), disable=not progress, desc="sampling", unit="chunk"):
            part = x_history[first : first + chunk]
            for step in self.steps(part, samples, seed, window_ids=ids[first : first + chunk], sampling=sampling):
                last = step
            motion = self.decode(last.y, part.to(self.device, torch.float32))
            futures.append(motion[:, :, self.cfg.data.history :].cpu())
        return torch.cat(futures)

    def with_sampling(self, **changes: object) -> SamplingConfig:
        """The configuration's sampling settings with some changed, for `predict` and `steps`."""
        return replace(self.cfg.override(**changes).sampling)

    def _clean(self, s: SamplingConfig, x_history: Tensor):
        """The function applied to every clean estimate: a bound in motion space, a projection, or none."""
        if s.bound > 0:
            origin = self.origin(x_history)[:, None]
            return lambda y: self.latent((self.latent.inverse(y) + origin).clamp(-s.bound, s.bound) - origin)
        return self.latent.project if s.wmsg == "x0_only" else None

    def _check(self, x_history: Tensor) -> None:
        expected = (self.cfg.data.history, self.channels)
        if x_history.ndim != 3 or tuple(x_history.shape[1:]) != expected:
            raise ValueError(f"x_history has shape {tuple(x_history.shape)}; expected (N, {expected[0]}, {expected[1]})")


def _compose(functions: list[Shape]) -> Shape | None:
    """One function of a latent after the other."""
    return (lambda y: reduce(lambda value, function: function(value), functions, y)) if functions else None


def _chain(functions: list[AfterStep]) -> AfterStep | None:
    """Apply functions one after the other."""
    if not functions:
        return None

    def run(y: Tensor, alpha_bar_prev: float) -> Tensor:
        for function in functions:
            y = function(y, alpha_bar_prev)
        return y

    return run
