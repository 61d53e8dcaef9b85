"""Captioned clips: those that a configuration names, their split, and batches of them."""

from __future__ import annotations

import csv
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from mwlib.body.motion import Motion
from mwlib.body.skeleton import HUMANML22
from mwlib.data.formats.humanml import HUMANML3D, LAYOUTS, CaptionedClip, FeatureLayout, TaggedCaption, read_folder
from mwlib.data.formats.humanml_encoding import features_of, with_bones
from mwlib.data.load import data_folder, find_source, motion_files, read_motion_file, source_state
from mwlib.data.meaning import clips_row
from mwlib.data.normalisation import Statistics
from mwlib.data.untrusted import SMALL_TEXT, MotionFormatError, read_text
from mwlib.data.windows import JoinedClips
from mwlib.hashing import sha256
from mwlib.networks.matching import UNIT
from mwlib.settings import Count, Natural


@dataclass(frozen=True)
class CaptionsConfig:
    """Which clips."""

    data: str = "people"  # "people", "cmu", or a folder laid out as HumanML3D or KIT, here or under MWLIB_DATA
    clips: Count = 2400  # of "people"; other data are what they are
    shortest: Count = 40  # frames: shorter clips are left out; at least 4. KIT's loader takes 24
    longest: Count = 196  # frames: longer clips are cut
    few: Natural = 0  # train on so many clips only, spread evenly; 0 = all


class Parts(NamedTuple):
    """Clips by what they may be used for; no clip, and where people are known no person, is in two parts."""

    train: list[CaptionedClip]
    val: list[CaptionedClip]
    test: list[CaptionedClip]

    def fingerprints(self) -> tuple[str, str]:
        """Of the clips that a model is trained on, and of those that it is tested on."""
        return fingerprint([*self.train, *self.val]), fingerprint(self.test)

    @property
    def layout(self) -> FeatureLayout:
        """What a row of features means."""
        return LAYOUTS[self.train[0].features.shape[1]]


def captioned_people(clips: int = 2400, seed: int = 0) -> list[CaptionedClip]:
    """The embedded captioned set, licence-free: the clips of `captioned_positions` as features of HumanML3D.

    Each has 40 to 120 frames, a multiple of four.

    Raises:
        ValueError: fewer than one clip.

    >>> clip = captioned_people(1)[0]
    >>> clip.features.shape, clip.split, clip.captions[0]
    ((76, 263), 'train', 'an adult walks briskly forward')
    """
    from mwlib.synthetic.acts import captioned_positions  # a model of other data opens no generator

    made = captioned_positions(clips, seed)
    return [CaptionedClip(features_of(x.positions), x.captions, x.name, x.split, x.attributes) for x in made]


def load_clips(source: CaptionsConfig) -> Parts:
    """The configured clips, parted as their collection parts them.

    Raises:
        ValueError: nothing is left to train or to test on.
        FileNotFoundError: there is no such folder.
        MotionFormatError: as the reader of the data.
    """
    clips = [_cut(clip, source.longest) for clip in _clips(source) if len(clip.features) >= source.shortest]
    train, val, test = ([clip for clip in clips if clip.split == split] for split in ("train", "val", "test"))
    train = thinned(train, source.few)
    if not train or not test:
        if source.data == "cmu":
            find_source(CMU_FOLDER)  # says where it looked, and how the files are had
        found = f"{source.data} has {len(train)} clips to train and {len(test)} to test on"
        raise ValueError(f"{found}, of {source.shortest} frames or more; expected some of both")
    return Parts(train, val, test)


def _clips(source: CaptionsConfig) -> list[CaptionedClip]:
    if source.data == "people":
        return _kept(captioned_people, source.clips)
    if source.data == "cmu":
        folder = data_folder().absolute()
        return _kept(captioned_cmu, folder, source_state(folder / CMU_FOLDER), source_state(folder / CMU_CAPTIONS))
    try:
        folder = find_source(source.data)
    except FileNotFoundError:
        found = f"data is {source.data!r}, which is neither here nor in {data_folder()}, the folder of data (MWLIB_DATA)"
        raise FileNotFoundError(f"{found}; expected people, cmu, or a folder laid out as HumanML3D or KIT") from None
    return _kept(read_folder, folder.absolute(), source_state(folder))


