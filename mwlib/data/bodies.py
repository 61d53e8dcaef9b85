"""What all clips of one training share: skeleton, frame rate, up-axis. New motions are made to fit it, or refused."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass

from mwlib.body.correspondence import to_h36m17
from mwlib.body.motion import Motion
from mwlib.body.skeleton import H36M17, Skeleton


@dataclass(frozen=True)
class Bodies:
    """The form in which a model takes motions.

    Args:
        skeleton: of every clip.
        fps: frames per second.
        up: the up-axis.
    """

    skeleton: Skeleton
    fps: float
    up: str

    @classmethod
    def of(cls, motions: Sequence[Motion]) -> Bodies:
        """What these clips share.

        Raises:
            ValueError: there are none, or they differ; the message names two clips that do.
        """
        if not motions:
            raise ValueError("there are no motions")
        first = motions[0]
        for m in motions:
            for what in ("skeleton", "fps", "up"):
                if getattr(m, what) != getattr(first, what):
                    found, other = (_said(getattr(clip, what)) for clip in (m, first))
                    names = m.name or "a clip", first.name or "another"
                    raise ValueError(f"{names[0]} has {what} {found}, {names[1]} has {other}; expected one and the same")
        return cls(first.skeleton, first.fps, first.up)

    def prepare(self, motions: Sequence[Motion]) -> list[Motion]:
        """Clips turned, carried over to the skeleton and resampled, as those were that the model was trained on.

        Raises:
            ValueError: a clip has another skeleton, and no way to this one is known.
        """
        return [self._fitted(m.with_up(self.up)).resample(self.fps) for m in motions]

    def _fitted(self, motion: Motion) -> Motion:
        if motion.skeleton == self.skeleton:
            return motion
        if self.skeleton == H36M17 and to_h36m17(motion.skeleton) is not None:
            return motion.retarget(H36M17)
        name = f"{motion.name}: " if motion.name else ""
        raise ValueError(
            f"{name}the skeleton is {_said(motion.skeleton)}; the model was trained on {_said(self.skeleton)}, and no way from "
            "one to the other is known"
        )

    def to_json(self) -> str:
        """As text that a model file carries."""
        return json.dumps({"skeleton": asdict(self.skeleton), "fps": self.fps, "up": self.up})

    @classmethod
    def from_json(cls, text: str) -> Bodies:
        """Inverse of `to_json`."""
        tree = json.loads(text)
        skeleton = tree["skeleton"]
        parts = {name: tuple(joints) for name, joints in skeleton["parts"].items()}
        rows = {name: tuple(skeleton[name]) for name in ("joints", "parents", "left", "right")}
        return cls(Skeleton(name=skeleton["name"], parts=parts, **rows), tree["fps"], tree["up"])


def prepare(motions: Sequence[Motion], fps: float) -> list[Motion]:
    """Clips as a training takes them: z up, on the 17-joint skeleton wherever a correspondence is known, then at `fps`."""
    ready = [m.with_up("z") for m in motions]
    return [(m if to_h36m17(m.skeleton) is None else m.retarget(H36M17)).resample(fps) for m in ready]


def _said(value: object) -> str:
    """A value in a message; of a skeleton its name and number of joints."""
    return f"{value.name} ({len(value)} joints)" if isinstance(value, Skeleton) else str(value)
