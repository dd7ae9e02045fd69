"""The page: header, campaign and measured responses; below them the model and the diagnosis."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from nicegui import events, run, ui

from cutvib_ss.plot.style import unit_text
from cutvib_ss.web import curves, figures
from cutvib_ss.web.diagnosis_panel import DiagnosisPanel
from cutvib_ss.web.model_panel import ModelPanel
from cutvib_ss.web.session import Opened, Session

_MANY = 6
"""Records that are drawn at first, at most."""
_SCHEMES = {"auto": "brightness_auto", "light": "light_mode", "dark": "dark_mode"}


class Page:
    """One visitor's page."""

    def __init__(self, session: Session, system_dark: bool, width: int) -> None:
        self.session = session
        self.width = width
        self.system_dark = system_dark
        self.scheme = "auto"
        self._redraws: list[Callable[[], None]] = []

    @property
    def dark(self) -> bool:
        """Whether the page is shown dark at present."""
        return self.system_dark if self.scheme == "auto" else self.scheme == "dark"

    def build(self) -> None:
        """Fill the page."""
        ui.colors(primary="#1f6f8f", negative="#b4552d", positive="#2f8560")
        self._mode = ui.dark_mode(None)
        ui.on("cutvib_uploaded", self._uploaded)
        ui.on("cutvib_scheme", self._system_scheme)
        ui.on("cutvib_width", self._new_width)
        with ui.element("header").classes("page-head"):
            ui.html("<b>cutvib_ss</b>", sanitize=False)
            self.title = ui.label().classes("page-title")
            self._scheme_button = ui.button(icon=_SCHEMES["auto"], on_click=self._next_scheme)
            self._scheme_button.props('flat round dense color=inherit aria-label="light or dark"')
        with ui.element("main").classes("page-main"):
            self._build_start()
            self.body = ui.element("div").classes("page-body")
        self.show()

    def _build_start(self) -> None:
        with ui.element("section").classes("card"):
            ui.html("<h2>Campaign</h2>", sanitize=False)
            ui.html(
                f'<div class="drop-zone" data-url="/upload/{self.session.name}"><p class="drop-note">Drop a campaign here: '
                "its folder, its files, or a zip of it.</p><p class='drop-picks'>"
                '<label class="pick">Choose files<input type="file" multiple data-pick="files"></label>'
                '<label class="pick">Choose a folder<input type="file" webkitdirectory data-pick="folder"></label></p></div>',
                sanitize=False,
            )
            with ui.element("div").classes("line"):
                self.demo_button = ui.button("Take the demonstration", on_click=self._take_demo)
                self.demo_button.props('outline no-caps data-act="demo"')
                self.busy = ui.spinner(size="1.6em")
                self.busy.visible = False
            self.error = ui.label().classes("error").props('role="alert"')
            self.error.visible = False

    def show(self) -> None:
        """The page of the campaign that is open."""
        opened = self.session.opened
        self.body.clear()
        self._redraws = []
        if opened is None:
            self.title.text = "vibration of a Cartesian cutting machine"
            return
        self.title.text = opened.campaign.title
        with self.body:
            self._measured = MeasuredPanel(self, opened)
            self._model = ModelPanel(self, opened)
            self._diagnosis = DiagnosisPanel(self, opened)
            self._redraws = [self._measured.draw, self._model.draw, self._diagnosis.recolour]

    def redraw(self) -> None:
        """Draw all pictures again: the corrected model has come, or the colours are others."""
        for draw in self._redraws:
            draw()

    def corrected_is_there(self) -> None:
        """Show the corrected model beside the nominal one."""
        self._model.corrected_is_there()
        self.redraw()

    def tell_error(self, message: str) -> None:
        """One line on what cannot be used; empty: nothing."""
        self.error.text = message
        self.error.visible = bool(message)

    async def _take_demo(self) -> None:
        self.tell_error("")
        self.busy.visible = True
        self.demo_button.disable()
        try:
            await run.io_bound(self.session.open_demo)
        finally:
            self.busy.visible = False
            self.demo_button.enable()
        self.show()

    def _uploaded(self, event: events.GenericEventArguments) -> None:
        told: dict[str, Any] = event.args if isinstance(event.args, dict) else {}
        error = str(told.get("error") or told.get("detail") or "")
        kept = self.session.opened
        self.tell_error(error + (f" (“{kept.campaign.title}” stays open)" if error and kept is not None else ""))
        if not error:
            self.show()

    def _next_scheme(self) -> None:
        names = list(_SCHEMES)
        self.scheme = names[(names.index(self.scheme) + 1) % len(names)]
        self._mode.value = None if self.scheme == "auto" else self.scheme == "dark"
        self._scheme_button.props(f"icon={_SCHEMES[self.scheme]}")
        self.redraw()

    def _system_scheme(self, event: events.GenericEventArguments) -> None:
        self.system_dark = bool(event.args.get("dark")) if isinstance(event.args, dict) else self.system_dark
        self.redraw()

    def _new_width(self, event: events.GenericEventArguments) -> None:
        self.width = int(event.args.get("width", self.width)) if isinstance(event.args, dict) else self.width
        self.redraw()


