"""The command line: commands and options as the source states them, help that waits for nothing, refusals that help."""

import ast
import importlib
import inspect
import os
import subprocess
import sys
import typing
from pathlib import Path

import pytest

from mwlib.cli import main, parse
from mwlib.cli.options import choice_of
from mwlib.cli.source import ADVANCED, arguments, commands, names_of, settings_text
from mwlib.data.collections import COLLECTIONS, SKELETONS
from mwlib.experiments.systems import MODULES, system

COMMANDS = commands()
NAMES = """
    check-data write-synthetic fetch train grid-table ship storyboards reproduction lafan1-benchmark predict export-bvh loop
    inbetween generate course run-notebook execute-notebooks learner-copies index-page claims site-sources run-experiment
""".split()


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


def test_help_lists_the_commands(capsys):
    said = helped([], capsys)
    assert [*COMMANDS] == NAMES and all(squeezed(f"{name} {command.summary}") in said for name, command in COMMANDS.items())


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
    assert ("--accept-older-code" in said) == (name not in (*NAMES[:3], *NAMES[14:15], *NAMES[16:21]))
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
    assert {name.strip() for name in shown[1]} == config.advanced()
    assert {name.strip() for part in shown for name in part} == {*config.owners()}
    for setting, said in (shown[0] | shown[1]).items():
        default, _, meaning = said.partition("  ")
        assert ast.literal_eval(default) == config().get(setting.strip()) and meaning, setting


@pytest.mark.parametrize("words", [["--help"], ["train", "--help"], ["check-data", "--help"], ["fetch", "-h"], ["exportbvh"]])
def test_help_and_mistyped_words_wait_for_no_torch(words):
    code = f"""if True:
        import sys
        from mwlib.cli import main
        try:
            main({words})
        except SystemExit:
            print({{'torch', 'matplotlib', 'numpy', 'scipy'}} & {{*sys.modules}})"""
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert said.endswith("set()\n")


@pytest.mark.parametrize(
    "words, near",
    [
        (["trian"], "there is no command 'trian', did you mean train?; expected one of check-data"),
        (["exportbvh", "runs/1"], "did you mean export-bvh?"), (["xyz"], "there is no command 'xyz'; expected one of"),
        (["predict", "runs/1", "synthetic", "--sample=3"], ""), (["predict", "runs/1"], "required: SOURCE"),
        (["train", "--sets", "lr=1"], "'--sets' is not understood, did you mean --set?"),
        (["train", "--preste=tiny"], "did you mean --preset?"),
        (["grid-table", "main"], "required: --out"), (["ship", "nobody"], "invalid choice: 'nobody'"),
        (["predict", "runs/1", "synthetic", "--up", "x"], "invalid choice: 'x'"),
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
    assert "mwlib: unknown setting 'test_window'; did you mean 'test_windows'?" in capsys.readouterr().err


def test_older_code_is_accepted_where_somebody_says_so(monkeypatch):
    monkeypatch.delenv("MWLIB_ACCEPT_OLDER_CODE", raising=False)
    assert main(["train", "--preset", "nothing"]) == 1 and "MWLIB_ACCEPT_OLDER_CODE" not in os.environ
    monkeypatch.setenv("MWLIB_ACCEPT_OLDER_CODE", "")
    assert main(["train", "--preset", "nothing", "--accept-older-code"]) == 1 and os.environ["MWLIB_ACCEPT_OLDER_CODE"] == "1"


def test_data_and_settings_of_a_grid_command_change_the_preset():
    _, given = parse(["grid-table", "table_4", "--data", "my/folder", "--set", "lr=0.5", "--set", "samples=3", "--out", "build"])
    assert choice_of(**given).changes == {"data": "my/folder", "lr": 0.5, "samples": 3}
    chosen = choice_of("table_4", out=Path("build"))
    assert chosen.changes == {} and chosen.preset == "tiny" and chosen.cfg == system("prediction").Config.preset("tiny")
    with pytest.raises(ValueError, match="grid is 'table_40'; .*grids.yaml has main"):
        choice_of("table_40", out=Path("build"))


def test_types_of_arguments_are_true():
    """What is read from the source as text are types that Python knows."""
    for command in COMMANDS.values():
        assert typing.get_type_hints(getattr(importlib.import_module(command.module), command.definition.name))
