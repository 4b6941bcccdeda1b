"""``study explore`` in a real browser: one session from the first verdict to the saved page without a network."""

import contextlib
import re
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page, TimeoutError

from study import trials
from study.compare import history
from study.equations import model_file
from study.records.record import write_csv

HOSTILE = "__import__('os').system('touch hacked')"
ERROR = "#figure-error b"


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A record with hidden drag and the model that its owner believes in."""
    folder = tmp_path_factory.mktemp("rig")
    trial = trials.make_trial(911, hidden=["quadratic_damping"], noise=0.0004, response="displacement")
    write_csv(trial.record.part(0, 4096), folder / "rig.csv")
    lines = "".join(f"  - {t.name}  # mine\n" for t in trial.believed.terms)
    (folder / "rig.yaml").write_text(f"name: rig\nterms:\n{lines}")
    return folder


@pytest.fixture(scope="module")
def address(rig: Path, exploring: Any) -> Iterator[str]:
    with exploring(rig, "rig.csv", "rig.yaml", "--out", "saved") as running:
        yield running.address


def watched(page: Page) -> tuple[list[str], list[str]]:
    """Lists that fill with what goes wrong and what is asked for."""
    wrong: list[str] = []
    asked: list[str] = []

    def console(message: Any) -> None:
        if message.type in ("error", "warning"):
            wrong.append(message.text)

    page.on("console", console)
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("request", lambda request: asked.append(request.url))
    page.on("websocket", lambda socket: asked.append(socket.url))
    return wrong, asked


def error(page: Page) -> float:
    return float(page.inner_text(ERROR).removesuffix("%"))


def until(page: Page, condition: str, *, seconds: float = 120.0) -> None:
    page.wait_for_function(condition, timeout=1000.0 * seconds)


def source(page: Page, name: str, column: str) -> list[float]:
    return page.evaluate(f"Array.from(Bokeh.documents[0].get_model_by_name('{name}').get_column('{column}'))")


def drag(page: Page, panel: str, first: float, last: float) -> None:
    """Drag across a panel, from one share of its width to another."""
    canvas = page.locator(f"[data-panel={panel}] canvas").first
    canvas.scroll_into_view_if_needed()
    box = canvas.bounding_box()
    assert box is not None
    y = box["y"] + 0.55 * box["height"]
    page.mouse.move(box["x"] + first * box["width"], y)
    page.mouse.down()
    page.mouse.move(box["x"] + last * box["width"], y, steps=4)
    page.mouse.up()


@pytest.mark.long
def test_a_session_from_the_first_verdict_to_the_saved_page(page: Page, address: str, rig: Path) -> None:
    wrong, asked = watched(page)
    page.goto(address)
    until(page, "document.querySelector('#figure-error b') && window.study.ready")
    page.wait_for_timeout(500)
    before = places(page)
    until(page, "document.querySelector('[data-candidate]')")
    _nothing_jumps(page, before)
    _tabbed(page)
    given = error(page)
    _read_the_verdict(page)
    _preview(page)
    _pin(page)
    _select(page)
    page.click("[data-candidate='0'] button")
    until(page, f"parseFloat(document.querySelector('{ERROR}').textContent) < {0.5 * given}")
    reached = error(page)
    assert page.evaluate("Bokeh.documents[0].get_model_by_name('range_history').factors.length") == 2
    page.click("[data-act=undo]")
    until(page, f"parseFloat(document.querySelector('{ERROR}').textContent) === {given}")
    assert page.is_disabled("[data-act=undo]")
    _hostile(page, rig)
    page.click("[data-act=add][data-name=quadratic_damping]")
    until(page, f"parseFloat(document.querySelector('{ERROR}').textContent) === {reached}")
    page.uncheck("#with-values")
    _save(page, "without")
    assert (rig / "saved" / "rig.yaml").read_text() == (rig / "rig.yaml").read_text() + "  - quadratic_damping\n"
    page.check("#with-values")
    _save(page, "with")
    _export(page)
    assert not wrong
    hosts = {re.match(r"\w+://([^/]+)/", url)[1] for url in asked if not url.startswith("data:")}  # type: ignore[index]
    assert hosts == {address.removeprefix("http://").rstrip("/")}
    _saved(rig)
    _opened_without_a_network(page, rig, given, reached)


def _read_the_verdict(page: Page) -> None:
    assert page.inner_text("#verdict h3") == "An effect is missing"
    assert "Quadratic damping is missing" in page.inner_text("#verdict")
    assert page.inner_text("[data-candidate='0'] .name") == "quadratic damping"
    assert "v|v|" in page.inner_text("#detail")
    labels = page.evaluate(
        "[...Bokeh.documents[0].all_models].filter((m) => m.axis_label && m.visible).map((m) => m.axis_label)"
    )
    assert len(labels) >= 19
    assert [text for text in labels if " / " not in text] == []


def _preview(page: Page) -> None:
    page.hover("[data-candidate='0']")
    until(page, "Bokeh.documents[0].get_model_by_name('ghost_time').get_length() > 100")
    assert max(map(abs, source(page, "ghost_time", "y"))) < 0.5 * max(map(abs, source(page, "time", "difference")))
    page.mouse.move(5, 5)
    until(page, "Bokeh.documents[0].get_model_by_name('ghost_time').get_length() === 0")


def _pin(page: Page) -> None:
    """Two candidates stay side by side, whatever is pointed at, until they are let go."""
    for place in (0, 1):
        page.click(f"[data-candidate='{place}'] .name")
    page.mouse.move(5, 5)
    for name, place in (("pinned", 0), ("ghost", 1)):
        until(page, f"Bokeh.documents[0].get_model_by_name('{name}_time').get_length() > 100")
        assert source(page, f"{name}_time", "y") == source(page, "would_time", str(place))
        assert source(page, f"{name}_spectrum", "y") == source(page, "would_spectrum", str(place))
    detail = page.inner_text("#detail")
    for place in (0, 1):
        assert page.text_content(f"[data-candidate='{place}'] .name b") in detail
    page.click("[data-candidate='0'] .name")
    page.mouse.move(5, 5)
    until(page, "Bokeh.documents[0].get_model_by_name('pinned_time').get_length() === 0")
    assert source(page, "ghost_time", "y") == source(page, "would_time", "1")
    page.keyboard.press("Escape")
    page.mouse.move(5, 6)
    until(page, "Bokeh.documents[0].get_model_by_name('ghost_time').get_length() === 0")
    assert page.locator("li.pinned").count() == 0


def _select(page: Page) -> None:
    """Each kind of selection shows in the panels of the other kinds."""
    plane = {"picked_u": "y", "plane": "picked"}
    for panel, said, shows in (
        ("response", "time from", plane | {"picked_spectrum": "y", "picked_v": "y"}),
        ("spectrum", "frequency from", plane | {"blocks": "weight", "picked_v": "y"}),
        ("against_v", "velocity from", plane | {"blocks": "weight", "picked_spectrum": "y"}),
    ):
        _drag_until(page, panel, f"document.querySelector('#selection').textContent.includes('{said}')")
        for name, column in shows.items():
            values = source(page, name, column)
            assert any(values), (panel, name)
        assert 0 < sum(source(page, "plane", "picked")) < sum(source(page, "plane", "seen")), panel
    page.keyboard.press("Escape")
    assert not any(source(page, "blocks", "weight"))


def _drag_until(page: Page, panel: str, condition: str) -> None:
    """Drag until it is taken for a selection: one that begins while panels still find their places is lost."""
    for seconds in (3.0, 10.0, 60.0):
        drag(page, panel, 0.45, 0.7)
        with contextlib.suppress(TimeoutError):
            until(page, condition, seconds=seconds)
            return
    pytest.fail(f"a drag across {panel} selects nothing")


def _hostile(page: Page, rig: Path) -> None:
    page.fill("#formula", HOSTILE)
    page.press("#formula", "Enter")
    until(page, "document.querySelector('#answer').textContent.includes('the functions are')")
    assert page.get_attribute("#formula", "aria-invalid") == "true"
    assert not (rig / "hacked").exists()
    page.fill("#formula", "my_drag = v*abs(v)")
    page.click("[data-act=try]")
    until(page, "document.querySelector('[data-act=add][data-name=my_drag]')")
    assert page.inner_text("#answer") == ""


def _save(page: Page, how: str) -> None:
    page.click("[data-act=save]")
    until(page, f"document.querySelector('#notice').textContent.includes(' {how} fitted values')")


def _export(page: Page) -> None:
    """The numbers of a panel as a file: as many lines as it draws points."""
    for panel, name in (("frf", "frf"), ("autocorrelation", "autocorrelation"), ("response", "time")):
        page.locator(f"[data-panel={panel}]").first.scroll_into_view_if_needed()
        page.locator(f"[data-panel={panel}]").first.hover()
        with page.expect_download() as download:
            page.click(f"[data-act=csv][data-name={panel}]")
        assert download.value.suggested_filename.endswith(f"_{panel}.csv")
        lines = Path(download.value.path()).read_text().splitlines()
        columns = lines[1].split(",")
        assert len(lines) == 2 + len(source(page, name, columns[0]))
        assert [float(x) for x in lines[2].split(",")] == pytest.approx([source(page, name, c)[0] for c in columns])


def _nothing_jumps(page: Page, before: dict[str, float]) -> None:
    """Cards stand where they stood while the verdict was awaited, and none of the mouse's targets moved."""
    for key, top in places(page).items():
        assert abs(top - before[key]) < 2.0, key