@lru_cache(maxsize=4)
def _kept(read: Callable[[Any], list[CaptionedClip]], source: object, *_state: object) -> list[CaptionedClip]:
    """What is read of a source; the state of its files makes a changed one be read again."""
    return read(source)


def _cut(clip: CaptionedClip, longest: int) -> CaptionedClip:
    """A clip that is cut may not show any more what was known of it."""
    if len(clip.features) <= longest:
        return clip
    return CaptionedClip(clip.features[:longest], clip.captions, clip.name, clip.split)


def thinned(items: Sequence[Item], count: int) -> list[Item]:
    """At most so many, spread evenly; 0 = all."""
    kept = min(count or len(items), len(items))
    return [items[i] for i in np.linspace(0, len(items) - 1, kept).round().astype(int)]


def fingerprint(clips: Sequence[CaptionedClip]) -> str:
    """Eight hex digits over names, captions, their parts of speech where these are told, and features."""
    return sha256(_contents(clips))[:8]


def _contents(clips: Sequence[CaptionedClip]) -> Iterator[bytes | str]:
    for clip in clips:
        tagged = [caption.tagged for caption in clip.captions if isinstance(caption, TaggedCaption)]
        yield f"{clip.name}/{clip.captions}/{clip.features.shape}{tagged or ''}"
        yield np.ascontiguousarray(clip.features, dtype=np.float32).tobytes()


SHORTENED = 1 / 3  # of the pieces
Item = TypeVar("Item")
Frames = Int[Tensor, " B"]  # numbers of them
BUCKETS = 8  # groups of clips of like lengths, one of which a batch comes from: own choice, a third less padding


class Batch(NamedTuple):
    """Normalised features, padded with zeros; which frames a sample has; its caption."""

    y: Float[Tensor, "B T D"]
    mask: Bool[Tensor, "B T"]
    lengths: Frames
    captions: list[str]


def piece(full: Frames, shorter: Float[Tensor, " B"], place: Float[Tensor, " B"]) -> tuple[Frames, Frames]:
    """Lengths of pieces of clips, and where they start.

    Source: Guo et al., 2022, their loader: the length is cut to a multiple of 4, one time in three by 4 more; the piece starts
    anywhere.

    Args:
        full: frames of each clip, at least 4.
        shorter, place: random numbers between 0 and 1.
    """
    units = full // UNIT
    lengths = UNIT * torch.where(shorter < SHORTENED, units - 1, units).clamp_min(1)
    return lengths, (place * (full - lengths + 1)).long()


def joined(clips: Sequence[CaptionedClip], statistics: Statistics) -> JoinedClips:
    """Clips laid end to end, normalised, as a network sees them."""
    return JoinedClips([statistics.normalise(torch.from_numpy(clip.features)).float() for clip in clips])


