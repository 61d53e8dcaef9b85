"""Files in the layouts of two published programs, with random weights; and a stand-in for CLIP that both sides can have."""

from __future__ import annotations

import json
import math
from functools import cache
from io import BytesIO
from pathlib import Path
from zlib import crc32

import numpy as np
import torch
from torch import Tensor, nn

from mwlib.networks.text import EncodedText, TextEncoder

WIDTH, LAYERS, FORWARD = 16, 2, 1024  # of MDM; its program knows no other feed-forward width
BASE, TIMES = 16, (1, 1, 1, 2)  # of the U-Net
ARGS = {"arch": "trans_enc", "dataset": "humanml", "diffusion_steps": 50, "noise_schedule": "cosine", "layers": LAYERS,
        "latent_dim": WIDTH, "cond_mask_prob": 0.1, "sigma_small": True, "emb_trans_dec": False, "lambda_vel": 0.0}  # fmt: skip
OPTIONS = {"base_dim": BASE, "batch_size": 64, "beta_schedule": "linear", "clip_grad_norm": 1, "cond_mask_prob": 0.1,
           "continue_ckpt": "latest.tar", "dataset_name": "t2m", "diffusion_steps": 1000, "dim_mults": [*TIMES],
           "feat_bias": 5, "lr": 0.0002, "model_ema": True, "name": "t2m_condunet1d_batch64", "no_adagn": False,
           "no_eff": False, "prediction_type": "sample", "text_latent_dim": 256, "time_dim": 512}  # fmt: skip


def drawn(shapes: dict[str, tuple[int, ...]], scale: float = 0.3) -> dict[str, Tensor]:
    generator = torch.Generator().manual_seed(2)
    return {name: scale * torch.randn(shape, generator=generator) for name, shape in shapes.items()}


def both(name: str, *weight: int, bias: int | None = None) -> dict[str, tuple[int, ...]]:
    return {f"{name}.weight": weight, f"{name}.bias": (bias or weight[0],)}


def transformer(name: str, width: int, heads: int, forward: int, layers: int) -> dict[str, tuple[int, ...]]:
    layer = nn.TransformerEncoderLayer(width, heads, forward, activation="gelu").state_dict()
    return {f"{name}.layers.{n}.{key}": tuple(value.shape) for n in range(layers) for key, value in layer.items()}


@cache
def mdm_weights(features: int = 263, text: int = 512) -> dict[str, Tensor]:
    """Names and shapes of a released file."""
    return drawn({
        **both("input_process.poseEmbedding", WIDTH, features),
        "sequence_pos_encoder.pe": (5000, 1, WIDTH), "embed_timestep.sequence_pos_encoder.pe": (5000, 1, WIDTH),
        **transformer("seqTransEncoder", WIDTH, 4, FORWARD, LAYERS),
        **both("embed_timestep.time_embed.0", WIDTH, WIDTH), **both("embed_timestep.time_embed.2", WIDTH, WIDTH),
        **both("embed_text", WIDTH, text), **both("output_process.poseFinal", features, WIDTH),
    })  # fmt: skip


@cache
def unet_weights(features: int = 263) -> dict[str, Tensor]:
    """Names and shapes of "encoder" and "model_ema", but for CLIP's."""
    widths = [BASE * times for times in TIMES]
    shapes = {
        **both("embed_text", 256, 512), **transformer("textTransEncoder", 256, 4, 2048, 4), **both("text_ln", 256),
        "unet.time_mlp.0.pe": (5000, 512), **both("unet.time_mlp.1", 2048, 512), **both("unet.time_mlp.3", 512, 2048),
    }  # fmt: skip
    for n, (before, width) in enumerate(zip([features, *widths], widths, strict=False)):
        shapes |= block(f"unet.downs.{n}.0", before, width) | block(f"unet.downs.{n}.1", width, width)
        shapes |= both(f"unet.downs.{n}.2.conv", width, width, 3)
    shapes |= block("unet.mid_block1", widths[-1], widths[-1]) | block("unet.mid_block2", widths[-1], widths[-1])
    for n, (before, width) in enumerate(zip([widths[-1], *widths[::-1]], widths[::-1], strict=False)):
        shapes |= both(f"unet.ups.{n}.0.conv", before, width, 4, bias=width)
        shapes |= block(f"unet.ups.{n}.1", 2 * width, width) | block(f"unet.ups.{n}.2", width, width)
    found = drawn(shapes | both("unet.final_conv", features, widths[0], 1), 0.1)
    angle = torch.arange(5000)[:, None] * torch.exp(torch.arange(0, 512, 2) * (-math.log(10000.0) / 512))
    found["unet.time_mlp.0.pe"][:, 0::2], found["unet.time_mlp.0.pe"][:, 1::2] = angle.sin(), angle.cos()
    return found


