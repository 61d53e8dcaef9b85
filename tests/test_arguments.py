"""Arguments of the rooms' functions: what an annotation does not name is refused by the argument's name, before anything runs."""

from __future__ import annotations

import inspect
import math
from collections.abc import Mapping

import numpy as np
import pytest
import torch

import mwlib as mw
from mwlib import metrics, plots, transforms
from mwlib.arguments import fault
from mwlib.synthetic.motions import synthetic_motions

pytestmark = pytest.mark.usefixtures("unchecked")
FUNCTIONS = {
    f"{room.__name__.split('.')[1]}.{name}": getattr(room, name)
    for room in (metrics, plots, transforms)
    for name in room.__all__
    if inspect.isfunction(getattr(room, name))
}
P, G = torch.zeros(2, 3, 4, 6), torch.zeros(2, 4, 6)
WALK = synthetic_motions(1, seconds=1)[0]


@pytest.mark.parametrize("name", FUNCTIONS)
def test_what_no_argument_can_be_is_refused_by_name(name):
    needed = [
        one
        for one in inspect.signature(FUNCTIONS[name]).parameters.values()
        if one.default is one.empty and "VAR" not in one.kind.name
    ]
    for spoilt in (object(), {1: object()}, np.array([None])):
        if needed:
            words = [spoilt for one in needed if one.kind is not one.KEYWORD_ONLY]
            with pytest.raises(ValueError, match=rf"^({'|'.join(one.name for one in needed)})\b.* is .*; expected "):
                FUNCTIONS[name](*words, **{one.name: spoilt for one in needed if one.kind is one.KEYWORD_ONLY})


