"""A release: built, checked, tried in an empty folder, tagged. `make release` does all of it, `make dist` all but the tag.

The version stands in mwlib/version.py. CHANGELOG.md begins with it, CITATION.cff repeats it. The tag is pushed by hand; then a
workflow publishes what it stands for.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tarfile
import tempfile
import venv
import zipfile
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[1]
DIST = ROOT / "build" / "dist"
TRIED = (["--version"], ["check-data", "synthetic"], ["course", "course"], ["run-notebook", "2"])


def version() -> str:
    """The version.

    Raises:
        SystemExit: the changelog or the citation has another one, or the changelog no date.
    """
    found = re.findall(r'__version__ = "(.+)"', (ROOT / "mwlib" / "version.py").read_text(encoding="utf-8"))[0]
    first = re.findall(r"^## (.+)$", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.M)[0]
    if not re.fullmatch(rf"{re.escape(found)} \(\d{{4}}-\d\d-\d\d\)", first):
        sys.exit(f"CHANGELOG.md begins with {first!r}; expected '{found} (YYYY-MM-DD)', as mwlib/version.py says {found}")
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    if (cited["version"], str(cited.get("date-released"))) != (found, first[-11:-1]):
        sys.exit(f"CITATION.cff says {cited['version']}, {cited.get('date-released')}; expected {found}, {first[-11:-1]}")
    return found


def run(*words: object, cwd: Path = ROOT, env: dict[str, str] | None = None) -> None:
    """Run a program; a failure ends the release."""
    print("$", *words, flush=True)
    subprocess.run([str(word) for word in words], cwd=cwd, env=env, check=True)


def environment(folder: Path, *packages: object) -> Path:
    """A new environment that has some packages; the folder of its programs."""
    venv.create(folder, with_pip=True)
    scripts = folder / ("Scripts" if os.name == "nt" else "bin")
    run(scripts / "python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *packages)
    return scripts


def dist(found: str) -> None:
    """Build a wheel and an sdist; see that they hold the same, that an index will take them, and that the wheel works."""
    for file in DIST.glob("*"):
        file.unlink()
    run(sys.executable, "-m", "hatchling", "build", "-t", "sdist", "-t", "wheel", "-d", DIST)
    (wheel,), (sdist,) = DIST.glob(f"*-{found}-*.whl"), DIST.glob(f"*-{found}.tar.gz")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with tarfile.open(sdist) as archive:
            archive.extractall(folder / "sdist", filter="data")
        (source,) = (folder / "sdist").iterdir()
        run(sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", folder / "again", cwd=source)
        (again,) = (folder / "again").iterdir()
        if contents(wheel) != contents(again):
            sys.exit("the wheel built from the sdist differs from the one built here; expected the same files")
        run(environment(folder / "twine", "twine>=6") / "twine", "check", "--strict", wheel, sdist)
        scripts = environment(folder / "venv", "-c", ROOT / "constraints.txt", f"{wheel}[notebooks]")
        (folder / "empty").mkdir()
        clean = {key: value for key, value in os.environ.items() if not key.startswith(("MW", "PYTHON"))}
        for words in TRIED:
            run(scripts / "mwlib", *words, cwd=folder / "empty", env=clean)


def contents(wheel: Path) -> dict[str, int]:
    """Checksums of the files of a wheel, by name."""
    with zipfile.ZipFile(wheel) as archive:
        return {entry.filename: entry.CRC for entry in archive.infolist() if not entry.filename.endswith("/RECORD")}


def main() -> None:
    """Build and check; with the word "tag" also tag a clean checkout."""
    found, tag = version(), "tag" in sys.argv[1:]
    if tag and subprocess.run(["git", "status", "--porcelain"], cwd=ROOT, capture_output=True, check=True).stdout:
        sys.exit("the checkout has changes; expected all of them committed")
    dist(found)
    if tag:
        run("git", "tag", "-a", f"v{found}", "-m", f"Version {found}")
        print(f"v{found} is tagged. `git push origin v{found}` publishes it.")


if __name__ == "__main__":
    main()
