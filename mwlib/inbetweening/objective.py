"""The denoiser of FreqDiffusionBridge, and its training: the loss of diffusion and losses on bodies, on random windows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn

from mwlib.data.sources import Split
from mwlib.data.windows import Variation
from mwlib.diffusion import alpha_bar, network_target, noised, snr_weights, to_eps, y0_hat_of
from mwlib.inbetweening.config import Config, ModelConfig

from mwlib.inbetweening.losses import (  # isort: skip
    bone_angle_loss, bone_angles, bone_length_loss, bone_lengths, contact_loss, diversity_loss, feet, smoothness_loss,
)  # fmt: skip
from mwlib.inbetweening.representation import Representation
from mwlib.inbetweening.space import Tracks
from mwlib.inbetweening.windows import Clips, PlacedWindows, draw_keyframes, make_space
from mwlib.networks import TransLinear
from mwlib.networks.layers import zero_linear
from mwlib.training import Objective, seeded

BESIDE = 3  # numbers of a token beside the interpolation: mask, frequency, length
SIZES = 64  # width of the network that says how large a window's numbers are
LARGEST = 4.0  # bound of the logarithm that it says
SMOOTH = 12  # tokens, from the first, whose mean a network says
FINE = 6.0  # hertz: what people mean to do is slower
MEAN_LAYERS = 3  # of that network
Tokens = Float[Tensor, "B rows channels"]
Index = Int[Tensor, " B"] | int  # of diffusion, one for all windows or one for each
Seen = Float[Tensor, "B rows conditioning"]  # see `Representation.conditioning`
Ends = Float[Tensor, "B entering"]  # see `Representation.ends`


class KeyframeNetwork(nn.Module):
    """A network on noised tokens.

    Source: FreqDiffusionBridge, Sec. 3.2, tells of linear layers, self-attention over the tokens and an embedding of the step
    that is added; HumanMAC's network, which does this and has skips and a learned place for each token, stands in. Own choice:
    the conditioning enters as columns beside each token's numbers.

    Args:
        model: sizes; whether the network sees the keyframes.
        rows: most tokens.
        channels: numbers per token.
        steps: how many steps beyond the keyframes it sees, see `Representation.conditioning`.
    """

    def __init__(self, model: ModelConfig, rows: int, channels: int, steps: int = 0) -> None:
        super().__init__()
        extra = (1 + steps) * channels + BESIDE + steps * bool(model.hide) if model.condition_on_keyframes else 0
        self.net = TransLinear(
            rows, channels, model.width, model.layers, model.heads, model.feedforward, model.dropout, model.attention_dropout,
            extra_columns=extra, conditioned=False,
        )  # fmt: skip

    def forward(self, y_t: Tokens, t: Index, conditioning: Seen | None = None) -> Tokens:
        """Its output. Fewer tokens than the most are the first of them.

        Args:
            y_t: noised tokens.
            t: diffusion index, one for all or one per item.
            conditioning: see `Representation.conditioning`; a network that was built for it needs it.
        """
        entering = y_t if conditioning is None else torch.cat([y_t, conditioning], dim=-1)
        return self.net.evaluate(entering, t, None)[0]


class WienerNetwork(nn.Module):
    """The best linear denoiser of independent numbers of known deviations s, and a network for what it misses.

    y0_hat = sqrt(a) s² / v y_t + s sqrt(1 - a) / sqrt(v) network(y_t / sqrt(v)), v = a s² + 1 - a, a = alpha_bar_t. What the
    network sees and what it should say have unit deviation at every level and in every token; one that says zero samples a
    Gaussian process with the right power at each frequency.

    Source: the preconditioning of Karras et al. 2022 (EDM), Eq. 7; own choice: for each number with its own deviation.

    Args:
        inner: the network.
        power: s, of each number of the most tokens; shorter motions have the first of them.
        alpha_bar: schedule.
    """

    def __init__(self, inner: KeyframeNetwork, power: Float[Tensor, "rows channels"], alpha_bar: Float[Tensor, " M"]) -> None:
        super().__init__()
        self.inner = inner
        self.power: Tensor
        self.alpha_bar: Tensor
        self.register_buffer("power", power.clone(), persistent=False)
        self.register_buffer("alpha_bar", alpha_bar.float(), persistent=False)

    def forward(self, y_t: Tokens, t: Index, conditioning: Seen | None = None) -> Tokens:
        """The clean estimate."""
        a, s, v = self._levels(y_t, t)
        return (a.sqrt() * s**2 / v) * y_t + self.share(y_t, t) * self.inner(y_t / v.sqrt(), t, conditioning)

    def share(self, y_t: Tokens, t: Index) -> Float[Tensor, "*B rows channels"]:
        """Deviation of what the linear denoiser misses: the network's output counts so much."""
        a, s, v = self._levels(y_t, t)
        return s * ((1 - a) / v).sqrt()

    def _levels(self, y_t: Tensor, t: Index) -> tuple[Tensor, Tensor, Tensor]:
        a = self.alpha_bar[t].reshape(-1, 1, 1)
        s = self.power[: y_t.shape[-2]]
        return a, s, a * s**2 + 1 - a


