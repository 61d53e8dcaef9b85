"""Pictures: every function draws, and what reaches the disk or the notebook is complete, described and repeatable."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from functools import partial

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
import torch
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from mwlib import metrics, plots
from mwlib.body.skeleton import CMU, H36M17
from mwlib.data.collections import SKELETONS
from mwlib.diffusion.process import alpha_bar, ddim_indices
from mwlib.diffusion.samplers import ddim
from mwlib.plots.bodies import _spread, facing, poses, project
from mwlib.plots.chapters.metrics import FUTURES, TRUTHS, WORDS
from mwlib.plots.look import INK, OBSERVED
from mwlib.plots.saving import as_csv
from mwlib.synthetic.motions import synthetic_motions
from mwlib.transforms import WaveletTransform
from tests.plots.legible import contrast, legible, luminance

FPS, HISTORY, FRAMES = 25.0, 8, 32
WALK = synthetic_motions(1, seconds=2)[0].resample(FPS).cut(0, FRAMES)
X = torch.as_tensor(WALK.root_relative())
FUTURE = X[None, HISTORY:] * torch.linspace(0.9, 1.1, 5)[:, None, None]
TF = WaveletTransform(FRAMES, 48, "haar")
BANDS = TF.split(TF(X))
SCHEDULE = alpha_bar("cosine", 20)
ENERGIES = {name: float(band.square().sum()) for name, band in BANDS.items()}
DENOISING = list(ddim(lambda y, t: torch.zeros_like(y), TF(X), SCHEDULE, ddim_indices(20, 5)))
VALUES = {"wavelet": {"walk": 0.3, "sit": 0.5}, "zero velocity": {"walk": 0.9}}
NORMAL = (np.linspace(-3, 3, 50), np.exp(-(np.linspace(-3, 3, 50) ** 2) / 2) / np.sqrt(2 * np.pi))
SCENE = {"fps": FPS, "truth": X[HISTORY:], "last": X[HISTORY - 1]}
STILL = {"truth": X, "sample": FUTURE[0]}

PICTURES = {
    "filmstrip": partial(plots.filmstrip, WALK),
    "filmstrip of a single frame": partial(plots.filmstrip, WALK.with_up("y").cut(0, 1)),
    "storyboard": partial(plots.storyboard, STILL, H36M17, fps=FPS, history=HISTORY),
    "storyboard of one motion in the world": partial(plots.storyboard, WALK.positions, H36M17, fps=FPS, frames=[0, 5, -1]),
    "overlay_futures": partial(plots.overlay_futures, FUTURE, H36M17, **SCENE),
    "overlay_futures at two moments": partial(plots.overlay_futures, FUTURE.numpy(), H36M17, frames=(3, -1), **SCENE),
    "end_poses": partial(plots.end_poses, {"walk": (FUTURE, X[HISTORY:]), "again": (FUTURE[:2], X)}, H36M17),
    "trajectories": partial(plots.trajectories, X[:, 8], FUTURE[:, :, 8], fps=FPS),
    "trajectories of one sample": partial(plots.trajectories, X[:, 8], FUTURE[:1, :, 8], fps=FPS),
    "filters": partial(plots.filters, "bior2.8"),
    "signal_and_coefficients": partial(plots.signal_and_coefficients, X[:, 8], "bior2.8", fps=FPS),
    "padding_modes": partial(plots.padding_modes, X[:, 8], modes=("zero", "symmetric", "constant", "smooth")),
    "matrix": partial(plots.matrix, TF.analysis_time, split=16),
    "subbands": partial(plots.subbands, BANDS),
    "subbands, common scale": partial(plots.subbands, BANDS, common=True),
    "subbands of nothing": partial(plots.subbands, {name: 0 * band for name, band in BANDS.items()}),
    "energy_bars": partial(plots.energy_bars, ENERGIES),
    "energy_bars of two": partial(plots.energy_bars, {"haar": ENERGIES, "again": ENERGIES}),
    "projection_change": partial(plots.projection_change, TF.analysis_time, TF.synthesis_time, title="haar"),
    "schedules": partial(plots.schedules, {kind: alpha_bar(kind, 50) for kind in ("cosine", "linear")}),
    "band_snr": partial(plots.band_snr, {"aa": 0.4, "da": 0.02, "loud": 1e9}, SCHEDULE),
    "noising": lambda: plots.noising(TF, X, SCHEDULE, [0, 10, 19], H36M17, generator=torch.Generator().manual_seed(0)),
    "ddim_path": partial(plots.ddim_path, DENOISING, TF.inverse, H36M17, fps=FPS, history=HISTORY, truth=X, count=2),
    "ddim_path without truth": partial(plots.ddim_path, DENOISING, TF.inverse, H36M17, fps=FPS, count=3),
    "loss_curves": partial(plots.loss_curves, {"training": torch.linspace(1, 0.2, 120), "validation": [(50, 0.4), (100, 0.3)]}),
    "metric_picture": plots.metric_picture,
    "curves": partial(plots.curves, {"a": SCHEDULE, "b": 1 - SCHEDULE}, xlabel="t", ylabel="share", log="y"),
    "small_multiples": partial(
        plots.small_multiples, {"here": {"a": [0, 1]}, "there": {"a": [2, 5]}}, xlabel="s", ylabel="change"
    ),
    "histograms": partial(plots.histograms, {"a": X, "b": X[:5]}, xlabel="position (m)"),
    "histograms and density": partial(plots.histograms, {"a": X}, density=NORMAL),
    "density_map": partial(plots.density_map, [9, 5, 0], NORMAL[0], np.stack([NORMAL[1]] * 3)),
    "sampling_paths": partial(plots.sampling_paths, [9, 5, 0], X[:3, :20], density=NORMAL),
    "bars_per_action": partial(plots.bars_per_action, VALUES, xlabel="ADE (m)"),
}


@pytest.fixture(scope="module")
def line() -> Figure:
    """The smallest figure."""
    return plots.schedules({"cosine": SCHEDULE})[0]


@pytest.mark.parametrize("picture", PICTURES.values(), ids=PICTURES)
def test_every_picture_is_legible_and_leaves_no_trace(picture):
    before = dict(mpl.rcParams)
    fig, axes = picture()
    assert isinstance(fig, Figure) and all(isinstance(ax, Axes) for ax in np.atleast_1d(axes).flat)
    legible(fig)
    assert dict(mpl.rcParams) == before
    curves = [
        curve for ax in fig.axes for curve in ax.lines if len(set(curve.get_xdata())) > 2 and curve.get_linestyle() != "None"
    ]
    assert all(curve.get_alpha() == 0.25 for curve in curves if curve.get_linewidth() < 1.5)  # raw values behind their mean


def test_colours_survive_greyscale_and_stand_off_the_page():
    lightness = np.sort([116 * np.cbrt(luminance(colour)) - 16 for colour in plots.CYCLE])
    assert np.diff(lightness).min() > 6
    assert min(map(contrast, (*plots.CYCLE, OBSERVED))) >= 3
    assert contrast(INK) >= 7


def test_the_truth_is_black_among_curves():
    truth, model = plots.curves({"truth": SCHEDULE, "model": SCHEDULE}, xlabel="t", ylabel="share")[1].lines
    assert (truth.get_color(), truth.get_linestyle()) == (INK, "-") and model.get_color() == plots.CYCLE[1]


def test_small_multiples_have_scales_of_their_own_and_one_legend():
    fig, axes = PICTURES["small_multiples"]()
    assert axes[0].get_ylim() != axes[1].get_ylim() and [ax.get_title(loc="left") for ax in axes] == ["here", "there"]
    assert [list(ax.lines[0].get_ydata()) for ax in axes] == [[0, 1], [2, 5]]
    assert [text.get_text() for text in fig.legends[0].get_texts()] == ["a"]


def test_storyboard_tells_past_truth_and_prediction_apart():
    fig, ax = plots.storyboard(STILL, H36M17, fps=FPS, history=HISTORY, frames=[HISTORY - 1, HISTORY, FRAMES - 1])
    drawn = [group for group in ax.collections if isinstance(group, LineCollection)]
    colours = {mpl.colors.to_hex(group.get_color()[0]) for group in drawn}
    assert {OBSERVED, "#000000", *plots.CYCLE[:2]} <= colours
    assert len(drawn) == 3 * (3 + 2)  # the sample has no past
    assert {"0.00 s", "+0.04 s", "+0.96 s", "truth", "sample", "observed  ", "  future"} == {text.get_text() for text in ax.texts}


def test_storyboard_cuts_off_what_explodes_instead_of_shrinking_the_rest():
    calm, _ = plots.storyboard({"truth": X, "sample": X}, H36M17, fps=FPS)
    wild, _ = plots.storyboard({"truth": X, "sample": 100 * X}, H36M17, fps=FPS)
    assert np.ptp(wild.axes[0].get_ylim()) < 2 * np.ptp(calm.axes[0].get_ylim())


@pytest.mark.parametrize(("history", "total", "count"), [(0, 30, 4), (8, 32, 8), (25, 125, 8), (1, 9, 3)])
def test_chosen_frames_hold_the_ends_of_past_and_future(history, total, count):
    frames = _spread(count, history, total)
    assert frames == sorted(set(frames)) and len(frames) == count
    assert {0, max(history - 1, 0), total - 1} <= set(frames)


def test_poses_take_both_layouts_of_a_motion():
    upright = poses(WALK.positions, H36M17)
    assert np.allclose(upright[:, 0, :2], 0) and np.allclose(upright[..., 2], WALK.positions[..., 2])
    assert np.allclose(poses(X, H36M17), upright - upright[:, :1])
    with pytest.raises(ValueError, match=r"\(32, 47\).*H36M17 takes \(..., 48\) or \(..., 17, 3\)"):
        poses(X[:, :47], H36M17)


@pytest.mark.parametrize("name", SKELETONS)
def test_every_skeleton_knows_where_it_faces(name):
    skeleton = SKELETONS[name]
    pose = np.zeros((len(skeleton), 3))
    pose[list(skeleton.left), 1], pose[list(skeleton.right), 1] = 1, -1  # left is +y, so the body faces +x
    assert facing(pose, skeleton) == pytest.approx(0)
    turned = pose @ np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]])  # by +90 degrees about z
    assert facing(turned, skeleton) == pytest.approx(90)


def test_camera_shows_the_left_hand_side_on_the_right_from_the_front():
    left, up = project(np.array([[0.0, 1, 0], [0, 0, 1]]), azimuth=0)
    assert left == pytest.approx([1, 0]) and up == pytest.approx([0, np.cos(np.radians(15))])


def test_fan_holds_the_median_and_the_middle_of_the_samples():
    _, ax = plots.trajectories(X[:, 8], FUTURE[:, :, 8], fps=FPS)
    median = next(line for line in ax.lines if line.get_label() == "predicted")
    assert np.allclose(median.get_ydata(), np.median(FUTURE[:, :, 8], axis=0))
    assert median.get_xdata()[0] == pytest.approx(1 / FPS)
    low, high = np.quantile(FUTURE[:, :, 8], [0.05, 0.95], axis=0)
    outline = ax.collections[0].get_paths()[0].vertices[:, 1]
    assert outline.min() == pytest.approx(low.min()) and outline.max() == pytest.approx(high.max())


def test_projection_change_counts_the_rows_that_change():
    tf = WaveletTransform(125, 48, "bior2.8", "zero")
    fig, axes = plots.projection_change(tf.analysis_time, tf.synthesis_time, title="bior2.8")
    assert fig.get_suptitle() == "bior2.8: 25 of 142 rows change"
    assert "16 of 71" in axes[0].get_title(loc="left") and "9 of 71" in axes[1].get_title(loc="left")


def test_energy_is_shown_as_shares():
    _, ax = plots.energy_bars({"aa": 3.0, "da": 1.0})
    assert [bar.get_width() for bar in ax.patches] == [75, 25]
    assert [text.get_text() for text in ax.texts] == ["75.0 %", "25.0 %"]


@pytest.fixture(scope="module")
def metric_axes() -> dict[str, Axes]:
    return dict(zip(WORDS, plots.metric_picture()[1], strict=True))


@pytest.mark.parametrize("name", ["apd", "ade", "fde", "mmade", "mmfde"])
def test_metric_pictures_carry_the_metric_and_its_links(name, metric_axes):
    ax = metric_axes[name]
    p, g = torch.as_tensor(FUTURES)[None], torch.as_tensor(TRUTHS)
    expected = {"apd": lambda: metrics.apd(p), "ade": lambda: metrics.ade(p, g[:1]), "fde": lambda: metrics.fde(p, g[:1])}
    value = float(expected.get(name, lambda: getattr(metrics, name)(p, [g]))())
    assert ax.get_title(loc="left") == f"{name.upper()} = {plots.significant(value)} m"
    lengths = np.linalg.norm(np.diff(ax.collections[0].get_segments(), axis=1)[:, 0], axis=-1)
    frames = FUTURES.shape[1]
    if name == "apd":
        assert np.linalg.norm(lengths.reshape(6, frames), axis=1).mean() == pytest.approx(value)
    else:
        assert lengths.mean() == pytest.approx(value)


DATA = {"time": np.arange(4) / 3, "band": torch.arange(6.0).reshape(3, 2) / 7, "name": ["a", "b"]}


def test_saved_files_hold_numbers_words_and_origin(line, tmp_path):
    paths = plots.save(line, tmp_path / "new", "fig", data=DATA, alt="Two\n curves.", provenance={"seed": 0})
    assert sorted(path.name for path in (tmp_path / "new").iterdir()) == sorted(path.name for path in paths)
    png, pdf, table, text, origin = (tmp_path / "new" / f"fig.{ending}" for ending in ("png", "pdf", "csv", "txt", "json"))
    assert png.read_bytes().startswith(b"\x89PNG") and pdf.read_bytes().startswith(b"%PDF")
    assert text.read_text() == "Two curves.\n"
    assert json.loads(origin.read_text()) == {"figure": "fig", "seed": 0}
    with table.open() as lines:
        header, *rows = csv.reader(lines)
    assert header == ["time", "band_0", "band_1", "name"]
    assert np.allclose([float(row[0]) for row in rows], DATA["time"])
    assert np.array_equal(np.array([row[1:3] for row in rows[:3]], dtype=np.float32), DATA["band"].numpy())
    assert [row[3] for row in rows] == ["a", "b", "", ""] and rows[3][1] == ""


def test_saved_rows_become_a_table():
    assert as_csv([{"a": 1, "b": 0.1}, {"a": 2, "c": "x"}]) == "a,b,c\n1,0.1,\n2,,x\n"


def test_saved_table_holds_rows_and_origin(tmp_path):
    paths = plots.save_table([{"a": 1, "b": 0.1}, {"a": 2}], tmp_path, "scores", provenance={"seed": 0})
    assert [path.name for path in paths] == ["scores.csv", "scores.json"]
    assert (tmp_path / "scores.csv").read_text() == "a,b\n1,0.1\n2,\n"
    assert json.loads(paths[1].read_text()) == {"table": "scores", "seed": 0}
    with pytest.raises(ValueError, match="without a folder"):
        plots.save_table([{"a": 1}], tmp_path, "no/scores", provenance={})


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"alt": "  "}, ValueError, "alternative text is empty"),
        ({"data": {}}, ValueError, "data are empty"),
        ({"stem": "../fig"}, ValueError, "without a folder"),
        ({"provenance": {"path": object()}}, TypeError, "not JSON serializable"),
    ],
)
def test_nothing_is_written_when_something_is_missing(line, tmp_path, change, error, message):
    arguments = {"folder": tmp_path, "stem": "fig", "data": DATA, "alt": "A line.", "provenance": {}} | change
    with pytest.raises(error, match=message):
        plots.save(line, arguments.pop("folder"), arguments.pop("stem"), **arguments)
    assert not list(tmp_path.iterdir())


def test_same_picture_same_bytes_in_another_process(tmp_path):
    script = (
        "import sys; import matplotlib as mpl; before = dict(mpl.rcParams)\n"
        "from mwlib import plots\n"
        "assert dict(mpl.rcParams) == before, 'importing changed the settings'\n"
        "plots.save(plots.filters('db2')[0], sys.argv[1], 'fig', data={'a': [1]}, alt='Taps.', provenance={})"
    )
    subprocess.run([sys.executable, "-c", script, tmp_path / "other"], check=True)
    with mpl.rc_context({"font.size": 30, "axes.facecolor": "red"}):  # a reader's own settings must not leak in
        plots.save(plots.filters("db2")[0], tmp_path / "here", "fig", data={"a": [1]}, alt="Taps.", provenance={})
    first, second = ({p.name: p.read_bytes() for p in (tmp_path / folder).iterdir()} for folder in ("here", "other"))
    assert first == second


def test_the_layout_is_solved_once(tmp_path, monkeypatch):
    line, solved = plots.schedules({"cosine": SCHEDULE})[0], []
    solve = ConstrainedLayoutEngine.execute
    monkeypatch.setattr(ConstrainedLayoutEngine, "execute", lambda engine, fig: solved.append(solve(engine, fig)))
    monkeypatch.setattr("IPython.display.display", lambda *data, **extra: None)
    before = line.axes[0].get_position().bounds
    plots.show(line, "A line.")
    shown = line.axes[0].get_position().bounds
    plots.save(line, tmp_path, "fig", data={"a": [1]}, alt="A line.", provenance={})
    assert len(solved) == 1 and before != shown == line.axes[0].get_position().bounds


def test_show_displays_picture_and_words_and_lets_go(monkeypatch):
    shown = {}
    monkeypatch.setattr("IPython.display.display", lambda data, **extra: shown.update(extra, data=data))
    fig, _ = plt.subplots()
    assert plots.show(fig, "An empty pair of axes.") is None
    assert shown["metadata"] == {"image/png": {"alt": "An empty pair of axes."}} and shown["raw"]
    assert shown["data"]["text/plain"] == "An empty pair of axes." and shown["data"]["image/png"].startswith("iVBOR")
    assert not plt.get_fignums()
    with pytest.raises(ValueError, match="alternative text is empty"):
        plots.show(fig, "")


def test_use_style_changes_the_readers_own_plots():
    with mpl.rc_context():
        plots.use_style()
        assert all(mpl.rcParams[key] == value for key, value in plots.STYLE.items())
    assert mpl.rcParams["axes.spines.top"]


def test_three_significant_digits():
    values = [0.4, 0.0999999, 12.345, 1234.6, 0.99996, 0.0, -0.0123456, 1.2e-7, 3.5e9, np.nan, np.inf, -np.inf]
    texts = "0.400 0.100 12.3 1235 1.00 0 -0.0123 1.20e-07 3.50e+09 – ∞ −∞".split()
    assert [plots.significant(value) for value in values] == texts


def test_results_table_rounds_marks_and_lists():
    rows = [
        {"method": "ours | <b>", "ADE": (0.3761, 0.0042), "FDE": torch.tensor(0.4), "seeds": 3},
        {"method": "zero velocity", "ADE": 0.9, "FDE": np.float32(0.4), "data": "synthetic"},
        {"method": "none", "ADE": float("nan"), "FDE": None},
    ]
    table = plots.results_table(rows, ["method", "ADE", "FDE", "seeds"], better={"ADE": "lower", "FDE": "higher"})
    assert repr(table).splitlines() == [
        "| method        |                ADE |       FDE | seeds |",
        "| ------------- | -----------------: | --------: | ----: |",
        "| ours \\| <b>   | **0.376 ± 0.0042** | **0.400** |     3 |",
        "| zero velocity |              0.900 | **0.400** |     – |",
        "| none          |                  – |         – |     – |",
    ]
    html = table._repr_html_()
    assert html.count("<tr>") == 4 and html.count('<th scope="col"') == 4
    assert "ours | &lt;b&gt;" in html and "<strong>0.376 ± 0.0042</strong>" in html
    assert "data" in repr(plots.results_table(rows))


def test_any_skeleton_can_be_drawn():
    motion = np.random.default_rng(0).normal(size=(6, len(CMU), 3))
    fig, ax = plots.storyboard(motion, CMU, fps=FPS, frames=3)
    assert len(ax.collections) == 9