def places(page: Page) -> dict[str, float]:
    """Of cards, and of the rows of coefficients with their buttons."""
    return page.evaluate(
        "Object.fromEntries([...document.querySelectorAll('.card, #coefficients tr')].map((c, i) => "
        "[i + ' ' + (c.querySelector('h2')?.firstChild.textContent ?? ''), c.getBoundingClientRect().top + scrollY]))"
    )


def _tabbed(page: Page) -> None:
    """The Tab key goes from one named action to the next: buttons and candidates, no unnamed stops in between."""
    page.evaluate("document.activeElement.blur(); scrollTo(0, 0)")
    named: list[str] = []
    for _ in range(12):
        page.keyboard.press("Tab")
        named.append(page.evaluate("(e => e.innerText?.trim() || e.ariaLabel || e.id)(document.activeElement)"))
        if page.evaluate("document.activeElement.dataset.candidate") == "0":
            break
    assert all(named), named
    assert page.evaluate("document.activeElement.dataset.candidate") == "0", named


def _saved(rig: Path) -> None:
    names = {path.name for path in (rig / "saved").iterdir()}
    assert {"rig.yaml", "rig.history.json", "explore.html", "response.png", "history.svg"} <= names
    assert (rig / "saved" / "coefficients.csv").is_file()
    text = (rig / "saved" / "rig.yaml").read_text()
    assert text.count("# mine") == (rig / "rig.yaml").read_text().count("# mine"), "comments stay"
    model = model_file.read_model(rig / "saved" / "rig.yaml")
    assert model.terms[-1].name == "quadratic_damping"
    assert set(model.starts) == set(model.values), "the values that were fitted are written as starts"
    assert [s["added"] for s in history.read_history(rig / "saved" / "rig.yaml")] == [None, "quadratic_damping"]


