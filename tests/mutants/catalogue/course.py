"""Mutants of course."""

from tests.mutants.mutant import of

MUTANTS = [
    *of(
        "course/notebooks.py", "test_notebooks.py::test_source_hash_ignores_outputs_and_sees_sources",
        ("sources-are-not-hashed", '"".join(cell["source"]).strip())', '"")'),
        ("values-go-unchecked", "if kind == parameter.kind and _is(kind, value):", "if kind == parameter.kind:",
         "course/test_drills.py::test_parameters_that_do_not_fit_are_refused_before_anything_runs"),
        ("unknown-parameters-pass", "if name not in offered:\n            raise", "if False:\n            raise",
         "course/test_drills.py::test_parameters_that_do_not_fit_are_refused_before_anything_runs"),
        ("a-letter-does-not-count", "or chapter_number(path) == name]", "or chapter_number(path)[:2] == name]",
         "test_notebooks.py::test_a_number_may_have_a_letter_and_is_never_taken_for_another"),
        ("exhibits-without-their-mark", 'if "stem" in mark]', "if True]",
         "test_notebooks.py::test_executing_keeps_prints_and_pictures_only"),
    ),
    *of(
        "course/execute.py", "course/test_drills.py::test_a_run_with_a_skipped_cell_is_not_done",
        ("skipped-cells-pass", "if cell.execution_count != number:", "if False:"),
        ("two-runs-mix", 'results.locked(folder.with_suffix(".lock"))', 'results.locked(folder.with_suffix(f".{os.getpid()}"))',
         "course/test_drills.py::test_two_runs_into_one_folder_come_one_after_the_other"),
        ("an-exit-passes", "        if left:\n", "        if False:\n",
         "course/test_drills.py::test_a_run_that_breaks_is_not_done"),
        ("any-result-counts", '"finished") is None:', '"finished") == 3:',
         "course/test_drills.py::test_a_run_that_breaks_is_not_done"),
        ("old-exhibits-stay", 'about.get("notebook") == notebook:', "False:",
         "course/test_drills.py::test_what_an_earlier_run_left_is_removed_and_nothing_else"),
        ("stderr-is-kept", 'if output.name == "stdout" else None', "if True else None",
         "test_notebooks.py::test_executing_keeps_prints_and_pictures_only"),
        ("stems-are-dropped", '(*PICTURES, "mwlib")', "PICTURES",
         "test_notebooks.py::test_executing_keeps_prints_and_pictures_only"),
        ("old-data-count", 'data.get("files") != fingerprint', 'None == fingerprint',
         "course/test_exhibits.py::test_index_believes_a_result_only_if_it_is_of_today"),
    ),
    *of(
        "course/learner.py", "course/test_learner.py::test_an_open_line_is_followed_by_one_that_says_so",
        ("an-open-line-runs-on", "assert {name} is not ..., ", "assert {name} is ..., "),
        ("the-target-of-an-open-line-is-lost", 'lines.append(f"{head} {name}")', "pass"),
    ),
    *of(
        "course/site.py", "course/test_site.py::test_solutions_are_folded_and_nothing_else_is",
        ("solutions-lie-open", '_folded(cell) if "solution" in tags(cell) else cell', "cell"),
        ("all-is-folded", '_folded(cell) if "solution" in tags(cell) else cell', "_folded(cell)"),
    ),
    *of(
        "course/exhibits.py", "course/test_site.py::test_committed_results_come_first",
        ("committed-results-are-not-shown", "if row.committed:", "if not row.committed:"),
        ("index-of-bare-numbers", "[{sentence}](", "[{title}](", "course/test_site.py::test_the_index_says_what_each_exhibit_is"),
        ("exhibits-out-of-order", "return kind, int(number), row.notebook", "return kind, -int(number), row.notebook",
         "course/test_site.py::test_every_exhibit_of_the_paper_is_there_in_its_order"),
        ("markdown-is-not-escaped", r'r"\\\1"', r'r"\1"',
         "course/test_exhibits.py::test_index_shows_what_was_made_and_says_what_is_missing"),
        ("broken-files-are-silent", "broken.append(", "str(",
         "course/test_exhibits.py::test_index_lives_with_broken_files_and_odd_names"),
    ),
    *of(
        "course/manifest.py", "course/test_exhibits.py::test_manifest_names_what_is_wrong",
        ("an-exhibit-twice", "values.count(value) > 1]", "values.count(value) > 2]"),
        ("files-may-lack", "elif missing := set(FILES", "elif missing := set() and set(FILES"),
    ),
    *of(
        "course/working_copy.py", "test_installed.py::test_what_is_there_is_kept",
        ("files-are-overwritten", "if not target.exists() and not target.is_symlink():", "if True:"),
    ),
    *of(
        "course/rules.py", "test_notebooks.py::test_every_rule_bites",
        ("one-hole-is-enough", "if found < 2:", "if found < 1:"),
        ("a-late-result-is-missed", "isinstance(last, ast.Expr) and last.value is calls[0]", "True"),
        ("any-level-of-heading", "if lower > upper + 1:", "if lower > upper + 3:"),
    ),
]  # fmt: skip
