"""Who may ask the page, tried with raw sockets; and that it does not grow, whoever asks and however often."""

import base64
import json
import re
import socket
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from bokeh.util.token import generate_jwt_token, generate_session_id

from study import cli

MODEL = "name: rig\nterms:\n  - inertia\n  - linear_damping\n  - linear_stiffness\n"
TRUE = (
    "terms:\n  - {term: inertia, value: 1.0}\n  - {term: linear_damping, value: 3.77}\n"
    "  - {term: linear_stiffness, value: 355.3}\n"
)
GROWTH = 50e6  # bytes
REQUESTS, SOCKETS = 2000, 50
PATIENCE = 60.0  # seconds for an answer, on a machine that has other work


@dataclass(frozen=True)
class Served:
    process: int
    port: int
    errors: Path

    def answer(self, path: str = "/", *headers: str, host: str | None = None, method: str = "GET") -> bytes:
        """All that comes back over a socket of its own."""
        lines = [
            f"{method} {path} HTTP/1.1",
            f"Host: {host or f'127.0.0.1:{self.port}'}",
            *headers,
            "Connection: close",
        ]
        return self.sent("\r\n".join([*lines, "", ""]).encode())

    def sent(self, request: bytes) -> bytes:
        with socket.create_connection(("127.0.0.1", self.port), PATIENCE) as connection:
            connection.sendall(request)
            return b"".join(iter(lambda: connection.recv(65536), b""))

    def token(self) -> str:
        """The token of a page that is fetched as a browser does."""
        return token_in(self.answer())

    def opened(self, token: str, *headers: str, host: str | None = None) -> tuple[socket.socket, bytes]:
        """A socket asked for with a token, and the first line of the answer."""
        key = base64.b64encode(b"0123456789abcdef").decode()
        lines = [
            "GET /ws HTTP/1.1", f"Host: {host or f'127.0.0.1:{self.port}'}", "Upgrade: websocket",
            "Connection: Upgrade", f"Sec-WebSocket-Key: {key}", "Sec-WebSocket-Version: 13",
            f"Sec-WebSocket-Protocol: bokeh, {token}", *headers,
        ]  # fmt: skip
        connection = socket.create_connection(("127.0.0.1", self.port), PATIENCE)
        connection.sendall("\r\n".join([*lines, "", ""]).encode())
        return connection, connection.recv(65536).split(b"\r\n", 1)[0]

    def memory(self) -> float:
        """Resident bytes."""
        text = Path(f"/proc/{self.process}/status").read_text()
        return 1024.0 * int(re.search(r"VmRSS:\s+(\d+)", text)[1])  # type: ignore[index]


def token_in(answer: bytes) -> str:
    """The token that a page carries."""
    found = re.search(rb'"token":"([^"]+)"', answer)
    assert found
    return found[1].decode()


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory, exploring: Any) -> Iterator[Served]:
    folder = tmp_path_factory.mktemp("guard")
    (folder / "true.yaml").write_text(TRUE)
    (folder / "rig.yaml").write_text(MODEL)
    assert cli.main(["simulate", str(folder / "true.yaml"), "--samples", "1000", "--out", str(folder / "rig.csv")]) == 0
    with exploring(folder, "rig.csv", "rig.yaml", "--no-measurement") as running:
        yield Served(running.process, running.port, running.errors)
    errors = running.errors
    said = errors.read_text().splitlines()  # no traceback, and nothing of what was refused
    assert len(said) <= 2, said
    assert all(line.startswith("study: ") and "message" in line for line in said)


def status(answer: bytes) -> int:
    return int(answer.split()[1])


@pytest.mark.parametrize("name", ["127.0.0.1", "localhost", "[::1]", "LOCALHOST"])
def test_the_pages_own_names_get_it(served: Served, name: str) -> None:
    answer = served.answer(host=f"{name}:{served.port}")
    assert status(answer) == 200
    connection, line = served.opened(
        token_in(answer), f"Origin: http://{name}:{served.port}", host=f"{name}:{served.port}"
    )
    with connection:
        assert line == b"HTTP/1.1 101 Switching Protocols"


@pytest.mark.parametrize(
    "path", ["/", "/ws", "/static/js/bokeh.min.js", "/autoload.js", "/metadata", "/favicon.ico", "/x"]
)
@pytest.mark.parametrize(
    "host",
    ["evil.example:{}", "127.0.0.1", "127.0.0.1:1", "127.0.0.1.evil.example:{}", "localhost.:{}", "a@localhost:{}"],
)
def test_any_other_name_gets_nothing(served: Served, path: str, host: str) -> None:
    named = host.format(served.port)
    for origin in ((), (f"Origin: http://{named}",), ("Sec-Fetch-Site: same-origin",)):
        answer = served.answer(path, *origin, host=named)
        assert status(answer) in (400, 403)
        assert b"token" not in answer
        assert len(answer) < 1000


