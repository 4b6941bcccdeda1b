"""The first pages and the documentation site: short, true, whole, and asking nobody for anything."""

import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest

import study as st
from scripts.site_pages import force_of
from study import cli
from study.equations.terms import LIBRARY
from study.records.completion import complete
from study.records.record import Record
from study.trials import make_trial

ROOT = Path(__file__).parents[2]
BLOCK = re.compile(r"```python\n(.*?)```", re.DOTALL)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The files that the examples read, short."""
    made = tmp_path_factory.mktemp("examples")
    model = st.Model(
        st.term("inertia", value=1.0), st.term("linear_damping", value=3.77), st.term("linear_stiffness", value=355.3),
        st.term("cubic_stiffness", value=2e7), name="rig",
    )  # fmt: skip

    def simulated(force):
        return st.simulate(model, force, noise=0.01**2)

    random = simulated(st.gaussian(samples=2048, seed=2))
    for name in ("rig", "high"):
        random.save(made / f"{name}.csv")
    simulated(st.gaussian(0.2, samples=2048, seed=3)).save(made / "low.csv")
    simulated(st.multisine(samples=2048, periods=2, seed=4)).save(made / "multisine.csv")
    once = st.sweep(samples=2048, band=(0.5, 10.0))
    swept = simulated(st.Force(np.tile(once.values, 2), once.dt))
    columns = np.column_stack([swept["force"], swept["displacement"]])
    np.savetxt(made / "sweep.csv", columns, delimiter=",", header="force,displacement", comments="")
    whole = st.simulate(model, st.gaussian(samples=2048, seed=5))
    columns = np.column_stack([whole.time, whole["force"], whole["acceleration"]])
    np.savetxt(made / "base.csv", columns, delimiter=",", header="time,F,a", comments="")
    ringing = [
        st.simulate(model.hold(c=0.3), st.Force(np.zeros(n), 0.02), initial=(0.01, 0.0))["displacement"]
        for n in (600, 1000)
    ]
    for name in ("roll", "blows"):
        st.record({"displacement": np.concatenate(ringing)}, dt=0.02).save(made / f"{name}.csv")
    for name, test in (("damper", "component"), ("axis", "axis")):
        st.Record.of(make_trial(4, (), 0.01, test=test).record).save(made / f"{name}.csv")
    table = make_trial(4, (), 0.01, test="base").record
    moved = complete(Record(table.dt, {"force": table["force"], "acceleration": table["base_acceleration"]})).record
    channels = {"base_displacement": moved["displacement"], "displacement": table["displacement"]}
    channels["displacement"] = channels["displacement"] + moved["displacement"]
    st.record(channels, dt=table.dt).save(made / "table.csv")
    return made


@pytest.mark.long
@pytest.mark.parametrize("page", ["README.md", "docs/howto.md"])
def test_every_example_of_a_page_runs(page, folder, monkeypatch):
    monkeypatch.chdir(folder)
    monkeypatch.syspath_prepend(folder)  # as where Python is started
    matplotlib.use("Agg")
    arrays = st.read("rig.csv")
    names = {"force": arrays["force"], "displacement": arrays["displacement"]}
    blocks = BLOCK.findall((ROOT / page).read_text(encoding="utf-8"))
    assert blocks
    for number, block in enumerate(blocks, start=1):
        example = block.replace("fs=100.0", "fs=50.0")  # the rate of the arrays that are there
        exec(compile(example, f"{page}, example {number}", "exec"), names)
    plt.close("all")


def test_the_sites_first_example_is_the_beginning_of_the_readmes():
    own, longer = (
        BLOCK.findall((ROOT / page).read_text(encoding="utf-8"))[0] for page in ("docs/index.md", "README.md")
    )
    assert [line for line in own.splitlines() if line not in longer.splitlines()] == ["found = fit.diagnose()"]


@pytest.mark.long
def test_the_first_page_is_short_and_shows_what_the_command_says(folder, monkeypatch, capsys):
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(text.splitlines()) < 120
    assert text.index("study diagnose rig.csv") < text.index("make study")
    monkeypatch.chdir(folder)
    (yaml,) = re.findall(r"```yaml\n(.*?)```", text, re.DOTALL)
    Path("rig.yaml").write_text(yaml)
    command = re.search(r"`study (simulate models/duffing.yaml --out rig.csv)`", text)
    assert command
    monkeypatch.chdir(ROOT)
    assert cli.main([*command[1].split()[:-1], str(folder / "written.csv")]) == 0
    monkeypatch.chdir(folder)
    assert cli.main(["diagnose", "written.csv", "--model", "rig.yaml", "--no-measurement", "--out", "out"]) == 0
    said = capsys.readouterr().out
    for line in text.splitlines():
        if re.match(r"[12]   \w", line):
            assert line.split()[:5] == next(row for row in said.splitlines() if row.startswith(line[:4])).split()[:5]


class Asked(HTMLParser):
    """What a page loads."""

    def __init__(self):
        super().__init__()
        self.sources = []

    def handle_starttag(self, tag, attrs):
        if tag in ("script", "img", "link", "iframe"):
            self.sources += [value for name, value in attrs if name in ("src", "href") and value]


@pytest.mark.long
def test_the_site_is_built_strictly_and_asks_no_other_host(tmp_path):
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(tmp_path / "site")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    pages = list((tmp_path / "site").rglob("*.html"))
    assert {"index.html", "howto.html", "tool.html", "terms.html", "python.html", "your_own_rig.html"} <= {
        p.name for p in pages
    }
    for page in pages:
        asked = Asked()
        asked.feed(page.read_text(encoding="utf-8"))
        assert not [source for source in asked.sources if "://" in source or source.startswith("//")], page
    terms = (tmp_path / "site" / "reference" / "terms.html").read_text(encoding="utf-8")
    assert all(f'id="{name}"' in terms and f"{name}.png" in terms for name in LIBRARY)
    reference = (tmp_path / "site" / "reference" / "python.html").read_text(encoding="utf-8")
    for name in st.__all__:
        assert name in ("__version__", "StudyError") or re.search(rf'id="study\.interface\.\w+\.{name}"', reference), (
            name
        )


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("inertia", "-4*pi**2*u"), ("linear_damping", "v"), ("cubic_stiffness", "u**3"),
        ("van_der_pol_damping", "u**2*v"), ("coulomb_friction", "sign(v)"),
    ],
)  # fmt: skip
def test_pictures_of_terms_show_their_force(name, expected):
    u, v, force = force_of(LIBRARY[name])
    exact = eval(expected, {"u": u, "v": v, "pi": np.pi, "sign": np.sign})
    assert np.max(np.abs(force - exact)) < 2e-3 * np.max(np.abs(force))
