"""README's Python examples run, in order, as they stand there, but with a shorter training."""

from __future__ import annotations

import re
from pathlib import Path

import mwlib as mw

README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
RUN = re.compile(r"runs/[0-9a-f]{8}-[0-9a-f]{8}")  # stands for any run's folder


def test_examples_run(monkeypatch, tmp_path, capsys):
    monkeypatch.setenv("MWLIB_RUNS", str(tmp_path / "runs"))
    monkeypatch.chdir(tmp_path)
    for number, motion in enumerate(mw.load_motions("synthetic")[:3]):
        mw.write_bvh(motion, tmp_path / "my" / "folder" / f"clip_{number}.bvh")
    known: dict[str, object] = {}
    blocks = re.findall(r"```python\n(.*?)```", README, re.S)
    assert len(blocks) == 2 and README.index(blocks[0]) < 1500, "code belongs into the first screen"
    for number, block in enumerate(blocks):
        for folder in (tmp_path / "runs").glob("*-*/config.yaml"):
            block = RUN.sub(folder.parent.relative_to(tmp_path).as_posix(), block)
        assert number or "train_steps=200" in block
        block = block.replace("train_steps=200", "train_steps=2")
        exec(compile(block, "README.md", "exec"), known)
    assert tuple(known["futures"].shape) == (3, 50, 30, 48) and (tmp_path / "copy.bvh").is_file()
    assert "tensor" in capsys.readouterr().out


def test_commands_named_in_readme_exist(capsys):
    from mwlib.cli import main

    named = set(re.findall(r"^mwlib ([a-z0-9-]+)|`mwlib ([a-z0-9-]+)", README, re.M))
    for command in {a or b for a, b in named} - {""}:
        try:
            main([command, "--help"])
        except SystemExit as end:
            assert end.code == 0, command
    capsys.readouterr()
