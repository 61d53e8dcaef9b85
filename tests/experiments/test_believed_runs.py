"""A run is what it says: its configuration is the one that trained it, and its model is the one that its result names."""

from __future__ import annotations

import json
import re
import shutil

import pytest
import torch
import yaml

from mwlib.data.formats.humanml import HUMANML3D
from mwlib.experiments import get_model, get_run, load_run
from mwlib.experiments.grids import read_config, system
from mwlib.experiments.results import RESULT, result_of
from mwlib.hashing import file_hash
from mwlib.matching.evaluators import open_matcher
from mwlib.paths import CONFIG, MODELS
from mwlib.training import CHECKPOINT, CURVES, MODEL, PREVIOUS
from mwlib.training.checkpoint import DamagedFileError, load_tensors, save_tensors
from tests.sample_settings import small, two_people


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """Runs with one finished training; and the training."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MWLIB_RUNS", str(tmp_path_factory.mktemp("runs")))
        return get_run(small(), two_people())


@pytest.fixture
def run(finished, monkeypatch, tmp_path):
    """A copy of it, to be spoilt."""
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path))
    return shutil.copytree(finished, tmp_path / finished.name)


def spoil(file):
    content = bytearray(file.read_bytes())
    content[-5] ^= 1
    file.write_bytes(bytes(content))


def cut(file):
    file.write_bytes(file.read_bytes()[:-100])


DAMAGES = {"flipped": spoil, "cut": cut, "gone": lambda file: file.unlink()}


def test_a_run_without_its_configuration_gets_it_back_as_it_was(run):
    before = (run / CONFIG).read_text()
    (run / CONFIG).unlink()
    assert get_run(small(guidance_weight=3.0), two_people()) == run
    assert (run / CONFIG).read_text() == before and load_run(run).sampling.guidance_weight == 0.0


@pytest.mark.parametrize("name", ["prediction", "inbetweening", "text_to_motion", "matching"])
def test_no_part_of_a_configuration_is_taken_for_all_of_it(tmp_path, name):
    cfg, file = system(name).Config(), tmp_path / CONFIG
    lines = cfg.to_yaml().splitlines(keepends=True)
    for count, following in enumerate(lines):
        if name != "prediction" and following[0] == " ":
            continue  # every line of one system, every group of the others
        file.write_text("".join(lines[:count]))
        with pytest.raises(ValueError, match=re.escape(str(file))):
            read_config(file)
    file.write_text("".join(lines))
    assert read_config(file) == cfg


def test_every_setting_of_a_run_is_there_but_newer_ones():
    cfg = system("inbetweening").Config()
    whole = yaml.safe_load(cfg.to_yaml())
    for name, group in cfg.owners().items():
        tree = whole | {group: {other: value for other, value in whole[group].items() if other != name}}
        if name in type(cfg).newer:
            assert type(cfg).from_yaml(yaml.safe_dump(tree)) == cfg
            continue
        with pytest.raises(ValueError, match=f"the configuration lacks {name}; expected every setting"):
            type(cfg).from_yaml(yaml.safe_dump(tree))


def test_a_cut_or_edited_configuration_opens_no_model(run):
    text = (run / CONFIG).read_text()
    for length in (0, len(text) // 2, len(text) - 2):
        (run / CONFIG).write_text(text[:length])
        with pytest.raises(ValueError, match=CONFIG):
            load_run(run)
    (run / CONFIG).write_text(text)
    load_run(run)


@pytest.mark.parametrize(
    "changes, message",
    [
        (
            {"schedule": "linear"},
            r"is not the configuration that trained model.safetensors: schedule is 'linear'; expected '\w+'\. ",
        ),
        ({"lr": 1.0, "width": 32}, r"width is 32; expected 16, lr is 1.0; expected 0"),
        (
            {"guidance_weight": 9.0},
            r"was edited: guidance_weight is 9.0; expected 0.0\. A run's settings .* by with_sampling, all others",
        ),
        ({"ddim_steps": 3, "samples": 4}, r"was edited: samples is 4; expected 3, ddim_steps is 3; expected 5"),
    ],
)
def test_an_edited_setting_is_named(run, changes, message):
    (run / CONFIG).write_text(read_config(run / CONFIG).override(**changes).to_yaml())
    with pytest.raises(ValueError, match=message):
        load_run(run)


def test_a_model_that_carries_no_settings_is_known_by_their_hash(run):
    tensors, about = load_tensors(run / MODEL)
    assert json.loads(about.pop("settings"))["diffusion"]["schedule"] == small().diffusion.schedule
    save_tensors(run / MODEL, tensors, about)
    load_run(run)
    (run / CONFIG).write_text(small(schedule="linear").to_yaml())
    with pytest.raises(ValueError, match=f"their hash is {small(schedule='linear').training_hash()}; expected {about['key']}"):
        load_run(run)
    with pytest.raises(ValueError, match="expected every setting|does not say which system"):
        (run / CONFIG).write_text("system: prediction\n")
        load_run(run)


def test_settings_of_a_model_that_comes_with_the_package_are_not_edited(tmp_path):
    folder = shutil.copytree(MODELS / "synthetic", tmp_path / "synthetic")
    cfg = read_config(folder / CONFIG)
    (folder / CONFIG).write_text(cfg.override(samples=3).to_yaml())
    with pytest.raises(ValueError, match=f"was edited: the hash of its settings is .*expected {cfg.hash()}"):
        load_run(folder)


def test_a_judge_with_other_settings_does_not_judge(tmp_path):
    folder = shutil.copytree(MODELS / "evaluator", tmp_path / "evaluator")
    file = folder / CONFIG
    file.write_text(read_config(file).override(seed=3).to_yaml())
    with pytest.raises(ValueError, match="is not the configuration that trained model.safetensors"):
        open_matcher(str(folder), HUMANML3D)
    file.write_text(file.read_text().rstrip().rpartition("\n")[0])
    with pytest.raises(ValueError, match="expected every setting"):
        open_matcher(str(folder), HUMANML3D)


def test_text_that_is_none_is_refused_by_name(run):
    (run / CONFIG).write_bytes((run / CONFIG).read_bytes().replace(b"system", b"sy\xffem", 1))
    with pytest.raises(
        ValueError, match=re.escape(f"{run / CONFIG} is not YAML: 'utf-8' codec can't decode byte 0xff in position 2")
    ):
        load_run(run)


@pytest.mark.parametrize("result", [True, False], ids=["finished", "before its result"])
@pytest.mark.parametrize("name, damage", [(MODEL, "flipped"), (MODEL, "cut"), (MODEL, "gone"), (CURVES, "cut"), (CURVES, "gone")])
def test_what_is_lost_is_made_again_from_the_checkpoint(run, caplog, name, damage, result):
    before, checkpoint = (
        {file: (run / file).read_bytes() for file in (MODEL, CURVES, RESULT)},
        (run / CHECKPOINT).stat().st_mtime_ns,
    )
    DAMAGES[damage](run / name)
    if not result:
        (run / RESULT).unlink()
    if name == MODEL:
        with pytest.raises((DamagedFileError, FileNotFoundError), match=f"{CHECKPOINT} is there: train with the run's settings"):
            load_run(run)
    assert get_run(small(), two_people()) == run
    assert {file: (run / file).read_bytes() for file in before} == before
    assert (run / CHECKPOINT).stat().st_mtime_ns == checkpoint, "no step was trained again"
    assert [name in message and f"made again from {CHECKPOINT}" in message for message in caplog.messages] == [True] * result
    caplog.clear()
    assert get_run(small(), two_people()) == run and not caplog.messages


def test_another_models_weights_are_written_over(run):
    tensors, about = load_tensors(run / MODEL)
    (run / RESULT).unlink()
    name = max(tensors, key=lambda name: tensors[name].numel())
    save_tensors(run / MODEL, tensors | {name: tensors[name] + 1}, about)
    get_run(small(), two_people())
    assert torch.equal(load_tensors(run / MODEL)[0][name], tensors[name])


def test_a_lost_model_without_a_checkpoint_is_trained_again_and_that_is_said(run, caplog):
    for name in (CHECKPOINT, PREVIOUS, CURVES):
        (run / name).unlink()
    assert get_run(small(), two_people()) == run and not caplog.messages, "a finished run needs no curves"
    expected = (run / MODEL).read_bytes()
    spoil(run / MODEL)
    get_model(small(), two_people())
    assert (run / MODEL).read_bytes() == expected and "made again by another training" in caplog.messages[-1]
    assert result_of(run)["depends"]["model"] == file_hash(run / MODEL)


@pytest.mark.parametrize(
    "text, message",
    [
        ("system: prediction\n", r"lacks the group data.*Delete config.yaml: going on with the run writes it again"),
        (small(lr=1.0).to_yaml(), r"belongs to a run with other settings: lr is 1.0; expected 0"),
    ],
)
def test_a_stopped_run_goes_on_with_its_own_settings_alone(run, text, message):
    (run / RESULT).unlink()
    before = (run / CONFIG).read_text()
    (run / CONFIG).write_text(text)
    with pytest.raises(ValueError, match=message):
        get_run(small(), two_people())
    (run / CONFIG).unlink()
    assert get_run(small(), two_people()) == run and (run / CONFIG).read_text() == before


def test_a_clock_that_jumps_back_changes_no_bit(finished, monkeypatch, tmp_path):
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path))
    jumps = iter(range(10**9, 0, -86_400))
    monkeypatch.setattr("time.time", lambda: float(next(jumps)))
    run = get_run(small(), two_people())
    assert file_hash(run / MODEL) == file_hash(finished / MODEL) and result_of(run) is not None
    assert 0 <= result_of(run)["metrics"]["seconds"] < 3600
