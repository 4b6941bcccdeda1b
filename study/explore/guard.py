"""Who may ask the page: this machine's browser under this machine's own names, and nobody else.

A page of another site can have its name resolve to 127.0.0.1 (DNS rebinding). Its requests then carry that name as
``Host``, and as ``Origin`` too, which looks like one origin to whoever compares the two with each other. Here both are
held against the names under which the page is served, for every path and before anything is answered.
"""

import logging
import time
from typing import Any

from bokeh.resources import Resources
from bokeh.server.tornado import BokehTornado
from bokeh.util.token import check_token_signature, get_token_payload
from tornado.httputil import HTTPServerRequest
from tornado.web import ErrorHandler

HOST_NAMES = ("127.0.0.1", "localhost", "[::1]")
PAGE_PATH, SOCKET, STATIC = "/", "/ws", "/static/"  # what a page asks for; Bokeh would serve others' scripts as well
FORBIDDEN, NOT_FOUND = 403, 404
SIGNED = "Bokeh-Session-Id"  # a session that is asked for by name; a page never does


class GuardedTornado(BokehTornado):
    """Bokeh's application behind the guard."""

    def __init__(self, applications: Any, port: int, key: bytes, **options: Any) -> None:
        self.hosts = frozenset(f"{name}:{port}" for name in HOST_NAMES)
        self.key = key
        super().__init__(
            applications, secret_key=key, sign_sessions=True, extra_websocket_origins=sorted(self.hosts), **options
        )

    def resources(self, absolute_url: str | bool | None = None) -> Resources:
        """Scripts of Bokeh that the page asks for: it has no widgets, tables, formulas or WebGL."""
        found = super().resources(absolute_url)
        found.components = ["bokeh"]
        return found

    def find_handler(self, request: HTTPServerRequest, **options: Any) -> Any:
        """The handler of a request, or one that refuses it."""
        status = refusal(request, self.hosts, self.key)
        if status:
            return self.get_handler_delegate(request, ErrorHandler, {"status_code": status})
        return super().find_handler(request, **options)


def refusal(request: HTTPServerRequest, hosts: frozenset[str], key: bytes) -> int:
    """The status with which a request is refused, 0 if it is not; ``key`` is what the page's tokens are signed with."""
    headers = request.headers
    origin = headers.get("Origin")
    own = [f"http://{host}" for host in hosts]
    if headers.get("Host", "").lower() not in hosts or (origin is not None and origin.lower() not in own):
        return FORBIDDEN
    if any(name.startswith("bokeh-") for name in request.arguments) or SIGNED in headers:
        return FORBIDDEN
    if request.path == SOCKET:
        return 0 if valid(headers.get("Sec-WebSocket-Protocol", ""), key) else FORBIDDEN
    return 0 if request.path == PAGE_PATH or request.path.startswith(STATIC) else NOT_FOUND


def valid(protocols: str, key: bytes) -> bool:
    """Whether a socket names Bokeh's protocol and a token that this server has signed and that has not run out."""
    words = [word.strip() for word in protocols.split(",")]
    if len(words) != 2 or words[0] != "bokeh" or not words[1].isascii():
        return False
    try:
        signed = check_token_signature(words[1], secret_key=key, signed=True)
        return signed and time.time() < float(get_token_payload(words[1])["session_expiry"])
    except Exception:  # a token may be anything, and decoding it may fail in any way
        return False


class _OneLine(logging.Formatter):
    """A fault of a request in one line: whoever started the page is shown no traceback of what others sent."""

    def format(self, record: logging.LogRecord) -> str:
        """The message, and the kind of the exception behind it."""
        cause = record.exc_info[1] if record.exc_info else None
        text = f"study: {record.getMessage()}" + (f" ({type(cause).__name__}: {cause})" if cause else "")
        return "".join(c if c.isprintable() else " " for c in text)[:500]


def one_line_each() -> None:
    """Have what Tornado and Bokeh report as a fault printed on stderr without its traceback, and nothing else."""
    handler = logging.StreamHandler()
    handler.setFormatter(_OneLine())
    handler.setLevel(logging.ERROR)
    for name in ("tornado", "bokeh"):
        logger = logging.getLogger(name)
        logger.handlers[:] = [handler]  # Bokeh has one of its own
        logger.propagate = False
