"""Who is served: this machine's pages, and nobody who came by another name or from another site."""

import asyncio
import contextlib
import gc
import html
import http.client
import json
import re
import socket
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numpy as np
import pytest
from bokeh.document import Document
from bokeh.models.widgets.markups import Div
from random_records import random_records
from tornado.httpclient import HTTPClientError, HTTPRequest
from tornado.iostream import IOStream
from tornado.websocket import WebSocketClientConnection, websocket_connect

from vrscan.data import records
from vrscan.data.errors import InputError
from vrscan.data.points import table
from vrscan.view import page, server
from vrscan.view.live import LiveSource, Options
from vrscan.view.word import is_word, new_word

Result = TypeVar("Result")
PATIENCE_S = 60.0


def small(document: Document) -> None:
    document.add_root(Div(text="here", name="here"))


def while_served(ask: Callable[[int], Result], make: Callable[[Document], None] = small) -> Result:
    """Return what a function of the port gives while the server runs."""

    async def run() -> Result:
        served, url = server.serve(make, 0)
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
    # What a browser says of a frame, and of parts that another site's page wants of ours.
    *(
        {
            "Host": "127.0.0.1:{port}",
            "Sec-Fetch-Site": site,
            "Sec-Fetch-Mode": mode,
            "Sec-Fetch-Dest": what,
        }
        for site in ("cross-site", "same-site")  # another port of this machine
        for mode, what in (("navigate", "iframe"), ("no-cors", "script"), ("websocket", "empty"))
    ),
    {"Host": "127.0.0.1:{port}", "Bokeh-Session-Id": "of-somebody-else"},
]


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("headers", FOREIGN)
def test_other_hosts_and_sites_get_nothing(path: str, headers: dict[str, str]) -> None:
    def ask(port: int) -> int:
        line = http.client.HTTPConnection("127.0.0.1", port, timeout=PATIENCE_S)
        line.request("GET", path, headers={k: v.format(port=port) for k, v in headers.items()})
        return line.getresponse().status

    assert while_served(ask) == 403


def ask_for(path: str, **headers: str) -> tuple[int, dict[str, str], str]:
    """Return status, headers and text of a response."""

    def ask(port: int) -> tuple[int, dict[str, str], str]:
        line = http.client.HTTPConnection("127.0.0.1", port, timeout=PATIENCE_S)
        line.request("GET", path, headers=headers)
        answer = line.getresponse()
        return answer.status, dict(answer.getheaders()), answer.read().decode()

    return while_served(ask)


@pytest.mark.parametrize(
    ("path", "headers", "status"),
    [
        ("/", {}, 200),
        ("/", {"Sec-Fetch-Site": "none"}, 200),
        (
            "/",
            {
                "Sec-Fetch-Site": "cross-site",
                "Sec-Fetch-Mode": "navigate",
                "Sec-Fetch-Dest": "document",
            },
            200,
        ),
        ("/static/js/bokeh.min.js", {"Sec-Fetch-Site": "same-origin"}, 200),
        ("/?bokeh-session-id=of-somebody-else", {}, 403),
        ("/?bokeh-token=of-somebody-else", {}, 403),
        ("/", {"Origin": "http://evil.example"}, 403),
        ("/autoload.js?bokeh-autoload-element=1", {}, 404),
        ("/metadata", {}, 404),
        ("/nothing", {}, 404),
        ("/ws", {}, 400),
        ("/static/../page.py", {}, 403),
    ],
)
def test_no_response_may_be_framed(path: str, headers: dict[str, str], status: int) -> None:
    got, found, _ = ask_for(path, **headers)
    assert got == status
    assert found["X-Frame-Options"] == "DENY"
    rules = dict(rule.split(" ", 1) for rule in found["Content-Security-Policy"].split("; "))
    assert rules["frame-ancestors"] == rules["default-src"] == rules["base-uri"] == "'none'"
    assert "unsafe" not in rules["script-src"]
    for name in ("Cross-Origin-Opener-Policy", "Cross-Origin-Resource-Policy"):
        assert found[name] == "same-origin"
    assert "Access-Control-Allow-Origin" not in found


def test_scripts_in_a_page_have_a_number_that_no_other_page_has() -> None:
    numbers = set()
    for _ in range(2):
        _, headers, _ = ask_for("/")
        (number,) = re.findall(r"'nonce-([^']+)'", headers["Content-Security-Policy"])
        numbers.add(number)
    assert len(numbers) == 2


@pytest.mark.parametrize("name", ["127.0.0.1", "localhost"])
def test_this_machine_gets_the_page_and_all_that_it_needs_from_here(name: str) -> None:
    def ask(port: int) -> str:
        line = http.client.HTTPConnection("127.0.0.1", port, timeout=PATIENCE_S)
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


