"""What all pages share: one template around them, plotly and the scripts that draw, numbers as JSON for them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from numpy.typing import ArrayLike

from cutvib_ss.results import ComplexArray


def page(template: str, script: str, data: Mapping[str, Any] | None, /, **content: Any) -> str:
    """One self-contained page: a template, its data, and the script that draws them; without data there are no charts."""
    environment = Environment(
        loader=PackageLoader("cutvib_ss.report"), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True,
    )  # fmt: skip
    environment.filters |= content.pop("filters", {})
    return environment.get_template(template).render(
        **content,
        data=None if data is None else embedded(data),
        plotly=plotly_script() if data is not None else "",
        frame_script=_source("frame.js"),
        charts=_source(script),
    )


def plotly_script() -> Markup:
    """The plotting library, to stand in the page once."""
    source = (files("plotly") / "package_data" / "plotly.min.js").read_text(encoding="utf-8")
    return Markup(source.replace("</script", "<\\/script"))


def embedded(data: Mapping[str, Any]) -> Markup:
    """JSON that may stand in a script element."""
    return Markup(json.dumps(data, separators=(",", ":"), allow_nan=False, ensure_ascii=False).replace("<", "\\u003c"))


def complex_lists(values: ComplexArray) -> dict[str, list[float | None]]:
    """Real and imaginary part as JSON takes them."""
    return {"re": number_list(values.real), "im": number_list(values.imag)}


def number_list(values: ArrayLike) -> list[float | None]:
    """Numbers as JSON takes them."""
    return [number(v) for v in np.asarray(values, dtype=np.float64).tolist()]


def number(value: float) -> float | None:
    """A number to five digits; None where it is not finite."""
    return float(f"{value:.5g}") if np.isfinite(value) else None


def _source(script: str) -> Markup:
    return Markup((files("cutvib_ss.report") / "templates" / script).read_text(encoding="utf-8"))
