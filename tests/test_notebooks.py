"""The committed notebooks keep the structure rules, and every rule bites."""

from __future__ import annotations

import ast
import copy
import re
from pathlib import Path

import nbformat
import pytest
from nbclient.exceptions import CellExecutionError
from nbformat import NotebookNode
from nbformat.v4 import new_markdown_cell, new_output

from mwlib.course.execute import execute_notebook, filter_notebook
from mwlib.course.learner import learner_copy, write_learner_copies
from mwlib.course.notebooks import (
    EXPERIMENT,
    LONGEST,
    NOTEBOOKS,
    ParameterError,
    chapter_number,
    course,
    exhibits_kept,
    find_notebook,
    from_text,
    read_parameters,
    read_values,
    resolve,
    source_hash,
)
from tests.notebook_rules import check, pictures
from tests.sample_notebooks import code, model_notebook, save


@pytest.mark.parametrize("path", [*course(), EXPERIMENT], ids=lambda path: path.stem)
def test_notebook_keeps_the_rules(path):
    assert check(path) == []


def test_controls_are_arguments_of_what_they_redraw():
    """Nothing calls these functions where no widget is shown, so that only this test and a reader would find it."""
    seen = 0
    for path in course():
        cells = nbformat.read(path, as_version=4).cells
        tree = ast.parse("\n".join(cell.source for cell in cells if cell.cell_type == "code"))
        made = {node.name: node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}
        for call in ast.walk(tree):
            if isinstance(call, ast.Call) and ast.unparse(call.func) == "widgets.explore":
                drawn = call.args[0] if isinstance(call.args[0], ast.Lambda) else made[ast.unparse(call.args[0])]
                taken = {argument.arg for argument in drawn.args.args}
                assert {given.arg for given in call.keywords} - {"button"} <= taken, f"{path.stem}: {ast.unparse(call)}"
                seen += 1
    assert seen >= 4


def test_chapter_11_is_committed_with_recorded_people():
    """Its section 7 shows a synthetic runner where CMU's files are not at hand, as a reader may see it."""
    text = (NOTEBOOKS / "11_inbetweening.ipynb").read_text(encoding="utf-8")
    assert all(f'"{clip}, feet' in text for clip in ("07_03", "02_10"))


def test_controls_are_what_a_cell_ends_with():
    """A notebook shows the value of a cell's last expression, and none of one inside an `if`."""
    seen = 0
    for path in course():
        for cell in nbformat.read(path, as_version=4).cells:
            if cell.cell_type == "code" and re.search(r"widgets\.(explore|keyframes)\(", cell.source):
                last = ast.parse(cell.source).body[-1]
                assert isinstance(last, ast.Expr) and "widgets." in ast.unparse(last), f"{path.stem}: {cell.source}"
                seen += 1
    assert seen >= 5


def test_there_is_a_course_and_no_number_is_taken_twice():
    numbers = [chapter_number(path) for path in course()]
    assert len(set(numbers)) == len(numbers) and {*LONGEST} < {*numbers}


@pytest.fixture(scope="module")
def model(tmp_path_factory) -> Path:
    """The model notebook, executed and filtered."""
    path = save(model_notebook(), tmp_path_factory.mktemp("model"))
    execute_notebook(path)
    return path


def cell_with(notebook: NotebookNode, text: str) -> NotebookNode:
    return next(cell for cell in notebook.cells if text in cell.source)


def test_executing_keeps_prints_and_pictures_only(model):
    notebook = nbformat.read(model, as_version=4)
    assert check(model) == []
    assert cell_with(notebook, "energy").outputs == [new_output("stream", name="stdout", text="energy 14\n")]
    assert cell_with(notebook, "warnings.warn").outputs == []  # stderr
    (picture,) = pictures(cell_with(notebook, "subplots"))
    assert picture.metadata["image/png"]["alt"].startswith("An empty pair of axes")
    (_, table), *none = [(stem, out.data) for stem, out in exhibits_kept(notebook) if stem != "fig_01_axes"]
    assert exhibits_kept(notebook)[0] == ("fig_01_axes", picture) and table["text/html"].startswith("<table>") and not none


def test_executing_twice_gives_the_same_file(model):
    before = model.read_bytes()
    execute_notebook(model)
    assert model.read_bytes() == before


def test_a_notebook_that_raises_is_left_as_it_was(tmp_path):
    notebook = model_notebook()
    notebook.cells = [notebook.cells[0], code("1 / 0")]
    path = save(notebook, tmp_path)
    before = path.read_bytes()
    with pytest.raises(CellExecutionError, match="ZeroDivisionError"):
        execute_notebook(path)
    assert path.read_bytes() == before


