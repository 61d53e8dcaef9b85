"""Configurations of in-betweening that train in a second, and motions for them: places alone, rigs like LaFAN1's, its clips."""

from __future__ import annotations

from functools import cache

import numpy as np
import torch
from scipy.spatial.transform import Rotation
from torch import nn

from mwlib.body.motion import Motion
from mwlib.body.rig import ANGLES, MOVES, Rig
from mwlib.body.rotation import continuous, euler_quaternions
from mwlib.body.skeleton import Skeleton
from mwlib.data.collections.lafan1 import LAFAN1
from mwlib.data.sources import Split
from mwlib.data.windows import prepare
from mwlib.inbetweening.bridge import Bridge
from mwlib.inbetweening.config import Config
from mwlib.inbetweening.objective import InbetweeningObjective, make_network
from mwlib.inbetweening.representation import Representation
from mwlib.inbetweening.space import Space
from mwlib.inbetweening.windows import Clips, make_space, ready
from mwlib.synthetic.motions import synthetic_motions

SMALL = dict(
    fps=10.0, between=6, shortest=0, state="positions", mirror=False, test_stride=8, test_windows=0,
    tokens="cosines", rows=0, target="departure", condition_on_keyframes=True, output="direct", prediction="y0", more_keyframes=0,
    width=16, layers=2, heads=2, feedforward=16, dropout=0.1, attention_dropout=0.0, steps=50,
    level_weight="snr", diversity_weight=0.0, smoothness_weight=0.0, length_weight=0.0, angle_weight=0.0, contact_weight=0.0,
    train_steps=6, batch=4, checkpoint_every=3, ema=0.9, ema_start=2, warmup=0, lr=1e-3, lr_schedule="constant", seed=0,
    samples=2, ddim_steps=5, temperature=1.0, spacing="leading", scheme="none", method="diffusion", sampling_seed=0,
)  # fmt: skip
PAPER = dict(target="motion", condition_on_keyframes=False, prediction="eps", level_weight="uniform", scheme="replacement")

WINDOW = dict(
    past=2, future=2, coast=3.0, hide=0.4, departure_scale="window", tokens="sines", output="wiener", level_weight="unit",
)  # fmt: skip


def small(**changes) -> Config:
    """The tiny preset, made smaller; everything that the tests depend on is said here."""
    return Config.preset("tiny", **{**SMALL, **changes})


# LaFAN1's bones, metres: along the joints' own x, left and right mirrored along z.
SIDE = {"UpLeg": (0.001, 0.018, 0.11), "Shoulder": (0.19, -0.015, 0.063)}
BONES = {
    "Leg": 0.435, "Foot": 0.424, "Toe": 0.173, "Arm": 0.113, "ForeArm": 0.33, "Hand": 0.252, "Spine": 0.069, "Spine1": 0.126,
    "Spine2": 0.123, "Neck": 0.258, "Head": 0.118,
}  # fmt: skip


def lafan_offsets(size: float = 1.0) -> np.ndarray:
    """From parent to joint in the parent's frame."""
    rows = [(0.0, 0.0, 0.0)]
    for name in LAFAN1.joints[1:]:
        part, sign = name.removeprefix("Left").removeprefix("Right"), -1 if name.startswith("Right") else 1
        x, y, z = SIDE.get(part, (BONES.get(part, 0.0), 0.0, 0.0))
        rows.append((x, y, sign * z))
    return size * np.array(rows)


def lafan_motion(frames: int = 40, seed: int = 0, fps: float = 10.0, up: str = "z", subject: str = "A", size: float = 1.0):
    """Smooth random rotations of such a body, which walks a random way."""
    rng = np.random.default_rng(seed)
    steps = rng.normal(0, 0.15, (frames, 22, 3))
    angles = np.cumsum(steps, axis=0) + rng.normal(0, 0.4, (22, 3))
    angles[:, 0] = np.cumsum(0.5 * steps[:, 0], axis=0) + [rng.uniform(-3, 3), 0.2, 1.6]
    turns = continuous(torch.from_numpy(euler_quaternions("zyx", angles))).numpy().astype(np.float32)
    root = np.cumsum(rng.normal(0, 0.04, (frames, 3)), axis=0) + rng.normal(0, 2, 3)
    rig = Rig(LAFAN1, lafan_offsets(size), turns, root, tuple(range(22)), (MOVES + ANGLES, *[ANGLES] * 21))
    name = f"{subject}{seed}"
    return Motion(rig.positions().astype(np.float32), fps, LAFAN1, subject=subject, name=name, up=up, rig=rig)


@cache
def people() -> Split:
    """Synthetic people at 10 Hz, places alone: one to train on, one for the validation loss, one for the test."""
    motions = prepare(synthetic_motions(subjects=3, seconds=3.0), 10.0)
    return Split(motions[:12], motions[12:24], motions[24:])


@cache
def dancers() -> Split:
    """Bodies with rotations, of two sizes."""
    parts = ([0, 1, 2], [3], [4, 5])
    made = ([lafan_motion(seed=s, subject="ABC"[i], size=1 + 0.1 * (s % 2)) for s in p] for i, p in enumerate(parts))
    return Split(*(ready(part, 10.0) for part in made))


def data_of(cfg: Config) -> Split:
    """What a configuration of either state trains on."""
    return dancers() if cfg.task.state == "rotations" else people()


@cache
def _learnt(cfg: Config) -> dict[str, torch.Tensor]:
    return InbetweeningObjective(cfg, data_of(cfg)).learnt()


