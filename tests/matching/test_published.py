"""The published evaluator from its files: embeddings by a slow transcription, what is refused, and a whole evaluation."""

from __future__ import annotations

import os
import pickle
import shutil
from itertools import product
from pathlib import Path

import numpy as np
import pytest
import torch

from mwlib import MotionFormatError
from mwlib.data.captioned import one_caption_each
from mwlib.data.formats.humanml import HUMANML3D, KIT, TaggedCaption
from mwlib.experiments import get_result, system_of
from mwlib.experiments.runs import Run, _models

from mwlib.matching.evaluators import (  # isort: skip
    FILES, KINDS, PARTS, Matcher, TaggedVocabulary, open_matcher, open_published, published_files,
)  # fmt: skip
from mwlib.networks.matching import published_weights
from mwlib.text_to_motion.objective import TextObjective
from mwlib.text_to_motion.system import evaluate
from tests.matching.sample_published import ROWS, WORDS, Published, features, scored, write_collection, write_evaluator
from tests.networks.test_matching import slowly
from tests.text_to_motion.sample import small, toy

# The order in the published code, and what it makes of some words with tags.
ORDER = "VERB NOUN DET ADP NUM AUX PRON ADJ ADV Loc_VIP Body_VIP Obj_VIP Act_VIP Desc_VIP OTHER".split()
READ = {
    ("a", "DET"): ("a", 2), ("man", "NOUN"): ("man", 1), ("to", "PART"): ("to", 14), ("then", "ADV"): ("then", 8),
    ("left", "VERB"): ("left", 9), ("hand", "NOUN"): ("hand", 10), ("chair", "NOUN"): ("chair", 11),
    ("walk", "NOUN"): ("walk", 12), ("slowly", "ADV"): ("slowly", 13), ("elephant", "NOUN"): ("unk", 14),
    ("dumbbell", "NOUN"): ("unk", 14), ("walked", "VERB"): ("unk", 14),
}  # fmt: skip

ALSO = READ | {
    ("an", "DET"): ("unk", 14), ("the", "DET"): ("the", 2), ("to", "ADP"): ("to", 3), ("and", "CCONJ"): ("and", 14),
    ("kick", "VERB"): ("kick", 12), ("walk", "VERB"): ("walk", 12), ("turn", "VERB"): ("turn", 12), ("left", "ADV"): ("left", 9),
}  # fmt: skip


@pytest.fixture
def published(tmp_path) -> Published:
    return write_evaluator(tmp_path / "published")


@pytest.fixture
def collection(tmp_path) -> Path:
    return write_collection(tmp_path / "HumanML3D")


def slow_text(published: Published, caption: TaggedCaption) -> torch.Tensor:
    """One caption, word by word."""
    pairs = [("sos", 14), *(ALSO[pair] for pair in caption.tagged[:20]), ("eos", 14)]
    x = []
    for word, part in pairs:
        one_hot = torch.zeros(15)
        one_hot[part] = 1.0
        vector = torch.from_numpy(published.vectors[ROWS[WORDS.index(word)]]).float()
        x.append(vector + published.text.pos_emb.weight @ one_hot + published.text.pos_emb.bias)
    return slowly(published.text, torch.stack(x))


def slow_convolution(layer: torch.nn.Conv1d, x: torch.Tensor) -> torch.Tensor:
    """Every second of x (T, C) with the one before it and the two behind it; zeros beyond the ends; then the rectifier."""
    framed = torch.cat([torch.zeros_like(x[:1]), x, torch.zeros_like(x[:1])])
    rows = [sum(layer.weight[..., k] @ framed[t + k] for k in range(4)) + layer.bias for t in range(0, len(x), 2)]
    return torch.stack([torch.where(row > 0, row, 0.2 * row) for row in rows])


