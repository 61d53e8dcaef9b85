"""Mutants of course."""

from tests.mutants.mutant import of

MUTANTS = [
    *of(
        "course/outputs.py", "course/test_outputs.py::test_outputs_that_do_not_match_their_calls_are_left_out",
        ("outputs-that-do-not-match-are-paired", "if len(stems) == len(outputs):", "if stems:"),
        ("outputs-of-other-cells-count", "or not _speaks(node, helpers)] for tree", "or True] for tree",
         "course/test_outputs.py::test_a_helper_shows_where_it_is_called"),
    ),
    *of(
        "course/stems.py", "course/test_outputs.py::test_a_loop_shows_pass_after_pass",
        ("a-loop-shows-call-after-call", "key=lambda one: one[:3]", "key=lambda one: (one[0], one[2], one[1])"),
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
        "course/site_exhibits.py", "course/test_site.py::test_committed_results_come_first",
        ("committed-results-are-not-shown", "if row.committed:", "if not row.committed:"),
        ("index-of-bare-numbers", "{label}[{sentence}](", "{label}[{title}](",
         "course/test_site.py::test_the_index_says_what_each_exhibit_is"),
    ),
]  # fmt: skip
