"""Public records: listed, fetched from a server on the loopback address, refused, and said without a network."""

import hashlib
import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import pytest

from study import cli
from study.records import public_records
from study.records.public_records import PublicFile, PublicRecord, fetch
from study.support.errors import StudyError

CONTENT = {"one.csv": b"time,force\n0,1\n", "two.csv": b"time,force\n0,2\n"}


class Silent(SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


@pytest.fixture
def server(tmp_path):
    """The address of a folder with two files."""
    folder = tmp_path / "served"
    folder.mkdir()
    for name, content in CONTENT.items():
        (folder / name).write_bytes(content)
    running = ThreadingHTTPServer(("127.0.0.1", 0), partial(Silent, directory=str(folder)))
    thread = threading.Thread(target=running.serve_forever, daemon=True)
    thread.start()
    yield f"http://127.0.0.1:{running.server_port}"
    running.shutdown()
    running.server_close()
    thread.join()


@pytest.fixture
def rig(monkeypatch):
    """A record of two files and one of a single file, whose checksums are right."""
    files = tuple(PublicFile(n, len(c), hashlib.sha256(c).hexdigest()) for n, c in CONTENT.items())
    records = {
        "rig": PublicRecord("Rig", "nobody", "MIT", "the shelf", files),
        "alone": PublicRecord("Alone", "nobody", "MIT", "the shelf", files[:1]),
    }
    monkeypatch.setattr(public_records, "RECORDS", records)


@pytest.mark.usefixtures("rig")
def test_files_are_fetched_once_and_verified(server, tmp_path):
    paths = fetch("rig", tmp_path / "data", server)
    assert [path.read_bytes() for path in paths] == list(CONTENT.values())
    assert fetch("rig", tmp_path / "data") == paths, "what is there is not asked for again"
    assert fetch("alone", tmp_path / "data", f"{server}/one.csv")[0].read_bytes() == CONTENT["one.csv"]


@pytest.mark.usefixtures("rig")
def test_a_file_has_a_public_address_or_was_converted(server, tmp_path, monkeypatch):
    content = CONTENT["one.csv"]
    file = PublicFile("one.csv", len(content), hashlib.sha256(content).hexdigest(), address=f"{server}/one.csv")
    monkeypatch.setitem(public_records.RECORDS, "offered", PublicRecord("Offered", "nobody", "MIT", "a shelf", (file,)))
    assert fetch("offered", tmp_path)[0].read_bytes() == content
    with pytest.raises(StudyError, match=r"no address has one.csv, converted.*by hand .the shelf."):
        fetch("alone", tmp_path)


@pytest.mark.usefixtures("rig")
def test_another_file_is_refused_and_nothing_left(server, tmp_path):
    with pytest.raises(StudyError, match=r"checksum is another.*by hand .the shelf."):
        fetch("alone", tmp_path / "data", f"{server}/two.csv")
    assert not [path for path in (tmp_path / "data").rglob("*") if path.is_file()]


@pytest.mark.usefixtures("rig")
def test_a_file_that_differs_is_not_written_over(server, tmp_path):
    path = tmp_path / "data" / "alone" / "one.csv"
    path.parent.mkdir(parents=True)
    path.write_bytes(b"mine")
    with pytest.raises(StudyError, match="move it away"):
        fetch("alone", tmp_path / "data", f"{server}/one.csv")
    assert path.read_bytes() == b"mine"


@pytest.mark.usefixtures("rig")
@pytest.mark.parametrize("address", ["http://127.0.0.1:9/one.csv", "{server}/three.csv", "no address"])
def test_without_a_network_one_sentence_says_where_to_get_it(address, server, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("STUDY_DATA", str(tmp_path / "data"))
    assert cli.main(["data", "alone", "--address", address.format(server=server)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert f"get it by hand (the shelf) and put it at {tmp_path / 'data' / 'alone' / 'one.csv'}" in said


@pytest.mark.usefixtures("rig")
def test_the_command_says_where_it_put_a_record(server, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("STUDY_DATA", str(tmp_path / "data"))
    assert cli.main(["data", "alone", "--address", f"{server}/one.csv"]) == 0
    said = capsys.readouterr().out
    assert str(tmp_path / "data" / "alone" / "one.csv") in said
    assert f"STUDY_DATA={tmp_path / 'data'}" in said


def test_the_list_says_licence_size_and_what_is_there(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("STUDY_DATA", str(tmp_path))
    (tmp_path / "pendulum").mkdir()
    (tmp_path / "pendulum" / "single.csv").write_text("another")
    assert cli.main(["data"]) == 0
    said = capsys.readouterr().out
    for name, record in public_records.RECORDS.items():
        assert name in said
        assert f"{record.size / 1e6:.1f} MB" in said
    assert "differs" in said
    assert "missing" in said
    assert cli.main(["data", "--address", "http://x"]) == 2
    assert cli.main(["data", "nothing"]) == 2


def test_every_record_of_the_gallery_is_listed():
    from pathlib import Path

    from study.commands.measurements import load_measurements

    root = Path(__file__).parents[2]
    for row in load_measurements(root / "config").values():
        for path in map(Path, row.paths):
            assert path.name in [file.name for file in public_records.RECORDS[path.parent.name].files]
