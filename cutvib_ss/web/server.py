"""The server behind the page: its routes, the visitors' sessions, and how it starts and ends."""

from __future__ import annotations

import asyncio
import secrets
import shutil
import socket
import sys
import traceback
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from nicegui import app, run, ui
from starlette.datastructures import UploadFile
from starlette.exceptions import HTTPException
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response

from cutvib_ss.errors import ParameterError
from cutvib_ss.web.page import Page
from cutvib_ss.web.session import Refused, Session, server_folder
from cutvib_ss.web.uploads import MOST_BYTES, MOST_FILES
from cutvib_ss.web.worker import MACHINE, REPORT, RESULT

_STATIC = Path(__file__).parent / "static"
_ICON = (
    "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 32 32'><rect width='32' height='32' rx='6' fill='#1f6f8f'/>"
    "<path d='M4 18 L10 18 L14 6 L18 26 L22 14 L24 18 L28 18' fill='none' stroke='#fff' stroke-width='2.4'/></svg>"
)
_HEAD = '<link rel="stylesheet" href="/assets/page.css"><script src="/assets/page.js" defer></script>'
_TYPES = {REPORT: "text/html", RESULT: "application/json", MACHINE: "application/toml"}
_LOOPBACK = ("127.0.0.1", "localhost", "::1")
# Scripts and data from this server alone, whatever a library would like to fetch; the page's own library needs eval.
_POLICY = (
    "default-src 'self' 'unsafe-inline' 'unsafe-eval' data: blob:; connect-src 'self' ws: wss:; "
    "form-action 'self'; frame-ancestors 'self'; object-src 'none'; base-uri 'self'"
)


_KEPT = 12 * 3600.0
"""Time for which a visitor's campaign and diagnosis are kept after the last page was closed [s]."""
_SWEPT = 600.0
"""Time between looks for visitors who are gone [s]."""


class Server:
    """Visitors' sessions, by an unguessable name that only their page knows."""

    def __init__(self, campaign: Path | None = None) -> None:
        self.campaign = campaign
        self.folder = server_folder()
        self.sessions: dict[str, Session] = {}
        self._locks: dict[str, asyncio.Lock] = {}

    def session(self, name: str | None) -> Session:
        """A visitor's session, a new one where there is none of that name."""
        if name is not None and name in self.sessions:
            return self.sessions[name]
        made = Session(secrets.token_urlsafe(24), self.folder)
        self.sessions[made.name] = made
        self._locks[made.name] = asyncio.Lock()
        if self.campaign is not None:
            made.open_folder(self.campaign)
        return made

    def close(self) -> None:
        """End every diagnosis that runs, remove all files."""
        for session in self.sessions.values():
            session.close()
        self.sessions.clear()
        shutil.rmtree(self.folder, ignore_errors=True)

    def sweep(self, seconds: float = _KEPT) -> None:
        """Forget visitors who have been gone for so long, with their files."""
        for name in [n for n, s in self.sessions.items() if s.is_abandoned(seconds)]:
            self.sessions.pop(name).close()
            self._locks.pop(name, None)

    async def index(self) -> None:
        """The page of one visitor; a reload finds its campaign and diagnosis again."""
        await ui.context.client.connected()
        kept = app.storage.tab
        session = self.session(kept.get("session"))
        kept["session"] = session.name
        session.entered()
        ui.context.client.on_delete(session.gone)
        dark, width = await ui.run_javascript(
            "[matchMedia('(prefers-color-scheme: dark)').matches, innerWidth]", timeout=10.0
        )
        Page(session, bool(dark), int(width)).build()

    async def receive(self, name: str, request: Request) -> Response:
        """An upload: the campaign's title, or in one line why it cannot be used."""
        session = self.sessions.get(name)
        if session is None:
            return _refused("this page is from before the server's last start; load it again", 404)
        if int(request.headers.get("content-length") or 0) > MOST_BYTES:
            return _refused(f"the upload is larger than {MOST_BYTES >> 30} GB; upload fewer records", 413)
        try:
            async with request.form(max_files=MOST_FILES) as form:
                parts = [f for f in form.getlist("files") if isinstance(f, UploadFile)]
                files = [(unquote(f.filename or ""), f.file) for f in parts]
                async with self._locks[name]:
                    await run.io_bound(session.open_upload, files)
        except Refused as error:
            return _refused(str(error), 422)
        except HTTPException as error:
            return _refused(str(error.detail), error.status_code)
        except Exception as error:
            traceback.print_exc()
            told = " ".join(str(error).split())
            return _refused(f"a fault of the program, not of the input: {type(error).__name__}: {told}", 500)
        return JSONResponse({"error": ""})

    async def result(self, name: str, file: str, download: bool = False) -> Response:
        """A file of a diagnosis that is done."""
        session = self.sessions.get(name)
        path = session.result(file) if session is not None and file in _TYPES else None
        if path is None:
            return Response("There is no such result: the diagnosis was cancelled or another one begun.", 404)
        return FileResponse(
            path, media_type=_TYPES[file], filename=file if download else None, headers={"Cache-Control": "no-store"}
        )


def serve(host: str, port: int, show: bool, campaign: Path | None = None) -> None:
    """Serve the page until interrupted; port 0 takes any that is free."""
    port = _free_port(host, port)
    server = Server(campaign)
    ui.page("/", title="cutvib_ss", dark=None)(server.index)
    app.post("/upload/{name}", response_model=None)(server.receive)
    app.get("/result/{name}/{file}", response_model=None)(server.result)
    app.add_static_files("/assets", _STATIC)
    ui.add_head_html(_HEAD, shared=True)
    app.on_shutdown(server.close)
    app.timer(_SWEPT, server.sweep)
    app.middleware("http")(_only_from_here)
    if host in _LOOPBACK:
        # Another site's script cannot reach the page under a name of its own that it points at this machine.
        app.add_middleware(TrustedHostMiddleware, allowed_hosts=["localhost", "127.0.0.1"])
    shown = f"[{host}]" if ":" in host else host
    where = f"http://{'127.0.0.1' if host in ('0.0.0.0', '::') else shown}:{port}"
    app.on_startup(lambda: sys.stderr.write(f"cutvib: the page is at {where} (Ctrl-C ends it)\n"))
    ui.run(
        host=host, port=port, title="cutvib_ss", favicon=_ICON, show=show, reload=False, show_welcome_message=False,
        tailwind=False, reconnect_timeout=20.0, uvicorn_logging_level="warning",
    )  # fmt: skip


async def _only_from_here(request: Request, call_next: Any) -> Response:
    """Forbid the browser to load anything from elsewhere."""
    response: Response = await call_next(request)
    if not request.url.path.startswith("/result/"):
        response.headers["Content-Security-Policy"] = _POLICY
    response.headers["X-Content-Type-Options"] = "nosniff"
    response.headers["Referrer-Policy"] = "no-referrer"
    return response


def _refused(message: str, status: int) -> JSONResponse:
    return JSONResponse({"error": message}, status_code=status)


def _free_port(host: str, port: int) -> int:
    """The port, or any free one for 0; one that is taken is refused before anything starts."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        with socket.socket(family, socket.SOCK_STREAM) as probe:
            if sys.platform != "win32":
                probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind((host, port))
            return int(probe.getsockname()[1])
    except socket.gaierror as error:
        raise ParameterError(f"--host {host}: no address of this machine ({error.strerror})") from error
    except OSError as error:
        raise ParameterError(
            f"--host {host} --port {port}: cannot be used ({error.strerror}); choose another with --port"
        ) from error
