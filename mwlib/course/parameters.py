"""The parameters cell of a notebook: what it offers, and whether given values fit."""

from __future__ import annotations

import ast
import io
import tokenize
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

SCALARS = {"str": str, "int": int, "float": float, "bool": bool}
KINDS = (*SCALARS, "list[str]", "list[int]", "list[float]")


class ParameterError(ValueError):
    """A notebook's parameters cell, or a value given for it, is not as it should be."""


@dataclass(frozen=True)
class Parameter:
    """One line of a parameters cell: ``name: kind = default  # comment``."""

    name: str
    kind: str
    default: Any
    comment: str

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
    comments = _comments(source)
    parameters = [_parameter(node, comments) for node in tree.body]
    return {parameter.name: parameter for parameter in parameters}


def resolve(offered: Mapping[str, Parameter], given: Mapping[str, Any]) -> dict[str, Any]:
    """All values of a run: the defaults, with the given ones checked and put in their place.

    Raises:
        ParameterError: a name is unknown or a value is of the wrong type; the message lists what is offered.
    """
    for name in given:
        if name not in offered:
            raise ParameterError(f"unknown parameter {name!r}; the notebook offers\n{_listing(offered)}")
    return {name: _fit(parameter, given.get(name, parameter.default)) for name, parameter in offered.items()}


def from_text(offered: Mapping[str, Parameter], assignments: list[str]) -> dict[str, Any]:
    """Values of ``name=text`` words, each read as its parameter's type demands: for `str` the text as it stands,
    otherwise a Python literal.

    Raises:
        ParameterError: a word has no ``=``, its name is unknown, or its text is not a literal.
    """
    given = {}
    for word in assignments:
        name, equals, text = word.partition("=")
        if not equals or name not in offered:
            raise ParameterError(f"unknown parameter in {word!r}; expected name=value with one of\n{_listing(offered)}")
        given[name] = text if offered[name].kind == "str" else _literal(offered[name], text)
    return given


def read_values(file: Path) -> dict[str, Any]:
    """Values by parameter name, from a YAML file; an empty file gives none.

    Raises:
        FileNotFoundError: there is no such file.
        ParameterError: it is not YAML, or not a mapping.
    """
    try:
        tree = yaml.safe_load(file.read_text(encoding="utf-8"))
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ParameterError(f"{file} is not YAML: {' '.join(str(error).split())}") from None
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
    kind = parameter.kind.removeprefix("list[").removesuffix("]")
    if kind == parameter.kind and _is(kind, value):
        return SCALARS[kind](value)
    if kind != parameter.kind and isinstance(value, list | tuple) and all(_is(kind, item) for item in value):
        return [SCALARS[kind](item) for item in value]
    found = f"{parameter.name} is {value!r} ({type(value).__name__})"
    hint = " (YAML reads 1e-3 as text; write 1.0e-3)" if kind == "float" and isinstance(value, str) else ""
    raise ParameterError(f"{found}; expected {parameter.kind}, e.g. {parameter.default!r}{hint}")


def _is(kind: str, value: Any) -> bool:
    return type(value) is SCALARS[kind] or (kind == "float" and type(value) is int)


def _parameter(node: ast.stmt, comments: Mapping[int, str]) -> Parameter:
    text = ast.unparse(node)
    if not (isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) and node.value is not None):
        raise ParameterError(f"parameters cell: {text!r} is not of the form 'name: type = literal  # comment'")
    kind, comment = ast.unparse(node.annotation), comments.get(node.end_lineno or 0, "")
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


def _comments(source: str) -> dict[int, str]:
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    return {token.start[0]: token.string.lstrip("# ").strip() for token in tokens if token.type == tokenize.COMMENT}


def _listing(offered: Mapping[str, Parameter]) -> str:
    return "\n".join(f"  {parameter}" for parameter in offered.values())
