"""Commands, names and settings as the library's source states them, read without importing it."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from itertools import takewhile
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).parents[1]
GROUPS = {  # of commands, by module, in the order of the overview
    "mwlib.cli.data": "use", "mwlib.cli.sample": "use", "mwlib.cli.measure": "train and measure", "mwlib.cli.course": "course",
}  # fmt: skip
MAINTAIN = "maintain"  # the group of those that keep the course up
MAINTAINING = ("ship", "reproduction", "execute_notebooks", "index_page", "site_sources", "run_experiment")
SYSTEMS = "mwlib.experiments.grids"
TYPES = {"int": int, "float": float, "str": str, "Path": lambda word: Path(word).expanduser()}
NAMED = re.compile(r"`(mwlib(?:\.\w+)*)\.([A-Za-z]\w+)`")  # in a text: stands for the names that `names_of` gives
ADVANCED = "advanced, changed by no preset, grid or chapter"


class Command(NamedTuple):
    """A function of the command line: the module that it stands in, its syntax tree, and what its docstring says it does."""

    module: str
    definition: ast.FunctionDef
    about: str

    @property
    def group(self) -> str:
        """The heading that it stands under in the overview."""
        return MAINTAIN if self.definition.name in MAINTAINING else GROUPS[self.module]

    @property
    def summary(self) -> str:
        """The first sentence, for the overview."""
        return self.about[0].lower() + self.about.partition(".\n")[0].removesuffix(".")[1:]


def commands() -> dict[str, Command]:
    """All commands by name: that of the function, with hyphens."""
    found = {}
    for module in GROUPS:
        for node in _source(module)[1].body:
            if isinstance(node, ast.FunctionDef) and node.name[0] != "_":
                found[node.name.replace("_", "-")] = Command(module, node, _docstring(node)[0])
    return found


def arguments(module: str, function: ast.FunctionDef) -> Iterator[tuple[str, dict[str, Any]]]:
    """Words and options of a function's command, as `ArgumentParser.add_argument` takes them.

    Arguments before the star are words, those behind it options; ``**name`` stands for those of the function `_name` there, or
    `name` of `mwlib.cli.options`.
    """
    given, texts, shared = function.args, _docstring(function)[1], []
    if given.kwarg:
        try:
            shared = [*arguments(*_defined(module, f"_{given.kwarg.arg}"))]
        except LookupError:
            shared = [*arguments(*_defined("mwlib.cli.options", given.kwarg.arg))]
    yield from (each for each in shared if each[0][0] != "-")
    for argument, default in zip(given.args, [None] * (len(given.args) - len(given.defaults)) + given.defaults, strict=True):
        optional = {"nargs": "?", "default": None} if default else {}
        yield argument.arg, {"metavar": argument.arg.upper()} | optional | _settings(argument, default, texts)
    for argument, default in zip(given.kwonlyargs, given.kw_defaults, strict=True):
        required = {} if default else {"required": True}
        yield f"--{argument.arg.replace('_', '-')}", required | _settings(argument, default, texts)
    yield from (each for each in shared if each[0][0] == "-")


def _settings(argument: ast.arg, default: ast.expr | None, texts: dict[str, str]) -> dict[str, Any]:
    """Type, number of words and meaning of one argument."""
    kind = ast.unparse(argument.annotation or ast.Constant("")).removesuffix(" | None")
    text = NAMED.sub(lambda found: ", ".join(names_of(*found.groups())), texts[argument.arg])
    value = ast.unparse(default or ast.Constant(None)).removeprefix("Path").strip("()'")
    if value not in ("", "None", "False") and "default" not in text:
        text += f" (default: {value})"
    outer, _, inner = kind.rstrip("]").partition("[")
    match outer:
        case "bool":
            kinds: dict[str, Any] = {"action": "store_true"}
        case "Literal":
            kinds = {"choices": ast.literal_eval(f"[{inner}]")}
        case "Repeated":
            kinds = {"action": "append", "metavar": "NAME=VALUE"}
        case "Sequence":
            kinds = {"nargs": "*" if value == "" else "+", "type": TYPES[inner]}
        case _:
            kinds = {"type": TYPES[kind]}
    if NAMED.sub("", texts[argument.arg]).strip(" ,") == "one of":
        kinds["choices"] = text.removeprefix("one of ").split(", ")
    return kinds | {"help": text.replace("%", "%%")}


def _docstring(definition: ast.FunctionDef) -> tuple[str, dict[str, str]]:
    """What a docstring says of the function, and of each argument."""
    about, _, given = (ast.get_docstring(definition) or "").partition("\n\nArgs:\n")
    entries = re.findall(r"^    (\w+): (.*(?:\n {5,}.*)*)", given.partition("\n\n")[0], re.MULTILINE)
    return about, {name: " ".join(text.split()).rstrip(".") for name, text in entries}


def names_of(module: str, variable: str) -> list[str]:
    """Keys of a mapping that a module defines, and of those joined to it; or the names of all that a package makes of a kind."""
    if not variable.isupper():
        text = "".join(file.read_text(encoding="utf-8") for file in sorted(_file(module).parent.glob("*.py")))
        return re.findall(rf'\b{variable}\(\s*(?:name=)?"([\w-]+)"', text)
    return [*_entries(module, variable)]


def _entries(module: str, variable: str) -> dict[str, str]:
    """Keys of a mapping that a module defines, and of those joined to it, each with the comment above it."""
    where, value = _defined(module, variable)
    lines, tree = _source(where)
    joined = [node.value for node in tree.body if isinstance(node, ast.AugAssign) and ast.unparse(node.target) == variable]
    found = {}
    for key in (key for mapping in (value, *joined) for key in getattr(mapping, "keys", ())):
        above = takewhile(lambda line: line.startswith("# "), (line.strip() for line in reversed(lines[: key.lineno - 1])))
        found[ast.literal_eval(key)] = " ".join(line[2:] for line in reversed([*above]))
    return found


def settings_text(system: str) -> str:
    """Presets and settings of a system as lines of text: each setting with its default and its meaning, the advanced ones last.

    Raises:
        ValueError: there is no such system; the message lists those there are.
    """
    modules = ast.literal_eval(_defined(SYSTEMS, "MODULES")[1])
    if system not in modules:
        raise ValueError(f"system is {system!r}; expected one of {', '.join(modules)}")
    presets, groups = {}, {}
    for module, config in _bases(modules[system], "Config"):
        for node in config.body:
            match node:
                case ast.Assign(targets=[ast.Name(id="presets")], value=ast.Name(id=variable)):
                    presets = _entries(module, variable)
                case ast.AnnAssign(target=ast.Name(id=group), annotation=ast.Name(id=kind)):
                    for advanced, line in _fields(*_defined(module, kind)):
                        groups.setdefault(ADVANCED if advanced else group, []).append(line)
    lines = [f"\nPresets of {system}: {', '.join(presets)}", *(f"  {name}  {text}" for name, text in presets.items() if text)]
    lines.append("\nIts settings, their defaults (a preset changes some) and meanings")
    for group in sorted(groups, key=ADVANCED.__eq__):
        lines += [f"{group}:", *groups[group]]
    return "\n".join([*lines, ""])


def _fields(module: str, kind: Any) -> Iterator[tuple[bool, str]]:
    """The fields of a group of settings, advanced or not; their meaning is the comment behind them, or on the line before."""
    lines = _source(module)[0]
    for node in kind.body:
        if isinstance(node, ast.AnnAssign) and node.value:
            before = lines[node.lineno - 2].strip()
            meaning = lines[(node.end_lineno or 0) - 1].partition("  # ")[2] or (before[2:] if before.startswith("# ") else "")
            default = f"{ast.unparse(node.target)} = {ast.unparse(node.value)}"
            yield ast.unparse(node.annotation).startswith("Advanced["), f"  {default}  {meaning}".rstrip()


def _bases(module: str, name: str) -> Iterator[tuple[str, Any]]:
    """A class and those that it is built on, the last one first."""
    package, _, name = name.rpartition(".")
    module, node = _defined(_defined(module, package)[0] if package else module, name)
    for base in node.bases:
        if ast.unparse(base) != "Settings":
            yield from _bases(module, ast.unparse(base))
    yield module, node


def _defined(module: str, name: str) -> tuple[str, Any]:
    """The definition of a name that a module has or imports, and the module it stands in."""
    for node in _source(module)[1].body:
        match node:
            case ast.ImportFrom(module=str(other)):
                for alias in node.names:
                    if (alias.asname or alias.name) == name:
                        whole = _file(f"{other}.{name}").is_file()
                        return (f"{other}.{name}", None) if whole else _defined(other, alias.name)
            case ast.ClassDef(name=found) | ast.FunctionDef(name=found) if found == name:
                return module, node
            case ast.Assign(targets=[ast.Name(id=found)], value=value) if found == name:
                return module, value
            case ast.AnnAssign(target=ast.Name(id=found), value=ast.expr() as value) if found == name:
                return module, value
    raise LookupError(f"{module} does not define {name}")


@cache
def _source(module: str) -> tuple[list[str], ast.Module]:
    """Lines and syntax tree of a module."""
    text = _file(module).read_text(encoding="utf-8")
    return text.splitlines(), ast.parse(text)


def _file(module: str) -> Path:
    place = ROOT.joinpath(*module.split(".")[1:])
    return place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
