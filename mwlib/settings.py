"""Configurations: frozen dataclasses of groups, with overrides by name, checks declared beside each field, YAML and a hash."""

import difflib
import json
import math
import operator
import sys
import types
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from functools import cache
from numbers import Real
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self, TypeVar, get_args, get_origin, get_type_hints

import yaml
from annotated_types import Ge, Gt, Interval

from mwlib.hashing import digest

Count = Annotated[int, Ge(1)]
Natural = Annotated[int, Ge(0)]
Share = Annotated[float, Interval(ge=0, le=1)]
BelowOne = Annotated[float, Interval(ge=0, lt=1)]
Positive = Annotated[float, Gt(0)]
NotNegative = Annotated[float, Ge(0)]

KINDS = {int: "a whole number", float: "a finite number", bool: "true or false", str: "a text"}  # in words
ADVANCED = "advanced"  # marks a field that no preset, grid or chapter changes
Field = TypeVar("Field")
Kind = TypeVar("Kind")
Advanced = Annotated[Field, ADVANCED]  # ``lr_period: Advanced[Count] = 15_620``: offered last


@dataclass(frozen=True)
class OneOf:
    """Marks a text field whose choices are only known at run time: ``Annotated[str, OneOf(names)]``."""

    choices: tuple[str, ...]


