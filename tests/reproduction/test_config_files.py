"""Files of the configuration: headings, rows, names, models, and YAML that nothing executes."""

import shutil
import time
from pathlib import Path

import pytest

from study.commands import measurements
from study.reproduction.config import load_config
from study.reproduction.settings import StudySettings
from study.support.config_files import TableRow, read_rows, read_yaml
from study.support.errors import StudyError
from tests.reproduction.test_config import ROW, refused, spoil

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("name", ["all", "claims", "record", "draw_many_errors", "benchmarks", "estimators_200"])
def test_names_that_are_taken(folder, name):
    shutil.copytree(ROOT / "rules", folder.parent / "rules")
    spoil(folder / "cases.tsv", "\nduffing\t", f"\n{name}\t")
    sentence = refused(folder)
    assert f"cases.tsv, row 3 (case '{name}'): '{name}' is the name of a" in sentence
    assert sentence.endswith("give the case another")


@pytest.mark.parametrize(
    "name", ["identify.duffing", "compare.silverbox", "claims.csv", "summary.md", "v_.2", "v2.", "a" * 65, "a" * 300]
)
def test_names_that_no_file_or_rule_may_have(folder, name):
    spoil(folder / "cases.tsv", "\nduffing\t", f"\n{name}\t")
    sentence = refused(folder)
    assert "cases.tsv, row 3 (case '" in sentence
    assert f"case is '{name[:56]}" in sentence
    assert sentence.endswith("a dot between two digits alone")


def test_a_record_that_is_a_case(folder):
    for name in ("silverbox", "silverbox_climb"):
        with pytest.raises(StudyError, match=rf"row 2 \(record 'silverbox'\): '{name}' is a case of cases.tsv"):
            measurements.load_measurements(folder, [name])
    for name in ("silverbox_climb", "damper"):
        with pytest.raises(StudyError, match=f"'{name}' is another target of the workflow; give the record"):
            measurements.load_measurements(folder, targets=[name])


def test_a_byte_order_mark_is_none_of_the_table(folder):
    table = folder / "cases.tsv"
    table.write_bytes(b"\xef\xbb\xbf" + table.read_bytes())
    assert load_config(folder).cases == load_config(ROOT / "config").cases


def test_rows_are_counted_as_an_editor_counts_lines(folder):
    spoil(folder / "cases.tsv", ROW, "\n\n" + ROW.replace("1.0", "-1.0"))
    assert "row 5 (case 'duffing')" in refused(folder)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("\ttitle\n", "\ttitel\n", "its heading names 'titel', which is no column"),
        ("\ttitle\n", "\tlevel\n", "its heading names 'level' twice"),
        ("noise\talso", "also", "its heading lacks the column 'noise'"),
    ],
)
def test_faults_of_the_heading(folder, old, new, says):
    spoil(folder / "cases.tsv", old, new)
    assert says in refused(folder)


@pytest.mark.parametrize("name", ["config.yaml", "cases.tsv"])
@pytest.mark.parametrize("content", [None, b"", b"\xff\xfe\x00", b"- a\n- b\n"])
def test_files_that_are_none(folder, name, content):
    if content is None:
        (folder / name).unlink()
    else:
        (folder / name).write_bytes(content)
    assert name in refused(folder)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("value: 2.0e7", "value: much", "value of cubic_stiffness is 'much'"),
        ("cubic_stiffness", "cubic_stifness", "there is no term 'cubic_stifness'"),
        (", value: 2.0e7", "", "gives no value for k3"),
        ("value: 1.0", "value: -1.0", "value of inertia is -1"),
        ("cubic_stiffness, value: 2.0e7", "own, force: 'u*tension', value: 1.0", "tension"),
    ],
)
def test_faults_of_a_model(folder, old, new, says):
    spoil(folder.parent / "models" / "duffing.yaml", old, new)
    sentence = refused(folder)
    assert "duffing.yaml" in sentence
    assert says in sentence


def test_more_inputs_than_segments(folder):
    spoil(folder / "config.yaml", "samples: 8192", "samples: 512")
    assert "cut the record into 1; 2 inputs need 3 or more" in refused(folder)


def test_more_inputs_than_a_band_tells_apart(folder):
    spoil(folder / "config.yaml", "half_width: 40", "half_width: 5")
    assert "half_width is 5; 2 inputs of degree 2 have 9 unknowns in a band, which needs 8 or more" in refused(folder)


class Pair(TableRow):
    a: str
    b: float


def test_quotes_are_plain_text(tmp_path):
    (tmp_path / "table.tsv").write_text('a\tb\n"open\t1\nshut"\t2\n')
    assert [row.a for _, row in read_rows(tmp_path / "table.tsv", Pair)] == ['"open', 'shut"']


def test_yaml_is_read_without_executing_anything(tmp_path):
    (tmp_path / "a.yaml").write_text("a: !!python/object/apply:os.system ['touch done']\n")
    with pytest.raises(StudyError, match=r"uses the YAML tag .* in line 1"):
        read_yaml(tmp_path / "a.yaml", StudySettings)
    assert not (tmp_path / "done").exists()


def test_a_yaml_bomb_is_refused_at_once(folder):
    """Nine levels of nine aliases each: built, they would be as many entries as the memory holds, and more."""
    levels = ["&a0 [1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    levels += [f"&a{n} [{', '.join([f'*a{n - 1}'] * 9)}]" for n in range(1, 10)]
    bomb = "noises: [" + ", ".join(levels) + "]"
    spoil(folder / "config.yaml", "noises: [0.0, 0.01, 0.05, 0.10]", bomb)
    begun = time.monotonic()
    sentence = refused(folder)
    assert time.monotonic() - begun < 1.0
    assert "config.yaml uses the YAML anchor or alias 'a0' in line " in sentence
