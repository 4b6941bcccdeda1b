"""Steps of the workflow in processes that are forked from one that has its packages, since these load for a second.

``StepServer`` starts that process for the first step; it ends when the one that started it does, in whatever way. Each
step has a process of its own: what it leaves in memory, and how it fails, is no business of others.
"""

import atexit
import gc
import importlib
import os
import pickle
import runpy
import signal
import socket
import subprocess
import sys
import traceback
from collections.abc import Mapping, Sequence
from threading import Lock
from types import SimpleNamespace
from typing import Any, NoReturn

from study.support.errors import StudyError


class StepServer:
    """A process that has imported what ``scripts`` import, and forks itself for every step."""

    def __init__(self, scripts: Sequence[str]) -> None:
        self._scripts, self._starting = scripts, Lock()
        self._requests: socket.socket | None = None

    def _started(self) -> socket.socket:
        with self._starting:
            if self._requests is None:
                self._requests, theirs = socket.socketpair()
                command = [sys.executable, "-m", "study.support.step_server", *self._scripts]
                with theirs:
                    process = subprocess.Popen(command, stdin=theirs.fileno())
                atexit.register(process.wait)
                atexit.register(self._requests.close)  # first, the last to be registered: the server ends by it
            return self._requests

    def run(self, script: str, step: Mapping[str, Any]) -> None:
        """Run a script that finds ``step``, plain data, as its ``snakemake``; it may be called from several threads.

        Raises
        ------
        StudyError
            If the script ends with another exit code than 0; it has then said why.
        """
        requests, (answers, theirs) = self._started(), socket.socketpair()
        with answers:
            with theirs:
                socket.send_fds(requests, [b"\0"], [theirs.fileno()])
            answers.sendall(pickle.dumps((script, step)))
            answers.shutdown(socket.SHUT_WR)
            code = _received(answers)
        if code != b"0":
            raise StudyError(f"{script} ended with exit code {code.decode() or 'none'}")


def run_here(script: str, step: Mapping[str, Any]) -> None:
    """Run a script in this process; a ``SystemExit`` passes."""
    runpy.run_path(script, {"snakemake": SimpleNamespace(**step)})


def _received(connection: socket.socket) -> bytes:
    """Everything until the other side ends."""
    with connection.makefile("rb") as file:
        return file.read()


def _serve(scripts: Sequence[str]) -> None:
    """Import what the scripts do, then fork for each request on the standard input until that ends."""
    importlib.import_module("snakemake.iocontainers")  # of which a step's lists of files are
    for script in scripts:
        runpy.run_path(script)
    gc.freeze()  # what was imported stays in pages that all share
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # an interrupt is for the steps; then this input ends
    at_work = set[int]()
    with socket.socket(fileno=os.dup(0)) as requests:
        while descriptors := socket.recv_fds(requests, 1, 1)[1]:
            at_work -= {process for process in at_work if os.waitpid(process, os.WNOHANG)[0]}
            with socket.socket(fileno=descriptors[0]) as connection:
                process = os.fork()
                if process == 0:
                    requests.close()
                    _answer(connection)
                at_work.add(process)
    for process in at_work:
        os.waitpid(process, 0)


def _answer(connection: socket.socket) -> NoReturn:
    """Run the step that is asked for, say its exit code, and end."""
    code = 1
    try:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        run_here(*pickle.loads(_received(connection)))
        code = 0
    except SystemExit as ended:
        code = ended.code if isinstance(ended.code, int) else 1
    except BaseException:  # the process ends here, whatever it is
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        connection.sendall(str(code).encode())
        os._exit(code)  # without the ends of what was inherited


if __name__ == "__main__":
    _serve(sys.argv[1:])
