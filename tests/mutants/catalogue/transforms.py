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
        ("levels-in-another-order", "2 ** (level - n) for n", "2 ** (n - omit - 1) for n"),
        ("coarse-details-left-out", "for n in range(level, omit, -1)", "for n in range(level - omit, 0, -1)"),
        ("deeper-levels-of-the-motion", "pywt.dwt(analysis[:approx], filters", "pywt.dwt(np.eye(length)[:approx], filters"),
    ),
    *of(
        "transforms/linear.py", "transforms/test_linear.py",
        ("projection-is-the-identity", "analysis, synthesis, analysis @ synthesis", "analysis, synthesis, np.eye(len(analysis))"),
        ("sines-begin-a-frame-late", "((0, 0), (1, 1))", "((0, 0), (2, 0))"),
    ),
    *of(
        "transforms/linear.py", "transforms/test_linear.py",
        ("bands-that-hold-still", "return mean, deviation.clamp_min(1e-3 * float(deviation.max()))", "return mean, deviation"),
        ("scales-in-the-windows-precision", "(part.float().cpu() for part", "(part.cpu() for part"),
    ),
]  # fmt: skip
