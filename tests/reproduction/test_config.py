"""The configuration: what the jobs are told, and one sentence for every fault before any of them starts."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from study.equations.model_file import read_model
from study.equations.simulate import simulate
from study.identify.estimators import ESTIMATORS, identify
from study.identify.estimators.base import Settings
from study.records.excitation import Excitation, force
from study.records.spectra import Segments
from study.reproduction.config import CURVES, load_config
from study.support.errors import StudyError

ROOT = Path(__file__).parents[2]
ROW = "duffing\tduffing\treport\t1.0\t0\t\t21\t22\t23\t24\t3\t\t\t\tDuffing system"


def spoil(path, old, new):
    text = path.read_text()
    assert old in text, f"{path.name} no longer holds {old!r}"
    path.write_text(text.replace(old, new, 1))


def refused(folder):
    """The sentence."""
    with pytest.raises(StudyError) as caught:
        load_config(folder)
    sentence = str(caught.value)
    assert "\n" not in sentence
    assert len(sentence) < 600
    return sentence


def test_every_case_of_the_report_is_there():
    study = load_config(ROOT / "config")
    assert list(study.cases) == [
        "linear", "duffing", "van_der_pol", "duffing_van_der_pol", "mathieu", "dead_band", "extreme",
        "variance_0.2", "variance_0.5", "variance_2.0", "noise_5", "noise_10", "noise_20",
    ]  # fmt: skip
    stems = [stem for case in study.cases.values() for stem in case.figures.values()]
    numbers = {int(stem.removeprefix("figure_")) for stem in stems if stem.startswith("figure_")}
    assert numbers == {*range(2, 9), *range(16, 62)}


def test_settings_of_a_case():
    study = load_config(ROOT / "config")
    record = study.record_settings("noise_10")
    assert record.noise == 0.1
    assert record.noise_seed == study.settings.noise_seed
    assert "noise_seed" not in study.record_settings("linear").plain(), (
        "the noise's seed is no business of a case without"
    )
    assert study.drawn("noise_10") == list(study.settings.drawn.with_noise)
    assert study.drawn("linear") == list(study.settings.drawn.without_noise)
    assert record.excitation.seed == study.settings.excitations["report"].seed
    assert "seed" not in str(record.without_seeds().plain()), "an ensemble brings seeds of its own"
    assert study.identification_settings("dead_band").relative["c"] == 0.05, "a case's own tolerance holds"
    assert study.identification_settings("duffing").relative["c"] == 0.02
    assert study.identification_settings("linear").also_assumed == "cubic_stiffness"


def test_figures_without_a_number_are_named_after_the_case(folder):
    with (folder / "cases.tsv").open("a") as table:
        table.write("mine\tduffing\treport\t3\t0\t\t\t\t\t\t\t\t\t\tMy own system\n")
    assert load_config(folder).cases["mine"].figures == {
        kind: f"mine_{kind}" for kind in ("linear", "nonlinear", "coherence", "histogram")
    }


def test_a_case_of_one_mass_has_neither_sensors_nor_limits_of_a_structure(folder):
    table = (folder / "cases.tsv").read_text().splitlines()
    (folder / "cases.tsv").write_text("\n".join([f"{table[0]}\tsensors", *(f"{row}\tfirst" for row in table[1:])]))
    assert "sensors and modal are for structures.tsv" in refused(folder)
    with (folder / "config.yaml").open("a") as settings:
        settings.write("limits: {changed: 0.05}\n")
    assert "limits are those of structures.yaml" in refused(folder)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("samples: 8192", "samples: -5", "sampling.samples is -5; expected 64 or more"),
        ("samples: 8192", "samples: many", "sampling.samples is 'many'; expected a whole number"),
        ("samples: 8192", "sample: 8192", "sampling: unknown key 'sample'; expected samples, dt"),
        ("dt: 0.02 ", "dt: .nan ", "sampling.dt is nan; expected a finite number"),
        ("dt: 0.02 ", "dt: 0.2 ", "fit_band is [0.3, 10.0]; it must rise and end below 2.5 Hz"),
        ("length: 512", "length: 8193", "segments.length is 8193, longer than the record of 8192 samples"),
        ("overlap: 0.5", "overlap: 1.5", "segments.overlap is 1.5; expected 0.95 or less"),
        ("window: hann", "window: han", "segments.window is 'han'; expected 'hann', 'hamming'"),
        ("fit_band: [0.3, 10.0]", "fit_band: [0.3, 0.5]", "it must span four lines of 0.0976562 Hz or more"),
        ("[siso, miso,", "[siso, mios,", "there is no estimator 'mios'; known are siso, miso"),
        ("[siso, miso, miso_hand_read", "[siso, miso_hand_read", "estimators lacks 'miso', whose coherences are drawn"),
        ("half_width: 40", "half_width: 800", "half_width makes bands of 1601 lines; fit_band [0.3, 10.0] of 8192"),
        (
            "with_noise: [siso, miso, instrumental]",
            "with_noise: [siso, instrument]",
            "drawn.with_noise names 'instrument', which",
        ),
        (
            "estimators: [siso, miso, local_polynomial, instrumental, output_error]",
            "estimators: [siso, local_polynomial]",
            "estimator_errors.estimators lacks 'miso', which the others are compared with",
        ),
        ("degree: 2", "degree: 2.5", "local_polynomial.degree is 2.5; expected a whole number"),
        (
            "kind: gaussian_lowpass",
            "kind: gaussian",
            "excitations.report.kind is 'gaussian'; expected 'gaussian_lowpass', ",
        ),
        ("cutoff: 12.5", "cutoff: 125", "excitations.report: the excitation reaches 125 Hz"),
        ("cutoff: 12.5", "periods: 7", "excitations.report: 8192 samples do not hold 7 whole periods"),
        ("cutoff: 12.5", "peak_frequency: 2.0", "excitations.report has peak_frequency, which means nothing to a"),
        (
            "    k3: 0.005",
            "    k3: 0.005\n    k_3: 0.005",
            "tolerances.relative names 'k_3', which is no parameter; known",
        ),
        ("{k: 0.01,", "{kk: 0.01,", "tolerances.of_case.dead_band names 'kk', which is no parameter"),
        ("seed: 1990", "seed: -1", "excitations.report.seed is -1; expected 0 or more"),
        ("method: abm4", "method: abm5", "integrator.method is 'abm5'; expected 'abm4' or 'rk4'"),
        ("dead_band: {k", "deadband: {k", "of_case names 'deadband', which is neither a case nor a system"),
        ("sampling:\n", "sampling: [\n", "config.yaml is not YAML (expected"),
        ("fit_band: [0.3, 10.0]", "", "config.yaml: 'fit_band' is missing; expected sampling, excitations,"),
        ("samples: 8192", "samples: 8192000000000", "sampling.samples is 8192000000000; expected 100000000 or less"),
    ],
)
def test_faults_of_the_settings(folder, old, new, says):
    spoil(folder / "config.yaml", old, new)
    sentence = refused(folder)
    assert sentence.startswith(str(folder / "config.yaml"))
    assert says in sentence


@pytest.mark.parametrize(
    ("new", "says"),
    [
        (ROW.replace("duffing\treport", "dufing\treport"), "there is no model 'dufing'; models/ holds dead_band"),
        (ROW.replace("report", "reprot"), "there is no excitation 'reprot'; config.yaml names report"),
        (ROW.replace("1.0", "-1.0"), "level is '-1.0'; expected a number above 0"),
        (ROW.replace("1.0", "one"), "level is 'one'; expected a number"),
        (ROW.replace("1.0", "nan"), "level is 'nan'; expected a finite number"),
        (ROW.replace("\t0\t", "\t-0.1\t"), "noise is '-0.1'; expected 0 or more"),
        (ROW.replace("\t21\t", "\t21.5\t"), "linear is '21.5'; expected a whole number"),
        (ROW.replace("\t21\t", "\t18\t"), "linear is 18, a number that linear of the case 'linear' has already"),
        (ROW.replace("\t22\t", "\t21\t"), "nonlinear is 21, a number that linear of the case 'duffing' has already"),
        (ROW.replace("\t0\t\t", "\t0\tcubic\t"), "there is no term 'cubic'"),
        (ROW.replace("\t0\t\t", "\t0\tdead_band\t"), "also_assumed 'dead_band' needs a value for u_g"),
        (ROW.replace("\t0\t\t", "\t0\tcubic_stiffness\t"), "lists the term 'cubic_stiffness' twice"),
        (ROW.replace("\t3\t\t", "\t3\t9\t"), "autospectrum is 9; its lines need a term periodic_stiffness"),
        (ROW.replace("\t3\t", "\t"), "has 14 cells where the heading has 15"),
        (
            ROW.replace("duffing\tduffing", "Duffing\tduffing"),
            "case is 'Duffing'; expected up to 64 of a to z",
        ),
        (ROW.replace("duffing\tduffing", "../up\tduffing"), "case is '../up'; expected up to 64 of a to z"),
        (ROW + "\n" + ROW, "row 4 (case 'duffing'): the case stands twice"),
    ],
)
def test_faults_of_a_row(folder, new, says):
    spoil(folder / "cases.tsv", ROW, new)
    sentence = refused(folder)
    assert re.match(rf"{re.escape(str(folder / 'cases.tsv'))}, row [34]( \(case '.*'\))?:? ", sentence)
    assert says in sentence


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (
            "    reading: raw\n",
            "",
            "excitations.report has no reading, which the claims name; it may be raw or filtered",
        ),
        (
            "  report:\n    kind",
            "  mine:\n    kind",
            "excitations names mine, not 'report'; the claims judge a force of",
        ),
        (
            "kind: gaussian_lowpass\n    reading: raw",
            "kind: pierson_moskowitz",
            "excitations.report.kind is 'pierson_moskowitz'; the claims judge a gaussian_lowpass there",
        ),
        ("    k3: 0.005\n", "", "tolerances.relative lacks 'k3'; expected at least m, f_n, k, k3"),
        ("    f_n: 0.003\n", "", "tolerances.relative lacks 'f_n'; expected at least m, f_n, k, k3"),
        ("    k: 1.78 ", "    # ", "tolerances.absolute lacks 'k'; expected at least k, c, k3, phase"),
        (
            "fit_band: [0.3, 10.0]",
            "fit_band: [5.0, 10.0]",
            "it must begin at 1.902 Hz or below and end at 4 Hz or above",
        ),
        ("length: 512", "length: 2048", "segments.length is 2048; the claims cut segments of 4 times that too"),
        ("length: 512", "length: 2048", "a record of 8192 samples must hold for more than 2 averages: expected 1024"),
        (
            "without_noise: [siso, miso, local_polynomial, miso_free_shape]",
            "without_noise: [miso_hand_read]",
            "drawn.without_noise is [miso_hand_read], of which none has curves of every case; one of siso, miso",
        ),
        ("dt: 0.02 ", "dt: 0.05 ", "the excitation reaches 12.5 Hz, above the Nyquist frequency of 10 Hz"),
    ],
)
def test_what_the_claims_and_figures_need(folder, old, new, says):
    """Each of these ended in a traceback of a job that ran for minutes."""
    spoil(folder / "config.yaml", old, new)
    if new.startswith("  mine"):
        table = folder / "cases.tsv"
        table.write_text(table.read_text().replace("\treport\t", "\tmine\t"))
    sentence = refused(folder)
    assert sentence.startswith(str(folder / "config.yaml"))
    assert says in sentence


def test_claims_put_every_kind_of_force_in_place_of_the_reports(folder):
    spoil(folder / "config.yaml", "cutoff: 12.5", "cutoff: 9.0")
    spoil(folder / "config.yaml", "dt: 0.02 ", "dt: 0.05 ")
    spoil(folder / "config.yaml", "fit_band: [0.3, 10.0]", "fit_band: [0.3, 8.0]")
    assert "the claims put a random_phase_multisine in place of excitations.report: the excitation reaches" in refused(
        folder
    )


def test_a_band_beyond_the_force(folder):
    spoil(folder / "config.yaml", "fit_band: [0.3, 10.0]", "fit_band: [13, 24]")
    sentence = refused(folder)
    assert (
        "row 2 (case 'linear'): fit_band of config.yaml is [13.0, 24.0]; the excitation has nothing above" in sentence
    )
    assert "12.5 Hz, where the band must end" in sentence


def test_a_band_below_the_force(folder):
    lines = "excitations:\n  lines: {kind: swept_sine, start_frequency: 9.9, stop_frequency: 12.0, seed: 1}\n"
    spoil(folder / "config.yaml", "excitations:\n", lines)
    spoil(folder / "cases.tsv", ROW, ROW.replace("report", "lines"))
    assert "the excitation begins at 9.9 Hz, and four lines of 0.0976562 Hz or more must lie above" in refused(folder)


def test_segments_that_overlap_so_far_that_they_are_one(folder):
    spoil(folder / "config.yaml", "length: 512", "length: 5000")
    spoil(folder / "config.yaml", "overlap: 0.5", "overlap: 0.95")
    spoil(folder / "config.yaml", "window: hann", "window: boxcar")
    assert "that are worth 1.56 averages, as they overlap; 2 inputs need more" in refused(folder)


@pytest.mark.parametrize("name", ESTIMATORS)
def test_who_has_curves_to_be_drawn_of_every_case(name):
    """A linear system has least to show: no shape parameter, one input."""
    model = read_model(ROOT / "models" / "linear.yaml")
    values = force(Excitation(), 2048, 0.02, 1)
    record = replace(simulate(model, np.tile(values, 6), 0.02), period=2048)
    found = identify(name, model, record, Settings(Segments(256), (0.3, 10.0)))
    assert (found.responses is not None) == (name in CURVES)


def test_an_estimator_that_needs_periods(folder):
    spoil(folder / "config.yaml", "miso_hand_read, local", "miso_hand_read, errors_in_variables, local")
    assert "the excitation has 1 period; the estimator errors_in_variables needs settle_periods and four" in refused(
        folder
    )
    spoil(folder / "config.yaml", "kind: gaussian_lowpass", "kind: gaussian_lowpass\n    periods: 8")
    study = load_config(folder)
    assert study.identification_settings("linear").period == 1024
    assert load_config(ROOT / "config").identification_settings("linear").period is None


@pytest.mark.parametrize("case", ["linear", "noise_10"])
def test_what_a_job_is_told_survives_as_plain_data(case):
    """Snakemake keeps settings as text: a job reads the same values from it."""
    study = load_config(ROOT / "config")
    record, identification = study.record_settings(case), study.identification_settings(case)
    for settings in (record, record.without_seeds(), identification):
        told = json.loads(json.dumps(settings.plain()))
        assert type(settings).model_validate(told) == settings


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("fit_band: [0.3, 10.0]", "fit_band: [0.3]", "fit_band is [0.3]; expected 2 entries or more"),
        ("fit_band: [0.3, 10.0]", "fit_band: 0.3", "fit_band is 0.3; expected a list"),
        ("fit_band: [0.3, 10.0]", "fit_band: [low, 10]", "fit_band.0 is 'low'; expected a number"),
        ("estimators: [siso, miso, miso_hand", "estimators: [siso, siso, miso_hand", "expected each entry once"),
        ("samples: 8192", "samples: true", "sampling.samples is True; expected a whole number"),
        ("samples: 8192", "samples: '8192'", "sampling.samples is '8192'; expected a whole number"),
        ("    seed: 1990 ", "    # ", "excitations.report: 'seed' is missing; expected a whole number of 0 or more"),
        ("pairs: 24", "pairs: 137", "trials.pairs is 137; expected 136 or less"),
        ("wanted:  ", "wanted: 1\n  # ", "is not YAML"),
        ("k3: 1.0e+5", "k3: -1", "tolerances.absolute.k3 is -1; expected a number above 0"),
    ],
)
def test_more_faults_of_the_settings(folder, old, new, says):
    spoil(folder / "config.yaml", old, new)
    assert says in refused(folder)
