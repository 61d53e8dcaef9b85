"""Encoders of sentences: words, masks, unknown words, and what a checkpoint holds."""

from __future__ import annotations

import copy
import time
import zlib

import pytest
import torch
from safetensors.torch import load, save

from mwlib.networks import EncodedText, HashedNgrams, WordTransformer, vocabulary_of, words_of

WORDS = ("a", "and", "circle", "in", "man", "person", "walks", "waves")
TEXTS = ["A man walks in a circle.", "a person waves", ""]


def learned(**kw) -> WordTransformer:
    torch.manual_seed(0)
    return WordTransformer(**{**dict(vocabulary=WORDS, width=16, layers=2, heads=4), **kw}).eval()


def hashed(**kw) -> HashedNgrams:
    torch.manual_seed(0)
    return HashedNgrams(**{**dict(buckets=512, width=16, layers=2, heads=4), **kw}).eval()


BOTH = pytest.mark.parametrize("make", [learned, hashed])


def test_words():
    assert words_of("A man doesn’t run-walk; he's at 3 o'clock!") == [
        "a",
        "man",
        "doesn't",
        "run",
        "walk",
        "he's",
        "at",
        "3",
        "o'clock",
    ]
    assert words_of(" ...\n") == []
    assert vocabulary_of(TEXTS) == ("a", "circle", "in", "man", "person", "walks", "waves")
    assert vocabulary_of(TEXTS, at_least=2) == ("a",)


@BOTH
def test_a_sentence_alone_and_among_longer_ones_is_the_same(make):
    encoder = make()
    together = encoder(TEXTS)
    assert encoder.width == 16 and together.tokens.shape == (3, 7, 16) and together.pooled.shape == (3, 16)
    assert together.mask.sum(1).tolist() == [7, 4, 1]  # with the start token
    for i, text in enumerate(TEXTS):
        alone = encoder.encode([text])
        n = alone.tokens.shape[1]
        assert alone.mask.all() and together.mask[i].tolist() == [True] * n + [False] * (7 - n)
        torch.testing.assert_close(alone.tokens[0], together.tokens[i, :n], atol=1e-5, rtol=1e-5)
        torch.testing.assert_close(alone.pooled[0], together.pooled[i], atol=1e-5, rtol=1e-5)


@BOTH
def test_what_is_pooled(make):
    for pooling in ("mean", "first"):
        encoder = make(pooling=pooling)
        found = encoder(TEXTS)
        for i, n in enumerate((7, 4, 1)):
            expected = found.tokens[i, :n].mean(0) if pooling == "mean" else found.tokens[i, 0]
            torch.testing.assert_close(found.pooled[i], expected, atol=1e-6, rtol=1e-5)


@BOTH
def test_order_counts_and_case_does_not(make):
    encoder = make()
    vectors = encoder(["a man waves", "waves a man", "A MAN, waves!"]).pooled
    assert (vectors[0] - vectors[1]).abs().max() > 1e-3
    torch.testing.assert_close(vectors[0], vectors[2])


def test_unknown_words_share_one_token():
    encoder = learned()
    found = encoder(["a man strolls", "a man saunters", "a man walks"])
    torch.testing.assert_close(found.tokens[0], found.tokens[1])
    assert (found.tokens[0] - found.tokens[2]).abs().max() > 1e-3
    assert encoder.numbers(["a strolls walks", ""]).tolist() == [[1, 3, 2, 9], [1, 0, 0, 0]]


def test_without_layers_a_sentence_is_a_bag_of_words_with_places():
    encoder = learned(layers=0)
    from mwlib.networks.layers import sinusoids

    expected = encoder.words.weight[[1, 7, 9]] + sinusoids(torch.arange(3), 16)
    torch.testing.assert_close(encoder(["man walks"]).tokens[0], expected)


def test_forgotten_words_train_the_shared_token():
    encoder = learned(forget=0.5, dropout=0.0).train()
    encoder(["a man walks"] * 20).pooled.square().sum().backward()
    assert encoder.words.weight.grad[[1, 2, 3, 7, 9]].abs().sum(1).min() > 0 and encoder.words.weight.grad[0].abs().max() == 0
    encoder(["man"] * 200)  # the start is never forgotten, nor padding taken for a word
    numbers = encoder.numbers(["a man", "a"])
    drawn = torch.stack([encoder._embed(numbers) for _ in range(50)])
    torch.testing.assert_close(drawn[:, :, 0], encoder.words.weight[1].expand(50, 2, 16))
    torch.testing.assert_close(drawn[:, 1, 2], encoder.words.weight[0].expand(50, 16))
    assert 0.2 < (drawn[:, 0, 1] == encoder.words.weight[2]).all(-1).float().mean() < 0.8
    torch.testing.assert_close(encoder.eval()(["a man"]).pooled, learned()(["a man"]).pooled)