class MeanNetwork(nn.Module):
    """What is given of a window in one row, to the mean of its first `SMOOTH` tokens in usual sizes: residual layers.

    Args:
        entering: how many numbers tell of a window.
        rows, columns: of all tokens.
        width: of the layers.
        dropout: before each layer.
    """

    def __init__(self, entering: int, rows: int, columns: int, width: int, dropout: float) -> None:
        super().__init__()
        self.rows, self.columns = rows, columns
        self.enter = nn.Sequential(nn.Dropout(dropout), nn.Linear(entering, width))
        self.layers = nn.ModuleList(
            nn.Sequential(nn.LayerNorm(width), nn.Linear(width, width), nn.SiLU(), nn.Dropout(dropout), nn.Linear(width, width))
            for _ in range(MEAN_LAYERS)
        )
        self.leave = nn.Sequential(nn.SiLU(), zero_linear(width, min(rows, SMOOTH) * columns))

    def forward(self, ends: Ends) -> Float[Tensor, "B rows columns"]:
        """The mean of all tokens; of those after the first `SMOOTH` it is 0."""
        x = self.enter(ends)
        for layer in self.layers:
            x = x + layer(x)
        said = self.leave(x).unflatten(-1, (-1, self.columns))
        return nn.functional.pad(said, (0, 0, 0, self.rows - said.shape[1]))


class SizedNetwork(WienerNetwork):
    """`WienerNetwork` of numbers of unit deviation, and a second network that says how much larger or smaller than usual the
    numbers of each token are in each window. A third may say their mean: what is diffused is then what differs from it.

    Own choice: people who stand and people who run differ more than gaps of one length do; and a mean that is asked for in
    metres is nearer than that of samples, whose training counts small and large numbers alike.

    Args:
        inner, alpha_bar: as of `WienerNetwork`.
        entering: how many numbers tell of a window, see `Representation.ends`.
        fps: frames per second of the windows.
        mean: says the mean of the tokens in each window; None: it is 0.
    """

    def __init__(
        self, inner: KeyframeNetwork, entering: int, alpha_bar: Float[Tensor, " M"], fps: float, mean: MeanNetwork | None = None
    ) -> None:
        rows = inner.net.rows
        super().__init__(inner, torch.ones(rows, inner.net.columns), alpha_bar)
        self.fps = fps
        last = zero_linear(SIZES, rows)  # draws before the first layer does, in every training that was made
        self.log_factor = nn.Sequential(nn.Linear(entering, SIZES), nn.SiLU(), last)
        self.mean_of = mean

    def mean(self, ends: Ends, rows: int) -> Float[Tensor, "B rows columns"]:
        """The mean of the first tokens in each window, in usual sizes."""
        return ends.new_zeros(len(ends), rows, self.power.shape[-1]) if self.mean_of is None else self.mean_of(ends)[:, :rows]

    def factor(self, ends: Ends, rows: int) -> Float[Tensor, "B rows 1"]:
        """By what the usual sizes of the first tokens are multiplied in each window, as training fits it."""
        return self.log_factor(ends)[:, :rows, None].clamp(-LARGEST, LARGEST).exp()

    def factor_of_samples(self, ends: Ends, rows: int) -> Float[Tensor, "B rows 1"]:
        """`factor`, but for tokens above `FINE` at most 1: for people faster than those in training the network says that what
        is so fine grows with the movement, and it hardly does.

        Source: Winter, Biomechanics and Motor Control of Human Movement, filters gait at 6 Hz; own choice: the bound.
        """
        frames = ends[:, -1:, None].exp()  # from keyframe to keyframe, see `Representation.ends`
        hertz = torch.arange(1, rows + 1, device=ends.device)[None, :, None] * self.fps / (2 * (frames - 1))
        found = self.factor(ends, rows)
        return torch.where(hertz > FINE, found.clamp_max(1), found)


FITTED_ON = 4000  # windows
STILL = 1e-4  # metres: a batch of people who stand as still as that has no larger loss
ON_BODIES = "diversity_weight", "smoothness_weight", "length_weight", "angle_weight", "contact_weight"
LIMIT = 0.995  # quantile of the training data's angles that is their limit: own choice, the paper's limits are not given


class Batch(NamedTuple):
    """Windows, and which of their frames are keyframes."""

    windows: PlacedWindows
    mask: Bool[Tensor, "B T"]