def block(name: str, before: int, width: int) -> dict[str, tuple[int, ...]]:
    heard = f"{name}.cross_attn.cross_attention"
    return {
        **both(f"{name}.conv1d.blocks.0.block", width, before, 5), **both(f"{name}.conv1d.blocks.0.group_norm", width),
        **both(f"{name}.conv1d.blocks.1.block", width, width, 5), **both(f"{name}.conv1d.blocks.1.norm", width),
        **both(f"{name}.conv1d.time_mlp.1", 2 * width, 512),
        **(both(f"{name}.conv1d.residual_conv", width, before, 1) if before != width else {}),
        **both(f"{heard}.norm", width), **both(f"{heard}.text_norm", 256),
        **both(f"{heard}.query", width, width), **both(f"{heard}.key", width, 256), **both(f"{heard}.value", width, 256),
    }  # fmt: skip


def write_mdm(folder: Path, weights: object = None, **changes: object) -> Path:
    torch.save(mdm_weights() if weights is None else weights, folder / "model000475000.pt")
    (folder / "args.json").write_text(json.dumps(ARGS | changes))
    return folder / "model000475000.pt"


def packed(checkpoint: object) -> bytes:
    file = BytesIO()
    torch.save(checkpoint, file)
    return file.getvalue()


@cache
def unet_checkpoint() -> bytes:
    """As the program saves it: the optimiser, the weights, their average, and CLIP in both."""
    clip = {"clip_model.positional_embedding": torch.zeros(77, 512)}
    plain = {name: value + 0.1 for name, value in unet_weights().items()}
    optimiser = {"state": {0: {"step": torch.tensor(3.0)}}, "param_groups": [{"lr": 2e-4, "params": [0]}]}
    return packed({"opt_encoder": optimiser, "total_it": 50_000, "encoder": plain | clip, "model_ema": unet_weights() | clip})


def write_unet(folder: Path, checkpoint: object = None, **changes: object) -> Path:
    for name in ("model", "meta"):
        (folder / name).mkdir(exist_ok=True)
    (folder / "model" / "latest.tar").write_bytes(unet_checkpoint() if checkpoint is None else packed(checkpoint))
    lines = "".join(f"{name}: {value}\n" for name, value in sorted((OPTIONS | changes).items()))
    (folder / "opt.txt").write_text(f"------------ Options -------------\n{lines}-------------- End ----------------\n")
    np.save(folder / "meta" / "mean.npy", np.linspace(-1, 1, 263))
    np.save(folder / "meta" / "std.npy", np.linspace(1, 2, 263))
    return folder / "model" / "latest.tar"


def said(text: str, longest: int = 77) -> Tensor:
    """What the stand-in for CLIP makes of a sentence: (77, 512), drawn by its letters."""
    return torch.randn(longest, 512, generator=torch.Generator().manual_seed(crc32(text.encode())))


class StandIn(TextEncoder):
    """Gives each sentence tokens of its own, and the first of them for the whole."""

    width = 512

    def __init__(self, *_: object, **__: object) -> None:
        super().__init__()

    def forward(self, texts) -> EncodedText:
        tokens = torch.stack([said(text) for text in texts])
        return EncodedText(tokens, torch.ones(tokens.shape[:2], dtype=torch.bool), tokens[:, 0])
