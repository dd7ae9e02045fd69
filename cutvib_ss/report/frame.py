"""What all pages share: one template around them, plotly and the scripts that draw, numbers as JSON for them."""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from numpy.typing import ArrayLike, NDArray

from cutvib_ss.results import ComplexArray, FloatArray

MOST_LINES = 2000
"""Lines of a response that a page draws at most."""
_PACKED = "f4"
"""Key of a packed array: little-endian single precision in base64, about half of what its digits take. NaN is no value."""


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


@cache
def plotly_script() -> str:
    """The plotting library, to stand in the page once: compressed, as base64; `frame.js` unpacks it."""
    source = (files("plotly") / "package_data" / "plotly.min.js").read_bytes()
    return base64.b64encode(gzip.compress(source, mtime=0)).decode()


def embedded(data: Mapping[str, Any]) -> Markup:
    """JSON that may stand in a script element; its arrays are packed."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False, ensure_ascii=False, default=_packed)
    return Markup(text.replace("<", "\\u003c"))


def unpacked(text: str) -> Any:
    """What `embedded` wrote."""
    return json.loads(
        text, object_hook=lambda d: np.frombuffer(base64.b64decode(d[_PACKED]), "<f4") if _PACKED in d else d
    )


def _packed(values: NDArray[np.float32]) -> dict[str, str]:
    return {_PACKED: base64.b64encode(values.astype("<f4").tobytes()).decode()}


def complex_lists(values: ComplexArray) -> dict[str, NDArray[np.float32]]:
    """Real and imaginary part as the page takes them."""
    return {"re": number_list(values.real), "im": number_list(values.imag)}


def number_list(values: ArrayLike) -> NDArray[np.float32]:
    """Numbers as the page takes them, to seven digits; NaN where not finite."""
    given = np.asarray(values, dtype=np.float64)
    return np.where(np.abs(given) < np.finfo(np.float32).max, given, np.nan).astype(np.float32)


def lines_to_draw(modulus: FloatArray, most: int = MOST_LINES) -> NDArray[np.intp]:
    """Indices of lines to draw: all, or the least and the largest of each stretch, so that no peak is lost."""
    every = np.arange(modulus.size)
    size = -(-modulus.size // (most // 2))
    if size < 3:
        return every
    whole = modulus.size // size * size
    stretches = every[:whole].reshape(-1, size)
    found, rows = modulus[stretches], np.arange(len(stretches))
    ends = [stretches[rows, found.argmin(axis=1)], stretches[rows, found.argmax(axis=1)], every[whole:]]
    return np.unique(np.concatenate(ends))


def number(value: float) -> float | None:
    """A number to five digits; None where it is not finite."""
    return float(f"{value:.5g}") if np.isfinite(value) else None


def _source(script: str) -> Markup:
    return Markup((files("cutvib_ss.report") / "templates" / script).read_text(encoding="utf-8"))
