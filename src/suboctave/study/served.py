"""Pages on the loopback address: that of a results file, and that of a run which fills as things are found.

Only this machine reaches them: the server listens at 127.0.0.1, at a free port, and refuses requests that name another
host, as those of a foreign page that has had its name point here. It knows one page and changes nothing.
"""

from __future__ import annotations

import os
import sys
import threading
import webbrowser
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

LOOPBACK = "127.0.0.1"
_HEADERS = {
    "Content-Type": "text/html; charset=utf-8",
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}


@contextmanager
def served(page: Callable[[], str]) -> Iterator[str]:
    """The address at which a page is served; `page` gives its text at every request, from another thread."""

    class Handler(BaseHTTPRequestHandler):
        server_version, sys_version = "suboctave", ""

        def do_GET(self) -> None:
            """The page, at the one place where it is."""
            port = server.server_port
            if self.headers.get("Host") not in (f"{LOOPBACK}:{port}", f"localhost:{port}"):
                self.send_error(HTTPStatus.FORBIDDEN, "this page is for this machine alone")
            elif self.path.partition("?")[0] != "/":
                self.send_error(HTTPStatus.NOT_FOUND)
            else:
                text = page().encode("utf-8")
                self.send_response(HTTPStatus.OK)
                for name, value in {**_HEADERS, "Content-Length": str(len(text))}.items():
                    self.send_header(name, value)
                self.end_headers()
                self.wfile.write(text)

        def log_message(self, *_: Any) -> None:
            """Nothing: the terminal is for the run."""

        def handle(self) -> None:
            """A reader who leaves before the end is no error."""
            try:
                super().handle()
            except ConnectionError:
                self.close_connection = True

    with ThreadingHTTPServer((LOOPBACK, 0), Handler) as server:
        server.daemon_threads = True
        thread = threading.Thread(target=server.serve_forever, name="page", daemon=True)
        thread.start()
        try:
            yield f"http://{LOOPBACK}:{server.server_port}/"
        finally:
            server.shutdown()
            thread.join()


def show_in_browser(address: str) -> bool:
    """Open an address where there is a screen to show it on; whether that was tried."""
    there = sys.platform in ("darwin", "win32") or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    return bool(there) and webbrowser.open(address)


def wait_for_ctrl_c() -> None:
    """Until the reader ends it."""
    try:
        threading.Event().wait()
    except KeyboardInterrupt:
        return
