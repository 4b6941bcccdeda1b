"""Model and history change together or not at all: killed between any two writes, on a full disk, two at once."""

import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from study import cli
from study.compare import history
from study.equations.model_file import read_model
from study.support.errors import StudyError
from study.support.files import journal_of, locked, recover, replace_together

OLD, NEW = b"terms: [inertia]\n", b"terms: [inertia, linear_damping]\n"
STEPS, MORE = b'{"steps": []}\n', b'{"steps": [1]}\n'
# Ends like kill -9 at the call of this number that changes anything on the disk; nothing is cleaned up.
KILLED = """
import os, sys
from pathlib import Path
from study.support.files import locked, replace_together

count, last = 0, int(sys.argv[1])

def counted(function):
    def called(*arguments, **options):
        global count
        count += 1
        if count == last:
            os._exit(9)
        return function(*arguments, **options)
    return called

for name in ("replace", "unlink", "write_bytes", "chmod"):
    setattr(Path, name, counted(getattr(Path, name)))
os.fsync = counted(os.fsync)
path = Path("rig.yaml")
with locked(path):
    replace_together(path, {path: %r, Path("rig.history.json"): %r}, {Path("found.json"): b"{}"})
print(count)
""" % (NEW, MORE)  # noqa: UP031


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("rig.yaml").write_bytes(OLD)


def state() -> tuple[bytes, bytes | None]:
    kept = Path("rig.history.json")
    return Path("rig.yaml").read_bytes(), kept.read_bytes() if kept.exists() else None


@pytest.mark.parametrize("kept", [STEPS, None], ids=["with a history", "without"])
def test_killed_between_any_two_writes(kept: bytes | None) -> None:
    """Every write in turn: whoever reads the model next sees all of it or nothing."""
    if kept is not None:
        Path("rig.history.json").write_bytes(kept)
    whole = subprocess.run([sys.executable, "-c", KILLED, "0"], capture_output=True, text=True, check=True)
    writes = int(whole.stdout)
    assert writes >= 10
    assert state() == (NEW, MORE)
    seen = set[tuple[bytes, bytes | None]]()
    for last in range(1, writes + 1):
        for path in Path().iterdir():
            path.unlink()
        Path("rig.yaml").write_bytes(OLD)
        if kept is not None:
            Path("rig.history.json").write_bytes(kept)
        assert subprocess.run([sys.executable, "-c", KILLED, str(last)], check=False).returncode == 9
        recover(Path("rig.yaml"))
        assert state() in ((OLD, kept), (NEW, MORE)), last
        assert not journal_of(Path("rig.yaml")).exists()
        seen.add(state())
        with locked(Path("rig.yaml")):  # the lock of the killed run stops nobody
            pass
    assert len(seen) == 2


def test_what_somebody_changed_after_a_kill_stays() -> None:
    for last in range(1, 40):
        Path("rig.yaml").write_bytes(OLD)
        subprocess.run([sys.executable, "-c", KILLED, str(last)], check=False, stdout=subprocess.DEVNULL)
        if journal_of(Path("rig.yaml")).exists() and Path("rig.yaml").read_bytes() == NEW:
            break
    Path("rig.yaml").write_bytes(b"terms: [inertia, dead_band]\n")
    assert "dead_band" in read_model(Path("rig.yaml"))
    assert not journal_of(Path("rig.yaml")).exists()


@pytest.mark.parametrize("content", ["", "[]", '{"../../evil": {"was": null, "becomes": ""}}', '{"rig.yaml": 1}', "["])
def test_a_journal_of_others_is_refused(content: str) -> None:
    journal_of(Path("rig.yaml")).write_text(content)
    with pytest.raises(StudyError, match=r"\.rig\.yaml\.undo: this is not what an interrupted run leaves"):
        read_model(Path("rig.yaml"))


def _limited() -> None:
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (40, 40))  # bytes a file may have: what a full disk does to a long one


