"""The live page: a document that follows the desk and passes on what is clicked."""

import math
from collections.abc import Sequence
from typing import Any

from bokeh.document import Document
from bokeh.events import RangesUpdate
from bokeh.models import ColumnDataSource, CustomJS

from study.explore import decimate, html_page, preview
from study.explore.any_page import history_columns
from study.explore.axis_scales import scales_of
from study.explore.by_record import worst
from study.explore.desk import Desk
from study.explore.session import Session, Stage, on_record
from study.explore.view import over_time, stretch

HELLO = "hello"  # what a page says when it is there
RECORD = "record"  # what it asks for when another record is chosen


class Scene:
    """A session in a document."""

    def __init__(self, session: Session, stores: Sequence[ColumnDataSource]) -> None:
        self.shown = session
        self.record = worst(session.now.on_each)
        self.page = html_page.build(self._view(), history_columns(session), stores)
        self.span: tuple[float, float] | None = None

    def lay(self, document: Document) -> None:
        """Put panels, template and words into an empty document."""
        self.page.lay(document, html_page.variables(self.shown, live=True))
        if "response" in self.page.panels:
            self.page.panels["response"].on_event(RangesUpdate, self._zoomed)

    def show(self, session: Session) -> None:
        """Draw another session."""
        self.shown = session
        history = history_columns(session)
        self.page.show(html_page.columns(self._view(), history), history)
        if self.span is not None:
            self._refine(self.span)

    def turn_to(self, record: str) -> None:
        """Show another of several records."""
        records = [str(number) for number in range(len(self.shown.now.on_each))]
        if record in records:
            self.record, self.span = records.index(record), None
            self.show(self.shown)

    def _view(self) -> html_page.Seen:
        stages = self.shown.stages
        return html_page.seen_of(stages[-1], len(stages) - 1, record=self.record)

    def _stage(self) -> Stage:
        return on_record(self.shown.now, self.record)

    def _zoomed(self, event: RangesUpdate) -> None:
        """Draw a stretch of a long record with the samples that the screen has room for."""
        first, last = event.x0, event.x1
        if len(self._stage().comparison.prediction.time) <= 2 * decimate.BUCKETS:
            return
        if first is not None and last is not None and math.isfinite(last - first) and last > first:
            self._refine((first, last))

    def _refine(self, span: tuple[float, float]) -> None:
        self.span = span
        stage = self._stage()
        comparison, scales = stage.comparison, scales_of(stage.comparison)
        part = stretch(comparison, span)
        self.page.sources["would_time"].data = preview.difference(stage, scales, part)
        self.page.sources["time"].data = over_time(comparison, scales, span)


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
        elif act == RECORD:
            self.document.hold("combine")
            self.scene.turn_to(name)
            self.document.unhold()
        elif isinstance(act, str) and isinstance(name, str):
            self.desk.ask(act, name)
