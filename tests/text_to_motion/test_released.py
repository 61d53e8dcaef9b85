"""Models of MDM's and StableMoFusion's codes: files of their layouts, with random weights, against the originals.

Two tests run the originals' own programs, where MWLIB_MDM and MWLIB_STABLEMOFUSION name their folders.
"""

from __future__ import annotations

import importlib
import math
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch
from torch import nn

import mwlib as mw
from mwlib import MotionFormatError
from mwlib.networks.text import EncodedText
from mwlib.text_to_motion import model
from mwlib.text_to_motion.released import open_released
from tests.text_to_motion.originals import FORWARD, LAYERS, TIMES, WIDTH, StandIn, mdm_weights, said, unet_weights, write_unet
from tests.text_to_motion.originals import write_mdm as write

TEXTS, FRAMES = ["a person walks", "a man waves twice"], [60, 196]


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
    monkeypatch.setattr(model, "ClipText", StandIn)
    monkeypatch.setenv("MWLIB_DATA", str(tmp_path))
    for name, width in (("HumanML3D", 263), ("KIT-ML", 251)):
        (tmp_path / name).mkdir()
        np.save(tmp_path / name / "Mean.npy", np.linspace(-1, 1, width))
        np.save(tmp_path / name / "Std.npy", np.linspace(1, 2, width))
    write(tmp_path)
    return tmp_path


@pytest.mark.parametrize(("dataset", "data", "features"), [("humanml", "HumanML3D", 263), ("kit", "KIT-ML", 251)])
def test_the_network_is_that_of_the_file(folder, dataset, data, features):
    weights = mdm_weights(features)
    found = open_released(write(folder, weights, dataset=dataset), data)
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
    plain, other = mdm_weights(), {name: value + 0.1 for name, value in mdm_weights().items()}
    file = write(folder, {"model": other, "model_avg": plain}, mask_frames=True, diffusion_steps=5)
    (motion,) = mw.generate("a person does not walk", 2.0, run=open_released(file, "HumanML3D"))  # words as they are
    (same,) = mw.generate(
        "a person does not walk", 2.0, run=open_released(write(folder, plain, mask_frames=True, diffusion_steps=5), "HumanML3D")
    )
    assert motion.positions.shape == (40, 22, 3) and np.array_equal(motion.positions, same.positions)
    assert open_released(file, "HumanML3D").cfg.model.mask_frames


@pytest.mark.parametrize(("name", "value", "told"), [
    ("arch", "trans_dec", "says arch 'trans_dec'; expected trans_enc"),
    ("dataset", "humanact12", "says dataset 'humanact12'; expected humanml or kit"),
    ("text_encoder_type", "bert", "says text_encoder_type 'bert'; expected clip"),
    ("dataset", "kit", "does not fit: .*expected MDM's trans_enc for KIT-ML"),
])  # fmt: skip
def test_models_of_another_kind_are_refused(folder, name, value, told):
    with pytest.raises(ValueError, match=told):
        open_released(write(folder, **{name: value}), "HumanML3D")


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "args.json, settings: found"),
        ("[]", "dataset among them"),
        ("{}", "dataset among"),
        ("[" * 200_000, "args.json, settings: found"),
    ],
)
def test_arguments_that_are_none_are_refused(folder, text, told):
    (folder / "args.json").write_text(text)
    with pytest.raises(MotionFormatError, match=told):
        open_released(folder / "model000475000.pt", "HumanML3D")
    (folder / "args.json").unlink()
    with pytest.raises(MotionFormatError, match="found none; expected the args.json that lies with MDM"):
        open_released(folder / "model000475000.pt", "HumanML3D")


class Call:
    """Pickles as a call of any function."""

    def __reduce__(self):
        return os.system, ("touch trace",)


