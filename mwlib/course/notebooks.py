"""Notebooks of the course: files, hashes of their sources, parameters, exhibits that they make, and working copies."""

import ast
import json
import re
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, distribution, requires
from pathlib import Path
from typing import Any, NamedTuple

from mwlib.experiments.grids import HYPHENED, LIST, WORDS, Place, check_fields, one_of
from mwlib.experiments.results import rendered
from mwlib.files import write_atomic
from mwlib.hashing import sha256
from mwlib.paths import carried, course_folder, installed
from mwlib.settings import near, read_yaml

ROOT = course_folder()  # of the folder that the process was started in
NOTEBOOKS = ROOT / "notebooks"
EXPERIMENT = NOTEBOOKS / "experiment.ipynb"  # one row of a grid
TIMEOUT = 86400.0  # seconds for one cell: the paper's own presets train for hours in one
# Chapters that take minutes: whoever runs several begins with them, with 06 first, whose model others wait for.
LONGEST = ("06", "11", "08", "03", "13", "10", "07", "04")
RANGE = re.compile(r"; from ([\d.]+) to ([\d.]+)$")  # how the comment of a parameter ends that is limited
WRONG = "wrong"  # metadata of a cell with a hole or a solution: plausible wrong answers, each {"code": ..., "hint": ...}
FOLDED = ("solution", "guard")  # tags of cells that a reader sees on asking: answers, and checks of the text's own numbers
CHAPTER = re.compile(r"\d\d[a-z]?")  # a chapter's number: 05, or 05b for its second half


def course(folder: Path = NOTEBOOKS) -> list[Path]:
    """The notebooks of the course, in order."""
    return sorted(path for path in folder.glob("*_*.ipynb") if CHAPTER.fullmatch(chapter_number(path)))


def chapter_number(path: Path) -> str:
    """What a notebook's name begins with.

    >>> chapter_number(Path("notebooks/05b_diffusion_on_the_manifold.ipynb"))
    '05b'
    """
    return path.stem.partition("_")[0]


def find_notebook(name: str, folder: Path = NOTEBOOKS) -> Path:
    """A notebook by path, by name, or by its number, and the letter where it has one: "5" is "05", which is never "05b".

    Raises:
        FileNotFoundError: there is none, or more than one; the message lists the course.
    """
    if name.endswith(".ipynb") and Path(name).is_file():
        return Path(name)
    stems = {path.stem: path for path in course(folder)}
    found = [path for stem, path in stems.items() if stem == name or chapter_number(path) in (name, f"0{name}")]
    if len(found) != 1:
        number = re.match(r"\d+", name)
        meant = next((stem for stem in stems if number and int(stem[:2]) == int(number[0])), name)  # 5c is 05, or 05b
        names = ", ".join(stems) or "nothing"
        raise FileNotFoundError(f"no notebook {name!r}{near(meant, stems)}; expected a path, a name or a number of: {names}")
    return found[0]


def read_notebook(path: Path) -> dict[str, Any]:
    """A notebook file as a tree, with all that is relied on later: cells that have a type and a source.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is no notebook; the message names the file and what was found.
    """
    try:
        tree = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{path} is not a notebook: {error}; expected JSON with a list of cells") from None
    cells = tree.get("cells") if isinstance(tree, dict) else None
    if not isinstance(cells, list) or not all(map(_is_cell, cells)):
        raise ValueError(f"{path} is not a notebook: {str(tree)[:40]}; expected cells, each with a type, metadata and a source")
    return tree


def _is_cell(cell: Any) -> bool:
    match cell:
        case {"cell_type": str(), "source": str() | list() as lines}:
            return isinstance(cell.get("metadata", {}), dict) and all(isinstance(line, str) for line in lines)
    return False


def source_hash(notebook: Path | Mapping[str, Any]) -> str:
    """Hash of what a notebook says, not of what running it produced: types, tags and sources of its cells.

    Raises:
        FileNotFoundError, ValueError: as in `read_notebook`.
    """
    tree = read_notebook(notebook) if isinstance(notebook, Path) else notebook
    cells = [(cell["cell_type"], tags(cell), "".join(cell["source"]).strip()) for cell in tree["cells"]]
    return sha256([json.dumps(cells)])


