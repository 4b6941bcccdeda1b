"""The server: bound to this machine alone, and open to no page but its own."""

import errno
from collections.abc import Callable
from typing import Any

from bokeh.application import Application
from bokeh.application.handlers import FunctionHandler
from bokeh.document import Document
from bokeh.server.server import Server
from bokeh.server.util import bind_sockets

from study.explore.desk import Desk
from study.explore.live import Watcher
from study.support.errors import StudyError

HOST = "127.0.0.1"
USUAL = 5006
DAY = 86400  # seconds within which a page that was fetched must open its socket


def serve(desk: Desk, port: int | None, ready: Callable[[str], None]) -> None:
    """Serve a desk until interrupted, and call ``ready`` with the address once it can be opened.

    A port of zero takes any that is free, None the usual one or, if that is taken, any.
    """

    def show(document: Document) -> None:
        Watcher(desk, document)

    application = Application(FunctionHandler(show))
    server = _bound(application, port)
    server.start()
    desk.diagnose()
    loop: Any = server.io_loop  # Tornado leaves what its callbacks give back untyped
    loop.add_callback(ready, f"http://{HOST}:{server.port}/")
    try:
        loop.start()
    finally:
        desk.close()
        server.stop()


def _bound(application: Application, port: int | None) -> Server:
    """A server on a port; Bokeh lets a browser's page open the socket only if its origin is one of these two."""
    try:
        return _server(application, USUAL if port is None else port)
    except OSError as error:
        if error.errno not in (errno.EADDRINUSE, errno.EACCES):
            raise
        if port is not None:
            raise StudyError(f"port {port} is taken or not allowed; expected another --port, or 0 for any") from None
        return _server(application, 0)


def _server(application: Application, port: int) -> Server:
    sockets, bound = bind_sockets(HOST, port)
    for socket in sockets:
        socket.close()
    origins = [f"{host}:{bound}" for host in (HOST, "localhost")]
    return Server(
        {"/": application}, address=HOST, port=bound, allow_websocket_origin=origins, session_token_expiration=DAY,
        check_unused_sessions_milliseconds=1000, unused_session_lifetime_milliseconds=2000,
    )  # fmt: skip
