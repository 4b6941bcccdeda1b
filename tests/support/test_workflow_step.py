"""What the steps of the workflow share: one sentence for a fault, one run at a time, the modules they rest on."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from study.support.errors import StudyError
from study.support.files import replacing
from study.support.workflow_step import one_sentence, only_run, remove_half_written, rests_on

ROOT = Path(__file__).parents[2]


def test_a_fault_is_one_sentence_and_an_exit_code(capsys):
    with pytest.raises(SystemExit) as ended, one_sentence():
        raise StudyError("a.yaml:\n  level is 'x'")
    assert ended.value.code == 2
    assert capsys.readouterr().err == "study: a.yaml: level is 'x'\n"


def test_other_errors_pass():
    with pytest.raises(KeyError), one_sentence():
        raise KeyError("a")


def test_one_run_at_a_time(tmp_path):
    held = only_run(tmp_path / "new" / "running")
    with pytest.raises(StudyError, match="another run is at work"):
        only_run(tmp_path / "new" / "running")
    held.close()
    only_run(tmp_path / "new" / "running").close()


def test_a_killed_run_holds_nobody_up(tmp_path):
    script = "import sys, time; from pathlib import Path; from study.support.workflow_step import only_run\n"
    script += "held = only_run(Path(sys.argv[1])); print('held', flush=True); time.sleep(60)"
    command = [sys.executable, "-c", script, str(tmp_path / "running")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "held\n"
        with pytest.raises(StudyError):
            only_run(tmp_path / "running")
        process.kill()
    only_run(tmp_path / "running").close()


def test_what_killed_runs_left_half_written_is_swept(tmp_path):
    path = tmp_path / "results" / "a" / "b.csv"
    path.parent.mkdir(parents=True)
    path.write_text("whole")
    with replacing(path) as beside:
        beside.write_text("half")
        left = beside.with_name(beside.name + ".csv")
        left.write_text("as a killed run leaves it")
    remove_half_written(tmp_path / "results", tmp_path / "missing")
    assert [p.name for p in path.parent.iterdir()] == ["b.csv"]


@pytest.fixture
def package(tmp_path):
    files = {
        "scripts/go.py": "import json\nfrom study import a\nfrom study.b import c\n",
        "study/a.py": "def f():\n    from study.deep import late\n    return late\n",
        "study/b.py": "import study.d\nif TYPE_CHECKING:\n    from study import typed\n",
        "study/d.py": "from study import b\n",
        "study/deep/__init__.py": "",
        "study/deep/late.py": "",
        "study/typed.py": "",
        "study/named.py": "",
        "study/unused.py": "",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def stems(package, **options):
    return [
        Path(p).relative_to(package / "study").as_posix() for p in rests_on(package / "scripts" / "go.py", **options)
    ]


def test_modules_are_followed_through_one_another(package):
    assert stems(package) == ["a.py", "b.py", "d.py", "deep/__init__.py", "deep/late.py"]
    assert "named.py" in stems(package, also=["study.named"])
    assert stems(package, without=["study.b"]) == ["a.py", "deep/__init__.py", "deep/late.py"]


def test_a_module_that_is_no_python_is_named(package):
    (package / "study" / "a.py").write_text("def (\n")
    with pytest.raises(StudyError, match=r"a\.py cannot be read as Python"):
        stems(package)


def test_simulation_does_not_rest_on_identification():
    script = Path("scripts/make_record.py")
    cut = [
        "study.identify.estimators",
        "study.identify.estimators.base",
        "study.records.spectra",
        "study.identify.frequency_domain.local_polynomial",
    ]
    found = rests_on(ROOT / script, without=cut)
    names = {Path(p).name for p in found}
    assert {"simulate.py", "kernels.py", "motion.c", "program.h", "excitation.py", "terms.py", "record.py"} <= names
    assert not {"in_reverse.py", "spectra.py", "inputs.py", "coefficients.py", "local_polynomial.py"} & names


def test_steps_write_files_that_are_never_half_there():
    """By ``study.support.files`` or ``tables.write_table``: what ``write_text`` began a killed run leaves as it is."""
    for path in sorted((ROOT / "scripts").glob("*.py")):
        assert not re.search(r"[.](write_text|write_bytes|to_csv[(](Path|output|page|csv)\b)", path.read_text()), (
            path.name
        )