def test_filter_drops_widgets_scripts_and_timing():
    widget = {"application/vnd.jupyter.widget-view+json": {"model_id": "1"}, "text/plain": "interactive(...)"}
    table = {"text/html": "<table><tr><td>1</td></tr></table>", "text/plain": "| 1 |"}
    animation = {"text/html": "<script>play()</script>", "text/plain": "<IPython.core.display.HTML object>"}
    frame = {"text/html": "<div><style scoped></style></div>", "text/plain": "   a\n0  1"}
    notebook = model_notebook()
    notebook.metadata["widgets"] = {"state": {}}
    cell = cell_with(notebook, "energy")
    cell.metadata |= {"always": "a sum of squares"}
    cell.metadata["execution"] = {"iopub.status.busy": "now"}
    cell.outputs = [new_output("display_data", data) for data in (widget, table, animation, frame)]
    filter_notebook(notebook)
    assert "widgets" not in notebook.metadata and list(cell.metadata) == ["tags", "always"]
    assert [output.data for output in cell.outputs] == [table, {"text/plain": "   a\n0  1"}]


def edit(text: str, **changes):
    """A change of the first cell that holds a text."""

    def change(notebook: NotebookNode) -> None:
        cell_with(notebook, text).update(changes)

    return change


def tag(text: str, *names: str):
    def change(notebook: NotebookNode) -> None:
        cell_with(notebook, text).metadata["tags"] = list(names)

    return change


def drop(text: str):
    def change(notebook: NotebookNode) -> None:
        notebook.cells.remove(cell_with(notebook, text))

    return change


def append(text: str, addition: str):
    def change(notebook: NotebookNode) -> None:
        cell_with(notebook, text).source += addition

    return change


def swap(text: str, replacement: str):
    def change(notebook: NotebookNode) -> None:
        cell = cell_with(notebook, text)
        cell.source = cell.source.replace(text, replacement)

    return change


def output(**fields):
    def change(notebook: NotebookNode) -> None:
        cell_with(notebook, "energy").outputs.append(new_output(**fields))

    return change


def unfold(text: str):
    def change(notebook: NotebookNode) -> None:
        del cell_with(notebook, text).metadata["jupyter"]

    return change


def unnamed_picture(notebook: NotebookNode) -> None:
    cell_with(notebook, "subplots").outputs[0].metadata = {}


def long_winded(notebook: NotebookNode) -> None:
    for cell in notebook.cells:
        if cell.cell_type == "code":
            cell.source += "\n1" * 5


def widget_state(notebook: NotebookNode) -> None:
    notebook.metadata["widgets"] = {}


WRONG = [{"code": f"half = {n}", "hint": "expected half"} for n in (3, 4, 5)]


def busy(change=None):
    """The model with wrong answers, by the rules of such chapters; then changed."""

    def made(notebook: NotebookNode) -> None:
        cell_with(notebook, "half = 4 / 2").metadata["wrong"] = WRONG * 2
        cell_with(notebook, "twice = 2").metadata["wrong"] = WRONG
        if change is not None:
            change(notebook)

    return made


def wrong(text: str, *answers: dict):
    def change(notebook: NotebookNode) -> None:
        cell_with(notebook, text).metadata["wrong"] = list(answers)

    return change