class InbetweeningObjective(Objective):
    """The training of a bridge, as `mwlib.training.train` takes it.

    Args:
        cfg: configuration.
        split: clips for training, and for the validation loss.
        learnt: what was learnt in an earlier part of the same training; empty: it is fitted now.

    Raises:
        ValueError: the clips do not match each other, or are all shorter than a window, those for validation too; or contacts
            are asked of a body without feet.
    """

    def __init__(self, cfg: Config, split: Split, learnt: Mapping[str, Tensor] | None = None) -> None:
        self.cfg, self.task, task = cfg, cfg.task, cfg.task
        self.space = make_space(split.train, task.state)
        self.feet = feet(self.space.bodies.skeleton)
        if cfg.objective.contact_weight and not self.feet:
            raise ValueError(
                f"contact_weight is {cfg.objective.contact_weight}, but joints are "
                f"{', '.join(self.space.bodies.skeleton.joints)}; expected toes, feet or ankles"
            )
        self.clips = Clips(Variation(speeds=task.other_speeds).clips(split.train), self.space, task.mirror)
        self.held_out = Clips(split.validation, self.space) if split.validation else None
        if self.held_out is not None:
            self.held_out.check(task.frames)
        self.alpha_bar = alpha_bar(cfg.diffusion.schedule, cfg.diffusion.steps)
        self.level = snr_weights(self.alpha_bar) if cfg.objective.level_weight == "snr" else None
        if learnt:
            self.limits = learnt["limits"]
            self.representation = Representation.restore(cfg, learnt)
        else:
            with seeded(cfg.training.seed, 0) as generator:
                seen = self.clips.draw(FITTED_ON, task.frames, generator, task.past)
            self.representation = Representation.fit(cfg, seen.x)
            angles = bone_angles(self.space.positions(seen.x, seen.offsets)[:, ::4], self.space.bodies.skeleton)
            self.limits = torch.quantile(angles.flatten(0, 1)[:200_000], LIMIT, dim=0)
        with seeded(cfg.training.seed, 0):
            self.network: nn.Module = make_network(self.representation)

    def to(self, device: torch.device) -> None:
        """Move the windows."""
        self.clips.to(device)
        if self.held_out is not None:
            self.held_out.to(device)

    def draw(self, batch: int, generator: torch.Generator) -> Batch:
        """Windows of one length and their keyframes; what some of them do not show beyond these is NaN."""
        frames = int(torch.randint(self.task.fewest, self.task.frames + 1, (1,), generator=generator))
        return self._shown(self.clips, batch, frames, generator, self.cfg.model.more_keyframes)

    def _shown(self, clips: Clips, batch: int, frames: int, generator: torch.Generator, more: int = 0) -> Batch:
        past, future, hide = self.task.past, self.task.future, self.cfg.model.hide
        mask = draw_keyframes(batch, frames, more, generator, past, future)
        windows = clips.draw(batch, frames, generator, past)
        if hide:
            hidden = torch.zeros(batch, frames, dtype=torch.bool)
            for part in (slice(0, past - 1), slice(frames - future + 1, frames)):
                hidden[:, part] = torch.rand(batch, 1, generator=generator) < hide
            windows = windows._replace(x=windows.x.masked_fill(hidden.to(windows.x.device)[..., None], torch.nan))
        return Batch(windows, mask.to(clips.flat.device))

    def loss(self, network: nn.Module, batch: Batch, generator: torch.Generator) -> Float[Tensor, ""]:
        """L = L_noise + lambda_d L_div + lambda_s L_smooth + lambda_l L_len + lambda_a L_ang + the contacts; t in 1..M-1."""
        options, form, seen = self.cfg.objective, self.representation, None
        draws = options.draws if options.diversity_weight else 1
        gap = form.gap(batch.windows.x, batch.mask)
        windows, tf, y = batch.windows._replace(x=gap.x), form.transform(gap.frames), form.tokens(gap)
        sizes, mean, of_window = y.new_ones(len(y), 1, 1), torch.zeros_like(y), y.new_zeros(())
        if isinstance(network, SizedNetwork):
            sizes, ends = form.usual(gap.frames).to(y), form.ends(gap)
            if network.mean_of is not None:
                mean = sizes * network.mean(ends, y.shape[-2])
                guess = form.states(tf.inverse(mean), gap)
                of_window, mean = self._share_left(guess, gap.line, windows), mean.detach()
                y = y - mean
            factor = network.factor(ends, y.shape[-2])
            of_window = of_window + (0.5 * (y / (sizes * factor)).square() + factor.log()).mean()  # minus the log density
            sizes = sizes * factor.detach()
        y = y / sizes
        t = torch.randint(1, len(self.alpha_bar), (len(y),), generator=generator)
        a = self.alpha_bar[t].repeat_interleave(draws)  # float64, on the CPU: not every device has that precision
        y, steps = (v.repeat_interleave(draws, dim=0) for v in (y, t.to(y.device)))
        eps = torch.randn(y.shape, generator=generator).to(y.device)
        y_t = noised(y, eps, a)
        if self.cfg.model.condition_on_keyframes:
            seen = form.conditioning(gap).repeat_interleave(draws, dim=0)
        output = network(y_t, steps, seen)
        error = output - network_target(self.cfg.diffusion.prediction, y, eps, a)
        if options.level_weight == "unit":
            error = error / network.share(y_t, steps)  # pyright: ignore[reportCallIssue]  (Config.check: it is Wiener's)
        error = error.square().mean((-2, -1))
        total = of_window + (error if self.level is None else error * self.level.to(y.device)[steps]).mean()
        if any(getattr(options, name) for name in ON_BODIES):
            y0_hat = y0_hat_of(y_t, to_eps(self.cfg.diffusion.prediction, output, y_t, a), a)
            z = tf.inverse(y0_hat.unflatten(0, (-1, draws)) * sizes[:, None] + mean[:, None])
            total = total + self._of_bodies(form.states(z, gap), windows, t)
        return total

    def _share_left(self, guess: Tracks, line: Tracks, windows: PlacedWindows) -> Float[Tensor, ""]:
        """Error of guessed states as a share of the interpolation's: mean distance of joints over the frames between."""
        p, straight, truth = (self.space.positions(states, windows.offsets) for states in (guess, line, windows.x))
        left, whole = ((places - truth)[:, 1:-1].norm(dim=-1).mean() for places in (p, straight))
        return left / whole.clamp_min(STILL)

    def _of_bodies(self, x: Float[Tensor, "B M T C"], windows: PlacedWindows, t: Int[Tensor, " B"]) -> Float[Tensor, ""]:
        """The losses on clean estimates, metres, times alpha_bar: an error in eps is divided by it in the estimate."""
        o, skeleton = self.cfg.objective, self.space.bodies.skeleton
        places = self.space.positions(x, windows.offsets[:, None])
        truth = self.space.positions(windows.x, windows.offsets)[:, None]
        flat = places.flatten(-2)
        total = x.new_zeros(x.shape[:2])
        if o.smoothness_weight:
            total = total + o.smoothness_weight * smoothness_loss(flat, truth.expand_as(places).flatten(-2), o.smoothness)
        if o.length_weight and not self.space.rigid:  # else it is zero
            lengths = bone_lengths(truth[:, :, 0], skeleton)
            total = total + o.length_weight * bone_length_loss(places, lengths, skeleton)
        if o.angle_weight:
            total = total + o.angle_weight * bone_angle_loss(places, self.limits.to(x), skeleton)
        if o.contact_weight:
            total = total + o.contact_weight * contact_loss(places, truth, self.feet, self.space.bodies.fps)
        if o.diversity_weight:
            total = total + o.diversity_weight * diversity_loss(flat, o.diversity, o.diversity_scale)[:, None]
        return (total.mean(1) * self.alpha_bar[t].to(x)).mean()

    def held_out_loss(self, network: nn.Module, generator: torch.Generator) -> float | None:
        """Loss on windows of people held out."""
        if self.held_out is None:
            return None
        parts = [self._shown(self.held_out, 256, self.task.frames, generator) for _ in range(2)]
        return float(torch.stack([self.loss(network, part, generator) for part in parts]).mean())

    def learnt(self) -> dict[str, Tensor]:
        """Statistics of the windows, and the limits of the angles."""
        return {**self.representation.learnt(), "limits": self.limits}

    def about(self) -> dict[str, str]:
        """The kind of body."""
        return {"space": self.space.to_json()}


def make_network(representation: Representation) -> KeyframeNetwork | WienerNetwork:
    """The untrained network that a configuration names, for what is diffused."""
    cfg = representation.cfg
    m, task, (rows, channels) = cfg.model, cfg.task, representation.transform(cfg.task.gap).shape
    inner = KeyframeNetwork(m, rows, channels, task.steps)
    if m.output == "direct":
        return inner
    levels = alpha_bar(cfg.diffusion.schedule, cfg.diffusion.steps)
    if m.departure_scale != "window":
        return WienerNetwork(inner, representation.power, levels)
    entering = (2 + task.steps) * channels + task.steps * bool(m.hide) + 1
    mean = MeanNetwork(entering, rows, channels, m.mean_width, m.dropout) if m.mean_width else None
    return SizedNetwork(inner, entering, levels, cfg.data.fps, mean)
