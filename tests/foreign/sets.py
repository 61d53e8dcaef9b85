"""Small sets of motions that differ from the embedded ones in everything a chapter might rely on."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from mwlib.body.motion import Motion
from mwlib.body.skeleton import HUMANML22
from mwlib.data.formats.bvh import write_bvh
from mwlib.data.formats.h36m import write_h36m
from mwlib.synthetic.acts import captioned_positions
from mwlib.synthetic.motions import synthetic_motions

SEED = 20  # other people than the embedded ones
FINGERS = 4  # joints of each finger


def few(folder: Path) -> None:
    """Three clips by three people, BVH at 30 Hz, 22 joints with names of their own."""
    people = [clip for clip in captioned_positions(9, SEED) if len(clip.positions) > 90][:3]
    clips = [Motion(clip.positions, 20.0, HUMANML22, up="y").resample(30.0) for clip in people]
    for clip, person in zip(clips, ("Ann", "Ben", "Cleo"), strict=True):
        write_bvh(clip, folder / f"{person.lower()}.bvh")
    _clips_table(folder, [(f"{person.lower()}.bvh", person, "") for person in ("Ann", "Ben", "Cleo")])


def one(folder: Path) -> None:
    """One clip by one person, BVH at 60 Hz, 40 seconds."""
    write_bvh(synthetic_motions(1, 40.0, SEED)[-1].resample(60.0), folder / "recording.bvh")


def two_skeletons(folder: Path) -> None:
    """Four people, two of 17 joints and two of 22, some in BVH."""
    small = [clip for clip in synthetic_motions(2, 5.0, SEED) if clip.action in ("walk", "wave")]
    for clip in small:
        write_bvh(clip, folder / f"{clip.name}.bvh")
    large = [clip for clip in captioned_positions(5, SEED) if len(clip.positions) > 70][:2]
    for clip in large:
        write_bvh(Motion(clip.positions, 20.0, HUMANML22, up="y"), folder / f"{clip.name}.bvh")
    _clips_table(
        folder, [(f"{c.name}.bvh", c.subject, c.action) for c in small] + [(f"{c.name}.bvh", c.name[:2], "") for c in large]
    )


def five(folder: Path) -> None:
    """Five joints, no left and right, an array at 25 Hz; one person, two clips."""
    joints = ("hip", "spine", "head", "right_knee", "right_foot")
    about = {
        "name": "five",
        "joints": ["base", "middle", "top", "bend", "tip"],
        "parents": [-1, 0, 1, 0, 3],
        "fps": 25,
        "unit": "m",
        "up": "z",
    }
    (folder / "skeleton.json").write_text(json.dumps(about))
    for clip in synthetic_motions(1, 8.0, SEED)[:2]:
        chosen = [clip.skeleton.joints.index(joint) for joint in joints]
        np.save(folder / f"{clip.action}.npy", clip.resample(25.0).positions[:, chosen])


def hands(folder: Path) -> None:
    """65 joints, with fingers, arrays at 100 Hz; two people."""
    clips = [clip for clip in synthetic_motions(2, 5.0, SEED) if clip.action in ("walk", "direct", "box")]
    skeleton = clips[0].skeleton
    names, parents = [*skeleton.joints], [*skeleton.parents]
    wrists = [skeleton.joints.index(name) for name in ("left_wrist", "right_wrist")]
    offsets = []
    for side, wrist in zip(("left", "right"), wrists, strict=True):
        for finger in range(6):
            for bone in range(FINGERS):
                parents.append(wrist if bone == 0 else len(names) - 1)
                names.append(f"{side}_finger_{finger}_{bone}")
                offsets.append((wrist, np.array([0.01 * (finger - 2.5), 0.02 * (bone + 1), 0.0])))
    pairs = [(i, names.index(n.replace("left", "right"))) for i, n in enumerate(names) if n.startswith("left")]
    left, right = zip(*pairs, strict=True)
    about = {
        "name": "hands",
        "joints": names,
        "parents": parents,
        "left": left,
        "right": right,
        "fps": 100,
        "unit": "m",
        "up": "z",
    }
    (folder / "skeleton.json").write_text(json.dumps(about))
    for clip in clips:
        body = clip.resample(100.0).positions
        tips = np.stack([body[:, wrist] + offset for wrist, offset in offsets], axis=1)
        np.save(folder / f"{clip.name}.npy", np.concatenate([body, tips], axis=1))
    _clips_table(folder, [(f"{clip.name}.npy", clip.subject, clip.action) for clip in clips])


def rates(folder: Path) -> None:
    """One person at 10 Hz, one at 24, one at 240; BVH in metres."""
    clips = [clip for clip in synthetic_motions(3, 6.0, SEED) if clip.action in ("walk", "stop_and_go")]
    for clip in clips:
        fps = {"P1": 10.0, "P2": 24.0, "P3": 240.0}[clip.subject]
        write_bvh(clip.resample(fps), folder / f"{clip.name}.bvh", unit="m")
    _clips_table(folder, [(f"{clip.name}.bvh", clip.subject, clip.action) for clip in clips])


def still(folder: Path) -> None:
    """People who hold a pose or lie, one clip of two seconds and one of a minute; joints that never move."""
    walk = synthetic_motions(2, 6.4, SEED)
    standing = walk[0].positions[:1]
    lying = (standing - standing[:, :1])[..., [2, 1, 0]] + np.array([0.0, 0.0, 0.1])
    poses = {"P1_stand": (standing, 1500), "P1_lie": (lying, 300), "P2_stand": (standing * 1.02, 100), "P2_sway": (standing, 400)}
    for name, (pose, frames) in poses.items():
        clip = np.repeat(pose, frames, axis=0)
        if name == "P2_sway":
            clip[:, 8:] += 0.02 * np.sin(np.arange(frames) / 10.0)[:, None, None]
        np.savez(folder / f"{name}.npz", positions=clip, fps=25.0, skeleton="H36M17", unit="m", up="z", subject=name[:2])


def archive(folder: Path) -> None:
    """The Human3.6M layout, 50 Hz, 32 joints, of which 17 are read; three people."""
    write_h36m(folder / "data_3d_h36m.npz", [c for c in synthetic_motions(3, 5.0, SEED) if c.action in ("walk", "sit", "kick")])


SETS: dict[str, Callable[[Path], None]] = {
    make.__name__: make for make in (few, one, two_skeletons, five, hands, rates, still, archive)
}


def make_sets(folder: Path, names: Sequence[str] = tuple(SETS)) -> dict[str, Path]:
    """Each named set in a folder of its own, made where it is missing; name -> folder."""
    for name in names:
        if not (folder / name).is_dir():
            unfinished = folder / f".{name}"
            unfinished.mkdir(parents=True, exist_ok=True)
            SETS[name](unfinished)
            unfinished.rename(folder / name)
    return {name: folder / name for name in names}


def _clips_table(folder: Path, rows: Sequence[tuple[str, str, str]]) -> None:
    with (folder / "clips.csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([("file", "subject", "action"), *rows])