def _opened_without_a_network(page: Page, rig: Path, given: float, reached: float) -> None:
    assert page.context.browser is not None
    context = page.context.browser.new_context(offline=True)
    saved = context.new_page()
    wrong, asked = watched(saved)
    saved.goto((rig / "saved" / "explore.html").as_uri())
    until(saved, "window.study && window.study.ready")
    assert error(saved) == reached
    saved.click("[data-act=step][data-name='0']")
    assert error(saved) == given
    largest = max(map(abs, source(saved, "against_v", "mean")))
    until(saved, f"Bokeh.documents[0].get_model_by_name('panel_against_v').y_range.end > {0.5 * largest}", seconds=5.0)
    assert saved.inner_text("#verdict h3") == "An effect is missing"
    assert saved.locator("button:has-text('Add')").count() == 0
    _preview(saved)
    _pin(saved)
    _select(saved)
    assert not wrong
    assert [url for url in asked if not url.startswith(("file:", "data:"))] == []
    context.close()


@pytest.mark.parametrize(("origin", "answer"), [("http://evil.example", 403), (None, 101)])
def test_no_other_page_may_open_the_socket(address: str, origin: str | None, answer: int) -> None:
    host = address.removeprefix("http://").rstrip("/")
    page = _get(host, "/", "Connection: close\r\n")
    token = re.search(r'"token":"([^"]+)"', page)
    assert token, page[-2000:]
    lines = [
        "Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
        "Sec-WebSocket-Version: 13", f"Sec-WebSocket-Protocol: bokeh, {token[1]}",
        f"Origin: {origin or address.rstrip('/')}",
    ]  # fmt: skip
    assert _get(host, "/ws", "".join(f"{line}\r\n" for line in lines), head=True).split()[1] == str(answer)


def test_the_server_listens_to_this_machine_alone(address: str) -> None:
    port = int(address.rstrip("/").rpartition(":")[2])
    listening = Path("/proc/net/tcp")
    if not listening.is_file():
        pytest.skip("/proc/net/tcp lists listening sockets on Linux alone")
    bound = [line.split()[1] for line in listening.read_text().splitlines() if f":{port:04X} 00000000:0000 0A" in line]
    assert bound == [f"0100007F:{port:04X}"]


def _get(host: str, path: str, lines: str, *, head: bool = False) -> str:
    """A request by hand; only the head of the answer, or all of it."""
    name, _, port = host.partition(":")
    with socket.create_connection((name, int(port)), timeout=20.0) as stream:
        stream.sendall(f"GET {path} HTTP/1.1\r\nHost: {host}\r\n{lines}\r\n".encode())
        content = b""
        began = time.monotonic()
        while time.monotonic() - began < 20.0:
            part = stream.recv(65536)
            content += part
            if not part or (head and b"\r\n\r\n" in content):
                break
    return content.decode("utf-8", "replace")
