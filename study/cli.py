"""The command line: run a command, and turn whatever goes wrong into one sentence."""

import ctypes
import gc
import os
import re
import sys
from collections.abc import Sequence
from contextlib import nullcontext, suppress
from pathlib import Path

from study.commands.parser import parser
from study.support.cores import one_thread_of_algebra
from study.support.errors import StudyError, expect
from study.support.extras import lacked
from study.support.terminal import harmless, shown_on

LONG_WORD = re.compile(r"\S{400,}")  # that no path and no value needs: a message is to be read
BAD_INPUT, FAULT, INTERRUPTED, PIPE_CLOSED = 2, 1, 130, 141  # the last two as shells report SIGINT and SIGPIPE


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command.

    Parameters
    ----------
    argv : sequence of str, optional
        Its words; those of the process if left out.

    Returns
    -------
    int
        0; 2 for input or files that cannot be used; 130 when interrupted; 141 when the reader of the
        output went away; 1 for a fault in this program.
    """
    one_thread_of_algebra()
    try:
        with shown_on(sys.stdout) if sys.stdout else nullcontext():  # None where the shell has closed it
            _run(argv)
        _flush()
        return 0
    except StudyError as error:
        return _end(BAD_INPUT, str(error))
    except KeyboardInterrupt:
        return _end(INTERRUPTED, "interrupted")
    except BrokenPipeError:
        return _end(PIPE_CLOSED)
    except OSError as error:
        where = f"{error.filename}: " if error.filename is not None else ""
        why = error.strerror or str(error)
        return _end(BAD_INPUT, f"{where}{why}; expected a readable file, and a writable folder with free space")
    except MemoryError:
        return _end(BAD_INPUT, "there is not enough memory for this; ask for fewer samples")
    except ModuleNotFoundError as error:
        return _end(BAD_INPUT, sentence) if (sentence := lacked(error)) else _fault(error)
    except Exception as error:  # a user is never shown a traceback
        return _fault(error)


def _run(argv: Sequence[str] | None) -> None:
    if argv is None:
        # what modules make while they load lives to the end: a search for garbage finds none there
        gc.set_threshold(50_000, 20, 50)
        _share_one_heap()
    words = sys.argv[1:] if argv is None else argv
    for word in words:  # a shell cannot pass one on, a caller in Python can
        expect("\0" not in word, f"the word {word!r} holds a null byte; expected words without")
    try:
        arguments = parser().parse_args(words)
    except SystemExit:  # --help and --version have printed what was asked
        return
    arguments.run(arguments)


def _share_one_heap() -> None:
    """One heap for all threads: each would keep what the arrays of its last fits took, a sixth of a long diagnosis."""
    with suppress(AttributeError, OSError, TypeError):  # the C library is another than GNU's, or not to be called
        ctypes.CDLL(None).mallopt(-8, 1)  # M_ARENA_MAX of malloc.h


def _fault(error: Exception) -> int:
    return _end(FAULT, f"a fault in the program, not in your input ({_place(error)}); please report it")


def _place(error: Exception) -> str:
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    where = f", {Path(trace.tb_frame.f_code.co_filename).name}:{trace.tb_lineno}" if trace else ""
    return f"{type(error).__name__}: {error}{where}"


def _flush() -> None:
    print(end="", flush=True)  # unlike sys.stdout.flush(), also where the shell has closed stdout


def _end(code: int, message: str = "") -> int:
    """Say the message in one line on stderr, and leave nothing for the interpreter's own flush to complain of."""
    if message:
        line = LONG_WORD.sub(lambda word: f"{word[0][:150]}...{word[0][-20:]}", " ".join(message.split()))
        with suppress(OSError):
            print("study:", harmless(line), file=sys.stderr)
    try:
        _flush()
    except OSError:  # what could not be written is tried again at exit, and complained of, unless it goes nowhere
        with suppress(OSError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return code
