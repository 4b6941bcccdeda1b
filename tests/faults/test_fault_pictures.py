"""Every fault can be drawn: in truth in grey, as read in black, where it is seen, with its value in words."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from study.faults.fault import CLIPPING, DRIFT, DROP_OUTS, FAULTS, FORCE_NOISE, GAIN_CHANGE, SPIKES, Fault
from study.faults.imposed import impose
from study.figures.styles import in_style

ROOT = Path(__file__).parents[2]


def loaded():
    spec = importlib.util.spec_from_file_location("fault_pictures_script", ROOT / "scripts" / "fault_pictures.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # its dataclass looks for it there
    spec.loader.exec_module(module)
    return module


script = loaded()


@pytest.fixture(scope="module")
def clean(systems):
    return script.measured_example(systems["duffing"], "displacement")


@pytest.fixture
def faulty(clean):
    """An example of a fault that is found with its very value."""

    def make(fault: str) -> script.Example:
        record, known = impose(clean, "displacement", fault, np.random.default_rng(5))
        size = known["value"]
        return script.Example(
            clean, record, size, Fault(fault, known["channel"], size, 0.01 * abs(size), known["unit"])
        )

    return make


@pytest.mark.parametrize("fault", FAULTS)
def test_every_fault_is_drawn_where_it_is_seen(fault, faulty):
    one = faulty(fault)
    first, last = script.shown_samples(one)
    with in_style():
        figure = script.picture(one)
    signal, difference = figure.axes
    true, read = (line.get_ydata() for line in signal.get_lines())
    added = difference.get_lines()[0].get_ydata()
    assert np.array_equal(true, one.clean[one.channel][first:last])
    assert np.array_equal(read, one.faulty[one.channel][first:last])
    assert np.array_equal(added, read - true)
    assert np.any(added != 0.0)
    unit = "N" if fault == FORCE_NOISE else "mm"
    assert [axes.get_ylabel() for axes in figure.axes] == [f"{one.channel} ({unit})", f"difference ({unit})"]
    assert difference.get_xlabel() == "time (s)"
    title, found = (text.get_text() for text in figure.texts)
    assert f"{one.size:.3g}" in title or f"{100.0 * one.size:.3g} %" in title
    assert found.startswith("found: ")


@pytest.mark.parametrize("fault", [SPIKES, DROP_OUTS, CLIPPING])
def test_what_spoils_some_samples_is_shown_between_sound_ones(fault, faulty):
    one = faulty(fault)
    first, last = script.shown_samples(one)
    changed = one.clean[one.channel][first:last] != one.faulty[one.channel][first:last]
    assert 0 < np.count_nonzero(changed) < 0.3 * (last - first)


@pytest.mark.parametrize("fault", [DRIFT, GAIN_CHANGE])
def test_what_is_as_slow_as_the_record_is_shown_along_all_of_it(fault, faulty, clean):
    assert script.shown_samples(faulty(fault)) == (0, len(clean))


def test_an_example_is_what_the_search_finds(systems):
    one = script.example(systems["duffing"], SPIKES)
    assert one.found.fault == SPIKES
    assert one.found.value == pytest.approx(one.size, rel=0.2)


def test_the_script_writes_a_picture_and_says_what_was_found(tmp_path, capsys):
    script.main(ROOT / "models", tmp_path / "new", [CLIPPING])
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["clipping.png"]
    with Image.open(tmp_path / "new" / "clipping.png") as drawn, Image.open(ROOT / "docs/faults/clipping.png") as shown:
        assert drawn.size == shown.size
    assert capsys.readouterr().out.startswith("clipping: The displacement is clipped at ")


@pytest.mark.parametrize("fault", FAULTS)
def test_the_text_shows_every_picture(fault):
    text = (ROOT / "docs" / "tool.md").read_text(encoding="utf-8")
    assert f"](faults/{fault}.png)" in text
    assert (ROOT / "docs" / "faults" / f"{fault}.png").stat().st_size < 60_000
