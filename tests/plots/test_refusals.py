"""What cannot be drawn is refused, with what was found and what was expected."""

from __future__ import annotations

import numpy as np
import pytest

from mwlib import plots
from mwlib.synthetic.motions import synthetic_motions

FPS = 20.0
TRUTH, NOISE = np.sin(np.arange(41)), np.ones((3, 41))
SEVEN = {str(row): np.linspace(1, 0.1, 40) for row in range(7)}
WALK = synthetic_motions(1, seconds=2)[0].resample(25.0).cut(0, 41)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: plots.bridged_coordinate(TRUTH, {"short": TRUTH[1:]}, NOISE, fps=FPS), "short: 40 frames; expected 41"),
        (lambda: plots.bridged_coordinate(TRUTH, dict.fromkeys("abcdef", TRUTH), NOISE, fps=FPS),
         "6 baselines; expected at most 5"),
        (lambda: plots.spectra({"truth": TRUTH}, fps=FPS, frames=79), "79 frames have 40 frequencies; .*not {'truth': 41}"),
        (lambda: plots.spectra({}, fps=FPS, frames=80), "at least one row"),
        (lambda: plots.imposed_steps(NOISE, [0.0, 0.5, 1.0], fps=FPS), "expected 3, one for each step, falling"),
        (lambda: plots.curves(dict.fromkeys("abcdefghijklm", TRUTH), xlabel="", ylabel=""), "13 rows; expected at most 12"),
        (lambda: plots.energy_by_coefficient(SEVEN), "7 rows; expected at most 6"),
        (lambda: plots.energy_by_coefficient({"rates": np.ones(8)}, few=8), "rates: 8 coefficients; expected more than few, 8"),
        (lambda: plots.known_share(SEVEN), "7 rows; expected at most 6"),
        (lambda: plots.recovery_by_coefficient(SEVEN, steps=9), "7 rows; expected at most 6"),
        (lambda: plots.parallel_snr(np.ones(9), np.full(9, 0.5), range(1, 8)), "7 coefficients; expected at most 6"),
        (lambda: plots.kept_power({"T": SEVEN}), "7 samplers; expected at most 6"),
        (lambda: plots.coupling_bars({"a": {"b": [3.0]}}, [0.2, 0.4]), "a, b: 1 errors; expected 2, one for each noise"),
        (lambda: plots.passages({"a": WALK}, keyframes=(0, 41)), "keyframe 41 is outside of a; expected 0 to 40"),
        (lambda: plots.passages({}), "0 rows"),
        (lambda: plots.passages(WALK, every=0), "every 0 frames"),
        (lambda: plots.ways({}), "expected at least one motion in each"),
        (lambda: plots.ways({"walks": [WALK], "runs": []}), "expected at least one motion in each"),
        (lambda: plots.emerging_way([NOISE[:2].T] * 2, [1], limbs=[TRUTH] * 2, fps=20),
         "2 paths, 1 steps and 2 limbs; expected equally many"),
        (lambda: plots.claimed_and_measured({}), "no settings"),
        (lambda: plots.claimed_and_measured({"a": {"x": (0.0, 1.0)}, "b": {"y": (0.0, 1.0)}}), r"\['b'\] differ"),
        (lambda: plots.results_table([]), "no rows"),
        (lambda: plots.results_table([{"a": 1.0}], better={"a": "up"}), "better is 'up'"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()