def test_names_with_markup_are_text(tmp_path: Path) -> None:
    name = """<script>hit()</script><img src=x onerror="hit()">&'{{ 7 }}"""
    source = LiveSource(Options(name))
    source.happened(name)

    def make(document: Document) -> None:
        page.make(document, source, tmp_path)

    def ask(port: int) -> str:
        line = http.client.HTTPConnection("127.0.0.1", port, timeout=PATIENCE_S)
        line.request("GET", "/")
        return line.getresponse().read().decode()

    shown = html.escape(name)
    text = while_served(ask, make)
    assert f"<title>VR-SCAN: {shown}</title>" in text.replace("&#34;", "&quot;").replace(
        "&#39;", "&#x27;"
    )
    assert "<script>hit" not in text and "<img" not in text
    whole = page._Page(Document(), source, tmp_path, None)
    whole.update()
    for div in (whole._state, whole._events):
        assert shown in div.text and "<img" not in div.text


def test_the_word_is_long_and_each_is_another_one() -> None:
    words = {new_word() for _ in range(100)}
    assert len(words) == 100
    for word in words:
        assert len(word.replace("-", "")) == 10
        assert is_word(f" {word.upper().replace('-', ' ')} ", word)
        assert not is_word("", word) and not is_word(word[:-1], word) and not is_word("ä", word)


def token_of(port: int) -> str:
    """Return the token of a page, with which its websocket is opened."""
    line = http.client.HTTPConnection("127.0.0.1", port, timeout=PATIENCE_S)
    line.request("GET", "/")
    (token,) = re.findall(r'"token":"([^"]+)"', line.getresponse().read().decode())
    return str(token)


def waiting_bytes() -> int:
    """Return what all connections of this process still have to send."""
    streams = [each for each in gc.get_objects() if isinstance(each, IOStream)]
    return sum(len(each._write_buffer or b"") for each in streams)


def test_a_browser_that_does_not_read_is_let_go_and_holds_nobody_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is sent no more than what one update has, and the others go on."""
    monkeypatch.setattr(server, "PING_S", 2.0)
    monkeypatch.setattr(page, "PATIENCE_S", 0.0)  # as if each update had been drawn
    source = LiveSource(Options(str(tmp_path / "port")))
    points = table(records.points(random_records(np.random.default_rng(1), range(2000))))

    def make(document: Document) -> None:
        page.make(document, source, tmp_path)

    def open_and_not_read(port: int) -> socket.socket:
        line = socket.socket()
        line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        line.connect(("127.0.0.1", port))
        words = (
            f"GET /ws HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\n"
            f"Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
            f"Sec-WebSocket-Key: {'A' * 22}==\r\n"
            f"Sec-WebSocket-Protocol: bokeh, {token_of(port)}\r\n\r\n"
        )
        line.sendall(words.encode())
        return line

    def ask(port: int) -> int:
        async def look() -> int:
            stuck = await asyncio.to_thread(open_and_not_read, port)
            token = await asyncio.to_thread(token_of, port)
            headers = {"Sec-WebSocket-Protocol": f"bokeh, {token}"}
            url = f"ws://127.0.0.1:{port}/ws"
            reads: WebSocketClientConnection = await websocket_connect(
                HTTPRequest(url, headers=headers)
            )
            for _ in range(3):  # the parts of its first message
                await reads.read_message()
            pull = {"msgid": "1", "msgtype": "PULL-DOC-REQ"}
            for part in (pull, {}, {}):
                await reads.write_message(json.dumps(part))
            updates: list[str] = []

            async def read() -> None:
                while (got := await reads.read_message()) is not None:
                    updates.extend([got] if isinstance(got, str) and "PATCH-DOC" in got else [])

            reading = asyncio.create_task(read())
            begin, most = time.monotonic(), 0
            while (gone := len(open_connections(port)) < 2) is False or len(updates) < 5:
                assert time.monotonic() < begin + PATIENCE_S, f"gone: {gone}, {len(updates)}"
                source.display.take(points)
                await asyncio.sleep(0.1)
                most = max(most, waiting_bytes())
            reading.cancel()
            reads.close()
            stuck.close()
            return most

        return asyncio.run(look())

    most = while_served(ask, make)
    print(f"{most} bytes waited at most")
    assert most < 2_000_000


def open_connections(port: int) -> list[str]:
    """Return the connections that the server has open."""
    rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    here = f"0100007F:{port:04X}"
    return [row[2] for row in rows if row[1] == here and row[3] == "01"]
