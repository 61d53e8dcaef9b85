"""The command line as a whole: which room a command is found in, and what it waits for."""

import importlib
import subprocess
import sys
from argparse import ArgumentParser

import pytest

from mwlib.__main__ import ROOMS, main
from mwlib.experiments.grid_options import given_changes, grid_options


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_has_the_commands_that_it_is_listed_with(room):
    subparsers = ArgumentParser().add_subparsers()
    importlib.import_module(room).add_parser(subparsers)
    assert tuple(subparsers.choices) == ROOMS[room]


def test_help_lists_the_commands_of_all_rooms(capsys):
    with pytest.raises(SystemExit) as end:
        main(["--help"])
    said = capsys.readouterr().out
    assert end.value.code == 0 and all(command in said for commands in ROOMS.values() for command in commands)


@pytest.mark.parametrize("words", [["run-notebook", "--help"], ["course", "--help"]])
def test_a_command_that_only_starts_others_imports_neither_torch_nor_matplotlib(words):
    code = f"""if True:
        import sys
        from mwlib.__main__ import main
        try:
            main({words})
        except SystemExit:
            print({{'torch', 'matplotlib', 'scipy'}} & {{*sys.modules}})"""
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert said.endswith("set()\n")


def test_an_unknown_command_is_refused_with_those_there_are(capsys):
    with pytest.raises(SystemExit):
        main(["trian"])
    assert "train" in capsys.readouterr().err


def test_data_and_settings_of_a_grid_command_change_the_preset():
    parser = ArgumentParser()
    grid_options(parser)
    given = parser.parse_args(["--data", "my/folder", "--set", "lr=0.5", "--set", "samples=3", "--out", "build"])
    assert given_changes(given) == {"data": "my/folder", "lr": 0.5, "samples": 3}
    assert given_changes(parser.parse_args(["--out", "build"])) == {}