REFUSED = [
    (lambda: metrics.apd(None), r"^p is None; expected a tensor of float numbers \(N, S, F, C\)$"),
    (lambda: metrics.apd(P.numpy()), r"^p is ndarray of shape \(2, 3, 4, 6\); expected a tensor of float"),
    (lambda: metrics.apd(P.long()), r"^p is Tensor of shape .*; expected a tensor of float"),
    (lambda: metrics.apd(P[0]), r"^p is Tensor of shape \(3, 4, 6\); expected a tensor of float numbers \(N, S, F, C\)"),
    (lambda: metrics.apd(P[None]), r"^p is Tensor of shape \(1, 2, 3, 4, 6\); expected a tensor"),
    (lambda: metrics.apd(P.to("meta")), r"^p is Tensor"),
    (lambda: metrics.apd(P.to_sparse()), r"^p is Tensor"),
    (lambda: metrics.ade(P, g=None), r"^g is None; expected a tensor"),
    (lambda: metrics.speed(P, "25"), r"^fps is '25'; expected a number$"),
    (lambda: metrics.speed(P, True), r"^fps is True; expected a number"),
    (lambda: metrics.speed(P, math.nan), r"^fps is nan; expected a number above 0"),
    (lambda: metrics.jerk(P, 0), r"^fps is 0; expected a number above 0"),
    (lambda: metrics.mmade(P, [G, None]), r"^gs\[1\] is None; expected a tensor"),
    (lambda: metrics.l2q(torch.zeros(2, 3, 4, 3), torch.zeros(2, 3, 4, 3)), r"^p is Tensor of shape \(2, 3, 4, 3\); .*J, 4\)"),
    (lambda: metrics.bone_length_jitter(P, "H36M17"), r"^skeleton is 'H36M17'; expected a Skeleton"),
    (lambda: metrics.keyframe_error(G, G, [0.5]), r"^keyframes\[0\] is 0.5; expected a whole number"),
    (lambda: metrics.keyframe_error(G, G, "01"), r"^keyframes is '01'; expected several of a whole number"),
    (lambda: metrics.r_precision(G[0], G[0], ranked="poses"), r"^ranked is 'poses'; expected 'motions' or 'texts'"),
    (lambda: metrics.diversity(G[0], 2, generator=0), r"^generator is 0; expected a Generator"),
    (lambda: plots.curves({"a": [1.0], "b": "x"}, xlabel="", ylabel=""), r"^lines\['b'\] is 'x'; expected an array of float"),
    (lambda: plots.passages({"a": None}), r"^\w+\['a'\] is None; expected a Motion"),
    (lambda: plots.player(WALK, fps="25"), r"^fps is '25'; expected a number"),
    (lambda: plots.player(5), r"^motions? is 5; expected"),
    (lambda: transforms.pad_history([[1.0]], 4), r"^x_history is \[\[1.0\]\] \(list\); expected a tensor"),
    (lambda: transforms.pad_history(G, 4.5), r"^frames is 4.5; expected a whole number"),
    (lambda: transforms.fit_scale(None, G, "band"), r"^tf is None; expected a Transform"),
    (lambda: transforms.fit_scale(mw.DCTTransform(4, 6), G, "bands"), "^kind is 'bands'; expected one of none, band, co"),
    (lambda: mw.DCTTransform("4", 6), r"^frames is '4'; expected a whole number, at least 1"),
    (lambda: mw.DCTTransform(4, 0), r"^channels is 0; expected at least 1"),
    (lambda: mw.DCTTransform(4, 6, rows=5), r"^rows is 5; expected at most 4"),
    (lambda: mw.DCTTransform(4, 6)(None), r"^the argument is None; expected a tensor"),
    (lambda: mw.DCTTransform(4, 6)(G[:, :3]), r"^last two axes are \(3, 6\); expected \(4, 6\)"),
    (lambda: mw.DCTTransform(4, 6).inverse(G[..., :3]), r"^last two axes are \(4, 3\); expected \(4, 6\)"),
    (lambda: transforms.DSTTransform(2, 6), r"^frames is 2; expected at least 3"),
    (lambda: transforms.DSTTransform(6, 6, rows=5), r"^rows is 5; expected at most 4"),
    (lambda: mw.WaveletTransform(4.0, 6), r"^frames is 4.0; expected a whole number"),
    (lambda: mw.WaveletTransform(4, 6, wavelet=None), r"^wavelet is None; expected a discrete PyWavelets wavelet"),
    (lambda: mw.WaveletTransform(4, 6, level=1.5), r"^level is 1.5; expected a whole number"),
    (lambda: mw.WaveletTransform(40, 6)("x"), r"^the argument is 'x'; expected a tensor"),
    (lambda: transforms.TimeWaveletTransform(40, 6, level="3"), r"^level is '3'; expected a whole number"),
    (lambda: transforms.TimeWaveletTransform(40, 6)(G), r"^last two axes are \(4, 6\); expected \(40, 6\)"),
    (lambda: mw.PhaseTransform(40, 6, window=4.5), r"^window is 4.5; expected a whole number"),
    (lambda: mw.PhaseTransform(40, None), r"^channels is None; expected a whole number"),
    (lambda: transforms.ScaledTransform(None, G[0], G[0]), r"^base is None; expected a Transform"),
    (lambda: transforms.ScaledTransform(mw.DCTTransform(4, 6), G, G[0]), r"^mean has shape \(2, 4, 6\); expected \(4, 6\)"),
]  # fmt: skip


@pytest.mark.parametrize("call, message", REFUSED)
def test_each_argument_is_named(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_what_fits_passes_and_a_missing_argument_is_pythons_error():
    joints = torch.rand(5, 4, 3)
    assert metrics.foot_contacts(joints, np.array([0, 1]), np.float32(10), fastest=math.inf, floor=torch.tensor(0.0)).shape == (
        4,
        2,
    )
    assert metrics.speed(P, np.int64(5)).shape == (2,) and metrics.speed(P, 5).shape == (2,)
    assert len(metrics.mmade(P, (G, G))) == 2 and metrics.confidence([0.5, 0.5]) == metrics.confidence(torch.ones(2)) == 0
    assert plots.curves({"a": [1, 2], "b": np.arange(2), "c": torch.arange(2.0)}, xlabel="", ylabel="")
    assert fault("x", {"a": {"b": 1.0}}, Mapping[str, float] | Mapping[str, Mapping[str, float]]) == ""
    with pytest.raises(TypeError, match="missing a required argument: 'g'"):
        metrics.ade(P)
    assert inspect.signature(metrics.ade) == inspect.signature(metrics.prediction.ade) and metrics.ade is metrics.ade
