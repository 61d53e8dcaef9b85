"""The networks of the evaluator: padding and order change nothing, gradients pass, published weights fit."""

from __future__ import annotations

import pytest
import torch
from torch import nn

from mwlib.networks.matching import MotionEncoder, MovementDecoder, MovementEncoder, SentenceEncoder, published_weights

LENGTHS = torch.tensor([9, 24, 4, 17, 24])


@pytest.fixture
def movement() -> MovementEncoder:
    torch.manual_seed(0)
    return shaken(MovementEncoder(23, 12, 10)).eval()


def shaken(network):
    """With biases that are not zero."""
    with torch.no_grad():
        for name, parameter in network.named_parameters():
            if name.endswith("bias"):
                parameter.normal_()
    return network


def slowly(reader, x: torch.Tensor) -> torch.Tensor:
    """One sequence without padding or packing, each direction by itself."""
    gru, inputs = reader.gru, reader.input_emb(x)
    ends = []
    for direction, name in enumerate(("", "_reverse")):
        h = reader.hidden[direction, 0]
        for step in inputs if direction == 0 else inputs.flip(0):
            of_x = getattr(gru, f"weight_ih_l0{name}") @ step + getattr(gru, f"bias_ih_l0{name}")
            of_h = getattr(gru, f"weight_hh_l0{name}") @ h + getattr(gru, f"bias_hh_l0{name}")
            (rx, zx, nx), (rh, zh, nh) = of_x.chunk(3), of_h.chunk(3)
            r, z = (rx + rh).sigmoid(), (zx + zh).sigmoid()
            h = (1 - z) * (nx + r * nh).tanh() + z * h
        ends.append(h)
    return reader.output_net(torch.cat(ends))


@pytest.mark.parametrize("kind", [MotionEncoder, SentenceEncoder])
def test_each_row_is_read_to_its_own_end_in_both_directions(kind, generator):
    torch.manual_seed(0)
    reader = shaken(kind(6, 8, 5))
    x = torch.randn(5, 24, 6, generator=generator)
    found = reader(x, LENGTHS)
    expected = torch.stack([slowly(reader, row[:n]) for row, n in zip(x, LENGTHS, strict=True)])
    torch.testing.assert_close(found, expected, atol=1e-5, rtol=1e-5)


def test_padding_does_not_change_a_sentence(generator):
    """Issue 182 of motion-diffusion-model: the padded length was read for all."""
    reader = SentenceEncoder(6, 8, 5, parts_of_speech=3)
    x, parts = torch.randn(2, 7, 6, generator=generator), nn.functional.one_hot(torch.arange(14).reshape(2, 7) % 3, 3).float()
    lengths = torch.tensor([5, 7])
    short = reader(x, lengths, parts)
    padded, more = (nn.functional.pad(v, (0, 0, 0, 15), value=2.0) for v in (x, parts))
    torch.testing.assert_close(reader(padded, lengths, more), short)
    torch.testing.assert_close(reader(x.flip(0), lengths.flip(0), parts.flip(0)), short.flip(0))
    assert not torch.allclose(reader(padded, torch.tensor([22, 22]), more), short, atol=1e-3)
    assert not torch.allclose(reader(x, lengths, parts.roll(1, 1)), short, atol=1e-3)


def test_padding_does_not_change_a_movement(movement, generator):
    x = torch.randn(5, 24, 23, generator=generator)
    codes, units = movement.codes(x, LENGTHS)
    assert units.tolist() == [2, 6, 1, 4, 6]
    for more in (1, 2, 3, 4, 30):
        padded = nn.functional.pad(x, (0, 0, 0, more), value=torch.nan)
        other, _ = movement.codes(padded, LENGTHS)
        for row, again, n in zip(codes, other, units, strict=True):
            torch.testing.assert_close(again[:n], row[:n])
    alone, _ = movement.codes(x[:1, :8], LENGTHS[:1])
    torch.testing.assert_close(alone[0, :2], codes[0, :2])


def test_codes_are_those_of_a_clip_padded_with_zeros_as_published(movement, generator):
    x = torch.randn(1, 24, 23, generator=generator)
    published = movement(nn.functional.pad(x, (0, 0, 0, 196 - 24)))
    found, _ = movement.codes(x, torch.tensor([24]))
    torch.testing.assert_close(found[:, :6], published[:, :6])


def test_contacts_are_not_looked_at_and_all_else_is(movement, generator):
    x = torch.randn(1, 8, 23, generator=generator).requires_grad_()
    movement(x).sum().backward()
    assert (x.grad[..., -4:] == 0).all() and (x.grad[..., :-4] != 0).all()


def test_the_decoder_is_the_mirror_image():
    decoder = MovementDecoder(23, 12, 10)
    assert decoder(torch.zeros(2, 6, 10)).shape == (2, 24, 23)
    assert MovementEncoder(23, 12, 10)(torch.zeros(2, 24, 23)).shape == (2, 6, 10)


