"""A folder of HumanML3D and one of its published evaluator, both made up: the same files, narrow networks, a few words."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from scipy.ndimage import gaussian_filter1d

from mwlib.data.captioned import Parts, load_clips
from mwlib.networks.matching import MotionEncoder, MovementEncoder, SentenceEncoder
from mwlib.text_to_motion.config import Config
from tests.text_to_motion.sample import small

WORDS = "unk sos eos a the man walk left hand chair slowly kick to and then turn".split()
ROWS = np.random.default_rng(5).permutation(len(WORDS) + 3)[: len(WORDS)]  # some vectors belong to no word
TEXTS = (
    "a man walks left#a/DET man/NOUN walk/VERB left/ADV#0.0#0.0\n"
    "the man, then turns#the/DET man/NOUN then/ADV turn/VERB#0.0#0.0\n",
    "an elephant kicks#an/DET elephant/NOUN kick/VERB#nan#nan\n",
    "a very long walk#" + "a/DET man/NOUN walk/VERB slowly/ADV and/CCONJ " * 5 + "to/ADP the/DET chair/NOUN#0.0#0.0\n",
)


class Published(NamedTuple):
    """What the files hold."""

    folder: Path
    text: SentenceEncoder
    motion: MotionEncoder
    movement: MovementEncoder
    mean: np.ndarray
    deviation: np.ndarray
    vectors: np.ndarray


def features(seed: int, frames: int, width: int = 263) -> np.ndarray:
    """Smooth numbers, and contacts that are 0 or 1."""
    rng = np.random.default_rng(seed)
    x = gaussian_filter1d(rng.normal(size=(frames, width)), 2.0, axis=0) + 0.3 * np.sin(np.arange(width)) + 0.2 * (seed % 3)
    x[:, -4:] = x[:, -4:] > 0
    return x.astype(np.float32)


def write_collection(folder: Path) -> Path:
    """Six clips to train on, six to test on, of 40 to 51 frames."""
    for name in ("new_joint_vecs", "texts"):
        (folder / name).mkdir(parents=True)
    for split, first in (("train", 0), ("test", 6)):
        names = [f"{number:06d}" for number in range(first, first + 6)]
        (folder / f"{split}.txt").write_text("\n".join(names))
        for number, name in enumerate(names, first):
            np.save(folder / "new_joint_vecs" / f"{name}.npy", features(number, 40 + number))
            (folder / "texts" / f"{name}.txt").write_text(TEXTS[number % 3])
    return folder


def write_evaluator(folder: Path, width: int = 263) -> Published:
    """The files of the published evaluator, where its authors' archives have them; KIT-ML has a width of 251."""
    torch.manual_seed(3)
    networks = SentenceEncoder(6, 10, 7, parts_of_speech=15), MotionEncoder(8, 9, 7), MovementEncoder(width, 12, 8)
    for parameter in (p for network in networks for p in network.eval().parameters()):
        torch.nn.init.normal_(parameter, std=0.4)
    names = ("text_encoder", "motion_encoder", "movement_encoder")
    states = {name: network.state_dict() for name, network in zip(names, networks, strict=True)}
    (folder / "text_mot_match" / "model").mkdir(parents=True)
    torch.save(states | {"epoch": 270, "opt_text_encoder": {"state": {}}}, folder / "text_mot_match" / "model" / "finest.tar")
    frames = np.concatenate([features(number, 60, width) for number in range(6)])
    mean, deviation = frames.mean(0), frames.std(0)
    deviation[-4:] = deviation[-4:].mean() / 25  # the other weighed features are random anyway
    vectors = np.random.default_rng(4).normal(size=(len(WORDS) + 3, 6))
    arrays = {"mean": mean.astype(np.float64), "std": deviation.astype(np.float64), "our_vab_data": vectors}
    for name, array in arrays.items():
        np.save(folder / f"{name}.npy", array)
    (folder / "our_vab_words.pkl").write_bytes(pickle.dumps(WORDS, protocol=3))
    rows = {word: int(row) for word, row in zip(WORDS, ROWS, strict=True)}
    (folder / "our_vab_idx.pkl").write_bytes(pickle.dumps(rows, protocol=3))
    return Published(folder, *networks, mean, deviation, vectors)


def scored(published: Published, collection: Path, **changes) -> tuple[Config, Parts]:
    """Settings that score real motions of the collection by this evaluator, and its clips."""
    shared = dict(data=str(collection), shortest=40, longest=196, method="truth", evaluator=str(published.folder))
    cfg = small(**(shared | changes))
    return cfg, load_clips(cfg.data)
