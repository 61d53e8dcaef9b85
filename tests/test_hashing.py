"""Hashes: what moves them, and what does not."""

from __future__ import annotations

import hashlib
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from mwlib import hashing
from mwlib.hashing import code_behind, code_hash, digest, file_hash, package_hash, sha256

ROOT = Path(__file__).parents[1]
CODE = '''"""What it is."""

def double(x):
    """Twice."""
    return 2 * x  # twice
'''


def test_texts_and_bytes_give_the_sha256_of_both(tmp_path):
    whole = hashlib.sha256("aßc".encode()).hexdigest()
    (tmp_path / "file").write_text("aßc", encoding="utf-8")
    assert sha256(["a", "ß", b"c"]) == sha256(["aßc"]) == file_hash(tmp_path / "file") == whole
    assert sha256(["\udcff"]) == hashlib.sha256(b"\xff").hexdigest(), "a file name that is no text"
    assert digest({"b": 1, "a": [2]}) == digest({"a": [2], "b": 1}) == hashlib.sha256(b'{"a": [2], "b": 1}').hexdigest()[:8]


def test_nobody_else_hashes():
    own = {path.name for path in (ROOT / "mwlib").rglob("*.py") if "hashlib" in path.read_text(encoding="utf-8")}
    assert own == {"hashing.py"}


@pytest.mark.parametrize(
    "change, moves",
    [
        (("# twice", "# two times"), False),
        (("Twice.", "Two times."), False),
        (('"""What it is."""\n', ""), False),
        (("return 2 * x", "return (\n        2\n        * x)"), False),
        (("2 * x", "3 * x"), True),
        (("2 * x", "2 + x"), True),
        (("def double(x)", "def double(x=0)"), True),
        (("double", "twice"), True),
    ],
)
def test_comments_docstrings_and_layout_are_no_code(tmp_path, change, moves):
    (tmp_path / "a.py").write_text(CODE)
    (tmp_path / "b.py").write_text(CODE.replace(*change))
    assert (code_hash(tmp_path / "a.py") != code_hash(tmp_path / "b.py")) == moves


def test_the_library_counts_but_for_the_courses_tooling(tmp_path):
    def written(**changes: str) -> str:
        hashing.code_hash.cache_clear(), hashing._parsed.cache_clear()
        files = {"data/a.py": "x = 1", "b.py": "y = 1", "course/c.py": "z = 1", "__pycache__/d.pyc": "", "d.csv": "1"}
        for name, text in (files | changes).items():
            (tmp_path / name).parent.mkdir(exist_ok=True)
            (tmp_path / name).write_text(text)
        return package_hash(tmp_path)

    before = written()
    for name, text, counts in [
        ("course/c.py", "z = 2", False),
        ("cli/f.py", "z = 2", False), ("__pycache__/d.pyc", "2", False), ("data/a.py", "x = 1  # one", False),
        ("data/a.py", "x = 2", True), ("d.csv", "2", True), ("e.py", "", True),
    ]:  # fmt: skip
        assert (written(**{name: text}) != before) == counts, name
    (tmp_path / "e.py").unlink()
    alone = package_hash(tmp_path, ["mwlib.data.a"])
    written(**{"b.py": "y = 2"})
    assert package_hash(tmp_path, ["mwlib.data.a"]) == alone != before
    written(**{"d.csv": "2"})
    assert package_hash(tmp_path, ["mwlib.data.a"]) != alone, "other files always count"


FILES = {
    "__init__.py": "",
    "main.py": "import json\nfrom own.given import deep\nfrom own import near, lazy\nfrom mwlib.plots import save\n",
    "near.py": "def late():\n    import own.later\n",
    "later.py": "from . import near\n",
    "given/__init__.py": "from own.given.one import other as deep\nfrom own.given.two import unused\n",
    "given/one.py": "other = 1\n",
    "given/two.py": "from mwlib.files import write_json\n",
    "lazy/__init__.py": "import lazy_loader\n",
    "apart.py": "",
}


def test_code_behind_a_module_is_what_it_imports(tmp_path, monkeypatch):
    """Late imports count, names are followed to where they come from, pictures and what nobody asks for are left out."""
    for name, text in FILES.items():
        (tmp_path / "own" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "own" / name).write_text(text)
    monkeypatch.setitem(sys.modules, "own.main", SimpleNamespace(__file__=str(tmp_path / "own" / "main.py")))
    found = code_behind("own.main")
    assert [*found] == ["own.given.one", "own.later", "own.lazy", "own.main", "own.near"]
    assert found["own.near"] == code_hash(tmp_path / "own" / "near.py")
    monkeypatch.setitem(sys.modules, "a_notebook", SimpleNamespace())
    assert code_behind("a_notebook") == {}


def test_code_behind_a_system_holds_its_samplers_and_no_pictures():
    found = {*code_behind("mwlib.prediction.system")}
    assert {"mwlib.prediction.config", "mwlib.diffusion.samplers", "mwlib.metrics.prediction", "mwlib.training.loop"} <= found
    assert "mwlib.body.skeleton" in found, "at second hand"
    assert not [name for name in found if name.startswith(("mwlib.plots", "mwlib.course", "mwlib.experiments", "mwlib.cli"))]
    assert "mwlib.text_to_motion.config" not in found


def test_what_a_package_imports_at_first_use_is_followed():
    """`mwlib.experiments` and `mwlib` say in a stub where their names come from."""
    assert hashing._origin("mwlib", "load_motions", {"mwlib": ROOT}) == "mwlib.data.load"
