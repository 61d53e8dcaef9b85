"""Motion as a few sinusoids per moment: a periodic autoencoder behind the interface of the other transforms."""

from __future__ import annotations

import math
from collections.abc import Callable

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional as nnf

from mwlib.settings import whole
from mwlib.transforms.linear import Coefficients, Motions, Transform

Batch = Float[Tensor, "B T C"]  # motions, metres

# Added to powers (of latents of about unit size): a window that stands still has amplitude and frequency 0, and gradients.
_POWER = 1e-6
_TAPS = 5  # of every convolution, frames
_CHUNK = 256  # sequences at a time: the windows of all frames side by side are large


def periodic_parameters(
    signal: Float[Tensor, "... N"], fps: float
) -> tuple[Float[Tensor, "..."], Float[Tensor, "..."], Float[Tensor, "..."]]:
    """Amplitude, frequency and offset of the one sinusoid that stands for a window.

    Source: Starke, Mason, Komura, DeepPhase (2022), from the real FFT c of the window without its constant bin:
    p_j = (2/N) |c_j|², A = sqrt((2/N) sum p_j), F = sum f_j p_j / sum p_j, B = c_0 / N. For a whole number of periods of a
    sinusoid they are its own; for several sinusoids A keeps the power and F is the mean frequency, weighted by power.

    Args:
        signal: N samples, N odd.
        fps: samples per second.

    Returns:
        A and B in the signal's unit, F in hertz.
    """
    count = signal.shape[-1]
    bins = torch.arange(1, count // 2 + 1, device=signal.device, dtype=signal.dtype)
    turns = torch.outer(torch.arange(count, device=signal.device, dtype=signal.dtype), bins) * (2 * math.pi / count)
    # The real and imaginary parts of c as a product of matrices: for windows of a second faster than an FFT and its gradient.
    power = (signal @ torch.cat([turns.cos(), turns.sin()], dim=1)).square() * (2 / count)
    total = power.sum(-1) + _POWER
    frequency = power @ (bins * (fps / count)).repeat(2) / total
    return (total * (2 / count)).sqrt(), frequency, signal.mean(-1)


def _conv(inputs: int, outputs: int) -> nn.Conv1d:
    return nn.Conv1d(inputs, outputs, _TAPS, padding=_TAPS // 2, padding_mode="replicate")


def _two_convolutions(inputs: int, hidden: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(_conv(inputs, hidden), nn.BatchNorm1d(hidden), nn.Tanh(), _conv(hidden, outputs))


class Straightened(nn.Module):
    """Layers along time, with a linear map of each frame added to what they give.

    Args:
        layers: (B, inputs, T) to (B, outputs, T).
        inputs, outputs: channels.
    """

    def __init__(self, layers: nn.Module, inputs: int, outputs: int) -> None:
        super().__init__()
        self.layers, self.line = layers, nn.Conv1d(inputs, outputs, 1)

    def forward(self, x: Float[Tensor, "B inputs T"]) -> Float[Tensor, "B outputs T"]:
        """The sum of both."""
        return self.layers(x) + self.line(x)


class PeriodicAutoencoder(nn.Module):
    """Convolutional encoder to M latent curves, one sinusoid per curve and window, and two decoders.

    Source: DeepPhase: two convolutions C to M, FFT, a linear layer per channel for the phase shift, a mirrored decoder of the
    window. Own choices: the input is positions, as positions must come out. The encoder runs once over the sequence, held at
    both ends, and the windows are cut from the latent curves, so that a frame costs one convolution and not N. Its kernels
    have five frames, not N, so that the window alone says how far a code looks, and C hidden channels, not C/3, which
    rebuilds motions better. A second, small decoder turns a sequence of codes into a motion.

    Args:
        channels, phases: C and M.
        window: N, frames, odd.
        fps: frames per second.
        straight: add a linear path beside the encoder and beside the decoder of motions. Own choice: without it a code of many
            channels is learnt far more slowly (grid `phase_sweep`).
    """

    mean: Tensor
    deviation: Tensor
    gain: Tensor

    def __init__(self, channels: int, phases: int, window: int, fps: float, straight: bool = False) -> None:
        super().__init__()
        self.window, self.fps = window, fps
        self.encoder: nn.Module = _two_convolutions(channels, channels, phases)
        self.shift = nn.Parameter(torch.randn(phases, window, 2) / math.sqrt(window))
        self.window_decoder = _two_convolutions(phases, channels, channels)
        self.decoder: nn.Module = nn.Sequential(
            _conv(4 * phases, channels), nn.ELU(), _conv(channels, channels), nn.ELU(), _conv(channels, channels)
        )
        if straight:
            self.encoder = Straightened(self.encoder, channels, phases)
            self.decoder = Straightened(self.decoder, 4 * phases, channels)
        self.register_buffer("mean", torch.zeros(channels))
        self.register_buffer("deviation", torch.ones(()))
        self.register_buffer("gain", torch.ones(4 * phases))

    def standard(self, x: Batch) -> Float[Tensor, "B C T"]:
        """Channels centred, and divided by one deviation for all, so that errors weigh as in metres."""
        return ((x - self.mean) / self.deviation).mT

    def held(self, x: Batch) -> Float[Tensor, "B C longer"]:
        """`standard`, with the first and last frame held for half a window, so that every frame is the centre of one."""
        return nnf.pad(self.standard(x), (self.window // 2, self.window // 2), mode="replicate")

    def encode(self, x: Batch) -> Float[Tensor, "B T columns"]:
        """A sin 2πS, A cos 2πS (the phase manifold), F in hertz, B: of every channel, at every frame."""
        latent = self.encoder(self.held(x))
        amplitude, frequency, offset = periodic_parameters(latent.unfold(-1, self.window, 1), self.fps)
        layers = self.shift.mT.flatten(0, 1)[:, None]  # the windows of one channel share theirs, which makes it a convolution
        shift = nnf.conv1d(latent, layers, groups=len(self.shift)).unflatten(1, (-1, 2))
        cosine, sine = (nnf.normalize(shift, dim=2) * amplitude[:, :, None]).unbind(2)
        return torch.cat([sine, cosine, frequency, offset], dim=1).mT

    def sinusoids(self, code: Float[Tensor, "... columns"]) -> Float[Tensor, "... M N"]:
        """A sin(2π(F τ - S)) + B over the window, τ = 0 at its centre."""
        sine, cosine, frequency, offset = (part[..., None] for part in code.chunk(4, dim=-1))
        seconds = (torch.arange(self.window, device=code.device) - self.window // 2) / self.fps
        turn = 2 * math.pi * frequency * seconds
        return cosine * turn.sin() - sine * turn.cos() + offset

    def decode(self, code: Float[Tensor, "B T columns"]) -> Batch:
        """The motion that a sequence of codes stands for, metres."""
        return self.decoder(code.mT).mT * self.deviation + self.mean

    def losses(self, x: Batch, frames: Tensor) -> tuple[Tensor, Tensor]:
        """Squared error of the windows at `frames`, each rebuilt from its own sinusoids, and of the whole motion."""
        code = self.encode(x)
        rebuilt = self.window_decoder(self.sinusoids(code[:, frames]).flatten(0, 1))
        wanted = self.held(x).unfold(-1, self.window, 1)[:, :, frames].transpose(1, 2).flatten(0, 1)
        return nnf.mse_loss(rebuilt, wanted), nnf.mse_loss(self.decoder(code.mT), self.standard(x))


class PhaseTransform(Transform):
    """The code of a trained periodic autoencoder, frame by frame. Neither linear nor invertible: `inverse` is a decoder.

    Projection, encoder after decoder, is not idempotent, unlike that of the linear transforms.

    Source: DeepPhase, as the paper's Sec. 4.7.1 cites it; the paper gives no construction. Own choices: a frame's code is all
    that its window's sinusoids are made of, [A sin 2πS, A cos 2πS, F, B], 4M numbers; the encoder serves both decoders; each
    column is scaled to metres, so that its deviation says how far the decoded body moves with it (losses that weigh
    coefficients by their variance then mean the same here as for the linear transforms).

    Args:
        frames, channels: T and C of the motions.
        phases: M, latent channels.
        window: N, frames, odd.
        fps: frames per second.
        seed: of the weights and of the draws of `fit`.
        straight: see `PeriodicAutoencoder`.

    Raises:
        ValueError: window is not an odd number from 3 on, or a count is none.
    """

    def __init__(
        self, frames: int, channels: int, phases: int = 8, window: int = 25, fps: float = 25.0, seed: int = 0,
        straight: bool = False,
    ) -> None:  # fmt: skip
        if whole("window", window, 3) % 2 == 0:
            raise ValueError(f"window is {window}; expected an odd number of frames, at least 3")
        self.frames, self.channels = whole("frames", frames, 1), whole("channels", channels, 1)
        self.phases, self.window, self.fps = whole("phases", phases, 1), window, fps
        self.shape, self.seed = (frames, 4 * phases), seed
        self.bands = {"phase": 2 * phases, "frequency": phases, "offset": phases}  # the phase manifold, and the rest of the code
        with torch.random.fork_rng([]):
            torch.manual_seed(seed)
            self.net = PeriodicAutoencoder(channels, phases, window, fps, straight)

    def fit(self, draw: Callable[[torch.Generator], Batch], steps: int = 1500, lr: float = 3e-3) -> list[float]:
        """Train on the CPU, so that a seed gives one result whatever device the motions are modelled on.

        Args:
            draw: a batch of windows, metres, from a generator.
            steps: batches.
            lr: first learning rate; it falls to zero along a cosine.

        Returns:
            The squared error of the decoded motion at each step, as a share of the motions' variance.
        """
        generator, net = torch.Generator().manual_seed(self.seed), self.net.train().requires_grad_(True)
        sample = torch.cat([draw(generator) for _ in range(8)])
        net.mean.copy_(sample.mean((0, 1)))
        net.deviation.copy_((sample - net.mean).square().mean().sqrt().clamp_min(1e-6))
        optimiser = torch.optim.AdamW(net.parameters(), lr=lr, fused=True)
        schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
        curve = []
        for _ in range(steps):
            frames = torch.randint(self.frames, (1,), generator=generator)
            window, motion = net.losses(draw(generator), frames)
            (window + motion).backward()
            nn.utils.clip_grad_norm_(net.parameters(), 1.0)
            optimiser.step()
            optimiser.zero_grad()
            schedule.step()
            curve.append(float(motion.detach()))
        net.eval().requires_grad_(False)
        net.gain.copy_(self._metres(sample))
        return curve

    def __call__(self, x: Motions) -> Coefficients:
        """Code of every frame."""
        return self._run(x, (self.frames, self.channels), lambda part: self.net.encode(part) * self.net.gain)

    def inverse(self, y: Coefficients) -> Motions:
        """The decoder's motion, metres."""
        return self._run(y, self.shape, lambda part: self.net.decode(part / self.net.gain))

    def tensors(self) -> dict[str, Tensor]:
        """Weights and scales."""
        return self.net.state_dict()

    def restore(self, tensors: dict[str, Tensor]) -> PhaseTransform:
        """Take over what `tensors` gave, instead of `fit`."""
        self.net.load_state_dict(tensors)
        self.net.eval().requires_grad_(False)
        return self

    @torch.no_grad()
    def _metres(self, x: Batch) -> Float[Tensor, " columns"]:
        """Metres that the decoded body moves per unit of each column of the code."""
        code = self.net.encode(x)
        still, deviation = self.net.decode(code), code.std((0, 1)).clamp_min(1e-6)
        moved = [self.net.decode(code + nudge) - still for nudge in torch.diag(deviation)]
        gain = torch.stack([m.square().mean().sqrt() for m in moved]) / deviation
        return gain.clamp_min(1e-4 * float(gain.max()))

    def _run(self, array: Tensor, expected: tuple[int, int], function: Callable[[Tensor], Tensor]) -> Tensor:
        if self.net.training:
            raise RuntimeError("this PhaseTransform is untrained: call fit or restore first")
        self._expect(array, expected)
        self.net.to(array.device)
        with torch.autocast(array.device.type, enabled=False):
            out = torch.cat([function(part) for part in array.reshape(-1, *expected).float().split(_CHUNK)])
        return out.to(array.dtype).reshape(*array.shape[:-2], *out.shape[1:])
