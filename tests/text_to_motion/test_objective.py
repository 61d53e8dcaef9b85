"""The objective: weights, stages, the gradient of the critic, trainings that resume or begin with another."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from torch.testing import assert_close

from mwlib import MotionFormatError
from mwlib.data.captioned import CaptionsConfig, load_clips
from mwlib.matching.evaluators import Matcher
from mwlib.networks.text import HashedNgrams
from mwlib.text_to_motion import model, objective
from mwlib.text_to_motion.losses import LowPass, low_frequency_loss, masked_error
from mwlib.text_to_motion.objective import TextObjective
from mwlib.text_to_motion.system import built_on
from mwlib.training import seeded, train
from mwlib.training.checkpoint import save_tensors
from tests.text_to_motion.sample import small, toy, untrained


class Critic(Matcher):
    """Embeds a motion by fixed random numbers of its frames, and every sentence alike."""

    def __init__(self) -> None:
        self.weight = torch.randn(263, 8, generator=torch.Generator().manual_seed(5))

    def to(self, device):
        return self

    def embed_motion(self, features, lengths):
        mask = torch.arange(features.shape[1]) < lengths[:, None]
        return ((features * mask[..., None]).sum(1) / lengths[:, None]) @ self.weight

    def embed_text(self, texts):
        return torch.ones(len(texts), 8)


@pytest.fixture
def critic(monkeypatch):
    monkeypatch.setattr(objective, "open_matcher", lambda name, layout: Critic())


def gradient(**changes) -> tuple[float, list[torch.Tensor]]:
    """Loss of one batch, and its gradient; same weights and noise whatever the losses."""
    one = TextObjective(small(**changes), toy())
    with seeded(0, 3) as generator:
        batch = one.draw(8, generator)
        loss = one.loss(one.network, batch, generator)
    loss.backward()
    return float(loss.detach()), [p.grad for p in one.network.parameters() if p.grad is not None]


def test_the_losses_add_up_with_their_weights(critic):
    main, low, semantic = (
        gradient(simple_weight=s, low_weight=w, semantic_weight=m)[0] for s, w, m in ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    )
    total, _ = gradient(simple_weight=2.0, low_weight=0.5, semantic_weight=0.25)
    assert total == pytest.approx(2 * main + 0.5 * low + 0.25 * semantic, rel=1e-5)
    assert min(main, low, semantic) > 0


def test_detached_meaning_changes_the_number_but_no_gradient(critic):
    """What the published code does; bit for bit."""
    plain, without = gradient()
    logged, detached = gradient(semantic_weight=1.0, semantic="detached")
    felt, real = gradient(semantic_weight=1.0)
    assert logged == felt > plain
    assert all(torch.equal(a, b) for a, b in zip(without, detached, strict=True))
    assert not all(torch.allclose(a, b) for a, b in zip(without, real, strict=True))


def test_the_critic_sees_only_samples_whose_stage_it_is(monkeypatch):
    seen = []

    class Curious(Critic):
        def embed_motion(self, features, lengths):
            seen.append(len(features))
            return super().embed_motion(features, lengths)

    monkeypatch.setattr(objective, "open_matcher", lambda name, layout: Curious())
    everywhere = gradient(semantic_weight=1.0, stage="none")[0]
    assert set(seen) == {8} and seen.clear() is None
    assert gradient(semantic_weight=1.0, stage="eq16")[0] < everywhere
    assert seen and max(seen) < 8


def test_an_estimate_that_is_right_means_what_the_truth_means_and_half_a_weight_is_half_a_loss(critic, monkeypatch):
    one = TextObjective(small(simple_weight=0.0, semantic_weight=1.0, stage="none"), toy())
    with seeded(0, 3) as generator:
        batch = one.draw(8, generator)
        one.network.forward = lambda y_t, *others: batch.y
        loss = one.loss(one.network, batch, generator)
    assert float(loss) == pytest.approx(0, abs=1e-5)
    whole = gradient(simple_weight=0.0, semantic_weight=1.0, stage="none")[0]
    monkeypatch.setattr(objective, "stage_weights", lambda stage, t, *others: (torch.ones(len(t)), torch.full((len(t),), 0.5)))
    assert gradient(simple_weight=0.0, semantic_weight=1.0)[0] == pytest.approx(0.5 * whole, rel=1e-5)


def test_stages_and_bands_reach_the_loss(critic):
    losses = {stage: gradient(simple_weight=0.0, low_weight=1.0, stage=stage)[0] for stage in ("none", "prose", "eq16", "snr")}
    assert losses["none"] > max(losses["prose"], losses["eq16"]) > 0 and losses["snr"] > 0
    both = [gradient(simple_weight=0.0, low_weight=1.0, stage="none", lf_norm="mse", lf_band=band)[0] for band in ("low", "high")]
    assert sum(both) == pytest.approx(gradient(simple_weight=1.0)[0], rel=1e-4)
    assert gradient(simple_weight=0.0, low_weight=1.0, stage="none", lf_k=1)[0] < losses["none"]
    assert gradient(simple_weight=0.0, low_weight=1.0, stage="none", lf_hz=9.0)[0] > losses["none"]


def test_the_loss_is_the_mean_square_of_the_clean_estimate():
    """A slow transcription: one sample at a time, without padding."""
    one = TextObjective(small(low_weight=0.7, stage="none", drop_text=0.0), toy())
    one.network.eval()
    with seeded(0, 3) as generator:
        batch = one.draw(4, generator)
        state = generator.get_state()
        loss = one.loss(one.network, batch, generator)
        generator.set_state(state)
        t = torch.randint(10, (4,), generator=generator)
        eps = torch.randn(batch.y.shape, generator=generator)
    each = []
    for i, n in enumerate(batch.lengths.tolist()):
        y, e, a = batch.y[i, :n], eps[i, :n], float(one.alpha_bar[t[i]])
        y_t = a**0.5 * y + (1 - a) ** 0.5 * e
        y0_hat = one.network(y_t[None], t[i : i + 1], torch.ones(1, n, dtype=torch.bool), [batch.captions[i]])[0]
        slow = LowPass(24, 10)(y0_hat[None] - y, torch.tensor([n]))[0, :n]
        each.append((y0_hat - y).square().mean() + 0.7 * slow.abs().mean())
    assert_close(loss, torch.stack(each).mean(), atol=1e-5, rtol=1e-5)


def test_noise_levels_weigh_as_the_root_of_signal_over_noise():
    """Between 1 and a tenth; sample by sample."""
    one, plain = (TextObjective(small(level_weight=w), toy()) for w in ("root_snr", "uniform"))
    a = one.alpha_bar
    assert plain.level.tolist() == [1.0] * len(one.level)
    by_hand = [min(max((x / (1 - x)) ** 0.5, 0.1), 1.0) for x in a.tolist()]
    assert one.level.tolist() == pytest.approx(by_hand) and 0.1 == pytest.approx(min(by_hand)) and max(by_hand) == 1.0
    with seeded(0, 3) as generator:
        batch = one.draw(8, generator)
        state = generator.get_state()
        one.network.forward = lambda y_t, *_: torch.zeros_like(y_t)
        found = one.loss(one.network, batch, generator)
        t = torch.randint(len(a), (8,), generator=generator.set_state(state))
    assert_close(found, (one.level[t] * masked_error(batch.y, batch.mask)).mean())


def test_power_of_low_cosines_is_that_of_all_clips(monkeypatch):
    one = TextObjective(small(stage="snr", low_weight=1.0), toy())
    numbers = [*range(30)]
    batch = one.clips.whole(numbers, [""] * 30)
    assert_close(one.power, one.low_pass.coefficients(batch.y, batch.lengths).square().mean((0, 2)))
    monkeypatch.setattr(objective, "CHUNK", 7)
    assert_close(one._power(), one.power)


def test_meaning_passes_through_the_critic_of_the_package():
    parts = load_clips(CaptionsConfig(clips=80))
    found = {}
    for name, changes in {"plain": {}, "detached": {"semantic": "detached"}, "felt": {}}.items():
        weight = 0.0 if name == "plain" else 1.0
        one = TextObjective(small(data="people", longest=120, semantic_weight=weight, stage="none", **changes), parts)
        with seeded(0, 3) as generator:
            one.loss(one.network, one.draw(4, generator), generator).backward()
        found[name] = [p.grad for p in one.network.parameters() if p.grad is not None]
    assert all(torch.equal(a, b) for a, b in zip(found["plain"], found["detached"], strict=True))
    assert not all(torch.allclose(a, b) for a, b in zip(found["plain"], found["felt"], strict=True))


def test_a_network_that_sees_the_padding_sees_noise_there():
    """As in both published codes; one that hides it gets zeros."""
    seen = {}
    for hides in (True, False):
        one = TextObjective(small(mask_frames=hides, attention_dropout=0.0), toy())
        given = []
        one.network.body.register_forward_pre_hook(lambda _, args, given=given: given.append((args[0], args[2])))
        with seeded(0, 3) as generator:
            one.loss(one.network, one.draw(6, generator), generator)
        ((y_t, mask),) = given
        assert not mask.all() and (y_t[mask] != 0).all()
        seen[hides] = y_t[~mask]
    assert not seen[True].any() and 0.5 < seen[False].std() < 1.5


def test_sampling_denoises_the_padding_that_a_network_sees():
    for hides in (True, False):
        drawn = untrained(mask_frames=hides)
        with torch.inference_mode():
            steps = [*drawn.steps(["a person goes up"] * 2, [8, 16], 1)]
        assert bool(steps[0].y[0, 8:].any()) == bool(steps[-1].y[0, 8:].any()) == (not hides)
        alone, together = drawn.sample(["someone"], [8], 1)[0], drawn.sample(["someone", "someone falls"], [8, 16], 1)[0]
        torch.testing.assert_close(alone, together)


def test_statistics_may_be_those_of_the_collection(tmp_path, monkeypatch):
    monkeypatch.setenv("MWLIB_DATA", str(tmp_path))
    folder = tmp_path / "HumanML3D"
    folder.mkdir()
    mean, deviation = np.linspace(-1, 1, 263), np.linspace(1, 3, 263)
    for name, numbers in (("Mean", mean), ("Std", deviation)):
        np.save(folder / f"{name}.npy", numbers)
    asked = dict(statistics="files", data="HumanML3D")
    plain, heavy = (TextObjective(small(normalisation=kind, **asked), toy()).learnt() for kind in ("mdm", "stablemofusion"))
    for found in (plain, heavy):
        np.testing.assert_allclose(found["mean"], mean, rtol=1e-6)
    np.testing.assert_allclose(plain["deviation"], deviation, rtol=1e-6)
    weighed = [*range(4), *range(259, 263)]
    assert (np.flatnonzero(heavy["deviation"] != plain["deviation"]) == weighed).all()
    np.testing.assert_allclose(heavy["deviation"][weighed], deviation[weighed] / 5, rtol=1e-6)
    assert built_on(small(**asked)) == [str(folder / "Mean.npy"), str(folder / "Std.npy")] and built_on(small()) == []
    np.save(folder / "Mean.npy", mean[:251])
    np.save(folder / "Std.npy", deviation[:251])
    with pytest.raises(MotionFormatError, match="Mean.npy: found 251 numbers; expected 263 for HumanML3D"):
        TextObjective(small(**asked), toy())
    (folder / "Std.npy").unlink()
    with pytest.raises(MotionFormatError, match="Std.npy"):
        TextObjective(small(**asked), toy())


def test_clip_is_looked_for_here_and_among_the_data(monkeypatch, tmp_path):
    found = []
    monkeypatch.setattr(model, "ClipText", lambda folder: found.append(folder) or HashedNgrams(8, width=4))
    monkeypatch.setenv("MWLIB_DATA", str(tmp_path / "data"))
    monkeypatch.chdir(tmp_path)
    for place in (None, tmp_path / "data" / "clip", tmp_path / "clip"):
        if place:
            place.mkdir(parents=True)
        model.make_text(small(text="clip", clip_folder="clip").model, ())
    assert [folder.resolve() for folder in found] == [tmp_path / "clip", tmp_path / "data" / "clip", tmp_path / "clip"]


def test_clip_reads_as_many_words_as_was_published(monkeypatch):
    asked = []
    monkeypatch.setattr(model, "ClipText", lambda folder, **given: asked.append(given) or HashedNgrams(8, width=4))
    for kind in ("mdm", "unet"):
        model.make_text(small(text="clip", clip_folder="clip", network=kind, width=32).model, ())
    assert asked == [{}, {"longest": 75, "padded": True}]


def test_dropped_sentences_are_not_seen():
    one = TextObjective(small(), toy())
    one.network.eval()
    y, mask = torch.randn(2, 8, 263), torch.ones(2, 8, dtype=torch.bool)
    t, drop = torch.tensor([3, 3]), torch.tensor([True, False])
    a, b = (one.network(y, t, mask, [text, text], drop) for text in ("someone rises", "a person goes down"))
    assert torch.equal(a[0], b[0]) and not torch.allclose(a[1], b[1])


def test_a_training_that_was_stopped_goes_on_to_the_same_model(tmp_path):
    cfg, parts = small(train_steps=6), toy()

    def make(learnt):
        return TextObjective(cfg, parts, learnt)

    whole = [step.loss for step in train(make, cfg.training, tmp_path / "whole", "key")]
    for step in train(make, cfg.training, tmp_path / "parts", "key"):
        if step.step == 3:
            break
    rest = [step.loss for step in train(make, cfg.training, tmp_path / "parts", "key")]
    assert rest == whole[3:]
    files = [(tmp_path / name / "model.safetensors").read_bytes() for name in ("whole", "parts")]
    assert files[0] == files[1]


def test_validation_is_the_same_twice_and_nothing_has_no_low_frequencies():
    one = TextObjective(small(), toy())
    assert one.validate(one.network) == one.validate(one.network) > 0
    assert TextObjective(small(), toy()._replace(val=[])).validate(one.network) is None
    lengths = torch.tensor([8, 8])
    assert not low_frequency_loss(torch.zeros(2, 8, 3), lengths, LowPass(8, 2)).any()
    assert not masked_error(torch.zeros(2, 8, 3), torch.ones(2, 8, dtype=torch.bool)).any()


def written(folder, cfg):
    """A finished run's folder, of an objective with weights of its own."""
    one = TextObjective(cfg, toy())
    with torch.no_grad():
        for weights in one.network.parameters():
            weights.add_(1.0)
    tensors = {f"net.{name}": t for name, t in one.network.state_dict().items()}
    save_tensors(folder / "model.safetensors", tensors | {f"objective.{n}": 2 * t for n, t in one.learnt().items()}, {})
    (folder / "config.yaml").write_text(cfg.to_yaml())
    return one