def exhibits_kept(notebook: Mapping[str, Any]) -> list[tuple[str, Mapping[str, Any]]]:
    """The stored pictures and tables that `page.show` and `page.table` gave a stem, in order, with their stems."""
    outputs = [output for cell in notebook["cells"] for output in cell.get("outputs", [])]
    marked = [(output.get("metadata", {}).get("mwlib", {}), output) for output in outputs]
    return [(mark["stem"], output) for mark, output in marked if "stem" in mark]


def title_of(notebook: Mapping[str, Any]) -> str:
    """The heading of a notebook."""
    return "".join(notebook["cells"][0]["source"]).splitlines()[0].lstrip("# ")


def write_hashes(folder: Path, hashes: Mapping[str, str]) -> None:
    """Write `<name>.sha256` for each; a file whose content stays is not touched.

    Snakemake rules depend on these files instead of on what was hashed: executing a notebook in place or touching a file of the
    data schedules nothing, and no path of a user's is taken for a pattern.
    """
    for name, text in hashes.items():
        target = folder / f"{name}.sha256"
        if not target.is_file() or target.read_text(encoding="utf-8") != text:
            write_atomic(target, text)


SCALARS = {"str": str, "int": int, "float": float, "bool": bool}
KINDS = (*SCALARS, "list[str]", "list[int]", "list[float]")


class ParameterError(ValueError):
    """A notebook's parameters cell, or a value given for it, is not as it should be."""


class Parameter(NamedTuple):
    """One line of a parameters cell: ``name: kind = default  # comment``, or ``# comment; from 1 to 100``."""

    name: str
    kind: str
    default: Any
    comment: str

    @property
    def range(self) -> tuple[float, float] | None:
        """Least and largest value, where the comment states them; a seed is a whole number of 32 bits."""
        if self.name == "seed":
            return 0, 2**32 - 1
        found = RANGE.search(self.comment)
        return (float(found[1]), float(found[2])) if found else None

    def __str__(self) -> str:
        return f"{self.name}: {self.kind} = {self.default!r}  # {self.comment}"


def tags(cell: Mapping) -> list[str]:
    """The tags of a notebook cell."""
    return cell.get("metadata", {}).get("tags", [])


def read_parameters(notebook: Mapping) -> dict[str, Parameter]:
    """Parameters that a notebook offers, by name, in order.

    Raises:
        ParameterError: there is not exactly one cell tagged `parameters`, or a line of it is not a typed
            and commented literal.
    """
    cells = [cell for cell in notebook["cells"] if "parameters" in tags(cell)]
    if len(cells) != 1:
        raise ParameterError(f"{len(cells)} cells are tagged 'parameters'; expected one")
    source = "".join(cells[0]["source"])
    try:
        tree = ast.parse(source)
    except SyntaxError as error:
        raise ParameterError(f"parameters cell: {error}; expected lines of the form 'name: type = literal  # comment'") from None
    parameters = [_parameter(node, source.encode().splitlines()) for node in tree.body]
    return {parameter.name: parameter for parameter in parameters}


def resolve(offered: Mapping[str, Parameter], given: Mapping[str, Any]) -> dict[str, Any]:
    """All values of a run: the defaults, with the given ones checked and put in their place.

    Raises:
        ParameterError: a name is unknown, or a value is of the wrong type or beyond its range; the message lists what is offered.
    """
    for name in given:
        if name not in offered:
            raise ParameterError(f"unknown parameter {name!r}{near(name, offered)}; the notebook offers\n{_listing(offered)}")
    return {name: _fit(parameter, given.get(name, parameter.default)) for name, parameter in offered.items()}


def from_text(offered: Mapping[str, Parameter], assignments: Sequence[str]) -> dict[str, Any]:
    """Values of ``name=text`` words, each read as its parameter's type demands: for `str` the text as it stands,
    otherwise a Python literal.

    Raises:
        ParameterError: a word has no ``=``, its name is unknown or was given before, or its text is not a literal.
    """
    given = {}
    for word in assignments:
        name, equals, text = word.partition("=")
        if not equals or name not in offered:
            meant = near(name, offered)
            raise ParameterError(f"unknown parameter in {word!r}{meant}; expected name=value with one of\n{_listing(offered)}")
        if name in given:
            raise ParameterError(f"{word!r}: {name} is given twice; expected each parameter once")
        given[name] = text if offered[name].kind == "str" else _literal(offered[name], text)
    return given


