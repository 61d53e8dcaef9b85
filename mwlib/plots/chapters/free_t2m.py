"""Pictures of Free-T2M: motions by frequency under noise (chapter 12), and motions made from sentences (chapter 13)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import fill

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap

from mwlib.body.motion import Motion
from mwlib.plots.chapters.diagrams import FOUR_LINES
from mwlib.plots.lines import bars, draw, plain

from mwlib.plots.look import (  # isort: skip
    CYCLE, FAINT, INK, LOOKS, OBSERVED, Array, Curves, Panel, Panels, Values, array, canvas, legend, outer, panel, rule, style,
    tiled, titled,
)  # fmt: skip


@style()
def energy_by_coefficient(rows: Curves, *, few: int = 10) -> Panels:
    """Where the energy of motions lies (Fig. 4): mean power of each cosine coefficient, and the share of the first ones.

    The share of the first `few` stands in the legend. k = 0, the mean over time, is drawn at the left of a broken axis, as the
    axis of k is logarithmic.

    Args:
        rows: name -> mean power of coefficients 0, 1, ..., in comparable units; at most six, lengths may differ.
        few: K, how many coefficients are called low.

    Raises:
        ValueError: there are more than six rows, or one has no more than `few` coefficients.
    """
    powers, shares = {name: array(power) for name, power in rows.items()}, {}
    for name, power in powers.items():
        if len(power) <= few:
            raise ValueError(f"{name}: {len(power)} coefficients; expected more than few, {few}")
        share = 100 * np.cumsum(power) / power.sum()
        shares[f"{name}: {share[few - 1]:.0f} %"] = share
    fig, axes = canvas(1, 2, height=3.5)
    left, right = axes[0]
    _by_coefficient(left, powers, label=None)
    for power, look in zip(powers.values(), LOOKS, strict=False):
        left.plot(0.6, power[0], "o", color=look["color"], clip_on=False)
    draw(right, shares, start=1)
    left.set(title="mean power", xlabel="coefficient k", xscale="log", yscale="log", xlim=(0.5, None))
    left.axvline(0.77, color=OBSERVED, linewidth=0.8, linestyle=(0, (2, 2)))
    right.set(title="energy in the first K", xlabel="K, number of coefficients", ylabel="%", xscale="log", ylim=(0, 103))
    right.axvline(few, color=OBSERVED, linewidth=0.8)
    _finish(left, (0.6, "0"))
    _finish(right)
    fig.legend(loc="outside upper left", ncols=2, title=f"share of the first {few}", alignment="left")
    return fig, axes[0]


@style()
def parallel_snr(power: Values, alpha_bar: Values, ks: Sequence[int]) -> Panel:
    """Signal-to-noise ratio of a few coefficients over the diffusion index, in decibel: one curve, at several heights.

    A dot marks where a coefficient goes under the threshold, a ratio of 1.

    Args:
        power: P_k, (K,).
        alpha_bar: (M,) schedule.
        ks: which coefficients; at most six.

    Raises:
        ValueError: more than six coefficients.
    """
    curve, ratios, marks = array(alpha_bar), {}, {}
    for k in ks:
        ratio, label = 10 * np.log10(curve * array(power)[k] / (1 - curve)), f"k = {k}"
        if len(above := np.flatnonzero(ratio >= 0)):
            label += f", until t = {above[-1]}"
            marks[label] = above[-1]
        ratios[label] = ratio
    fig, ax = panel(3.3)
    ax.axhline(0, color=INK, linewidth=1.0, label="SNR = 1")
    draw(ax, ratios, marks=marks, what="coefficients")
    ax.set(xlabel="diffusion index t", ylabel="signal to noise (dB)", xlim=(0, len(curve) - 1), ylim=(-60, 60))
    ax.grid(axis="y")
    legend(ax)
    return fig, ax


@style()
def recovery_by_coefficient(rows: Curves, *, steps: int) -> Panel:
    """When each coefficient comes back as t falls: sampling runs from the top of the picture to its bottom.

    A dot marks each that comes back before a lower one, by more than a fiftieth of the way.

    Args:
        rows: name -> time at which each coefficient's SNR is the threshold; at most six. k = 0 is not drawn.
        steps: T.

    Raises:
        ValueError: more than six rows.
    """
    times = {name: array(row) for name, row in rows.items()}
    early = {name: np.flatnonzero(t[2:] > np.minimum.accumulate(t[1:])[:-1] + 0.02 * steps) + 1 for name, t in times.items()}
    fig, ax = panel(3.3)
    looks = [look | {"zorder": 3 - 0.1 * number} for number, look in enumerate(LOOKS)]
    _by_coefficient(ax, times, looks=looks, marks=early)
    ax.set(xlabel="coefficient k", ylabel="time t at which SNR = 1", xscale="log", ylim=(0, steps))
    ax.annotate("sampling starts here", (1, 1), (-4, -4), "axes fraction", "offset points", ha="right", va="top", size=9)
    ax.annotate("and ends here", (0, 0), (4, 4), "axes fraction", "offset points", size=9)
    _finish(ax)
    legend(ax)
    return fig, ax


@style()
def known_share(rows: Curves) -> Panel:
    """What the best denoiser knows of each coefficient, SNR / (1 + SNR), at several times: a low-pass filter that opens.

    Args:
        rows: name of the time -> share for each k, from 0 to 1; at most six. k = 0 is not drawn.

    Raises:
        ValueError: more than six rows.
    """
    fig, ax = panel(3.2)
    _by_coefficient(ax, {name: 100 * array(share) for name, share in rows.items()})
    rule(ax, 50)
    ax.set(xlabel="coefficient k", ylabel="share of $P_k$ that is known (%)", xscale="log", ylim=(0, 102))
    _finish(ax)
    legend(ax)
    return fig, ax


@style()
def kept_power(panels: Mapping[str, Curves]) -> Panels:
    """Power of samples over that of the data, by coefficient, a panel for each number of steps and a line for each sampler.

    Args:
        panels: title -> sampler -> ratio for each k; the same samplers in all, at most six. k = 0 is not drawn.

    Raises:
        ValueError: more than six samplers.
    """
    fig, axes = canvas(1, len(panels), height=3.2, sharey=True)
    for ax, rows in titled(axes, panels):
        ax.axhline(1, color=INK, linewidth=1.0)
        _by_coefficient(ax, rows, what="samplers")
        ax.set(xlabel="coefficient k", xscale="log", ylim=(0, 1.08))
        _finish(ax)
    axes[0, 0].set_ylabel("power of samples / of data")
    legend(axes[0, 0], 2)
    return fig, axes[0]


@style()
def coupling_bars(panels: Mapping[str, Mapping[str, Sequence[float]]], noises: Sequence[float]) -> Panels:
    """Relative error of a high band, predicted from itself or with the low band's help: a panel for each kind of data.

    Args:
        panels: title -> from what -> error in percent of the band's power, one for each noise.
        noises: deviations of the noise, groups of bars.

    Raises:
        ValueError: the errors are not as many as the noises.
    """
    fig, axes = canvas(1, len(panels), height=3.0, sharey=True)
    for ax, (title, rows) in zip(axes[0], panels.items(), strict=True):
        for name, errors in rows.items():
            if len(errors) != len(noises):
                raise ValueError(f"{title}, {name}: {len(errors)} errors; expected {len(noises)}, one for each noise")
        for drawn in bars(ax, rows, room=0.8, fill=0.92, upright=True):
            for label in ax.bar_label(drawn, fmt="{:.0f}", padding=2, size=9):
                label.set_va("baseline")
        ax.set(title=title, xlabel="deviation of the noise", xticks=range(len(noises)), xticklabels=[f"{s:g}" for s in noises])
        ax.axhline(100, color=FAINT, linewidth=1.5, zorder=0)
        ax.tick_params(axis="x", length=0)
    axes[0, 0].set(ylabel="error of the high band (%)", ylim=(0, 112))
    legend(axes[0, 0], 2)
    return fig, axes[0]


def _by_coefficient(ax: Axes, rows: Curves, **options) -> None:
    """Rows over k = 1, 2, ..., without what they have at k = 0; options as for `draw`."""
    draw(ax, {name: array(values)[1:] for name, values in rows.items()}, start=1, **options)


def _finish(ax: Axes, *extra: tuple[float, str]) -> None:
    """A grid, and 1, 10, 100 in plain figures on the logarithmic axis of k, with extra ticks of other names."""
    ax.grid(axis="y")
    low, high = ax.get_xlim()
    ticks = dict(extra) | {10.0**e: str(10**e) for e in range(4) if low <= 10.0**e <= high}
    plain(ax.xaxis)
    ax.set_xticks([*ticks], [*ticks.values()])
    if ax.get_yscale() == "linear":
        ax.yaxis.set_major_formatter("{x:g}")


NARROWEST = 0.6  # metres to either side of the middle of a way, at least
STEPS = LinearSegmentedColormap.from_list("steps", ["#c8ccd2", CYCLE[0]])


@style()
def ways(rows: Mapping[str, Sequence[Motion]]) -> Panels:
    """Ways of the root on the floor, seen from above: a panel for each sentence, a line for each motion.

    All start at the dot and look up the page, so that left is left. Each panel has its own place and its own scale, of
    `NARROWEST` metres at least.

    Args:
        rows: title -> motions; those with y up and those with z up may be mixed.

    Raises:
        ValueError: there is no motion.
    """
    if not rows or not all(rows.values()):
        raise ValueError(f"{len(rows)} rows, some perhaps without a motion; expected at least one motion in each")
    fig, axes = tiled(len(rows), frame=0.4, each=2.5, shared=False)
    for ax, (title, motions) in zip(axes.flat, rows.items(), strict=False):
        several = [_seen_from_above(motion) for motion in motions]
        points = np.concatenate([*several, np.zeros((1, 2))])
        low, high = points.min(axis=0), points.max(axis=0)
        reach = max(NARROWEST, 0.54 * (high - low).max())
        for number, path in enumerate(several):
            ax.plot(*path.T, color=CYCLE[number % len(CYCLE)], linewidth=1.6)
        ax.plot(0, 0, "o", color="black")
        x, y = (low + high) / 2
        ax.set(xlim=(x - reach, x + reach), ylim=(y - reach, y + reach), aspect="equal")
        ax.set_title(fill(title, 22, **FOUR_LINES), fontsize=9.5)
        ax.grid(color=FAINT)
    outer(axes, "to the right (m)", "ahead (m)")
    return fig, axes


def _seen_from_above(motion: Motion) -> Float[np.ndarray, "T 2"]:
    """The root's way, metres: to the right and ahead of where the body looks in the first frame."""
    joints = motion.with_up("y").positions
    left, right = (list(side)[:1] for side in (motion.skeleton.left, motion.skeleton.right))
    across = (joints[0, right] - joints[0, left]).mean(axis=0)[[0, 2]]
    to_right = across / np.linalg.norm(across)
    ahead = np.array([to_right[1], -to_right[0]])  # a quarter turn: y up, z ahead, x to the left
    way = joints[:, 0][:, [0, 2]] - joints[0, 0, [0, 2]]
    return np.stack([way @ to_right, way @ ahead], axis=-1)


