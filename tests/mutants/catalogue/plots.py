"""Mutants of plots."""

from tests.mutants.mutant import of

MUTANTS = [
    *of(
        "plots/bodies.py", "plots/test_guidance.py",
        ("the-smallest-body-sets-the-scale", "quarter = (len(flat) - 1) // 4", "quarter = 0"),
    ),
    *of(
        "plots/lines.py", "plots/test_plots.py::test_the_truth_is_black_among_curves",
        ("truth-coloured-as-the-rest", 'if name == "truth" else', 'if name == "" else'),
    ),
    *of(
        "plots/chapters/guidance.py", "plots/test_guidance.py::test_numbers_of_an_axis_do_not_run_into_each_other",
        ("ticks-of-changes-are-left-to-matplotlib", "ax.set_xticks(_three_ticks(*ax.get_xlim()))", "pass"),
    ),
    *of(
        "plots/routes.py", "plots/test_passages.py",
        ("way-runs-to-the-left", "onward >= 0 else", "onward < 0 else"),
        ("camera-in-front-of-the-way", "float(np.degrees(angle)) - 90", "float(np.degrees(angle))"),
    ),
    *of(
        "plots/chapters/bridging.py", "plots/test_bridging.py",
        ("step-at-its-first-frame", "(np.arange(frames - 1) + 0.5) / fps", "np.arange(frames - 1) / fps"),
        ("seam-after-the-keyframe-only", "for step in (k - 1, k) if", "for step in (k,) if"),
        ("cosines-at-twice-their-frequency", "fps / (2 * len(x))", "fps / len(x)"),
        ("bone-errors-in-metres", "1000 * np.abs(", "np.abs(", "plots/test_passages.py"),
        ("clean-keyframes-of-the-first-step", "x[-1, given], \"o\"", "x[0, given], \"o\""),
    ),
    *of(
        "plots/widgets.py", "plots/test_widgets.py",
        ("a-box-and-its-button-ask-twice", "if values == shown:", "if False:"),
        ("a-button-is-not-waited-for", '"manual": bool(button)', '"manual": False'),
    ),
    *of(
        "plots/loops.py", "plots/test_player.py",
        ("short-motions-begin-with-the-film", "frames - len(positions) if history else 0", "0"),
        ("floor-at-the-root", "positions[..., 2].min(axis=1)", "positions[:, 0, 2]"),
        ("given-pose-not-moved-along", "return positions[0] - actor.offset", "return positions[0]"),
    ),
    *of(
        "plots/playing.py", "plots/test_player.py",
        ("positions-wrap-round", "max(MILLIMETRE, float(np.abs(raised).max()) / LARGEST)", "MILLIMETRE"),
        ("positions-cut-instead-of-rounded", "np.round(raised / unit)", "np.trunc(raised / unit)"),
        ("left-and-right-exchanged", '"l" if joint in skeleton.left else "r"', '"r" if joint in skeleton.left else "l"'),
        ("names-can-end-the-script", r'.replace("<", "\\u003c")', ""),
        ("ghosts-at-the-wrong-frame", "at = frame - actor.start", "at = frame - actor.start - 1"),
    ),
    *of(
        "plots/loops.py", "plots/test_loops.py",
        ("loop-plays-once", '"loop": 0}', '"loop": 1}'),
        ("loop-without-its-last-frame", "range((shown.frames - 1) % step, shown.frames, step)",
         "range(0, shown.frames - step, step)"),
        ("limit-forgotten", "if size <= most_bytes:", "if True:"),
    ),
]  # fmt: skip
