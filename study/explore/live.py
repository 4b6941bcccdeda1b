"""The live page: a document that follows the desk and passes on what is clicked."""

import math
from collections.abc import Sequence
from typing import Any

from bokeh.document import Document
from bokeh.events import RangesUpdate
from bokeh.models import ColumnDataSource, CustomJS

from study.explore import decimate, html_page
from study.explore.axis_scales import Columns
from study.explore.desk import Desk
from study.explore.session import Session, worst
from study.explore.view import View, over_time, would_differ

HELLO = "hello"  # what a page says when it is there
RECORD, SENSOR, PLACE = "record", "sensor", "place"  # what it asks for when another one is chosen


class Scene:
    """A session in a document, turned to one of the records, one of the sensors and one of the places."""

    def __init__(self, session: Session, stores: Sequence[ColumnDataSource]) -> None:
        self.shown, self.record = session, worst(session.now.on_each)
        self.view = self._seen()
        self.place = next(iter(self.view.places))
        self.sensor = self.view.nearest(self.place)
        self.page = html_page.build(self.view, session, self.sensor, self.place, stores)
        self.span: tuple[float, float] | None = None

    def lay(self, document: Document) -> None:
        """Put panels, template and words into an empty document."""
        self.page.lay(document, html_page.variables(self.shown, live=True))
        self.page.panels["response"].on_event(RangesUpdate, self._zoomed)

    def show(self, session: Session) -> None:
        """Draw another session."""
        self.shown = session
        self.view = self._seen()
        if self.place not in self.view.places:
            self.place = next(iter(self.view.places))
        columns = {**self.view.of_sensor(self.sensor), **self.view.of_place(self.place), **self.view.of_record(session)}
        self.page.put({"turned": html_page.turned(self.sensor, self.place), **columns})
        if self.span is not None:
            self._refine(self.span)

    def turn_to(self, what: str, name: str) -> None:
        """Show another record by its number, another sensor or place by its name."""
        if what == RECORD and name in [str(number) for number in range(len(self.shown.now.on_each))]:
            self.record, self.span = int(name), None
            self.show(self.shown)
        if what == SENSOR and name in self.view.sensors:
            self.sensor = name
            self._turned(self.view.of_sensor(name))
            if self.span is not None:
                self._refine(self.span)
        if what == PLACE and name in self.view.places:
            self.place = name
            self._turned(self.view.of_place(name))

    def _turned(self, columns: dict[str, Columns]) -> None:
        self.page.put({**columns, "turned": html_page.turned(self.sensor, self.place)})

    def _seen(self) -> View:
        stages = self.shown.stages
        return View(stages[-1], len(stages) - 1, record=self.record)

    def _zoomed(self, event: RangesUpdate) -> None:
        """Draw a stretch of a long record with the samples that the screen has room for."""
        first, last = event.x0, event.x1
        if len(self.view.stage.comparison.prediction.time) <= 2 * decimate.BUCKETS:
            return
        if first is not None and last is not None and math.isfinite(last - first) and last > first:
            self._refine((first, last))

    def _refine(self, span: tuple[float, float]) -> None:
        self.span = span
        focus = self.view.focus(self.sensor, self.place)
        times = {"would_time": would_differ(focus, self.view.stage.shown, span), "time": over_time(focus, span)}
        self.page.put(times)


class Watcher:
    """One page that follows the desk and passes on what is clicked: made ahead, and laid in the document of a visit."""

    def __init__(self, desk: Desk) -> None:
        self.desk = desk
        self.shown = desk.session
        self.asked = ColumnDataSource({"act": [], "name": [], "count": []}, name="asked")
        self.state = ColumnDataSource(self._state(), name="state")
        self.scene = Scene(self.shown, [self.asked, self.state])
        self.state.js_on_change("data", CustomJS(code="window.study.state()"))

    def lay(self, document: Document) -> None:
        """Put the page into an empty document, as the desk stands now."""
        self.document = document
        self._draw()
        with document.models.freeze():  # what belongs to the document is gathered once
            self.scene.lay(document)
            document.js_on_event("document_ready", CustomJS(code="window.study.begin()"))
            self.asked.on_change("data", self._passed_on)
        self.desk.watch(self, self._changed)
        document.on_session_destroyed(lambda _: self.desk.leave(self))

    def _state(self) -> dict[str, Any]:
        state, many = self.desk.state, len(self.shown.stages) > 1
        return {
            "busy": [state.busy], "doing": [state.busy or state.diagnosing], "answer": [state.answer],
            "accepted": [state.accepted], "notice": [state.notice], "undo": [many],
        }  # fmt: skip

    def _changed(self) -> None:
        """Called from any thread; the document is touched in its own loop."""
        self.document.add_next_tick_callback(self._show)

    def _show(self) -> None:
        self.document.hold("combine")
        self._draw()
        self.document.unhold()

    def _draw(self) -> None:
        session = self.desk.session
        if session is not self.shown:
            self.shown = session
            self.scene.show(session)
        self.state.data = self._state()

    def _passed_on(self, _attribute: str, _old: object, new: dict[str, list[Any]]) -> None:
        act, name = (new[key][0] if new[key] else "" for key in ("act", "name"))
        if act == HELLO:  # what changed while the page was on its way is shown now
            self._show()
        elif act in (RECORD, SENSOR, PLACE):
            self.document.hold("combine")
            self.scene.turn_to(act, str(name))
            self.document.unhold()
        elif isinstance(act, str) and isinstance(name, str):
            self.desk.ask(act, name)
