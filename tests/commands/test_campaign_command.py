"""``study campaign``: a folder of records on one page, which a killed run does not begin anew."""

import json
from pathlib import Path

import numpy as np
import pytest

import study as st
from study.cli import main
from study.commands import campaign

MODEL = "name: rig\nterms: [inertia, linear_damping, linear_stiffness]\n"
READ = ("--model", "rig.yaml", "--no-measurement")


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three records of a rig that has become softer, and a file that is none."""
    folder = tmp_path_factory.mktemp("measured")
    for seed, (day, stiffness) in enumerate((("2026-01-10", 355.3), ("20260211", 355.3), ("2026-05-02", 330.0))):
        values = {"inertia": 1.0, "linear_damping": 3.77, "linear_stiffness": stiffness}
        model = st.Model(*(st.term(name, value=value) for name, value in values.items()))
        record = st.simulate(model, st.gaussian(samples=768, seed=seed + 1))
        noise = np.random.default_rng(seed).standard_normal(768)
        moved = record["displacement"] + 0.02 * np.std(record["displacement"]) * noise
        st.record({"force": record["force"], "displacement": moved}, dt=record.dt).save(folder / f"rig_{day}.csv")
    (folder / "notes.txt").write_text("the rig was moved in March\n")
    return folder


@pytest.fixture
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("rig.yaml").write_text(MODEL)


@pytest.mark.usefixtures("_elsewhere")
def test_what_was_found_is_kept_until_record_model_or_options_change(monkeypatch, capsys):
    Path("rigs").mkdir()
    for name in "ab":
        Path("rigs", f"{name}.csv").write_text(name)
    made = list[str]()

    def found(_arguments, _model, path, place, digest):
        made.append(path.stem)
        comparison = {
            "model": {"name": "rig"}, "error": {"response": 0.1}, "noise_floor": {"response": 0.1}, "coefficients": [],
        }  # fmt: skip
        diagnosis = {"verdict": "nothing_missing", "candidates": []}
        place.mkdir(parents=True, exist_ok=True)
        content = {"comparison.json": comparison, "diagnosis.json": diagnosis, campaign.SOURCE: {"sha256": digest}}
        for name, fields in content.items():
            (place / name).write_text(json.dumps(fields))
        return comparison, diagnosis

    monkeypatch.setattr(campaign, "_found", found)
    words = ["campaign", "rigs", *READ, "--out", "out"]
    for change, again in (
        (lambda: None, "ab"), (lambda: None, ""), (lambda: Path("rigs/a.csv").write_text("other"), "a"),
        (lambda: Path("rigs/b.record.yaml").write_text("fs: 50\n"), "b"),
        (lambda: Path("rig.yaml").write_text(MODEL + "# changed\n"), "ab"),
        (lambda: words.append("--as-sampled"), "ab"),
        (lambda: Path("out/b/diagnosis.json").write_text("{"), "b"), (lambda: words.extend(["--by", "level"]), ""),
    ):  # fmt: skip
        made.clear()
        change()
        assert main(words) == 0
        assert "".join(made) == again
    assert "2 records, 2 of them as found before" in capsys.readouterr().out


@pytest.mark.long
@pytest.mark.usefixtures("_elsewhere")
def test_a_folder_is_one_page_and_goes_on_where_a_run_was_killed(measured, monkeypatch, capsys):
    whole, made = campaign._found, list[str]()

    def counted(arguments, model, path, place, digest):
        made.append(path.stem)
        if len(made) == 3:
            raise KeyboardInterrupt
        return whole(arguments, model, path, place, digest)

    monkeypatch.setattr(campaign, "_found", counted)
    assert main(["campaign", str(measured), *READ, "--out", "out"]) == 130
    assert not Path("out/campaign.html").exists()
    assert main(["campaign", str(measured), *READ, "--out", "out"]) == 0
    # the file that is none is asked each time, a record that was found is not
    assert made == ["notes", "rig_2026-01-10", "rig_2026-05-02", "notes", "rig_2026-05-02", "rig_20260211"]
    said = capsys.readouterr().out
    assert "1 of 3 coefficients differ between the records by more than chance: k from" in said
    assert "all 3 verdicts are the same: nothing is missing" in said
    assert "3 records, 1 of them as found before, 1 refused" in said
    page = Path("out/campaign.html").read_text()
    assert page.count("<img ") == 1
    assert "notes.txt: no line with numbers is found" in page
    assert main(["campaign", str(measured), *READ, "--out", "out", "--by", "level"]) == 0
    assert made[6:] == ["notes"]
    Path("rig.yaml").write_text(MODEL + "# another file\n")
    place = Path("out/rig_2026-01-10")
    assert campaign._kept(place, "of something else") is None
    assert campaign._kept(place, json.loads((place / campaign.SOURCE).read_text())["sha256"]) is not None


@pytest.mark.usefixtures("_elsewhere")
@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["rig.yaml"], "rig.yaml: this is not a folder; expected one with records, or 'study compare' for a file"),
        (["empty"], "empty: there is no record in it; expected files such as rig.csv"),
        (["twice"], "two records are called a; expected a name for each"),
        (["twice/..", "--by", "date"], "there is no record in it"),
        (["bad"], "bad: no record could be used; the first: bad/a.csv:"),
        (["bad", "--by", "date"], "bad/a.csv: its name holds no day; expected one such as rig_2026-03-01.csv"),
    ],
)
def test_a_folder_that_cannot_be_used_is_refused_in_a_sentence(words, said, capsys):
    for folder, names in (("empty", ()), ("twice", ("a.csv", "a.txt")), ("bad", ("a.csv",))):
        Path(folder).mkdir()
        for name in names:
            Path(folder, name).write_text("nothing\n")
    assert main(["campaign", *words, *READ, "--out", "out"]) == 2
    assert said in capsys.readouterr().err
    assert not Path("out").exists()
