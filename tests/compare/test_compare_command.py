"""``study compare`` as a user meets it: files in, files out, one sentence for whatever goes wrong."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from study import cli
from study.equations.model import Model, free
from study.equations.simulate import simulate
from study.equations.terms import get
from study.records.excitation import Excitation, force
from study.records.record import Record, write_csv
from study.support.errors import StudyError
from study.support.files import check_folder, write_files
from tests.public_records import DATA, needs

DT = 0.02
LINEAR = "name: rig\nterms: [inertia, linear_damping, linear_stiffness]\n"
WRITTEN = {
    "explore.html", "comparison.json", "comparison.csv", "coefficients.csv", "force_error.csv",
    "response_spectrum.csv", "growth.csv",
    "missing_force_curves.csv", "missing_force_map.csv", "error_in_time.csv",
    *(f"{name}.{kind}" for name in ("response", "force_error", "missing_force", "error_in_time")
      for kind in ("png", "svg")),
}  # fmt: skip


def record(level: float = 1.0, seed: int = 1, samples: int = 4096) -> Record:
    values = {"m": 1.0, "c": 3.77, "k": 355.3, "c2": 400.0}
    names = ("inertia", "linear_damping", "linear_stiffness", "quadratic_damping")
    truth = Model("truth", tuple(free(get(n)).with_values(values) for n in names))
    history = force(Excitation(level=level), samples, DT, seed)
    u = simulate(truth, history, DT)["displacement"]
    noisy = u + 0.02 * np.std(u) * np.random.default_rng(seed).standard_normal(samples)
    return Record(DT, {"force": history, "displacement": noisy})


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_csv(record(), Path("rig.csv"))
    Path("rig.yaml").write_text(LINEAR)


def refused(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """The one sentence; nothing may be written."""
    before = sorted(Path().rglob("*"))
    assert cli.main(["compare", *words]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("study: ")
    assert err.count("\n") == 1
    assert sorted(Path().rglob("*")) == before
    return err


def test_a_comparison_is_printed_and_written(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["compare", "rig.csv", "--model", "rig.yaml"]) == 0
    out, _ = capsys.readouterr()
    folder = Path("results/rig")
    assert {p.name for p in folder.iterdir()} == WRITTEN
    content = json.loads((folder / "comparison.json").read_text())
    assert content["says"] in out
    assert "square of velocity and is odd" in content["says"]
    assert content["error"]["response"] > 2.0 * content["noise_floor"]["response"]
    assert len(out.splitlines()) < 30
    assert max(len(line) for line in out.splitlines() if line != content["says"]) < 120
    for picture in folder.glob("*.png"):
        assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.mark.long
def test_the_same_input_gives_the_same_bytes() -> None:
    for folder in ("one", "two"):
        assert cli.main(["compare", "rig.csv", "--model", "rig.yaml", "--out", folder]) == 0
    for path in Path("one").iterdir():
        assert path.read_bytes() == (Path("two") / path.name).read_bytes(), path.name


@pytest.mark.long
def test_several_records_give_a_table_by_level(capsys: pytest.CaptureFixture[str]) -> None:
    for level in (0.3, 3.0):
        write_csv(record(level, round(10 * level)), Path(f"level_{level:g}.csv".replace("0.", "0")))
    words = ["compare", "level_03.csv", "level_3.csv", "--model", "rig.yaml", "--out", "levels"]
    assert cli.main(words) == 0
    content = json.loads(Path("levels/comparison.json").read_text())
    moves = {row["key"]: row["moves"] for row in content["where"]["level"]}
    assert moves == {"m": False, "c": True, "k": False}
    assert [r["record"] for r in content["records"]] == ["level_03", "level_3"]
    assert {"level_3_response.png", "coefficients_by_level.png", "coefficients_by_level.csv"} <= {
        p.name for p in Path("levels").iterdir()
    }
    assert "Coefficients move with the level: c by" in capsys.readouterr().out


def test_ranges_response_and_units_are_taken_from_the_command_line() -> None:
    values = record()
    columns = np.column_stack([values["force"], values["displacement"]])
    np.savetxt("plain.csv", columns, delimiter=",", header="V1,V2", comments="")
    words = [
        "compare", "plain.csv", "--column", "force=V1", "--column", "displacement=2", "--unit", "force=V", "--unit",
        "displacement=V", "--fs", "50", "--judge", "100:1500", "--fit", "2000:", "--model", "rig.yaml", "--out", "v",
    ]  # fmt: skip
    assert cli.main(words) == 0
    content = json.loads(Path("v/comparison.json").read_text())
    assert content["fit"]["samples"] == [2000, 4096]
    assert content["fit"]["judged"] == [100, 1500]
    assert {c["key"]: c["unit"] for c in content["coefficients"]}["k"] == "V/V"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["rig.csv", "--model", "absent.yaml"], "absent.yaml"),
        (["absent.csv", "--model", "rig.yaml"], "absent.csv"),
        (["rig.csv", "--model", "rig.yaml", "--fit", "0:3000", "--judge", "2000:4000"], "overlap"),
        (["rig.csv", "--model", "rig.yaml", "--fit", "0:9000"], "64 samples or more"),
        (["rig.csv", "--model", "rig.yaml", "--fit", "5:2"], "ends before it begins"),
        (["rig.csv", "--model", "rig.yaml", "--judge", "first half"], "no range of samples"),
        (["rig.csv", "--model", "rig.yaml", "--response", "acceleration"], "no acceleration was measured"),
        (["rig.csv", "--model", "rig.yaml", "--cutoff", "30"], "cut-off is 30 Hz"),
        (["rig.csv", "--model", "rig.yaml", "--column", "force"], "--column force=V1"),
        (["rig.csv", "--model", "rig.yaml", "--unit", "force=furlong"], "furlong"),
        (["rig.csv", "--model", "rig.yaml", "--out", "rig.csv/deeper"], "cannot be written"),
        (["rig.csv", "--model", "rig.csv"], "rig.csv"),
        (["rig.csv"], "--model"),
    ],
)
def test_bad_input_gets_one_sentence_and_writes_nothing(
    words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert said in refused(capsys, *words)


def test_a_record_too_short_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    write_csv(record().part(0, 100), Path("short.csv"))
    assert "64 samples or more" in refused(capsys, "short.csv", "--model", "rig.yaml")


@pytest.mark.long
def test_a_blow_with_a_long_rest_behind_it_is_compared_where_no_force_acts() -> None:
    """The judged half has no force: what it balances there is the force of inertia, as in a free decay."""
    values = {"m": 1.0, "c": 0.8, "k": 400.0}
    names = ("inertia", "linear_damping", "linear_stiffness")
    blow = np.where(np.arange(4096) < 100, force(Excitation(), 4096, 0.01, 1), 0.0)
    u = simulate(Model("truth", tuple(free(get(n)).with_values(values) for n in names)), blow, 0.01)["displacement"]
    write_csv(Record(0.01, {"force": blow, "displacement": u}), Path("blow.csv"))
    assert cli.main(["compare", "blow.csv", "--model", "rig.yaml", "--out", "blow"]) == 0
    error = json.loads(Path("blow/comparison.json").read_text())["error"]
    assert 0.0 < error["force"] < 1e-3


def test_noise_instead_of_a_response_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    rng = np.random.default_rng(5)
    values = record()
    write_csv(values.with_channels({"displacement": rng.standard_normal(len(values))}), Path("noise.csv"))
    assert "nothing in common" in refused(capsys, "noise.csv", "--model", "rig.yaml")


def test_a_folder_that_cannot_be_written_is_found_before_the_work(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(StudyError, match="writable folder"):
        check_folder(tmp_path / "file" / "results")
    check_folder(tmp_path / "not" / "yet" / "there")
    assert not (tmp_path / "not").exists()
    with pytest.raises(StudyError, match="another --out"):
        check_folder(Path("a\0b"))


def test_results_do_not_go_into_a_folder_with_the_name_of_a_file(capsys: pytest.CaptureFixture[str]) -> None:
    assert "expected such as better" in refused(capsys, "rig.csv", "--model", "rig.yaml", "--out", "better.yaml")
    assert not Path("better.yaml").exists()


def test_files_are_written_together_or_not_at_all(tmp_path: Path) -> None:
    write_files(tmp_path / "out", {"a.txt": b"old", "b.txt": b"old"})
    (tmp_path / "out" / "c.txt").mkdir()  # cannot be replaced by a file
    with pytest.raises(StudyError, match=r"c\.txt"):
        write_files(tmp_path / "out", {"c.txt": b"new", "a.txt": b"new", "b.txt": b"new"})
    assert not [p for p in (tmp_path / "out").iterdir() if p.name.startswith(".study")]


def test_a_full_disk_leaves_the_old_results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_files(tmp_path, {"a.txt": b"old", "b.txt": b"old"})
    written = Path.write_bytes

    def full(path: Path, data: bytes) -> int:
        if data == b"last":
            raise OSError(28, "No space left on device")
        return written(path, data)

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(StudyError, match="No space left"):
        write_files(tmp_path, {"a.txt": b"new", "b.txt": b"last"})
    assert (tmp_path / "a.txt").read_text() == "old"
    assert sorted(p.name for p in tmp_path.iterdir() if p.suffix == ".txt") == ["a.txt", "b.txt"]


def test_help_is_quick_and_imports_nothing_heavy() -> None:
    code = (
        "import sys, study.cli; study.cli.main(['compare', '--help']); print(*{m.split('.')[0] for m in sys.modules})"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not {"numpy", "scipy", "pandas", "matplotlib"} & set(done.stdout.splitlines()[-1].split())
    assert "--judge A:B" in done.stdout


# ---- public records


@pytest.mark.long
@needs("silverbox")
def test_the_silverbox_lacks_a_cubic_stiffness_and_then_little(capsys: pytest.CaptureFixture[str]) -> None:
    words = [
        "compare", str(DATA / "silverbox" / "SNLS80mV.csv"), "--column", "force=V1", "--column", "displacement=V2",
        "--unit", "force=V", "--unit", "displacement=V", "--fs", "610.3515625", "--fit", "40650:127400",
        "--judge", "100:40575", "--model", "rig.yaml",
    ]  # fmt: skip
    assert cli.main([*words, "--out", "linear"]) == 0
    assert "cube of displacement and is odd" in capsys.readouterr().out
    more = "cubic_stiffness, quadratic_stiffness, quadratic_damping, constant_force"
    Path("rig.yaml").write_text(LINEAR.replace("linear_stiffness]", f"linear_stiffness, {more}]"))
    assert cli.main([*words, "--out", "drag"]) == 0
    linear, drag = (json.loads(Path(f"{d}/comparison.json").read_text())["rms"] for d in ("linear", "drag"))
    assert linear["unit"] == "V"
    assert 0.010 < linear["response_error"] < 0.020
    assert drag["response_error"] < 0.32e-3


@pytest.mark.long
@needs("boucwen")
def test_the_bouc_wen_record_is_no_function_of_the_motion_and_hysteresis_reaches_its_noise(
    capsys: pytest.CaptureFixture[str],
) -> None:
    words = [
        "compare", str(DATA / "boucwen" / "train.h5"), "--group", "multisine", "--column", "force=u", "--column",
        "displacement=y", "--fs", "750", "--period", "8192", "--model", "rig.yaml", "--out", "bw",
    ]  # fmt: skip
    assert cli.main(words) == 0
    assert "no power of displacement or velocity explains it" in capsys.readouterr().out
    assert json.loads(Path("bw/comparison.json").read_text())["noise_floor"]["from"] == "scatter between periods"
    held = "{term: hysteresis, beta: 800.0, gamma: -1100.0}"  # the published system
    Path("rig.yaml").write_text(LINEAR.replace("linear_stiffness]", f"linear_stiffness, {held}]"))
    assert cli.main(words) == 0
    assert "which looks like noise (from the scatter between periods)" in capsys.readouterr().out


def test_a_record_too_short_to_be_fitted_is_refused_for_that(capsys: pytest.CaptureFixture[str]) -> None:
    write_csv(record().part(0, 130), Path("short.csv"))
    assert "has 65 samples, too few" in refused(capsys, "short.csv", "--model", "rig.yaml")


def test_a_decay_that_is_over_before_the_judged_part_is_not_called_a_model_that_never_moves(
    capsys: pytest.CaptureFixture[str],
) -> None:
    t, omega, zeta = np.arange(1200) / 200.0, 2.0 * np.pi, 0.46
    turns = omega * np.sqrt(1.0 - zeta**2)
    u = 0.02 * np.exp(-zeta * omega * t) * (np.cos(turns * t) + zeta * omega / turns * np.sin(turns * t))
    noisy = u + 2e-5 * np.random.default_rng(3).standard_normal(len(t))
    write_csv(Record(1 / 200.0, {"displacement": noisy}, name="decay"), Path("decay.csv"))
    words = ["compare", "decay.csv", "--free", "--model", "rig.yaml"]
    assert cli.main(words) == 0
    assert "Most of what is judged is noise" not in capsys.readouterr().out, "either part has some of the motion"
    assert cli.main([*words, "--fit", "0:600", "--judge", "600:1200", "--out", "decay"]) == 0
    said = capsys.readouterr().out
    assert "which looks like noise" in said
    assert "Most of what is judged is noise" in said
    found = {c["key"]: c["value"] for c in json.loads(Path("decay/comparison.json").read_text())["coefficients"]}
    assert found["c"] == pytest.approx(2.0 * zeta * omega, rel=2e-3)
    assert found["k"] == pytest.approx(omega**2, rel=2e-3)


@pytest.mark.long
def test_a_short_record_has_a_noise_floor_all_the_same(capsys: pytest.CaptureFixture[str]) -> None:
    write_csv(record().part(0, 500), Path("short.csv"))
    assert cli.main(["compare", "short.csv", "--model", "rig.yaml", "--out", "short"]) == 0
    found = json.loads(Path("short/comparison.json").read_text())
    assert 0.005 < found["noise_floor"]["response"] < found["error"]["response"]
    assert "inf" not in capsys.readouterr().out
    assert cli.main(["diagnose", "short.csv", "--model", "rig.yaml", "--out", "short"]) == 0
    assert json.loads(Path("short/diagnosis.json").read_text())["noise_floor"]["response"] > 0.005


@pytest.mark.long
def test_a_model_that_cannot_follow_is_said_to_mean_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    Path("bare.yaml").write_text("name: bare\nterms: [inertia, {term: linear_stiffness, value: 1.0e-9}]\n")
    assert cli.main(["compare", "rig.csv", "--model", "bare.yaml", "--out", "bare"]) == 0
    assert "its fitted coefficients mean nothing" in " ".join(capsys.readouterr().out.split())


def test_a_formula_that_is_no_number_somewhere_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    Path("own.yaml").write_text(LINEAR.replace("linear_stiffness]", 'linear_stiffness, {term: own, force: "log(u)"}]'))
    assert "the formula 'log(u)' has no finite value at t = " in refused(capsys, "rig.csv", "--model", "own.yaml")


def test_a_rate_that_the_times_deny_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    said = refused(capsys, "rig.csv", "--model", "rig.yaml", "--fs", "100")
    assert "an interval of 0.01 s is given (--fs or --dt), its times step by 0.02 s" in said