def slow_motion(published: Published, raw: np.ndarray) -> torch.Tensor:
    """One motion, scaled by the evaluator's numbers and padded with zeros to 196 frames as published."""
    x = torch.zeros(196, raw.shape[1])
    frames = len(raw) // 4 * 4
    x[:frames] = torch.from_numpy((raw[:frames] - published.mean) / published.deviation).float()
    codes = slow_convolution(published.movement.main[3], slow_convolution(published.movement.main[0], x[:, :-4]))
    return slowly(published.motion, published.movement.out_net(codes[: frames // 4]))


def close(found: torch.Tensor, expected: torch.Tensor) -> None:
    torch.testing.assert_close(found, expected, atol=1e-4, rtol=1e-4)


def test_captions_are_read_as_published(published):
    pairs = list(READ)
    captions = [TaggedCaption("x", pairs[:n]) for n in (1, 3, 12)] + [TaggedCaption("long", pairs * 2 + pairs[:1])]
    found = open_published(published.folder).embed_text(captions)
    close(found, torch.stack([slow_text(published, caption) for caption in captions]))
    alone = open_published(published.folder).embed_text(captions[:1])
    close(alone, found[:1])
    assert len(pairs * 2) > 20 and not torch.allclose(found[2], found[3], atol=1e-3)
    cut = TaggedCaption("cut", (pairs * 2)[:20])
    close(open_published(published.folder).embed_text([cut]), found[3:])


def test_words_have_the_published_parts_of_speech():
    assert list(PARTS) == ORDER
    assert [len({*words.split()}) for words in KINDS.values()] == [12, 13, 10, 34, 12]
    vocabulary = TaggedVocabulary(WORDS)
    numbers, counts, parts = vocabulary.ids([TaggedCaption("x", list(READ)), TaggedCaption("y", [("a", "DET")])])
    assert counts.tolist() == [14, 3] and (parts.sum(-1) == 1).all()
    found = [(WORDS[number], int(part)) for number, part in zip(numbers[0], parts[0].argmax(-1), strict=True)]
    assert found == [("sos", 14), *READ.values(), ("eos", 14)]
    assert vocabulary.words_of(TaggedCaption("x", list(READ)))[-1] == "walked"
    with pytest.raises(ValueError, match="'unk' is not among the 15 words"):
        TaggedVocabulary(WORDS[1:])


def test_motions_are_scaled_by_the_evaluators_own_statistics(published):
    judge = open_published(published.folder)
    motions = [features(seed, frames) for seed, frames in ((20, 43), (21, 7), (22, 64))]
    found = judge.embed_motions([torch.from_numpy(x) for x in motions])
    close(found, torch.stack([slow_motion(published, x) for x in motions]))
    assert judge.statistics.layout == HUMANML3D and judge.device.type == "cpu" and judge.to("cpu") is judge


@pytest.mark.parametrize("width", [263, 251])
def test_motions_are_padded_to_196_frames_and_no_further(width, tmp_path):
    """As published: nothing is known of what comes after a clip of 196 frames."""
    published = write_evaluator(tmp_path, width)
    judge = open_published(tmp_path)
    motions = [features(20 + frames, frames, width) for frames in (24, 192, 195, 196, 199)]
    found = judge.embed_motions([torch.from_numpy(x) for x in motions])
    close(found, torch.stack([slow_motion(published, x) for x in motions]))
    open_end = Matcher(judge.network, judge.movement, judge.statistics, judge.vocabulary)
    other = open_end.embed_motions([torch.from_numpy(x) for x in motions])
    close(other[:3], found[:3])
    assert (other[3:] - found[3:]).norm() > 0.005 * found[3:].norm(), "zeros after the end would be seen"
    with pytest.raises(ValueError, match="a clip has 203 frames; expected at most 196 in whole movements"):
        judge.embed_motions([torch.from_numpy(features(1, 203, width))])


def test_it_may_take_part_in_a_loss(published, collection):
    judge = open_published(published.folder)
    x = torch.from_numpy(features(1, 16))[None].requires_grad_()
    judge.embed_motion(x, torch.tensor([16])).sum().backward()
    assert x.grad is not None and (x.grad[..., :-4] != 0).any(1).all()
    assert not any(p.requires_grad for p in [*judge.network.parameters(), *judge.movement.parameters()])
    asked = dict(critic=str(published.folder), semantic_weight=1.0, semantic="cos_text", stage="none")
    cfg, parts = scored(published, collection, **asked)
    objective = TextObjective(cfg, parts)
    batch = objective.draw(4, torch.Generator().manual_seed(0))
    assert all(isinstance(caption, TaggedCaption) for caption in batch.captions)
    objective.loss(objective.network, batch, torch.Generator().manual_seed(0)).backward()
    assert any(p.grad is not None and p.grad.abs().sum() > 0 for p in objective.network.parameters())


def test_real_motions_are_scored_from_one_end_to_the_other(published, collection, monkeypatch, tmp_path):
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path / "runs"))
    cfg, parts = scored(published, collection)
    found = get_result(cfg, parts)
    motion = torch.stack([slow_motion(published, clip.features) for clip in parts.test])
    captions = one_caption_each(parts.test, cfg.sampling.sampling_seed)
    text = torch.stack([slow_text(published, caption) for caption in captions])
    assert found["values"]["mm_dist"] == pytest.approx((text - motion).norm(dim=1).tolist(), rel=1e-3)
    assert found["mean"]["fid"] == pytest.approx(0, abs=1e-6) and found["windows"] == 6


def test_captions_without_parts_of_speech_are_refused(published):
    cfg = small(method="truth", evaluator=str(published.folder))
    with pytest.raises(ValueError, match=r"'a person goes up' has no parts of speech; expected a caption of HumanML3D or KIT-ML"):
        evaluate(cfg, lambda: None, toy())
    with pytest.raises(ValueError, match="has no parts of speech"):
        open_published(published.folder).embed_text(["a man walks"])


def test_results_depend_on_every_file_of_it(published, collection, monkeypatch, tmp_path):
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path / "runs"))
    cfg, parts = scored(published, collection, critic=str(published.folder), semantic_weight=1.0)
    system = system_of(cfg)
    assert len(_models(system.judged_by(cfg))) == len(_models(system.built_on(cfg))) == len(FILES) == 6
    places = {Run(cfg, parts).file}
    for file in published_files(published.folder).values():
        file.write_bytes(file.read_bytes() + b"x")
        places.add(Run(cfg, parts).file)
    assert len(places) == 7


