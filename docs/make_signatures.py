"""
Compute the signature of every effect of the catalogue on the published machine: docs/effect_signatures.md and its pictures.

    .venv/bin/python docs/make_signatures.py          # page and pictures
    .venv/bin/python docs/make_signatures.py page     # the page alone

A strong example of each effect (that of the conformance suite) is applied to the published machine at its first place. Linear
effects by frequency responses over the rail; laws by sine sweeps at two levels of force.
"""

import sys
from dataclasses import fields
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

DOCS = Path(__file__).resolve().parent
sys.path.insert(0, str(DOCS.parent))

import cutvib_ss as cv  # noqa: E402
from cutvib_ss.effects.base import Effect, parameter_fields  # noqa: E402
from cutvib_ss.effects.catalogue import OWN  # noqa: E402

PAGE = DOCS / "effect_signatures.md"
FIGURES = DOCS / "figures" / "effects"
CHANNELS = ("tool_x", "tool_z", "base_x")
RAIL = np.linspace(0.02, 0.98, 25)
FREQ = np.arange(15.0, 450.5, 1.0)
SWEEP_RAIL = np.array([0.1, 0.3, 0.5])
SWEEP = np.arange(150.0, 350.5, 1.0)
JOINT_MOTION = 1e-4
"""Largest rotation of the law's joint in the louder sweep of the linear machine [rad]."""


INTRODUCTION = """\
# What each effect does to the responses

Computed by `docs/make_signatures.py` on the published machine, force on the tool in X: a strong example of each effect at
its first place. {doc}`effects` derives them. Percent are root mean squares of the change over those of the response, over
the whole rail and 15 to 450 Hz; of nonlinear ones, over three positions and 150 to 350 Hz, at a force that turns the joint by
0.1 mrad at most. *Bands* are the fewest steps of 10 Hz that carry four fifths of the change. *Positions*: where along the
rail it shows most and least (*alike*: less than half as much again). An effect of other size or place has another
signature; the pattern is what tells.
"""
PICTURES = """\
Below: left, the channel that changes most where it changes most, without (grey) and with the effect, of a law at the
quieter level too (dashed); right, for linear effects, the change of that channel over its response, |H' - H|/|H|, over rail
and frequency.
"""


class Signature(NamedTuple):
    """What an effect does to the responses."""

    effect: Effect
    positions: np.ndarray
    freq: np.ndarray
    plain: np.ndarray  # (position, channel, frequency) without it
    changed: np.ndarray  # with it; of a law at the louder level
    quiet: np.ndarray | None  # of a law at a quarter of that level


def example(kind: type[Effect]) -> Effect:
    """The conformance suite's example of an effect, at its first place."""
    machine = cv.published_machine()
    place = kind.places(machine)[0]
    _, at = next(iter(kind.examples(machine, place)))
    return at(1.0)


def signature(kind: type[Effect]) -> Signature:
    """Responses without and with an effect."""
    machine, effect = cv.published_machine(), example(kind)
    applied = effect.apply(machine)
    if kind.linear:
        plain = cv.frequency_response(machine, RAIL, FREQ, outputs=CHANNELS).data[:, :, 0]
        changed = cv.frequency_response(applied, RAIL, FREQ, outputs=CHANNELS).data[:, :, 0]
        return Signature(effect, RAIL, FREQ, plain, changed, None)
    plain = cv.frequency_response(machine, SWEEP_RAIL, SWEEP, outputs=CHANNELS).data[:, :, 0]
    joint = cv.frequency_response(machine, SWEEP_RAIL, SWEEP, form="receptance", outputs=[effect.place]).data
    loud = JOINT_MOTION / float(np.abs(joint).max())
    swept = [
        cv.sine_response(applied, SWEEP_RAIL, SWEEP, level, harmonics=3, outputs=CHANNELS).data[:, :, 0]
        for level in (loud, loud / 4)
    ]
    return Signature(effect, SWEEP_RAIL, SWEEP, plain, *swept)


def parts(s: Signature) -> np.ndarray:
    """Squares of the change over the mean squares of the response of each channel, shape (position, channel, frequency)."""
    size = np.mean(np.abs(s.plain) ** 2, axis=(0, 2), keepdims=True)
    return np.abs(s.changed - s.plain) ** 2 / size


def channels_text(s: Signature) -> list[str]:
    """Change of each channel: root mean squares over rail and band, in percent of the response."""
    size = 100 * np.sqrt(np.mean(parts(s), axis=(0, 2)))
    return [f"{x:.0f} %" if x >= 9.5 else f"{x:.1f} %" if x >= 0.05 else "0" for x in size]


def positions_text(s: Signature) -> str:
    """Where along the rail it shows most and least."""
    size = np.sqrt(np.mean(parts(s), axis=(1, 2)))
    if size.max() < 1.5 * size.min():
        return "alike"
    # of two mirror positions that differ by rounding alone, the first
    even = np.round(size / size.max(), 6)
    most, least = s.positions[even.argmax()], s.positions[even.argmin()]
    return f"most {most:.2f}, least {least:.2f} ({size.max() / max(size.min(), 1e-300):.1f} x)"


