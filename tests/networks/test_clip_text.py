"""CLIP's text tower: what is missing and where it comes from; and, on a stand-in for the library, what is made of its output."""

from __future__ import annotations

import copy
import sys
from types import SimpleNamespace

import pytest
import torch

from mwlib.networks import ClipText

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


class Logging:
    """What the library shows while it opens a file."""

    def __init__(self) -> None:
        self.level, self.bar = 30, True

    def get_verbosity(self):
        return self.level

    def is_progress_bar_enabled(self):
        return self.bar

    def set_verbosity(self, level):
        self.level = level

    def set_verbosity_error(self):
        self.level = 40

    def enable_progress_bar(self):
        self.bar = True

    def disable_progress_bar(self):
        self.bar = False


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The files of a tower, and the library."""
    for name in ("model.safetensors", "tokenizer.json"):
        (tmp_path / name).touch()
    (tmp_path / "config.json").write_text("4")
    library = SimpleNamespace(
        CLIPTextModelWithProjection=StandIn, CLIPTokenizer=Tokenizer, utils=SimpleNamespace(logging=Logging())
    )
    monkeypatch.setitem(sys.modules, "transformers", library)
    return tmp_path


def test_a_missing_library_says_what_to_install(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "transformers", None)
    with pytest.raises(ImportError, match=r"transformers, which is not installed; install it with: pip install .*\[clip\]"):
        ClipText(tmp_path)


def test_missing_files_say_where_to_get_them_and_where_to_put_them(folder):
    (folder / "model.safetensors").unlink()
    (folder / "tokenizer.json").unlink()
    with pytest.raises(FileNotFoundError) as error:
        ClipText(folder)
    message = str(error.value)
    assert message.startswith(
        f"{folder} has no model.safetensors or pytorch_model.bin, no tokenizer.json or vocab.json; expected"
    )
    assert "https://huggingface.co/openai/clip-vit-base-patch32 into that folder" in message


def test_another_tower_and_bad_lengths_are_refused(folder):
    (folder / "config.json").write_text("3")
    with pytest.raises(ValueError, match="4 numbers per token and 3 per sentence; expected that of ViT-B/32"):
        ClipText(folder)
    (folder / "config.json").write_text("4 text.late text.early")
    with pytest.raises(ValueError, match="has no weights for text.early, one of 2; expected CLIP ViT-B/32 from https"):
        ClipText(folder)
    logging = sys.modules["transformers"].utils.logging
    assert logging.level == 30 and logging.bar  # as they were
    for longest in (0, 76):
        with pytest.raises(ValueError, match=f"longest is {longest}; expected 1 to 75"):
            ClipText(folder, longest=longest)


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


def test_known_sentences_are_not_encoded_again(folder):
    encoder = ClipText(folder, keep=3)
    calls = encoder._tower.network.calls
    first = encoder(["a", "b c", "a"])
    assert len(calls) == 1 and len(calls[0]) == 2
    again = encoder(["b c", "a"])
    assert len(calls) == 1
    torch.testing.assert_close(again.pooled, first.pooled[[1, 0]])
    encoder(["d", "e"])
    assert [*encoder._tower.known] == ["b c", "d", "e"]
    assert len(encoder(["f", "g", "h", "i", "j"]).pooled) == 5 and len(encoder._tower.known) == 3
    forgetful = ClipText(folder, keep=0)
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


@pytest.mark.parametrize("texts", ["a man", []])
def test_what_is_no_list_of_sentences_is_refused(folder, texts):
    with pytest.raises(ValueError, match="expected a sequence of at least one sentence"):
        ClipText(folder)(texts)