def test_code_in_a_file_does_not_run(folder, monkeypatch):
    monkeypatch.chdir(folder)
    for content in ({"input_process.poseEmbedding.weight": Call()}, Call()):
        with pytest.raises(ValueError, match="is refused .*; expected a checkpoint of tensors and numbers alone"):
            open_released(write(folder, content), "HumanML3D")
    assert not (folder / "trace").exists()


@pytest.mark.parametrize(("change", "told"), [
    (lambda weights: weights | {"seqTransDecoder.layers.0.norm1.bias": torch.zeros(2)}, "has weights 'seqTransDecoder.*"),
    (lambda weights: {name: v for name, v in weights.items() if "poseFinal" not in name}, "does not fit: .*leave.weight"),
    (lambda weights: {name: v for name, v in weights.items() if "poseEmb" not in name}, "does not fit: 'enter.weight'"),
    (lambda weights: [weights], "holds 'list'; expected weights of MDM's trans_enc by their names"),
    (lambda weights: {"epoch": 3}, "holds 'dict'; expected weights of MDM's trans_enc by their names"),
])  # fmt: skip
def test_other_weights_are_refused(folder, change, told):
    with pytest.raises(ValueError, match=told):
        open_released(write(folder, change(mdm_weights())), "HumanML3D")


def test_a_checkpoint_of_stablemofusion_is_opened_with_its_average_its_statistics_and_its_sampler(folder):
    found = open_released(write_unet(folder))  # no data: its statistics lie with it
    net, theirs = found.net.body.state_dict(), unet_weights()
    assert sum(value.numel() for value in net.values()) == sum(v.numel() for n, v in theirs.items() if "time_mlp.0" not in n)
    for own, other in (
        ("text.weight", "embed_text.weight"), ("text_norm.bias", "text_ln.bias"), ("time.2.bias", "unet.time_mlp.3.bias"),
        ("shrink.3.weight", "unet.downs.3.2.conv.weight"), ("middle.1.attention.query.weight",
        "unet.mid_block2.cross_attn.cross_attention.query.weight"), ("grow.0.bias", "unet.ups.0.0.conv.bias"),
        ("ups.1.1.convolutions.film.bias", "unet.ups.1.2.conv1d.time_mlp.1.bias"), ("leave.weight", "unet.final_conv.weight"),
    ):  # fmt: skip
        assert torch.equal(net[own], theirs[other])
    np.testing.assert_allclose(found.statistics.deviation, np.linspace(1, 2, 263), rtol=1e-6)  # as it is, not divided again
    cfg = found.cfg
    assert (cfg.sampling.sampler, cfg.sampling.sampling_steps, cfg.model.mask_frames, cfg.padded) == ("sde_dpm", 10, False, 196)
    assert cfg.model.multipliers == TIMES and found.lengths == (40, 196)


def test_statistics_of_the_collection_stand_in_for_those_that_are_not_there(folder):
    file = write_unet(folder)
    (folder / "meta" / "std.npy").unlink()
    with pytest.raises(MotionFormatError, match="std.npy"):
        open_released(file)
    (folder / "meta" / "mean.npy").unlink()
    (folder / "meta").rmdir()
    weighed = np.linspace(1, 2, 263)
    weighed[[0, 1, 2, 3, -4, -3, -2, -1]] /= 5
    np.testing.assert_allclose(open_released(file).statistics.deviation, weighed, rtol=1e-6)
    (folder / "opt.txt").write_text((folder / "opt.txt").read_text().replace("feat_bias: 5", "feat_bias: 3"))
    with pytest.raises(MotionFormatError, match="as feat_bias is 3 and not 5"):
        open_released(file)


@pytest.mark.parametrize(("name", "value", "told"), [
    ("no_eff", True, "opt.txt says no_eff True; expected False"),
    ("dataset_name", "amass", "says dataset_name 'amass'; expected t2m or humanml or kit"),
    ("base_dim", 10**9, "does not fit: .*base_dim 1000000000 .*where the weights have .16, 16, 16, 32"),
    ("dim_mults", [1, 1, 1], "does not fit: .*dim_mults .1, 1, 1. .*four levels"),
    ("dim_mults", "two", "does not fit"),
    ("dataset_name", "kit", "does not fit: .*expected StableMoFusion's U-Net for KIT-ML"),
])  # fmt: skip
def test_checkpoints_of_another_kind_are_refused(folder, name, value, told):
    with pytest.raises(ValueError, match=told):
        open_released(write_unet(folder, **{name: value}))