class ClipBatches:
    """Random batches of clips of like lengths.

    Args:
        clips: at least one, none shorter than `UNIT` frames.
        statistics: normalises their features.
        padded: frames to which every batch is filled up; 0 = to its longest clip.
    """

    def __init__(self, clips: Sequence[CaptionedClip], statistics: Statistics, padded: int = 0) -> None:
        self.clips, self.frames, self.padded = clips, joined(clips, statistics), padded
        order = self.frames.lengths.argsort(stable=True)
        self.buckets = [part for part in order.tensor_split(min(BUCKETS, len(clips))) if len(part)]

    def to(self, device: torch.device) -> None:
        """Move the features."""
        self.frames.to(device)

    def draw(self, batch: int, generator: torch.Generator) -> Batch:
        """Random clips of like lengths, a random caption of each, and a random piece of it."""
        sizes = torch.tensor([*map(len, self.buckets)], dtype=torch.float)
        bucket = self.buckets[int(torch.multinomial(sizes, 1, generator=generator))]
        picked = bucket[torch.randint(len(bucket), (batch,), generator=generator)]
        lengths, start = piece(self.frames.lengths[picked], *(torch.rand(batch, generator=generator) for _ in range(2)))
        words = torch.rand(batch, generator=generator).tolist()
        own = [self.clips[i].captions for i in picked.tolist()]
        return self._batch(picked, start, lengths, [texts[int(w * len(texts))] for texts, w in zip(own, words, strict=True)])

    def whole(self, numbers: Sequence[int], captions: Sequence[str]) -> Batch:
        """Given clips from their beginning, cut to a multiple of 4 frames."""
        picked = torch.tensor(numbers)
        return self._batch(picked, torch.zeros_like(picked), self.frames.lengths[picked] // UNIT * UNIT, list(captions))

    def _batch(self, clip: Tensor, start: Tensor, lengths: Frames, captions: list[str]) -> Batch:
        y = self.frames.take(clip, start, self.padded or int(lengths.max()))
        mask = (torch.arange(y.shape[1]) < lengths[:, None]).to(y.device)
        return Batch(y * mask[..., None], mask, lengths.to(y.device), captions)


def one_caption_each(clips: Sequence[CaptionedClip], seed: int) -> list[str]:
    """A random caption of every clip."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(3,)))
    return [clip.captions[int(rng.integers(len(clip.captions)))] for clip in clips]


CMU_FOLDER, CMU_CAPTIONS = "cmu/asfamc", "captions_cmu.csv"
TEST, VAL = ("2", "7", "29"), ("1",)  # subjects; all others are for training
LONGEST = 196  # rows of features of one clip, as HumanML3D has it
FASTEST = 12.0  # metres a second from frame to frame at 20 Hz, of any joint; dancers reach 10.7, faster ones are glitches


def captioned_cmu(folder: Path, subjects: Collection[str] | None = None) -> list[CaptionedClip]:
    """CMU's clips on HumanML3D's one body, at 20 Hz, as features; split by person.

    Captions are KIT-ML's, where captions_cmu.csv has some for the trial, then CMU's own words for it: keywords rather than
    sentences. A trial of more than 196 rows is cut into as few pieces as will do, of one length to a row, each with the
    captions of the whole; `attributes` say "part" (from 1) of how many "parts". Shorter than 40 rows, without any words or with
    a joint that jumps: left out. Subjects 2, 7 and 29 are for testing, 1 for validation. Own choice, all of it.

    Args:
        folder: with cmu/asfamc and, if there, captions_cmu.csv.
        subjects: only these people, such as "7"; None: all.

    Raises:
        MotionFormatError: a file cannot be read.
    """
    spoken = _kit_captions(folder / CMU_CAPTIONS)
    clips: list[CaptionedClip] = []
    for file in motion_files(folder / CMU_FOLDER):
        row, _ = clips_row(file)
        if subjects is not None and row.get("subject") not in subjects:
            continue
        own = row.get("description") or row.get("action")
        captions = (*spoken.get(file.relative_to(folder).as_posix().removesuffix(".xz"), ()), *([own] if own else []))
        if captions:
            clips += _pieces(read_motion_file(file)[0], captions)
    return clips


def _kit_captions(file: Path) -> dict[str, list[str]]:
    """Captions by the trial's path, packing left out; none if there is no such file."""
    if not file.is_file():
        return {}
    found: dict[str, list[str]] = {}
    for n, row in enumerate(csv.DictReader(read_text(file, SMALL_TEXT).splitlines()), 2):
        path, caption = row.get("clip_file"), row.get("caption")
        if not path or not caption:
            raise MotionFormatError(file, f"line {n}", str(row)[:80], "columns clip_file and caption, both filled")
        found.setdefault(path.removesuffix(".xz"), []).append(caption.strip())
    return found


def _pieces(motion: Motion, captions: tuple[str, ...]) -> Iterator[CaptionedClip]:
    at_20 = replace(motion, rig=None).with_up("y").retarget(HUMANML22).resample(HUMANML3D.fps)
    positions = with_bones(at_20.positions)
    rows = len(positions) - 1
    speed = np.linalg.norm(np.diff(positions, axis=0), axis=-1) * HUMANML3D.fps
    if rows < HUMANML3D.shortest or speed.max() > FASTEST:
        return
    count = -(-rows // LONGEST)
    ends = np.linspace(0, rows, count + 1).round().astype(int)
    split = "test" if motion.subject in TEST else "val" if motion.subject in VAL else "train"
    for part, (start, stop) in enumerate(zip(ends, ends[1:], strict=False), 1):
        name = motion.name if count == 1 else f"{motion.name} part {part}"
        attributes = {"subject": motion.subject, "kind": motion.action, "part": float(part), "parts": float(count)}
        yield CaptionedClip(features_of(positions[start : stop + 1]), captions, name, split, attributes)