class Settings:
    """Base of a system's configuration: a frozen dataclass whose fields are groups, themselves frozen dataclasses.

    The fields' names are unique over all groups, so that a change needs no group: ``cfg.override(lr=1e-3)``. A field's type says
    what is accepted: `int`, `float`, `bool`, `str`, tuples of them, `Literal`, or `Annotated` with bounds or `OneOf`.

    Raises:
        ValueError: a value has the wrong type, is out of range or not among its choices; the message names the field, the value
            and what is accepted.
    """

    system: ClassVar[str]  # name of the system that this configures
    presets: ClassVar[Mapping[str, Mapping[str, Any]]] = {}  # name -> changes to the defaults
    renamed: ClassVar[Mapping[str, str]] = {}  # names of former versions -> today's
    after_training: ClassVar[frozenset[str]] = frozenset()  # groups and fields on which no trained model depends
    people: ClassVar[tuple[str, ...]] = ()  # fields that mean nothing with other data than a preset's own
    newer: ClassVar[Mapping[str, Any]] = {}  # fields that came after results were kept -> the value at which no hash has them

    def __post_init__(self) -> None:
        for group, kind in self.groups().items():
            part = getattr(self, group)
            for name, hint in _hints(kind).items():
                object.__setattr__(part, name, checked(name, getattr(part, name), hint))
        self.check()

    def check(self) -> None:
        """Refuse values that do not fit each other; a system overrides it."""

    @classmethod
    def groups(cls) -> dict[str, type]:
        """Group name -> its dataclass."""
        return {item.name: _hints(cls)[item.name] for item in fields(cls)}  # pyright: ignore[reportArgumentType]  (as in override)

    @classmethod
    def owners(cls) -> dict[str, str]:
        """Field name -> the group it belongs to."""
        return {item.name: group for group, kind in cls.groups().items() for item in fields(kind)}

    @classmethod
    def preset(cls, name: str, **changes: Any) -> Self:
        """A named preset with some fields changed, e.g. ``Config.preset("tiny", lr=1e-3)``.

        With other data than the preset's own, its subjects no longer mean anything: the lists of `people` are emptied.

        Args:
            name: of a preset; or a file of settings that ends in .yaml, as `to_yaml` writes it.
            changes: field -> value.

        Raises:
            ValueError: unknown preset or field; the message lists the valid ones. Or as in `from_yaml`.
            FileNotFoundError: there is no such file.
        """
        word = str(name) if isinstance(name, str | Path) else ""
        if (file := Path(word)).suffix == ".yaml":
            if not file.is_file():
                hint = near(file.name, [beside.name for beside in file.parent.glob("*.yaml")]) or near(file.stem, cls.presets)
                raise FileNotFoundError(f"preset: there is no file {word}{hint}")
            base = cls.from_yaml(file)
        elif word in cls.presets:
            base = cls().override(**cls.presets[word])
        else:
            found, names = f"{shown(name)}{near(name, cls.presets)}", ", ".join(sorted(cls.presets))
            raise ValueError(f"preset is {found}; expected one of {names}, or a file that ends in .yaml")
        if cls.people and changes.get("data", base.get("data")) != base.get("data"):
            base = base.override(**dict.fromkeys(cls.people, ()))
        return base.override(**changes)

    def override(self, **changes: Any) -> Self:
        """A copy with some fields changed; group names are not needed.

        Raises:
            ValueError: a name is not a field (the message has today's name, a near one, or says what lists all), or a bad value.
        """
        owner, parts = self.owners(), {}
        for name, value in changes.items():
            if name in self.renamed:
                raise ValueError(f"{name!r} is not a setting any more; it is now called {self.renamed[name]!r}")
            if name not in owner:
                hint = near(name, owner).strip(" ()") or f"mwlib train --system {self.system} --help lists all"
                raise ValueError(f"unknown setting {name!r}; {hint}")
            parts.setdefault(owner[name], {})[name] = value
        groups = {group: replace(getattr(self, group), **part) for group, part in parts.items()}
        return replace(self, **groups)  # pyright: ignore[reportArgumentType]  (a subclass is a dataclass)

    def get(self, name: str) -> Any:
        """The value of a field, whichever group holds it."""
        return getattr(getattr(self, self.owners()[name]), name)

    def get_group(self, name: str) -> Any:
        """A group by name."""
        return getattr(self, name)

    def changed_from(self, other: Self) -> dict[str, Any]:
        """Fields that differ from another configuration's, with the values they have here."""
        return {name: self.get(name) for name in self.owners() if self.get(name) != other.get(name)}

    def hash(self) -> str:
        """Eight hex digits over every field and the system's name."""
        return digest({"system": self.system, **self._hashed()})

    def training_hash(self) -> str:
        """Eight hex digits over what a trained model depends on: every field but those of `after_training`."""
        return digest(self.trained())

    def trained(self) -> dict[str, Any]:
        """What `training_hash` is made of: the system's name, and by group every field but those of `after_training`."""
        free = self.after_training
        kept = {
            group: {k: v for k, v in part.items() if k not in free} for group, part in self._hashed().items() if group not in free
        }
        return json.loads(json.dumps({"system": self.system, **kept}))

    def sampled(self) -> dict[str, Any]:
        """The fields on which no trained model depends: those of `after_training`."""
        free = {name: self.get(name) for name, group in self.owners().items() if {name, group} & self.after_training}
        return json.loads(json.dumps(free))

    def _hashed(self) -> dict[str, dict[str, Any]]:
        """All fields but the newer ones that change nothing, so that what was made before these came is found again."""
        newer = self.newer
        return {
            group: {name: value for name, value in part.items() if name not in newer or value != newer[name]}
            for group, part in asdict(self).items()  # pyright: ignore[reportArgumentType]  (as in override)
        }

    def to_yaml(self) -> str:
        """The system's name and all fields as YAML text, grouped."""
        tree = json.loads(json.dumps(asdict(self)))  # pyright: ignore[reportArgumentType]  (as in override)
        return yaml.safe_dump({"system": self.system, **tree}, sort_keys=False)

    @classmethod
    def from_yaml(cls, source: str | Path) -> Self:
        """Read what `to_yaml` wrote; nothing may be left out but the fields of `newer`.

        Args:
            source: a file, or text.

        Raises:
            ValueError: the text is not of this system, was written by a former version, lacks a field, holds an unknown one, one
                twice, or a bad value; the file is not UTF-8.
        """
        tree = read_tree(source)
        if tree.pop("system") != cls.system:
            raise ValueError(f"{_place(source)} configures another system; expected system: {cls.system}")
        if not {*tree} <= {*cls.groups()} or not all(isinstance(part, dict | None) for part in tree.values()):
            raise ValueError(
                f"{_place(source)} has {sorted(tree)}; expected the groups {', '.join(cls.groups())}, each a mapping"
            )
        try:
            found = cls().override(**{k: v for group in tree.values() for k, v in (group or {}).items()})
        except (TypeError, ValueError) as error:
            raise ValueError(f"{_place(source)}: {error}") from None
        # Groups, or fields of groups that are there, which a file leaves out.
        absent = [f"the group {group}" for group in cls.groups() if not tree.get(group)]
        absent += [n for n, g in cls.owners().items() if tree.get(g) and n not in tree[g] and n not in cls.newer]
        if absent:
            expected = "every setting, as the run wrote it (cut or edited since); changes to a preset are given by --set"
            raise ValueError(f"{_place(source)} lacks {', '.join(absent)}; expected {expected}")
        return found


