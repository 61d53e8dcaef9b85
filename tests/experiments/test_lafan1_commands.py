"""The command lafan1-benchmark: what it prints, writes and refuses; and the table that is committed."""

from __future__ import annotations

import csv
import io
import json
import re
from contextlib import redirect_stdout
from pathlib import Path

import pytest

import mwlib as mw
from mwlib.cli import main, measure
from mwlib.data.sources import Split
from mwlib.experiments import get_run
from mwlib.inbetweening import lafan1
from mwlib.inbetweening.lafan1 import published
from mwlib.inbetweening.windows import ready
from tests.inbetweening.sample import TASK, small, small_set

COMMITTED = Path(__file__).parents[2] / "figures" / "lafan1" / "benchmark.csv"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("data") / "lafan1"
    for motion in small_set():
        mw.write_bvh(motion, path / f"{motion.name}.bvh")
    return path


def rows_of(file: Path) -> list[dict[str, str]]:
    with file.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def test_a_part_of_the_files_cannot_be_compared(folder, tmp_path, capsys):
    assert main(["lafan1-benchmark", "--data", str(folder), "--out", str(tmp_path / "new" / "out")]) == 0
    told = capsys.readouterr().out
    assert "4 windows of subject 5, statistics of 2 clips. Published: all 2232 windows of the 77 files." in told
    assert "NOT COMPARABLE with the published numbers: 4 of 2232 windows, 5 of 77 files" in told
    blocks = re.sub(" +", " ", told).split("\n\n")
    l2q, l2p, npss = blocks[1:4]
    assert l2q.count("measured here") == l2p.count("measured here") == npss.count("measured here") == 2
    assert "0.56 | 1.10 | 1.51 | 1.81" in l2q and "1.5230 | 3.6944 | 6.6002 | 9.3289" in l2p
    assert "0.4493" in npss and "TG-complete" not in npss and "0.65 | – | 2.24" in l2p
    rows, about = rows_of(tmp_path / "new/out/benchmark.csv"), json.loads((tmp_path / "new/out/benchmark.json").read_text())
    measured = [row for row in rows if row["source"] == "measured here"]
    assert [(row["method"], row["N"], row["windows"]) for row in measured] == [
        (method, n, "4") for method in ("zero velocity", "interpolation") for n in ("5", "15", "30", "45")
    ]
    assert f"| {float(measured[1]['L2P']):.4f} |" in l2p and f"| {float(measured[6]['NPSS']):.4f} |" in npss
    assert len(rows) == 8 + len(published())
    assert about["test_windows"] == {"walk1_subject5": 2, "walk2_subject5": 2} and "CC BY-NC-ND" in about["acknowledgement"]
    assert about["protocol"]["test_window"] == 65 and about["protocol"]["statistics_clips"][0] == "aiming1_subject1"
    assert "NOT COMPARABLE" in about["verdict"]


def test_all_files_meet_the_published_digits_or_not(folder, monkeypatch, capsys):
    monkeypatch.setattr(lafan1, "ALL_WINDOWS", 4)
    assert main(["lafan1-benchmark", "--data", str(folder)]) == 0
    assert "NOT COMPARABLE" in capsys.readouterr().out  # four windows, but not all clips
    monkeypatch.setattr(lafan1, "ALL_CLIPS", 5)
    assert main(["lafan1-benchmark", "--data", str(folder)]) == 1
    told = capsys.readouterr().out
    assert "The published digits are NOT met:\n  L2P of interpolation at 15 frames is " in told
    monkeypatch.setattr(lafan1, "misses", lambda rows: [])
    assert main(["lafan1-benchmark", "--data", str(folder)]) == 0
    assert "All published digits of the two baselines are met." in capsys.readouterr().out


def test_what_cannot_be_measured_is_told(folder, tmp_path, capsys):
    for motion in small_set()[:2]:
        mw.write_bvh(motion, tmp_path / f"{motion.name}.bvh")
    assert main(["lafan1-benchmark", "--data", str(tmp_path)]) == 1
    assert main(["lafan1-benchmark", "--data", "synthetic"]) == 1
    assert main(["lafan1-benchmark", "--data", str(tmp_path / "nowhere")]) == 1
    told = capsys.readouterr().err
    assert "2 clips of subjects 1, 2; expected a clip of subject 5" in told and "is of skeleton H36M17" in told
    assert "no motions at" in told and "Traceback" not in told
    with pytest.raises(SystemExit) as end:
        main(["lafan1-benchmark", "--help"])
    text = " ".join(capsys.readouterr().out.split())
    assert end.value.code == 0 and "all 77 files" in text and "subject 5" in text and "(default: lafan1)" in text


def trained(place: Path, folder: Path, seed: int) -> Path:
    """A run of two steps."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MWLIB_RUNS", str(place))
        cfg = small(**TASK, train_steps=2, lr=0.1, seed=seed)
        return get_run(cfg, Split(ready([m for m in mw.load_motions(folder) if m.subject != "5"], 30.0), [], []))


@pytest.fixture(scope="module")
def run(folder, tmp_path_factory):
    return trained(tmp_path_factory.mktemp("runs"), folder, seed=0)


def scored(folder: Path, out: Path, *models: str, seed: str = "0") -> list[dict[str, str]]:
    """The table that the command writes of models, two samples each."""
    words = ["lafan1-benchmark", "--data", str(folder), "--samples", "2", "--seed", seed, "--out", str(out)]
    assert main([*words, *(f"--model={model}" for model in models)]) == 0
    return rows_of(out / "benchmark_model.csv")


@pytest.fixture(scope="module")
def alone(folder, run, tmp_path_factory) -> tuple[Path, str]:
    """The folder of one run's table, and what the command printed."""
    out = tmp_path_factory.mktemp("alone")
    with redirect_stdout(io.StringIO()) as printed:
        scored(folder, out, str(run))
    return out, " ".join(printed.getvalue().split())