@style()
def emerging_way(paths: Sequence[Float[Array, "T 2"]], steps: Sequence[int], *, limbs: Sequence[Values], fps: float) -> Panels:
    """The clean estimate's way and the height of one joint, from the first denoising step (light) to the last (dark).

    Args:
        paths: ways on the floor, metres, one for each step shown.
        steps: number of each denoising step, the first is 1.
        limbs: height of a joint over time, metres, one for each step.
        fps: frames per second.

    Returns:
        Figure and its two axes.

    Raises:
        ValueError: not equally many of each.
    """
    if not len(paths) == len(steps) == len(limbs):
        raise ValueError(f"{len(paths)} paths, {len(steps)} steps and {len(limbs)} limbs; expected equally many")
    fig, axes = canvas(1, 2, height=2.9)
    left, right = axes[0]
    for share, path, step, limb in zip(np.linspace(0, 1, len(paths)), paths, steps, limbs, strict=True):
        colour = STEPS(share)
        left.plot(*array(path).T, color=colour, label=f"step {step}")
        right.plot(np.arange(len(limb)) / fps, array(limb), color=colour)
    left.set(title="path on the floor", xlabel="across (m)", ylabel="ahead (m)")
    left.set_aspect("equal", adjustable="datalim")
    right.set(title="height of a foot", xlabel="time (s)", ylabel="metres")
    legend(left, place="outside lower center")
    return fig, axes
