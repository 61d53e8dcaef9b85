"""A trained model: histories in, futures out."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields, replace
from functools import lru_cache, partial, reduce
from math import ceil
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from scipy.special import ndtri
from torch import Tensor

from mwlib.body.following import on_rig
from mwlib.body.kinematics import bones_of, scale_bones
from mwlib.body.motion import Motion
from mwlib.data.meaning import check_people
from mwlib.data.untrusted import LARGEST
from mwlib.data.windows import Bodies, Windows, clips_given

from mwlib.diffusion import (  # isort: skip
    AfterStep, OnEstimate, Step, WindowNoise, alpha_bar, ddim, ddim_indices, dpm_solver, history_completion, posterior_mean,
)  # fmt: skip
from mwlib.networks import TransLinear
from mwlib.prediction.config import Config
from mwlib.prediction.guidance import TABG, Coefficients, NetworkBranches, guided, make_network
from mwlib.prediction.representation import Continuation, Observed, Representation, restored_representation
from mwlib.settings import whole
from mwlib.training import TrainedModel, chunks, identities, with_weights
from mwlib.transforms import ScaledTransform
from mwlib.transforms.linear import pad_history

Histories = Observed | Float[np.ndarray, "N H C"] | Windows | Sequence[Motion]


def histories(source: Histories, bodies: Bodies, history: int) -> Observed:
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
        if (found := Bodies.of(source.motions)) != bodies:
            raise ValueError(
                f"the windows are of {found.skeleton.name} at {found.fps:g} Hz, {found.up} up; the model was trained on "
                f"{bodies.skeleton.name} at {bodies.fps:g} Hz, {bodies.up} up. {PREPARE}"
            )
        x = source.x_history
    elif isinstance(source, (Tensor, np.ndarray)):
        x = _tensor(source)
    else:
        clips = bodies.prepare(clips_given("source", source, f"Windows or a tensor (N, {history}, C)"))
        if short := [m for m in clips if len(m) < history]:
            raise ValueError(
                f"{short[0].name or 'a clip'} has {len(short[0])} frames at {short[0].fps:g} Hz; "
                f"expected at least {history}, the history"
            )
        x = torch.from_numpy(np.stack([m.cut(len(m) - history, len(m)).root_relative() for m in clips])).float()
    _check(x, bodies, history)
    return x


def _tensor(source: Tensor | np.ndarray) -> Tensor:
    """Numbers that a network can take; what an array masks is none."""
    if isinstance(source, np.ndarray):
        if source.dtype.kind not in "fiu":
            raise ValueError(f"source is an array of {source.dtype}; expected real numbers")
        return torch.from_numpy(np.ma.filled(source.astype(np.float64, order="C"), np.nan))
    x = source
    if x.is_complex() or x.dtype == torch.bool or x.layout != torch.strided or x.is_meta or x.is_quantized or x.is_nested:
        raise ValueError(f"source is a tensor of {x.dtype}, {x.layout}, on {x.device}; expected a dense one of real numbers")
    return x.detach() if x.is_floating_point() else x.float()


PREPARE = "Give predict the motions instead: it prepares them"


def _check(x: Tensor, bodies: Bodies, history: int) -> None:
    channels = 3 * (len(bodies.skeleton) - 1)
    if x.shape[1:] != (history, channels):
        raise ValueError(
            f"x_history has shape {tuple(x.shape)}; expected (N, {history}, {channels}): {history} frames of "
            f"{bodies.skeleton.name} at {bodies.fps:g} Hz, {bodies.up} up, root dropped. {PREPARE}"
        )
    if not len(x):
        raise ValueError("there are no windows; expected at least one history")
    if not (good := x.abs() <= LARGEST).all():  # False for nan
        window = int((~good).nonzero()[0, 0])
        raise ValueError(f"x_history of window {window} is not finite or holds numbers over {LARGEST:g}; expected metres")
    joints = np.pad(x.cpu().double().numpy().reshape(len(x), history, -1, 3), ((0, 0), (0, 0), (1, 0), (0, 0)))
    check_people(joints, bodies.skeleton, [f"x_history of window {window}" for window in range(len(x))])


CHUNK = 8  # windows sampled together on a processor; more would not be faster
_continuation = lru_cache(maxsize=8)(Continuation)  # its matrices serve every model with the same settings
Imposed = Callable[[slice, Float[Tensor, "n H C"]], dict[str, Any]]  # which windows, their histories -> hooks of `steps`


class Predictor(TrainedModel):
    """A network with the representation and schedule that it was trained for, and settings of the sampling.

    Args:
        net: trained weights (the moving average).
        representation: windows as coefficients.
        cfg: of the training; its group `sampling` says sampler, guidance and number of samples, and `with_sampling` changes it.
        bodies: skeleton, frame rate and up-axis of the motions that it was trained on.
    """

    def __init__(self, net: TransLinear, representation: Representation, cfg: Config, bodies: Bodies) -> None:
        super().__init__(net, cfg)
        self.representation, self.bodies = representation, bodies
        self.alpha_bar = alpha_bar(cfg.diffusion.schedule, cfg.diffusion.steps)

    @classmethod
    def from_tensors(
        cls, cfg: Config, weights: Mapping[str, Tensor], learnt: Mapping[str, Tensor], about: Mapping[str, str]
    ) -> Predictor:
        """The predictor that a finished training left (see `mwlib.training.read_model`)."""
        bodies = Bodies.from_json(about["bodies"])
        representation = restored_representation(cfg, learnt, bodies)
        net = with_weights(lambda: make_network(cfg.model, representation.motion.shape), weights)
        return cls(net, representation, cfg, bodies)

    @property
    def transform(self) -> ScaledTransform:
        """The scaled frequency view of what is modelled."""
        return self.representation.motion

    def branches(self, x_history: Observed) -> NetworkBranches:
        """The network's evaluations for these histories, in its own precision: conditional, unconditional, both.

        Args:
            x_history: observed frames, metres.
        """
        history = x_history.to(self.net.position)
        added = self.net.embed_condition(self.representation.encode_history(history))[:, None]
        return NetworkBranches(self.net, added, self.alpha_bar, self.cfg.diffusion.prediction, self.sampling.precision)

    def indices(self) -> list[int]:
        """The diffusion indices that sampling visits, falling."""
        return ddim_indices(self.cfg.diffusion.steps, self.sampling.ddim_steps, self.sampling.spacing)

    def noise(self, seed: int, window_ids: Sequence[int], samples: int) -> WindowNoise:
        """The noise of these windows, one stream each."""
        source = self.device if self.sampling.noise_on == "device" else "cpu"
        return WindowNoise(seed, window_ids, (samples, *self.transform.shape), self.device, source)

    def chunk(self, samples: int) -> int:
        """How many windows to sample together: 8; on a graphics card as many as half of its free memory holds."""
        if self.device.type != "cuda":
            return CHUNK
        rows, columns = self.transform.shape
        # of one window, counted generously: what a block and the skips hold, attention maps, copies of y_t
        numbers = self.net.numbers_per_token() + 8 * columns
        one = 2 * samples * rows * numbers * 4  # both branches in float32
        return max(1, torch.cuda.mem_get_info(self.device)[0] // (2 * one))

    def tabg(self) -> TABG:
        """Attention guidance as the settings say."""
        s, indices = self.sampling, self.indices()
        named = {item.name: getattr(s, f"tabg_{item.name}") for item in fields(TABG) if item.name != "active"}
        return TABG(**named, active=frozenset(indices[: round(s.tabg_steps * len(indices))]))

    @torch.inference_mode()
    def steps(
        self,
        x_history: Observed,
        samples: int | None = None,
        seed: int | None = None,
        *,
        window_ids: Sequence[int] | None = None,
        after_step: AfterStep | None = None,
        on_y0_hat: OnEstimate | None = None,
    ) -> Iterator[Step]:
        """Algorithm 1 as a generator over denoising steps; the last item holds the coefficients (N, S, rows, columns).

        Args:
            x_history: observed frames, metres.
            samples: S; None = the settings'.
            seed: of the noise; None = the settings'.
            window_ids: identity of each window in the whole set (default 0..N-1): the noise depends on seed and
                identity only.
            after_step: applied after each step, after manifold shaping (control masks).
            on_y0_hat: applied to every clean estimate, after the bound or projection that the settings ask for.

        Raises:
            ValueError: the history does not fit the model, window_ids do not fit the histories, or no sample is asked for.
        """
        s, (samples, seed) = self.sampling, self.asked(samples, seed)
        x = histories(x_history, self.bodies, self.representation.history).to(self.device, torch.float32)
        noise = self.noise(seed, identities(window_ids, len(x)), samples)
        denoise = guided(
            self.branches(x), self.alpha_bar, weight=s.guidance_weight, form=s.guidance_form, tabg=self.tabg(), draw=noise
        )
        own_estimate, own_steps = self._shaping(x, noise)
        hooks = {"on_y0_hat": _in_turn([own_estimate, on_y0_hat]), "after_step": _in_turn([*own_steps, after_step])}
        samplers = {"ddim": partial(ddim, eta=s.eta, noise=noise), "dpmpp": dpm_solver, "eq6": posterior_mean}
        first = noise() * temperatures(samples, s.temperature, s.temperature_spread).to(x)[:, None, None]
        yield from samplers[s.sampler](denoise, first, self.alpha_bar, self.indices(), **hooks)

    def sampled(
        self,
        source: Histories,
        samples: int | None = None,
        seed: int | None = None,
        *,
        window_ids: Sequence[int] | None = None,
        chunk: int | None = None,
        progress: bool = False,
        imposed: Imposed = lambda part, x_history: {},
    ) -> Iterator[tuple[Float[Tensor, "n S rows columns"], Float[Tensor, "n H C"]]]:
        """Sampled coefficients and the histories that they continue, a chunk of windows at a time, where the network is.

        Args:
            source, samples, seed, window_ids, chunk, progress: as in `predict`.
            imposed: what is imposed on the steps of a chunk, `after_step` and `on_y0_hat`.
        """
        x_history = histories(source, self.bodies, self.representation.history)
        samples, seed = self.asked(samples, seed)
        ids = identities(window_ids, len(x_history))
        size = self.chunk(samples) if chunk is None else whole("chunk", chunk, 1)
        for part in chunks(len(x_history), size, progress):
            x = x_history[part].to(self.device, torch.float32)
            for step in self.steps(x, samples, seed, window_ids=ids[part], **imposed(part, x)):
                last = step
            yield last.y, x

    @torch.inference_mode()
    def predict(
        self,
        source: Histories,
        samples: int | None = None,
        seed: int | None = None,
        *,
        window_ids: Sequence[int] | None = None,
        chunk: int | None = None,
        progress: bool = False,
    ) -> Float[Tensor, "N S F C"]:
        """Sampled futures, metres, root-relative, on the CPU.

        Args:
            source: motions, or one, of which the last H frames are continued (turned, carried over and resampled as in
                training); windows; or observed frames (N, H, C) in the form that the model was trained on.
            samples: S; None = the settings'.
            seed: of the noise; None = the settings'. The result for a window depends on it and the window's identity, not on
                `chunk`.
            window_ids: identity of each window (default 0..N-1).
            chunk: windows sampled together; None: what `chunk` says.
            progress: show a bar.

        Raises:
            ValueError: what is given does not fit the model: a source of another kind, shape, length or skeleton, poses that are
                not finite or of no human's size, numbers out of range; or the settings of the sampling make numbers overflow.
                The message names the argument, what was found, what is expected, and what to call.
        """
        parts = self.sampled(source, samples, seed, window_ids=window_ids, chunk=chunk, progress=progress)
        return torch.cat([self.finite(self.decode(y, x_history)).cpu() for y, x_history in parts])

    @torch.inference_mode()
    def decode(self, y: Coefficients, x_history: Observed) -> Float[Tensor, "N S F C"]:
        """Sampled coefficients to futures, metres: as `decoding` says, and with bones as `bones` says.

        Args:
            y: coefficients, as `sampled` yields them.
            x_history: the observed frames that they continue, metres.
        """
        seen = self.representation
        if self.sampling.decoding == "continued":
            future = seen.continued(y, x_history, self.continuation)
        else:
            future = seen.decode(y, x_history)[:, :, seen.history :]
        if self.sampling.bones == "free":
            return future
        observed, drawn = (bones_of(x, self.bodies.skeleton).norm(dim=-1) for x in (x_history[:, -1], future))
        return scale_bones(future, observed[:, None, None] / drawn.clamp_min(1e-6), self.bodies.skeleton)

    @property
    def continuation(self) -> Continuation:
        """How coefficients are decoded that continue the history."""
        seen = self.representation
        return _continuation(seen.motion, seen.history, seen.frames, self.bodies.fps, self.sampling.seam)

    def _shaping(self, x_history: Observed, noise: WindowNoise) -> tuple[OnEstimate | None, list[AfterStep]]:
        """What the settings do to every clean estimate (a bound in motion space, a projection or nothing), and after a step."""
        seen, bound, after = self.representation, self.sampling.bound, []
        if self.sampling.wmsg == "every_step":
            after.append(lambda y, _: seen.motion.project(y))
        if self.sampling.complete_history:
            known = seen.modelled(pad_history(x_history, seen.frames), x_history)
            after.append(history_completion(seen.motion, known[:, None], seen.history, noise))
        if bound > 0:
            return lambda y: seen.motion(seen.modelled(seen.decode(y, x_history).clamp(-bound, bound), x_history)), after
        return seen.motion.project if self.sampling.wmsg == "y0_hat" else None, after


def temperatures(samples: int, temperature: float, spread: float) -> Float[Tensor, " S"]:
    """Deviation of the noise that each sample starts from: log-normal, in the order of van der Corput's sequence.

    Own choice: how widely a stranger's futures spread is not known, so that some samples hold the pose and some go far. A
    sample's temperature does not depend on how many there are.

    Args:
        samples: S.
        temperature: the median.
        spread: deviation of the logarithm; 0: all are alike.

    >>> temperatures(3, 1.0, 0.5)
    tensor([1.0000, 0.7137, 1.4011], dtype=torch.float64)
    """
    from scipy.stats.qmc import Halton  # half a second, which few need

    shares = Halton(1, scramble=False).fast_forward(1).random(samples)[:, 0]  # the first is 0
    return temperature * torch.from_numpy(np.exp(spread * ndtri(shares)))


def _in_turn(functions: Sequence[Callable[..., Tensor] | None]) -> Callable[..., Tensor] | None:
    """One function of those that are there, each applied to what the one before gives; None without any."""
    there = [function for function in functions if function]
    return (lambda y, *level: reduce(lambda value, function: function(value, *level), there, y)) if there else None


def predicted_motions(
    predictor: Predictor,
    motions: Sequence[Motion],
    samples: int | None = None,
    seed: int | None = None,
    progress: bool = False,
    own_rig: bool = False,
) -> list[list[Motion]]:
    """Each clip's last H frames and sampled futures of them, as motions in the form that the model was trained on.

    The model knows no root: in the future it stays where it was last seen (own choice).

    Args:
        predictor: a trained model.
        motions: clips of at least H frames after resampling.
        samples, seed, progress: as in `Predictor.predict`.
        own_rig: clips that have a rig are continued on it, with all its joints and at its rate (see `on_rig`).

    Returns:
        For each clip a list of S motions of H + F frames, positions only; or of as many seconds, observed frames unchanged.

    Raises:
        ValueError: a clip does not fit the model.
    """
    futures = predictor.predict(motions, samples, seed, progress=progress)
    made = []
    for clip, ready, row in zip(motions, predictor.bodies.prepare(motions), futures, strict=True):
        frames, start = len(ready), len(ready) - predictor.representation.history
        whole = [_joined(ready.cut(start, frames), future) for future in row]
        if own_rig and clip.rig:  # its own observed frames, and the time of each in frames of the model
            ratio = clip.fps / ready.fps
            first, end = ceil(start * ratio - 1e-6), int((frames - 1) * ratio + 1e-6) + 1
            whole = [on_rig(m, clip.cut(first, end), np.arange(first, end) / ratio - start) for m in whole]
        made.append(whole)
    return made


def _joined(observed: Motion, future: Float[Tensor, "F C"]) -> Motion:
    joints = np.pad(future.numpy().reshape(len(future), -1, 3), ((0, 0), (1, 0), (0, 0)))  # the root, held
    ahead = joints + observed.positions[-1, :1]
    positions = np.concatenate([observed.positions, ahead.astype(observed.positions.dtype)])
    return replace(observed, positions=positions, rig=None)