def objective(**changes) -> InbetweeningObjective:
    """What trains with these settings."""
    cfg = small(**changes)
    return InbetweeningObjective(cfg, data_of(cfg), _learnt(cfg))


def shaken(network: nn.Module, std: float = 0.1) -> nn.Module:
    """Random weights also where a training starts from zero."""
    generator = torch.Generator().manual_seed(0)
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.normal_(std=std, generator=generator)
    return network


@cache
def _fitted(cfg: Config) -> tuple[Representation, Space]:
    space = make_space(data_of(cfg).train, cfg.task.state)
    return Representation.fit(cfg, Clips(data_of(cfg).train, space).windows(cfg.task.frames, 3, cfg.task.past).x), space


def untrained(**changes) -> Bridge:
    """A bridge that does something without a training."""
    cfg = small(**changes)
    representation, space = _fitted(cfg)
    return Bridge(shaken(make_network(representation)), representation, space, cfg)


def windows_for(bridge: Bridge, frames: int | None = None):
    """Windows of people whom it has not seen."""
    clips = Clips(data_of(bridge.cfg).test, bridge.space)
    return clips.windows(frames or bridge.cfg.task.frames, bridge.cfg.task.test_stride, bridge.cfg.task.past)


# From each joint's parent, metres, y up, facing z; then turned so that, as in LaFAN1, the hips' x points up and their y ahead.
STANDING = np.array([
    [0, 0.9, 0], [0.1, 0, 0], [0, -0.43, 0], [0, -0.42, 0], [0, -0.05, 0.15], [-0.1, 0, 0], [0, -0.43, 0], [0, -0.42, 0],
    [0, -0.05, 0.15], [0, 0.07, 0], [0, 0.12, 0], [0, 0.12, 0], [0, 0.25, 0], [0, 0.12, 0], [0.06, 0.19, 0], [0.11, 0, 0],
    [0.33, 0, 0], [0.25, 0, 0], [-0.06, 0.19, 0], [-0.11, 0, 0], [-0.33, 0, 0], [-0.25, 0, 0],
])  # fmt: skip
HIPS = Rotation.from_matrix(np.array([[0, 0, 1.0], [1, 0, 0], [0, 1, 0]]))
ENDS = (4, 8, 13, 17, 21)
TREE = Skeleton(
    "rig",
    (*LAFAN1.joints, *(f"{LAFAN1.joints[joint]}/End" for joint in ENDS)),
    (*LAFAN1.parents, *ENDS),
)

# A model for the benchmark: settings beside those of `sample.small`.
TASK = dict(
    fps=30.0, state="rotations", past=10, between=45, shortest=5, tokens="sines", rows=16, coast=8.0, departure_scale="each",
    train_subjects=("1", "2", "4"), test_subjects=("5",), validation_subjects=(),
)  # fmt: skip


def clip(name: str, subject: str, frames: int, size: float = 1.0) -> Motion:
    """A body of this size that wanders about and waves its limbs; every clip moves in its own way."""
    rng = np.random.default_rng([frames, int(1000 * size), *name.encode()])
    offsets = np.concatenate([HIPS.inv().apply(STANDING) * size, np.full((len(ENDS), 3), 0.05)])
    waves = 0.25 * rng.normal(size=(4, 22, 3)) / (1 + np.arange(4))[:, None, None]
    phase = rng.uniform(0, 2 * np.pi, (4, 22, 3))
    t = np.arange(frames)[:, None, None, None] / 30
    bends = (waves * np.sin((1 + np.arange(4))[:, None, None] * 2 * t + phase)).sum(1)  # (frames, 22, 3) radians
    turns = Rotation.from_rotvec(bends.reshape(-1, 3)).as_quat().reshape(frames, 22, 4)
    heading = Rotation.from_rotvec(np.outer(rng.uniform(0, 6) + rng.normal() * t.ravel(), [0, 1.0, 0]))
    turns[:, 0] = (heading * Rotation.from_quat(turns[:, 0]) * HIPS).as_quat()
    rotations = np.tile([1.0, 0, 0, 0], (frames, len(TREE), 1))
    rotations[:, :22] = np.roll(turns, 1, axis=-1)
    against = np.sum(rotations[1:] * rotations[:-1], axis=-1, keepdims=True) < 0
    rotations[1:] *= np.cumprod(np.where(against, -1, 1), axis=0)
    root = np.cumsum(rng.normal(size=2) * 0.02 + 0.01 * np.sin(t[..., 0, 0] + [0, 1]), axis=0) + 3 * rng.normal(size=2)
    height = size * (0.9 + 0.03 * np.sin(5 * t.ravel()))
    path = np.stack([root[:, 0], height, root[:, 1]], axis=-1)
    channels = (MOVES + ANGLES, *[ANGLES] * 21, *[None] * len(ENDS))
    rig = Rig(TREE, offsets, rotations, path, tuple(range(22)), channels)
    positions = rig.positions().astype(np.float32)
    return Motion(positions, 30.0, LAFAN1, subject, "walk", name, up="y", rig=rig)


def small_set() -> list[Motion]:
    """Five clips, the first of them with the body that the benchmark uses for all; 2 + 4 training and 2 + 2 test windows."""
    return [
        clip("aiming1_subject1", "1", 90),
        clip("dance1_subject2", "2", 111, size=1.05),
        clip("walk1_subject5", "5", 145, size=1.1),  # a third window would end with the last frame
        clip("walk2_subject5", "5", 110, size=0.95),
        clip("walk3_subject4", "4", 50),  # no window
    ]
