"""The whole workflow on a small configuration, in a copy of the project: what runs, runs again, is refused."""

import hashlib
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

pytestmark = pytest.mark.long
ROOT = Path(__file__).parents[2]
SNAKEMAKE = str(Path(sys.executable).parent / "snakemake")
PARTS = ("Snakefile", "rules", "config", "models", "scripts", "study", "profiles")
SMALL = [
    (r"samples: 8192", "samples: 2048"),
    (r"length: 512", "length: 256"),
    (r"(?s)(monte_carlo:\n  seeds:) \d+", r"\1 3"),
    (r"(?s)(estimator_errors:\n  seeds:) \d+", r"\1 2"),
    (r"(?s)(ensembles:\n  seeds:) \d+", r"\1 2"),
    (r"\nexcitations:\n", "\nexcitations:\n  other: {kind: gaussian_lowpass, seed: 7}\n"),
]
STRUCTURES = ("two_masses", "three_masses", "beam")
DUFFING = "duffing\tduffing\treport\t1.0\t0\t\t21\t22\t23\t24\t3\t\t\t\tDuffing system"
TAB = "\t"
NOISY = "noisy\tduffing_van_der_pol\tother\t1.0\t0.05\t\t53\t54\t55\t\t\t\t\t\tCombined system with noise"


def project(folder, *rows):
    """A copy of the project with a small configuration; modules keep their times, and so their compiled kernels."""
    for part in PARTS:
        source = ROOT / part
        if source.is_dir():
            shutil.copytree(source, folder / part)
        else:
            shutil.copy2(source, folder / part)
    settings = folder / "config" / "config.yaml"
    text = settings.read_text()
    for pattern, put in SMALL:
        text, count = re.subn(pattern, put, text)
        assert count == 1, f"config.yaml no longer holds {pattern}"
    settings.write_text(text)
    structures = folder / "config" / "structures.yaml"
    structures.write_text(structures.read_text().replace("samples: 16384", "samples: 4096").replace("2048", "512"))
    heading = (ROOT / "config" / "cases.tsv").read_text().splitlines()[0]
    (folder / "config" / "cases.tsv").write_text("\n".join([heading, *rows]) + "\n")
    return folder


def run(folder, *words, code=0):
    """What Snakemake says."""
    done = subprocess.run([SNAKEMAKE, *words], cwd=folder, capture_output=True, text=True, timeout=300)
    assert done.returncode == code, done.stderr[-3000:]
    return done.stderr + done.stdout


def planned(folder, *targets):
    """Jobs that would run, by rule; of Part I, whose settings are made small here, if no target is named."""
    said = run(folder, "-n", *(targets or ("part1",)))
    if "Nothing to be done" in said:
        return {}
    table = said.split("Job stats:")[1]
    return {name: int(count) for name, count in re.findall(r"^(\S+) +(\d+)$", table, re.MULTILINE) if name != "total"}


def digests(folder):
    """Of every table in results."""
    paths = sorted((folder / "results").rglob("*.csv"))
    return {str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest() for p in paths}


@contextmanager
def edited(path, old, new):
    """A file with a text replaced for a while; its time changes, then changes back."""
    text, times = path.read_text(), path.stat()
    assert old in text
    path.write_text(text.replace(old, new))
    try:
        yield
    finally:
        path.write_text(text)
        os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """The small study, complete."""
    folder = project(tmp_path_factory.mktemp("study"), DUFFING, NOISY)
    (folder / "said.txt").write_text(run(folder, "-j2", "--verbose", "part1"))
    return folder


def test_a_row_of_the_table_gives_every_product(built):
    for case in ("duffing", "noisy"):
        for name in ("record.csv", "frequency_response.csv", "coherence.csv", "noise.csv", "parameters.csv"):
            assert (built / "results" / case / name).stat().st_size > 100
    drawn = {path.name for path in (built / "figures").iterdir()}
    stems = ["figure_21", "figure_22", "figure_23", "figure_24", "figure_3", "figure_53", "figure_54", "figure_55"]
    structures = [f"{case}_{kind}" for case in STRUCTURES[:2] for kind in ("connections", "coherence")]
    others = ("noisy_histogram", "estimators", "beam_measured", *structures)
    assert drawn == {f"{stem}.{ending}" for stem in (*stems, *others) for ending in ("png", "svg")}
    page = (built / "results" / "summary.md").read_text()
    assert "| duffing " in page
    assert "| noisy " in page
    assert "## Run times" in page


