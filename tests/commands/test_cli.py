"""The command line: quick help, readable tables, one sentence and the right exit code for what goes wrong."""

import argparse
import os
import resource
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from study import __version__, cli
from study.commands import parser
from study.commands.command import Command, finite_number, whole_number
from study.commands.terms import terms_table
from study.equations.model_file import read_model
from study.equations.simulate import simulate
from study.equations.terms import LIBRARY
from study.records.excitation import Excitation, force
from study.records.record import read_csv
from study.support.errors import StudyError

DUFFING = str(Path(__file__).parents[2] / "models" / "duffing.yaml")
STUDY = [sys.executable, "-m", "study"]
HEAVY = {
    "numpy", "scipy", "pandas", "matplotlib", "ruamel", "pydantic", "tabulate", "h5py", "bokeh", "snakemake",
}  # fmt: skip


def _run(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*STUDY, *words], capture_output=True, text=True, timeout=60, check=False)


def _said(capsys: pytest.CaptureFixture[str]) -> str:
    """The one line on stderr; nothing on stdout."""
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("study: ")
    assert err.count("\n") == 1
    return err


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("PYTHONUNBUFFERED", raising=False)  # users' output is buffered, and so fails late


def test_help_imports_nothing_heavy() -> None:
    code = "import sys, study.cli; study.cli.main(['--help']); print(*{m.split('.')[0] for m in sys.modules})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not HEAVY & set(done.stdout.splitlines()[-1].split())


