"""Mutants of transforms."""

from tests.mutants.mutant import of

MUTANTS = [
    *of(
        "transforms/phase.py", "transforms/test_phase.py",
        ("frequency-of-the-next-bin", "power @ (bins * (fps / count))", "power @ ((bins + 1) * (fps / count))"),
        ("linear-path-left-out", "return self.layers(x) + self.line(x)", "return self.layers(x)"),
    ),
    *of(
        "transforms/dwt.py", "transforms/test_linear.py",
        ("levels-in-another-order", "[1, *(2**k for k in range(level - omit))]", "[*(2**k for k in range(level - omit)), 1]"),
        ("coarse-details-left-out", "range(level, omit, -1)", "range(level - omit, 0, -1)"),
        ("projection-is-the-identity", "Constant(s), Constant(a @ s)", "Constant(s), Constant(np.eye(len(a)))"),
    ),
    *of(
        "transforms/linear.py", "transforms/test_linear.py",
        ("sines-begin-a-frame-late", "((0, 0), (1, 1))", "((0, 0), (2, 0))"),
    ),
]  # fmt: skip
