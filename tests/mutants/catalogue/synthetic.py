"""Mutants of synthetic."""

from tests.mutants.mutant import of

MUTANTS = [
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
]  # fmt: skip
