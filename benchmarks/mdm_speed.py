"""MDM's transformer beside torch's own and one written by hand, in turn; and the time of sampling motions from sentences.

    python benchmarks/mdm_speed.py [--threads 2] [--rounds 7] [--frames-per-token 4]

Teaching size: 128 numbers per token, 4 layers, 4 heads. Sampling is 32 sentences of 196 frames in 50 steps with guidance, so that
the network sees 64 motions in each.
"""

from __future__ import annotations

import argparse
import math
import statistics
from time import perf_counter

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from mwlib.diffusion import alpha_bar, classifier_free, ddim_indices, posterior_mean, to_eps
from mwlib.networks import MDM, ConditionalUNet, WordTransformer
from mwlib.networks.layers import Encoder

WIDTH, LAYERS, HEADS, FEEDFORWARD, DROPOUT = 128, 4, 4, 256, 0.1
FEATURES, FRAMES, STEPS, SENTENCES, GUIDANCE = 263, 196, 50, 32, 2.5


class PlainLayer(nn.Module):
    """Post-norm attention and feed-forward, everything spelled out, with torch's dropout."""

    def __init__(self) -> None:
        super().__init__()
        self.qkv = nn.ModuleList(nn.Linear(WIDTH, WIDTH) for _ in range(3))
        self.out, self.up, self.down = nn.Linear(WIDTH, WIDTH), nn.Linear(WIDTH, FEEDFORWARD), nn.Linear(FEEDFORWARD, WIDTH)
        self.norms, self.dropout = nn.ModuleList(nn.LayerNorm(WIDTH) for _ in range(2)), nn.Dropout(DROPOUT)

    def forward(self, x: Tensor, mask: Tensor) -> Tensor:
        q, k, v = (layer(x).unflatten(-1, (HEADS, -1)) for layer in self.qkv)
        weight = torch.einsum("bnhd,bmhd->bhnm", q, k) / math.sqrt(WIDTH // HEADS)
        weight = self.dropout(weight.masked_fill(~mask[:, None, None], float("-inf")).softmax(dim=-1))
        mixed = self.out(torch.einsum("bhnm,bmhd->bnhd", weight, v).flatten(-2))
        x = self.norms[0](x + self.dropout(mixed))
        return self.norms[1](x + self.dropout(self.down(self.dropout(F.gelu(self.up(x))))))


class Plain(nn.Module):
    """Layers one after the other."""

    def __init__(self) -> None:
        super().__init__()
        self.layers = nn.ModuleList(PlainLayer() for _ in range(LAYERS))

    def forward(self, x: Tensor, mask: Tensor) -> Tensor:
        for layer in self.layers:
            x = layer(x, mask)
        return x


class Torchs(nn.Module):
    """torch.nn.TransformerEncoder as it comes."""

    def __init__(self) -> None:
        super().__init__()
        layer = nn.TransformerEncoderLayer(WIDTH, HEADS, FEEDFORWARD, DROPOUT, "gelu", batch_first=True)
        self.stack = nn.TransformerEncoder(layer, LAYERS, enable_nested_tensor=False)

    def forward(self, x: Tensor, mask: Tensor) -> Tensor:
        return self.stack(x, src_key_padding_mask=~mask)


def in_turn(runs: dict, rounds: int) -> dict[str, float]:
    """Median milliseconds of each, after one round that does not count."""
    times: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(rounds + 1):
        for name, run in runs.items():
            start = perf_counter()
            run()
            times[name].append(1000 * (perf_counter() - start))
    return {name: statistics.median(found[1:]) for name, found in times.items()}


def transformers(rounds: int) -> None:
    """The four kinds, training and evaluated."""
    sizes = (WIDTH, LAYERS, HEADS, FEEDFORWARD, DROPOUT)
    kinds = {
        "mwlib": Encoder(*sizes), "mwlib, no attention dropout": Encoder(*sizes, 0.0), "torch's": Torchs(), "by hand": Plain(),
    }  # fmt: skip
    x = torch.randn(2 * SENTENCES, FRAMES // 2 + 1, WIDTH)
    mask = torch.arange(x.shape[1]) < torch.randint(40, x.shape[1], (len(x), 1))

    def trained(net):
        return lambda: net.train()(x, mask).square().mean().backward()

    def evaluated(net):
        return lambda: torch.inference_mode()(net.eval())(x, mask)

    training = in_turn({name: trained(net) for name, net in kinds.items()}, rounds)
    evaluation = in_turn({name: evaluated(net) for name, net in kinds.items()}, rounds)
    print(f"{len(x)} x {x.shape[1]} tokens, milliseconds")
    for name in kinds:
        share = f"{training[name] / training['by hand']:4.0%} and {evaluation[name] / evaluation['by hand']:4.0%} of by hand"
        print(f"  {name:28s} forward and back {training[name]:7.0f}, forward {evaluation[name]:6.0f}; {share}")


@torch.inference_mode()
def sampled(network: nn.Module, encoder: WordTransformer) -> float:
    """Seconds for all sentences with ancestral DDPM and classifier-free guidance."""
    start, a = perf_counter(), alpha_bar("cosine", STEPS)
    text = encoder([f"a person walks forward and waves {n} times" for n in range(SENTENCES)])
    twice = type(text)(*(torch.cat([part, part]) for part in text))
    drop = torch.arange(2 * SENTENCES) >= SENTENCES
    mask = torch.ones(2 * SENTENCES, FRAMES, dtype=torch.bool)

    def denoise(y: Tensor, t: int) -> Tensor:
        out = network(torch.cat([y, y]), torch.full((2 * SENTENCES,), t), mask, twice, drop)
        return to_eps("y0", classifier_free(*out.chunk(2), GUIDANCE, "alg1"), y, a[t])

    y = torch.randn(SENTENCES, FRAMES, FEATURES)
    for _ in posterior_mean(denoise, y, a, ddim_indices(STEPS, STEPS), noise=lambda: torch.randn_like(y)):
        pass
    return perf_counter() - start


def main() -> None:
    """Print medians and ratios, then the seconds of sampling."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--frames-per-token", type=int, default=4)
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    transformers(args.rounds)
    encoder = WordTransformer(["a", "and", "forward", "person", "times", "walks", "waves"], WIDTH).eval()
    sizes = dict(width=WIDTH, layers=LAYERS, heads=HEADS, feedforward=FEEDFORWARD, text_width=WIDTH)
    networks = {
        "MDM, a token for each frame": MDM(FEATURES, STEPS, **sizes),
        f"MDM, a token for {args.frames_per_token} frames": MDM(FEATURES, STEPS, **sizes, frames_per_token=args.frames_per_token),
        "U-Net, base 32": ConditionalUNet(FEATURES, STEPS, base=32, text_width=WIDTH),
    }
    print(f"{SENTENCES} sentences, {FRAMES} frames, {STEPS} steps with guidance")
    for name, network in networks.items():
        print(f"  {name:28s} {sampled(network.eval(), encoder):6.1f} s")


if __name__ == "__main__":
    main()
