"""The pictures of a diagnosis as pages."""

from matplotlib.figure import Figure

from study.diagnose import diagnosis_pictures
from study.diagnose.diagnosis_pictures import PicturedDiagnosis
from study.diagnose.verdict import Diagnosis
from study.figures import page
from study.figures.styles import in_style

FOLLOWED = 3  # candidates whose coefficient is drawn along frequency and amplitude


def pages(diagnosis: PicturedDiagnosis, record: str) -> dict[str, Figure]:
    """Figures by the stem of their file name; the caller applies the style sheet."""
    ranking, (axes,) = page.empty_page(
        f"What is missing from the model of {record}", f"verdict: {diagnosis.verdict.replace('_', ' ')}",
        panel=3.4, legend_rows=0, headed=False,
    )  # fmt: skip
    ranking.subplots_adjust(left=0.34)
    diagnosis_pictures.ranking(axes, diagnosis)
    constancy, panels = page.empty_page(
        f"Is the coefficient a constant? {record}", "that of a true term is, along frequency and along amplitude",
        columns=2, width=page.width(2), panel=2.8, share=False,
    )  # fmt: skip
    diagnosis_pictures.constancy_panels(panels[0], panels[1], diagnosis.candidates[:FOLLOWED])
    page.shared_legend(constancy, panels)
    return {"candidates": ranking, "constancy": constancy}


def picture_files(diagnosis: Diagnosis, record: str) -> dict[str, bytes]:
    """The pictures by file name, in the project's style."""
    with in_style():
        return page.image_files(pages(diagnosis, record))
