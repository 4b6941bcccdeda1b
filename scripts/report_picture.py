"""A picture of what ``study report`` writes, for the documentation: ``make report_picture`` draws it.

The record is that of a Duffing system, with noise on the displacement; the model as given lacks its cubic stiffness.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from study.diagnose.one_page import one_page
from study.diagnose.one_page_files import sheet
from study.diagnose.verdict import diagnose
from study.equations.model_file import read_model
from study.equations.simulate import simulate
from study.figures import page
from study.figures.styles import in_style
from study.records.excitation import Excitation, force
from study.support.files import replace_file
from study.support.workflow_step import one_sentence
from study.way_in.compare_records import compare_records

NOISE = 0.01  # of the rms displacement


def main(models: Path, picture: Path) -> None:
    truth = read_model(models / "duffing.yaml")
    record = simulate(truth, force(Excitation(level=1.0, cutoff=5.0), 8192, 0.02, 1), 0.02)
    noise = np.random.default_rng(1990).standard_normal(len(record))
    noisy = record["displacement"] + NOISE * np.std(record["displacement"]) * noise
    measured = {"force": record["force"], "displacement": noisy}
    given = truth.without_term("cubic_stiffness").with_values(dict.fromkeys(truth.values))
    found = diagnose(compare_records([replace(record, channels=measured, name="rig")], given).comparison)
    with in_style():
        replace_file(picture, page.rendered(sheet(one_page(found)), "png"))


if __name__ == "__main__":
    with one_sentence():
        main(Path(sys.argv[1]), Path(sys.argv[2]))
