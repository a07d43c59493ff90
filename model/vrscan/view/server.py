"""The server of the page: for this machine alone, and for pages of its own alone.

It listens on 127.0.0.1. A request that names another host, as one does whose name was made to lead
here, and one that another site's page sends are refused, be they for a page or for a websocket.
"""

import logging
import socket
from collections.abc import Callable
from typing import Any
from urllib.parse import urlsplit

from bokeh.application import Application
from bokeh.application.handlers.function import FunctionHandler
from bokeh.document import Document
from bokeh.server.server import BaseServer
from bokeh.server.tornado import BokehTornado
from bokeh.settings import settings
from tornado.httpserver import HTTPServer
from tornado.httputil import HTTPServerRequest
from tornado.ioloop import IOLoop
from tornado.web import ErrorHandler, _HandlerDelegate

from vrscan.data.errors import InputError

ADDRESS = "127.0.0.1"


class _Guarded(BokehTornado):
    """An application that serves no other host and no other site."""

    hosts: tuple[str, ...] = ()

    def find_handler(self, request: HTTPServerRequest, **more: Any) -> _HandlerDelegate:
        origins = request.headers.get_list("Origin")
        named = [request.host, *(urlsplit(origin).netloc for origin in origins)]
        if not set(named) <= set(self.hosts):
            return self.get_handler_delegate(request, ErrorHandler, {"status_code": 403})
        return super().find_handler(request, **more)


def serve(make: Callable[[Document], None], port: int) -> tuple[BaseServer, str]:
    """Start the server in this thread's loop.

    Args:
        make: Fills the document of each page that is opened.
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
    application = _Guarded(
        Application(FunctionHandler(make)),
        extra_websocket_origins=list(hosts),
        absolute_url=f"http://{ADDRESS}:{port}/",
        keep_alive_milliseconds=10_000,
        unused_session_lifetime_milliseconds=10_000,
    )
    application.hosts = hosts
    http = HTTPServer(application)
    http.add_socket(listening)
    server = BaseServer(IOLoop.current(), application, http)
    server.start()
    return server, f"http://{ADDRESS}:{port}/"