PARAMETERS, SAVED = "preset: str", {"mwlib": {"stem": "fig_01_axes"}}
BREACHES = {
    "second H1": (append("What you should see", "\n# Again"), "heading: 2 headings of level 1"),
    "skipped level": (edit("### Ex", source="##### Ex 1.1 Double it"), "heading: a heading of level 5"),
    "library not imported": (edit("import mwlib as mw", source="import warnings"), "first_cell: the first code cell"),
    "late import": (append("energy", "\nimport math"), "first_cell: .* imports"),
    "parameter untyped": (append(PARAMETERS, "\nk = 3  # three"), "parameters: .*not of the form"),
    "parameter uncommented": (append(PARAMETERS, "\nk: int = 3"), "parameters: .*no comment"),
    "parameter derived": (append(PARAMETERS, "\nk: int = 2 * level  # derived"), "parameters: .*not a literal"),
    "parameter of another type": (append(PARAMETERS, "\nk: int = 0.5  # half"), "parameters: .*expected int"),
    "parameter without a range": (append(PARAMETERS, "\nk: int = 3  # three"), "parameters: .*k has no range"),
    "parameter beyond its range": (append(PARAMETERS, "\nk: int = 3  # three; from 4 to 9"), "parameters: .*expected 4 to 9"),
    "no preset": (edit(PARAMETERS, source='out: str = ""  # folder'), "parameters: .*preset: str"),
    "no Config": (edit("cfg =", source="cfg = None"), "parameters: .*Config"),
    "no page": (edit("page = Page", source="cfg = mw.Config.preset(preset)"), "page: .*no 'page = Page"),
    "page without a parameter": (swap(", lr=lr", ""), "page: .*expected name=name .*'lr'"),
    "page with another value": (swap("lr=lr", "lr=level"), "page: .*expected name=name .*'lr'"),
    "page of another name": (swap("01_sample", "02_sample"), "name: the page is called '02_sample'"),
    "files of its own": (append("energy", "\nif out:\n    open(out)"), "page: cell 4 uses 'out'"),
    "stem twice": (
        output(output_type="display_data", metadata={"mwlib": {"stem": "fig_01_axes"}}),
        "page: the stem 'fig_01_axes'",
    ),
    "no result": (drop("page.finish"), "result: 0 calls"),
    "result too early": (append("page.finish", "\nprint(1)"), "result: 1 calls"),
    "two results": (append("energy", "\npage.finish({})"), "result: 2 calls"),
    "install": (append("energy", "\n%pip install x"), "forbidden: .*magic"),
    "absolute path": (append("energy", "\nopen('/etc/hosts')"), "forbidden: .*absolute path"),
    "printed path": (output(output_type="stream", text="saved /home/me/x.png"), "forbidden: .*one machine"),
    "progress bar": (append("energy", "\ntqdm(3)"), "forbidden: .*tqdm"),
    "tagged to raise": (tag("warnings.warn", "raises-exception"), "forbidden: .*raises-exception"),
    "tagged to be skipped": (tag("warnings.warn", "nbval-skip"), "forbidden: .*nbval-skip"),
    "tagged to be passed over": (tag("warnings.warn", "skip-execution"), "forbidden: .*skip-execution"),
    "comment to skip": (append("energy", "\n  # NBVAL_SKIP"), "forbidden: .*a comment that nbval obeys"),
    "comment to ignore": (append("energy", "\n##NBVAL_IGNORE_OUTPUT"), "forbidden: .*a comment that nbval obeys"),
    "compared and ignored": (tag("energy", "nbval-check-output", "nbval-ignore-output"), "compared: .*one of the two"),
    "picture of its own": (append("energy", "\nplots.show(fig, '')"), "forbidden: .*a picture or table of its own"),
    "showing imported": (append("import mwlib", "\nfrom mwlib.plots import curves, show"), "forbidden: .*of its own"),
    "result of its own": (append("energy", "\nruns.finish('', {}, {})"), "forbidden: .*a result of its own"),
    "long cell": (append("energy", "\nx = 1" * 26), "length: the longest cell"),
    "long cells": (long_winded, "length: the median cell"),
    "not executed": (edit("energy", execution_count=None), "executed: execution counts"),
    "changed since": (append("energy", "  # changed"), "executed: a source has changed"),
    "stderr": (output(output_type="stream", name="stderr", text="noise"), "outputs: .*stderr"),
    "error": (output(output_type="error", ename="E", evalue="", traceback=[]), "outputs: .*an error"),
    "script": (output(output_type="display_data", data={"text/html": "<script>"}), "outputs: .*script"),
    "address": (output(output_type="display_data", data={"text/plain": "[<Line2D at 0x7f00>]"}), "outputs: .*address"),
    "widget state": (widget_state, "outputs: metadata.widgets"),
    "nothing compared": (edit("energy", outputs=[]), "compared: no cell"),
    "clock compared": (append("energy", "\nperf_counter"), "compared: .*time"),
    "assert of a preset": (append("energy", "\nassert preset != 'tiny' or level"), "claims: .*expected page.claim"),
    "order asserted of what was loaded": (
        append("energy", "\nfound = page.load(sum, [1])\nfor one in [found]:\n    both = 2 * one\nassert level < both"),
        "claims: .*asserts what was measured \\(both\\)",
    ),
    "number asserted of what was loaded": (
        append("energy", "\nfound = page.load(sum, [1])\nassert [found, 2] == [17, 2]"),
        "claims: .*asserts what was measured \\(found\\)",
    ),
    "order asserted with a message, far from an answer": (
        append("energy", "\nfound = page.load(sum, [1])\nassert found < level, 'is the sum right?'"),
        "claims: .*asserts what was measured \\(found\\)",
    ),
    "order asserted with a message, of nothing that was answered": (
        append("half == 2", "\nfound = page.load(sum, [1])\nassert found < level, 'is the sum right?'"),
        "claims: .*asserts what was measured \\(found\\)",
    ),
    "order asserted of what a function makes": (
        append("energy", "\nfound = page.load(sum, [1])\ndef twice(n):\n    return n * found\nassert twice(1) < level"),
        "claims: .*asserts what was measured \\(twice\\)",
    ),
    "order asserted of what was gathered": (
        append("energy", "\nrows = []\nfound = page.load(sum, [1])\nrows.append(found)\nassert rows[0] < level"),
        "claims: .*asserts what was measured \\(rows\\)",
    ),
    "claim compared": (append("energy", "\npage.claim('x', True)"), "claims: .*is compared and claims"),
    "no symbols": (edit("## Energy", source="## Energy\n$$x$$"), "symbols: "),
    "picture without text": (unnamed_picture, "described: .*alternative text"),
    "picture without prose": (edit("What you should see", source="Nice."), "described: .*What you should see"),
    "exercise number": (edit("### Ex", source="### Ex 1.2 Double it"), "exercises: .*numbered"),
    "no solution": (tag("twice = "), "exercises: .*no cell tagged"),
    "no self-check": (drop("assert twice"), "exercises: .*no self-check"),
    "solution open to all eyes": (unfold("twice = 2"), "exercises: .*not folded"),
    "derivation open to all eyes": (edit("<details>", source="By hand."), "exercises: a solution in words begins 'By hand.'"),
    "hole that cannot be left open": (append("energy", "\nprint(1)  # your turn: one"), "holes: 'print"),
    "no derivation": (drop("<details>"), "exercises: Ex 1.1 has no derivation"),
    "one hole": (swap("  # your turn: a third of six", ""), "holes: 1 lines end in"),
    "few holes for a busy chapter": (busy(), "holes: 2 lines end in .*expected 6"),
    "hole with few wrong answers": (busy(wrong("half = 4 / 2", *WRONG)), "wrong_answers: .* names 3 wrong answers; expected 6"),
    "exercise without wrong answers": (
        busy(lambda n: cell_with(n, "twice = 2").metadata.pop("wrong")),
        "wrong_answers: '### Ex 1.1",
    ),
    "wrong answer without a hint": (busy(wrong("twice = 2", *WRONG[1:], {"code": "x"})), "wrong_answers: .* that is not"),
    "picture explained at once": (busy(), "described: 'What you should see' after .* is not folded"),
    "guard open to all eyes": (tag("energy", "guard"), "exercises: the guard in cell"),
    "too many words": (busy(append("What you should see", " word" * 3500)), "economy: 35.* words; expected at most 3500"),
    "too many tables": (busy(append("What you should see", "\n| a |\n|---|" * 9)), "economy: 11 tables; expected at most 8"),
    "hole without a check": (append("twice == level", "\nx = 1  # your turn: one"), "holes: no check with a message"),
}