def test_a_full_disk_leaves_everything_as_it_was() -> None:
    Path("rig.history.json").write_bytes(STEPS)
    done = subprocess.run(
        [sys.executable, "-c", KILLED, "0"], capture_output=True, text=True, preexec_fn=_limited, check=False
    )
    assert "File too large" in done.stderr
    assert state() == (OLD, STEPS)
    assert {p.name for p in Path().iterdir()} == {"rig.yaml", "rig.history.json"}


def test_what_fails_on_the_way_is_put_back(monkeypatch: pytest.MonkeyPatch) -> None:
    replace = Path.replace

    def fails(self: Path, target: Path) -> Path:
        if Path(target).name == "rig.history.json":
            raise OSError(28, "No space left on device")
        return replace(self, target)

    monkeypatch.setattr(Path, "replace", fails)
    path = Path("rig.yaml")
    with pytest.raises(StudyError, match="No space left"), locked(path):
        replace_together(path, {path: NEW, Path("rig.history.json"): MORE})
    assert state() == (OLD, None)
    assert {p.name for p in path.parent.iterdir()} == {"rig.yaml"}


def test_one_after_the_other() -> None:
    """Twenty at once, each adds a line: none is lost."""
    code = (
        "from pathlib import Path\nfrom study.support.files import *\np = Path('rig.yaml')\n"
        "with locked(p):\n    replace_together(p, {p: p.read_bytes() + b'x'})\n"
    )
    running = [subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.DEVNULL) for _ in range(20)]
    assert [process.wait(30) for process in running] == [0] * 20
    assert state()[0] == OLD + 20 * b"x"
    assert {p.name for p in Path().iterdir()} == {"rig.yaml"}


MODEL = "terms:\n  - inertia\n  - linear_damping\n  - linear_stiffness\n"
TRUE = (
    "terms: [{term: inertia, value: 1.0}, {term: linear_damping, value: 3.77}, "
    "{term: linear_stiffness, value: 355.3}]\n"
)


@pytest.fixture
def rig() -> None:
    Path("true.yaml").write_text(TRUE)
    assert cli.main(["simulate", "true.yaml", "--samples", "1000", "--out", "rig.csv"]) == 0
    Path("rig.yaml").write_text(MODEL)


def add(term: str) -> list[str]:
    return ["add", "rig.yaml", term, "--data", "rig.csv", "--no-measurement", "--out", "found"]


@pytest.mark.usefixtures("rig")
def test_an_add_that_fails_leaves_no_step_and_a_second_one_does_not_double_it(monkeypatch, capsys) -> None:
    replace = Path.replace

    def fails(self: Path, target: Path) -> Path:
        if Path(target).name == "rig.yaml":
            raise OSError(28, "No space left on device")
        return replace(self, target)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", fails)
        assert cli.main(add("cubic_stiffness")) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert Path("rig.yaml").read_text() == MODEL
    assert not history.path_of(Path("rig.yaml")).exists()
    assert cli.main(add("cubic_stiffness")) == 0
    assert [s["added"] for s in history.read_history(Path("rig.yaml"))] == [None, "cubic_stiffness"]
    assert cli.main(add("cubic_stiffness")) == 2
    assert len(history.read_history(Path("rig.yaml"))) == 2


@pytest.mark.usefixtures("rig")
def test_two_adds_at_once_end_with_both_terms_and_both_steps() -> None:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path)), "OPENBLAS_NUM_THREADS": "1"}
    running = [
        subprocess.Popen([sys.executable, "-m", "study", *add(term)], env=environment, stdout=subprocess.DEVNULL)
        for term in ("cubic_stiffness", "quadratic_damping")
    ]
    assert [process.wait(60) for process in running] == [0, 0]
    steps = history.read_history(Path("rig.yaml"))
    assert {s["added"] for s in steps} == {None, "cubic_stiffness", "quadratic_damping"}
    assert len(steps) == 3
    model = read_model(Path("rig.yaml"))
    assert steps[-1]["terms"] == [t.name for t in model.terms]


