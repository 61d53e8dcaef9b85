"""Mutants of matching."""

from tests.mutants.mutant import of

MUTANTS = [
    *of(
        "matching/evaluators.py", "text_to_motion/test_published.py",
        ("vectors-in-the-order-of-the-list", "vectors[[rows[word] for word in words]]", "vectors[: len(words)]"),
        ("any-deviation-will-do", "if not 0.5 < weight", "if not 0.01 < weight"),
        ("places-not-all-looked-at", "place for place in wanted.places", "place for place in wanted.places[:1]"),
    ),
    *of(
        "matching/evaluators.py", "text_to_motion/test_published.py",
        ("published-files-without-a-hash", "[str(file) for file in published_files(Path(name)).values()] or [name]", "[name]"),
        ("a-name-comes-before-published-files", "if published_files(Path(name)):",
         "if published_files(Path(name)) and name != \"evaluator\":"),
    ),
    *of(
        "matching/objective.py", "text_to_motion/test_matching_objective.py",
        ("pairs-as-negatives", "torch.randint(1, len(text), (1,)", "torch.randint(0, len(text), (1,)",
         "text_to_motion/test_matching_objective.py::test_every_other_shift_is_drawn"),
        ("copies-as-negatives", "left_out = same & ~", "left_out = same & ",
         "text_to_motion/test_matching_objective.py::test_infonce_by_a_loop"),
        ("critic-learns-from-all", "chosen = of_half(data.train, cfg.model.half)", "chosen = data.train",
         "text_to_motion/test_matching_objective.py::test_evaluator_and_critic_learn_from_their_own_clips"),
    ),
    *of(
        "matching/evaluators.py", "text_to_motion/test_matching.py",
        ("motion-not-scaled", "scaled = self.statistics.scale(features.to(self.device, torch.float32)).values",
         "scaled = features.to(self.device, torch.float32)",
         "text_to_motion/test_matching.py::test_motions_come_in_raw_and_the_matcher_scales_them"),
    ),
]  # fmt: skip