def read_values(file: Path) -> dict[str, Any]:
    """Values by parameter name, from a YAML file; an empty file gives none.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is not YAML, has a name twice, or is not a mapping.
    """
    tree = read_yaml(file)
    if not isinstance(tree, dict | None) or not all(isinstance(name, str) for name in tree or {}):
        raise ParameterError(f"{file} holds {str(tree)[:40]!r}; expected a mapping of parameters, e.g. preset: tiny")
    return tree or {}


def _literal(parameter: Parameter, text: str) -> Any:
    try:
        return ast.literal_eval({"true": "True", "false": "False"}.get(text, text))
    except (ValueError, TypeError, SyntaxError):
        raise ParameterError(f"{parameter.name} is {text!r}; expected {parameter.kind}, e.g. {parameter.default!r}") from None


def _fit(parameter: Parameter, value: Any) -> Any:
    """The value, whole numbers turned to float where a float is wanted; papermill alone would pass anything."""
    several = parameter.kind.startswith("list")
    kind = SCALARS[parameter.kind.removeprefix("list[").removesuffix("]")]
    parts = value if several else [value]
    if not isinstance(parts, list | tuple) or not all(type(part) in (kind, int if kind is float else kind) for part in parts):
        hint = " (YAML reads 1e-3 as text; write 1.0e-3)" if kind is float and isinstance(value, str) else ""
        found = f"{parameter.name} is {value!r} ({type(value).__name__})"
        raise ParameterError(f"{found}; expected {parameter.kind}, e.g. {parameter.default!r}{hint}")
    if (limits := parameter.range) and not all(limits[0] <= part <= limits[1] for part in parts):
        raise ParameterError(f"{parameter.name} is {value!r}; expected {limits[0]:g} to {limits[1]:.10g}")
    fitted = [kind(part) for part in parts]
    return fitted if several else fitted[0]


def _parameter(node: Any, lines: list[bytes]) -> Parameter:
    text = ast.unparse(node)
    if not (isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) and node.value is not None):
        raise ParameterError(f"parameters cell: {text!r} is not of the form 'name: type = literal  # comment'")
    comment = lines[node.end_lineno - 1][node.end_col_offset :].decode().strip("# ")  # pyright: ignore[reportOptionalOperand]
    kind = ast.unparse(node.annotation)
    if kind not in KINDS:
        raise ParameterError(f"parameters cell: {text!r} has the type {kind}; expected one of {', '.join(KINDS)}")
    if not comment:
        raise ParameterError(f"parameters cell: {text!r} has no comment that says what it is")
    try:
        value = ast.literal_eval(node.value)
    except (ValueError, TypeError):
        raise ParameterError(f"parameters cell: {text!r} is not a literal; derive values in the next cell") from None
    parameter = Parameter(node.target.id, kind, value, comment)
    _fit(parameter, value)
    return parameter


def _listing(offered: Mapping[str, Parameter]) -> str:
    return "\n".join(f"  {parameter}" for parameter in offered.values())


MANIFEST = ROOT / "figures" / "manifest.yaml"
FILES = {"figure": ("png", "pdf", "csv", "txt", "json"), "table": ("csv", "json")}
# What a row of the manifest holds, see `check_fields`.
NEEDED = {"id", "kind", "caption", "notebook", "stem", "data", "status"}
FIELDS = dict.fromkeys([*NEEDED], WORDS) | {"id": HYPHENED, "kind": one_of(FILES), "status": one_of(("made", "planned"))}
FIELDS |= {"files": LIST, "committed": LIST}
FIELDS["paper"] = "'system' and 'item'", lambda value: isinstance(value, dict) and {*value} in (set(), {"system", "item"})


