"""Pictures of a sealed trial's score: reliability, risk against coverage, confusion, severity, shrinkage."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import PowerNorm

from cutvib_ss.plot.style import CORRECTED, GREY, INK, MEASURED, NOMINAL, TUNED, on_grid
from cutvib_ss.validation.score import Confusion, Score

_LEAST = 1e-3
"""What is left of an error below this part of it is drawn there."""


def reliability_diagram(score: Score, *, ax: Any = None) -> Any:
    """
    How often answers were right against how sure they were, with the number of answers below.

    Parameters
    ----------
    score : Score
        Score of a sealed trial.
    ax : sequence of two Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    Figure or sequence of Axes
        The axes that were given, else the figure; bars are 95 % intervals.
    """
    with on_grid(ax, 2, 1, 4.6, 4.6, sharex=True, height_ratios=[3.2, 1]) as grid:
        upper, lower = grid.axes[:, 0]
        upper.plot([0, 1], [0, 1], color=GREY, lw=0.8, ls=(0, (4, 2)), label="stated = true")
        shown = [b for b in score.bins if b.right.cases]
        x = np.array([b.confidence for b in shown])
        y = np.array([b.right.value for b in shown])
        low, high = np.array([b.right.low for b in shown]), np.array([b.right.high for b in shown])
        upper.errorbar(x, y, [y - low, high - y], fmt="o", ms=4.5, color=CORRECTED, ecolor=CORRECTED, elinewidth=0.9,
                       label="right, with 95 % interval")  # fmt: skip
        upper.set(ylim=(-0.02, 1.02), ylabel="right [-]", title="Reliability")
        upper.legend(loc="upper left")
        width = score.bins[0].high - score.bins[0].low
        counts = [b.right.cases for b in score.bins]
        lower.bar([(b.low + b.high) / 2 for b in score.bins], counts, 0.9 * width, color=MEASURED)
        lower.set(xlim=(0, 1), xlabel="stated probability of the first answer [-]", ylabel="answers")
    return grid.drawn


def risk_curve(score: Score, *, ax: Axes | None = None) -> Any:
    """
    Part of wrong answers among the surest, against how many are counted in.

    Parameters
    ----------
    score : Score
        Score of a sealed trial.
    ax : Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    Figure or Axes
        The axes that were given, else the figure.
    """
    with on_grid(ax, 1, 1, 4.6, 3.2) as grid:
        axes = grid.axes[0, 0]
        axes.step(score.coverage, score.risk, where="post", color=CORRECTED)
        axes.set(xlim=(0, 1), ylim=(0, max(0.05, 1.15 * float(np.max(score.risk, initial=0.0)))))
        axes.set(
            xlabel="answers counted, the surest first [-]", ylabel="wrong among them [-]", title="Risk and coverage"
        )
    return grid.drawn


def severity_curve(score: Score, *, ax: Axes | None = None) -> Any:
    """
    Right answers by size of the gap, for cases with one cause.

    Parameters
    ----------
    score : Score
        Score of a sealed trial.
    ax : Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    Figure or Axes
        The axes that were given, else the figure.
    """
    groups = score.by_severity
    with on_grid(ax, 1, 1, 4.6, 3.2) as grid:
        axes = grid.axes[0, 0]
        x = np.arange(len(groups))
        y = np.array([g.right.value for g in groups])
        spread = [y - [g.right.low for g in groups], np.array([g.right.high for g in groups]) - y]
        axes.bar(x, y, 0.6, color=CORRECTED, label="right first")
        axes.errorbar(x, y, spread, fmt="none", ecolor=INK, elinewidth=0.9)
        axes.plot(x, [g.probability for g in groups], "D", ms=4.5, color=TUNED, mec=INK, mew=0.5,
                  label="mean probability on the truth")  # fmt: skip
        axes.set_xticks(x, [f"{g.name}\n{g.right.cases} cases" for g in groups])
        axes.set(ylim=(0, 1.02), xlabel="gap over noise", ylabel="[-]", title="By size of the gap, one cause")
        axes.grid(axis="x", visible=False)
        grid.legend(axes, "outside lower center", ncols=2)
    return grid.drawn


def confusion_map(confusion: Confusion, title: str, *, ax: Axes | None = None) -> Any:
    """
    Truths against names: shares of each row as colours, cases as figures.

    Parameters
    ----------
    confusion : Confusion
        How often each truth got each name: ``score.causes`` or ``score.places``.
    title : str
        Title of the picture.
    ax : Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    Figure or Axes
        The axes that were given, else the figure.
    """
    counts = confusion.counts
    rows, columns = counts.shape
    with on_grid(ax, 1, 1, 3.2 + 0.3 * columns, 2.4 + 0.22 * rows) as grid:
        axes = grid.axes[0, 0]
        share = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
        axes.imshow(share, cmap="Blues", norm=PowerNorm(0.6, 0.0, 1.0), aspect="auto")
        axes.set_xticks(np.arange(columns), confusion.named, rotation=90, fontsize=7)
        axes.set_yticks(np.arange(rows), confusion.truths, fontsize=7)
        axes.set(xlabel="named first", ylabel="truth", title=title)
        axes.grid(visible=False)
        _outline_right(axes, confusion)
        for r, c in np.argwhere(counts > 0):
            colour = "white" if share[r, c] > 0.55 else INK
            axes.text(c, r, str(counts[r, c]), ha="center", va="center", fontsize=7, color=colour)
    return grid.drawn


def _outline_right(axes: Axes, confusion: Confusion) -> None:
    for r, truth in enumerate(confusion.truths):
        right = "unknown" if truth.startswith("outside:") else truth
        if right in confusion.named:
            c = confusion.named.index(right)
            x, y = [c - 0.5, c + 0.5, c + 0.5, c - 0.5, c - 0.5], [r - 0.5, r - 0.5, r + 0.5, r + 0.5, r - 0.5]
            axes.plot(x, y, color=INK if confusion.counts[r, c] else NOMINAL, lw=0.9)


def shrinkage_scatter(score: Score, *, ax: Axes | None = None) -> Any:
    """
    Part of the error that is closed, as stated with its interval, against what is achieved on fresh records.

    Parameters
    ----------
    score : Score
        Score of a sealed trial.
    ax : Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    Figure or Axes
        The axes that were given, else the figure.
    """
    with on_grid(ax, 1, 1, 4.6, 4.2) as grid:
        axes = grid.axes[0, 0]
        axes.plot([_LEAST, 2], [_LEAST, 2], color=GREY, lw=0.8, ls=(0, (4, 2)))
        for right, colour, label in ((True, CORRECTED, "right first"), (False, NOMINAL, "wrong")):
            shown = [s for s in score.shrinkage if s.right is right]
            # Left of the error rather than closed: 99 and 99.9 % are far apart for whoever uses the model.
            x, y, low, high = (
                np.clip([1.0 - getattr(s, name) for s in shown], _LEAST, None)
                for name in ("achieved", "stated", "high", "low")
            )
            spread = [np.maximum(y - low, 0.0), np.maximum(high - y, 0.0)]
            axes.errorbar(x, y, spread, fmt="o", ms=3, color=colour, ecolor=MEASURED, elinewidth=0.8, label=label)
        axes.set(
            xscale="log", yscale="log", xlim=(_LEAST / 1.5, 2), ylim=(_LEAST / 1.5, 2), title="What is left of the gap"
        )
        axes.set(xlabel="on fresh records [-]", ylabel="as stated, with its 95 % interval [-]")
        axes.legend(loc="upper left")
    return grid.drawn
