"""Encoders of sentences: words, masks, unknown words, what a checkpoint holds; CLIP's tower on a stand-in for its library."""

from __future__ import annotations

import copy
import sys
import time
import zlib
from types import SimpleNamespace

import pytest
import torch
from safetensors.torch import load, save

from mwlib.networks import ClipText, EncodedText, HashedNgrams, WordTransformer, vocabulary_of, words_of
from mwlib.networks.layers import sinusoids

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
    said = "A man doesn’t run-walk; he's at 3 o'clock!"
    assert words_of(said) == ["a", "man", "doesn't", "run", "walk", "he's", "at", "3", "o'clock"]
    assert words_of(" ...\n") == []
    assert vocabulary_of(TEXTS) == ("a", "circle", "in", "man", "person", "walks", "waves")


@BOTH
def test_a_sentence_alone_and_among_longer_ones_is_the_same(make):
    encoder = make()
    together = encoder(TEXTS)
    assert encoder.width == 16 and together.tokens.shape == (3, 7, 16) and together.pooled.shape == (3, 16)
    assert together.mask.sum(1).tolist() == [7, 4, 1]  # with the start token
    for i, text in enumerate(TEXTS):
        alone = encoder([text])
        n = alone.tokens.shape[1]
        assert alone.mask.all() and together.mask[i].tolist() == [True] * n + [False] * (7 - n)
        torch.testing.assert_close(alone.tokens[0], together.tokens[i, :n], atol=1e-5, rtol=1e-5)
        torch.testing.assert_close(alone.pooled[0], together.pooled[i], atol=1e-5, rtol=1e-5)


@BOTH
def test_what_is_pooled(make):
    found = make()(TEXTS)
    for i, n in enumerate((7, 4, 1)):
        torch.testing.assert_close(found.pooled[i], found.tokens[i, :n].mean(0), atol=1e-6, rtol=1e-5)


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
    vectors = encoder._embed(encoder.numbers(["walks", "walking", "waves", "jumps"]))[:, 1]
    walking, waves, jumps = torch.cosine_similarity(vectors[:1], vectors[1:])
    assert walking > waves and walking > jumps + 0.2


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


@pytest.mark.parametrize("make", [learned, hashed, ClipText])
@pytest.mark.parametrize("texts", ["a man", [], ()])
def test_what_is_no_list_of_sentences_is_refused(make, texts, folder):
    encoder = make(folder) if make is ClipText else make()
    with pytest.raises(ValueError, match="expected a sequence of at least one sentence"):
        encoder(texts)


@pytest.mark.parametrize(
    "make, change, message",
    [
        (learned, dict(vocabulary=("a", "a")), "2 words, 1 of them plain and different.*; expected each once"),
        (learned, dict(vocabulary=()), "0 words, 0 of them"),
        (learned, dict(vocabulary=("two words", "a")), "others are .'two words'.; expected each once, in lower case"),
        (learned, dict(vocabulary=("Man",)), "'Man'"),
        (learned, dict(heads=3), "width is 16"),
    ],
)
def test_bad_settings(make, change, message, unchecked):
    with pytest.raises(ValueError, match=message):
        make(**change)


START, END = 98, 99


class StandIn(torch.nn.Module):
    """A tower whose tokens see those before them only, as the library's: running sums of embeddings."""

    def __init__(self, projection: int = 4) -> None:
        super().__init__()
        self.config = SimpleNamespace(hidden_size=4, projection_dim=projection)
        self.embedding = torch.nn.Embedding(100, 4)
        self.place = torch.nn.Parameter(torch.randn(77, 4))
        self.project = torch.nn.Linear(4, projection)
        self.calls: list[torch.Tensor] = []

    @classmethod
    def from_pretrained(cls, folder, local_files_only, output_loading_info):
        assert local_files_only and output_loading_info
        torch.manual_seed(0)
        said = (folder / "config.json").read_text()
        return cls(int(said[0])), {"missing_keys": said.split()[1:]}

    @property
    def device(self):
        return self.place.device

    def forward(self, input_ids):
        self.calls.append(input_ids)
        tokens = (self.embedding(input_ids) + self.place[: input_ids.shape[1]]).cumsum(1)
        pooled = tokens[torch.arange(len(tokens)), input_ids.argmax(1)]
        return SimpleNamespace(last_hidden_state=tokens, text_embeds=self.project(pooled))


class Tokenizer:
    @classmethod
    def from_pretrained(cls, folder, local_files_only):
        assert local_files_only
        return cls()

    def __call__(self, texts, truncation, max_length):
        assert isinstance(texts, list) and truncation
        rows = [[START, *(1 + len(word) for word in text.split())][: max_length - 1] + [END] for text in texts]
        return {"input_ids": rows}