def test_the_vocabulary_travels_with_the_weights():
    encoder = learned(vocabulary=("größe", "man", "o'clock", "waves"))
    state = load(save({f"net.text.{k}": v for k, v in encoder.state_dict().items()}))
    words = WordTransformer.vocabulary_in(state, "net.text.")
    assert words == ("größe", "man", "o'clock", "waves") == encoder.vocabulary
    again = learned(vocabulary=words)
    again.load_state_dict({k.removeprefix("net.text."): v for k, v in state.items()})
    torch.testing.assert_close(again(["man waves"]).pooled, encoder(["man waves"]).pooled)
    other = learned(vocabulary=("größe", "nam", "o'clock", "seavw"))  # as many letters
    other.load_state_dict(encoder.state_dict())
    assert other.vocabulary == encoder.vocabulary
    torch.testing.assert_close(other(["man waves"]).pooled, encoder(["man waves"]).pooled)
    with pytest.raises(RuntimeError, match="spelling"):
        learned().load_state_dict(encoder.state_dict())


def test_hashes_by_hand():
    encoder = hashed(layers=0)
    groups = ["<wa", "wal", "alk", "lks", "ks>"]
    assert encoder.hashes("walks") == [zlib.crc32(group.encode()) % 512 for group in groups]
    assert encoder.hashes("a") == [zlib.crc32(b"<a>") % 512]
    vector = encoder._embed(encoder.numbers(["man walks"]))[0, 2]
    torch.testing.assert_close(vector, encoder.groups.weight[encoder.hashes("walks")].mean(0))


def test_unseen_words_are_near_those_they_look_like():
    encoder = hashed(layers=0, buckets=4096)
    walks, walking, waves, jumps = (
        encoder._embed(encoder.numbers([word]))[0, 1] for word in ("walks", "walking", "waves", "jumps")
    )
    near = lambda other: torch.cosine_similarity(walks, other, dim=0)  # noqa: E731
    assert near(walking) > near(waves) and near(walking) > near(jumps) + 0.2


def test_hashed_vectors_do_not_depend_on_words_met_before():
    """To the bit, gradients too: a training that goes on has met other words."""
    fresh, used = hashed(dropout=0.0), hashed(dropout=0.0)
    used(["waves and jumps in a circle", "person"])
    assert torch.equal(fresh(TEXTS).tokens, used(TEXTS).tokens)
    for encoder in (fresh, used):
        encoder(TEXTS).pooled.square().sum().backward()
    assert torch.equal(fresh.groups.weight.grad, used.groups.weight.grad)


@BOTH
def test_every_parameter_learns_and_copies_work(make):
    encoder = make().train()
    found = encoder(TEXTS)
    assert isinstance(found, EncodedText)
    (found.tokens.square().sum() + found.pooled.sum()).backward()
    for name, p in encoder.named_parameters():
        assert p.grad is not None and p.grad.abs().sum() > 0, name
    twin = copy.deepcopy(encoder).eval()
    torch.testing.assert_close(twin(TEXTS).pooled, encoder.eval()(TEXTS).pooled)


@BOTH
def test_long_sentences_are_cut(make):
    encoder = make()
    long = " ".join(["walks"] * 100)
    assert encoder([long]).tokens.shape[1] == 77
    torch.testing.assert_close(encoder([long]).pooled, encoder([long + " a man"]).pooled)


@BOTH
def test_words_are_numbered_quickly(make, unchecked):
    """64 captions take about a millisecond; far more is allowed on a machine with other work."""
    encoder = make()
    texts = [f"a person walks in a circle and waves {n} times with the left hand" for n in range(64)]
    times = []
    for _ in range(20):
        start = time.perf_counter()
        encoder.numbers(texts)
        times.append(time.perf_counter() - start)
    assert min(times) < 0.005


@BOTH
@pytest.mark.parametrize("texts", ["a man", [], ()])
def test_what_is_no_list_of_sentences_is_refused(make, texts):
    with pytest.raises(ValueError, match="expected a sequence of at least one sentence"):
        make()(texts)


@pytest.mark.parametrize(
    "make, change, message",
    [
        (learned, dict(vocabulary=("a", "a")), "2 words, 1 different; expected each once"),
        (learned, dict(vocabulary=()), "0 words, 0 different"),
        (learned, dict(vocabulary=("two words",)), "'two words'; expected words in lower case"),
        (learned, dict(vocabulary=("Man",)), "'Man'"),
        (learned, dict(pooling="last"), "pooling is 'last'; expected 'mean' or 'first'"),
        (learned, dict(heads=3), "width is 16"),
        (hashed, dict(buckets=0), "buckets is 0; expected at least 1"),
    ],
)
def test_bad_settings(make, change, message, unchecked):
    with pytest.raises(ValueError, match=message):
        make(**change)
