"""Mutants of matching."""

from tests.mutants.mutant import of

MUTANTS = [
    *of(
        "matching/system.py", "matching/test_evaluators.py",
        ("captions-not-shuffled", "r_precision(text[strangers], motion", "r_precision(text, motion"),
        ("a-half-against-itself", "fid(motion[order[:half]], motion[order[half:]])",
         "fid(motion[order[:half]], motion[order[:half]])"),
    ),
    *of(
        "matching/objective.py", "matching/test_clips.py",
        ("stretches-in-either-half", 'clip.name.split(" ")[0])', "clip.name)"),
        ("critic-and-evaluator-of-one-half", 'wanted = ("evaluator", "critic").index(half)', "wanted = 0"),
        ("no-window-at-the-end", "(self.frames.lengths - frames + 1)", "(self.frames.lengths - frames)"),
        ("captions-of-other-clips", "self.first_caption[clip] + ", "self.first_caption[clip.flip(0)] + "),
    ),
    *of(
        "matching/config.py", "matching/test_objective.py",
        ("movements-of-two-frames", "movement_frames % UNIT", "movement_frames % 2"),
    ),
    *of(
        "matching/evaluators.py", "matching/test_clips.py",
        ("sentences-not-cut", "words_of(text)[: self.longest]", "words_of(text)"),
    ),
    *of(
        "matching/evaluators.py", "matching/test_published.py",
        ("tag-wins-over-the-lists", "_KIND.get(word, tag)", "tag if tag in PARTS else _KIND.get(word, tag)"),
        ("unknown-words-keep-their-tag", "word, tag = UNKNOWN_WORD, OTHER", "word = UNKNOWN_WORD"),
        ("padding-counted-as-words", "torch.tensor([*map(len, filled)])", "torch.tensor([max(map(len, filled))] * len(filled))"),
        ("captions-not-cut", "LONGEST = 20", "LONGEST = 200"),
        ("ends-not-marked", ", (END_WORD, OTHER)]", "]"),
        ("plain-captions-have-no-words", "    if not isinstance(sentence, TaggedCaption) or not sentence.tagged:\n",
         "    if not isinstance(sentence, TaggedCaption):\n        return ()\n    if not sentence.tagged:\n"),
    ),
    *of(
        "matching/evaluators.py", "matching/test_published.py",
        ("vectors-in-the-order-of-the-list", "vectors[[rows[word] for word in words]]", "vectors[: len(words)]"),
        ("any-deviation-will-do", "if not 0.5 < weight", "if not 0.01 < weight"),
        ("published-clips-never-end", "TaggedVocabulary(words), WINDOW)", "TaggedVocabulary(words))"),
        ("places-not-all-looked-at", "place for place in places]", "place for place in places[:1]]"),
    ),
    *of(
        "matching/evaluators.py", "matching/test_published.py",
        ("published-files-without-a-hash", "[str(file) for file in published_files(Path(name)).values()] or [name]", "[name]"),
        ("a-name-comes-before-published-files", "if published_files(Path(name)):",
         "if published_files(Path(name)) and name != \"evaluator\":"),
    ),
    *of(
        "matching/objective.py", "matching/test_objective.py",
        ("pairs-as-negatives", "torch.randint(1, len(text), (1,)", "torch.randint(0, len(text), (1,)",
         "matching/test_objective.py::test_every_other_shift_is_drawn"),
        ("copies-as-negatives", "left_out = same & ~", "left_out = same & ",
         "matching/test_objective.py::test_infonce_by_a_loop"),
        ("critic-learns-from-all", "chosen = of_half(data.train, cfg.model.half)", "chosen = data.train",
         "matching/test_objective.py::test_evaluator_and_critic_learn_from_their_own_clips"),
    ),
    *of(
        "matching/evaluators.py", "matching/test_evaluators.py",
        ("motion-not-scaled", "scaled = self.statistics.normalise(features.to(self.device, torch.float32))",
         "scaled = features.to(self.device, torch.float32)",
         "matching/test_evaluators.py::test_motions_come_in_raw_and_the_matcher_scales_them"),
    ),
]  # fmt: skip