@pytest.mark.parametrize("command", parser.COMMANDS, ids=lambda c: c.name)
def test_each_help_shows_an_example_that_is_understood(command: Command, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([command.name, "--help"]) == 0
    shown = capsys.readouterr().out
    assert "example:" in shown
    for line in command.example.splitlines():
        words = shlex.split(line, comments=True)
        assert line.strip() in shown
        assert words[0] == "study"
        assert parser.parser().parse_args(words[1:]).run is command.run


def test_version_and_both_ways_to_start() -> None:
    assert _run("--version").stdout == f"study {__version__}\n"
    script = Path(sys.executable).with_name("study")
    done = subprocess.run([script, "--version"], capture_output=True, text=True, check=True)
    assert done.stdout == f"study {__version__}\n"


def test_terms_lists_the_library(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["terms"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[2:-2] if not line.startswith(" ")] == list(LIBRARY)
    assert lines[0].split() == ["term", "formula", "shape", "parameters", "meaning", "common", "cause"]


@pytest.mark.parametrize("width", [160, 250])
def test_the_table_fits_the_terminal(width: int) -> None:
    assert max(map(len, terms_table(tuple(LIBRARY.values()), width).splitlines())) <= width


@pytest.mark.parametrize("name", LIBRARY)
def test_terms_shows_one_in_detail(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["terms", name]) == 0
    shown = capsys.readouterr().out
    term = LIBRARY[name]
    for part in (term.formula, term.meaning, term.cause, f"- {name}\n"):
        assert part in shown
    for symbol in term.symbols:
        line = next(row for row in shown.splitlines() if row.startswith("coefficient") and f" {symbol} " in row)
        assert term.unit(symbol, "N", "m") in line
    for parameter in term.parameters:
        assert any(row.startswith("shape parameter") and f" {parameter.name} " in row for row in shown.splitlines())


def test_what_details_says_of_a_model_line_is_read(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    for name in LIBRARY:
        assert cli.main(["terms", name]) == 0
        entry = capsys.readouterr().out.splitlines()[-1].replace("...", "1.5")
        (tmp_path / "m.yaml").write_text(f"terms:\n{entry}\n")
        model = read_model(tmp_path / "m.yaml")
        assert None not in model.values.values()


def test_an_unknown_term_is_met_with_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["terms", "cubic_stifness"]) == 2
    assert "did you mean 'cubic_stiffness'" in _said(capsys)


def test_simulate_writes_the_record(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["simulate", DUFFING, "--level", "0.5", "--seed", "3", "--samples", "512", "--dt", "0.01", "--out", "a.csv"]
    assert cli.main(words) == 0
    assert "a.csv: 512 samples, 5.12 s of duffing" in capsys.readouterr().out
    record = read_csv(Path("a.csv"))
    expected = simulate(read_model(Path(DUFFING)), force(Excitation(level=0.5), 512, 0.01, 3), 0.01)
    assert record.dt == 0.01
    for channel in ("force", "displacement", "velocity", "acceleration"):
        np.testing.assert_array_equal(record[channel], expected[channel])
    first = Path("a.csv").read_bytes()
    assert cli.main(words) == 0
    assert Path("a.csv").read_bytes() == first
    assert cli.main([*words[:4], "--seed", "4", *words[6:]]) == 0
    assert Path("a.csv").read_bytes() != first


def test_simulate_takes_as_many_steps_as_the_fastest_mode_of_a_structure_asks_for() -> None:
    """7.3 Hz at 50 samples a second: with twice as many steps the record is the same."""
    frame = str(Path(DUFFING).parent / "structures" / "frame.yaml")
    usual, finer = ([], ["--steps", "64"])
    for words, name in ((usual, "usual.csv"), (finer, "finer.csv")):
        assert cli.main(["simulate", frame, "--level", "100", "--samples", "512", "--out", name, *words]) == 0
    one, other = (np.loadtxt(name, delimiter=",", skiprows=1) for name in ("usual.csv", "finer.csv"))
    assert np.max(np.abs(one - other)[:, 2:]) < 1e-6 * np.max(np.abs(other[:, 2:]))


OWN = """terms:
  - {term: inertia, value: 1.0}
  - {term: linear_damping, value: 1.0}
  - {term: linear_stiffness, value: 355.3}
  - {term: friction, force: "FRICTION", value: 0.2}
"""


def test_simulate_takes_as_many_steps_as_a_formula_of_the_users_asks_for() -> None:
    """Dry friction that is rounded off within a tenth of a millimetre a second."""
    Path("own.yaml").write_text(OWN.replace("FRICTION", "tanh(v/0.0001)"))
    for words, name in (([], "usual.csv"), (["--steps", "256"], "finer.csv"), (["--steps", "8"], "eight.csv")):
        assert cli.main(["simulate", "own.yaml", "--samples", "2048", "--out", name, *words]) == 0
    usual, finer, eight = (read_csv(Path(f"{n}.csv"))["displacement"] for n in ("usual", "finer", "eight"))
    assert np.std(usual - finer) < 2e-3 * np.std(finer) < np.std(eight - finer)


def test_simulate_switches_where_a_formula_of_the_users_jumps() -> None:
    """The report's integrator, which does not, shifts such a motion by percents."""
    Path("own.yaml").write_text(OWN.replace("FRICTION", "sign(v)*(1 + exp(-(v/0.005)**2))"))
    for words, name in (([], "usual.csv"), (["--steps", "256"], "finer.csv")):
        assert cli.main(["simulate", "own.yaml", "--samples", "2048", "--out", name, *words]) == 0
    usual, finer = (read_csv(Path(f"{n}.csv")) for n in ("usual", "finer"))
    reports = simulate(read_model(Path("own.yaml")), usual["force"], 0.02)
    size = np.std(finer["displacement"])
    assert np.std(usual["displacement"] - finer["displacement"]) < 1e-3 * size
    assert np.std(reports["displacement"] - finer["displacement"]) > 1e-2 * size


def test_simulate_says_where_no_number_of_steps_gives_the_motion(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["simulate", str(Path(DUFFING).parent / "dead_band.yaml"), "--samples", "4096", "--out", "chaotic.csv"]
    assert cli.main(words) == 0
    assert "with twice the 8 steps per sample, a motion changes by" in capsys.readouterr().out


BAD = {
    "no_command": ([], "COMMAND"),
    "unknown_command": (["simulat"], "'simulat'"),
    "unknown_option": (["terms", "--nme"], "--nme"),
    "no_model": (["simulate"], "model"),
    "missing_model": (["simulate", "rig.yaml"], "rig.yaml: there is no such file"),
    "text_level": (["simulate", DUFFING, "--level", "loud"], "'loud' is not a finite number"),
    "nan_level": (["simulate", DUFFING, "--level", "nan"], "'nan' is not a finite number"),
    "negative_level": (["simulate", DUFFING, "--level=-1"], "of at least 0"),
    "zero_dt": (["simulate", DUFFING, "--dt", "0"], "at least 1e-15"),
    "few_samples": (["simulate", DUFFING, "--samples", "2"], "from 16 to"),
    "many_samples": (["simulate", DUFFING, "--samples", "1e12"], "from 16 to"),
    "half_sample": (["simulate", DUFFING, "--samples", "99.5"], "'99.5' is not a whole number"),
    "negative_seed": (["simulate", DUFFING, "--seed=-1"], "'-1' is not a whole number"),
    "high_cutoff": (["simulate", DUFFING, "--cutoff", "1e6"], "1e+06"),
    "no_folder": (["simulate", DUFFING, "--samples", "64", "--out", "none/a.csv"], "none/a.csv: cannot be written"),
    "out_is_folder": (["simulate", DUFFING, "--samples", "64", "--out", "."], "cannot be written"),
    "out_in_file": (["simulate", DUFFING, "--samples", "64", "--out", f"{DUFFING}/a.csv"], "Not a directory"),
    "control_characters": (["simulate", "\x1b[31m\n\nred"], "?[31m red: there is no such file"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_input_gets_one_sentence_and_exit_code_2(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words, names = BAD[name]
    assert cli.main(words) == 2
    said = _said(capsys)
    assert names in said
    assert "\x1b" not in said
    assert list(tmp_path.iterdir()) == []


def test_a_model_without_values_is_not_simulated(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "rig.yaml").write_text("terms: [{term: inertia, value: 1}, linear_stiffness]")
    assert cli.main(["simulate", "rig.yaml"]) == 2
    assert "no value for k" in _said(capsys)


def test_a_diverging_run_writes_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "rig.yaml").write_text("terms: [{term: inertia, value: 1}, {term: linear_stiffness, value: -1e4}]")
    assert cli.main(["simulate", "rig.yaml"]) == 2
    assert "diverged" in _said(capsys)
    assert [p.name for p in tmp_path.iterdir()] == ["rig.yaml"]


def test_no_space_left_keeps_the_old_record(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.csv").write_text("old")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))
    try:
        assert cli.main(["simulate", DUFFING, "--samples", "512", "--out", "a.csv"]) == 2
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert "a.csv: cannot be written" in _said(capsys)
    assert [p.name for p in tmp_path.iterdir()] == ["a.csv"]
    assert (tmp_path / "a.csv").read_text() == "old"


def _table_of(error: BaseException) -> tuple[Command, ...]:
    def run(_: argparse.Namespace) -> None:
        raise error

    return (Command("fail", "fails", "study fail", lambda _: None, run),)


@pytest.mark.parametrize(
    ("error", "code", "names"),
    [
        (StudyError("rig.yaml: two\nlines"), 2, "study: rig.yaml: two lines\n"),
        (PermissionError(13, "Permission denied", "results"), 2, "results: Permission denied"),
        (OSError(28, "No space left on device"), 2, "No space left on device"),
        (MemoryError(), 2, "not enough memory"),
        (KeyboardInterrupt(), 130, "interrupted"),
        (BrokenPipeError(), 141, ""),
        (ZeroDivisionError("division"), 1, "fault in the program, not in your input (ZeroDivisionError: division"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, BaseException) else None,
)
def test_whatever_goes_wrong_is_one_line(
    error: BaseException, code: int, names: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(parser, "COMMANDS", _table_of(error))
    assert cli.main(["fail"]) == code
    out, err = capsys.readouterr()
    assert out == ""
    assert names in err
    assert err.count("\n") == (1 if names else 0)


@pytest.mark.parametrize("words", [["terms"], ["terms", "inertia"]])
def test_a_closed_pipe_is_quiet(words: list[str]) -> None:
    read, write = os.pipe()
    os.close(read)
    try:
        done = subprocess.run([*STUDY, *words], stdout=write, stderr=subprocess.PIPE, text=True, check=False)
    finally:
        os.close(write)
    assert done.returncode == 141
    assert done.stderr == ""


def test_an_error_after_output_to_a_closed_pipe_is_still_one_line() -> None:
    code = ENDLESS.replace("time.sleep(60)", "raise cli.StudyError('too late')").replace(", flush=True", "")
    read, write = os.pipe()
    os.close(read)
    try:
        words = [sys.executable, "-c", code]
        done = subprocess.run(words, stdout=write, stderr=subprocess.PIPE, text=True, check=False)
    finally:
        os.close(write)
    assert done.returncode == 2
    assert done.stderr == "study: too late\n"


def test_a_closed_stdout_is_no_trouble() -> None:
    command = f"'{sys.executable}' -m study terms >&-"
    done = subprocess.run(["sh", "-c", command], stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 0
    assert done.stderr == ""


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="only Linux has a device that is always full")
@pytest.mark.parametrize("words", [["terms"], ["terms", "inertia"], ["--version"]])
def test_a_full_disk_behind_stdout_is_one_sentence(words: list[str]) -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run([*STUDY, *words], stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 2
    assert "No space left on device" in done.stderr
    assert done.stderr.count("\n") == 1


ENDLESS = """
import signal, sys, time
from study import cli
from study.commands import parser
from study.commands.command import Command

signal.signal(signal.SIGINT, signal.default_int_handler)  # shells start what runs behind them without it

def run(_):
    print("working", flush=True)
    time.sleep(60)

parser.COMMANDS = (Command("work", "works", "study work", lambda _: None, run),)
sys.exit(cli.main(["work"]))
"""


def test_an_interrupt_while_it_works() -> None:
    words = [sys.executable, "-c", ENDLESS]
    with subprocess.Popen(words, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "working\n"
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=30)
    assert process.returncode == 130
    assert err == "study: interrupted\n"


@pytest.mark.parametrize(("text", "value"), [("0", 0.0), ("1e-3", 1e-3), ("-0.5", -0.5)])
def test_numbers(text: str, value: float) -> None:
    assert finite_number()(text) == value


def test_limits_of_numbers() -> None:
    assert finite_number(above=0.0)("1e-300") == 1e-300
    assert whole_number(0, 5)("5") == 5
    for read, text in (
        (finite_number(above=0.0), "0"),
        (finite_number(least=1.0), "0.9"),
        (finite_number(), "inf"),
        (whole_number(0, 5), "6"),
    ):
        with pytest.raises(argparse.ArgumentTypeError, match=text):
            read(text)


def test_help_begins_with_what_to_type(capsys: pytest.CaptureFixture[str]) -> None:
    for words in ([], ["diagnose"]):
        assert cli.main([*words, "--help"]) == 0
        lines = capsys.readouterr().out.splitlines()
        assert lines[0] == "example:"
        assert lines[1].strip().startswith("study ")
    for line in parser.EXAMPLE.splitlines():
        assert parser.parser().parse_args(shlex.split(line, comments=True)[1:]).run


def test_a_word_finds_terms_by_name_or_by_what_they_mean(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["terms", "cubic"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[2:-2] if not line.startswith(" ")] == ["cubic_stiffness", "cubic_damping"]
    assert cli.main(["terms", "Dead Band"]) == 0
    assert capsys.readouterr().out.startswith("dead_band: ")
    assert cli.main(["terms", "bolted"]) == 0
    assert "hysteresis" in capsys.readouterr().out


def test_fits_side_by_side_are_not_each_run_by_threads_of_their_own():
    asked = "import os, sys, study.cli; study.cli.main(['--version']); print(os.environ['OPENBLAS_NUM_THREADS'])"
    free = {name: value for name, value in os.environ.items() if name != "OPENBLAS_NUM_THREADS"}
    for given, expected in ((free, "1"), (free | {"OPENBLAS_NUM_THREADS": "3"}, "3")):
        run = subprocess.run([sys.executable, "-c", asked], env=given, capture_output=True, text=True, check=True)
        assert run.stdout.splitlines()[-1] == expected


def test_steps_of_the_workflow_are_not_run_by_threads_of_their_own_either():
    """It asks before anything loads NumPy: Part I took a third longer, and Part II half as long again."""
    begun = (Path(__file__).parents[2] / "Snakefile").read_text().partition("\none_thread_of_algebra()")
    asked = "".join(begun[:2]) + "\nimport os; print('numpy' in sys.modules, os.environ['OPENBLAS_NUM_THREADS'])"
    free = {name: value for name, value in os.environ.items() if name != "OPENBLAS_NUM_THREADS"}
    run = subprocess.run([sys.executable, "-c", asked], env=free, capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["False", "1"]
