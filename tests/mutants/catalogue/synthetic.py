"""Mutants of synthetic."""

from tests.mutants.mutant import of

MUTANTS = [
    *of(
        "synthetic/movements.py", "synthetic/test_people.py",
        ("legs-in-step", '(0.0 if side == "left" else 0.5)) % 1.0', "0.0) % 1.0"),
        ("trunk-always-as-the-left-hand-would", "unit *= SIDES[near]", "unit *= 1.0"),
        ("limbs-stretched-too-far", "np.deg2rad(2.0))", "np.deg2rad(-20.0))"),
    ),
    *of(
        "synthetic/motions.py", "synthetic/test_people.py",
        ("clips-that-begin-anywhere", "return positions - positions[0, 0] * [1.0, 1.0, 0.0]", "return positions"),
        ("one-body-for-all", "spawn_key=(0, subject)", "spawn_key=(0,)"),
    ),
    *of(
        "synthetic/sentences.py", "synthetic/test_sentences.py",
        ("articles-that-do-not-agree", 'in "aeiou" else "a"', 'in "" else "a"'),
    ),
    *of(
        "synthetic/person.py", "synthetic/test_people.py",
        ("toes-through-the-floor", "np.minimum(np.clip(neutral, highest, LARGEST_PITCH), deepest)",
         "np.clip(neutral, highest, LARGEST_PITCH)"),
        ("standing-feet-turn-along", "return np.interp(np.arange(len(heading)), frames, mean[run])", "return heading"),
    ),
    *of(
        "synthetic/acts.py", "synthetic/test_acts.py",
        ("left-turns-go-right", "self.heading += angle * self.rise", "self.heading -= angle * self.rise"),
        ("half-the-time-in-the-air", "float(2 * np.sqrt(2 * height / GRAVITY))", "float(np.sqrt(2 * height / GRAVITY))"),
    ),
    *of(
        "synthetic/sentences.py", "synthetic/test_sentences.py",
        ("every-word-replaced", "rng.permutation(places)[:replacements]", "rng.permutation(places)"),
    ),
    *of(
        "synthetic/acts.py", "synthetic/test_acts.py",
        ("a-new-body-in-every-clip", "spawn_key=(2, person)", "spawn_key=(2, number)"),
    ),
    *of(
        "synthetic/acts.py", "synthetic/test_sentences_typed.py",
        ("times-of-anybody-walking", '{"action": "walk", "direction": "backward"} if action == "backward" else', "{} or"),
        ("time-of-the-slowest", "float(np.median(", "float(np.max("),
    ),
    *of(
        "synthetic/sentences.py", "synthetic/test_sentences_typed.py",
        ("what-is-left-open-is-drawn", "_drawn(actions, rng, usual=True) | said", "_drawn(actions, rng) | said"),
    ),
    *of(
        "synthetic/sentences_typed.py", "synthetic/test_sentences_typed.py",
        ("denials-are-done", "word in DENIALS or word.endswith(\"n't\")", "word in DENIALS"),
        ("any-number-of-actions", "if len(found.actions) > MOST:", "if len(found.actions) > 9:"),
        ("letters-of-any-script", 'if letter.isalpha() and "LATIN" not in', 'if letter.isdigit() and "LATIN" not in'),
        ("verbs-as-they-are", "(word not in known or _may_begin(before))", "word not in known"),
        ("nobody-acts", 'words = ["a", "person", *words]', "pass"),
        ("walks-with-no-path", 'r"\\1 forward"', 'r"\\1"'),
        ("either-side-is-the-first", 'said[0] if len(said) == 1 else ""', 'said[0] if said else ""'),
        ("a-bend-is-a-turn", '_actions(BEND.sub("", c)) if', "a if"),
        ("sides-of-two-actions", "if len(own) == 1:", "if own:"),
        ("whose-number-it-is", "if len(actions) == MOST:", "if False:"),
        ("clauses-without-an-action", "if _actions(clause) or not clauses else", "if True else"),
        ("plain-with-any-words", "and _clauses().issuperset(clauses)", ""),
        ("plain-in-any-order", "(len(asked) == 1 or asked in PAIRS)", "True"),
        ("reaches-with-both", 'if action == "wave" or "both"', 'if True or "both"'),
        ("backward-on-a-path", '"backward" if action == "walk" and', '"walk" if action == "walk" and'),
        ("every-pair-is-learnt", "or self.actions in PAIRS", "or len(self.actions) == 2"),
    ),
    *of(
        "experiments/sampling.py", "synthetic/test_sentences_typed.py",
        ("any-sentence-is-looked-at", "and is_plain(text) else {}", "else {}"),
        ("words-of-others-are-changed", 'return model.cfg.data.data == "people" and bool(model.net.text.vocabulary)',
         "return bool(model.net.text.vocabulary)"),
        ("what-was-typed-is-sampled", "[read[many[k]] for k in which], [", "[texts[many[k]] for k in which], ["),
        ("named-by-what-was-read", "model.layout, texts[many[k]], fused", "model.layout, read[many[k]], fused"),
        ("again-from-the-same-noise", "+ AGAIN * attempt", "+ 0 * attempt"),
        ("the-last-attempt-is-kept", "len(missed) < len(found[k][0])", "True"),
        ("what-it-does-besides", '{"then": "nothing"} | wanted', "wanted"),
        ("made-again-for-nothing", "if not (left := [k for k in left if found[k][0]]):", "if not left:"),
        ("long-motions-unbounded", ", longest) for one in usual]", ", 10**6) for one in usual]"),
    ),
]  # fmt: skip
