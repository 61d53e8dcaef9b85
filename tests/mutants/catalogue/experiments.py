"""Mutants of experiments."""

from tests.mutants.mutant import of

MUTANTS = [
    *of(
        "experiments/lafan1_commands.py", "experiments/test_lafan1_commands.py",
        ("missed-digits-are-success", "return 1 if missed else 0", "return 0"),
    ),
    *of(
        "experiments/claims.py", "experiments/test_reproduction.py",
        ("spreads-exchanged", '"sd": ", deviation", "se": ", standard error"', '"sd": ", standard error", "se": ", deviation"'),
        ("checks-may-hold-texts", "type(node.value) not in (int, float)", "type(node.value) in (bool,)"),
        ("checks-may-hold-any-syntax", "if not isinstance(node, UNDERSTOOD) or (", "if ("),
        ("a-number-may-stand-for-a-truth", "and _is_truth(inner) != ", "and False and _is_truth(inner) != "),
        ("a-column-may-stand-for-a-number", "inner.id in columns and not", "not columns and not"),
        ("checks-see-the-builtins", '{"__builtins__": {}}, ', ""),
        ("cases-in-any-order", "for case in claim.cases:", "for case in reversed(claim.cases):"),
        ("reasons-left-out", "if case.kind in WITH_A_REASON and", "if not case.kind and"),
        ("claims-without-evidence", 'if not body.get("shown") and not all(case.kind', 'if "shown" in body and not all(case.kind'),
        ("false-counts-as-not-measured", "    if not false:\n", "    if missing or not false:\n"),
        ("sections-not-looked-up", "if place.section not in headings:", "if not headings:"),
        ("quotes-not-looked-up", "if place.prints and not any(", "if place.prints and all("),
    ),
    *of(
        "experiments/grid_options.py", "test_command_line.py",
        ("data-of-a-grid-not-heard", '({"data": args.data} if args.data else {}) | parse_changes', "parse_changes"),
    ),
    *of(
        "experiments/shipped.py", "experiments/test_shipped.py",
        ("shipped-in-single-precision", 't.half() if name.startswith("net.") and t.is_floating_point() else t', "t"),
        ("shipped-without-its-owners-words", ', *acknowledgement(cfg.get("data")).values()]', "]"),
    ),
    *of(
        "experiments/runs.py", "experiments/test_runs.py::test_another_model_behind_a_run_makes_it_another_run",
        ("one-run-for-every-critic", "digest([self.key, *built_on])", "digest([self.key])"),
        ("one-result-for-every-judge", "[digest(built_on + judged_by)] if", "[digest(built_on)] if"),
    ),
    *of(
        "experiments/runs.py", "experiments/test_runs.py::test_another_sampler_gives_another_number",
        ("a-result-for-any-code", "*others, code])}.json", "*others])}.json"),
        ("a-run-for-any-code", "-{self.training}-{code}", "-{self.training}"),
        ("a-change-is-not-told", "        log.warning(\n", "        log.debug(\n"),
    ),
    *of(
        "experiments/runs.py", "experiments/test_runs.py::test_a_run_of_older_code_is_taken_where_that_is_asked_for",
        ("older-code-is-always-taken", "if not found or changed and not accepts_older_code():", "if not found:"),
        ("a-result-forgets-that-its-model-is-older", 'if changed := self.changed(of_run["depends"]):', "if changed := []:"),
        ("what-is-gone-is-no-change", "for name in before | self.code if", "for name in self.code if"),
    ),
    *of(
        "experiments/runs.py", "experiments/test_runs.py::test_a_training_that_older_code_began_goes_on",
        ("a-run-forgets-the-code-it-began-with", "depends |= self._marked(read_tree(self.folder / CODE))",
         "depends |= self._marked(self.code)"),
        ("stopped-runs-of-older-code-are-lost", "if (place / CHECKPOINT).exists() and", "if False and"),
    ),
    *of(
        "experiments/results.py", "experiments/test_runs.py",
        ("half-written-results-are-believed", "isinstance(tree.get(name), kind) for", "True for",
         "experiments/test_runs.py::test_results_are_believed_only_when_whole"),
        ("results-of-other-parameters-are-believed", "== (status, key) else None", "== (status, result.get('hash')) else None",
         "experiments/test_runs.py::test_results_are_believed_only_when_whole"),
        ("the-place-of-results-counts", 'if name != "out"', "if name",
         "experiments/test_runs.py::test_the_hash_of_a_notebooks_parameters_leaves_out_where_results_go"),
        ("locks-outlive-errors", "        lock.release()", "        pass",
         "experiments/test_runs.py::test_a_lock_is_free_again_after_an_error"),
    ),
    *of(
        "experiments/grids.py", "experiments/test_tables.py",
        ("warm-up-not-shortened", '("train_steps", "lr_period", "warmup", "ema_start")',
         '("train_steps", "lr_period", "ema_start")'),
        ("average-begins-after-the-end", '("train_steps", "lr_period", "warmup", "ema_start")',
         '("train_steps", "lr_period", "warmup")'),
        ("milestones-not-shortened", "[round(share * m) for m in", "[m for m in"),
        ("base-wins-over-the-row", "return shared | row.changes", "return row.changes | shared"),
        ("budget-wins-over-the-base", "(shared | grid.base)", "(grid.base | shared)"),
        ("budget-ends-one-step-early", "<= b.until", "< b.until"),
        ("rows-without-pairs", '{"sampling_seed": seed, **', '{"sampling_seed": hash(row.name) % 1000 + seed, **'),
        ("one-training-for-all-seeds", '({"seed": seed} if grid.trains_at(cfg) else {})', "{}"),
        ("training-seeds-where-none-is-trained", '({"seed": seed} if grid.trains_at(cfg) else {})', '{"seed": seed}'),
    ),
    *of(
        "experiments/grids.py", "experiments/test_grids.py",
        ("budget-has-no-say-in-trainings", "return self.trains if said is None else said", "return self.trains"),
    ),
    *of(
        "experiments/lafan1_commands.py", "experiments/test_lafan1_commands.py",
        ("one-training-speaks-for-all", "{metric: mean(values)", "{metric: values[0]"),
    ),
    *of(
        "experiments/tables.py", "experiments/test_tables.py",
        ("deviation-of-a-population", "stdev(v) if", "stdev(v) * ((len(v) - 1) / len(v)) ** 0.5 if"),
        ("standard-error-of-the-last-seed", 'results[0]["standard_error"].get(m)', 'results[-1]["standard_error"].get(m)'),
        ("standard-error-in-metres", '= scale * error', '= error'),
        ("deviation-in-metres", "(value, scale * spread)", "(value, spread)"),
        ("numbers-of-the-first-seed", "m: mean(v) for", "m: v[0] for"),
    ),
]  # fmt: skip
