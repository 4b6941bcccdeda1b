"""Golden results: the same commands by the code of another revision and by this one, number by number.

``python benchmarks/golden.py REVISION [NAME ...]`` checks the revision out beside this tree, compiles it, writes
records with it, runs every command (or those named) with both, and lists what differs by more than 1e-9 of itself. What
the other revision gave is kept in the folder ``.golden`` and not made again.
"""

import json
import math
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parents[1]
KEPT = HERE / ".golden"
CLOSE = 1e-9
WORKERS = int(os.environ.get("GOLDEN_WORKERS", "2"))
DATA = Path(os.environ.get("STUDY_DATA", HERE.parent / "shared" / "data"))
FAULTS = (
    "offset", "drift", "hum", "delay", "high_pass", "spikes", "drop_outs", "clipping", "converter_steps", "gain_change",
    "force_noise",
)  # fmt: skip
OSCILLATOR = "terms: [inertia, linear_damping, linear_stiffness]\n"
DUFFING = "terms: [inertia, linear_damping, linear_stiffness, cubic_stiffness]\n"
WELL = (
    "terms:\n  - {term: inertia, value: 1.0}\n  - {term: linear_damping, value: 0.3}\n"
    "  - {term: linear_stiffness, value: -20.0}\n  - {term: cubic_stiffness, value: 20.0}\n"
)
MADE = {  # what is made: the words of a command that makes it
    "duffing": "simulate models/duffing.yaml --out duffing.csv --samples 4096",
    "low": "simulate models/duffing.yaml --out low.csv --samples 4096 --level 0.2 --seed 5",
    "well": "simulate well_true.yaml --out well.csv --samples 4096 --cutoff 2 --level 40",
    "noisy": "trial --seed 11 --hidden cubic_stiffness --noise 0.05",
    "pair": "trial --seed 14 --hidden cubic_stiffness,quadratic_damping --noise 0.01",
    "none": "trial --seed 12 --hidden none --noise 0.02",
    **{f: f"trial --seed {20 + i} --hidden cubic_stiffness --noise 0.01 --fault {f}" for i, f in enumerate(FAULTS)},
    **{
        t: f"trial --seed 31 --test {t} --hidden coulomb_friction --noise 0.01"
        for t in ("free_decay", "blows", "base", "component", "axis")
    },
    "frame": "simulate models/structures/frame.yaml --out frame.csv --samples 4096 --level 100",
    "three": "simulate models/structures/three_masses.yaml --out three.csv --samples 4096",
    "beam": "simulate models/structures/beam.yaml --out beam.csv --samples 4096 --dt 0.002 --cutoff 100",
    "masses": "trial --seed 41 --coordinates 2 --hidden quadratic_damping --noise 0.01",
}
RUN = {  # what is compared: the words of the command
    "driven_compare": "compare duffing.csv --model linear.yaml",
    "driven_diagnose": "diagnose duffing.csv --model linear.yaml",
    "driven_local_polynomial": "compare duffing.csv --model duffing.yaml --estimator local_polynomial",
    "driven_right": "diagnose duffing.csv --model duffing.yaml",
    "several": "compare duffing.csv low.csv --model duffing.yaml",
    "several_diagnose": "diagnose duffing.csv low.csv --model linear.yaml",
    "each_record": "compare duffing.csv low.csv --model duffing.yaml --each-record linear_stiffness",
    "chaos": "compare well.csv --model well.yaml",
    "noisy": "diagnose {noisy}",
    "pair": "diagnose {pair}",
    "none": "diagnose {none}",
    **{fault: f"diagnose --accept-saturated {{{fault}}}" for fault in FAULTS},
    **{test: f"diagnose {{{test}}}" for test in ("free_decay", "blows", "base", "component", "axis")},
    "add": "add linear.yaml cubic_stiffness --data duffing.csv",
    "drop": "drop duffing.yaml cubic_stiffness --data duffing.csv",
    "history_of_two": "add duffing.yaml quadratic_damping --data duffing.csv low.csv",
    "frame_compare": "compare frame.csv --model frame.yaml",
    "frame_diagnose": "diagnose frame.csv --model frame_linear.yaml",
    "three_compare": "compare three.csv --model three.yaml",
    "masses": "diagnose {masses}",
    "frame_add": "add frame_linear.yaml cubic_stiffness --between floor2 floor3 --data frame.csv",
    "modal_compare": "compare beam.csv --model beam_modal.yaml",
    "modal_diagnose": "diagnose beam.csv --model beam_modal_linear.yaml",
    "wing": "diagnose data/wing/model_1.csv --model models/measured/wing_1.yaml",
    "pendulum": "diagnose data/pendulum/single.csv --model models/measured/pendulum.yaml",
}


def main() -> int:
    """Run both and tell; 1 where anything differs."""
    revision, names = sys.argv[1], sys.argv[2:] or list(RUN)
    other, made = KEPT / f"code_{revision}", KEPT / f"made_{revision}"
    if not other.exists():
        subprocess.run(["git", "-C", str(HERE), "worktree", "add", "--detach", str(other), revision], check=True)
        subprocess.run([sys.executable, "setup.py", "-q", "build_ext", "--inplace"], cwd=other, check=True)
    if not made.exists():
        _make(other, made)

    def theirs_of(name: str) -> dict[str, Any]:
        return _run(other, made, KEPT / f"run_{revision}" / name, name, True)

    def ours_of(name: str) -> dict[str, Any]:
        return _run(HERE, made, KEPT / "run_here" / name, name, False)

    with ThreadPoolExecutor(WORKERS) as pool:
        theirs = dict(zip(names, pool.map(theirs_of, names), strict=True))
        ours = dict(zip(names, pool.map(ours_of, names), strict=True))
    different = 0
    for name in names:
        found = list(_differences(theirs[name], ours[name]))
        different += bool(found)
        print(f"{name}: {'the same' if not found else f'{len(found)} differ'}")
        for line in sorted(found, key=lambda line: line.endswith("only in this one"))[:12]:
            print(f"    {line}")
    return int(bool(different))