@pytest.mark.parametrize("breach", BREACHES)
def test_every_rule_bites(model, tmp_path, breach):
    notebook = nbformat.read(model, as_version=4)
    change, expected = BREACHES[breach]
    change(notebook)
    problems = check(save(notebook, tmp_path))
    assert any(re.match(expected, problem) for problem in problems), problems


@pytest.mark.parametrize(
    "harmless",
    [
        "assert abs(found - level) < 1e-6",  # rounding
        "assert found.shape == (3, 4) and found.sum() == 0",  # a size, and what may follow from the mathematics
        "found = level\nassert found < level",  # another thing under the same name
        "assert all(found < 3 for found in [level])",
        "assert found == level",
        "def twice(found):\n    return 2 * found\nassert twice(1) < level",  # its own argument
    ],
)
def test_other_asserts_may_stand(model, tmp_path, harmless):
    assert not problems_with_claims(model, tmp_path, append("energy", f"\nfound = page.load(sum, [1])\n{harmless}"))


@pytest.mark.parametrize(
    ("place", "check"),
    [
        ("half == 2", "assert found < half, 'is it half?'"),
        ("half == 2", "share = found / half\nassert share < 1, 'is it half?'"),
        ("twice == level", "assert found < twice, 'is it twice?'"),
    ],
)
def test_a_readers_answer_may_be_checked(model, tmp_path, place, check):
    assert not problems_with_claims(model, tmp_path, append(place, f"\nfound = page.load(sum, [1])\n{check}"))
    assert problems_with_claims(model, tmp_path, append(place, f"\nfound = page.load(sum, [1])\n{check.partition(', ')[0]}"))


