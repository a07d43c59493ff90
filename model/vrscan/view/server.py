"""The server of the page: for this machine alone, and for pages of its own alone.

It listens on 127.0.0.1. A request that names another host, as one does whose name was made to lead
here, and one that another site's page sends are refused, be they for a page, for a part of one or
for a websocket. No page may frame this one, and the page runs no script but its own.
"""

import logging
import secrets
import socket
from collections.abc import Callable
from functools import partial
from typing import Any
from urllib.parse import urlsplit

from bokeh.application import Application
from bokeh.application.handlers.function import FunctionHandler
from bokeh.document import Document
from bokeh.server.server import BaseServer
from bokeh.server.tornado import BokehTornado
from bokeh.settings import settings
from tornado.httpserver import HTTPServer
from tornado.httputil import HTTPHeaders, HTTPServerRequest
from tornado.ioloop import IOLoop
from tornado.web import ErrorHandler, OutputTransform, _HandlerDelegate

from vrscan.data.errors import InputError

ADDRESS = "127.0.0.1"
PING_S = 30.0  # between two pings; a browser that does not answer one until the next is let go
MOST_PAGES = 32
MOST_BYTES = 1 << 20  # of what a browser sends at once
NONCE_BYTES = 16
# Bokeh puts styles into its elements. The scripts are the server's files, and those in the page
# that have the response's own number.
POLICY = "; ".join(
    (
        "default-src 'none'",
        "script-src 'self' 'nonce-{nonce}'",
        "style-src 'self' 'unsafe-inline'",
        "img-src 'self' data: blob:",
        "connect-src 'self' {sockets}",
        *(f"{what} 'none'" for what in ("frame-ancestors", "base-uri", "form-action")),
    )
)
HEADERS = {
    "X-Frame-Options": "DENY",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
}


class _Headers(OutputTransform):
    """Puts the headers into every response, and a number of its own into those with a page.

    Args:
        request: Request that is answered.
        mark: Text in a page that becomes its number, as long as that.
        hosts: Names under which the page is served.
    """

    def __init__(self, request: HTTPServerRequest, *, mark: str, hosts: tuple[str, ...]) -> None:
        self._mark, self._hosts = mark, hosts

    def transform_first_chunk(
        self, status_code: int, headers: HTTPHeaders, chunk: bytes, finishing: bool
    ) -> tuple[int, HTTPHeaders, bytes]:
        nonce = secrets.token_urlsafe(NONCE_BYTES)
        sockets = " ".join(f"ws://{host}" for host in self._hosts)
        headers["Content-Security-Policy"] = POLICY.format(nonce=nonce, sockets=sockets)
        for name, value in HEADERS.items():
            headers[name] = value
        if headers.get("Content-Type", "").startswith("text/html"):
            headers["Cache-Control"] = "no-store"
            headers.pop("Etag", None)  # of the page without its number
            chunk = chunk.replace(self._mark.encode(), nonce.encode())
        return status_code, headers, chunk


class _Guarded(BokehTornado):
    """An application that serves no other host and no other site, and the page alone."""

    hosts: tuple[str, ...] = ()

    def find_handler(self, request: HTTPServerRequest, **more: Any) -> _HandlerDelegate:
        if not self._for_us(request):
            status = 403
        elif request.path == "/" and len(self.get_sessions("/")) >= MOST_PAGES:
            status = 503
        elif request.path not in ("/", "/ws", "/favicon.ico") and not _is_file(request.path):
            status = 404
        else:
            return super().find_handler(request, **more)
        return self.get_handler_delegate(request, ErrorHandler, {"status_code": status})

    def _for_us(self, request: HTTPServerRequest) -> bool:
        """Return whether a request comes from a page of ours, or from the person at the browser."""
        headers = request.headers
        named = [request.host, *(urlsplit(each).netloc for each in headers.get_list("Origin"))]
        if not set(named) <= set(self.hosts):
            return False
        # Nobody is led into a session that somebody else has opened.
        if request.query_arguments.keys() & {"bokeh-session-id", "bokeh-token"}:
            return False
        if "Bokeh-Session-Id" in headers:
            return False
        # Another site may lead here, and nothing else: no frame, no part of its page.
        led = headers.get("Sec-Fetch-Mode") == "navigate"
        led = led and headers.get("Sec-Fetch-Dest") == "document"
        return led or headers.get("Sec-Fetch-Site", "none") in ("none", "same-origin")


def _is_file(path: str) -> bool:
    return path.startswith("/static/")


def serve(make: Callable[[Document], None], port: int) -> tuple[BaseServer, str]:
    """Start the server in this thread's loop.

    Args:
        make: Fills the document of each page that is opened. A script in its template may run
            with the template's variable ``nonce``.
        port: Port to listen on; 0 for any that is free.

    Returns:
        The server and its URL.

    Raises:
        InputError: if the port is in use.
    """
    logging.getLogger("bokeh").setLevel(logging.ERROR)  # it tells of pages that are closed
    settings.resources = "server"  # never from the internet
    listening = socket.socket()
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((ADDRESS, port))
    except OSError as error:
        listening.close()
        raise InputError(f"--http-port: {port}: cannot listen ({error.strerror})") from error
    listening.listen()
    listening.setblocking(False)
    port = listening.getsockname()[1]
    hosts = f"{ADDRESS}:{port}", f"localhost:{port}"
    mark = secrets.token_urlsafe(NONCE_BYTES)

    def fill(document: Document) -> None:
        make(document)
        document.template_variables["nonce"] = mark

    application = _Guarded(
        Application(FunctionHandler(fill)),
        extra_websocket_origins=list(hosts),
        absolute_url=f"http://{ADDRESS}:{port}/",
        keep_alive_milliseconds=10_000,
        unused_session_lifetime_milliseconds=10_000,
        websocket_max_message_size_bytes=MOST_BYTES,
        websocket_ping_interval=PING_S,
        websocket_ping_timeout=PING_S,
        sign_sessions=True,  # a websocket is for who was given a page
        secret_key=secrets.token_bytes(32),
    )
    application.hosts = hosts
    headers: Any = partial(_Headers, mark=mark, hosts=hosts)
    application.add_transform(headers)
    http = HTTPServer(application, max_buffer_size=MOST_BYTES, max_body_size=MOST_BYTES)
    http.add_socket(listening)
    server = BaseServer(IOLoop.current(), application, http)
    server.start()
    return server, f"http://{ADDRESS}:{port}/"