def test_a_trained_model_gets_its_rows(folder, run, alone, tmp_path):
    out, told = alone
    rows = [row for row in rows_of(out / "benchmark_model.csv") if row["source"] == measure.MEASURED]
    names = ["zero velocity", "interpolation"]
    names += [f"{run.name}, {what}" for what in ("single samples", "average of 2", "its curve")]
    assert [row["method"] for row in rows] == [name for name in names for _ in range(4)]
    for row, metric, digits in ((rows[9], "L2P", 4), (rows[14], "L2Q", 3)):
        assert f"| {float(row[metric]):.{digits}f} |" in told
    about = json.loads((out / "benchmark_model.json").read_text())
    (model,) = about["models"]
    assert model["run"] == model["name"] == run.name and model["past"] == 10 and model["samples"] == 2
    assert len(model["file"]) == 64 and model["people"]["train"] == ["1", "2", "4"]
    assert about["seeds"] == "0, of the models' noise"
    assert about["command"].endswith(f'--model "{run.name}={run.name}" --samples 2 --seed 0')
    assert scored(folder, tmp_path, str(run), seed="1") != rows_of(out / "benchmark_model.csv")


def test_runs_of_one_name_are_averaged(folder, run, alone, tmp_path):
    """And the same seed gives the same numbers: the run is measured again."""
    other = trained(tmp_path, folder, seed=1)
    first, second = rows_of(alone[0] / "benchmark_model.csv")[8:20], scored(folder, tmp_path, f"{run.name}={other}")[8:20]
    together = scored(folder, tmp_path / "both", f"{run.name}={run}", f"{run.name}={other}")[8:20]
    assert first != second
    for a, b, mean in zip(first, second, together, strict=True):
        assert mean["method"] == a["method"] == b["method"] and mean["trainings"] == "2"
        values = [float(row["L2P"]) for row in (a, b)]
        assert float(mean["L2P"]) == pytest.approx(sum(values) / 2)
        assert float(mean["L2P, deviation"]) == pytest.approx(abs(values[0] - values[1]) / 2**0.5)
    about = json.loads((tmp_path / "both" / "benchmark_model.json").read_text())
    assert [model["run"] for model in about["models"]] == [run.name, other.name]


def test_a_model_that_does_not_fit_is_refused_before_anything_is_measured(folder, run, monkeypatch, capsys):
    given = ["lafan1-benchmark", "--data", str(folder), "--model"]
    monkeypatch.setattr(lafan1, "lafan1_benchmark", None)
    assert main([*given, "inbetween"]) == main([*given, "cmu"]) == main([*given, "nowhere"]) == 1
    assert main([*given, str(run), "--samples", "0"]) == 1
    told = capsys.readouterr().err
    assert "the model is of skeleton H36M17 with 17 joints; expected one of LaFAN1's 22 joints" in told
    assert "run is cmu, a run of another system; expected one of in-betweening" in told and "Traceback" not in told
    assert "nowhere/config.yaml is missing" in told and "samples is 0; expected at least 1" in told


def test_the_committed_table_says_what_it_is():
    rows, about = rows_of(COMMITTED), json.loads(COMMITTED.with_suffix(".json").read_text(encoding="utf-8"))
    measured = [row for row in rows if row["source"] == measure.MEASURED]
    assert len(measured) == 8 and {row["windows"] for row in measured} == {str(sum(about["test_windows"].values()))}
    assert "CC BY-NC-ND 4.0" in about["acknowledgement"] and "Robust Motion In-Betweening" in about["acknowledgement"]
    assert about["verdict"].startswith("NOT COMPARABLE") and about["clips"] == 10
    said = {(row["method"], row["N"]): (row["L2Q"], row["L2P"], row["NPSS"]) for row in rows if row not in measured}
    for row in published():
        expected = ("" if row[m] is None else f"{row[m]:.9g}" for m in ("L2Q", "L2P", "NPSS"))
        assert said[row["method"], str(row["N"])] == tuple(expected)
    assert not any(word in COMMITTED.with_suffix(".json").read_text() for word in ("/work", "/tmp", "/home"))


def test_the_committed_table_is_what_the_files_give(data_folder, tmp_path):
    assert main(["lafan1-benchmark", "--data", "lafan1", "--out", str(tmp_path)]) == 0
    about, again = (json.loads((f / "benchmark.json").read_text(encoding="utf-8")) for f in (COMMITTED.parent, tmp_path))
    if about["data_fingerprint"] == again["data_fingerprint"]:  # else these are other files
        for old, new in zip(rows_of(COMMITTED), rows_of(tmp_path / "benchmark.csv"), strict=True):
            assert (old["method"], old["N"], old["source"]) == (new["method"], new["N"], new["source"])
            for metric in ("L2Q", "L2P", "NPSS"):
                assert (old[metric], new[metric]) == ("", "") or float(new[metric]) == pytest.approx(float(old[metric]), rel=1e-6)
