"""The command line: commands and options as the source states them, help that waits for nothing, refusals that help."""

import ast
import importlib
import inspect
import json
import os
import re
import subprocess
import sys
import tempfile
import typing
from pathlib import Path

import pytest
from tqdm import tqdm

from mwlib.cli import main, parse
from mwlib.cli.options import choice_of
from mwlib.cli.source import ADVANCED, arguments, commands, names_of, settings_text
from mwlib.course.notebooks import chapter_number, find_notebook
from mwlib.data.collections import COLLECTIONS, SKELETONS
from mwlib.data.formats.bvh import write_bvh
from mwlib.experiments.grids import MODULES, system
from mwlib.synthetic.motions import synthetic_motions

pytestmark = pytest.mark.usefixtures("grids_read_once")
COMMANDS = commands()
NAMES = """
    check-data write-synthetic fetch predict export-bvh export-onnx loop inbetween generate train judge grid-table ship
    storyboards reproduction lafan1-benchmark course run-notebook execute-notebooks learner-copies index-page claims site-sources
    run-experiment
""".split()
WITHOUT_RUNS = {
    "check-data", "write-synthetic", "fetch", "course", "execute-notebooks", "learner-copies", "index-page", "claims",
    "site-sources",
}  # fmt: skip
GROUPS = ["use", "train and measure", "course", "maintain"]
ORDERED = ["check-data", "generate", "train", "lafan1-benchmark", "course", "claims", "ship", "site-sources"]


def refused(words: list[str], capsys) -> str:
    with pytest.raises(SystemExit) as end:
        main(words)
    assert end.value.code == 2
    return capsys.readouterr().err


def helped(words: list[str], capsys) -> str:
    with pytest.raises(SystemExit) as end:
        main([*words, "--help"])
    assert end.value.code == 0
    return squeezed(capsys.readouterr().out)


def squeezed(text: str) -> str:
    """Without spaces, however lines are broken."""
    return "".join(text.split())


@pytest.mark.parametrize("words", [["--help"], []])
def test_help_lists_the_commands_in_groups(words, capsys):
    with pytest.raises(SystemExit, match="0|None"):
        main(words)
    said = capsys.readouterr().out
    assert [*COMMANDS] == NAMES and re.findall(r"^([a-z ]+):$", said, re.M)[1:] == GROUPS
    assert all(squeezed(f"{name} {command.summary}") in squeezed(said) for name, command in COMMANDS.items())
    places = [said.index(f"\n  {name} ") if f"\n  {name} " in said else said.index(f"\n  {name}\n") for name in ORDERED]
    assert places == sorted(places) and {*ORDERED} <= {*NAMES}


@pytest.mark.parametrize("name", COMMANDS)
def test_help_is_what_the_function_says(name, capsys):
    """Every option is an argument of the function, or of one that it hands its arguments to, and says what it means."""
    command = COMMANDS[name]
    found = inspect.signature(getattr(importlib.import_module(command.module), command.definition.name)).parameters
    shared = any(each.kind is inspect.Parameter.VAR_KEYWORD for each in found.values())
    said = helped([name], capsys)
    assert squeezed(command.about) in said
    stated = {
        option.lstrip("-").replace("-", "_"): settings for option, settings in arguments(command.module, command.definition)
    }
    assert ("--accept-older-code" in said) == (name not in WITHOUT_RUNS)
    assert {each for each in found if found[each].kind is not inspect.Parameter.VAR_KEYWORD} <= {*stated}
    assert shared or {*found} == {*stated}
    for settings in stated.values():
        assert squeezed(settings["help"].replace("%%", "%")) in said and "`" not in settings["help"]


@pytest.mark.parametrize(
    "module, variable",
    [
        ("mwlib.data.meaning", "UNITS"), ("mwlib.prediction.config", "PRESETS"),
        ("mwlib.experiments.shipped", "RECIPES"),
    ],
)  # fmt: skip
def test_names_read_from_the_source_are_those_of_the_library(module, variable):
    assert names_of(module, variable) == [*getattr(importlib.import_module(module), variable)]
    assert {*names_of("mwlib.data.collections", "Collection")} == {*COLLECTIONS}
    skeletons = [name for room in ("body.skeleton", "data.collections") for name in names_of(f"mwlib.{room}", "named_tree")]
    assert sorted(skeletons) == sorted(SKELETONS)


