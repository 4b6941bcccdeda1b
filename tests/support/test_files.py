"""Writing a file is one step: it is new, or as it was."""

import errno
import os
import resource
import stat
from pathlib import Path

import pytest

from study.equations.model_file import read_model
from study.equations.terms import get
from study.support import files
from study.support.errors import StudyError
from tests.model_files import add_term


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o664, 0o755])
def test_permission_bits_stay(mode: int, tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text("terms: [inertia]\n")
    path.chmod(mode)
    add_term(path, get("cubic_stiffness"))
    assert stat.S_IMODE(path.stat().st_mode) == mode


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "real.yaml").write_text("terms: [inertia]\n")
    (tmp_path / "rig.yaml").symlink_to("real.yaml")
    add_term(tmp_path / "rig.yaml", get("cubic_stiffness"))
    assert (tmp_path / "rig.yaml").is_symlink()
    assert "cubic_stiffness" in read_model(tmp_path / "real.yaml")


def test_a_new_file_has_the_users_permissions(tmp_path: Path) -> None:
    old = os.umask(0o027)
    try:
        files.replace_file(tmp_path / "new.yaml", b"x")
    finally:
        os.umask(old)
    assert stat.S_IMODE((tmp_path / "new.yaml").stat().st_mode) == 0o640


def test_no_space_left_keeps_the_old_file(tmp_path: Path) -> None:
    """The kernel refuses the write half way, as on a full disk: here by the limit on the size of a file."""
    path = tmp_path / "rig.yaml"
    old = b"# " + b"x" * 5000 + b"\nterms: [inertia]\n"
    path.write_bytes(old)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))
    try:
        with pytest.raises(StudyError, match=r"rig\.yaml: cannot be written .* and is as it was"):
            add_term(path, get("cubic_stiffness"))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert path.read_bytes() == old
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("step", ["fsync", "replace"])
def test_a_failure_at_any_step_keeps_the_old_file(step: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text("terms: [inertia]\n")

    def fail(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(*((os, "fsync") if step == "fsync" else (Path, "replace")), fail)
    with pytest.raises(StudyError, match="No space left on device"):
        add_term(path, get("cubic_stiffness"))
    assert path.read_text() == "terms: [inertia]\n"
    assert list(tmp_path.iterdir()) == [path]


def test_an_interrupt_leaves_nothing_behind(tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text("old")

    def interrupted() -> None:
        with files.replacing(path) as beside:
            beside.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_write_protected_file_is_not_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text("terms: [inertia]\n")
    monkeypatch.setattr(os, "access", lambda *_: False)  # as for anybody but root
    with pytest.raises(StudyError, match="write-protected"):
        add_term(path, get("cubic_stiffness"))
    assert path.read_text() == "terms: [inertia]\n"


def test_a_folder_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match="No such file or directory"):
        files.replace_file(tmp_path / "none" / "rig.yaml", b"x")


def test_a_folder_where_one_of_many_files_goes_is_refused_before_any_is_written(tmp_path: Path) -> None:
    (tmp_path / "out" / "b.csv").mkdir(parents=True)
    wanted = dict.fromkeys(("a.csv", "b.csv", "c.csv"), b"x")
    with pytest.raises(StudyError, match=r"b\.csv: cannot be written \(a folder is in its place\)"):
        files.write_files(tmp_path / "out", wanted)
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["b.csv"]