def test_weights_words_and_statistics_are_those_of_the_run_that_it_starts_from(tmp_path):
    before = written(tmp_path, small())
    fewer = toy()._replace(train=toy().train[:4:2])  # of which all go up: "down" would not be a word
    after = TextObjective(small(start=str(tmp_path)), fewer)
    state = after.network.state_dict()
    assert all(torch.equal(t, state[name]) for name, t in before.network.state_dict().items())
    assert torch.equal(after.statistics.mean, 2 * before.statistics.mean)
    plain = TextObjective(small(), toy())
    assert not torch.equal(plain.network.body.enter.weight, after.network.body.enter.weight)
    corrected = TextObjective(small(start=str(tmp_path), detail=4), toy()).network.body
    assert torch.equal(corrected.enter.weight, before.network.body.enter.weight) and not corrected.detail.leave.weight.any()
    before = written(tmp_path, small(detail=4))
    again = TextObjective(small(start=str(tmp_path), detail=4), toy()).network.body
    assert torch.equal(again.detail.leave.weight, before.network.body.detail.leave.weight)


def test_what_cannot_be_started_from_is_refused(tmp_path):
    written(tmp_path, small())
    with pytest.raises(
        FileNotFoundError, match="nowhere/config.yaml is missing: no finished run there; name a run of text_to_motion"
    ):
        TextObjective(small(start="nowhere"), toy())
    with pytest.raises(ValueError, match="(?s)start is .*size mismatch .*; expected a run of the same sizes"):
        TextObjective(small(start=str(tmp_path), width=32), toy())