@pytest.mark.parametrize("name", MODULES)
def test_settings_read_from_the_source_are_those_of_the_system(name):
    config = system(name).Config
    text = settings_text(name)
    assert f"Presets of {name}: {', '.join(config.presets)}\n" in text
    presets, _, text = text.partition("Its settings")
    told = dict(line[2:].split("  ", 1) for line in presets.splitlines() if line.startswith("  "))
    assert {"tiny", "laptop"} <= {*told} <= {*config.presets} and all(said.endswith(".") for said in told.values())
    usual, _, advanced = text.partition(ADVANCED)
    shown = [dict(line.split(" = ", 1) for line in part.splitlines() if line.startswith("  ")) for part in (usual, advanced)]
    hints = [hint for group in config.groups().values() for hint in typing.get_type_hints(group, include_extras=True).items()]
    assert {name.strip() for name in shown[1]} == {name for name, hint in hints if "advanced" in typing.get_args(hint)}
    assert {name.strip() for part in shown for name in part} == {*config.owners()}
    for setting, said in (shown[0] | shown[1]).items():
        default, _, meaning = said.partition("  ")
        assert ast.literal_eval(default) == config().get(setting.strip()) and meaning, setting


def test_help_and_mistyped_words_wait_for_no_torch():
    code = """if True:
        import sys
        from mwlib.cli import main
        for words in (["--help"], ["train", "--help"], ["check-data", "--help"], ["fetch", "-h"], ["exportbvh"]):
            try:
                main(words)
            except SystemExit:
                print(words, {'torch', 'matplotlib', 'numpy', 'scipy'} & {*sys.modules})"""
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert said.count("] set()\n") == 5


@pytest.mark.parametrize(
    "words, near",
    [
        (["trian"], "mwlib: there is no command 'trian' (did you mean 'train'?); mwlib --help lists all\n"),
        (["exportbvh", "runs/1"], "(did you mean 'export-bvh'?)"), (["xyz"], "there is no command 'xyz'; mwlib --help lists all"),
        (["--quiet", "train"], "'--quiet' comes before the command; expected mwlib COMMAND --quiet"),
        (["--versoin"], "'--versoin' is not understood (did you mean '--version'?)"),
        (["predict", "runs/1", "synthetic", "--sample=3"], ""), (["predict", "runs/1"], "required: SOURCE"),
        (["train", "--sets", "lr=1"], "'--sets' is not understood (did you mean '--set'?)"),
        (["train", "--preste=tiny"], "(did you mean '--preset'?)"),
        (["grid-table", "main"], "required: --out"), (["ship", "cmuu"], "there is no 'cmuu' (did you mean 'cmu'?)\n"),
        (["predict", "runs/1", "synthetic", "--up", "q"], "argument --up: there is no 'q'; expected y, z\n"),
        (["train", "--system", "telepathy", "--help"], "expected one of prediction"),
        (["predict", "runs/1", "synthetic", "--samples", "many"], "invalid int value"),
    ],
)  # fmt: skip
def test_what_is_not_understood_is_refused_with_what_is_near(words, near, capsys):
    if near:
        assert near in refused(words, capsys)
    else:  # beginnings of an option's name will do
        assert parse(words)[1]["samples"] == 3


@pytest.mark.parametrize(
    "words, expected",
    [
        (["inbetween", "a.bvh", "--keyframes", "0", "30"], {"start": "a.bvh", "end": None, "keyframes": [0, 30]}),
        (["inbetween", "a.bvh", "b.bvh", "--between=9", "--up=z"], {"start": "a.bvh", "end": "b.bvh", "between": 9, "up": "z"}),
        (["generate", "a", "b", "--plain"], {"texts": ["a", "b"], "plain": True}),
        (["train", "--set", "lr=1", "--set", "seed=2"], {"set": ["lr=1", "seed=2"]}), (["fetch"], {"name": None}),
        (["execute-notebooks"], {"notebooks": []}), (["execute-notebooks", "01", "02"], {"notebooks": ["01", "02"]}),
        (["check-data", "x", "--file-fps", "30"], {"path": "x", "file_fps": 30.0}),
        (["run-experiment", "main", "3", "1", "--out=o"], {"grid": "main", "row": 3, "seed": 1, "out": Path("o")}),
        (["predict", "r", "s", "--clips", "2"], {"run": Path("r"), "source": "s", "clips": 2}),
    ],
)  # fmt: skip
def test_words_become_arguments_and_defaults_stay_with_the_function(words, expected):
    assert parse(words)[1] == expected


