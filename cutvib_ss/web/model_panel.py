"""The model tried out: the head moves along the rail, an absorber and a controller are added to it."""

from __future__ import annotations

import asyncio
import time
from dataclasses import replace
from typing import TYPE_CHECKING

from nicegui import background_tasks, run, ui

from cutvib_ss.effects.base import Model
from cutvib_ss.errors import CutvibError
from cutvib_ss.parameters import AbsorberParameters
from cutvib_ss.plot.style import unit_text
from cutvib_ss.web import curves, figures
from cutvib_ss.web.curves import Change, Controller, Curve
from cutvib_ss.web.session import Opened

if TYPE_CHECKING:
    from cutvib_ss.web.page import Page

_NONE = "none"
_START = 0.5
_PAUSE = 0.15
"""Time that a slider has to rest before the controller is evaluated over the rail [s]."""
_NEAR = 3
"""Records at the head's position that are drawn, at most."""


class ModelPanel:
    """Sliders, and beside them what they do to the response."""

    def __init__(self, page: Page, opened: Opened) -> None:
        self.page, self.opened = page, opened
        self.designed_at = _START
        self._asked = 0
        model = self.model
        self.band = curves.band_of(model, opened.summary.records)
        with ui.element("section").classes("card"):
            parts = "position, absorber, controller" if model.has_position else "absorber"
            ui.html(f"<h2>Model: {parts}</h2>", sanitize=False)
            with ui.element("div").classes("beside"):
                with ui.element("div").classes("sliders"):
                    self._build_choices(model)
                    self._build_absorber(model)
                    if model.has_position:
                        self._build_controller()
                with ui.element("div").classes("pictures"):
                    self.plot = ui.plotly({"data": [], "layout": {}}).classes("plot").props('data-plot="model"')
                    self.figures = ui.label().classes("facts-line").props('data-facts="model"')
                    if model.has_position:
                        self.rail = ui.plotly({"data": [], "layout": {}}).classes("plot").props('data-plot="rail"')
        self.draw()

    @property
    def model(self) -> Model:
        """The model that is tried out: the nominal or the corrected one."""
        corrected = self.page.session.corrected_machine()
        if corrected is not None and getattr(self, "which", None) is not None and self.which.value == "corrected":
            return corrected
        nominal: Model = self.opened.campaign.machine
        return nominal

    def corrected_is_there(self) -> None:
        """Offer the corrected model."""
        self.which.visible = self.page.session.corrected_machine() is not None

    def _build_choices(self, model: Model) -> None:
        channels = list(model.channels)
        self.which = ui.toggle({"nominal": "nominal", "corrected": "corrected"}, value="nominal", on_change=self.draw)
        self.which.props("no-caps dense")
        self.which.visible = self.page.session.corrected_machine() is not None
        self.channel = ui.select(channels, value=channels[0], label="channel", on_change=self.draw)
        self.position = None
        if model.has_position:
            self.position, _ = self._slider("position", "position of the head y/L", 0.01, 0.99, 0.01, _START)
        self.phase = ui.switch("phase", on_change=self.draw)

    def _build_absorber(self, model: Model) -> None:
        start = curves.default_absorber(model)
        self.absorber = ui.switch(f"absorber at {model.input_port}", on_change=self.draw)
        self.absorber.props('data-act="absorber"')
        low, high = (100.0, 350.0) if model.has_position else (self.band[0], self.band[1])
        with ui.element("div").classes("group").bind_visibility_from(self.absorber, "value"):
            self.frequency, _ = self._slider(
                "frequency",
                "frequency [Hz]",
                low,
                high,
                0.5 if high - low > 50 else (high - low) / 400,
                start.frequency,
            )
            self.mass, _ = self._slider(
                "mass", "mass [kg]", 0.1 * start.mass, 10 * start.mass, 0.05 * start.mass, start.mass
            )
            self.damping, _ = self._slider("damping", "damping ratio", 0.0, 0.3, 0.002, start.damping_ratio)

    def _build_controller(self) -> None:
        from cutvib_ss.control_design.prototypes import PROTOTYPES

        names = {_NONE: "none", **{p.name: p.about for p in PROTOTYPES.values()}}
        self.controller = ui.select(names, value=_NONE, label="controller", on_change=self._new_controller)
        self.controller.props('data-act="controller"')
        with ui.element("div").classes("group").bind_visibility_from(self.controller, "value", lambda v: v != _NONE):
            self.gain, _ = self._slider("gain", "gain, of its design's", 0.0, 3.0, 0.02, 1.0)
            self.design_note = ui.label().classes("soft")
            self.design_button = ui.button("Design at the present position", on_click=self._design_here)
            self.design_button.props('outline dense no-caps data-act="design"')

    def _slider(
        self, name: str, label: str, low: float, high: float, step: float, value: float
    ) -> tuple[ui.slider, ui.label]:
        with ui.element("div").classes("slider"):
            with ui.element("div").classes("slider-head"):
                ui.label(label)
                shown = ui.label().classes("value")
            slider = ui.slider(min=low, max=high, step=step, value=value, on_change=self.draw)
            slider.props(f'data-slider="{name}" aria-label="{label}"')
            shown.bind_text_from(slider, "value", lambda v: f"{v:.4g}")
        return slider, shown

    async def _new_controller(self) -> None:
        if self.controller.value == _NONE:
            self.draw()
            return
        await self._design(_START if self.position is None else self.designed_at)

    async def _design_here(self) -> None:
        await self._design(_START if self.position is None else float(self.position.value))

    async def _design(self, position: float) -> None:
        """Design off the page's own thread: some prototypes take seconds."""
        model, name = self.model, str(self.controller.value)
        assert model.rail is not None
        self.design_note.text = "designing …"
        try:
            await run.io_bound(curves.designed, model, name, position)
        except CutvibError as error:
            self.design_note.text = str(error)
            self.controller.value = _NONE
            return
        self.designed_at = position
        self.design_note.text = f"designed at y/L = {position:.2f}, without the absorber"
        self.draw()

    @property
    def width(self) -> int:
        """Width of the pictures [px]: beside the sliders, or under them."""
        whole = min(self.page.width, 1240)
        return whole - 350 if self.page.width > 760 else whole

    @property
    def change(self) -> Change:
        """What the sliders add to the model."""
        absorber = None
        if self.absorber.value:
            absorber = AbsorberParameters(
                float(self.frequency.value), float(self.damping.value), float(self.mass.value)
            )
        controller = None
        if self.model.has_position and self.controller.value != _NONE:
            controller = Controller(str(self.controller.value), float(self.gain.value), self.designed_at)
        return Change(absorber, self.model.input_port, controller)

    def draw(self) -> None:
        """Draw the model at the sliders' values."""
        model, output, dark = self.model, str(self.channel.value), self.page.dark
        position = None if self.position is None else float(self.position.value)
        begun = time.perf_counter()
        found = curves.modified(model, position, output, self.change, self.band)
        took = time.perf_counter() - begun
        mark = curves.WORKING_FREQUENCY if model.has_position else None
        self.plot.update_figure(
            figures.response_figure(
                [*found.curves, *self._measured_here(position, output)], dark=dark, width=self.width,
                title=f"{output} [{unit_text(found.curves[0].unit)}]", phase=bool(self.phase.value), mark=mark, span=self.band,
                revision=f"{output}{self.phase.value}",
            )
        )  # fmt: skip
        self.figures.text = _facts(found, mark, took)
        self.figures.classes(
            add="unstable" if found.stable is False else "", remove="" if found.stable is False else "unstable"
        )
        if model.rail is not None and position is not None:
            self._draw_rail(model, output, position, found.curves[-1])

    def _draw_rail(self, model: Model, output: str, position: float, last: Curve) -> None:
        """The response at the working frequency over the rail; the controlled one follows, which takes some tenths of a second."""
        change, frequency = self.change, curves.WORKING_FREQUENCY
        along = curves.along_the_rail(model, output, change, frequency)
        extra = curves.at_frequency(last, frequency) if last.kind == "controller" else None
        self._asked += 1
        asked = self._asked

        def show(more: list[Curve]) -> None:
            self.rail.update_figure(
                figures.rail_figure(
                    [*along, *more], position, dark=self.page.dark, width=self.width,
                    title=f"at {frequency:g} Hz [{unit_text(along[0].unit)}]", extra=None if extra is None else (extra, last.name),
                )
            )  # fmt: skip

        async def follow() -> None:
            await asyncio.sleep(_PAUSE)
            if asked != self._asked:
                return  # the slider has moved on
            controlled = await run.io_bound(curves.controlled_along_the_rail, model, output, change, frequency)
            if asked == self._asked and controlled is not None:
                show([controlled])

        show([])
        if change.controller is not None:
            background_tasks.create(follow(), name="controller over the rail")

    def _measured_here(self, position: float | None, output: str) -> list[Curve]:
        """Records that were taken where the head is."""
        summary = self.opened.summary
        near = [
            k
            for k, r in enumerate(summary.records)
            if r.input is None and (r.position is None or (position is not None and abs(r.position - position) < 0.006))
        ]
        found = curves.measured_curves(summary.frfs, summary.records, near[:_NEAR], output)
        # Colours that the model's own curves do not have.
        return [replace(c, colour=k + 3) for k, c in enumerate(found)]


def _facts(found: curves.Modified, mark: float | None, took: float) -> str:
    """Largest response and the one at the working frequency, curve by curve."""
    parts = []
    for c in found.curves:
        k = int(abs(c.data).argmax())
        text = f"{c.name}: peak {abs(c.data[k]):.3g} {unit_text(c.unit)} at {c.freq[k]:.1f} Hz"
        value = None if mark is None else curves.at_frequency(c, mark)
        parts.append(text if value is None else f"{text}, {value:.3g} at {mark:g} Hz")
    if found.stable is False:
        parts.append(f"the closed loop is UNSTABLE: it grows by e^({found.growth:.3g} t) at {found.growth_freq:.0f} Hz")
    return "; ".join(parts) + f". Computed in {1e3 * took:.0f} ms."
