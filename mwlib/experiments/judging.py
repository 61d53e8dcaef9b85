"""Any model of sentences, opened and judged: replicates in files of their own, means with 95 % intervals."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TypeVar

import torch
from tqdm import tqdm

from mwlib.data.captioned import Parts, load_clips
from mwlib.data.formats.humanml import HUMANML3D
from mwlib.experiments.results import read_tree
from mwlib.experiments.sampling import model_of
from mwlib.files import write_json
from mwlib.hashing import code_behind, digest
from mwlib.matching.evaluators import CHECKPOINTS, GLOVE, Matcher, open_matcher
from mwlib.metrics.text import confidence
from mwlib.text_to_motion import judging
from mwlib.text_to_motion.config import Config
from mwlib.text_to_motion.judging import Once, Protocol, Scores, deviations, scores
from mwlib.text_to_motion.model import TextToMotion, make_text
from mwlib.text_to_motion.released import CODES, open_released

APART = 1000  # seeds from one replicate to the next
WITH_PACKAGE = ("people", "cmu")  # data whose judges come along
NO_JUDGE = f"no evaluator is named; expected a folder with the files of the published one ({CHECKPOINTS}; {GLOVE})"
Opened = TypeVar("Opened")


def open_all(name: str, data: str, evaluator: str, clip_folder: str) -> tuple[TextToMotion, Parts, Matcher]:
    """A model, the clips that it is judged on, and its judge; on a GPU, where there is one.

    Args:
        name: of a run, as `load_run` takes it, or the file of a released model, see `open_released`.
        data: as in `CaptionsConfig`; "": those that the model was trained on.
        evaluator: as `open_matcher` takes it; "": that of the model's settings, or of the data that come with the package.
        clip_folder: of CLIP, for a released model.

    Raises:
        FileNotFoundError: one message of all that is missing, and where people get it.
        ValueError, MotionFormatError: as `open_released`, `load_run`, `load_clips` and `open_matcher`.
    """
    missing: list[str] = []

    def tried(opening: Callable[[], Opened], where: str = "") -> Opened | None:
        """What is opened; None, and one line more of what is missing, where a file or package is."""
        try:
            return opening()
        except (FileNotFoundError, ImportError) as error:
            missing.append(f"{error}{where}")
            return None

    if Path(name).suffix in CODES:
        if not Path(name).is_file():  # which asks for CLIP as it is opened
            tried(lambda: make_text(Config.preset("mdm", clip_folder=clip_folder).model, ()))
        model = tried(lambda: open_released(name, data, clip_folder))
    else:
        model = tried(lambda: model_of(name, TextToMotion, "text_to_motion"))
    cfg = model.cfg if model else Config.preset("mdm")
    chosen, own = replace(cfg.data, data=data or cfg.data.data), evaluator or cfg.sampling.evaluator
    parts = tried(lambda: load_clips(chosen), "; `mwlib fetch humanml3d` says how people get HumanML3D")
    judge, published = None, f"; the published one: {CHECKPOINTS}; {GLOVE}"
    if own and (evaluator or own != "evaluator" or chosen.data in WITH_PACKAGE):
        judge = tried(lambda: open_matcher(own, parts.layout if parts else HUMANML3D), published)
    else:
        missing.append(NO_JUDGE)
    if model is None or parts is None or judge is None:
        raise FileNotFoundError("to judge this, some things are missing:\n  " + "\n  ".join(dict.fromkeys(missing)))
    device = "cuda" if torch.cuda.is_available() else "cpu"
    return model.to(device), parts, judge.to(device)


def replicates(
    opened: tuple[TextToMotion, Parts, Matcher],
    how: Protocol,
    count: int,
    seed: int,
    out: Path,
    compare: bool = False,
    progress: bool = False,
) -> tuple[Path, list[dict[str, Scores]]]:
    """Scores of so many replicates, and the folder with a file of each; those that are there are not made again.

    Args:
        opened: what `open_all` gives.
        how: the protocol.
        count: of replicates.
        seed: of the first; the others are 1000 apart.
        out: gets a folder whose name holds a hash of model, clips, judge, protocol, seed and code.
        compare: score each of `deviations`, too, on the same captions and noise.
        progress: show bars.

    Returns:
        By row, as `scores` names them, and the names of the deviations.
    """
    model, parts, judge = opened
    behind = [
        judging.fingerprint([model.net], model.statistics), model.cfg.hash(), parts.fingerprints()[1],
        judging.fingerprint([judge.network, judge.movement], judge.statistics), [*judge.vocabulary.words],
        asdict(how), seed, compare, code_behind(judging.__name__),
    ]  # fmt: skip
    folder, found = out / digest(behind), []
    others = deviations(how, min(model.lengths[1], judge.window or model.lengths[1]), len(parts.test)) if compare else {}
    for number in tqdm(range(count), "replicates", disable=not progress):
        file = folder / f"replicate_{number:02}.json"
        if not (rows := read_tree(file, scores=dict).get("scores")):
            make = Once(model, seed + APART * number, progress)
            rows = scores(make, judge, parts.test, how)
            rows |= {name: scores(make, judge, parts.test, replace(how, **changes))["model"] for name, changes in others.items()}
            write_json(file, {"seed": make.seed, "protocol": asdict(how), "scores": rows})
        found.append(rows)
    return folder, found


def with_intervals(
    rows: Sequence[Mapping[str, float]], less: Sequence[Mapping[str, float]] = ()
) -> dict[str, tuple[float, float | None]]:
    """By metric, mean and half the width of a 95 % interval over replicates (see `confidence`), which one alone has not.

    Args:
        rows: of one model, one for each replicate.
        less: of another one, in the same order: subtracted first.
    """
    found = {}
    for name in rows[0]:
        values = [row[name] - (less[i][name] if less else 0.0) for i, row in enumerate(rows)]
        found[name] = sum(values) / len(values), float(confidence(values)) if len(values) > 1 else None
    return found
