"""The study's settings: what would grow without bound, and what is misspelt, is met before any job, in one sentence."""

import re
import shutil
import time
from pathlib import Path

import pytest

from study.reproduction.config import load_config
from study.support.errors import StudyError

ROOT = Path(__file__).parents[2]
SECONDS = 5.0  # a bomb takes minutes, or all memory


def bomb(start: str = "{x: 1}") -> str:
    """Nine to the power of nine entries, in ten lines."""
    lines = [f"&a0 {start}", *(f"  b{i}: &a{i} [{','.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 10))]
    return "\n".join(lines)


KEYS = [
    "sampling", "excitations", "noise_seed", "integrator", "segments", "fit_band", "local_polynomial", "estimators",
    "drawn", "tolerances", "monte_carlo", "estimator_errors", "trials",
]  # fmt: skip


@pytest.fixture
def config(tmp_path: Path) -> Path:
    for folder in ("config", "models"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    return tmp_path / "config"


def refused(config: Path) -> str:
    started = time.monotonic()
    with pytest.raises(StudyError) as caught:
        load_config(config)
    assert time.monotonic() - started < SECONDS
    assert "\n" not in str(caught.value)
    assert str(config / "config.yaml") in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("key", KEYS)
@pytest.mark.parametrize("form", ["mapping", "list", "merge"])
def test_aliases_are_refused_under_every_key(config: Path, key: str, form: str) -> None:
    path = config / "config.yaml"
    first, _, rest = path.read_text().partition(f"\n{key}:")
    content = {"mapping": f"\n  b0: {bomb()}", "list": f" {bomb('[x]')}", "merge": f"\n  b0: {bomb()}\n  <<: *a9"}[form]
    path.write_text(f"{first}\n{key}:{content}\n# {rest.partition(chr(10))[0]}")
    assert "YAML anchor or alias" in refused(config)


@pytest.mark.parametrize(
    ("name", "wrong"),
    [("    k3: 0.005", "k33"), ("    zeta: 0.02", "zetta"), ("    f_m: 0.001", "f_mm"), ("    phase: 0.02", "phas"),
     ("    dead_band: {k", "dead_bnd"), ("  relative:", "relativ")],
)  # fmt: skip
def test_a_misspelt_tolerance_is_named_as_itself(config: Path, name: str, wrong: str) -> None:
    path = config / "config.yaml"
    text = path.read_text()
    assert name in text
    path.write_text(text.replace(name, re.sub(r"\w+(?=:)", wrong, name, count=1), 1))
    assert repr(wrong) in refused(config)
