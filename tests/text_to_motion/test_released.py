"""Models of MDM's code: its own layout of a file, with random weights, against a transcription of its forward pass."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import nn

import mwlib as mw
from mwlib import MotionFormatError
from mwlib.networks.text import EncodedText, HashedNgrams
from mwlib.text_to_motion import model
from mwlib.text_to_motion.released import open_mdm

WIDTH, LAYERS, FORWARD = 16, 2, 24
ARGS = {"arch": "trans_enc", "dataset": "humanml", "diffusion_steps": 50, "noise_schedule": "cosine", "layers": LAYERS,
        "latent_dim": WIDTH, "cond_mask_prob": 0.1, "sigma_small": True, "emb_trans_dec": False, "lambda_vel": 0.0}  # fmt: skip


def released(features: int, text: int = 512) -> dict[str, torch.Tensor]:
    """Names and shapes of a released file."""
    layer = nn.TransformerEncoderLayer(WIDTH, 4, FORWARD, activation="gelu").state_dict()
    shapes = {
        "input_process.poseEmbedding.weight": (WIDTH, features), "input_process.poseEmbedding.bias": (WIDTH,),
        "sequence_pos_encoder.pe": (5000, 1, WIDTH), "embed_timestep.sequence_pos_encoder.pe": (5000, 1, WIDTH),
        **{f"seqTransEncoder.layers.{n}.{name}": tuple(value.shape) for n in range(LAYERS) for name, value in layer.items()},
        **{f"embed_timestep.time_embed.{n}.weight": (WIDTH, WIDTH) for n in (0, 2)},
        **{f"embed_timestep.time_embed.{n}.bias": (WIDTH,) for n in (0, 2)},
        "embed_text.weight": (WIDTH, text), "embed_text.bias": (WIDTH,),
        "output_process.poseFinal.weight": (features, WIDTH), "output_process.poseFinal.bias": (features,),
    }  # fmt: skip
    generator = torch.Generator().manual_seed(2)
    return {name: 0.3 * torch.randn(shape, generator=generator) for name, shape in shapes.items()}


def transcribed(weights: dict[str, torch.Tensor], x: torch.Tensor, t: int, text: torch.Tensor) -> torch.Tensor:
    """The clean estimate of one clip (T, D), all of whose frames are seen."""

    def linear(name: str, value: torch.Tensor) -> torch.Tensor:
        return value @ weights[f"{name}.weight"].T + weights[f"{name}.bias"]

    rate = torch.exp(torch.arange(0, WIDTH, 2) * (-math.log(10000.0) / WIDTH))
    places = torch.zeros(len(x) + 100, WIDTH)
    places[:, 0::2] = torch.sin(torch.arange(len(places))[:, None] * rate)
    places[:, 1::2] = torch.cos(torch.arange(len(places))[:, None] * rate)
    time = linear("embed_timestep.time_embed.0", places[t])
    condition = linear("embed_timestep.time_embed.2", time * time.sigmoid()) + linear("embed_text", text)
    tokens = torch.cat([condition[None], linear("input_process.poseEmbedding", x)])
    layer = nn.TransformerEncoderLayer(WIDTH, 4, FORWARD, activation="gelu")
    encoder = nn.TransformerEncoder(layer, LAYERS, enable_nested_tensor=False).eval()
    own = {name.removeprefix("seqTransEncoder."): v for name, v in weights.items() if name.startswith("seqTransEncoder.")}
    encoder.load_state_dict(own)
    with torch.no_grad():
        out = encoder((tokens + places[: len(tokens)])[:, None])[1:, 0]
    return linear("output_process.poseFinal", out)


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """A model beside a collection's statistics; CLIP is another encoder of 512 numbers."""

    def stand_in(place: Path) -> HashedNgrams:
        torch.manual_seed(4)
        return HashedNgrams(50, width=512, layers=0)

    monkeypatch.setattr(model, "ClipText", stand_in)
    monkeypatch.setenv("MWLIB_DATA", str(tmp_path))
    for name, width in (("HumanML3D", 263), ("KIT-ML", 251)):
        (tmp_path / name).mkdir()
        np.save(tmp_path / name / "Mean.npy", np.linspace(-1, 1, width))
        np.save(tmp_path / name / "Std.npy", np.linspace(1, 2, width))
    write(tmp_path)
    return tmp_path


def write(folder: Path, weights: object = None, **changes: object) -> Path:
    torch.save(released(263) if weights is None else weights, folder / "model000475000.pt")
    (folder / "args.json").write_text(json.dumps(ARGS | changes))
    return folder / "model000475000.pt"


