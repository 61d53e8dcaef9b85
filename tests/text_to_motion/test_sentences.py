"""Motions by sentence: lengths as people give them, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from mwlib.experiments.sentences import generate
from mwlib.inbetweening.presets import PRESETS as INBETWEENING
from mwlib.prediction.presets import PRESETS as PREDICTION
from mwlib.text_to_motion import config, matching_config
from tests.text_to_motion.test_generator import model


@pytest.mark.parametrize("seconds", [1, 1.0, np.float32(1), np.int64(1), [1.0], np.ones(1)])
def test_seconds_may_be_any_number(seconds):
    [found] = generate("someone falls", seconds, run=model())
    assert len(found) == 20 and found.name == "someone falls"


@pytest.mark.parametrize("changes, message", [
    ({"seconds": float("nan")}, "seconds is nan; expected a finite number"),
    ({"seconds": float("inf")}, "seconds is inf; expected a finite number"),
    ({"samples": 0}, "0 samples; expected one length for each of 1 sentences, and 1 to 1000 samples"),
    ({"samples": 1001}, "1001 samples; expected"),
    ({"seconds": [1.0, 1.0]}, "2 lengths"),
])  # fmt: skip
def test_what_cannot_be_made_is_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        generate("someone falls", **{"seconds": 1.0, **changes}, run=model())


def test_one_preset_name_builds_the_figures_of_all_systems():
    shared = (set(PREDICTION) & set(INBETWEENING)) - {"lafan1"}
    assert {"h36m", "humaneva", "cmu_plus", "laptop_plus"} <= shared
    for kind in (config.Config, matching_config.Config):
        assert shared <= set(kind.presets)
        for name in kind.presets:
            assert kind.from_yaml(kind.preset(name).to_yaml()) == kind.preset(name)
