"""Pictures of noise and its removal (chapters 05 and 06)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.colors import PowerNorm
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator
from torch import Tensor

from mwlib.body.skeleton import Skeleton
from mwlib.diffusion.process import noised
from mwlib.diffusion.samplers import Step
from mwlib.plots.bodies import COLOURS, AnyMotion, camera, draw_bodies, poses, project, storyboard
from mwlib.plots.lines import draw, plain

from mwlib.plots.look import (  # isort: skip
    BAND_NAMES, CYCLE, FAINT, INK, LOOKS, TRUTH, WIDTH, Array, Curves, Matrix, Panel, Panels, Values, array, canvas, legend,
    panel, rule, signed, style, titled,
)  # fmt: skip
from mwlib.plots.loops import Loop, photographed
from mwlib.plots.tables import significant
from mwlib.transforms.linear import LinearTransform

Density = tuple[Values, Values]  # values, and the density at them
DENSITY = {"color": INK, "linestyle": (0, (3, 1))}


@style()
def histograms(samples: Curves, *, density: Density | None = None, xlabel: str = "") -> Panels:
    """Where many numbers lie, one panel per name on common axes, each scaled to area 1.

    Args:
        samples: name -> numbers.
        density: a curve (values, density) to compare with, drawn in every panel; it also sets the range, widened by half,
            and the height: a spike is cut off.
    """
    ends = _range(list(samples.values()), density)
    fig, axes = canvas(len(samples), 1, height=0.5 + 0.95 * len(samples), sharex=True, sharey=True)
    for number, (ax, values) in enumerate(titled(axes, samples)):
        _stairs(ax, array(values).ravel(), ends, CYCLE[number % len(CYCLE)])
        if density is not None:
            ax.plot(*map(array, density), **DENSITY)
        ax.set_yticks([])
    if density is not None:
        axes[0, 0].set_ylim(0, 1.4 * float(array(density[1]).max()))
    axes[-1, 0].set_xlabel(xlabel)
    return fig, axes[:, 0]


@style()
def sampling_paths(ts: Sequence[int], paths: Matrix, *, density: Density | None = None, ylabel: str = "y") -> Panels:
    """How the first 40 numbers travel from noise (left) to samples (right), and where all of them end.

    Args:
        ts: diffusion index of each row of `paths`; noise first, falling.
        paths: (steps, N), a column per sample; those that end above 0 are coloured otherwise, and dashed.
        density: (values, density) of the true distribution, drawn beside the end points.
        ylabel: what, and its unit.
    """
    paths, times = array(paths), np.asarray(ts)
    low, high = _range([paths[0], paths[-1]], density)
    fig, axes = canvas(1, 2, height=3.2, sharey=True, gridspec_kw={"width_ratios": (4, 1)})
    left, right = axes[0]
    for path in paths[:, :40].T:
        left.plot(times, path, alpha=0.5, linewidth=1.5, **LOOKS[int(path[-1] > 0)])
    left.set(xlim=(times[0], times[-1]), ylim=(low, high), xlabel="diffusion index t, falling", ylabel=ylabel)
    left.xaxis.set_major_locator(MaxNLocator(integer=True))
    rule(left, zorder=1)
    _stairs(right, paths[-1], (low, high), CYCLE[0], orientation="horizontal")
    if density is not None:
        values, height = map(array, density)
        right.plot(height, values, label="truth", **DENSITY)
        right.legend(loc="lower right")
    right.set(xticks=[], xlabel="where they end", facecolor="white")
    right.spines["left"].set_color(FAINT)
    return fig, axes[0]


@style()
def density_map(ts: Sequence[int], values: Values, density: Matrix, *, ylabel: str = "y") -> Panel:
    """The density of one number at every diffusion index, dark where it is high.

    Args:
        ts: diffusion index of each row of `density`; the first stands on the left.
        values: where the density is given, rising.
        density: (steps, V) its values, a row per index.
        ylabel: what, and its unit; the density has one over it.
    """
    times, heights = np.asarray(ts), array(values)
    fig, ax = panel(3.4)
    mesh = ax.pcolormesh(times, heights, array(density).T, cmap="Greys", norm=PowerNorm(0.5, vmin=0), shading="nearest")
    ax.set(xlim=(times[0], times[-1]), ylim=(heights[0], heights[-1]), xlabel="diffusion index t", ylabel=ylabel)
    fig.colorbar(mesh, label="density", ticks=[0, 0.1, 0.4, 1.0])
    return fig, ax


def particles(ts: Sequence[int], paths: Matrix, values: Values, density: Matrix, *, alt: str, xlabel: str = "y") -> Loop:
    """Points that a sampler moves, each in a lane of its own, below the density that they should have at that moment.

    Args:
        ts: diffusion index of each row of `paths` and `density`.
        paths: (steps, N), a column per point; coloured by which side of 0 it ends on.
        values, density: as for `density_map`.
        alt: one or two sentences that say what the picture shows to someone who cannot see it.
        xlabel: what moves, and its unit.

    Raises:
        ValueError: the alternative text is empty.
    """
    places, curve = array(paths), array(density)
    moment = partial(_moment, values=array(values), top=curve.max(), side=places[-1] > 0, xlabel=xlabel)
    return Loop(map(photographed, map(moment, ts, places, curve)), 90, alt)


@style()
def _moment(
    t: int, now: np.ndarray, curve: np.ndarray, *, values: np.ndarray, top: float, side: np.ndarray, xlabel: str
) -> Figure:
    """One picture: the density above zero, the points in their lanes below, marked by the side on which they end."""
    fig, ax = panel(2.6)
    fig.set_dpi(480 / WIDTH)  # 480 pixels wide
    ax.fill_between(values, curve, color=FAINT)
    ax.plot(values, curve, color=INK, linewidth=1.2)
    lanes = -top * (0.08 + np.arange(len(now)) / len(now))
    for which, marker, colour in ((~side, "o", CYCLE[0]), (side, "^", CYCLE[1])):
        ax.plot(now[which], lanes[which], marker, color=colour, markersize=4)
    ax.set(xlim=(values[0], values[-1]), ylim=(-1.12 * top, 1.05 * top), yticks=[], xlabel=xlabel, title=f"t = {int(t)}")
    ax.spines["left"].set_visible(False)
    return fig


@style()
def schedules(curves: Curves) -> Panels:
    """Noise schedules: the share of signal power that is left, and the signal-to-noise ratio, over the diffusion index.

    Args:
        curves: name -> alpha_bar (M,), as `schedule.alpha_bar` returns it.
    """
    fig, axes = canvas(1, 2, height=2.8)
    left, right = axes[0]
    draw(left, curves)
    draw(right, {name: _decibel(curve) for name, curve in curves.items()})
    left.set(title="signal power left, ᾱ", xlabel="diffusion index t", ylim=(0, 1.02))
    left.legend()
    rule(right)
    right.set(title="signal to noise, ᾱ / (1 − ᾱ)", xlabel="diffusion index t", ylabel="dB", ylim=(None, 45))
    return fig, axes[0]


@style()
def band_snr(deviations: Mapping[str, float], alpha_bar: Values) -> Panel:
    """How far parts of a movement stand above the noise at every diffusion index; below 0 dB the noise is the stronger.

    Args:
        deviations: part, e.g. a sub-band -> standard deviation of its coefficients, in units of the noise (metres for raw ones).
        alpha_bar: (M,) schedule.
    """
    ratios, marks = {}, {}
    for band, deviation in deviations.items():
        ratio, label = _decibel(alpha_bar) + 20 * np.log10(deviation), f"{band}: σ = {significant(deviation)}"
        if len(drowned := np.flatnonzero(ratio < 0)):
            label += f", lost at t = {drowned[0]}"
            marks[label] = drowned[0]
        ratios[label] = ratio
    fig, ax = panel(3.4)
    rule(ax)
    draw(ax, ratios, marks=marks)
    ax.set(xlabel="diffusion index t", ylabel="signal to noise (dB)", ylim=(-80, 50))
    legend(ax, 2)
    return fig, ax


@style()
def noising(
    tf: LinearTransform,
    x: Float[Tensor, "T C"],
    alpha_bar: Float[Tensor, " M"],
    ts: Sequence[int],
    skeleton: Skeleton,
    *,
    generator: torch.Generator,
    channel: int = 0,
) -> Panels:
    """One motion under growing noise: the coefficients y_t, one coordinate of the motion it stands for, and its last pose.

    Args:
        tf: wavelet transform with the four sub-bands of level 1.
        x: clean motion, metres; drawn in black.
        alpha_bar: schedule.
        ts: diffusion indices, one column each; the same noise is drawn at all of them.
        generator: of the noise.
        channel: which coordinate to show.
    """
    clean = tf(x)
    eps = torch.randn(clean.shape, generator=generator, dtype=clean.dtype)
    fig, axes = canvas(3, len(ts), height=5.4, gridspec_kw={"height_ratios": (1.2, 0.8, 1.3)}, sharey="row")
    for (top, middle, bottom), t in zip(axes.T, ts, strict=True):
        y = noised(clean, eps, alpha_bar[t])
        signed(top, array(y), 2)
        top.set_title(f"t = {t}")
        motion = tf.inverse(y)
        middle.plot(array(motion[:, channel]), color=CYCLE[0], linewidth=1.5, label="noised curve")
        middle.plot(array(x[:, channel]), color=TRUTH, linestyle=(0, (3, 1)), linewidth=1.5, label="clean curve")
        middle.set_xlabel("frame")
        _pose(bottom, motion[-1], x[-1], skeleton)
    edges = np.cumsum([0, *(band.shape[-1] for band in tf.split(clean).values())]) - 0.5
    for top in axes[0]:
        top.set(xticks=(edges[:-1] + edges[1:]) / 2, xticklabels=list(BAND_NAMES))
        top.tick_params(axis="x", length=0)
        for edge in edges[1:-1]:
            top.axvline(edge, color=INK, linewidth=0.8)
    axes[0, 0].set_ylabel("row k (time)")
    axes[1, 0].set_ylabel(f"{skeleton.joints[1 + channel // 3].replace('_', ' ')}, {'xyz'[channel % 3]} (m)")
    axes[2, 0].set_ylabel(f"pose, frame {len(x) - 1}")
    axes[1, 0].plot([], [], color=TRUTH, alpha=0.35, label="clean pose")
    axes[1, 0].plot([], [], color=COLOURS["predicted"][2], linestyle=(0, (2.2, 0.9)), label="right limbs")
    legend(axes[1, 0], 4)
    return fig, axes


@style()
def ddim_path(
    steps: Iterable[Step],
    inverse: Callable[[Tensor], AnyMotion],
    skeleton: Skeleton,
    *,
    fps: float,
    history: int = 0,
    truth: AnyMotion | None = None,
    count: int = 4,
    frames: int | Sequence[int] = 6,
) -> Panel:
    """How a sample comes to be: the clean estimate at a few denoising steps, one row each, the last one at the bottom.

    Args:
        steps: what `sampling.ddim` yields for a single motion's coefficients (rows, columns).
        inverse: coefficients -> motion (T, C), e.g. the transform's inverse.
        truth: drawn in the first row.
        count: how many of the steps to show, evenly spread, first and last included.
        fps, history, frames: as in `storyboard`.
    """
    steps = list(steps)
    chosen = np.unique(np.linspace(0, len(steps) - 1, count).round().astype(int))
    rows = {f"t = {steps[i].t}": inverse(steps[i].y0_hat) for i in chosen}
    clean = [*rows.values()][-1] if truth is None else truth
    rows = rows if truth is None else {"truth": truth} | rows
    azimuth = camera(poses(clean, skeleton)[0], skeleton)
    return storyboard(rows, skeleton, fps=fps, history=history, frames=frames, azimuth=azimuth)


@style()
def loss_curves(curves: Mapping[str, Array | Sequence]) -> Panel:
    """Losses over the training steps, on a logarithmic axis.

    Args:
        curves: name -> (n,) one value per step from step 1, drawn faintly with its running mean over n/50 steps on top; or
            (n, 2) pairs of step and value, drawn with dots.
    """
    fig, ax = panel(3.0)
    for (name, curve), look in zip(curves.items(), LOOKS, strict=False):
        curve = array(curve)
        if curve.ndim == 2:
            ax.plot(*curve.T, marker="o", label=name, **look)
            continue
        span = max(len(curve) // 50, 1)
        if span > 1:
            ax.plot(np.arange(len(curve)) + 1, curve, color=look["color"], alpha=0.25, linewidth=0.8)
        mean = np.convolve(curve, np.full(span, 1 / span), "valid")
        ax.plot(1 + span // 2 + np.arange(len(mean)), mean, label=name, **look)
    ax.set(xlabel="training step", ylabel="loss", yscale="log")
    ax.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    plain(ax.yaxis)
    ax.legend()
    return fig, ax


def _range(samples: Sequence[Array], density: Density | None) -> tuple[float, float]:
    """What holds nearly all numbers: of the density, widened by half, or of the samples."""
    if density is not None:
        share, (low, high) = 0.25, np.quantile(array(density[0]), [0.0, 1.0])
    else:
        share, (low, high) = 0.05, np.quantile(np.concatenate([array(values).ravel() for values in samples]), [0.001, 0.999])
    spare = share * (high - low)
    return float(low - spare), float(high + spare)


def _stairs(ax: Axes, values: np.ndarray, ends: tuple[float, float], colour: str, **look: Any) -> None:
    """A histogram of area 1 over all values; those beyond the ends are not drawn."""
    edges = np.linspace(*ends, 81)
    heights = np.histogram(values, edges)[0] / (len(values) * np.diff(edges))
    ax.stairs(heights, edges, fill=True, color=colour, alpha=0.75, **look)


def _decibel(alpha_bar: Values) -> np.ndarray:
    alpha_bar = array(alpha_bar)
    return 10 * np.log10(alpha_bar / (1 - alpha_bar))


def _pose(ax: Axes, noisy: Tensor, clean: Tensor, skeleton: Skeleton) -> None:
    """The noisy pose over the clean one; the view stays on the clean one."""
    reference = poses(clean, skeleton)
    view = camera(reference, skeleton)
    flat = project(reference, view)
    middle, reach = (flat.max(0) + flat.min(0)) / 2, 0.75 * np.ptp(flat, axis=0).max()
    draw_bodies(ax, project(poses(noisy, skeleton), view)[None], skeleton, "predicted", width=1.5)
    draw_bodies(ax, flat[None], skeleton, "truth", alpha=0.35, width=1.5)
    ax.set(xlim=middle[0] + reach * np.array([-0.7, 0.7]), ylim=middle[1] + reach * np.array([-1, 1]), xticks=[], yticks=[])
    ax.set_aspect("equal")
    ax.spines[:].set_visible(False)