def test_what_is_true_of_any_data_may_be_asserted(model, tmp_path):
    def change(notebook: NotebookNode) -> None:
        append("energy", "\nfound = page.load(sum, [1])\nassert found < level")(notebook)
        cell_with(notebook, "energy").metadata["always"] = "an inequality of sums"

    assert not problems_with_claims(model, tmp_path, change)


def problems_with_claims(model: Path, folder: Path, change) -> list[str]:
    """What the rule of claims finds in the model after a change."""
    notebook = nbformat.read(model, as_version=4)
    change(notebook)
    return [problem for problem in check(save(notebook, folder)) if problem.startswith("claims")]


def test_size_is_limited(model, tmp_path):
    notebook = nbformat.read(model, as_version=4)
    notebook.cells.append(new_markdown_cell("x" * 1_000_000))
    assert any(problem.startswith("size: ") for problem in check(save(notebook, tmp_path)))


def test_source_hash_ignores_outputs_and_sees_sources(model):
    notebook = nbformat.read(model, as_version=4)
    stripped, edited = copy.deepcopy(notebook), copy.deepcopy(notebook)
    for cell in stripped.cells:
        cell.pop("outputs", None)
    cell_with(edited, "energy").source += "\nprint(1)"
    assert source_hash(notebook) == source_hash(stripped) == source_hash(model) != source_hash(edited)


def test_learner_copies_hold_the_checks_and_no_solutions(model, tmp_path):
    notebook = learner_copy(nbformat.read(model, as_version=4))
    text = "\n".join(cell.source for cell in notebook.cells)
    assert "twice = 2" not in text and "assert twice" in text and "Your turn" in text and "Because" not in text
    assert "half = ...  # your turn: half of four" in text and "half == 2" in text
    assert not any(cell.get("outputs") for cell in notebook.cells)
    (first,) = write_learner_copies(tmp_path, [model])
    first.write_text("a learner's work")
    assert write_learner_copies(tmp_path, [model]) == []
    assert first.read_text() == "a learner's work"


def test_text_is_read_as_the_parameter_is_typed():
    offered = read_parameters(model_notebook())
    words = ["preset=007", "level=3", "lr=1e-3", "names=['db4']"]
    assert resolve(offered, from_text(offered, words)) | {"data": "", "out": ""} == {
        "preset": "007", "data": "", "level": 3, "lr": 0.001, "names": ["db4"], "out": "",
    }  # fmt: skip
    for word in ("level=", "level=007", "lr=fast", "names=[", "level"):
        with pytest.raises(ParameterError, match="expected"):
            from_text(offered, [word])
    with pytest.raises(ParameterError, match="level is given twice; expected each parameter once"):
        from_text(offered, ["level=3", "level=4"])


def test_a_file_of_values_says_each_name_once(tmp_path):
    (tmp_path / "values.yaml").write_text("level: 1\nlevel: 2\n")
    with pytest.raises(ValueError, match=r"values.yaml, line 2: 'level' is already in line 1; expected each key once"):
        read_values(tmp_path / "values.yaml")


def test_notebooks_are_found_by_name_and_number(tmp_path):
    path = save(model_notebook(), tmp_path, "03_third")
    assert find_notebook("03", tmp_path) == find_notebook("03_third", tmp_path) == find_notebook(str(path)) == path
    with pytest.raises(FileNotFoundError, match="03_third"):
        find_notebook("04", tmp_path)


def test_a_number_may_have_a_letter_and_is_never_taken_for_another(tmp_path):
    names = ("03_third", "03b_second_half", "04_fourth")
    paths = [save(model_notebook(), tmp_path, name) for name in names]
    save(model_notebook(), tmp_path, "notes_of_mine"), save(model_notebook(), tmp_path, "0304_both")
    assert course(tmp_path) == paths
    assert [find_notebook(number, tmp_path) for number in ("03", "03b", "04")] == paths
    with pytest.raises(FileNotFoundError, match="03b_second_half"):
        find_notebook("0", tmp_path)


def test_exercises_may_belong_to_a_chapter_with_a_letter(model, tmp_path):
    notebook = nbformat.read(model, as_version=4)
    cell = cell_with(notebook, "### Ex 1.1")
    cell.source = cell.source.replace("Ex 1.1", "Ex 1b.1")
    notebook.metadata["mwlib"]["source"] = source_hash(notebook)
    assert check(save(notebook, tmp_path)) == []
