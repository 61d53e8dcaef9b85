"""Pictures of noise and its removal (chapters 05 and 06)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np
import torch
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.colors import PowerNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter
from torch import Tensor

from mwlib.body.skeleton import Skeleton
from mwlib.diffusion.process import noised
from mwlib.diffusion.samplers import Step
from mwlib.plots.bodies import COLOURS, THREE_QUARTER, AnyMotion, Array, draw_bodies, facing, poses, project, storyboard
from mwlib.plots.coefficients import DIVERGING
from mwlib.plots.look import BAND_NAMES, CYCLE, DASHES, FAINT, INK, OBSERVED, TRUTH, WIDTH, array, canvas, style
from mwlib.plots.loops import Loop
from mwlib.plots.tables import significant
from mwlib.transforms.linear import LinearTransform


@style()
def schedules(curves: Mapping[str, Float[Array, " M"]]) -> tuple[Figure, np.ndarray]:
    """Noise schedules: the share of signal power that is left, and the signal-to-noise ratio, over the diffusion index.

    Args:
        curves: name -> alpha_bar (M,), as `schedule.alpha_bar` returns it.
    """
    fig, axes = canvas(1, 2, height=2.8)
    for (name, curve), colour, dashes in zip(curves.items(), CYCLE, DASHES, strict=False):
        curve = array(curve)
        axes[0, 0].plot(curve, color=colour, linestyle=dashes, label=name)
        axes[0, 1].plot(_decibel(curve), color=colour, linestyle=dashes)
    axes[0, 0].set(title="signal power left, ᾱ", xlabel="diffusion index t", ylim=(0, 1.02))
    axes[0, 0].legend()
    axes[0, 1].axhline(0, color=OBSERVED, linewidth=0.8)
    axes[0, 1].set(title="signal to noise, ᾱ / (1 − ᾱ)", xlabel="diffusion index t", ylabel="dB", ylim=(None, 45))
    return fig, axes[0]


@style()
def band_snr(deviations: Mapping[str, float], alpha_bar: Float[Array, " M"]) -> tuple[Figure, Axes]:
    """How far each sub-band stands above the noise at every diffusion index; below 0 dB the noise is the stronger.

    Args:
        deviations: band -> standard deviation of its coefficients, in units of the noise (metres for raw coefficients).
        alpha_bar: (M,) schedule.
    """
    curve = array(alpha_bar)
    fig, axes = canvas(height=3.2)
    ax = axes[0, 0]
    ax.axhline(0, color=OBSERVED, linewidth=0.8)
    for (band, deviation), colour, dashes in zip(deviations.items(), CYCLE, DASHES, strict=False):
        ratio = _decibel(curve) + 20 * np.log10(deviation)
        label = f"{band}: σ = {significant(deviation)}"
        if (ratio < 0).any():
            drowned = int(np.argmax(ratio < 0))
            ax.plot(drowned, ratio[drowned], "o", color=colour)
            label += f", under the noise from t = {drowned}"
        ax.plot(ratio, color=colour, linestyle=dashes, label=label)
    ax.set(xlabel="diffusion index t", ylabel="signal to noise (dB)", ylim=(-80, 50))
    ax.legend(loc="upper right")
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
    frame: int = -1,
) -> tuple[Figure, np.ndarray]:
    """One motion under growing noise: the coefficients y_t, one coordinate of the motion it stands for, and one pose.

    Args:
        tf: wavelet transform with the four sub-bands of level 1.
        x: clean motion, metres; drawn in black.
        alpha_bar: schedule.
        ts: diffusion indices, one column each; the same noise is drawn at all of them.
        generator: of the noise.
        channel, frame: which coordinate and which pose to show.
    """
    clean = tf(x)
    eps = torch.randn(clean.shape, generator=generator, dtype=clean.dtype)
    noisy = [noised(clean, eps, alpha_bar[t]) for t in ts]
    fig, axes = canvas(3, len(ts), height=5.4, gridspec_kw={"height_ratios": (1.2, 0.8, 1.3)}, sharey="row")
    for column, t, y in zip(axes.T, ts, noisy, strict=True):
        column[0].imshow(array(y).T, cmap=DIVERGING, vmin=-2, vmax=2, aspect="auto")
        column[0].set(title=f"t = {t}", xlabel="row k")
        motion = tf.inverse(y)
        column[1].plot(array(motion[:, channel]), color=CYCLE[0], linewidth=1.5, label="noised curve")
        column[1].plot(array(x[:, channel]), color=TRUTH, linestyle=(0, (3, 1)), linewidth=1.5, label="clean curve")
        column[1].set(xlabel="frame")
        _pose(column[2], motion[frame], x[frame], skeleton)
    _name_bands(axes[0], tf, clean)
    axes[1, 0].set_ylabel(f"{skeleton.joints[1 + channel // 3].replace('_', ' ')}, {'xyz'[channel % 3]} (m)")
    axes[2, 0].set_ylabel(f"pose, frame {frame % len(x)}")
    pose = [Line2D([], [], color=TRUTH, alpha=0.35, label="clean pose")]
    pose += [Line2D([], [], color=COLOURS["predicted"][2], linestyle=(0, (2.2, 0.9)), label="right limbs")]
    fig.legend(handles=[*axes[1, 0].lines, *pose], loc="outside upper left", ncols=4)
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
) -> tuple[Figure, Axes]:
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
    rows = {} if truth is None else {"truth": truth}
    rows |= {f"t = {steps[i].t}": inverse(steps[i].y0_hat) for i in chosen}
    azimuth = facing(poses(list(rows.values())[0 if truth is not None else -1], skeleton)[0], skeleton) + THREE_QUARTER
    return storyboard(rows, skeleton, fps=fps, history=history, frames=frames, azimuth=azimuth)


@style()
def loss_curves(curves: Mapping[str, Array | Sequence], *, ylabel: str = "loss") -> tuple[Figure, Axes]:
    """Losses over the training steps, on a logarithmic axis.

    Args:
        curves: name -> (n,) one value per step from step 1, drawn faintly with its running mean over n/50 steps on top; or
            (n, 2) pairs of step and value, drawn with dots.
    """
    fig, axes = canvas(height=3.0)
    ax = axes[0, 0]
    for (name, curve), colour, dashes in zip(curves.items(), CYCLE, DASHES, strict=False):
        curve = np.asarray(array(curve), dtype=float)
        if curve.ndim == 2:
            ax.plot(*curve.T, color=colour, linestyle=dashes, marker="o", label=name)
            continue
        span = max(len(curve) // 50, 1)
        mean = np.convolve(curve, np.full(span, 1 / span), "valid")
        if span > 1:
            ax.plot(np.arange(len(curve)) + 1, curve, color=colour, alpha=0.25, linewidth=0.8)
        ax.plot(np.arange(len(mean)) + 1 + span // 2, mean, color=colour, linestyle=dashes, label=name)
    ax.set(xlabel="training step", ylabel=ylabel, yscale="log")
    ax.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    ax.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    ax.yaxis.set_minor_formatter(NullFormatter())
    ax.legend()
    return fig, ax


def _decibel(alpha_bar: np.ndarray) -> np.ndarray:
    return 10 * np.log10(alpha_bar / (1 - alpha_bar))


def _pose(ax: Axes, noisy: Tensor, clean: Tensor, skeleton: Skeleton) -> None:
    """The noisy pose over the clean one; the view stays on the clean one."""
    reference = poses(clean, skeleton)
    view = facing(reference, skeleton) + THREE_QUARTER
    flat = project(reference, view)
    middle, reach = (flat.max(0) + flat.min(0)) / 2, 0.75 * np.ptp(flat, axis=0).max()
    draw_bodies(ax, project(poses(noisy, skeleton), view)[None], skeleton, "predicted", width=1.5)
    draw_bodies(ax, flat[None], skeleton, "truth", alpha=0.35, width=1.5)
    ax.set(xlim=middle[0] + reach * np.array([-0.7, 0.7]), ylim=middle[1] + reach * np.array([-1, 1]), xticks=[], yticks=[])
    ax.set_aspect("equal")
    ax.spines[:].set_visible(False)


def _name_bands(axes: np.ndarray, tf: LinearTransform, y: Tensor) -> None:
    """Mark the sub-bands in pictures of coefficients, and name them in the first."""
    edges = np.cumsum([0, *(band.shape[-1] for band in tf.split(y).values())]) - 0.5
    axes[0].set(yticks=(edges[:-1] + edges[1:]) / 2, yticklabels=list(BAND_NAMES))
    for ax in axes:
        ax.tick_params(axis="y", length=0)
        for edge in edges[1:-1]:
            ax.axhline(edge, color=INK, linewidth=0.8)


@style()
def density_map(
    ts: Sequence[int],
    values: Float[Array, " V"],
    density: Float[Array, "steps V"],
    *,
    paths: Float[Array, "steps N"] | None = None,
    parting: float = 0.0,
    ylabel: str = "y",
) -> tuple[Figure, Axes]:
    """The density of one number at every diffusion index, dark where it is high, and paths that run through it.

    Args:
        ts: diffusion index of each row of `density` and `paths`; the first stands on the left.
        values: where the density is given, rising.
        density: its values, a row per index.
        paths: a column per particle; coloured and dashed by which side of `parting` they end on.
        ylabel: what, and its unit; the density has one over it.
    """
    times, heights = np.asarray(ts), array(values)
    fig, axes = canvas(height=3.4)
    ax = axes[0, 0]
    mesh = ax.pcolormesh(times, heights, array(density).T, cmap="Greys", norm=PowerNorm(0.5, vmin=0), shading="nearest")
    for path in () if paths is None else array(paths).T:
        side = int(path[-1] > parting)
        ax.plot(times, path, color=CYCLE[side], linestyle=DASHES[side], linewidth=1.5)
    ax.set(xlim=(times[0], times[-1]), ylim=(heights[0], heights[-1]), xlabel="diffusion index t", ylabel=ylabel)
    fig.colorbar(mesh, label="density", ticks=[0, 0.1, 0.4, 1.0])
    return fig, ax


def particles(
    ts: Sequence[int],
    paths: Float[Array, "steps N"],
    values: Float[Array, " V"],
    density: Float[Array, "steps V"],
    *,
    alt: str,
    parting: float = 0.0,
    xlabel: str = "y",
    milliseconds: int = 90,
    width: int = 480,
) -> Loop:
    """Points that a sampler moves, each in a lane of its own, below the density that they should have at that moment.

    Args:
        ts: diffusion index of each row of `paths` and `density`.
        paths: a column per point; coloured by which side of `parting` it ends on.
        values, density: as for `density_map`.
        alt: one or two sentences that say what the picture shows to someone who cannot see it.
        xlabel: what moves, and its unit.
        milliseconds: how long each picture stays; the last one stays a second.
        width: pixels.

    Raises:
        ValueError: the alternative text is empty.
    """
    places, curve = array(paths), array(density)
    figures = (_moment(int(t), places, places[i], array(values), curve[i], curve.max(), parting, xlabel, width)
               for i, t in enumerate(ts))  # fmt: skip
    return Loop.of_figures(figures, milliseconds, alt)


@style()
def _moment(
    t: int,
    paths: np.ndarray,
    now: np.ndarray,
    values: np.ndarray,
    curve: np.ndarray,
    top: float,
    parting: float,
    xlabel: str,
    width: int,
) -> Figure:
    """One picture: the density above zero, the points in their lanes below."""
    fig, axes = canvas(height=2.6)
    fig.set_dpi(width / WIDTH)
    ax = axes[0, 0]
    ax.fill_between(values, curve, color=FAINT)
    ax.plot(values, curve, color=INK, linewidth=1.2)
    lanes, side = -top * (0.08 + np.arange(len(now)) / len(now)), paths[-1] > parting
    for which, marker in ((False, "o"), (True, "^")):
        ax.plot(now[side == which], lanes[side == which], marker, color=CYCLE[int(which)], markersize=4)
    ax.set(xlim=(values[0], values[-1]), ylim=(-1.12 * top, 1.05 * top), yticks=[], xlabel=xlabel)
    ax.set_title(f"t = {t}")
    ax.spines["left"].set_visible(False)
    return fig
