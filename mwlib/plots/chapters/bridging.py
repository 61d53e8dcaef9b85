"""Pictures of in-betweening (chapter 11)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import fill

import numpy as np
from jaxtyping import Float
from matplotlib.ticker import LogLocator

from mwlib.plots.lines import draw, plain

from mwlib.plots.look import (  # isort: skip
    AFTER_TRUTH, CYCLE, DASHES, FAINT, INK, LOOKS, OBSERVED, PREDICTED, TRUTH, Array, Curves, Look, Matrix, Panel, Panels, Values,
    array, canvas, legend, outer, panel, style, tiled, titled,
)  # fmt: skip

ENDS = [0, -1]  # where the keyframes are
MARK = {"marker": "o", "color": TRUTH, "linestyle": "none", "zorder": 5}


@style()
def bridged_coordinate(
    truth: Values,
    baselines: Curves,
    samples: Float[Array, "S T"],
    *,
    fps: float,
    ylabel: str = "position (m)",
) -> Panel:
    """One coordinate between two keyframes, its ends: the truth, what fills it in without training, and samples that fan out.

    Args:
        truth: T values, keyframes among them.
        baselines: name -> T values, at most five.
        samples: S motions with the same keyframes.
        fps: frames per second; time 0 is the first frame.
        ylabel: what, and its unit.

    Raises:
        ValueError: lengths differ, or there are more than five baselines.
    """
    truth = array(truth)
    for name, values in {**baselines, "samples": samples}.items():
        if (frames := array(values).shape[-1]) != len(truth):
            raise ValueError(f"{name}: {frames} frames; expected {len(truth)}, as the truth has")
    seconds = np.arange(len(truth)) / fps
    fig, ax = panel(3.3)
    alpha = np.clip(1.2 / np.sqrt(len(samples)), 0.25, 0.7)
    ax.plot(seconds, array(samples).T, color=PREDICTED, linewidth=1.5, alpha=alpha)
    ax.plot([], [], color=PREDICTED, label=f"{len(samples)} samples")
    draw(ax, baselines, seconds, looks=LOOKS[1:], what="baselines")
    ax.plot(seconds, truth, color=TRUTH, linewidth=2.4, label="truth")
    ax.plot(seconds[ENDS], truth[ENDS], markersize=8, label="keyframe", clip_on=False, **MARK)
    ax.set(xlabel="time (s)", ylabel=ylabel, xlim=(seconds[0], seconds[-1]))
    legend(ax)
    return fig, ax


@style()
def spectra(rows: Curves, *, fps: float, frames: int) -> Panels:
    """Mean power at each frequency but 0, the mean; beneath it the ratio to that of the truth.

    Args:
        rows: name -> power in m² at the F frequencies of a real Fourier transform, 0 first; one is called "truth".
        fps: frames per second.
        frames: of the motions that were transformed.

    Raises:
        ValueError: the rows have different lengths, or these frames have other frequencies.
    """
    lengths, count = {name: len(power) for name, power in rows.items()}, frames // 2 + 1
    if {*lengths.values()} != {count}:
        raise ValueError(f"{frames} frames have {count} frequencies; expected as many in each of at least one row, not {lengths}")
    powers = {name: array(power)[1:] for name, power in rows.items()}
    hertz = np.arange(1, count) * fps / frames
    fig, axes = canvas(2, 1, height=4.3, sharex=True, gridspec_kw={"height_ratios": (3, 2)})
    top, bottom = axes[:, 0]
    draw(top, powers, hertz, looks=_looks(rows))
    top.set_ylabel("mean power (m²)")
    truth = powers.pop("truth")
    draw(bottom, {name: power / truth for name, power in powers.items()}, hertz, looks=_looks(powers), label=None)
    bottom.axhline(1.0, color=TRUTH, linewidth=1.5)
    bottom.set(xlabel="frequency (Hz)", ylabel="ratio to truth", xlim=(0, hertz[-1]))
    for ax in axes[:, 0]:
        ax.set_yscale("log")
        ax.grid(axis="y")
    low, high = bottom.get_ylim()
    bottom.set_ylim(min(low, 0.4), max(high, 2.5))  # never so near to 1 that chance looks large
    bottom.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < 50 * low else (1.0,)))
    plain(bottom.yaxis)
    legend(top)
    return fig, axes[:, 0]


@style()
def imposed_steps(x: Matrix, levels: Sequence[float], *, fps: float, ylabel: str = "position (m)") -> Panels:
    """One coordinate at a few steps of sampling, noise falling: keyframes are noised as much as what lies between (Fig. 4).

    The keyframes are the first and the last frame; dots are their values that were imposed at this step, rings the clean ones.

    Args:
        x: (steps, T) the coordinate over time at each step shown; the last is the sample, its keyframes are the clean ones.
        levels: deviation of the noise in each, sqrt(1 - alpha_bar).
        fps: frames per second.
        ylabel: what, and its unit.

    Raises:
        ValueError: as many levels as steps are expected, falling.
    """
    x = array(x)
    if len(levels) != len(x) or list(levels) != sorted(levels, reverse=True):
        raise ValueError(f"levels are {[*levels]}; expected {len(x)}, one for each step, falling")
    seconds = np.arange(x.shape[1]) / fps
    fig, axes = tiled(len(x), frame=0.8, each=1.75)
    rings = {"color": INK, "markerfacecolor": "none", "markersize": 10, "clip_on": False}
    for ax, values, level in zip(axes.flat, x, levels, strict=False):
        ax.plot(seconds, values, color=PREDICTED, linewidth=1.5, label="between")
        ax.plot(seconds[ENDS], values[ENDS], "o", color=CYCLE[1], markersize=7, label="keyframe at this noise", clip_on=False)
        ax.plot(seconds[ENDS], x[-1, ENDS], "o", label="clean keyframe", **rings)
        ax.set_title(f"noise {level:.2f}" if level else "clean")
    outer(axes, "time (s)", ylabel)
    legend(axes[0, 0])
    return fig, axes


@style()
def training_view(x: Values, y: Values, noised: Mapping[str, tuple[Values, Values]], *, fps: float, unit: str = "m") -> Panels:
    """What training sees of one coordinate of a whole clip (Fig. 3): time on the left, its cosines on the right.

    Args:
        x: the coordinate over T frames.
        y: its cosine coefficients, frequency 0 first; as many as were kept.
        noised: title -> (coefficients with noise, the same back in time), a row each.
        fps: frames per second.
        unit: of x.
    """
    x = array(x)
    fig, axes = canvas(1 + len(noised), 2, height=0.7 + 1.35 * (1 + len(noised)), sharex="col", sharey="col")
    seconds, hertz = np.arange(len(x)) / fps, np.arange(len(y)) * fps / (2 * len(x))
    for number, ((left, right), (title, pair)) in enumerate(zip(axes, {"": (y, x), **noised}.items(), strict=True)):
        coefficients, values = map(array, pair)
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


@style()
def keyframe_samples(
    mean: Values, deviation: Values, panels: Mapping[str, Float[Array, "S T"]], *, keyframes: Sequence[int]
) -> Panels:
    """One panel per scheme: its samples over the true law, mean in black and bands of one and two deviations in grey.

    Args:
        mean, deviation: of the true law between the keyframes.
        panels: name -> samples; the mean of all is dashed, the first twelve are drawn thin.
        keyframes: frames that are given; the true law has deviation 0 there.
    """
    mean, deviation, at = array(mean), array(deviation), np.asarray(keyframes)
    frames = np.arange(len(mean))
    fig, axes = tiled(len(panels), frame=0.7, each=1.75)
    for ax, samples in titled(axes, {fill(name, 22): array(samples) for name, samples in panels.items()}):
        for times, shade in ((2, FAINT), (1, "#cfd3d8")):
            label = f"true law, ± {times} deviation{'s' * (times > 1)}"
            ax.fill_between(frames, mean - times * deviation, mean + times * deviation, color=shade, linewidth=0, label=label)
        first, *_ = ax.plot(frames, samples[:12].T, color=CYCLE[0], linewidth=0.8, alpha=0.55)
        first.set_label("samples")
        ax.plot(frames, mean, color=TRUTH, linewidth=1.6, label="true mean")
        ax.plot(frames, samples.mean(0), color=CYCLE[1], linestyle=(0, (4, 1.2)), linewidth=2, label="mean of samples")
        ax.plot(at, mean[at], label="keyframe", **MARK)
        ax.set_xlim(-0.8, len(mean) - 0.2)
    reach = 1.7 * float(np.max(np.abs(mean) + 2 * deviation))  # samples that diverge leave the picture
    axes[0, 0].set_ylim(-reach, reach)
    outer(axes, "frame", "coordinate")
    legend(axes[0, 0])
    return fig, axes


def _looks(rows: Mapping[str, object]) -> list[Look]:
    """Colours and dashes for rows; the truth is black and solid, and takes those of nobody."""
    others = iter(AFTER_TRUTH * 2)
    return [{"color": TRUTH} if name == "truth" else next(others) for name in rows]
