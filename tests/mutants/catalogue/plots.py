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
        "plots/routes.py", "plots/test_routes.py",
        ("way-runs-to-the-left", "onward >= 0 else", "onward < 0 else"),
        ("camera-in-front-of-the-way", "float(np.degrees(angle)) - 90", "float(np.degrees(angle))"),
    ),
    *of(
        "plots/chapters/bridging.py", "plots/test_bridging.py",
        ("cosines-at-twice-their-frequency", "fps / (2 * len(x))", "fps / len(x)"),
        ("clean-keyframes-of-the-first-step", "x[-1, ENDS], \"o\"", "x[0, ENDS], \"o\""),
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
        ("names-can-end-the-script", r'.replace("<", "\\u003c")', ""),
        ("ghosts-at-the-wrong-frame", "at = frame - actor.start", "at = frame - actor.start - 1"),
    ),
    *of(
        "plots/loops.py", "plots/test_loops.py",
        ("loop-plays-once", "loop=0, **FORMATS", "loop=1, **FORMATS"),
        ("loop-without-its-last-frame", "range((shown.frames - 1) % step, shown.frames, step)",
         "range(0, shown.frames - step, step)"),
        ("limit-forgotten", "if size <= most_bytes:", "if True:"),
        ("loops-in-the-readers-look", "@style()\ndef loop(", "def loop("),
    ),
    *of(
        "plots/lines.py", "plots/test_frequencies.py",
        ("dots-beside-their-line", "places[marked], values[marked]", "places[marked], values[marked - 1]"),
        ("bars-behind-each-other", "(number - (len(series) - 1) / 2) * thick", "0"),
        ("fan-of-eight-tenths", "(0.9, 0.5) if", "(0.8, 0.5) if",
         "plots/test_plots.py::test_fan_holds_the_median_and_the_middle_of_the_samples"),
        ("future-begins-with-the-film", "array(x)[-len(values) :]", "array(x)[: len(values)]",
         "plots/test_diffusion.py::test_predicted_curves_line_up_with_the_future"),
    ),
    *of(
        "plots/look.py", "plots/test_sentences.py::test_each_sentence_has_a_panel_of_its_own_scale",
        ("columns-without-their-label", "if ax.get_visible()]", "if True]"),
    ),
    *of(
        "plots/saving.py", "plots/test_plots.py::test_saved_files_hold_numbers_words_and_origin",
        ("short-columns-end-in-zeros", 'fillvalue=""', 'fillvalue="0"'),
        ("text-on-several-lines", '" ".join(alt.split())', "alt"),
        ("layout-by-the-readers-settings", "layout.execute(fig)", "pass",
         "plots/test_plots.py::test_the_layout_is_solved_once"),
    ),
    *of(
        "plots/tables.py", "plots/test_plots.py::test_results_table_rounds_marks_and_lists",
        ("the-worst-is-bold", '(min if which == "lower" else max)', '(max if which == "lower" else min)'),
    ),
    *of(
        "plots/lines.py", "plots/test_plots.py",
        ("projection-against-nothing", " - np.eye(len(analysis))", ""),
        ("shares-of-one", "100 * row[band]", "row[band]"),
    ),
    *of(
        "plots/bodies.py", "plots/test_player.py",
        ("left-and-right-exchanged", '"l" if joint in skeleton.left else "r"', '"r" if joint in skeleton.left else "l"'),
    ),
    *of(
        "plots/bodies.py", "plots/test_plots.py::test_every_skeleton_knows_where_it_faces",
        ("bodies-face-backwards", "np.arctan2(-x, y)", "np.arctan2(x, -y)"),
    ),
    *of(
        "plots/chapters/wavelets.py", "plots/test_wavelets.py",
        ("taps-a-frame-late", "2 * k + 1 - np.arange(len(taps))", "2 * k + 2 - np.arange(len(taps))"),
        ("coefficients-over-other-frames", "return 2 * np.arange(count) + 1 -", "return 2 * np.arange(count) + 5 -"),
        ("marks-of-a-series-on-one-line", "(number - (len(values) - 1) / 2) * step", "0"),
    ),
    *of(
        "plots/chapters/diffusion.py", "plots/test_diffusion.py",
        ("histogram-of-any-area", "(len(values) * np.diff(edges))", "len(values)"),
        ("paths-coloured-by-their-beginning", "path[-1] > 0", "path[0] > 0"),
    ),
    *of(
        "plots/chapters/free_t2m.py", "plots/test_frequencies.py",
        ("coefficients-counted-from-zero", "start=1, **options", "start=0, **options"),
        ("share-of-one-more", "share[few - 1]", "share[few]"),
    ),
    *of(
        "plots/chapters/wavelets.py", "plots/test_diffusion.py",
        ("windows-begin-at-zero", "np.arange(len(window)) - len(window) // 2", "np.arange(len(window))"),
    ),
    *of(
        "plots/chapters/free_t2m.py", "plots/test_sentences.py",
        ("left-is-right", "joints[0, right] - joints[0, left]", "joints[0, left] - joints[0, right]"),
    ),
    *of(
        "plots/chapters/metrics.py", "plots/test_plots.py::test_metric_pictures_carry_the_metric_and_its_links",
        ("links-to-the-farthest", "np.argmin", "np.argmax"),
    ),
    *of(
        "plots/chapters/diagrams.py", "plots/test_guidance.py::test_diagrams_hold_the_data_they_are_given",
        ("noise-left-out-of-the-diagram", '"$\\\\mathbf{y}^{(t)}$", y_t)', '"$\\\\mathbf{y}^{(t)}$", y)'),
    ),
    *of(
        "plots/chapters/guidance.py", "plots/test_guidance.py",
        ("bars-of-one-error", "xerr=2 * error", "xerr=error"),
    ),
    *of(
        "plots/player_widget.py", "plots/test_player.py::test_the_widget_takes_all_that_a_page_takes",
        ("player-begins-with-its-second-frame", "traitlets.Int(0)", "traitlets.Int(1)"),
    ),
]  # fmt: skip
