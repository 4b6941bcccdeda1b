"""The server: bound to this machine alone, and open to no page but its own."""

import errno
import secrets
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

from bokeh.application import Application
from bokeh.application.handlers import FunctionHandler
from bokeh.document import Document
from bokeh.server.server import BaseServer
from bokeh.server.util import bind_sockets
from tornado.httpserver import HTTPServer
from tornado.ioloop import IOLoop

from study.explore.desk import Desk
from study.explore.guard import GuardedTornado, one_line_each
from study.explore.live import Watcher
from study.support.errors import StudyError

HOST = "127.0.0.1"
USUAL_PORT = 5006
LARGEST_REQUEST = 1_000_000  # bytes: a page sends none
AGAIN = 5.0  # seconds after a visit in which its page is drawn, before one is made for the next
DAY = 86400  # seconds within which a page that was fetched must open its socket


def serve(desk: Desk, port: int | None, ready: Callable[[str], None]) -> None:
    """Serve a desk until interrupted, and call ``ready`` with the address once it can be opened.

    A port of zero takes any that is free, None the usual one or, if that is taken, any.
    """
    ahead = ThreadPoolExecutor(1, "page")
    made: list[Future[Watcher]] = []  # pages that wait for a visit: one is made before the browser has opened

    def make() -> None:
        if not made:
            made.append(ahead.submit(Watcher, desk))

    def show(document: Document) -> None:
        page = made.pop().result() if made else Watcher(desk)
        page.lay(document)
        loop.call_later(AGAIN, make)

    loop: Any = IOLoop.current()  # Tornado leaves what its callbacks give back untyped
    application = Application(FunctionHandler(show))
    one_line_each()
    server, bound = _bound(application, port)
    server.start()
    make()
    desk.diagnose()
    loop.add_callback(ready, f"http://{HOST}:{bound}/")
    try:
        loop.start()
    finally:
        desk.close()
        ahead.shutdown(wait=False, cancel_futures=True)
        server.stop()


def _bound(application: Application, port: int | None) -> tuple[BaseServer, int]:
    """A server, and the port that it has."""
    try:
        return _server(application, USUAL_PORT if port is None else port)
    except OSError as error:
        if error.errno not in (errno.EADDRINUSE, errno.EACCES):
            raise
        if port is not None:
            raise StudyError(f"port {port} is taken or not allowed; expected another --port, or 0 for any") from None
        return _server(application, 0)


def _server(application: Application, port: int) -> tuple[BaseServer, int]:
    sockets, bound = bind_sockets(HOST, port)
    guarded = GuardedTornado(
        {"/": application}, bound, secrets.token_hex(32).encode(), session_token_expiration=DAY,
        check_unused_sessions_milliseconds=1000, unused_session_lifetime_milliseconds=2000,
    )  # fmt: skip
    http = HTTPServer(guarded, max_body_size=LARGEST_REQUEST)
    http.add_sockets(sockets)
    return BaseServer(IOLoop.current(), guarded, http), bound