@pytest.mark.parametrize("part", FILES)
def test_what_is_missing_is_named_with_its_place_and_its_origin(part, published):
    published_files(published.folder)[part].unlink()
    origin, place, *_ = FILES[part]
    with pytest.raises(FileNotFoundError, match=f"is not whole; missing: .*published/{place} .from {origin}.$"):
        open_matcher(str(published.folder), HUMANML3D)


def test_a_folder_without_any_is_no_evaluator(tmp_path):
    with pytest.raises(
        FileNotFoundError, match="no finished run there; train one .* or name one with the files of the published"
    ):
        open_matcher(str(tmp_path), HUMANML3D)


def test_other_layouts_of_the_same_files_will_do(published, monkeypatch):
    texts, folder = [TaggedCaption("x", list(READ))], published.folder
    expected = open_matcher(str(folder), HUMANML3D).embed_text(texts)
    (folder / "glove").mkdir()
    for name, other in (
        ("text_mot_match/model/finest.tar", "finest.tar"), ("mean.npy", "t2m_mean.npy"), ("std.npy", "t2m_std.npy"),
        ("our_vab_data.npy", "glove/our_vab_data.npy"), ("our_vab_idx.pkl", "glove/our_vab_idx.pkl"),
        ("our_vab_words.pkl", "glove/our_vab_words.pkl"),
    ):  # fmt: skip
        shutil.move(folder / name, folder / other)
    assert torch.equal(open_matcher(str(folder), HUMANML3D).embed_text(texts), expected)
    (folder / "glove" / "our_vab_words.pkl").unlink()
    (folder / "glove" / "our_vab_idx.pkl").unlink()
    np.save(folder / "glove" / "our_vab_data.npy", published.vectors[ROWS])
    (folder / "our_vab_words.txt").write_text("\n".join(WORDS) + "\n")
    assert torch.equal(open_matcher(str(folder), HUMANML3D).embed_text(texts), expected)
    monkeypatch.chdir(folder.parent)
    shutil.move(folder, "evaluator")  # the name of one that comes with the package
    assert torch.equal(open_matcher("evaluator", HUMANML3D).embed_text(texts), expected)


