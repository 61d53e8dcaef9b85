"""What more attempts at a sentence bring, by the rules that choose and by looks that do not choose; and what its length does.

Two draws of test people, 360 clips each, one caption of each, one motion each, as long as the clip, sampling seed 0, default
reading. The judge is the `evaluator` that comes with the package. Then sentences of each action, in several lengths. Twenty
minutes of a core: python benchmarks/attempts.py figures/synthetic
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import torch
from scipy.ndimage import gaussian_filter1d

import mwlib as mw
from mwlib.body.kinematics import bone_lengths
from mwlib.body.motion import Motion
from mwlib.data.captioned import one_caption_each, thinned
from mwlib.data.formats.humanml import CaptionedClip, FeatureLayout
from mwlib.experiments.sampling import AGAIN, MOST
from mwlib.files import write_together
from mwlib.matching.evaluators import open_matcher
from mwlib.metrics import mm_dist
from mwlib.networks.matching import UNIT
from mwlib.plots.saving import as_csv
from mwlib.synthetic.sentences import RECIPES, captions_of, completed
from mwlib.synthetic.sentences_typed import claims
from mwlib.text_to_motion.attributes import CLAIMS, measured_attributes, movement
from mwlib.text_to_motion.motions import motion_of
from mwlib.text_to_motion.system import load_data, set_scores

MOST_ATTEMPTS = 4
SETS = {"the card's clips": {}, "of the set of 2,400": {"clips": 2400}}
SHOWN = ("wave", "kick", "turn")
SENTENCES, EACH = 4, 4  # of each action, and motions of each
ROUGH = 0.5  # seconds: what an arm does slower is no wave


def swing(motion: Motion) -> float:
    """How far a raised wrist goes to and from its shoulder, metres: twice the deviation about a slow average; of the arm it is
    larger in."""
    sizes = [0.0]
    for side in ("left", "right"):
        wrist, shoulder = (motion.positions[:, motion.skeleton.joints.index(f"{side}_{name}")] for name in ("wrist", "shoulder"))
        reach = np.linalg.norm(wrist - shoulder, axis=-1)
        quick = (reach - gaussian_filter1d(reach, ROUGH * motion.fps))[wrist[:, 1] > shoulder[:, 1]]
        sizes += [2 * float(quick.std())] if len(quick) else []
    return max(sizes)


def seen(motions: list[Motion], test: list[CaptionedClip]) -> dict[str, float]:
    """Shares of what captions claim that the rules see, by claim and for some actions."""
    right: dict[str, list[bool]] = {}
    for motion, clip in zip(motions, test, strict=True):
        found = measured_attributes(motion.positions, motion.fps)
        for name in CLAIMS:
            if name in clip.attributes:
                right.setdefault(f"{name} right", []).append(found.get(name) == clip.attributes[name])
        if clip.attributes["action"] in SHOWN:
            right.setdefault(f"{clip.attributes['action']}s right", []).append(found.get("action") == clip.attributes["action"])
        right.setdefault("nothing besides", []).append(found.get("then") == clip.attributes.get("then"))
    return {name: float(np.mean(values)) for name, values in sorted(right.items())}


def measured(of: str, changes: dict[str, Any]) -> list[dict[str, Any]]:
    """A row for the clips themselves, and one for each number of attempts."""
    model = mw.load_run("sentences")
    parts = load_data(model.cfg.override(**changes))
    test, layout = thinned(parts.test, model.cfg.sampling.test_clips), parts.layout
    texts, waves = one_caption_each(test, 0), [clip.attributes["action"] == "wave" for clip in test]
    true = [torch.from_numpy(clip.features[: len(clip.features) // UNIT * UNIT]) for clip in test]
    judge, drawn = open_matcher("evaluator", layout), dict[int, torch.Tensor]()
    words, real = judge.embed_text(texts).cpu(), judge.embed_motions(true)
    sample = model.sample

    def once(asked: list[str], frames: list[int], seed: int, *, ids: list[int], progress: bool) -> list[torch.Tensor]:
        """Whole features beside the motions that `generate` gives, each made once."""
        new = [k for k, number in enumerate(ids) if number not in drawn]
        own = [ids[k] for k in new]
        made = sample([asked[k] for k in new], [frames[k] for k in new], seed, ids=own, progress=progress) if new else []
        drawn.update(zip(own, made, strict=True))
        return [drawn[number] for number in ids]

    model.sample = once
    seconds = [len(x) / layout.fps for x in true]
    rows = []
    for attempts in range(MOST_ATTEMPTS + 1):
        name = f"{of}, {attempts} attempt" + "s" * (attempts > 1) if attempts else f"{of}, people"
        if attempts:
            motions = mw.generate(texts, seconds, run=model, attempts=attempts)
            which = [_attempt(drawn, i, motion, layout) for i, motion in enumerate(motions)]
            features = [drawn[MOST * i + AGAIN * attempt] for i, attempt in enumerate(which)]
        else:
            features, motions, which = true, [motion_of(x, layout) for x in true], [0] * len(true)
        found, plain = judge.embed_motions(features), [motion_of(x, layout) for x in features]
        lengths = [bone_lengths(motion.positions, motion.skeleton) for motion in motions]
        later = float(np.mean(np.array(which) > 0))
        row: dict[str, Any] = {"motions": name, "clips": len(test), "from a later attempt": later}
        row |= seen(motions, test)
        row |= {f"{name}, places alone": value for name, value in seen(plain, test).items() if name == "waves right"}
        scores = set_scores(words, found, real, 32, 0)
        row |= {"FID": abs(round(scores["fid"], 6)), "R-precision top 1": scores["top1"], "MM-Dist": mm_dist(words, found)}
        row |= {"swing of waving arms (m)": np.mean([swing(m) for m, is_wave in zip(motions, waves, strict=True) if is_wave])}
        row |= {
            "bones, largest less smallest (%)": round(100 * np.mean([(np.ptp(x, axis=0) / x.mean(0)).max() for x in lengths]), 3)
        }
        rows.append(row | {"jerk, places alone (m/s³)": np.mean([movement(x, layout)["jerk"] for x in features])})
    return rows


def _attempt(drawn: dict[int, torch.Tensor], i: int, motion: Motion, layout: FeatureLayout) -> int:
    """At which attempt a motion came."""
    tried = {n: drawn[number] for n in range(MOST_ATTEMPTS) if (number := MOST * i + AGAIN * n) in drawn}
    return next(n for n, x in tried.items() if np.array_equal(motion_of(x, layout, fused=True).positions, motion.positions))


def by_length() -> list[dict[str, Any]]:
    """For each length the share of motions, by action, that show what their sentence says, and nothing besides."""
    model, rng = mw.load_run("sentences"), np.random.default_rng(7)
    said = {a: [captions_of(completed({"action": a}, rng), rng)[0] for _ in range(SENTENCES)] for a in RECIPES if a != "backward"}
    texts = [text for sentences in said.values() for text in sentences]
    wanted = [{"then": None} | {name: value for name, value in claims(text).items() if name in CLAIMS} for text in texts]
    rows = []
    for seconds, attempts in ((2.0, 1), (3.0, 1), (4.0, 1), (5.0, 1), (6.0, 1), (None, 1), (None, 3)):
        motions = mw.generate(texts, seconds, EACH, run=model, attempts=attempts)
        seen = [measured_attributes(motion.positions, motion.fps) for motion in motions]
        right = [all(seen[k].get(name) == value for name, value in wanted[k // EACH].items()) for k in range(len(seen))]
        shares = dict(zip(said, np.reshape(right, (len(said), -1)).mean(axis=1), strict=True))
        name = (f"{seconds:g} s" if seconds else "as people take") + ", three attempts" * (attempts > 1)
        rows.append({"time": name, "all": np.mean(right)} | shares)
    return rows


def main() -> None:
    """Write the tables."""
    torch.set_num_threads(1)
    lengths = by_length()
    rows = [row for of, changes in SETS.items() for row in measured(of, changes)]
    about = {
        "data": "people", "model": "sentences, as it comes with the package", "judge": "evaluator", "seed": 0,
        "mwlib": mw.__version__, "command": "python benchmarks/attempts.py figures/synthetic",
    }  # fmt: skip
    out = Path(sys.argv[1])
    write_together(
        {
            out / "attempts.csv": as_csv(rows),
            out / "lengths.csv": as_csv(lengths),
            out / "attempts.json": json.dumps(about, indent=1),
        }
    )


if __name__ == "__main__":
    main()
