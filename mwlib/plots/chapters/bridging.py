"""Pictures of in-betweening (chapter 11)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import fill

import numpy as np
import torch
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from mwlib.plots.look import CYCLE, DASHES, FAINT, INK, OBSERVED, PREDICTED, TRUTH, array, canvas, style

Array = np.ndarray | torch.Tensor


@style()
def bridged_coordinate(
    truth: Float[Array, " T"],
    baselines: Mapping[str, Float[Array, " T"]],
    samples: Float[Array, "S T"] | None = None,
    *,
    fps: float,
    keyframes: Sequence[int] = (0, -1),
    ylabel: str = "position (m)",
) -> tuple[Figure, Axes]:
    """One coordinate between keyframes: the truth, what fills it in without training, and samples that fan out.

    Args:
        truth: T values, keyframes among them.
        baselines: name -> T values, at most five.
        samples: S motions with the same keyframes.
        fps: frames per second; time 0 is the first frame.
        keyframes: numbers of the given frames; -1 is the last.
        ylabel: what, and its unit.

    Raises:
        ValueError: lengths differ, a keyframe is no frame, or there are more than five baselines.
    """
    truth, given = array(truth), _given(len(array(truth)), keyframes)
    if len(baselines) >= len(CYCLE):
        raise ValueError(f"{len(baselines)} baselines; expected at most {len(CYCLE) - 1}, told apart by colour and dashes")
    seconds = np.arange(len(truth)) / fps
    fig, axes = canvas(height=3.3)
    ax = axes[0, 0]
    if samples is not None:
        many = _as_long(array(samples), truth, "samples")
        alpha = max(0.25, 1.2 / np.sqrt(len(many)) if len(many) > 1 else 1.0)
        ax.plot(seconds, many.T, color=PREDICTED, linewidth=1.5, alpha=min(alpha, 0.7))
        ax.plot([], [], color=PREDICTED, label=f"{len(many)} samples")
    for (name, values), colour, dashes in zip(baselines.items(), CYCLE[1:], DASHES[1:], strict=False):
        ax.plot(seconds, _as_long(array(values), truth, name), color=colour, linestyle=dashes, label=name)
    ax.plot(seconds, truth, color=TRUTH, linewidth=2.4, label="truth")
    ax.plot(seconds[given], truth[given], "o", color=TRUTH, markersize=8, label="keyframe", clip_on=False, zorder=5)
    ax.set(xlabel="time (s)", ylabel=ylabel, xlim=(seconds[0], seconds[-1]))
    fig.legend(loc="outside upper left", ncols=3)
    return fig, ax


@style()
def seams(
    rows: Mapping[str, Float[Array, "*lead T C"]],
    *,
    fps: float,
    keyframes: Sequence[int] = (0, -1),
    unit: str = "m",
    log: bool = False,
) -> tuple[Figure, Axes]:
    """How far each motion goes from frame to frame, ‖x_t+1 - x_t‖: a motion that was pasted to its keyframes pops beside them.

    Large marks are the steps that touch a keyframe.

    Args:
        rows: name -> motions of T frames, keyframes among them; leading axes are averaged over. "truth" is black.
        fps: frames per second; a step stands in the middle of its two frames.
        keyframes: numbers of the given frames; -1 is the last.
        unit: of x.
        log: a logarithmic axis, for pops that dwarf the rest.

    Raises:
        ValueError: lengths differ, or a keyframe is no frame.
    """
    motions = {name: array(x) for name, x in rows.items()}
    frames = _one_length({name: x.shape[-2] for name, x in motions.items()})
    given = _given(frames, keyframes)
    touching = np.unique([step for k in given for step in (k - 1, k) if 0 <= step < frames - 1])
    seconds = (np.arange(frames - 1) + 0.5) / fps
    fig, axes = canvas(height=3.2)
    ax = axes[0, 0]
    for time in given / fps:
        ax.axvline(time, color=OBSERVED, linewidth=0.8, zorder=0)
    others = iter(zip(CYCLE, DASHES[1:], strict=False))
    for name, x in motions.items():
        steps = np.linalg.norm(np.diff(x, axis=-2), axis=-1).reshape(-1, frames - 1).mean(0)
        colour, dashes = (TRUTH, "-") if name == "truth" else next(others)
        ax.plot(seconds, steps, color=colour, linestyle=dashes, label=name)
        ax.plot(seconds[touching], steps[touching], "o", color=colour, markersize=6)
    ax.set(xlabel="time (s); vertical lines: keyframes", ylabel=f"step ({unit} per frame)", yscale="log" if log else "linear")
    ax.grid(axis="y")
    if not log:
        ax.set_ylim(bottom=0)
    fig.legend(loc="outside upper left", ncols=3)
    return fig, ax


@style()
def spectra(
    rows: Mapping[str, Float[Array, " F"]], *, fps: float, frames: int | None = None, unit: str = "m²"
) -> tuple[Figure, np.ndarray]:
    """Mean power at each frequency but 0, the mean; with a row called "truth", beneath it the ratio of the others to it.

    Args:
        rows: name -> power at the F frequencies of a real Fourier transform, 0 first.
        fps: frames per second.
        frames: of the motions that were transformed; None: 2(F - 1).
        unit: of the power.

    Raises:
        ValueError: the rows have different lengths, or these frames have other frequencies.
    """
    powers = {name: array(power) for name, power in rows.items()}
    count = _one_length({name: len(power) for name, power in powers.items()})
    frames = 2 * (count - 1) if frames is None else frames
    if frames // 2 + 1 != count:
        raise ValueError(f"{frames} frames have {frames // 2 + 1} frequencies; expected {count}, as the rows have")
    hertz = np.arange(1, count) * fps / frames
    panels = 2 if "truth" in powers and len(powers) > 1 else 1
    ratios = {"height_ratios": (3, 2)[:panels]}
    fig, axes = canvas(panels, 1, height=2.8 + 1.5 * (panels - 1), sharex=True, gridspec_kw=ratios)
    others = iter(zip(CYCLE * 2, (DASHES[1:] + DASHES[:1]) * 2, strict=True))
    for name, power in powers.items():
        colour, dashes = (TRUTH, "-") if name == "truth" else next(others)
        axes[0, 0].plot(hertz, power[1:], color=colour, linestyle=dashes, label=name)
        if panels == 2 and name != "truth":
            axes[1, 0].plot(hertz, power[1:] / powers["truth"][1:], color=colour, linestyle=dashes)
    axes[0, 0].set(yscale="log", ylabel=f"mean power ({unit})")
    if panels == 2:
        axes[1, 0].axhline(1.0, color=TRUTH, linewidth=1.5)
        axes[1, 0].set(yscale="log", ylabel="ratio to truth")
        _ratio_axis(axes[1, 0])
    for ax in axes[:, 0]:
        ax.grid(axis="y")
    axes[-1, 0].set(xlabel="frequency (Hz)", xlim=(0, hertz[-1]))
    fig.legend(loc="outside upper left", ncols=3)
    return fig, axes[:, 0]


@style()
def imposed_steps(
    x: Float[Array, "steps T"],
    levels: Sequence[float],
    *,
    keyframes: Sequence[int] = (0, -1),
    fps: float,
    ylabel: str = "position (m)",
) -> tuple[Figure, np.ndarray]:
    """One coordinate at a few steps of sampling, noise falling: keyframes are noised as much as what lies between (Fig. 4).

    Dots are the values that were imposed at this step, rings the clean keyframes.

    Args:
        x: the coordinate over time at each step shown; the last is the sample, its keyframes are the clean ones.
        levels: deviation of the noise in each, sqrt(1 - alpha_bar).
        keyframes: numbers of the given frames; -1 is the last.
        fps: frames per second.
        ylabel: what, and its unit.

    Raises:
        ValueError: as many levels as steps are expected, falling, and keyframes that are frames.
    """
    x = array(x)
    if len(levels) != len(x) or list(levels) != sorted(levels, reverse=True):
        raise ValueError(f"levels are {[*levels]}; expected {len(x)}, one for each step, falling")
    given, seconds = _given(x.shape[1], keyframes), np.arange(x.shape[1]) / fps
    columns = min(len(x), 3)
    rows = -(-len(x) // columns)
    fig, axes = canvas(rows, columns, height=0.8 + 1.75 * rows, sharex=True, sharey=True)
    for ax in axes.flat[len(x) :]:
        ax.set_visible(False)
    for number, (ax, values, level) in enumerate(zip(axes.flat, x, levels, strict=False)):
        ax.plot(seconds, values, color=PREDICTED, linewidth=1.5, label="between, from the network")
        ax.plot(seconds[given], values[given], "o", color=CYCLE[1], markersize=7, label="keyframe at this noise", clip_on=False)
        rings = {"color": INK, "markerfacecolor": "none", "markersize": 10, "linestyle": "none", "clip_on": False}
        ax.plot(seconds[given], x[-1, given], marker="o", label="clean keyframe", **rings)
        ax.set_title(f"noise {level:.2f}" if level else "clean")
        ax.tick_params(labelbottom=number + columns >= len(x))
        if number + columns >= len(x):
            ax.set_xlabel("time (s)")
    for ax in axes[:, 0]:
        ax.set_ylabel(ylabel)
    fig.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=3)
    return fig, axes


@style()
def training_view(
    x: Float[Array, " T"],
    y: Float[Array, " T"],
    noised: Mapping[str, tuple[Float[Array, " T"], Float[Array, " T"]]],
    *,
    fps: float,
    unit: str = "m",
) -> tuple[Figure, np.ndarray]:
    """What training sees of one coordinate of a whole clip (Fig. 3): time on the left, its cosines on the right.

    Args:
        x: the coordinate over T frames.
        y: its cosine coefficients, frequency 0 first; as many as were kept.
        noised: title -> (coefficients with noise, the same back in time), a row each.
        fps: frames per second.
        unit: of x.
    """
    x, y = array(x), array(y)
    fig, axes = canvas(1 + len(noised), 2, height=0.7 + 1.35 * (1 + len(noised)), sharex="col", sharey="col")
    seconds, hertz = np.arange(len(x)) / fps, np.arange(len(y)) * fps / (2 * len(x))
    rows = {"": (y, x), **{title: (array(a), array(b)) for title, (a, b) in noised.items()}}
    for number, ((left, right), (title, (coefficients, values))) in enumerate(zip(axes, rows.items(), strict=True)):
        if number:
            left.plot(seconds, x, color=OBSERVED, linewidth=1.5, linestyle=DASHES[2])
        left.plot(seconds, values, color=PREDICTED if number else TRUTH)
        right.axhline(0, color=FAINT, linewidth=2.0, zorder=0)
        right.vlines(hertz, 0, coefficients, color=CYCLE[1] if number else TRUTH, linewidth=1.5)
        left.set(title=f"{title}: back in time (iDCT)" if number else "the complete clip", ylabel=unit)
        right.set_title(f"{title}: coefficients" if number else "its cosine coefficients (DCT)")
    axes[-1, 0].set_xlabel("time (s); dotted: the clip" if noised else "time (s)")
    axes[-1, 1].set_xlabel("frequency (Hz)")
    return fig, axes


def _ratio_axis(ax: Axes) -> None:
    """Logarithmic, with plain numbers, and never so near to 1 that chance looks large."""
    low, high = ax.get_ylim()
    ax.set_ylim(min(low, 0.4), max(high, 2.5))
    ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < 50 * low else (1.0,)))
    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.yaxis.set_minor_formatter(NullFormatter())


def _given(frames: int, keyframes: Sequence[int]) -> np.ndarray:
    if not keyframes or not all(-frames <= k < frames for k in keyframes):
        raise ValueError(f"keyframes are {[*keyframes]}; expected one or more of {-frames} to {frames - 1}")
    return np.unique(np.array(keyframes) % frames)


def _as_long(values: np.ndarray, truth: np.ndarray, name: str) -> np.ndarray:
    if values.shape[-1] != len(truth):
        raise ValueError(f"{name}: {values.shape[-1]} frames; expected {len(truth)}, as the truth has")
    return values


def _one_length(lengths: Mapping[str, int]) -> int:
    if len(set(lengths.values())) != 1:
        raise ValueError(f"lengths of the rows are {dict(lengths)}; expected one and the same, of at least one row")
    return next(iter(lengths.values()))


COLUMNS = 3
MARK = {"marker": "o", "color": TRUTH, "linestyle": "none", "markersize": 5, "zorder": 5}
MEASURES = {
    "mean_error": "error of the mean",
    "mean_error_limit": "error of the mean",
    "seam": "seam ratio",
    "spread": "spread ratio",
}


@style()
def keyframe_samples(
    mean: Float[Array, " T"],
    deviation: Float[Array, " T"],
    panels: Mapping[str, Float[Array, "S T"]],
    *,
    keyframes: Sequence[int],
    ylabel: str = "coordinate",
    lines: int = 12,
) -> tuple[Figure, np.ndarray]:
    """One panel per scheme: its samples over the true law, mean in black and bands of one and two deviations in grey.

    Args:
        mean, deviation: of the true law between the keyframes.
        panels: name -> samples; the mean of all is dashed, the first `lines` are drawn thin.
        keyframes: frames that are given; the true law has deviation 0 there.
        ylabel: what the coordinate is.
        lines: how many of the samples to draw.
    """
    mean, deviation, at = array(mean), array(deviation), np.asarray(keyframes)
    frames, rows = np.arange(len(mean)), -(-len(panels) // COLUMNS)
    fig, axes = canvas(rows, min(COLUMNS, len(panels)), height=0.7 + 1.75 * rows, sharex=True, sharey=True)
    for ax in axes.ravel()[len(panels) :]:
        ax.set_axis_off()
    for ax, (name, samples) in zip(axes.ravel(), panels.items(), strict=False):
        samples = array(samples)
        for times, shade in ((2, FAINT), (1, "#cfd3d8")):
            label = f"true law, ± {times} deviation{'s' * (times > 1)}"
            ax.fill_between(frames, mean - times * deviation, mean + times * deviation, color=shade, linewidth=0, label=label)
        drawn = ax.plot(frames, samples[:lines].T, color=CYCLE[0], linewidth=0.8, alpha=0.55)
        drawn[0].set_label("samples")
        ax.plot(frames, mean, color=TRUTH, linewidth=1.6, label="true mean")
        ax.plot(frames, samples.mean(0), color=CYCLE[1], linestyle=(0, (4, 1.2)), linewidth=2, label="mean of samples")
        ax.plot(at, mean[at], label="keyframe", **MARK)
        ax.set_title(fill(name, 22))
        ax.set_xlim(frames[0] - 0.8, frames[-1] + 0.8)
    reach = 1.4 * float(np.max(np.abs(mean) + 2 * deviation))  # samples that diverge leave the picture
    axes[0, 0].set_ylim(-reach, reach)
    for ax in axes[:, 0]:
        ax.set_ylabel(ylabel)
    for column in axes.T:
        [ax for ax in column if ax.axison][-1].tick_params(labelbottom=True)
        [ax for ax in column if ax.axison][-1].set_xlabel("frame")
    fig.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=3)
    return fig, axes


@style()
def scheme_errors(
    rows: Sequence[Mapping[str, object]], measures: Sequence[str] = ("mean_error_limit", "seam", "spread")
) -> tuple[Figure, np.ndarray]:
    """One line per scheme and a panel per measure: a dot, and a bar from what the true law gives. Divergence is said in words.

    Args:
        rows: of `mwlib.inbetweening.gaussian.table`; the first is the true law's, and gives the upright lines.
        measures: keys of the rows.

    Raises:
        ValueError: there is no row after the first.
    """
    truth, *found = rows
    if not found:
        raise ValueError("one row; expected the true law's and those of schemes")
    height = np.arange(len(found))[::-1]
    fig, axes = canvas(1, len(measures), height=0.9 + 0.24 * len(found), width=7.2, sharey=True)
    for ax, measure in zip(axes[0], measures, strict=True):
        _dots(ax, height, [None if row["diverged"] else row[measure] for row in found], truth[measure])
        ax.set_title(MEASURES[measure])
        ax.tick_params(axis="y", length=0)
        ax.spines["left"].set_visible(False)
        ax.set_xlim(min(0, *ax.get_xlim()), None)
    axes[0, 0].set_yticks(height, [str(row["scheme"]) for row in found])
    axes[0, 0].set_ylim(-0.7, len(found) - 0.3)
    fig.supxlabel("upright line: the true law", fontsize=9, color=OBSERVED)
    return fig, axes[0]


def _dots(ax: Axes, height: np.ndarray, values: Sequence, truth) -> None:
    """Values as dots with a bar from the truth; None is a word."""
    ax.axvline(truth, color=TRUTH, linewidth=1.2, zorder=1)
    for y, value in zip(height, values, strict=True):
        ax.axhline(y, color=FAINT, linewidth=0.8, zorder=0)
        if value is None:
            ax.annotate("diverges", (truth, y), (6, 0), textcoords="offset points", va="center", color=CYCLE[5], fontsize=8)
            continue
        ax.plot([truth, value], [y, y], color=CYCLE[0], linewidth=3, alpha=0.3, solid_capstyle="butt")
        ax.plot(value, y, "o", color=CYCLE[0], markersize=5)
        away, side = ((-6, 0), "right") if value < truth else ((6, 0), "left")
        words = {"textcoords": "offset points", "va": "center", "ha": side, "color": INK, "fontsize": 8}
        ax.annotate(f"{value:.2f}", (value, y), away, **words)
    ax.margins(x=0.18)