def test_a_frozen_critic_passes_gradients_to_the_motion(movement, generator):
    motion = MotionEncoder(10, 8, 5).eval().requires_grad_(False)
    movement.requires_grad_(False)
    assert motion.gru.training, "cuDNN goes backwards through a GRU in training mode only"
    assert not motion.output_net.training and not movement.main[1].training
    x = torch.randn(3, 24, 23, generator=generator).requires_grad_()
    motion(*movement.codes(x, torch.tensor([24, 12, 15]))).square().sum().backward()
    assert x.grad is not None and all(p.grad is None for p in (*motion.parameters(), *movement.parameters()))
    seen = (x.grad != 0).any(-1)
    assert seen[0].all() and seen[1].sum() == 12 and seen[2].sum() == 12 and seen[2, :12].all()


def test_the_learned_start_state_learns():
    reader = MotionEncoder(6, 8, 5)
    reader(torch.zeros(2, 3, 6), torch.tensor([1, 3])).sum().backward()
    assert (reader.hidden.grad != 0).all()


def test_parts_of_speech_that_are_not_asked_for_are_refused():
    with pytest.raises(ValueError, match="parts of speech given"):
        SentenceEncoder(6, 8, 5)(torch.zeros(1, 3, 6), torch.tensor([3]), torch.zeros(1, 3, 2))


# Names and shapes in the published file: three networks of Guo et al. for 263 features.
PUBLISHED = {
    "text_encoder": {
        "hidden": (2, 1, 512), "pos_emb.weight": (300, 15), "pos_emb.bias": (300,), "input_emb.weight": (512, 300),
        "input_emb.bias": (512,),
        **{f"gru.weight_{kind}_l0{way}": (1536, 512) for kind in ("ih", "hh") for way in ("", "_reverse")},
        **{f"gru.bias_{kind}_l0{way}": (1536,) for kind in ("ih", "hh") for way in ("", "_reverse")},
        "output_net.0.weight": (512, 1024), "output_net.0.bias": (512,), "output_net.1.weight": (512,),
        "output_net.1.bias": (512,), "output_net.3.weight": (512, 512), "output_net.3.bias": (512,),
    },
    "motion_encoder": {
        "hidden": (2, 1, 1024), "input_emb.weight": (1024, 512), "input_emb.bias": (1024,),
        **{f"gru.weight_{kind}_l0{way}": (3072, 1024) for kind in ("ih", "hh") for way in ("", "_reverse")},
        **{f"gru.bias_{kind}_l0{way}": (3072,) for kind in ("ih", "hh") for way in ("", "_reverse")},
        "output_net.0.weight": (1024, 2048), "output_net.0.bias": (1024,), "output_net.1.weight": (1024,),
        "output_net.1.bias": (1024,), "output_net.3.weight": (512, 1024), "output_net.3.bias": (512,),
    },
    "movement_encoder": {
        "main.0.weight": (512, 259, 4), "main.0.bias": (512,), "main.3.weight": (512, 512, 4), "main.3.bias": (512,),
        "out_net.weight": (512, 512), "out_net.bias": (512,),
    },
}  # fmt: skip


def checkpoint(scale: float = 0.01) -> dict:
    """What the published file holds, with other numbers."""
    generator = torch.Generator().manual_seed(0)
    made = {
        part: {name: scale * torch.randn(shape, generator=generator) for name, shape in shapes.items()}
        for part, shapes in PUBLISHED.items()
    }
    return {**made, "opt_motion_encoder": {"state": {}, "param_groups": [{"lr": 1e-4}]}, "epoch": 270, "iter": 9}


def test_published_weights_fit(tmp_path):
    tree = checkpoint()
    torch.save(tree, tmp_path / "finest.tar")
    text, motion, movement = published_weights(tmp_path / "finest.tar")
    for network, part in ((text, "text_encoder"), (motion, "motion_encoder"), (movement, "movement_encoder")):
        state = network.state_dict()
        assert state.keys() == tree[part].keys() and all(torch.equal(state[key], tree[part][key]) for key in state)
        assert not any(p.requires_grad for p in network.parameters()) and not network.training
    assert motion(*movement.codes(torch.ones(2, 8, 263), torch.tensor([8, 4]))).shape == (2, 512)
    assert text(torch.ones(1, 4, 300), torch.tensor([4]), torch.ones(1, 4, 15)).shape == (1, 512)


def test_the_defaults_are_the_published_sizes():
    made = (SentenceEncoder(parts_of_speech=15), MotionEncoder(), MovementEncoder(263))
    for network, shapes in zip(made, PUBLISHED.values(), strict=True):
        assert {name: tuple(value.shape) for name, value in network.state_dict().items()} == shapes


def test_other_files_are_refused(tmp_path):
    tree = checkpoint()
    del tree["motion_encoder"]
    for content in (tree, {**tree, "motion_encoder": 3}, tree["text_encoder"], [1, 2], 5):
        torch.save(content, tmp_path / "other.tar")
        with pytest.raises(ValueError, match="expected text_encoder, motion_encoder and movement_encoder"):
            published_weights(tmp_path / "other.tar")
    with pytest.raises(FileNotFoundError):
        published_weights(tmp_path / "nothing.tar")
