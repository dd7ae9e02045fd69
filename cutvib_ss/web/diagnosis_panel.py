"""The diagnosis on the page: started, followed, cancelled; its report read and its results downloaded."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from nicegui import ui

from cutvib_ss.web.session import Opened, Refused
from cutvib_ss.web.worker import MACHINE, REPORT, RESULT

if TYPE_CHECKING:
    from cutvib_ss.web.page import Page

_PERIOD = 0.5
_LAST = 60
_DOWNLOADS = (("Report (HTML)", REPORT), ("Results (JSON)", RESULT), ("Corrected machine (TOML)", MACHINE))


class DiagnosisPanel:
    """Start, progress, cancel, outcome."""

    def __init__(self, page: Page, opened: Opened) -> None:
        self.page, self.opened = page, opened
        self._told = 0
        with ui.element("section").classes("card"):
            ui.html("<h2>Diagnosis</h2>", sanitize=False)
            ui.label("Where model and measurement differ, which cause explains it, and how much of the gap it closes.")
            with ui.element("div").classes("line"):
                self.start = ui.button("Diagnose", on_click=self._start).props('no-caps data-act="diagnose"')
                self.cancel = ui.button("Cancel", on_click=self._cancel).props('outline no-caps data-act="cancel"')
                self.spinner = ui.spinner(size="1.6em")
                self.clock = ui.label().classes("clock").props('role="status"')
            with ui.expansion("Settings").classes("fold"), ui.element("div").classes("controls"):
                most = os.cpu_count() or 1
                self.jobs = ui.number("processes", value=1, min=1, max=most, step=1, precision=0)
                self.seed = ui.number("seed", value=0, min=0, step=1, precision=0)
            self.log = ui.log(max_lines=_LAST).classes("progress").props('aria-label="progress"')
            self.error = ui.label().classes("error").props('role="alert"')
            self.outcome = ui.element("div").classes("outcome")
            self.timer = ui.timer(_PERIOD, self.poll)
        self.poll()

    @property
    def _theme(self) -> str:
        return "dark" if self.page.dark else "light"

    def recolour(self) -> None:
        """Tell the report in its frame that the page has turned light or dark."""
        told = f"contentWindow.postMessage({{theme: '{self._theme}'}}, location.origin)"
        ui.run_javascript(f"document.querySelectorAll('iframe.report').forEach(frame => frame.{told})")

    def _start(self) -> None:
        self.log.clear()
        self._told = 0
        try:
            self.page.session.diagnose(int(self.seed.value or 0), int(self.jobs.value or 1))
        except Refused as error:
            self._show_error(str(error))
        self.page.corrected_is_there()
        self.poll()

    def _cancel(self) -> None:
        if self.page.session.job is not None:
            self.page.session.job.cancel()
        self.poll()

    def poll(self) -> None:
        """Show how far the diagnosis is."""
        job = self.page.session.job
        state = None if job is None else job.state
        running = state == "running"
        self.timer.active = running
        self.start.set_visibility(not running)
        for element in (self.cancel, self.spinner):
            element.set_visibility(running)
        self.log.set_visibility(job is not None)
        self._show_error("")
        if job is None:
            self.clock.text = ""
            self.outcome.clear()
            return
        for line in job.lines[self._told :]:
            self.log.push(f"{line.seconds:6.1f} s  {line.text}")
        self._told = len(job.lines)
        at = job.lines[-1].text if job.lines and running else ""
        words = {"running": "", "done": "Done after ", "failed": "Ended after ", "cancelled": "Cancelled after "}
        self.clock.text = f"{words[state or 'running']}{job.seconds:.0f} s{': ' + at if at else ''}"
        if state == "failed":
            self._show_error(job.error)
        self._show_outcome(state)

    def _show_error(self, message: str) -> None:
        self.error.text = message
        self.error.set_visibility(bool(message))

    def _show_outcome(self, state: str | None) -> None:
        job = self.page.session.job
        self.outcome.clear()
        if state != "done" or job is None:
            return
        address = f"/result/{self.page.session.name}"
        with self.outcome:
            with ui.element("div").classes(f"verdict {job.outcome['verdict']}").props('data-verdict=""'):
                ui.label(job.outcome["title"]).classes("verdict-title")
                ui.label(job.outcome["sentence"])
            for warning in job.outcome["warnings"]:
                ui.label(warning).classes("warning")
            with ui.element("div").classes("line"):
                for text, file in _DOWNLOADS:
                    link = ui.link(text, f"{address}/{file}?download=true").classes("download")
                    link.props(f'download="{file}" data-file="{file}"')
                ui.link("Open the report alone", f"{address}/{REPORT}", new_tab=True)
            # Changed for every diagnosis: a frame of the same address would not load again.
            ui.element("iframe").classes("report").props(
                f'src="{address}/{REPORT}?started={id(job)}&theme={self._theme}" title="Report of the diagnosis"'
            )
        if self.page.session.corrected is None:
            self.page.corrected_is_there()
