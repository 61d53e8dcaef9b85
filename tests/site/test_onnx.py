"""Exported networks say what torch's say, for any number of items, words and frames; the file beside them is whole."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import onnxruntime
import pytest
import torch

import mwlib as mw
from mwlib.cli import main
from mwlib.experiments.exported import export_onnx
from mwlib.transforms import pad_history

NAMES = {"prediction": "synthetic", "inbetweening": "inbetween", "text_to_motion": "sentences"}
NEAR = 1e-5  # of the largest number that torch says


@pytest.fixture(scope="module", params=["synthetic", "sentences", "inbetween"])
def exported(request, tmp_path_factory):
    """A model, its network in ONNX Runtime, and its description."""
    file = tmp_path_factory.mktemp("onnx") / f"{request.param}.onnx"
    words = [sys.executable, "-m", "mwlib", "export-onnx", request.param, "--out", str(file)]
    subprocess.run(words, check=True)  # the checks of shapes that tests switch on cannot be traced
    return mw.load_run(request.param), onnxruntime.InferenceSession(file), json.loads(file.with_suffix(".json").read_text())


def test_the_network_is_torchs(exported):
    model, network, about = exported
    generator, told = torch.Generator().manual_seed(0), torch.tensor([1.0, 0.0, 1.0, 1.0, 0.0])
    with torch.inference_mode():
        for t in (3, 41):
            if about["system"] == "prediction":
                y, given = (
                    torch.randn(5, *about["shape"], generator=generator),
                    torch.randn(1, *about["shape"], generator=generator),
                )
                expected = model.net(y, t, given.expand_as(y), keep=told.bool())
                condition = {"condition": given.numpy()}
            elif about["system"] == "inbetweening":
                y, given = (
                    torch.randn(5, 2 + t // 2, 51, generator=generator),
                    torch.randn(1, 2 + t // 2, 158, generator=generator),
                )
                ends = torch.randn(1, 207, generator=generator)
                ends[:, -1] = torch.tensor(y.shape[1] + 2.0).log()  # frames from keyframe to keyframe
                expected, condition = (
                    model.net(y, t, given.expand(5, -1, -1)),
                    {"condition": given.numpy(), "ends": ends.numpy()},
                )
                beside = [part(ends, y.shape[1]).numpy() for part in (model.net.mean, model.net.factor_of_samples)]
            else:
                y, text = (
                    torch.randn(5, 40 + 2 * t // 4 * 4, 263, generator=generator),
                    "someone walks in a circle" + " then turns" * t,
                )
                mask, same = torch.ones(y.shape[:2], dtype=torch.bool), [text] * 5
                expected = model.net(y, torch.full((5,), t), mask, same, told == 0)
                condition = {"words": model.net.text.numbers([text]).numpy()}
            feeds = {"y_t": y.numpy(), "t": np.array([t]), "told": told.numpy(), **condition}
            found, *more = network.run(None, {name: feeds[name] for name in about["inputs"]})
            if about["system"] == "inbetweening":
                for said, true in zip(more, beside, strict=True):
                    assert np.ptp(true) > 0 and np.abs(said - true).max() < NEAR * np.abs(true).max()
            assert np.abs(found - expected.numpy()).max() < NEAR * float(expected.abs().max())


def test_matrices_do_what_the_representation_does(exported):
    model, _, about = exported
    if about["system"] == "inbetweening":
        assert np.array(about["power"]).shape == (86, 32, 51)
        return
    if about["system"] != "prediction":
        assert about["words"] == [*model.net.text.vocabulary] and about["typed"]["words"]
        assert np.allclose(about["mean"], model.statistics.mean) and about["alpha_bar"] == model.alpha_bar.tolist()
        return
    (x,), seen = (
        mw.windows(model.bodies.prepare(mw.load_motions("synthetic")[:1]), 25, 100, 400).x[:1].double(),
        model.representation,
    )
    analysis, of_y, of_history = (np.array(about["matrices"][name]) for name in ("analysis", "of_coefficients", "of_history"))
    padded = pad_history(x[:25], 125)
    assert np.allclose(analysis @ padded.numpy(), seen.motion.along_time(seen.motion(padded)), atol=1e-6)
    future = of_y @ (analysis @ x.numpy()) + of_history @ x[:25].numpy()
    expected = model.continuation(seen.motion(x[None, None]), x[None, None, :25])
    assert np.allclose(future, expected[0, 0], atol=1e-5)


def test_shipped_weights_take_half_the_room(exported, tmp_path_factory):
    model, _, about = exported
    (file,) = tmp_path_factory.getbasetemp().rglob(f"{NAMES[about['system']]}.onnx")
    assert file.stat().st_size < 2.3 * sum(weight.numel() for weight in model.net.parameters())


def test_what_cannot_be_exported_is_said(tmp_path, monkeypatch, capsys):
    assert main(["export-onnx", "evaluator", "--out", str(tmp_path / "x.onnx")]) == 1
    assert "expected one of prediction, inbetweening or text_to_motion" in capsys.readouterr().err
    with pytest.raises(ValueError, match="file is 'x.bin'; expected a name that ends in .onnx"):
        export_onnx(mw.load_run("synthetic"), Path("x.bin"))
    monkeypatch.setitem(sys.modules, "onnxscript", None)
    assert main(["export-onnx", "synthetic", "--out", str(tmp_path / "x.onnx")]) == 1
    assert "onnxscript is missing, which writes ONNX; install both with: pip install" in capsys.readouterr().err
    assert not [*tmp_path.iterdir()]
