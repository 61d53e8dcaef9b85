"""In-betweens of two poses by a model that is named."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from mwlib.body.motion import Motion
from mwlib.experiments.runs import load_run
from mwlib.inbetweening.bridge import Bridge
from mwlib.inbetweening.motions import filled

SHIPPED = "inbetween"  # the model that comes with the package


def inbetween(
    start: Motion,
    end: Motion | Sequence[int],
    frames: int | None = None,
    samples: int = 1,
    seed: int = 0,
    run: str | Path | Bridge = SHIPPED,
    progress: bool = False,
) -> list[Motion]:
    """Motions that leave one pose and arrive at another.

    Args:
        start: its last frame is the first keyframe; or, with numbers for `end`, the motion whose frames they are.
        end: its first frame is the last keyframe; or numbers of two or more frames of `start`, at the model's rate.
        frames: frames between, at the model's rate; None: the model's own number, or as many as lie between the numbers.
        samples: how many motions.
        seed: of their noise.
        run: folder of a finished run of in-betweening, a name that `load_run` knows, or its model.
        progress: show a bar.

    Returns:
        `samples` motions of `frames` + 2 frames at the model's rate, the keyframes among them; and before these the past, of a
        model that is given one.

    Raises:
        FileNotFoundError: there is no such run.
        ValueError: it is one of another system, or bodies, length or keyframes do not fit it.

    >>> walk = mw.load_motions("synthetic", fps=30.0)[0]
    >>> [motion] = inbetween(walk.cut(0, 1), walk.cut(31, 32), frames=30)
    >>> motion.positions.shape, motion.fps, np.allclose(motion.positions[0], walk.positions[0], atol=1e-5)
    ((32, 17, 3), 30.0, True)
    """
    bridge = run if isinstance(run, Bridge) else load_run(run)
    if not isinstance(bridge, Bridge):
        raise ValueError(f"{run} is a run of another system; expected one of in-betweening")
    return filled(bridge, start, end, frames, samples, seed, progress)
