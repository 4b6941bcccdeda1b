"""What Part II holds, known before any of it is computed: the chapters with their tables and figures."""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Contents:
    """A chapter: where it is computed, and what is made of it."""

    module: str  # of ``study.reproduction.chapters``
    title: str
    recommendation: str  # the report's, Section 7, in its words
    tables: tuple[str, ...]  # results/part_two/<name>.csv
    figures: Mapping[str, str]  # figures/<name>.png and .svg, and what each shows


OF_STRUCTURES = "structures"  # the chapter whose cases are in config/structures.tsv

CHAPTERS: Mapping[str, Contents] = {
    "excitations": Contents(
        "other_spectra",
        "Forces with other spectra",
        "Investigate force excitations with arbitrary spectral shapes (such as the Pierson-Moskowitz wind-wave model) "
        "and apply these excitations to various nonlinear systems.",
        ("excitations",),
        {
            "spectra_map": "where the method breaks down",
            "spectra_bands": "how narrow may my band be",
        },
    ),
    "forces": Contents(
        "other_forces",
        "More complicated forces",
        "Simulate extended SDOF nonlinear systems with more complicated nonlinear restoring and damping forces than "
        "those considered here.",
        ("forces", "force_coefficients", "force_coherences", "force_patterns"),
        {
            "force_patterns": "restoring force against displacement",
            "force_coherences": "what the coherence says of a wrong model",
        },
    ),
    "noise": Contents(
        "noise_both_sides",
        "Noise at input and output",
        "Study effects of noise in greater detail for cases of noise at both the inputs and outputs of simulated SDOF "
        "systems.",
        ("noise", "noise_best"),
        {
            "noise_map": "which estimator for my noise",
            "noise_bias": "bias and scatter of each coefficient, and theory",
        },
    ),
    OF_STRUCTURES: Contents(
        "fewer_sensors",
        "Several degrees of freedom",
        "Develop procedures for analyzing and identifying different terms in MDOF systems and associated MDOF "
        "nonlinear differential equations of motion.",
        ("sensors", "sensor_values"),
        {"sensors_map": "which effect, at which connection, with how few sensors"},
    ),
    "measured": Contents(
        "measured_ladders",
        "Actual systems, measured data",
        "Demonstrate these procedures by investigating the properties of an actual nonlinear physical system using "
        "measured data.",
        ("ladders",),
        {"ladders": "error on what was not fitted, model after model"},
    ),
    "varying": Contents(
        "not_constant",
        "Coefficients that are not constant",
        "Investigate the use of this new method for the nonlinear system identification of nonlinear equations of "
        "motion where the coefficients are not necessarily constants.",
        ("varying", "varying_values", "mathieu", "moments"),
        {"varying": "what constant coefficients leave, and when the stiffness stepped"},
    ),
}