class MeasuredPanel:
    """The records: what they are, and their responses beside the model's."""

    def __init__(self, page: Page, opened: Opened) -> None:
        self.page, self.opened = page, opened
        summary = opened.summary
        with ui.element("section").classes("card"):
            ui.html("<h2>Measured responses</h2>", sanitize=False)
            for sentence in summary.sentences():
                ui.label(sentence)
            names = curves.labels_of(summary.records, summary.input_unit)
            with ui.element("div").classes("controls"):
                self.channel = ui.select(
                    opened.channels, value=opened.channels[0], label="channel", on_change=self.draw
                )
                self.records = ui.select(
                    dict(enumerate(names)), value=list(range(min(len(names), _MANY))), label="records",
                    multiple=True, on_change=self.draw,
                ).props("use-chips" if len(names) <= _MANY else "")  # fmt: skip
                with ui.element("div").classes("switches"):
                    self.nominal = ui.switch("nominal model", value=True, on_change=self.draw)
                    self.corrected = ui.switch("corrected model", value=True, on_change=self.draw)
                    self.phase = ui.switch("phase", on_change=self.draw)
                    self.coherence = ui.switch("coherence", on_change=self.draw)
            self.plot = ui.plotly(self._figure()).classes("plot").props('data-plot="measured"')
            ui.label("In a record's colour: dashed the nominal model, dotted the corrected one.").classes("soft")
            with ui.expansion("Records and what was noticed").classes("fold"):
                self._table()
                for warning in summary.warnings:
                    ui.label(warning).classes("warning")

    def draw(self) -> None:
        """Draw the responses that are chosen."""
        self.plot.update_figure(self._figure())

    def _figure(self) -> dict[str, Any]:
        opened, summary = self.opened, self.opened.summary
        chosen, output = [int(k) for k in self.records.value or []], str(self.channel.value)
        drawn = curves.measured_curves(summary.frfs, summary.records, chosen, output)
        unit = drawn[0].unit if drawn else ""
        corrected = self.page.session.corrected_machine()
        self.corrected.visible = corrected is not None
        for model, wanted, kind in (
            (opened.campaign.machine, self.nominal.value, "nominal"),
            (corrected, self.corrected.value, "corrected"),
        ):
            if wanted and model is not None and output in model.channels:
                drawn += curves.model_curves(model, opened.campaign, summary.records, chosen, output, kind)
        return figures.response_figure(
            drawn, dark=self.page.dark, width=self.page.width, title=f"{output} [{unit_text(unit)}]", phase=bool(self.phase.value),
            coherence=curves.coherence_curves(summary.frfs, summary.records, chosen, output) if self.coherence.value else (),
            span=curves.band_of(opened.campaign.machine, summary.records),
            revision=f"{output}{self.phase.value}{self.coherence.value}",
        )  # fmt: skip

    def _table(self) -> None:
        peak = f"peak [{self.opened.summary.input_unit}]"
        heads = ["record", "kind", "y/L", "use", "blows", peak, "lines [Hz]", "coherence"]
        rows = [
            {
                "record": r.name,
                "kind": r.kind,
                "y/L": "" if r.position is None else f"{r.position:g}",
                "use": r.use or "",
                "blows": str(r.blows),
                peak: r.level_text(),
                "lines [Hz]": r.lines_text(),
                "coherence": "" if r.coherence is None else f"{r.coherence:.3f}",
            }
            for r in self.opened.summary.records
        ]
        columns = [{"name": h, "label": h, "field": h, "align": "left"} for h in heads]
        ui.table(rows=rows, columns=columns, row_key="record").props("flat dense").classes("records")