def _study(code: Path, words: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"PYTHONPATH": str(code), "OPENBLAS_NUM_THREADS": "1"}
    return subprocess.run(
        [sys.executable, "-m", "study", *words],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )


def _make(code: Path, folder: Path) -> None:
    """Write records and models with the code of the other revision."""
    beside = folder.with_suffix(".part")
    shutil.rmtree(beside, ignore_errors=True)
    shutil.copytree(code / "models", beside / "models")
    (beside / "data").symlink_to(DATA)
    structures = beside / "models" / "structures"
    given = {
        "linear": OSCILLATOR, "duffing": DUFFING, "well_true": WELL, "well": DUFFING,
        "frame": _open((structures / "frame.yaml").read_text()),
        "frame_linear": _open((structures / "frame.yaml").read_text(), without="cubic_stiffness"),
        "three": _open((structures / "three_masses.yaml").read_text()),
        "beam_modal": (structures / "beam_measured.yaml").read_text(),
        "beam_modal_linear": _open((structures / "beam_measured.yaml").read_text(), without="cubic_stiffness"),
    }  # fmt: skip
    for name, text in given.items():
        named = text if "name:" in text else f"name: {name}\n{text}"
        (beside / f"{name}.yaml").write_text(named if "terms:\n" not in named[-8:] else named[:-7] + "terms: []\n")
    for name, command in MADE.items():
        words = command.split()
        run = _study(code, words if words[0] == "simulate" else [*words, "--out", name], beside)
        assert run.returncode == 0, f"{command}: {run.stderr}"
    _keep_sensors(beside / "beam.csv", ["time", "shaker", "p4 displacement", "p7 displacement", "p10 displacement"])
    _keep_sensors(beside / "duffing.csv", ["time", "force", "displacement"])
    _keep_sensors(beside / "low.csv", ["time", "force", "displacement"])
    _keep_sensors(beside / "well.csv", ["time", "force", "displacement"])
    beside.rename(folder)


def _open(text: str, without: str = "") -> str:
    """A model file without its values, and without a term."""
    lines = [line for line in text.splitlines() if not without or without not in line]
    return "\n".join(line.split(", value:")[0] + "}" if ", value:" in line else line for line in lines) + "\n"


def _keep_sensors(path: Path, columns: list[str]) -> None:
    import pandas as pd

    pd.read_csv(path)[columns].to_csv(path, index=False, float_format="%.17g")


def _run(code: Path, made: Path, folder: Path, name: str, keep: bool) -> dict[str, Any]:
    """What one command gives: exit code, what it prints, every number it writes."""
    told = folder / "told.json"
    if keep and told.exists():
        return json.loads(told.read_text())
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(made, folder, symlinks=True)
    words = RUN[name].split()
    if words[-1].startswith("{"):
        trial = Path(words.pop()[1:-1])
        (record,) = (folder / trial).glob("*.csv")
        words += [str(trial / record.name), "--model", str(trial / record.with_suffix(".yaml").name)]
    run = _study(code, [*words, "--out", "out"], folder)
    found: dict[str, Any] = {"exit": run.returncode, "stdout": run.stdout}
    if run.returncode:
        found["stderr"] = run.stderr
    for path in sorted((folder / "out").glob("*")) if (folder / "out").exists() else ():
        if path.suffix == ".json":
            found[path.name] = json.loads(path.read_text())
        elif path.suffix == ".csv":
            found[path.name] = path.read_text()
        else:
            found[path.name] = "written"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    told.write_text(json.dumps(found))
    return found


def _differences(one: Any, other: Any, path: str = "") -> Iterator[str]:
    if isinstance(one, dict) and isinstance(other, dict):
        for key in sorted({*one, *other}):
            if key not in one or key not in other:
                yield f"{path}/{key}: only in {'this one' if key in other else 'the other'}"
            else:
                yield from _differences(one[key], other[key], f"{path}/{key}")
    elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        for i, pair in enumerate(zip(one, other, strict=True)):
            yield from _differences(*pair, f"{path}[{i}]")
    elif isinstance(one, str) and isinstance(other, str) and "\n" in one and one.count("\n") == other.count("\n"):
        for i, pair in enumerate(zip(one.splitlines(), other.splitlines(), strict=True)):
            yield from _differences(*pair, f"{path}:{i + 1}")
    elif not _same(one, other):
        yield f"{path}: {_short(one)} -> {_short(other)}"


def _same(one: Any, other: Any) -> bool:
    if one == other:
        return True
    if isinstance(one, str) and isinstance(other, str) and "," in one and one.count(",") == other.count(","):
        return all(_same(a, b) for a, b in zip(one.split(","), other.split(","), strict=True))
    try:
        a, b = float(one), float(other)
    except (TypeError, ValueError):
        return False
    return math.isclose(a, b, rel_tol=CLOSE, abs_tol=1e-300) or (math.isnan(a) and math.isnan(b))


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) < 100 else text[:97] + "..."


if __name__ == "__main__":
    sys.exit(main())
