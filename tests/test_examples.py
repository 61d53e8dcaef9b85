"""Every example in a docstring of mwlib does what it shows. `torch`, `np` and `mw` are there without an import."""

from __future__ import annotations

import doctest
import importlib
import pkgutil

import numpy as np
import pytest
import torch

import mwlib as mw

NAMES = ["mwlib", *(found.name for found in pkgutil.walk_packages(mw.__path__, "mwlib.") if not found.name.endswith("__main__"))]
KNOWN = {"torch": torch, "np": np, "mw": mw}
FOUND = [test for name in NAMES for test in doctest.DocTestFinder().find(importlib.import_module(name), extraglobs=KNOWN)]
EXAMPLES = {test.name: test for test in FOUND if test.examples}


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_shows_what_happens(name):
    with torch.random.fork_rng():
        torch.manual_seed(0)
        doctest.DebugRunner(optionflags=doctest.NORMALIZE_WHITESPACE).run(EXAMPLES[name], clear_globs=False)


# The vocabulary: whoever looks one of these up finds it used.
WITH_EXAMPLE = """
    mwlib mwlib.transforms.dwt.WaveletTransform mwlib.transforms.linear.DCTTransform
    mwlib.transforms.linear.ScaledTransform mwlib.transforms.linear.fit_scale
    mwlib.transforms.linear.pad_history mwlib.diffusion.process.alpha_bar
    mwlib.diffusion.process.ddim_indices mwlib.diffusion.process.noised mwlib.diffusion.process.network_target
    mwlib.diffusion.process.to_eps mwlib.diffusion.process.y0_hat_of mwlib.diffusion.process.eps_of
    mwlib.diffusion.samplers.ddim mwlib.diffusion.samplers.dpm_solver mwlib.diffusion.samplers.posterior_mean
    mwlib.diffusion.conditioning.classifier_free mwlib.diffusion.samplers.WindowNoise mwlib.data.windows.windows
    mwlib.data.windows.TrainingWindows mwlib.metrics.prediction.apd mwlib.metrics.prediction.ade
    mwlib.metrics.prediction.fde mwlib.metrics.prediction.mmade mwlib.metrics.prediction.mmfde mwlib.metrics.prediction.cmd
    mwlib.metrics.prediction.step_length mwlib.metrics.prediction.bone_length_jitter mwlib.metrics.prediction.apde
    mwlib.metrics.inbetweening.l2p mwlib.metrics.inbetweening.l2q mwlib.metrics.inbetweening.NPSS mwlib.metrics.inbetweening.npss
    mwlib.metrics.evaluation.MetricTable mwlib.metrics.text.fid mwlib.metrics.text.r_precision
    mwlib.metrics.prediction.multimodal_futures mwlib.metrics.prediction.multimodal_apd
    mwlib.metrics.table.Column mwlib.prediction.baselines.zero_velocity
    mwlib.prediction.baselines.constant_velocity mwlib.prediction.baselines.NearestHistory
    mwlib.diffusion.conditioning.keyframed mwlib.inbetweening.gaussian.GaussianBridge
    mwlib.training.config.learning_rate mwlib.settings.parse_changes mwlib.prediction.config.Config
""".split()


def test_the_vocabulary_is_shown_at_work():
    assert [name for name in WITH_EXAMPLE if name not in EXAMPLES] == []
