"""The bodies that each system would train on, found by letting the systems make their data ready."""

import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from mwlib.body.motion import Motion
from mwlib.data.captioned import CMU_FOLDER
from mwlib.data.check import is_captioned
from mwlib.data.collections import named_source
from mwlib.data.formats.humanml import has_lists
from mwlib.data.load import data_folder, find_source
from mwlib.data.sources import Split
from mwlib.inbetweening import system as inbetweening
from mwlib.inbetweening.windows import make_space
from mwlib.prediction import system as prediction
from mwlib.text_to_motion import system as text_to_motion


def outlook(source: str | Path, motions: Sequence[Motion], fps: float | None = None) -> list[str]:
    """A line for each system on what its training makes of these data, or why it refuses them.

    What is said comes from the functions with which the systems load their data and encode it, at their default settings. Of
    a folder laid out as HumanML3D or KIT-ML only text to motion speaks, unless a rate is given.

    Args:
        source: as in `load_motions`.
        motions: what was read from it, at their own rates.
        fps: of training; None: each system's default.
    """
    rate = {} if fps is None else {"fps": fps}

    def predicted() -> str:
        """What prediction makes of the data."""
        cfg = prediction.Config().override(data=str(source), **rate)
        split, frames = prediction.load_data(cfg, motions), cfg.windows.frames
        return _carried(motions, Split(*([m for m in part if len(m) > frames] for part in split)))

    def between(state: str) -> str:
        """What in-betweening makes of them."""
        cfg = inbetweening.Config().override(data=str(source), state=state, **rate)
        split = inbetweening.load_data(cfg, motions)
        space = make_space(split.train, state)
        for motion in (m for part in split for m in part):
            space.encode(motion)
        return _carried(motions, split)

    lines = []
    place, _ = named_source(source)
    if motions and (fps is not None or place == "synthetic" or not is_captioned(find_source(place))):
        lines = [f"prediction: {_or_refused(predicted)}"]
        lines += [f"in-betweening, {state}: {_or_refused(between, state)}" for state in ("positions", "rotations")]
    return [*lines, f"text to motion: {_or_refused(_captioned, source)}"]


def _or_refused(say: Callable[..., str], *given: Any) -> str:
    with warnings.catch_warnings(action="ignore"):  # the report has said it
        try:
            return say(*given)
        except (ValueError, OSError) as error:
            return f"refused: {error}"


def _carried(motions: Sequence[Motion], split: Split) -> str:
    """How bodies and rates change from files to training, and how many clips are left for what."""
    after = split.train[0]
    before, rates = (sorted({*found}) for found in ((len(m.skeleton) for m in motions), (m.fps for m in motions)))
    kept = all(m.skeleton == after.skeleton for m in motions)
    joints = f"{_and(before)} joints {'kept' if kept else f'carried to {len(after.skeleton)}'}"
    counts = f"{len(split.train)} clips to train on, {len(split.test)} to test on"
    return f"{joints}, {_and(rates)} Hz {'kept' if rates == [after.fps] else f'→ {after.fps:g} Hz'}; {counts}"


def _and(numbers: Sequence[float]) -> str:
    *first, last = (f"{number:g}" for number in numbers)
    return " and ".join([", ".join(first), last] if first else [last])


def _captioned(source: str | Path) -> str:
    source, _ = named_source(source)
    if source == "synthetic":
        return "its built-in people have captions (data=people)"
    path = find_source(source)
    if path.is_dir() and has_lists(path):
        parts = text_to_motion.load_data(text_to_motion.Config().override(data=str(source)))
        return f"{parts.layout.name}, {len(parts.train)} clips to train on, {len(parts.test)} to test on"
    if path.resolve() == (data_folder() / CMU_FOLDER).resolve():
        return "CMU's clips have captions (data=cmu)"
    return "needs captions, as a folder laid out as HumanML3D or KIT has them: none found"