def test_snakemake_looks_for_work_when_a_job_ends_not_all_the_time(built):
    said = (built / "said.txt").read_text()
    jobs, looks = said.count("Finished jobid"), said.count("Resources before job selection")
    assert jobs > 15
    assert looks <= jobs + 1, "with a number of jobs a second to hold to, it is hundreds of times"


def test_a_new_row_runs_its_own_jobs_and_what_joins_all_cases(built):
    with edited(built / "config" / "cases.tsv", DUFFING, f"{DUFFING}\nmine\tlinear\treport\t2\t0{10 * TAB}Mine"):
        assert planned(built) == {
            "record": 1, "identify.mine": 1, "estimator_errors": 1, "draw_estimators": 1, "parameters": 1,
            "summary": 1, "part1": 1,
        }  # fmt: skip


def test_a_second_run_finds_nothing_to_do(built):
    assert planned(built) == {}


def test_part_two_is_a_job_a_chapter_and_one_page_has_both(built):
    jobs = planned(built, "part2")
    assert {name for name in jobs if name.startswith("chapter.")} == {
        f"chapter.{name}" for name in ("excitations", "forces", "noise", "structures", "varying")
    }
    assert {"ladders", "part_two_claims", "draw_chapter.noise", "part2"} <= set(jobs)
    assert planned(built, "all").keys() == {*(jobs.keys() - {"part2"}), "study_page", "all"}


def test_report_is_one_file_with_every_figure_and_table(built):
    run(built, "part1", "--report", "report.html")
    page = (built / "report.html").read_text()
    for name in ("figure_21.png", "figure_55.png", "claims.html", "parameters.html", "summary.html"):
        assert name in page
    assert not re.search(r"<(script|link|img)[^>]+(src|href)=[\"']https?:", page)


def test_touched_identification_runs_again_without_simulation(built):
    module = built / "study" / "identify" / "frequency_domain" / "conditioned.py"
    times = module.stat()
    module.touch()
    jobs = planned(built)
    os.utime(module, ns=(times.st_atime_ns, times.st_mtime_ns))
    assert {"identify.duffing", "identify.noisy", "claims", "parameters", "summary"} <= set(jobs)
    assert "record" not in jobs


def test_touched_style_draws_again_without_simulation_or_claims(built):
    with edited(built / "study" / "figures" / "study.mplstyle", "font.size: 10", "font.size: 11"):
        jobs = planned(built)
    assert set(jobs) == {
        "identify.duffing", "identify.noisy", "draw_estimators", "parameters", "summary", "part1",
        *(f"structure.{case}" for case in STRUCTURES), "structures", "structure_claims",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("file", "old", "new"),
    [("config.yaml", "seed: 7}", "seed: 8}"), ("cases.tsv", "other\t1.0\t0.05", "other\t1.0\t0.06")],
)
def test_a_changed_seed_or_row_runs_its_case_alone(built, file, old, new):
    with edited(built / "config" / file, old, new):
        jobs = planned(built)
    assert (jobs["record"], jobs["identify.noisy"]) == (1, 1)
    assert not {"identify.duffing", "claims", "excitation_reading"} & set(jobs)
    assert ("estimator_errors" in jobs) == (file == "cases.tsv"), "ensembles have seeds of their own"


def test_seeds_of_the_study_are_no_business_of_the_ensembles(built):
    target, settings = "results/monte_carlo/noisy.csv", built / "config" / "config.yaml"
    run(built, "-j1", target)
    try:
        with edited(settings, "seed: 7}", "seed: 8}"), edited(settings, "noise_seed: 54", "noise_seed: 55"):
            assert planned(built, target) == {}
    finally:
        (built / target).unlink()