@cache
def _hints(kind: type) -> dict[str, Any]:
    """Types of a dataclass's fields, with their marks."""
    return get_type_hints(kind, include_extras=True)


LARGEST_YAML = 250_000  # bytes of a file, which are read in seconds; own choice: the course's largest has 73,000


class Written(dict[Any, Any]):
    """A mapping read from YAML that knows in which line it begins, and which line each key stands in."""

    line = 0  # not known
    lines: Mapping[Any, int] = types.MappingProxyType({})


class _TwiceError(yaml.YAMLError):
    """A key stands in a mapping twice."""


class _Loader(yaml.SafeLoader):
    """Reads plain YAML; mappings become `Written`, and a key that one of them has twice is refused."""

    def compose_mapping_node(self, anchor: Any) -> Any:
        """The mapping, if no key stands in it twice."""
        node, first = super().compose_mapping_node(anchor), {}
        for key, _ in node.value:  # as written: what << brings comes later, and a mapping's own keys win over it
            line, name = key.start_mark.line + 1, (key.tag, str(key.value))
            if name in first:
                raise _TwiceError(f"line {line}: {key.value!r} is already in line {first[name]}; expected each key once")
            first[name] = line
        return node


def _written(loader: yaml.SafeLoader, node: yaml.MappingNode) -> Iterator[Written]:
    found = Written()
    found.line = node.start_mark.line + 1
    yield found  # so that an alias inside it may name it
    found.update(loader.construct_mapping(node))
    found.lines = {loader.construct_object(key, deep=True): key.start_mark.line + 1 for key, _ in node.value}


_Loader.add_constructor("tag:yaml.org,2002:map", _written)


def read_yaml(source: str | Path) -> Any:
    """What a YAML file or text holds; mappings know their lines, see `Written`.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is not YAML, too large, or a mapping has a key twice; the message names the file and the line.
    """
    if isinstance(source, Path) and (size := source.stat().st_size) > LARGEST_YAML:
        raise ValueError(f"{source} has {size} bytes; expected at most {LARGEST_YAML}")
    try:
        found = yaml.load(source.read_text(encoding="utf-8") if isinstance(source, Path) else source, _Loader)  # noqa: S506
        if _entries(found, {}) <= LARGEST_YAML:
            return found
    except _TwiceError as error:
        raise ValueError(f"{_place(source)}, {error}") from None
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        raise ValueError(f"{_place(source)} is not YAML: {' '.join(str(error).split())}") from None
    raise ValueError(f"{_place(source)} has aliases for more than {LARGEST_YAML} entries, or one inside itself; expected fewer")


def _entries(tree: Any, known: dict[int, float]) -> float:
    """How many values there are if each alias is written out; infinite where one stands inside itself."""
    if not isinstance(tree, list | dict):
        return 1
    if id(tree) not in known:
        known[id(tree)] = math.inf
        known[id(tree)] = 1 + sum(_entries(part, known) for part in (tree.values() if isinstance(tree, dict) else tree))
    return known[id(tree)]


