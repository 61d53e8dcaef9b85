"""Training steps per second at the preset `laptop_paper` beside a plain reference loop, in turn, in one process.

    python benchmarks/training_speed.py [--preset laptop_paper] [--rounds 5] [--threads 2]

The reference is the same model and objective as one writes them first, after HumanMAC's code: separate q, k, v, each with
its own layer norm, materialised attention, torch's dropout, windows drawn one by one in NumPy and transformed by PyWavelets.
It is timed with dropout on the attention weights, as published, and without, as in the preset.
"""

from __future__ import annotations

import argparse
import math
import statistics
import time

import numpy as np
import pywt
import torch
from torch import nn
from torch.nn import functional as F

from mwlib.data.sources import Split, split_motions
from mwlib.diffusion.process import alpha_bar
from mwlib.networks.translinear import TransLinear
from mwlib.prediction.config import Config
from mwlib.prediction.objective import PredictionObjective
from mwlib.training import train


class PlainStylize(nn.Module):
    """FiLM, SiLU, dropout, linear."""

    def __init__(self, width, dropout):
        super().__init__()
        self.film, self.norm = nn.Linear(width, 2 * width), nn.LayerNorm(width)
        self.dropout, self.out = nn.Dropout(dropout), nn.Linear(width, width)

    def forward(self, h, emb):
        scale, shift = torch.chunk(self.film(F.silu(emb)).unsqueeze(1), 2, dim=2)
        return self.out(self.dropout(F.silu(self.norm(h) * (1 + scale) + shift)))


class PlainBlock(nn.Module):
    """Self-attention with everything spelled out, then feed-forward."""

    def __init__(self, width, heads, feedforward, dropout, attention_dropout):
        super().__init__()
        self.heads = heads
        self.norms = nn.ModuleList(nn.LayerNorm(width) for _ in range(3))
        self.qkv = nn.ModuleList(nn.Linear(width, width, bias=False) for _ in range(3))
        self.attention_dropout, self.dropout = nn.Dropout(attention_dropout), nn.Dropout(dropout)
        self.up, self.down = nn.Linear(width, feedforward), nn.Linear(feedforward, width)
        self.styles = nn.ModuleList(PlainStylize(width, dropout) for _ in range(2))

    def forward(self, x, emb):
        b, k, d = x.shape
        q, key, v = (lin(norm(x)).view(b, k, self.heads, -1) for lin, norm in zip(self.qkv, self.norms, strict=True))
        weight = torch.einsum("bnhd,bmhd->bnmh", q, key) / math.sqrt(d // self.heads)
        mixed = torch.einsum("bnmh,bmhd->bnhd", self.attention_dropout(F.softmax(weight, dim=2)), v).reshape(b, k, d)
        x = x + self.styles[0](mixed, emb)
        return x + self.styles[1](self.down(self.dropout(F.gelu(self.up(x)))), emb)


def plain_network(cfg: Config, shape: tuple[int, int], attention_dropout: float) -> nn.Module:
    """TransLinear with plain blocks."""
    m = cfg.model
    net = TransLinear(*shape, m.width, m.layers, m.heads, m.feedforward, m.dropout, m.attention_dropout)
    plain = (PlainBlock(m.width, m.heads, m.feedforward, m.dropout, attention_dropout) for _ in net.blocks)
    net.blocks = nn.ModuleList(_WithoutMaps(block) for block in plain)
    return net


class _WithoutMaps(nn.Module):
    def __init__(self, block):
        super().__init__()
        self.block = block

    def forward(self, x, emb, attention_rows):
        return self.block(x, emb), None


def reference_steps(cfg: Config, motions, attention_dropout: float):
    """A plain training loop; yields once a step."""
    c, cut, rng = cfg.training, cfg.windows, np.random.default_rng(0)
    clips = [m.root_relative().astype(np.float32) for m in motions if len(m) > cut.frames]
    joints = clips[0].shape[1] // 3

    def sample():
        clip = clips[rng.integers(len(clips))]
        start = rng.integers(len(clip) - cut.frames)
        window = clip[start : start + cut.frames].reshape(cut.frames, joints, 3)
        angle = rng.uniform(0, 2 * np.pi)
        turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
        return (window @ turn.T).reshape(cut.frames, -1)

    def dwt(x):
        aa, (da, ad, dd) = pywt.dwt2(x, cfg.model.wavelet, cfg.model.mode)
        return torch.from_numpy(np.concatenate([aa, da, ad, dd], axis=-1)).float()

    some = dwt(np.stack([sample() for _ in range(256)]))
    mean, deviation = some.mean(0), some.std(0).clamp_min(1e-3)
    net = plain_network(cfg, tuple(some.shape[1:]), attention_dropout)
    optimiser = torch.optim.AdamW(net.parameters(), lr=c.lr)
    average = [p.detach().clone() for p in net.parameters()]
    a_bar = alpha_bar(cfg.diffusion.schedule, cfg.diffusion.steps).float()
    while True:
        x = np.stack([sample() for _ in range(c.batch)])
        history = x[:, : cut.history]
        padded = np.concatenate([history, np.repeat(history[:, -1:], cut.future, axis=1)], axis=1)
        y, condition = ((dwt(v) - mean) / deviation for v in (x, padded))
        t = torch.randint(1, cfg.diffusion.steps, (c.batch,))
        eps, a = torch.randn_like(y), a_bar[t].view(-1, 1, 1)
        out = net(a.sqrt() * y + (1 - a).sqrt() * eps, t, condition)
        loss = F.mse_loss(out, y if cfg.diffusion.prediction == "y0" else eps)
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        for old, new in zip(average, net.parameters(), strict=True):
            old.mul_(c.ema).add_(new.detach(), alpha=1 - c.ema)
        yield loss.item()


def main() -> None:
    """Time blocks of steps, ours and the reference's in turn."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--preset", default="laptop_paper")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--steps", type=int, default=4, help="steps per round")
    parser.add_argument("--threads", type=int, default=2)
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    cfg = Config.preset(args.preset)
    motions = split_motions(cfg.data).train
    loops = {
        "mwlib": train(lambda learnt: PredictionObjective(cfg, Split(motions, [], []), learnt), cfg.training),
        "reference": reference_steps(cfg, motions, cfg.model.dropout),
        "reference, no attention dropout": reference_steps(cfg, motions, cfg.model.attention_dropout),
    }
    rates: dict[str, list[float]] = {name: [] for name in loops}
    for loop in loops.values():
        next(loop), next(loop)
    for _ in range(args.rounds):
        for name, loop in loops.items():
            started = time.perf_counter()
            for _ in range(args.steps):
                next(loop)
            rates[name].append(args.steps / (time.perf_counter() - started))
    for name, values in rates.items():
        ratios = [ours / theirs for ours, theirs in zip(rates["mwlib"], values, strict=True)]
        print(
            f"{name:32s} {statistics.median(values):6.2f} steps/s   (min {min(values):.2f}, max {max(values):.2f})"
            f"   mwlib / this: {statistics.median(ratios):.2f}   (min {min(ratios):.2f}, max {max(ratios):.2f})"
        )


if __name__ == "__main__":
    main()
