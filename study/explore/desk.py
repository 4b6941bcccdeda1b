"""The desk: one session, the pages that look at it, and the work that must not hold them up.

Fits and diagnoses run in threads (the compiled loops let others run); a page is only ever touched from its own
event loop. A diagnosis goes on by itself after every change; one that was overtaken is dropped when it next reports.
"""

import threading
import traceback
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

from study.equations.model import Model
from study.explore import PAGE
from study.explore import session as sessions
from study.explore.saved import files, of_stage
from study.explore.session import Session
from study.support.errors import StudyError
from study.support.files import write_files

VALUES = "values"  # how to save a model: with what was fitted
Drawn = Mapping[str, bytes]


@dataclass(frozen=True)
class State:
    """What pages show beside the model."""

    busy: str = ""  # what is done while nothing else can be asked for
    diagnosing: str = ""  # what goes on behind that
    answer: str = ""  # the sentence beside the field for a formula
    accepted: str = ""  # the formula that was taken last
    notice: str = ""  # a sentence above everything else


class OvertakenError(Exception):
    """The model that is being diagnosed is no longer the present one."""


class Desk:
    """One session and whoever looks at it."""

    def __init__(self, session: Session, model: Path, text: str, folder: Path, inputs: Sequence[Path] = ()) -> None:
        self.session = session
        self.state = State()
        self.model, self.text, self.folder, self.inputs = model, text, folder, tuple(inputs)
        self.watchers: dict[object, Callable[[], None]] = {}
        self._drawn: tuple[object, Drawn] = (None, {})
        self._pen = threading.Lock()  # what draws pictures has a style that all threads share
        self._lock = threading.RLock()
        self._rest = threading.Event()  # never set but to end
        self._hand = ThreadPoolExecutor(1, "change")
        self._behind = ThreadPoolExecutor(1, "diagnosis")
        self._actions: Mapping[str, tuple[str, Callable[[str], None]]] = {
            "add": ("adding {}", lambda name: self._change(sessions.with_added(self.session, name))),
            "drop": ("dropping {}", lambda name: self._change(sessions.dropped(self.session, name))),
            "undo": ("undoing", lambda _: self._change(sessions.undone(self.session))),
            "hold": ("holding {}", lambda key: self._change(sessions.with_held(self.session, key, True))),
            "free": ("freeing {}", lambda key: self._change(sessions.with_held(self.session, key, False))),
            "try": ("trying {}", self._try),
            "save": ("writing files", self._save),
        }

    def watch(self, who: object, changed: Callable[[], None]) -> None:
        """Call someone after every change, from whatever thread makes it."""
        with self._lock:
            self.watchers[who] = changed

    def leave(self, who: object) -> None:
        """Call them no more."""
        with self._lock:
            self.watchers.pop(who, None)

    def ask(self, action: str, name: str) -> None:
        """Do what a page asked for; while something is being done, nothing else is taken on."""
        with self._lock:
            if action not in self._actions or self.state.busy:
                return
            doing, work = self._actions[action]
            self._tell(busy=doing.format(name[:40]), answer="", accepted="", notice="")
        self._hand.submit(self._do, work, name, action)

    def diagnose(self) -> None:
        """Ask what is missing from the present model, unless that is known, behind everything else; then draw it."""
        self._behind.submit(self._examine)
        self._behind.submit(self._draw)

    def close(self) -> None:
        """End the threads; work that waits is dropped."""
        self._rest.set()
        self._hand.shutdown(wait=False, cancel_futures=True)
        self._behind.shutdown(wait=False, cancel_futures=True)

    def _tell(self, session: Session | None = None, **state: str) -> None:
        """Change the state, perhaps the session, and call whoever watches."""
        with self._lock:
            self.state = replace(self.state, **state)
            self.session = session or self.session
            watchers = list(self.watchers.values())
        for changed in watchers:
            changed()

    def _do(self, work: Callable[[str], None], name: str, action: str) -> None:
        place = "answer" if action == "try" else "notice"
        try:
            work(name)
        except StudyError as error:
            self._tell(None, **{place: str(error)})
        except Exception as error:  # a fault of this program: the page says so and stays as it was
            traceback.print_exc()
            self._tell(None, **{place: f"a fault in the program, not in your input ({type(error).__name__}: {error})"})
        self._tell(busy="")

    def _change(self, session: Session) -> None:
        self._tell(session)
        self.diagnose()

    def _try(self, text: str) -> None:
        session = sessions.tried(self.session, text)
        self._tell(session, accepted=text)
        self._behind.submit(self._examine, session.own)
        self._behind.submit(self._draw)

    def _save(self, how: str) -> None:
        session = self.session
        with self._pen:
            ahead = self._drawn[1] if self._drawn[0] is session.now else None
            contents = files(session, self.model.name, self.text, how == VALUES, ahead)
        write_files(self.folder, contents, self.inputs)
        with_them = "with" if how == VALUES else "without"
        self._tell(
            notice=f"Saved in {self.folder}: {self.model.name} {with_them} fitted values, {PAGE}, pictures and tables"
        )

    def _draw(self) -> None:
        """Draw what Save would write of the present model, which takes longer than a user likes to wait."""
        with self._pen:
            session = self.session
            if session.now.diagnosis is None or self._rest.is_set() or self._drawn[0] is session.now:
                return
            self._drawn = session.now, of_stage(session.now, by_level=not session.several.separate)

    def _still(self, model: Model) -> None:
        """End what is done of a model that is no longer the present one."""
        if self.session.now.model != model or self._rest.is_set():
            raise OvertakenError

    def _examine(self, own: object = None) -> None:
        self._rest.wait(0.4)  # seconds in which pages are drawn, before a diagnosis takes the processors
        asked = self.session
        model = asked.now.model
        if asked.now.diagnosis is not None and own is None:
            return

        def count(done: int, of: int, what: str) -> None:
            self._still(model)
            self._tell(diagnosing=f"diagnosing: {done} of {of} tried, {what}")

        try:
            self._tell(diagnosing="diagnosing")
            alone = sessions.by_itself(asked)
            if alone is not asked:
                self._still(model)
                with self._lock:
                    self._tell(sessions.with_stage(self.session, alone.now))
            asked = alone
            stage, _ = sessions.examined(asked, count)
            with self._pen:
                stage = sessions.with_next_test(stage)
            with self._lock:
                self._tell(sessions.with_stage(self.session, stage), diagnosing="")
        except OvertakenError:
            self._tell(diagnosing="")
        except StudyError as error:
            self._tell(diagnosing="", notice=str(error))
        except Exception as error:
            traceback.print_exc()
            self._tell(diagnosing="", notice=f"the diagnosis failed ({type(error).__name__}: {error})")