def near(found: object, known: Iterable[str]) -> str:
    """A hint at the known name that may be meant: " (did you mean 'rows'?)", or nothing."""
    match = difflib.get_close_matches(str(found), [*known], n=1)
    return f" (did you mean {match[0]!r}?)" if match else ""


def read_tree(source: str | Path) -> dict[str, Any]:
    """A configuration file or text as a mapping that names its system.

    Raises:
        ValueError: it is not UTF-8 or not YAML, has a key twice, is no mapping, or names no system, as files before 0.2 do not.
    """
    tree = read_yaml(source)
    if not isinstance(tree, dict):
        raise ValueError(f"{_place(source)} holds {str(tree)[:40]!r}; expected a mapping with system and groups of settings")
    if "system" not in tree:
        raise ValueError(
            f"{_place(source)} does not say which system it configures, as files of mwlib before 0.2 do not. Several settings "
            "have new names since; make the run again with this version (`mwlib train --help` lists the names)"
        )
    return tree


def _place(source: str | Path) -> str:
    return str(source) if isinstance(source, Path) else "the configuration"


def parse_changes(words: Sequence[str]) -> dict[str, Any]:
    """``name=value`` words, values in YAML, as changes to a configuration.

    >>> parse_changes(["wavelet=haar", "lr=1e-3", "test_subjects=[S9, S11]"])
    {'wavelet': 'haar', 'lr': '1e-3', 'test_subjects': ['S9', 'S11']}

    Numbers that YAML takes for text, like 1e-3, are read as numbers by the field that they are for.

    Raises:
        ValueError: a word has no equals sign, its name was given before, or its value is not YAML.
    """
    changes = {}
    for word in words:
        name, equals, value = word.partition("=")
        if not equals:
            raise ValueError(f"{word!r} is not a change; expected name=value, e.g. wavelet=haar")
        if name.strip() in changes:
            raise ValueError(f"{word!r}: {name.strip()} is given twice; expected each setting once")
        try:
            changes[name.strip()] = yaml.safe_load(value)
        except yaml.YAMLError:
            raise ValueError(f"{word!r}: the value is not YAML; quote it if it holds brackets, braces or colons") from None
    return changes


def checked(name: str, value: Any, hint: Any) -> Any:
    """A value as a field of this type takes it: whole floats, lists and numbers written as text are converted.

    Raises:
        ValueError: it does not fit; the message says what does.
    """
    kind, *rules = get_args(hint) if get_origin(hint) is Annotated else [hint]
    if get_origin(kind) is tuple:
        if isinstance(value, str) or not isinstance(value, Sequence):
            example = f", such as [{value}]" if isinstance(value, str | int | float) and value != "" else ""
            raise ValueError(f"{name} is {value!r}; expected a list{example}")
        inner = get_args(kind)[0]
        return tuple(str(item) if inner is str else checked(name, item, inner) for item in value)
    if get_origin(kind) is Literal:
        choice(name, value, get_args(kind))
        return value
    value = _number(value, kind) if kind in (int, float) else value
    if type(value) is not kind:
        raise ValueError(f"{name} is {value!r}; expected {KINDS.get(kind, kind)}")
    for rule in rules:
        if isinstance(rule, OneOf):
            choice(name, value, rule.choices)
        elif isinstance(rule, Ge) and not value >= rule.ge:
            raise ValueError(f"{name} is {value}; expected at least {rule.ge}")
        elif isinstance(rule, Gt) and not value > rule.gt:
            raise ValueError(f"{name} is {value}; expected more than {rule.gt}")
        elif isinstance(rule, Interval):
            high = rule.lt if rule.le is None else rule.le
            if not rule.ge <= value <= high or value == rule.lt:
                raise ValueError(f"{name} is {value}; expected {rule.ge} to {'below ' * (rule.le is None)}{high}")
    return value