def test_what_is_no_checkpoint_is_refused(folder, monkeypatch):
    monkeypatch.chdir(folder)
    for content, told in (({"encoder": Call()}, "is refused"), ({"encoder": {"unet.x.weight": torch.zeros(2)}}, "has weights")):
        with pytest.raises(ValueError, match=told):
            open_released(write_unet(folder, content))
    assert not (folder / "trace").exists()
    (folder / "model" / "latest.tar").write_bytes(b"none")
    with pytest.raises(ValueError, match="is refused"):
        open_released(folder / "model" / "latest.tar")
    (folder / "opt.txt").unlink()
    with pytest.raises(MotionFormatError, match="expected the opt.txt that lies with StableMoFusion"):
        open_released(folder / "model" / "latest.tar")
    with pytest.raises(FileNotFoundError, match="[*].tar from the models that .*StableMoFusion links"):
        open_released(folder / "nowhere" / "latest.tar")


def test_averages_of_torch_are_opened(folder):
    averaged = {f"module.{name}": value for name, value in unet_weights().items()} | {"n_averaged": torch.tensor(7)}
    found = open_released(write_unet(folder, {"encoder": {}, "model_ema": averaged}))
    assert torch.equal(found.net.body.state_dict()["text.bias"], unet_weights()["embed_text.bias"])


def noise_like(monkeypatch, shape: tuple[int, ...], seed: int = 0) -> None:
    """Noise that is drawn as the originals draw it, for all motions of a batch together."""

    class Together:
        def __init__(self, *_: object) -> None:
            torch.manual_seed(seed)

        def __call__(self) -> torch.Tensor:
            drawn = torch.randn(shape)
            return drawn if len(shape) == 3 else drawn[:, :, 0].transpose(1, 2)

    monkeypatch.setattr(model, "WindowNoise", Together)


def sampled(folder: Path, monkeypatch, name: str) -> list[torch.Tensor]:
    if name == "unet":
        noise_like(monkeypatch, (2, 196, 263))
        return open_released(write_unet(folder)).sample(TEXTS, FRAMES)
    noise_like(monkeypatch, (2, 263, 1, 196))
    return open_released(write(folder, diffusion_steps=10), "HumanML3D").sample(TEXTS, FRAMES)


@pytest.fixture
def original(monkeypatch, tmp_path) -> Iterator[Any]:
    """A function that makes an original's modules importable; CLIP, the body model and BERT are stand-ins."""
    before = {*sys.modules}

    def use(variable: str) -> Path:
        if not os.environ.get(variable):
            pytest.skip(f"{variable} names no folder of the original's program")
        place = Path(os.environ[variable])
        monkeypatch.syspath_prepend(place)
        monkeypatch.chdir(place)
        stand_ins = {
            "clip": {"tokenize": lambda texts, **_: [*texts], "load": lambda *_, **__: (Clip(), None),
                     "model": SimpleNamespace(convert_weights=lambda _: None)},
            "model.rotation2xyz": {"Rotation2xyz": lambda **_: SimpleNamespace(smpl_model=nn.Identity())},
            "model.BERT.BERT_encoder": {"load_bert": None},
            "joblib": {},
        }  # fmt: skip
        for name, content in stand_ins.items():
            monkeypatch.setitem(sys.modules, name, ModuleType(name))
            for key, value in content.items():
                setattr(sys.modules[name], key, value)
        return place

    yield use
    for name in {*sys.modules} - before:
        if name.partition(".")[0] in ("models", "model", "diffusion", "utils", "data_loaders"):
            del sys.modules[name]


