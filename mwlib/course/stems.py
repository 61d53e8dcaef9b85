"""Under which names a notebook keeps its pictures and tables, read from its source: no kernel is started.

A stem may be written where it is used, passed to a helper, or made of literals in a loop: the calls of the page are followed
through functions and loops, with the values of the names that are known there.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from itertools import repeat
from typing import Any

STEM_PLACE = 1  # of page.show and page.table
UNKNOWN = object()  # a value that only a run can tell
METHODS = ("items", "keys", "values", "replace", "lower")
Scope = dict[str, Any]


def parsed(notebook: Mapping) -> ast.Module:
    """The code of all cells as one syntax tree; a cell that is not plain Python is left out."""
    statements = []
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            try:
                statements += ast.parse("".join(cell["source"])).body
            except SyntaxError:
                continue
    return ast.Module(statements, [])


def page_calls(tree: ast.AST, *methods: str) -> list[ast.Call]:
    """The calls of some methods of `page`, in order."""
    return [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Attribute)
        and ast.unparse(node.func.value) == "page"
        and node.func.attr in methods
    ]


def saved_stems(notebook: Mapping) -> list[str]:
    """The stems that a notebook gives to `page.show` and `page.table`; one that it uses twice is there twice.

    Raises:
        ValueError: a stem cannot be read from the source.

    >>> cells = ["def board(stem):", "    page.show(fig, stem, alt, data)", "for n in (1, 2):", "    board(f'fig_{n}')"]
    >>> saved_stems({"cells": [{"cell_type": "code", "source": "\\n".join(cells)}]})
    ['fig_1', 'fig_2']
    """
    return [stem for _, stem in kept_calls(parsed(notebook)) if stem is not None]


def kept_calls(tree: ast.Module) -> list[tuple[str, str | None]]:
    """Every call of `page.show` and `page.table`: the method, and the stem or None; of a loop, pass after pass.

    Raises:
        ValueError: a stem cannot be read from the source.
    """
    source, found = _Source(tree), []
    for place, call in enumerate(page_calls(source.tree, "show", "table")):
        named = [keyword.value for keyword in call.keywords if keyword.arg == "stem"]
        expression = next(iter([*call.args[STEM_PLACE : STEM_PLACE + 1], *named]), ast.Constant(None))
        for turn, scope in enumerate(source.scopes(call)):
            stem = source.value(expression, scope)
            if not (stem is None or isinstance(stem, str)):
                text = f"{ast.unparse(call.func)}({ast.unparse(call.args[0]) if call.args else ''}, {ast.unparse(expression)}"
                raise ValueError(f"the stem in {text}, …) cannot be read; expected a literal, or a loop or call with literals")
            found.append((source.top(call), turn, place, _attribute(call), stem))
    return [(method, stem) for *_, method, stem in sorted(found, key=lambda one: one[:3])]


def _attribute(call: ast.Call) -> str:
    return call.func.attr if isinstance(call.func, ast.Attribute) else ""


class _Source:
    """A syntax tree with what is needed to tell the value of an expression in it."""

    def __init__(self, tree: ast.Module):
        self.tree = tree
        self.parents = {child: node for node in ast.walk(tree) for child in ast.iter_child_nodes(node)}
        self.calls: dict[str, list[ast.Call]] = {}
        self.assigned: dict[str, list[ast.expr]] = {}
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                self.calls.setdefault(node.func.id, []).append(node)
            if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
                self.assigned.setdefault(node.targets[0].id, []).append(node.value)

    def scopes(self, node: ast.AST) -> Iterator[Scope]:
        """The names known at a node: once for each pass of the loops and each call of the functions that it stands in."""
        parent = self.parents.get(node)
        if parent is None:
            yield {}
            return
        for scope in self.scopes(parent):
            if isinstance(parent, ast.For) and node in parent.body:
                yield from self._passes([parent], scope)
            elif isinstance(parent, ast.ListComp | ast.SetComp | ast.GeneratorExp) and node is parent.elt:
                yield from self._passes(parent.generators, scope)
            elif isinstance(parent, ast.FunctionDef) and node in parent.body:
                for call in self.calls.get(parent.name, []):
                    if parent not in self._around(call):
                        yield from (scope | self._arguments(parent, call, outer) for outer in self.scopes(call))
            else:
                yield scope

    def value(self, node: ast.AST | None, scope: Scope) -> Any:
        """The value of an expression made of literals and known names; else UNKNOWN."""
        match node:
            case ast.Constant(value):
                return value
            case ast.Name(name):
                once = self.assigned.get(name, [])
                return scope[name] if name in scope else self.value(once[0], scope) if len(once) == 1 else UNKNOWN
            case ast.Tuple(elements) | ast.List(elements):
                return [self.value(element, scope) for element in elements]
            case ast.Dict(keys, values):
                pairs = [(self.value(key, scope), self.value(item, scope)) for key, item in zip(keys, values, strict=True)]
                return {key: item for key, item in pairs if isinstance(key, str | int)}
            case ast.JoinedStr(parts):
                return _joined([self.value(part, scope) for part in parts])
            case ast.FormattedValue(inner, _, spec):
                held, form = self.value(inner, scope), self.value(spec, scope) if spec else ""
                return UNKNOWN if UNKNOWN in (held, form) else format(held, form)
            case ast.BinOp(left, ast.Add(), right):
                pair = self.value(left, scope), self.value(right, scope)
                return pair[0] + pair[1] if isinstance(pair[0], str | int) and type(pair[0]) is type(pair[1]) else UNKNOWN
            case ast.Call(function, arguments, keywords) if all(keyword.arg == "strict" for keyword in keywords):
                return self._called(function, [self.value(argument, scope) for argument in arguments], scope)
        return UNKNOWN

    def _called(self, function: ast.expr, arguments: list[Any], scope: Scope) -> Any:
        match function:
            case ast.Name("zip") if any(argument is not UNKNOWN for argument in arguments):
                columns = [repeat(UNKNOWN) if argument is UNKNOWN else argument for argument in arguments]
                return [list(row) for row in zip(*columns, strict=False)]
            case ast.Name("range") if UNKNOWN not in arguments:
                return list(range(*arguments))
            case ast.Name("enumerate") if UNKNOWN not in arguments:
                return [list(pair) for pair in enumerate(*arguments)]
            case ast.Attribute(owner, name) if name in METHODS and UNKNOWN not in arguments:
                method = getattr(self.value(owner, scope), name, None)
                return UNKNOWN if method is None else [*map(list, method())] if name == "items" else method(*arguments)
        return UNKNOWN

    def _passes(self, loops: list, scope: Scope) -> Iterator[Scope]:
        """The scope once for each pass of nested loops; one pass with unknown names where the items are unknown."""
        if not loops:
            yield scope
            return
        items = self.value(loops[0].iter, scope)
        for item in [UNKNOWN] if items is UNKNOWN else items:
            yield from self._passes(loops[1:], scope | _bound(loops[0].target, item))

    def _arguments(self, function: ast.FunctionDef, call: ast.Call, outer: Scope) -> Scope:
        names = [argument.arg for argument in (*function.args.posonlyargs, *function.args.args)]
        defaults = dict(zip(reversed(names), reversed(function.args.defaults), strict=False))
        defaults |= dict(zip((a.arg for a in function.args.kwonlyargs), function.args.kw_defaults, strict=True))
        given = dict(zip(names, call.args, strict=False)) | {k.arg: k.value for k in call.keywords}
        return {name: self.value(expression, outer) for name, expression in (defaults | given).items() if name}

    def top(self, node: ast.AST) -> int:
        """The place of the statement of the notebook that a node stands in."""
        return next(place for place, around in enumerate(self.tree.body) if around in (node, *self._around(node)))

    def _around(self, node: ast.AST) -> list[ast.AST]:
        around, above = [], self.parents.get(node)
        while above is not None:
            around.append(above)
            above = self.parents.get(above)
        return around


def _joined(parts: list[Any]) -> Any:
    return "".join(parts) if all(isinstance(part, str) for part in parts) else UNKNOWN


def _bound(target: ast.expr, item: Any) -> Scope:
    """What a loop's target holds for one item."""
    if isinstance(target, ast.Name):
        return {target.id: item}
    if isinstance(target, ast.Tuple | ast.List):
        items = item if isinstance(item, list) and len(item) == len(target.elts) else repeat(UNKNOWN)
        return {name: held for part, one in zip(target.elts, items, strict=False) for name, held in _bound(part, one).items()}
    return {}
