"""The desk: one session, the pages that look at it, and the work that must not hold them up.

Fits and diagnoses run in threads (the compiled loops let others run); a page is only ever touched from its own
event loop. A diagnosis goes on by itself after every change; one that was overtaken is dropped when it next reports.
"""

import threading
import traceback
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

from study.explore import session as sessions
from study.explore.saved_files import PAGE, files
from study.explore.session import Session
from study.support.errors import StudyError
from study.support.file_sets import write_files

SETTLE = 0.4  # seconds in which pages are drawn, before a diagnosis takes the processors


@dataclass(frozen=True)
class State:
    """What pages show beside the rung.

    Attributes
    ----------
    busy : str
        What is done while nothing else can be asked for.
    diagnosing : str
        What goes on behind that.
    answer : str
        The sentence beside the field for a formula.
    accepted : str
        The formula that was taken last.
    notice : str
        A sentence above everything else.
    """

    busy: str = ""
    diagnosing: str = ""
    answer: str = ""
    accepted: str = ""
    notice: str = ""


class OvertakenError(Exception):
    """The model that is being diagnosed is no longer the present one."""


class Desk:
    """One session and whoever looks at it."""

    def __init__(self, session: Session, model: Path, text: str, folder: Path) -> None:
        self.session = session
        self.state = State()
        self.model, self.text, self.folder = model, text, folder
        self.watchers: dict[object, Callable[[], None]] = {}
        self._lock = threading.RLock()
        self._rest = threading.Event()  # never set but to end
        self._hand = ThreadPoolExecutor(1, "change")
        self._behind = ThreadPoolExecutor(1, "diagnosis")
        self._actions: Mapping[str, tuple[str, Callable[[str], None]]] = {
            "add": ("adding {}", self._add), "undo": ("undoing", self._undo), "save": ("writing files", self._save),
            "hold": ("holding {}", lambda key: self._hold(key, True)),
            "free": ("freeing {}", lambda key: self._hold(key, False)), "try": ("trying {}", self._try),
        }  # fmt: skip

    def watch(self, who: object, told: Callable[[], None]) -> None:
        """Tell someone of every change, from whatever thread makes it."""
        with self._lock:
            self.watchers[who] = told

    def leave(self, who: object) -> None:
        """Tell them no more."""
        with self._lock:
            self.watchers.pop(who, None)

    def ask(self, action: str, name: str) -> None:
        """Do what a page asked for; while something is being done, nothing else is taken on."""
        with self._lock:
            if action not in self._actions or self.state.busy:
                return
            doing, work = self._actions[action]
            self._tell(replace(self.state, busy=doing.format(name[:40]), answer="", accepted="", notice=""))
        self._hand.submit(self._do, work, name, action)

    def diagnose(self) -> None:
        """Ask what is missing from the present model, unless that is known, behind everything else."""
        self._behind.submit(self._examine)

    def close(self) -> None:
        """End the threads; work that waits is dropped."""
        self._rest.set()
        self._hand.shutdown(wait=False, cancel_futures=True)
        self._behind.shutdown(wait=False, cancel_futures=True)

    def _tell(self, state: State, session: Session | None = None) -> None:
        with self._lock:
            self.state = state
            if session is not None:
                self.session = session
            told = list(self.watchers.values())
        for one in told:
            one()

    def _do(self, work: Callable[[str], None], name: str, action: str) -> None:
        try:
            work(name)
        except StudyError as error:
            self._refuse(str(error), action)
        except Exception as error:  # a fault of this program: the page says so and stays as it was
            traceback.print_exc()
            self._refuse(f"a fault in the program, not in your input ({type(error).__name__}: {error})", action)
        self._tell(replace(self.state, busy=""))

    def _refuse(self, sentence: str, action: str) -> None:
        said = {"answer": sentence} if action == "try" else {"notice": sentence}
        self._tell(replace(self.state, **said))

    def _change(self, session: Session) -> None:
        self._tell(replace(self.state, busy=""), session)
        self.diagnose()

    def _add(self, name: str) -> None:
        self._change(sessions.with_added(self.session, name))

    def _undo(self, _: str) -> None:
        self._change(sessions.undone(self.session))

    def _hold(self, key: str, hold: bool) -> None:
        self._change(sessions.with_held(self.session, key, hold))

    def _try(self, text: str) -> None:
        after = sessions.tried(self.session, text)
        self._tell(replace(self.state, accepted=text), after)
        self._behind.submit(self._examine, after.own)

    def _save(self, _: str) -> None:
        write_files(self.folder, files(self.session, self.model.name, self.text))
        self._tell(
            replace(self.state, notice=f"Saved in {self.folder}: {self.model.name}, {PAGE}, pictures and tables")
        )

    def _examine(self, own: object = None) -> None:
        self._rest.wait(SETTLE)
        asked = self.session
        model = asked.now.model
        if asked.now.diagnosis is not None and own is None:
            return

        def one_more(count: int) -> None:
            if self.session.now.model != model or self._rest.is_set():
                raise OvertakenError
            self._tell(replace(self.state, diagnosing=f"diagnosing: {count} candidates tried"))

        try:
            self._tell(replace(self.state, diagnosing="diagnosing"))
            rung, _ = sessions.examined(asked, one_more)
            with self._lock:
                current = sessions.with_rung(self.session, rung)
                self._tell(replace(self.state, diagnosing=""), current)
        except OvertakenError:
            self._tell(replace(self.state, diagnosing=""))
        except StudyError as error:
            self._tell(replace(self.state, diagnosing="", notice=str(error)))
        except Exception as error:
            traceback.print_exc()
            self._tell(
                replace(self.state, diagnosing="", notice=f"the diagnosis failed ({type(error).__name__}: {error})")
            )
