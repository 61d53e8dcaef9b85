"""Looking up the nearest caption among the training clips of the shipped model of sentences, on the test clips of its card.

    python benchmarks/nearest_sentences.py

Three draws of captions and pools; prints a Markdown table of means, ± the deviation over draws, to stand beside the card's.
A minute of one core.
"""

from __future__ import annotations

import numpy as np

import mwlib as mw
from mwlib.plots.tables import results_table
from mwlib.text_to_motion.system import DETAILS, METRICS, evaluate, load_data

SHOWN = "fid", "top1", "action", "then", "path", "speed", "hand", "foot", "turn", "count", "jerk"
DRAWS = 3


def main() -> None:
    """The command."""
    model = mw.load_run("sentences")
    data, columns = load_data(model.cfg), METRICS | DETAILS
    draws = [model.cfg.override(method="nearest_caption", sampling_seed=draw) for draw in range(DRAWS)]
    found = [evaluate(cfg, lambda: model, data)["mean"] for cfg in draws]
    line: dict[str, object] = {"motions": "nearest caption"}
    for name in SHOWN:
        values = np.array([mean[name] for mean in found])
        line[columns[name].heading] = f"{values.mean():.3g} ± {values.std(ddof=1):.1g}"
    print(results_table([line]))


if __name__ == "__main__":
    main()