def test_the_seed_of_the_noise_is_no_business_of_what_has_none(built):
    with edited(built / "config" / "config.yaml", "noise_seed: 54", "noise_seed: 55"):
        jobs = planned(built)
    assert (jobs["record"], jobs["identify.noisy"], jobs["claims"]) == (1, 1, 1), "claims judge noisy records"
    assert not {"identify.duffing", "excitation_reading", "integrator_steps", "estimator_errors"} & set(jobs)


def test_targets_by_name_and_by_number(built):
    (built / "figures" / "figure_21.png").rename(built / "kept.png")
    assert planned(built, "figures/figure_21.png") == {"identify.duffing": 1}
    assert set(planned(built, "duffing")) == {"identify.duffing", "duffing"}
    (built / "kept.png").rename(built / "figures" / "figure_21.png")
    assert planned(built, "noisy") == {}
    monte_carlo = {"ensemble": 2, "rates": 1, "monte_carlo": 1}
    estimators = {"many_errors": 2, "join_errors": 1, "draw_many_errors": 1, "estimators": 1}
    assert planned(built, "monte_carlo", "estimators") == {**monte_carlo, **estimators}


def test_measured_records_are_planned_without_their_data_and_ask_for_them_by_name(built, monkeypatch):
    monkeypatch.delenv("STUDY_DATA", raising=False)
    jobs = planned(built, "gallery")
    assert {"climb.silverbox", "compare.bouc_wen", "diagnose.silverbox", "gallery", "gallery_page"} <= set(jobs)
    damper = {name for name in jobs if "damper" in name or "dahl" in name}
    assert set(planned(built, "damper")) == damper | {"damper"}, "an entry's target makes all of its rows, no other's"
    said = run(built, "-j1", "results/silverbox/comparison.json", code=1)
    assert "study: $STUDY_DATA/silverbox/SNLS80mV.mat: STUDY_DATA is not set; expected the folder that holds" in said
    assert "Traceback" not in said


def test_killed_at_work_and_finished_on_one_core_gives_the_same_bytes(built, tmp_path):
    folder = project(tmp_path, DUFFING, NOISY)
    targets = ["results/duffing/parameters.csv", "results/excitation_reading.csv"]
    process = subprocess.Popen(
        [SNAKEMAKE, "-j2", *targets], cwd=folder, start_new_session=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    patience = time.monotonic() + 60.0
    while not (folder / "results" / "duffing" / "record.csv").exists() and time.monotonic() < patience:
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    assert (folder / "results" / "duffing" / "record.csv").exists()
    run(folder, "-j1", *targets)
    expected = digests(built)
    found = digests(folder)
    assert len(found) > 4
    assert found == {name: expected[name] for name in found}


@pytest.mark.parametrize(
    ("file", "old", "new", "says"),
    [
        ("cases.tsv", "\tduffing\treport", "\tdufing\treport", "row 2 (case 'duffing'): there is no model 'dufing'"),
        ("config.yaml", "length: 256", "length: 4096", "segments.length is 4096, longer than the record of 2048"),
        ("cases.tsv", "duffing\tduffing", "claims\tduffing", "row 2 (case 'claims'): 'claims' is the name of a rule"),
        ("cases.tsv", "duffing\tduffing", "all\tduffing", "row 2 (case 'all'): 'all' is the name of a rule"),
        ("reported.tsv", "table_1.duffing.k3\t", "table_1.dufing.k3\t", "'table_1.duffing.k3' is near it"),
    ],
)
def test_bad_configuration_is_refused_in_one_sentence(built, file, old, new, says):
    with edited(built / "config" / file, old, new):
        said = run(built, "-j2", code=2)
    lines = [line for line in said.splitlines() if not line.startswith("Using workflow")]
    assert len(lines) == 1
    assert lines[0].startswith("study: config/")
    assert says in lines[0]


def test_a_fault_in_a_job_is_said_in_one_sentence(tmp_path):
    folder = project(tmp_path, DUFFING.replace("report\t1.0", "report\t1e14"))
    said = run(folder, "-j1", "results/duffing/record.csv", code=1)
    assert "study: case 'duffing' at level 1e+14: the simulation of 'duffing' diverged at t = " in said
    assert "Traceback" not in said
    assert not (folder / "results" / "duffing" / "record.csv").exists(), "a run that diverges leaves no record"
