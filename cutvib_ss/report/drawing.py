"""A drawing of the machine with the places of the fault marked, as SVG in the page's own colours."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape

from markupsafe import Markup

from cutvib_ss.diagnosis.result import Diagnosis
from cutvib_ss.plot.diagnosis import probability_text

# Shape of each place, and where its label stands (x, y, anchor).
_PARTS: Mapping[str, tuple[str, tuple[int, int, str]]] = {
    "rail": ('<rect x="60" y="92" width="480" height="14" rx="2"/>', (150, 84, "middle")),
    "rail_ends": (
        '<path d="M70 107 l-16 26 h32 z M530 107 l-16 26 h32 z M44 137 h52 M504 137 h52"/>',
        (4, 158, "start"),
    ),
    "head_base": ('<rect x="258" y="80" width="84" height="38" rx="3"/>', (352, 84, "start")),
    "head": ('<rect x="288" y="120" width="24" height="72" rx="4"/>', (326, 166, "start")),
    "joint1": ('<circle cx="300" cy="122" r="11"/>', (326, 133, "start")),
    "tool": ('<path d="M291 206 h18 v48 l-9 16 l-9 -16 z"/>', (326, 248, "start")),
    "joint2": ('<circle cx="300" cy="198" r="11"/>', (326, 204, "start")),
    "measurement": ('<path d="M96 214 h62 v40 h-62 z M108 234 q8 -22 16 0 t16 0"/>', (127, 272, "middle")),
}
_LABELS = {
    "rail": "rail",
    "rail_ends": "ends of the rail",
    "head_base": "guide",
    "joint1": "joint 1",
    "head": "head",
    "joint2": "joint 2",
    "tool": "tool",
    "measurement": "measuring chain",
}


def machine_drawing(d: Diagnosis) -> Markup:
    """The cutting machine, or the ports of another structure, with the set of places marked."""
    odds: dict[str, float] = {}
    for place, p in d.where.places:
        for part in place.split("+"):
            odds[part] = odds.get(part, 0.0) + p
    marked = {p for place in (d.where.place, *d.where.place_set) for p in place.split("+")} - {"none"}
    if d.verdict == "no_gap":
        marked = set()
    if d.nominal.has_position:
        body, size = _machine(marked, odds, _spot(d)), (600, 290)
    else:
        body, size = _ports(list(d.nominal.system.ports), marked, odds)  # type: ignore[union-attr]
    top = 54 if d.nominal.has_position else 0
    named = ", ".join(sorted(marked)) or "none"
    return Markup(
        f'<svg class="machine" viewBox="0 {top} {size[0]} {size[1] - top}" role="img" '
        f'aria-label="Drawing of the machine; marked places: {escape(named)}">{body}</svg>'
    )


def _spot(d: Diagnosis) -> float | None:
    """Where on the rail the fault sits, as a fraction of its length, if that was fitted."""
    if d.verdict == "no_gap" or d.causes[0].effect != "rail_added_mass":
        return None
    position = d.causes[0].parameters.get("position")
    return float(position.value) if position is not None else None


def _machine(marked: set[str], odds: Mapping[str, float], spot: float | None) -> str:
    out = []
    for place, (shape, (x, y, anchor)) in _PARTS.items():
        kind = "part marked" if place in marked else "part"
        label = _LABELS[place] + (f" · {probability_text(min(odds.get(place, 0.0), 1.0))}" if place in marked else "")
        out.append(f'<g class="{kind}">{shape}<text x="{x}" y="{y}" text-anchor="{anchor}">{escape(label)}</text></g>')
    if spot is not None:
        out.append(f'<g class="part marked"><circle cx="{60 + 480 * spot:.1f}" cy="99" r="12"/></g>')
    axes = (
        '<path d="M470 216 h44 m-7 -4 l7 4 l-7 4 M470 216 v34 m-4 -7 l4 7 l4 -7"/>'
        '<text x="522" y="220">Y</text><text x="466" y="268">X</text>'
    )
    return "".join(out) + f'<g class="axes">{axes}</g>'


def _ports(ports: list[str], marked: set[str], odds: Mapping[str, float]) -> tuple[str, tuple[int, int]]:
    names = [*ports, "measurement"]
    out = []
    for k, name in enumerate(names):
        x, y = 10 + 148 * (k % 4), 10 + 62 * (k // 4)
        kind = "part marked" if name in marked else "part"
        label = escape(name if len(name) < 18 else name[:16] + "…")
        lines = [label, probability_text(min(odds.get(name, 0.0), 1.0))] if name in marked else [label]
        texts = (
            f'<text x="{x + 68}" y="{y + 38 - 10 * len(lines) + 19 * i}" text-anchor="middle">{text}</text>'
            for i, text in enumerate(lines)
        )
        out.append(f'<g class="{kind}"><rect x="{x}" y="{y}" width="136" height="46" rx="4"/>{"".join(texts)}</g>')
    return "".join(out), (600, 72 + 62 * ((len(names) - 1) // 4))
