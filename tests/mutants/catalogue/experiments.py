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
        "experiments/runs.py", "experiments/test_origins.py",
        ("one-run-for-every-critic", '__version__, *models_behind(cfg, "built_on")]', "__version__]"),
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
