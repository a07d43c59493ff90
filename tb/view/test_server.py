"""Who is served: this machine's pages, and nobody who came by another name or from another site."""

import asyncio
import contextlib
import http.client
from collections.abc import Callable
from pathlib import Path

import pytest
from bokeh.document import Document
from bokeh.models.widgets.markups import Div
from tornado.httpclient import HTTPClientError, HTTPRequest
from tornado.websocket import websocket_connect

from vrscan.data.errors import InputError
from vrscan.view import server


def small(document: Document) -> None:
    document.add_root(Div(text="here", name="here"))


def while_served(ask: Callable[[int], object]) -> object:
    """Return what a function of the port gives while the server runs."""

    async def run() -> object:
        served, url = server.serve(small, 0)
        try:
            return await asyncio.to_thread(ask, int(url.rstrip("/").rpartition(":")[2]))
        finally:
            served.stop()

    return asyncio.run(run())


PATHS = ["/", "/static/js/bokeh.min.js", "/nothing"]
FOREIGN = [
    {"Host": "evil.example:{port}"},
    {"Host": "127.0.0.1.evil.example:{port}"},
    {"Host": "127.0.0.1"},  # another port
    {"Host": "127.0.0.1:{port}", "Origin": "http://evil.example"},
    {"Host": "127.0.0.1:{port}", "Origin": "http://evil.example:{port}"},
    {"Host": "localhost:{port}", "Origin": "null"},
]


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("headers", FOREIGN)
def test_other_hosts_and_sites_get_nothing(path: str, headers: dict[str, str]) -> None:
    def ask(port: int) -> int:
        line = http.client.HTTPConnection("127.0.0.1", port, timeout=10.0)
        line.request("GET", path, headers={k: v.format(port=port) for k, v in headers.items()})
        return line.getresponse().status

    assert while_served(ask) == 403


@pytest.mark.parametrize("name", ["127.0.0.1", "localhost"])
def test_this_machine_gets_the_page_and_all_that_it_needs_from_here(name: str) -> None:
    def ask(port: int) -> str:
        line = http.client.HTTPConnection("127.0.0.1", port, timeout=10.0)
        line.request("GET", "/", headers={"Host": f"{name}:{port}"})
        answer = line.getresponse()
        assert answer.status == 200
        return answer.read().decode()

    page = str(while_served(ask))
    assert "static/js/bokeh.min.js" in page
    assert "//cdn." not in page


@pytest.mark.parametrize(
    ("host", "origin", "status"),
    [
        ("127.0.0.1:{port}", "http://evil.example", 403),
        ("evil.example:{port}", "http://evil.example:{port}", 403),
        ("127.0.0.1:{port}", "http://127.0.0.1:{port}", None),
    ],
)
def test_a_websocket_is_for_our_own_pages(host: str, origin: str, status: int | None) -> None:
    def ask(port: int) -> int | None:
        async def connect() -> int | None:
            headers = {"Host": host.format(port=port), "Origin": origin.format(port=port)}
            headers["Sec-WebSocket-Protocol"] = "bokeh, no-token"
            request = HTTPRequest(f"ws://127.0.0.1:{port}/ws", headers=headers)
            try:
                socket = await websocket_connect(request)
            except HTTPClientError as error:
                return error.code
            socket.close()
            return None

        return asyncio.run(connect())

    assert while_served(ask) == status


def test_only_this_machine_is_listened_to() -> None:
    def ask(port: int) -> list[str]:
        rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
        rows6: list[list[str]] = []
        with contextlib.suppress(FileNotFoundError):
            rows6 = [line.split() for line in Path("/proc/net/tcp6").read_text().splitlines()[1:]]
        ours = [row[1] for row in rows + rows6 if row[1].endswith(f":{port:04X}")]
        return [each for each in ours if not each.startswith("0100007F:")]

    assert while_served(ask) == []


def test_a_port_in_use_is_told() -> None:
    def ask(port: int) -> str:
        with pytest.raises(InputError) as error:
            server.serve(small, port)
        return str(error.value)

    assert "cannot listen (Address already in use)" in str(while_served(ask))
