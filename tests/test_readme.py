"""README's Python example runs as it stands there, but with a shorter training, and its first screen is short."""

from __future__ import annotations

import re
from pathlib import Path

import mwlib as mw

README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")


def test_examples_run(monkeypatch, tmp_path, capsys):
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path / "runs"))
    monkeypatch.chdir(tmp_path)
    known: dict[str, object] = {}
    (block,) = re.findall(r"```python\n(.*?)```", README, re.S)
    assert len(re.findall(r"^\S", block, re.M)) <= 10 and "train_steps=200" in block
    exec(compile(block.replace("train_steps=200", "train_steps=2"), "README.md", "exec"), known)
    assert tuple(known["futures"].shape) == (4, 10, 100, 48) and (tmp_path / "between.bvh").is_file()
    assert "tensor" in capsys.readouterr().out
    for number, motion in enumerate(known["motions"][:3]):
        mw.write_bvh(motion, tmp_path / "my" / "folder" / f"clip_{number}.bvh")
    yours = known["model"].predict(mw.load_motions("my/folder"), samples=2, seed=0)
    assert tuple(yours.shape) == (3, 2, 100, 48), "a folder of BVH files in place of the embedded people"


def test_the_first_screen_says_what_it_is_for():
    """A moving picture, one sentence why, two commands, ten lines; the rest is a page, and the how-tos have it."""
    before, _, screen = README.partition("```python")[0].partition("walk.webp")
    assert len(before) < 300 and README.index("```python") < 1800
    assert screen.count("**Why:**") == 1 and len(re.findall(r"^\| `make [a-z]+` ", screen, re.M)) == 2
    assert len(README.split()) < 1100


def test_commands_named_in_readme_exist(capsys):
    from mwlib.cli import main

    named = set(re.findall(r"^mwlib ([a-z0-9-]+)|`mwlib ([a-z0-9-]+)", README, re.M))
    for command in {a or b for a, b in named} - {""}:
        try:
            main([command, "--help"])
        except SystemExit as end:
            assert end.code == 0, command
    capsys.readouterr()