def logging() -> SimpleNamespace:
    """What the library shows while it opens a file."""
    shown = SimpleNamespace(level=30, bar=True)
    shown.get_verbosity, shown.is_progress_bar_enabled = lambda: shown.level, lambda: shown.bar
    shown.set_verbosity = lambda level: setattr(shown, "level", level)
    shown.set_verbosity_error = lambda: setattr(shown, "level", 40)
    shown.enable_progress_bar, shown.disable_progress_bar = (
        lambda: setattr(shown, "bar", True),
        lambda: setattr(shown, "bar", False),
    )
    return shown


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The files of a tower, and the library."""
    for name in ("model.safetensors", "tokenizer.json"):
        (tmp_path / name).touch()
    (tmp_path / "config.json").write_text("4")
    utils = SimpleNamespace(logging=logging())
    library = SimpleNamespace(CLIPTextModelWithProjection=StandIn, CLIPTokenizer=Tokenizer, utils=utils)
    monkeypatch.setitem(sys.modules, "transformers", library)
    return tmp_path


def test_a_missing_library_says_what_to_install(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "transformers", None)
    with pytest.raises(ImportError, match=r"transformers, which is not installed: pip install 'transformers>="):
        ClipText(tmp_path)


def test_missing_files_say_where_to_get_them_and_where_to_put_them(folder):
    (folder / "model.safetensors").unlink()
    (folder / "tokenizer.json").unlink()
    with pytest.raises(FileNotFoundError) as error:
        ClipText(folder)
    missing = "no model.safetensors or pytorch_model.bin, no tokenizer.json or vocab.json"
    assert str(error.value).startswith(f"{folder} has {missing}; expected")
    assert "https://huggingface.co/openai/clip-vit-base-patch32 into that folder" in str(error.value)


def test_another_tower_is_refused(folder):
    (folder / "config.json").write_text("3")
    with pytest.raises(ValueError, match="4 numbers per token and 3 per sentence; expected that of ViT-B/32"):
        ClipText(folder)
    (folder / "config.json").write_text("4 text.late text.early")
    with pytest.raises(ValueError, match="has no weights for text.early, one of 2; expected CLIP ViT-B/32 from https"):
        ClipText(folder)
    shown = sys.modules["transformers"].utils.logging
    assert shown.level == 30 and shown.bar  # as they were


def test_tokens_and_sentence_vectors(folder):
    """Sentences have the tower's own output, cut to 20 tokens between start and end; padding is zeros and masked."""
    encoder = ClipText(str(folder))
    long = " ".join(["waves"] * 30)
    found = encoder(["a man walks", "run", long])
    assert encoder.width == 4 and found.tokens.shape == (3, 22, 4) and found.mask.sum(1).tolist() == [5, 3, 22]
    rows = [[START, 2, 4, 6, END], [START, 4, END], [START, *[6] * 20, END]]
    tower = encoder._tower.network
    assert [row[: len(ids)].tolist() for row, ids in zip(tower.calls[0], rows, strict=True)] == rows
    assert tower.calls[0][0, 5:].abs().max() == 0
    for i, ids in enumerate(rows):
        out = tower(torch.tensor([ids]))
        torch.testing.assert_close(found.tokens[i, : len(ids)], out.last_hidden_state[0])
        torch.testing.assert_close(found.pooled[i], out.text_embeds[0])
    assert ClipText(folder, longest=75)([long]).tokens.shape == (1, 32, 4)


def test_padding_may_count_as_tokens(folder):
    encoder = ClipText(folder, longest=75, padded=True)
    found = encoder(["a man walks", "run"])
    assert found.tokens.shape == (2, 77, 4) and found.mask.all()
    padded = torch.tensor([[START, 4, END] + [0] * 74])
    torch.testing.assert_close(found.tokens[1:], encoder._tower.network(padded).last_hidden_state)


def test_known_sentences_are_not_encoded_again(folder, monkeypatch):
    monkeypatch.setattr("mwlib.networks.text.CLIP_KEPT", 3)
    encoder = ClipText(folder)
    calls = encoder._tower.network.calls
    first = encoder(["a", "b c", "a"])
    assert len(calls) == 1 and len(calls[0]) == 2
    again = encoder(["b c", "a"])
    assert len(calls) == 1
    torch.testing.assert_close(again.pooled, first.pooled[[1, 0]])
    encoder(["d", "e"])
    assert [*encoder._tower.known] == ["b c", "d", "e"]
    assert len(encoder(["f", "g", "h", "i", "j"]).pooled) == 5 and len(encoder._tower.known) == 3
    monkeypatch.setattr("mwlib.networks.text.CLIP_KEPT", 0)
    forgetful = ClipText(folder)
    forgetful(["a"]), forgetful(["a"])
    assert len(forgetful._tower.network.calls) == 2


def test_the_tower_neither_learns_nor_is_saved_nor_copied(folder):
    encoder = ClipText(folder)
    assert not [*encoder.parameters()] and not encoder.state_dict()
    assert copy.deepcopy(encoder)._tower is encoder._tower
    tower = encoder.train()._tower.network
    assert not tower.training and not any(p.requires_grad for p in tower.parameters())
    assert not encoder(["a man"]).pooled.requires_grad
    assert tower.place.dtype == torch.float32
    encoder.to(torch.float64)
    assert tower.place.dtype == torch.float64  # moves with it
