"""Whatever is fed in: one sentence with file, value and what was expected, exit 2, nothing written, nothing lost."""

import re
from pathlib import Path

import pytest

from study import cli
from tests.hostile.corpus import MODEL, TRUE, Case, cases, csv

CASES = cases()
# A sentence that says what to do instead says what was expected.
EXPECTED = re.compile(
    r"expected|did you mean|--help|known are|are known|may be|may hold|is read|are read|give |fill the gap|leave |"
    r"take a |write the value|name them by|the functions are|such as|at most|use letters|are the channels|must hold|"
    r"fit a longer"
)
GOOD = {"rig.csv": csv(), "rig.yaml": MODEL.encode(), "true.yaml": TRUE.encode()}


def content() -> dict[str, bytes]:
    """Every file below this folder, links and pipes by their names alone."""
    paths = [p for p in Path().rglob("*") if p.is_symlink() or not p.is_dir()]
    return {str(p): p.read_bytes() if p.is_file() and not p.is_symlink() else b"" for p in paths}


def test_the_corpus_is_as_wide_as_it_claims() -> None:
    assert len(CASES) >= 300
    assert {case.words[0] for case in CASES if case.words} >= {
        "compare", "diagnose", "add", "drop", "explore", "simulate", "trial", "terms", "history",
    }  # fmt: skip


@pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])
def test_one_sentence(
    case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for name, data in {**GOOD, **case.files}.items():
        Path(name).write_bytes(data)
    if case.prepare is not None:
        case.prepare()
    before = content()
    code = cli.main(list(case.words))
    out, err = capsys.readouterr()
    assert code == 2, err
    assert out == ""
    said = err.rpartition("\r")[2].removesuffix("\n")  # behind a line of progress, which is taken back
    assert said.strip().startswith("study: "), err
    assert said.isprintable() or "\u202e" not in said
    assert not set(said) & set("\n\x1b\x07\0\u202e")
    assert len(said) < 1000
    for part in case.said:
        assert part in said
    assert EXPECTED.search(said), said
    assert content() == before
    assert not any(p.is_dir() for p in tmp_path.iterdir())