def bands_text(s: Signature) -> str:
    """The fewest bands of 10 Hz that carry four fifths of the change."""
    edges = np.arange(s.freq[0], s.freq[-1], 10.0)
    power = np.mean(parts(s), axis=(0, 1))
    each = np.array([power[(s.freq >= a) & (s.freq < a + 10.0)].sum() for a in edges])
    order = np.argsort(-each)
    enough = int(np.searchsorted(np.cumsum(each[order]), 0.8 * each.sum())) + 1
    chosen = sorted(edges[order[:enough]])
    joined: list[list[float]] = []
    for a in chosen:
        if joined and a <= joined[-1][1] + 1e-9:
            joined[-1][1] = a + 10.0
        else:
            joined.append([a, a + 10.0])
    return ", ".join(f"{a:.0f}-{b:.0f}" for a, b in joined)


def level_text(s: Signature) -> str:
    """Whether a quarter of the force changes the response by another amount."""
    if s.quiet is None:
        return "no"
    size = np.mean(np.abs(s.plain) ** 2, axis=(0, 2), keepdims=True)
    quiet = float(np.sqrt(np.mean(np.abs(s.quiet - s.plain) ** 2 / size)))
    loud = float(np.sqrt(np.mean(parts(s))))
    apart = float(np.sqrt(np.mean(np.abs(s.quiet - s.changed) ** 2 / size)))
    if apart < 0.01 * max(loud, quiet):
        return "no: the same at every level"
    return f"yes: {100 * loud:.0f} %, at a quarter of the force {100 * quiet:.0f} %"


def values_text(effect: Effect) -> str:
    """The example's values."""
    said = []
    units = {f.name: f.metadata["range"].unit for f in parameter_fields(type(effect))}
    for f in fields(effect):
        value: Any = getattr(effect, f.name)
        if f.name == "place" or value is None or value is False:
            continue
        text = f"{value:.3g}" if isinstance(value, float) else str(value)
        unit = units.get(f.name, f.metadata.get("unit", ""))
        said.append(f"`{f.name}` {text}" + ("" if unit in ("", "1") else f" {unit}"))
    return ", ".join(said)


def page(signatures: dict[str, Signature]) -> str:
    """The page's text."""
    lines = [
        *INTRODUCTION.splitlines(),
        "",
        "| effect | place | example | `tool_x` | `tool_z` | `base_x` | positions, y/L | bands [Hz] | depends on the level |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for name, s in signatures.items():
        cells = [
            f"[`{name}`](#{name.replace('_', '-')})",
            f"`{s.effect.place}`",
            values_text(s.effect),
            *channels_text(s),
        ]
        cells += [positions_text(s), bands_text(s), level_text(s)]
        lines.append("| " + " | ".join(cells) + " |")
    lines += [
        "",
        *PICTURES.splitlines(),
        "",
    ]
    for name, s in signatures.items():
        what = (type(s.effect).__doc__ or "").strip().partition("\n")[0]
        lines += [f"## {name.replace('_', ' ')}", "", what.replace("``", "`"), ""]
        lines += [f"![{name}: response without and with it](figures/effects/{name}.png)", ""]
    return "\n".join(lines).rstrip() + "\n"


def draw(name: str, s: Signature) -> None:
    """The picture of one effect."""
    from matplotlib.colors import LogNorm

    from cutvib_ss.plot.style import CORRECTED, GREY, MEASURED, WORKING_FREQUENCY, colour_bar, drawing, png

    change = parts(s).mean(axis=2)
    position, channel = np.unravel_index(int(change.argmax()), change.shape)
    panels = 1 if s.quiet is not None else 2
    with drawing(3.2 + 3.6 * panels, 2.5) as figure:
        axes = figure.subplots(1, panels, squeeze=False)[0]
        for data, style in (
            (s.plain, {"color": MEASURED, "linewidth": 2.8}),
            (s.changed, {"color": CORRECTED}),
            (s.quiet, {"color": CORRECTED, "linewidth": 0.7, "linestyle": "--"}),
        ):
            if data is not None:
                axes[0].semilogy(s.freq, np.abs(data[position, channel]), **style)
        axes[0].axvline(WORKING_FREQUENCY, color=GREY, linestyle=":", linewidth=0.8)
        axes[0].set(xlim=(s.freq[0], s.freq[-1]), xlabel="frequency [Hz]", ylabel="accelerance [(m/s²)/N]")
        axes[0].set_title(f"{CHANNELS[channel]}, y/L = {s.positions[position]:.2f}")
        if panels == 2:
            change = 100 * np.abs(s.changed[:, channel] / s.plain[:, channel] - 1)
            norm = LogNorm(1.0, 100.0)
            axes[1].pcolormesh(s.positions, s.freq, change.T, cmap="viridis", norm=norm, rasterized=True)
            axes[1].set(xlim=(0.0, 1.0), xlabel="position y/L", title=f"{CHANNELS[channel]}: change over response")
            axes[1].grid(False)
            colour_bar(figure, axes[1], "viridis", norm, "%")
        FIGURES.mkdir(parents=True, exist_ok=True)
        (FIGURES / f"{name}.png").write_bytes(png(figure, dpi=100.0, colours=64))


def main(what: str) -> None:
    """Compute all and write."""
    signatures = {kind.effect: signature(kind) for kind in OWN}
    PAGE.write_text(page(signatures), encoding="utf-8")
    if what == "all":
        for name, s in signatures.items():
            draw(name, s)
    print(f"written: {PAGE}")


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "all")
