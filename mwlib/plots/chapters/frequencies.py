"""Pictures of motions by frequency under noise (chapter 12)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import torch
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from mwlib.plots.look import CYCLE, DASHES, FAINT, INK, OBSERVED, array, bar_look, canvas, style

Array = np.ndarray | torch.Tensor
LOOKS = list(zip(CYCLE, DASHES, strict=True))


@style()
def energy_by_coefficient(rows: Mapping[str, Float[Array, " K"]], *, few: int = 10) -> tuple[Figure, np.ndarray]:
    """Where the energy of motions lies (Fig. 4): mean power of each cosine coefficient, and the share of the first ones.

    The share of the first `few` stands in the legend. k = 0, the mean over time, is drawn at the left of a broken axis, as the
    axis of k is logarithmic.

    Args:
        rows: name -> mean power of coefficients 0, 1, ..., in comparable units; at most six, lengths may differ.
        few: K, how many coefficients are called low.

    Raises:
        ValueError: there are more than six rows, or one has no more than `few` coefficients.
    """
    powers = {name: array(power) for name, power in rows.items()}
    _at_most(len(powers), "rows")
    fig, axes = canvas(1, 2, height=3.5)
    left, right = axes[0]
    for (name, power), (colour, dashes) in zip(powers.items(), LOOKS, strict=False):
        if len(power) <= few:
            raise ValueError(f"{name}: {len(power)} coefficients; expected more than few, {few}")
        share = np.cumsum(power) / power.sum()
        left.plot(np.arange(1, len(power)), power[1:], color=colour, linestyle=dashes)
        left.plot(0.6, power[0], "o", color=colour, markersize=5, clip_on=False)
        label = f"{name}: {100 * share[few - 1]:.0f} %"
        right.plot(np.arange(1, len(power) + 1), 100 * share, color=colour, linestyle=dashes, label=label)
    left.set(title="mean power", xlabel="coefficient k", xscale="log", yscale="log", xlim=(0.5, None))
    left.axvline(0.77, color=OBSERVED, linewidth=0.8, linestyle=(0, (2, 2)))
    right.set(title="energy in the first K", xlabel="K, number of coefficients", ylabel="%", xscale="log", ylim=(0, 103))
    right.axvline(few, color=OBSERVED, linewidth=0.8)
    for ax in axes[0]:
        ax.grid(axis="y")
        _plain_ticks(ax, (0.6,) if ax is left else (), ("0",) if ax is left else ())
    fig.legend(loc="outside upper left", ncols=2, title=f"share of the first {few}", alignment="left")
    return fig, axes[0]


@style()
def parallel_snr(
    power: Float[Array, " K"], alpha_bar: Float[Array, " M"], ks: Sequence[int], *, gamma: float = 1.0
) -> tuple[Figure, Axes]:
    """Signal-to-noise ratio of a few coefficients over the diffusion index, in decibel: one curve, at several heights.

    A dot marks where a coefficient goes under the threshold.

    Args:
        power: P_k.
        alpha_bar: (M,) schedule.
        ks: which coefficients; at most six.
        gamma: the threshold.

    Raises:
        ValueError: more than six coefficients.
    """
    _at_most(len(ks), "coefficients")
    power, curve = array(power), array(alpha_bar)
    fig, axes = canvas(height=3.3)
    ax = axes[0, 0]
    ax.axhline(10 * np.log10(gamma), color=INK, linewidth=1.0, label=f"SNR = {gamma:g}")
    for k, (colour, dashes) in zip(ks, LOOKS, strict=False):
        ratio = 10 * np.log10(curve * power[k] / (1 - curve))
        above = np.flatnonzero(ratio >= 10 * np.log10(gamma))
        label = f"k = {k}"
        if len(above):
            ax.plot(above[-1], ratio[above[-1]], "o", color=colour)
            label += f", until t = {above[-1]}"
        ax.plot(ratio, color=colour, linestyle=dashes, label=label)
    ax.set(xlabel="diffusion index t", ylabel="signal to noise (dB)", xlim=(0, len(curve) - 1), ylim=(-60, 60))
    ax.grid(axis="y")
    fig.legend(loc="outside upper left", ncols=3)
    return fig, ax


@style()
def recovery_by_coefficient(rows: Mapping[str, Float[Array, " K"]], *, steps: int) -> tuple[Figure, Axes]:
    """When each coefficient comes back as t falls: sampling runs from the top of the picture to its bottom.

    A dot marks each that comes back before a lower one, by more than a fiftieth of the way.

    Args:
        rows: name -> time at which each coefficient's SNR is the threshold; at most six. k = 0 is not drawn.
        steps: T.

    Raises:
        ValueError: more than six rows.
    """
    _at_most(len(rows), "rows")
    fig, axes = canvas(height=3.3)
    ax = axes[0, 0]
    for number, ((name, times), (colour, dashes)) in enumerate(zip(rows.items(), LOOKS, strict=False)):
        times = array(times)[1:]
        k = np.arange(1, len(times) + 1)
        ax.plot(k, times, color=colour, linestyle=dashes, label=name, zorder=3 - 0.1 * number)
        early = np.flatnonzero(times[1:] > np.minimum.accumulate(times)[:-1] + 0.02 * steps) + 1
        ax.plot(k[early], times[early], "o", color=colour, markersize=5)
    ax.set(xlabel="coefficient k", ylabel="time t at which SNR = 1", xscale="log", ylim=(0, steps))
    ax.annotate("sampling starts here", (1, 1), (-4, -4), "axes fraction", "offset points", ha="right", va="top", size=9)
    ax.annotate("and ends here", (0, 0), (4, 4), "axes fraction", "offset points", size=9)
    ax.grid(axis="y")
    _plain_ticks(ax)
    fig.legend(loc="outside upper left", ncols=3)
    return fig, ax


@style()
def known_share(rows: Mapping[str, Float[Array, " K"]]) -> tuple[Figure, Axes]:
    """What the best denoiser knows of each coefficient, SNR / (1 + SNR), at several times: a low-pass filter that opens.

    Args:
        rows: name of the time -> share for each k, from 0 to 1; at most six. k = 0 is not drawn.

    Raises:
        ValueError: more than six rows.
    """
    _at_most(len(rows), "rows")
    fig, axes = canvas(height=3.2)
    ax = axes[0, 0]
    for (name, share), (colour, dashes) in zip(rows.items(), LOOKS, strict=False):
        share = array(share)
        ax.plot(np.arange(1, len(share)), 100 * share[1:], color=colour, linestyle=dashes, label=name)
    ax.axhline(50, color=OBSERVED, linewidth=0.8)
    ax.set(xlabel="coefficient k", ylabel="share of $P_k$ that is known (%)", xscale="log", ylim=(0, 102))
    ax.grid(axis="y")
    _plain_ticks(ax)
    fig.legend(loc="outside upper left", ncols=3)
    return fig, ax


@style()
def kept_power(panels: Mapping[str, Mapping[str, Float[Array, " K"]]]) -> tuple[Figure, np.ndarray]:
    """Power of samples over that of the data, by coefficient, a panel for each number of steps and a line for each sampler.

    Args:
        panels: title -> sampler -> ratio for each k; the same samplers in all, at most six. k = 0 is not drawn.

    Raises:
        ValueError: more than six samplers.
    """
    _at_most(max(len(rows) for rows in panels.values()), "samplers")
    fig, axes = canvas(1, len(panels), height=3.2, sharey=True)
    for ax, (title, rows) in zip(axes[0], panels.items(), strict=True):
        ax.axhline(1, color=INK, linewidth=1.0)
        for (name, ratio), (colour, dashes) in zip(rows.items(), LOOKS, strict=False):
            ratio = array(ratio)
            ax.plot(np.arange(1, len(ratio)), ratio[1:], color=colour, linestyle=dashes, label=name)
        ax.set(title=title, xlabel="coefficient k", xscale="log", ylim=(0, 1.08))
        ax.grid(axis="y")
        _plain_ticks(ax)
    axes[0, 0].set_ylabel("power of samples / of data")
    fig.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=2)
    return fig, axes[0]


@style()
def coupling_bars(panels: Mapping[str, Mapping[str, Sequence[float]]], noises: Sequence[float]) -> tuple[Figure, np.ndarray]:
    """Relative error of a high band, predicted from itself or with the low band's help: a panel for each kind of data.

    Args:
        panels: title -> from what -> error in percent of the band's power, one for each noise.
        noises: deviations of the noise, groups of bars.

    Raises:
        ValueError: the errors are not as many as the noises.
    """
    fig, axes = canvas(1, len(panels), height=3.0, sharey=True)
    for ax, (title, rows) in zip(axes[0], panels.items(), strict=True):
        thick = 0.8 / len(rows)
        for number, (name, errors) in enumerate(rows.items()):
            if len(errors) != len(noises):
                raise ValueError(f"{title}, {name}: {len(errors)} errors; expected {len(noises)}, one for each noise")
            places = np.arange(len(noises)) + (number - (len(rows) - 1) / 2) * thick
            ax.bar(places, errors, 0.92 * thick, label=name, **bar_look(number))
            for place, error in zip(places, errors, strict=True):
                ax.annotate(f"{error:.0f}", (place, error), (0, 2), textcoords="offset points", ha="center", size=9)
        ax.set(title=title, xlabel="deviation of the noise", xticks=range(len(noises)), xticklabels=[f"{s:g}" for s in noises])
        ax.axhline(100, color=FAINT, linewidth=1.5, zorder=0)
        ax.tick_params(axis="x", length=0)
    axes[0, 0].set(ylabel="error of the high band (%)", ylim=(0, 112))
    fig.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=2)
    return fig, axes[0]


def _plain_ticks(ax: Axes, places: Sequence[float] = (), names: Sequence[str] = ()) -> None:
    """1, 10, 100 in plain figures on a logarithmic axis of k, and extra ticks with names of their own."""
    low, high = ax.get_xlim()
    powers = [10.0**e for e in range(4) if low <= 10.0**e <= high]
    ax.set_xticks([*places, *powers], [*names, *(f"{p:g}" for p in powers)])
    ax.xaxis.set_minor_formatter(NullFormatter())
    if ax.get_yscale() == "linear":
        ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def _at_most(count: int, what: str) -> None:
    if count > len(LOOKS):
        raise ValueError(f"{count} {what}; expected at most {len(LOOKS)}, told apart by colour and dashes")