def whole(name: str, value: object, least: int = 0, most: int | None = None) -> int:
    """An argument as a whole number: Python's, NumPy's or PyTorch's, but no text, fraction, True or False.

    Raises:
        ValueError: it is none, or out of range; the message names the argument.

    >>> whole("samples", 3, 1)
    3
    """
    try:
        number = operator.index(value)  # pyright: ignore[reportArgumentType]
    except (TypeError, RuntimeError):
        number = None
    if number is None or _is_truth(value):
        raise ValueError(f"{name} is {shown(value)}; expected a whole number, at least {least}")
    if number < least:
        raise ValueError(f"{name} is {shown(number)}; expected at least {least}")
    if most is not None and number > most:
        raise ValueError(f"{name} is {shown(number)}; expected at most {most}")
    return number


def wholes(name: str, values: object) -> list[int]:
    """An argument as several whole numbers from 0.

    Raises:
        ValueError: it is not several, or one is no such number; the message names the argument and the place.
    """
    return [whole(f"{name}[{place}]", value, 0) for place, value in enumerate(several(name, values, "whole numbers"))]


def real(name: str, value: object) -> float:
    """An argument as a finite number: Python's, NumPy's or PyTorch's, but no text, True or False.

    Raises:
        ValueError: it is none; the message names the argument.

    >>> real("seconds", 3)
    3.0
    """
    try:
        plain = getattr(value, "item")() if getattr(value, "ndim", 1) == 0 else value  # noqa: B009  (of no known type)
        number = float(plain) if isinstance(plain, Real) and not _is_truth(plain) else math.nan
    except (OverflowError, RuntimeError):
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f"{name} is {shown(value)}; expected a finite number")
    return number


def choice(name: str, value: object, choices: Iterable[str]) -> None:
    """Refuse an argument that is none of some texts.

    Raises:
        ValueError: it is none of them; the message names the argument.
    """
    choices = [*choices]
    if not isinstance(value, str) or value not in choices:
        raise ValueError(f"{name} is {shown(value)}; expected one of {', '.join(choices)}{near(value, choices)}")


def of_kind(name: str, value: Any, kind: type[Kind] | tuple[type[Kind], ...], expected: str = "") -> Kind:
    """An argument that must be an object of some class.

    Raises:
        ValueError: it is none; the message names the argument, and says `expected` or the class's name.
    """
    if isinstance(value, kind):
        return value
    raise ValueError(f"{name} is {shown(value)}; expected {expected or 'a ' + getattr(kind, '__name__', str(kind))}")


def several(name: str, values: object, what: str) -> list[Any]:
    """An argument as a list of things.

    Args:
        name: of the argument.
        values: what was given; neither a text nor a mapping.
        what: the things, in the message.

    Raises:
        ValueError: it is not several; the message names the argument.
    """
    try:
        if isinstance(values, str | bytes | Mapping):
            raise TypeError
        return list(values)  # pyright: ignore[reportArgumentType]
    except (TypeError, ValueError, RuntimeError):  # a tensor without numbers, or of no dimension
        raise ValueError(f"{name} is {shown(values)}; expected several {what}") from None


def _is_truth(value: object) -> bool:
    return "bool" in str(getattr(value, "dtype", type(value)))


def shown(value: object) -> str:
    """A value in a message, short: of an array its kind and shape."""
    if hasattr(value, "shape") and hasattr(value, "dtype"):
        return f"{type(value).__name__} of shape {tuple(getattr(value, 'shape'))}"  # noqa: B009  (of no known type)
    text = f"{value:.6g}" if isinstance(value, int) and abs(value) > 10**15 and abs(value) < 10**300 else repr(value)[:60]
    return f"{text} ({type(value).__name__})" if not isinstance(value, int | float | str | None) else text


def _number(value: Any, kind: type) -> Any:
    """What people mean by a number: 1e-3 as text, 4e3 for a whole number, 1 for a fraction; anything else as it is."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        return value
    try:
        number = float(value) if isinstance(value, str) else value
    except ValueError:
        return value
    if not abs(number) <= sys.float_info.max:
        return str(value)[:40]  # refused as no number
    if kind is float:
        return float(number)
    return int(number) if number == int(number) else number