@pytest.mark.parametrize("lines", ["GET / HTTP/1.0", "GET / HTTP/1.1", "GET / HTTP/1.1\r\nHost:"])
def test_no_name_gets_nothing(served: Served, lines: str) -> None:
    answer = served.sent(f"{lines}\r\nConnection: close\r\n\r\n".encode())
    assert status(answer) in (400, 403)
    assert b"token" not in answer


def test_two_names_get_nothing(served: Served) -> None:
    answer = served.answer("/", "Host: evil.example")
    assert status(answer) in (400, 403)


@pytest.fixture(scope="module")
def token(served: Served) -> str:
    """A good one: who else holds it is refused for what they are, not for what they hold."""
    return served.token()


@pytest.mark.parametrize("origin", ["http://evil.example:{}", "null", "https://127.0.0.1:{}", "http://127.0.0.1:1", ""])
def test_a_page_of_another_origin_opens_no_socket(served: Served, token: str, origin: str) -> None:
    named = origin.format(served.port)
    for headers in ((), ("Sec-Fetch-Site: same-origin",)):
        for host in (None, named.removeprefix("http://") or None):
            connection, line = served.opened(token, f"Origin: {named}", *headers, host=host)
            with connection:
                assert status(line) in (400, 403)


def test_that_token_opens_one_for_its_own_page(served: Served, token: str) -> None:
    connection, line = served.opened(token, f"Origin: http://127.0.0.1:{served.port}")
    with connection:
        assert status(line) == 101


def test_what_other_pages_could_include_is_not_there(served: Served) -> None:
    for path in ("/autoload.js?bokeh-autoload-element=x", "/metadata"):
        for method in ("GET", "OPTIONS"):
            answer = served.answer(path, method=method)
            assert status(answer) in (403, 404)
            assert b"access-control" not in answer.lower()
            assert b"token" not in answer


def forged() -> list[str]:
    own = generate_session_id()
    signed = generate_jwt_token(own, secret_key=b"guessed", signed=True, expiration=1000)
    claimed = base64.urlsafe_b64encode(json.dumps({"session_id": "x", "session_expiry": 1e12}).encode()).decode()
    return ["", "x", "\x7f", "a.b", "." * 50, "A" * 5000, generate_jwt_token(own, expiration=1000), signed, claimed]


@pytest.mark.parametrize("token", forged(), ids=range(len(forged())))
def test_a_bad_token_is_refused(served: Served, token: str) -> None:
    connection, line = served.opened(token)
    with connection:
        assert status(line) in (400, 403)
    for answer in (served.answer(f"/?bokeh-token={token[:50]}"), served.answer("/?bokeh-session-id=x")):
        assert status(answer) in (400, 403)
    assert status(served.answer("/", "Bokeh-Session-Id: x")) == 403


@pytest.mark.long
def test_what_is_no_request_and_no_message_leaves_the_page_as_it_was(served: Served) -> None:
    connection, line = served.opened(served.token())
    with connection:
        assert status(line) == 101
        connection.sendall(b"\x81\x84\0\0\0\0evil")
        connection.recv(65536)
    for request in (b"\0" * 100 + b"\r\n\r\n", b"GET\r\n\r\n", b"GET / HTTP/9.9\r\nHost: x\r\n\r\n"):
        served.sent(request)
    assert status(served.answer()) == 200


@pytest.mark.long
def test_thousands_of_requests_leave_no_memory_behind(served: Served) -> None:
    """2,000 requests, of them 10 for whole pages, and 50 sockets; five pages first, so that what is kept once is there.

    A page's session is dropped two seconds after it was last used; that is looked for each second.
    """
    for _ in range(5):
        served.answer()
    time.sleep(3.5)
    before = served.memory()
    small = ("/static/js/bokeh.min.js?v=1", "/autoload.js", "/metadata", "/static/none", "/static/../../etc/passwd")
    for count in range(REQUESTS):
        path = "/" if count % 200 == 0 else small[count % len(small)]
        assert status(served.answer(path, method="GET" if path == "/" else "HEAD")) in (200, 403, 404)
    tokens = [served.token() for _ in range(2)]
    connections = [served.opened(tokens[count % len(tokens)]) for count in range(SOCKETS)]
    assert all(status(line) == 101 for _, line in connections)
    for connection, _ in connections:
        connection.close()
    time.sleep(3.5)
    assert served.memory() - before < GROWTH
    assert status(served.answer()) == 200