def test_a_mistake_is_told_in_a_sentence(capsys):
    assert main(["train", "--preset", "tiny", "--set", "test_window=3"]) == 1
    assert capsys.readouterr().err == "mwlib: unknown setting 'test_window'; did you mean 'test_windows'?\n"
    assert main(["train", "--preset", "tiny", "--set", "zzz=3"]) == 1
    assert capsys.readouterr().err == "mwlib: unknown setting 'zzz'; mwlib train --system prediction --help lists all\n"
    assert main(["run-notebook", "06_trainin"]) == 1
    assert "no notebook '06_trainin' (did you mean '06_training'?)" in capsys.readouterr().err


@pytest.mark.parametrize(
    "words, meant",
    [
        (["run-notebook", "5c"], "05_diffusion_of_one_number"), (["run-notebook", "3x"], "03_choosing_a_wavelet"),
        (["check-data", "synthtic"], "synthetic"), (["export-onnx", "synthetik"], "synthetic"),
        (["train", "--system", "inbetwening"], "inbetweening"), (["train", "--preset", "lptop"], "laptop"),
        (["train", "--set", "wavelet=haarr"], "haar"), (["run-notebook", "3", "--set", "presett=tiny"], "preset"),
        (["grid-table", "table_44", "--out", "x"], "table_4"),
    ],
)  # fmt: skip
def test_a_mistyped_value_is_answered_with_a_near_one(words, meant, capsys):
    assert main(words) == 1
    assert f"(did you mean {meant!r}?)" in capsys.readouterr().err


@pytest.mark.parametrize("said, expected", [("3", "03"), ("03", "03"), ("5", "05"), ("5b", "05b"), ("05b", "05b"), ("10", "10")])
def test_a_chapter_goes_by_its_number(said, expected):
    assert chapter_number(find_notebook(said)) == expected


@pytest.mark.parametrize("said", ["b", "05c", "005", ""])
def test_what_is_no_chapter_is_refused(said):
    with pytest.raises(FileNotFoundError, match="expected a path, a name or a number of: 00_"):
        find_notebook(said)


def test_bars_are_left_out_where_somebody_says_so(monkeypatch, capsys):
    monkeypatch.setattr("mwlib.cli.data.fetch", lambda **_: len([*tqdm(range(3), disable=False)]))
    assert main(["fetch", "--quiet"]) == 3 and capsys.readouterr().err == ""
    assert main(["fetch"]) == 3 and "3/3" in capsys.readouterr().err


def test_an_interrupted_command_ends_without_a_traceback(monkeypatch, capsys):
    def interrupted(**_):
        raise KeyboardInterrupt

    monkeypatch.setattr("mwlib.cli.data.fetch", interrupted)
    assert main(["fetch"]) == 130 and capsys.readouterr().err == "mwlib: interrupted\n"


