"""The numbers of judgement as the documentation shows them."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from cutvib_ss.diagnosis.settings import SETTINGS


def settings_table() -> str:
    """The numbers as a table of the documentation, a section for each prefix of their names."""
    rows, section = [], ""
    for f in fields(SETTINGS):
        prefix, _, rest = f.name.partition("_")
        if prefix != section:
            section = prefix
            rows += ["", f"## `{section}_…`", "", "| number | value | unit | what it is | larger | source |"]
            rows.append("|---|---|---|---|---|---|")
        about = " | ".join(f.metadata[key] for key in ("unit", "meaning", "effect", "source"))
        rows.append(f"| `{rest}` | {_shown(getattr(SETTINGS, f.name))} | {about} |")
    return "\n".join(rows).strip() + "\n"


def _shown(value: Any) -> str:
    """A value, or several, of which many by their ends."""
    if not isinstance(value, tuple):
        return f"{value:.4g}"
    each = [" : ".join(f"{x:.3g}" for x in v) if isinstance(v, tuple) else f"{v:.3g}" for v in value]
    return ", ".join(each if len(each) <= 8 else [*each[:2], "…", each[-1]])