@pytest.mark.usefixtures("rig")
def test_an_add_that_is_killed_at_any_moment_leaves_model_and_history_agreed() -> None:
    """Moments around the end of the fit, where the writing is."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path)), "OPENBLAS_NUM_THREADS": "1"}
    shutil.copytree(".", "../whole", dirs_exist_ok=True)
    for delay in (0.0, 0.001, 0.003):
        process = subprocess.Popen(
            [sys.executable, "-m", "study", *add("cubic_stiffness")], env=environment, stdout=subprocess.DEVNULL
        )
        end = time.monotonic() + 60.0
        while not list(Path().glob(".study-*")) and process.poll() is None and time.monotonic() < end:
            time.sleep(0.0005)
        time.sleep(delay)
        process.kill()
        process.wait()
        steps, model = history.read_history(Path("rig.yaml")), read_model(Path("rig.yaml"))
        names = [t.name for t in model.terms]
        assert (steps[-1]["terms"] if steps else names[:3]) == names
        Path("rig.yaml").write_text(MODEL)
        history.path_of(Path("rig.yaml")).unlink(missing_ok=True)


def test_a_model_of_another_ending_has_a_history_of_its_own() -> None:
    names = [history.path_of(Path(name)).name for name in ("rig.yaml", "rig.yml", "rig", "rig.b.yaml", ".yaml")]
    assert names[0] == "rig.history.json"
    assert len(set(names)) == len(names)


STEP = {
    "terms": ["inertia"], "record": "rig", "unit": "m", "rms": 1.0, "error": {"force": None, "response": 0.1},
    "noise_floor": {"response": 0.01}, "added": None,
}  # fmt: skip
MALFORMED = [
    "[]", "1", "null", '"steps"', '{"steps": 1}', '{"steps": [1]}', '{"steps": [null]}', '{"steps": [[]]}',
    "[" * 100_000, '{"steps": ' + "9" * 6000 + "}", "{", "\0", "\ufeff",
    *(json.dumps({"steps": [{**STEP, **wrong}]}) for wrong in (
        {"terms": "inertia"}, {"terms": [1]}, {"record": 5}, {"unit": None}, {"rms": "big"}, {"rms": True},
        {"error": 1}, {"error": {"force": "x", "response": 1}}, {"error": {"force": 1}}, {"noise_floor": {}},
        {"added": 3},
        {"dropped": []}, {"rms": float("nan")}, {"noise_floor": {"response": float("nan")}}, {"rms": float("inf")},
        {"rms": 10**400}, {"error": {"force": 1, "response": [1]}},
    )),
]  # fmt: skip


@pytest.mark.usefixtures("rig")
@pytest.mark.parametrize("content", MALFORMED, ids=range(len(MALFORMED)))
def test_a_malformed_history_is_found_out_before_anything_is_done(content: str, capsys) -> None:
    path = history.path_of(Path("rig.yaml"))
    path.write_text(content)
    capsys.readouterr()
    for words in (["history", "rig.yaml"], add("cubic_stiffness")):
        assert cli.main(words) == 2
        out, err = capsys.readouterr()
        assert out == ""
        assert err.count("\n") == 1
        assert "rig.history.json" in err
        assert "expected" in err
    assert path.read_text() == content
    assert Path("rig.yaml").read_text() == MODEL
    assert not Path("found").exists()


def test_a_history_with_what_a_terminal_obeys_is_shown_without_it(capsys) -> None:
    step = {**STEP, "record": "\x1b[2Jgone\u202e", "unit": "\x07m", "terms": ["\x1b]0;x\x07"]}
    history.path_of(Path("rig.yaml")).write_text(json.dumps({"steps": [step]}))
    assert cli.main(["history", "rig.yaml"]) == 0
    out = capsys.readouterr().out
    assert "gone" in out
    assert not {"\x1b", "\x07", "\u202e"} & set(out)