class Exhibit(NamedTuple):
    """One row of the manifest.

    Args:
        id: unique, lower case, words joined by hyphens.
        kind: "figure" or "table".
        caption: what it shows, in our words.
        notebook: stem of the notebook that makes it.
        stem: name of its files, without ending; unique within the notebook.
        files: endings of the files that make it up.
        data: which data it is made from.
        status: "made", or "planned" while no notebook makes it.
        paper: the paper's item that it answers to, e.g. {"system": "MotionWavelet", "item": "Table 1"}; may be empty.
        committed: results under figures/ that show the same on real people, without ending; the site shows them instead.
    """

    id: str
    kind: str
    caption: str
    notebook: str
    stem: str
    files: Sequence[str]
    data: str
    status: str
    paper: Mapping[str, str] = {}
    committed: Sequence[str] = ()


def read_manifest(path: Path = MANIFEST) -> list[Exhibit]:
    """All exhibits, in the order of the file.

    Raises:
        ValueError: a row lacks a field, has an unknown one, one twice, or a value that is not allowed; the message names
            the file and every such row.
    """
    tree = read_yaml(path) or {}
    rows = tree.get("exhibits", []) if isinstance(tree, dict) else None
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise ValueError(f"{path} holds {str(tree)[:40]!r}; expected exhibits: a list of mappings")
    problems = []
    for number, row in enumerate(rows, 1):
        try:
            _check_row(Place(path, f"row {number} ({row.get('id', '?')})"), row)
        except ValueError as error:
            problems.append(str(error))
    for name, keys in (("id", ["id"]), ("notebook and stem", ["notebook", "stem"])):
        values = [tuple(row.get(key) for key in keys) for row in rows]
        problems += [f"{value}: the same {name} twice" for value in sorted(set(values), key=str) if values.count(value) > 1]
    if problems:
        raise ValueError(f"{path}:\n" + "\n".join(problems))
    return [Exhibit(**row) for row in rows]


def _check_row(where: Place, row: dict[str, Any]) -> None:
    check_fields(where, row, NEEDED, FIELDS)
    needed = FILES[row["kind"]]
    if missing := {*needed} - {*row.get("files", ())}:
        expected = f"a {row['kind']} consists of {', '.join(needed)}"
        raise ValueError(f"{where.of(row, 'files')}: files lack {sorted(missing)}: {expected}")


PACKAGE = "motion-wavelet-notebooks"


class LaidOut(NamedTuple):
    """What `lay_out` did, as paths relative to the folder."""

    written: list[Path]
    kept: list[Path]  # were there already
    changed: list[Path]  # of those kept, the ones that are not as this mwlib has them


def lay_out(folder: Path) -> LaidOut:
    """Copy notebooks, grids, the list of figures, committed results and Snakefile into a folder; overwrite nothing.

    Args:
        folder: made if missing. What is there already stays as it is, so a second call brings back what was deleted.

    Raises:
        NotADirectoryError: the path is a file, or goes through one.
        PermissionError: the folder cannot be written to.
    """
    if folder.exists() and not folder.is_dir():
        raise NotADirectoryError(f"{folder} is a file; expected a folder, or a name that is still free")
    out = LaidOut([], [], [])
    source = installed()
    for file in carried(source):
        name = file.relative_to(source)
        target, content = folder / name, file.read_bytes()
        if not target.exists() and not target.is_symlink():
            write_atomic(target, content)
            out.written.append(name)
            continue
        out.kept.append(name)
        if not target.is_file() or target.read_bytes() != content:
            out.changed.append(name)
    return out


def to_install(extra: str) -> str:
    """The command that brings the packages of an extra that are missing, by their own names: it works wherever mwlib is from.

    Empty if none is missing.
    """
    try:
        lines = requires(PACKAGE) or []
    except PackageNotFoundError:  # a checkout that is on the path, not installed
        return f'pip install ".[{extra}]"'
    of_extra = [line.partition(";")[0].strip() for line in lines if f"extra == '{extra}'" in line]
    missing = [f'"{line}"' for line in of_extra if not _is_there(re.split(r"[^\w.-]", line)[0])]
    return " ".join(["pip install", *missing]) if missing else ""


def _is_there(package: str) -> bool:
    try:
        return bool(distribution(package))
    except PackageNotFoundError:
        return False


def told(folder: Path, done: LaidOut, version: str) -> str:
    """What was done, and what a reader can do next, for the terminal."""
    missing = to_install("notebooks")
    return rendered("course/working_copy.md.jinja", folder=folder, done=done, version=version, missing=missing).rstrip()
