"""The live page: a document that follows the desk and passes on what is clicked."""

import math
from typing import Any

from bokeh.document import Document
from bokeh.events import RangesUpdate
from bokeh.models import ColumnDataSource, CustomJS

from study.explore import decimate, page, preview
from study.explore.desk import Desk
from study.explore.view import View, over_time, scales_of, view, within


class Watcher:
    """One document that shows the desk."""

    def __init__(self, desk: Desk, document: Document) -> None:
        self.desk, self.document = desk, document
        self.asked = ColumnDataSource({"act": [], "name": [], "count": []}, name="asked")
        self.state = ColumnDataSource(self._state(), name="state")
        self.page = page.build(self._view(), page.ladder_columns(desk.session), [self.asked, self.state])
        self.span: tuple[float, float] | None = None
        self._lay()
        desk.watch(self, self._told)
        document.on_session_destroyed(lambda _: desk.leave(self))

    def _lay(self) -> None:
        for panel in page.placed(self.page, diagnosed=True):
            self.document.add_root(panel)
        self.document.title = page.title(self.desk.session)
        self.document.template = page.template()
        self.document.template_variables.update(page.variables(self.desk.session, live=True))
        self.document.js_on_event("document_ready", CustomJS(code="window.study.begin()"))
        self.page.sources["words"].js_on_change("data", CustomJS(code="window.study.words()"))
        self.state.js_on_change("data", CustomJS(code="window.study.state()"))
        self.asked.on_change("data", self._passed_on)
        self.page.panels["response"].on_event(RangesUpdate, self._zoomed)

    def _view(self) -> View:
        rungs = self.desk.session.rungs
        return view(rungs[-1], len(rungs) - 1)

    def _state(self) -> dict[str, Any]:
        state, many = self.desk.state, len(self.desk.session.rungs) > 1
        return {
            "busy": [state.busy], "doing": [state.busy or state.diagnosing], "answer": [state.answer],
            "accepted": [state.accepted], "notice": [state.notice], "undo": [many],
        }  # fmt: skip

    def _told(self, changed: bool) -> None:
        """Called from any thread; the document is touched in its own loop."""
        seen = self._view() if changed else None

        def show() -> None:
            self.document.hold("combine")
            if seen is not None:
                self.page.show(seen, page.ladder_columns(self.desk.session))
                if self.span is not None:
                    self._refine(self.span)
            self.state.data = self._state()
            self.document.unhold()

        self.document.add_next_tick_callback(show)

    def _passed_on(self, _attribute: str, _old: object, new: dict[str, list[Any]]) -> None:
        if new["act"] and isinstance(new["act"][0], str) and isinstance(new["name"][0], str):
            self.desk.ask(new["act"][0], new["name"][0])

    def _zoomed(self, event: RangesUpdate) -> None:
        """Draw a stretch of a long record with the samples that the screen has room for."""
        first, last = event.x0, event.x1
        if len(self.desk.session.now.comparison.judged.time) <= 2 * decimate.BUCKETS:
            return
        if first is not None and last is not None and math.isfinite(last - first) and last > first:
            self._refine((first, last))

    def _refine(self, span: tuple[float, float]) -> None:
        self.span = span
        rung = self.desk.session.now
        found, scales = rung.comparison, scales_of(rung.comparison)
        rows = preview.difference(found, rung.shown, scales, within(found, span))
        self.page.sources["would_time"].data = rows
        self.page.sources["time"].data = over_time(found, scales, span)