class Clip(nn.Module):
    """Says of sentences what `StandIn` does, in the steps that the U-Net's program takes."""

    dtype = torch.float32
    positional_embedding = torch.zeros(77, 512)
    transformer = ln_final = staticmethod(lambda x: x)

    def token_embedding(self, texts: list[str]) -> torch.Tensor:
        return torch.stack([said(text) for text in texts])


class Texts(list):
    """Tokens that a program may move to a device."""

    def to(self, _: object) -> Texts:
        return self


@pytest.mark.filterwarnings("ignore")
def test_the_u_net_samples_as_the_original(folder, monkeypatch, original):
    original("MWLIB_STABLEMOFUSION")
    file = write_unet(folder)
    monkeypatch.setattr(sys.modules["clip"], "tokenize", lambda texts, **_: Texts(texts))
    unet, pipeline = (importlib.import_module(name) for name in ("models.unet", "models.gaussian_diffusion"))
    net = unet.T2MUnet(input_feats=263, base_dim=16, dim_mults=TIMES, text_latent_dim=256, time_dim=512, cond_mask_prob=0.1)
    checkpoint = torch.load(file, weights_only=True)["model_ema"]
    net.load_state_dict({n: v for n, v in checkpoint.items() if not n.startswith("clip_model")}, strict=True)
    opt = SimpleNamespace(diffusion_steps=1000, beta_schedule="linear", prediction_type="sample")
    pipe = pipeline.DiffusePipeline(opt, net.eval(), "dpmsolver", 10, "cpu", torch.float32)
    torch.manual_seed(0)
    theirs = pipe.generate_batch(TEXTS, torch.tensor(FRAMES)) * torch.linspace(1, 2, 263) + torch.linspace(-1, 1, 263)
    check(sampled(folder, monkeypatch, "unet"), theirs)


@pytest.mark.filterwarnings("ignore")
def test_mdm_samples_as_the_original(folder, monkeypatch, original):
    original("MWLIB_MDM")
    tools, guided = (importlib.import_module(name) for name in ("utils.model_util", "utils.sampler_util"))
    args = SimpleNamespace(
        dataset="humanml", latent_dim=WIDTH, layers=LAYERS, cond_mask_prob=0.1, arch="trans_enc", emb_trans_dec=False,
        text_encoder_type="clip", pos_embed_max_len=5000, mask_frames=False, unconstrained=False, diffusion_steps=10,
        noise_schedule="cosine", sigma_small=True, lambda_vel=0.0, lambda_rcxyz=0.0, lambda_fc=0.0,
    )  # fmt: skip
    net, diffusion = tools.create_model_and_diffusion(args, SimpleNamespace(dataset=None))
    tools.load_saved_model(net, write(folder, diffusion_steps=10))
    net.eval()  # gives nothing back
    net.encode_text = lambda texts: torch.stack([said(text)[0] for text in texts])[None]
    mask = (torch.arange(196) < torch.tensor(FRAMES)[:, None])[:, None, None]
    asked = {"y": {"mask": mask, "lengths": torch.tensor(FRAMES), "text": TEXTS, "scale": torch.full((2,), 2.5)}}
    monkeypatch.setattr(torch, "randn_like", lambda x: torch.randn(x.shape))  # whatever the order in memory
    torch.manual_seed(0)
    theirs = diffusion.p_sample_loop(
        guided.ClassifierFreeSampleModel(net).eval(), (2, 263, 1, 196), clip_denoised=False, model_kwargs=asked
    )
    raw = theirs[:, :, 0].transpose(1, 2) * torch.linspace(1, 2, 263) + torch.linspace(-1, 1, 263)
    check(sampled(folder, monkeypatch, "mdm"), raw)


def check(ours: list[torch.Tensor], theirs: torch.Tensor) -> None:
    for x, other, frames in zip(ours, theirs, FRAMES, strict=True):
        torch.testing.assert_close(x, other[:frames], atol=1e-3, rtol=1e-3)
