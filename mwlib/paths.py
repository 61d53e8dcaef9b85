"""Places of the course, of its results, and of the models that come with the package.

The course lies in one of three places: a working copy around the working folder (`mwlib course FOLDER` lays one out), the
checkout that mwlib is imported from, or the copy inside the installed package.
"""

from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[1]
PACKAGED = Path(__file__).resolve().with_name("_material")  # hatch_build.py puts it into the wheel
CONFIG = "config.yaml"  # in a run's folder: its settings
MODELS = Path(__file__).resolve().with_name("models")  # a run's folder for each model that comes with the package
MARKS = ("notebooks", "figures/manifest.yaml", "Snakefile")
# What a working copy consists of.
CARRIED = ("LICENSE", "Snakefile", "notebooks/*.ipynb", "notebooks/*.md", "figures/*.yaml", "figures/*/*")


def is_course(folder: Path) -> bool:
    """Whether a folder is a working copy of the course: it has the notebooks, the list of figures and the Snakefile."""
    return all((folder / mark).exists() for mark in MARKS)


def installed() -> Path:
    """The course as it came with this mwlib: the checkout, or the copy inside the package, which is only read."""
    return CHECKOUT if is_course(CHECKOUT) else PACKAGED


def shipped() -> list[str]:
    """Names of the trained models that come with the package."""
    return sorted(config.parent.name for config in MODELS.glob(f"*/{CONFIG}"))


def run_folder(name: str | Path) -> Path | None:
    """The folder of a run: the one of that name, else that of the model that comes with the package; None if there is neither."""
    own = Path(name)
    if not (own / CONFIG).exists() and str(name) in shipped():
        return MODELS / name
    return own if (own / CONFIG).exists() else None


def home() -> Path:
    """Where results go: the working copy of the course around the working folder, else the working folder itself."""
    here = Path.cwd()
    return next((folder for folder in (here, *here.parents) if is_course(folder)), here)


def course_folder() -> Path:
    """The folder whose notebooks/ and figures/ are used: `home` if that is a working copy, else what is `installed`."""
    return home() if is_course(home()) else installed()


def carried(folder: Path) -> list[Path]:
    """The files of a course that a wheel and a working copy have, in order, whatever else lies in the folder."""
    return [file for pattern in CARRIED for file in sorted(folder.glob(pattern)) if file.is_file()]