@pytest.mark.parametrize(("dataset", "data", "features"), [("humanml", "HumanML3D", 263), ("kit", "KIT-ML", 251)])
def test_the_network_is_that_of_the_file(folder, dataset, data, features):
    weights = released(features)
    found = open_mdm(write(folder, weights, dataset=dataset), data)
    x, text = (torch.randn(shape, generator=torch.Generator().manual_seed(1)) for shape in ((2, 20, features), (2, 512)))
    encoded = EncodedText(text[:, None], torch.ones(2, 1, dtype=torch.bool), text)
    with torch.no_grad():
        y0_hat = found.net(x, torch.tensor([7, 49]), torch.ones(2, 20, dtype=torch.bool), encoded)
    expected = torch.stack([transcribed(weights, row, t, one) for row, t, one in zip(x, (7, 49), text, strict=True)])
    torch.testing.assert_close(y0_hat, expected, atol=1e-5, rtol=1e-5)
    np.testing.assert_allclose(found.statistics.mean, np.linspace(-1, 1, features), rtol=1e-6, atol=1e-7)
    cfg = found.cfg
    assert (cfg.forward.steps, cfg.model.mask_frames, cfg.sampling.guidance, cfg.sampling.sampler) == (50, False, 2.5, "ddpm")
    assert cfg.data.shortest == (40 if features == 263 else 24) and found.layout.width == features


def test_it_makes_motions_and_takes_the_average_of_the_weights(folder):
    plain, other = released(263), {name: value + 0.1 for name, value in released(263).items()}
    file = write(folder, {"model": other, "model_avg": plain}, mask_frames=True, diffusion_steps=5)
    (motion,) = mw.generate("a person does not walk", 2.0, run=open_mdm(file, "HumanML3D"))  # words as they are
    (same,) = mw.generate(
        "a person does not walk", 2.0, run=open_mdm(write(folder, plain, mask_frames=True, diffusion_steps=5), "HumanML3D")
    )
    assert motion.positions.shape == (40, 22, 3) and np.array_equal(motion.positions, same.positions)
    assert open_mdm(file, "HumanML3D").cfg.model.mask_frames


@pytest.mark.parametrize(("name", "value", "told"), [
    ("arch", "trans_dec", "says arch 'trans_dec'; expected trans_enc"),
    ("dataset", "humanact12", "says dataset 'humanact12'; expected humanml or kit"),
    ("text_encoder_type", "bert", "says text_encoder_type 'bert'; expected clip"),
    ("dataset", "kit", "does not fit: .*expected MDM's trans_enc for KIT-ML"),
])  # fmt: skip
def test_models_of_another_kind_are_refused(folder, name, value, told):
    with pytest.raises(ValueError, match=told):
        open_mdm(write(folder, **{name: value}), "HumanML3D")


@pytest.mark.parametrize(
    ("text", "told"), [("", "args.json, json: found"), ("[]", "dataset among them"), ("{}", "dataset among")]
)
def test_arguments_that_are_none_are_refused(folder, text, told):
    (folder / "args.json").write_text(text)
    with pytest.raises(MotionFormatError, match=told):
        open_mdm(folder / "model000475000.pt", "HumanML3D")
    (folder / "args.json").unlink()
    with pytest.raises(MotionFormatError, match="found none; expected the args.json that lies beside the model"):
        open_mdm(folder / "model000475000.pt", "HumanML3D")


class Call:
    """Pickles as a call of any function."""

    def __reduce__(self):
        return os.system, ("touch trace",)


def test_code_in_a_file_does_not_run(folder, monkeypatch):
    monkeypatch.chdir(folder)
    for content in ({"input_process.poseEmbedding.weight": Call()}, Call()):
        with pytest.raises(ValueError, match="is refused .*; expected a checkpoint of tensors and numbers alone"):
            open_mdm(write(folder, content), "HumanML3D")
    assert not (folder / "trace").exists()


@pytest.mark.parametrize(("change", "told"), [
    (lambda weights: weights | {"seqTransDecoder.layers.0.norm1.bias": torch.zeros(2)}, "has weights 'seqTransDecoder.*"),
    (lambda weights: {name: v for name, v in weights.items() if "poseFinal" not in name}, "does not fit: .*leave.weight"),
    (lambda weights: {name: v for name, v in weights.items() if "poseEmb" not in name}, "does not fit: 'enter.weight'"),
    (lambda weights: [weights], "holds 'list'; expected weights of MDM by their names"),
    (lambda weights: {"epoch": 3}, "holds 'dict'; expected weights of MDM by their names"),
])  # fmt: skip
def test_other_weights_are_refused(folder, change, told):
    with pytest.raises(ValueError, match=told):
        open_mdm(write(folder, change(released(263))), "HumanML3D")