class Call:
    """Pickles as a call of any function."""

    def __reduce__(self):
        return os.system, ("touch trace",)


def test_code_in_its_files_does_not_run(published, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    for name, content in product(("our_vab_words.pkl", "our_vab_idx.pkl"), (Call(), [Call()], {"a": Call()})):
        file = published.folder / name
        whole = file.read_bytes()
        file.write_bytes(pickle.dumps(content))
        with pytest.raises(
            MotionFormatError, match=f"{name}, pickle: found the name .*system; expected a pickle of a list of words"
        ):
            open_published(published.folder)
        file.write_bytes(whole)
    np.save(published.folder / "our_vab_data.npy", np.array([Call()], dtype=object), allow_pickle=True)
    with pytest.raises(MotionFormatError, match="our_vab_data.npy, array: found an array of dtype object"):
        open_published(published.folder)
    weights = published_files(published.folder)["weights"]
    for content in ({"text_encoder": Call()}, Call(), None):
        torch.save(content, weights) if content else weights.write_bytes(b"")
        with pytest.raises(ValueError, match="finest.tar is refused .*; expected a checkpoint of tensors and numbers alone"):
            published_weights(weights)
    assert not (tmp_path / "trace").exists()


@pytest.mark.parametrize("name, content, message", [
    ("our_vab_words.pkl", [*WORDS, "more"], r"no row for 1 of 17 words, such as \['more'\]; expected words with rows"),
    ("our_vab_words.pkl", [], "no row for 0 of 0 words"),
    ("our_vab_words.pkl", {"a": 1}, "a dict, and a dict in .*; expected a list, and a dictionary"),
    ("our_vab_idx.pkl", {"a": 1.5}, "found an instruction BINFLOAT"),
    ("our_vab_idx.pkl", {"a": "b"}, "found dict with something else"),
    ("our_vab_idx.pkl", dict.fromkeys(WORDS, 99), "no row for 16 of 16 words"),
    ("our_vab_data.npy", np.zeros((30, 7)),
     r"finest.tar has \(263, 6, 15\) .*numbers of a word.*; expected \(263, 7, 15\), as the files beside"),
    ("our_vab_data.npy", np.zeros(30), r"float64 of shape \(30,\); expected numbers of shape \(words, 300\)"),
    ("our_vab_data.npy", np.full((30, 6), np.nan), "found nan"),
    ("mean.npy", np.zeros(251), "251 means, 263 deviations"),
])  # fmt: skip
def test_files_that_do_not_belong_together_are_refused(published, name, content, message):
    if name.endswith(".npy"):
        np.save(published.folder / name, content)
    else:
        (published.folder / name).write_bytes(pickle.dumps(content))
    with pytest.raises(ValueError if "finest" in message else MotionFormatError, match=message):
        open_published(published.folder)


def test_an_evaluator_of_other_features_is_refused(published):
    with pytest.raises(ValueError, match="judges HumanML3D; expected KIT-ML"):
        open_matcher(str(published.folder), KIT)


def test_the_collections_own_deviations_are_doubted(published):
    deviation = published.deviation.copy()
    deviation[-4:] *= 25
    np.save(published.folder / "std.npy", deviation)
    with pytest.warns(
        UserWarning, match="std.npy divides the deviation of contacts by 1; expected 25, as in the evaluator's own"
    ):
        open_published(published.folder)