def test_programs_get_json(capsys, tmp_path):
    (tmp_path / "broken.bvh").write_text("no motion")
    write_bvh(synthetic_motions(subjects=1)[0].cut(0, 20), tmp_path / "walk.bvh")
    assert main(["check-data", str(tmp_path), "--json"]) == 1
    told = json.loads(capsys.readouterr().out)
    (clip,) = told["clips"]
    assert not told["ok"] and "broken.bvh" in told["report"] and told["training"]
    assert (clip["frames"], clip["joints"], clip["fps"]) == (20, 17, {"value": 50.0, "source": "the file"})
    (tmp_path / "build" / "01_dwt_from_scratch").mkdir(parents=True)
    assert main(["claims", str(tmp_path / "build"), "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["build"]["02_motion_wavelet_manifold"]["status"] == "not run"


def completed(line: str) -> list[str]:
    """What a shell is told as the Tab key is pressed behind a line."""
    asked = {"_ARGCOMPLETE": "1", "_ARGCOMPLETE_STDOUT_FILENAME": os.devnull, "COMP_LINE": line, "COMP_POINT": str(len(line))}
    code = "import sys; from mwlib.cli import main; main()"
    with tempfile.NamedTemporaryFile("r") as answer:
        environment = os.environ | asked | {"_ARGCOMPLETE_STDOUT_FILENAME": answer.name, "_ARGCOMPLETE_IFS": "\n"}
        subprocess.run([sys.executable, "-c", code], env=environment, check=True, timeout=60)
        return answer.read().split()


@pytest.mark.parametrize(
    "line, expected",
    [
        ("mwlib tr", ["train"]), ("mwlib train --pres", ["--preset"]), ("mwlib fetch cm", ["cmu"]),
        ("mwlib train --system inbetweening --preset lafan1_off", ["lafan1_official"]),
        ("mwlib train --set train_ste", ["train_steps="]), ("mwlib train --system text_t", ["text_to_motion"]),
    ],
)  # fmt: skip
def test_a_shell_that_asks_is_told_what_fits(line, expected):
    assert completed(line) == expected


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("predict synthetic synthetic --clips -1", "clips is -1; expected at least 0"),
        ("predict synthetic synthetic --out p.txt", "out is p.txt; expected a name that ends in .npz"),
        ("loop synthetic synthetic --width 0", "width is 0; expected at least 16"),
        ("loop synthetic synthetic --out l.jpg", "out is l.jpg; expected a name that ends in .png or .webp or .gif"),
        ("write-synthetic s.txt", "path is s.txt; expected a name that ends in .npz"),
        ("write-synthetic s.npz --seed -1", "seed is -1; expected at least 0"),
        ("check-data synthetic --picture p.jpg", "picture is p.jpg; expected a name that ends in .png"),
        ("check-data ", "source is ''; expected a path"),
        ("run-notebook 05 --timeout nan", "timeout is nan; expected more than 0 seconds"),
    ],
)
def test_options_are_checked_before_the_work(words, message, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert main(words.split(" ")) == 1 and message in capsys.readouterr().err and [*tmp_path.iterdir()] == []


def test_a_folder_that_cannot_be_made_is_told_before_a_grid_is_measured(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("mwlib.cli.measure.measure", lambda *given, **options: pytest.fail("measured all the same"))
    (tmp_path / "file").touch()
    assert main(["grid-table", "table_4", "--out", str(tmp_path / "file")]) == 1
    assert f"File exists: '{tmp_path / 'file'}'" in capsys.readouterr().err


def test_older_code_is_accepted_where_somebody_says_so(monkeypatch):
    monkeypatch.delenv("MWLIB_ACCEPT_OLDER_CODE", raising=False)
    assert main(["train", "--preset", "nothing"]) == 1 and "MWLIB_ACCEPT_OLDER_CODE" not in os.environ
    monkeypatch.setenv("MWLIB_ACCEPT_OLDER_CODE", "")
    assert main(["train", "--preset", "nothing", "--accept-older-code"]) == 1 and os.environ["MWLIB_ACCEPT_OLDER_CODE"] == "1"


def test_data_and_settings_of_a_grid_command_change_the_preset():
    _, given = parse(["grid-table", "table_4", "--data", "my/folder", "--set", "lr=0.5", "--set", "samples=3", "--out", "build"])
    assert choice_of(**given)[2] == {"data": "my/folder", "lr": 0.5, "samples": 3}
    grid, *others = choice_of("table_4", out=Path("build"))
    assert grid.id == "table_4" and others == ["tiny", {}, Path("build")]
    with pytest.raises(ValueError, match=r"grid is 'table_40' \(did you mean 'table_4'\?\); .*grids.yaml has main"):
        choice_of("table_40", out=Path("build"))


def test_types_of_arguments_are_true():
    """What is read from the source as text are types that Python knows."""
    for command in COMMANDS.values():
        assert typing.get_type_hints(getattr(importlib.import_module(command.module), command.definition.name))


def test_help_that_finds_no_room_says_so_in_one_line():
    with open("/dev/full", "w", encoding="utf-8") as full:
        found = subprocess.run([sys.executable, "-m", "mwlib", "train", "--help"], stdout=full, stderr=subprocess.PIPE, text=True)
    assert found.returncode == 1 and found.stderr == "mwlib: [Errno 28] No space left on device\n"


def test_a_warning_does_not_show_the_library(tmp_path, monkeypatch):
    """In a process of its own, as pytest keeps warnings."""
    (tmp_path / "broken.bvh").write_text("no motion")
    write_bvh(synthetic_motions(subjects=1)[0], tmp_path / "walk.bvh")
    words = [
        sys.executable,
        "-m",
        "mwlib",
        "predict",
        "synthetic",
        str(tmp_path),
        "--samples",
        "1",
        "--out",
        str(tmp_path / "x.npz"),
    ]
    found = subprocess.run(words, capture_output=True, text=True)
    assert found.returncode == 0 and found.stderr.startswith("mwlib: 1 of 2 files") and ".py" not in found.stderr
