"""Bad, hostile and odd input for every command and format, as cases that a test runs; all of it is made here."""

import base64
import json
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.io import savemat

Floats = NDArray[np.float64]
MODEL = "name: rig\nterms:\n  - inertia\n  - linear_damping\n  - linear_stiffness\n"
TRUE = (
    "terms:\n  - {term: inertia, value: 1.0}\n  - {term: linear_damping, value: 3.77}\n"
    "  - {term: linear_stiffness, value: 355.3}\n"
)
CONTROL = "\x1b[2J\x07"  # what clears a terminal and rings its bell
READ = ["--no-measurement"]


@dataclass(frozen=True)
class Case:
    """One call of the command line that must be refused in one sentence."""

    name: str
    words: tuple[str, ...]
    said: tuple[str, ...]  # what the sentence must hold: file or option, and value
    files: Mapping[str, bytes] = field(default_factory=dict[str, bytes])
    prepare: Callable[[], Any] | None = None


def measured() -> tuple[Floats, Floats, Floats]:
    """Times, force and displacement of an oscillator by central differences, each of shape (1000,)."""
    dt, samples = 0.02, 1000
    force = np.convolve(np.random.default_rng(3).standard_normal(samples + 4), np.ones(5) / 5.0, "valid")
    u = np.zeros(samples)
    for k in range(1, samples - 1):
        spring = force[k] - 355.3 * u[k] + 3.77 * u[k - 1] / (2.0 * dt)
        u[k + 1] = (spring + (2.0 * u[k] - u[k - 1]) / dt**2) / (1.0 / dt**2 + 3.77 / (2.0 * dt))
    return dt * np.arange(samples), force, u


TIME, FORCE, U = measured()


def csv(head: str = "time,force,displacement", columns: tuple[Any, ...] = (TIME, FORCE, U), sep: str = ",") -> bytes:
    """A table as text."""
    rows = [sep.join(x if isinstance(x, str) else f"{x:.12g}" for x in row) for row in zip(*columns, strict=True)]
    return "\n".join([head, *rows, ""]).encode()


def changed(values: Floats, where: int | slice, to: float) -> Floats:
    """Values with some replaced."""
    other = values.copy()
    other[where] = to
    return other


def refused_by(name: str, files: Mapping[str, bytes], said: tuple[str, ...], **options: Any) -> Iterator[Case]:
    """One bad record, given to each command that reads records."""
    (record,) = [n for n in files if n not in ("rig.yaml", "rig.csv") and not n.endswith(".record.yaml")]
    more = tuple(options.get("words", ()))
    for command in ("compare", "diagnose"):
        yield Case(f"{command} {name}", (command, record, "--model", "rig.yaml", *READ, *more), said, files)
    yield Case(f"add {name}", ("add", "rig.yaml", "cubic_stiffness", "--data", record, *READ, *more), said, files)
    if options.get("all_commands", True):
        yield Case(f"drop {name}", ("drop", "rig.yaml", "linear_damping", "--data", record, *READ, *more), said, files)
        words = ("explore", record, "--model", "rig.yaml", "--no-browser", "--port", "0", *READ, *more)
        yield Case(f"explore {name}", words, said, files)


def texts() -> Iterator[Case]:
    """Tables of text."""
    bad: dict[str, tuple[bytes, tuple[str, ...]]] = {
        "empty": (b"", ("empty",)), "blank": (b"\n \n\t\n", ("empty",)), "no numbers": (b"a,b\nc,d\n", ("numbers",)),
        "header alone": (b"time,force,displacement\n", ("numbers",)), "nul": (csv() + b"\0", ("0x00",)),
        "escape": (b"\x1b[2J" + csv(), ("0x1b",)), "zip": (b"PK\x03\x04" + csv(), ("ZIP",)),
        "gzip": (b"\x1f\x8b\x08" + csv(), ("gzip",)), "pdf": (b"%PDF-1.7\n" + csv(), ("PDF",)),
        "numpy": (b"\x93NUMPY" + csv(), ("NumPy",)), "json": (b'{"force": [1, 2]}\n', ("numbers",)),
        "nan": (csv(columns=(TIME, FORCE, changed(U, 400, np.nan))), ("displacement", "line 402")),
        "inf": (csv(columns=(TIME, changed(FORCE, 7, np.inf), U)), ("force", "infinite", "line 9")),
        "word": (csv().replace(b"\n0.2,", b"\n0.2,oops", 1), ("oops",)),
        "true": (csv(columns=(TIME, FORCE, ["True", "False"] * 500)), ("True", "line 2")),
        "one true": (csv(columns=(TIME, FORCE, [*map(str, U[:900]), *["TRUE"] * 100])), ("TRUE", "line 902")),
        "1e160": (csv(columns=(TIME, FORCE, 1e160 * U)), ("displacement", "e+1", "1e+50")),
        "1e308 once": (csv(columns=(TIME, FORCE, changed(U, 5, 1e308))), ("1e+308", "line 7")),
        "-1e308 once": (csv(columns=(TIME, changed(FORCE, 5, -1e308), U)), ("-1e+308", "line 7")),
        "1e-200": (csv(columns=(TIME, FORCE, 1e-200 * U)), ("displacement", "1e-50")),
        "times of 1e300": (csv(columns=(1e300 * TIME, FORCE, U)), ("time", "1e+50")),
        "times of 1e-300": (csv(columns=(1e-300 * TIME, FORCE, U)), ("time", "1e-50")),
        "times stand": (csv(columns=(changed(TIME, 9, TIME[8]), FORCE, U)), ("stands still", "line 11")),
        "times back": (csv(columns=(TIME[::-1], FORCE, U)), ("runs backwards", "line 3")),
        "a gap": (csv(columns=(np.where(TIME > 5.0, TIME + 1.0, TIME), FORCE, U)), ("gap",)),
        "uneven": (csv(columns=(TIME**1.2, FORCE, U)), ("line",)),
        "response rests": (csv(columns=(TIME, FORCE, 0.0 * U + 3.0)), ("displacement", "3 throughout")),
        "short": (csv(columns=(TIME[:9], FORCE[:9], U[:9])), ("9 samples",)),
        "one column": (csv("force", (FORCE,)), ("displacement",)),
        "no names": (csv("1,2,3"), ("force",)), "no times": (csv("force,displacement", (FORCE, U)), ("--fs",)),
        "force twice": (csv("time,force,force"), ("force", "2 times")),
        "two motions alike": (csv("time,force,displ,disp", (TIME, FORCE, U, U)), ("'displ' and 'disp'",)),
        "same numbers": (csv(columns=(TIME, FORCE, FORCE)), ("force and displacement", "same numbers")),
        "a cell too many": (csv().replace(b"\n0.5,", b"\n0.5,1,", 1), ("cells",)),
        "a cell too few": (b"\n".join([*csv().split(b"\n")[:600], b"12.0,3.0", b""]), ("line 601",)),
        "unit of another kind": (csv("time,force [m],displacement"), ("force", "m")),
        "unknown unit": (csv("time,force [blob],displacement"), ("blob",)),
        "clipped": (csv(columns=(TIME, FORCE, np.clip(U, -1e-3, 1e-3))), ("displacement", "rests at its")),
        "noise": (csv(columns=(TIME, FORCE, np.random.default_rng(1).standard_normal(1000))), ("in common",)),
        "too short to fit": (csv(columns=(TIME[:60], FORCE[:60], U[:60])), ("fit", "60")),
    }  # fmt: skip
    for name, (content, said) in bad.items():
        many = name in ("empty", "nan", "1e160", "same numbers", "true")
        yield from refused_by(name, {"bad.csv": content}, ("bad.csv", *said), all_commands=many)
    for suffix, kind in ((".mat", "MATLAB"), (".h5", "HDF5"), (".parquet", "Parquet"), (".uff", "universal")):
        name = f"bad{suffix}"
        yield from refused_by(f"text as {suffix}", {name: csv()}, (name, kind), all_commands=False)


def _written(path: str, write: Callable[[str], Any]) -> bytes:
    """The bytes of a file that somebody else's package writes."""
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        target = os.path.join(folder, path)  # noqa: PTH118
        write(target)
        return Path(target).read_bytes()


def _hdf5(**datasets: Any) -> bytes:
    def write(path: str) -> None:
        with h5py.File(path, "w") as file:
            for name, values in datasets.items():
                if callable(values):
                    values(file, name)
                else:
                    file[name] = values

    return _written("a.h5", write)


def _uff(kind: int = 1) -> bytes:
    """A universal file of two functions of a kind (1 is a time response), in text."""
    lines: list[str] = []
    for node, (name, values, quantity) in enumerate((("force", FORCE, 13), ("displacement", U, 8)), start=1):
        axis = "    0    0    0 NONE                 NONE                "
        lines += [f"{-1:6d}", f"{58:6d}", name, *["NONE"] * 4]
        lines.append(f"{kind:5d}{0:10d}{0:5d}{0:10d} {'NONE':10s}{node:10d}{1:4d} {'NONE':10s}{0:10d}{0:4d}")
        lines.append(f"{4:10d}{len(values):10d}{1:10d}{0.0:13.5e}{0.02:13.5e}{0.0:13.5e}")
        lines += [f"{17:10d}{axis}", f"{quantity:10d}{axis}", f"{0:10d}{axis}", f"{0:10d}{axis}"]
        lines += ["".join(f"{value:20.11e}" for value in values[k : k + 4]) for k in range(0, len(values), 4)]
        lines.append(f"{-1:6d}")
    return "\n".join([*lines, ""]).encode()


def binaries() -> Iterator[Case]:
    """HDF5, MATLAB, Parquet and UFF: cut short, of wrong kinds, and too large for any memory."""
    named = {"time": TIME, "force": FORCE, "displacement": U}
    good = {
        ".h5": _hdf5(**named), ".mat": _written("a.mat", lambda p: savemat(p, named)), ".uff": _uff(),
        ".parquet": _written("a.parquet", lambda p: pd.DataFrame(named).to_parquet(p)),
    }  # fmt: skip
    for suffix, content in good.items():
        for share in (0.01, 0.1, 0.5, 0.9, 0.98):
            cut = content[: max(int(share * len(content)), 30)]
            name = f"bad{suffix}"
            yield from refused_by(f"{share:g} of {suffix}", {name: cut}, (name,), all_commands=False)

    def huge(file: Any, name: str) -> None:
        file.create_dataset(name, shape=(10**12,), dtype="f8", chunks=(1000,))

    def unwritten(file: Any, name: str) -> None:
        file.create_dataset(name, shape=(1000,), dtype="f8", chunks=(100,))

    h5: dict[str, tuple[bytes, tuple[str, ...]]] = {
        "huge": (_hdf5(force=huge, displacement=huge), ("1000000000000",)),
        "unwritten": (_hdf5(time=TIME, force=FORCE, displacement=unwritten), ("displacement", "0 throughout")),
        "text": (_hdf5(time=TIME, force=FORCE, displacement=b"words"), ("displacement",)),
        "complex": (_hdf5(time=TIME, force=FORCE, displacement=1j * U), ("displacement", "complex")),
        "cube": (_hdf5(time=TIME, force=FORCE, displacement=np.zeros((10, 10, 10))), ("displacement", "10, 10, 10")),
        "lengths": (_hdf5(time=TIME, force=FORCE, displacement=U[:900]), ("900", "1000")),
        "empty": (_hdf5(), ("no column",)),
        "rate of nothing": (_hdf5(fs=0.0, force=FORCE, displacement=U), ("fs", "0")),
        "rate of nan": (_hdf5(fs=np.nan, force=FORCE, displacement=U), ("fs", "nan")),
        "rate of 1e300": (_hdf5(fs=1e300, force=FORCE, displacement=U), ("1e-300",)),
    }  # fmt: skip
    for name, (content, said) in h5.items():
        yield from refused_by(f"HDF5 {name}", {"bad.h5": content}, ("bad.h5", *said), all_commands=False)
    yield from refused_by("HDF5 group", {"bad.h5": good[".h5"]}, ("bad.h5", "'no'"), words=("--group", "no"))
    yield from refused_by("UFF spectrum", {"bad.uff": _uff(4)}, ("bad.uff", "4"), all_commands=False)
    text = _written("a.parquet", lambda p: pd.DataFrame({"force": ["a"] * 99, "x": U[:99]}).to_parquet(p))
    yield from refused_by("Parquet text", {"bad.parquet": text}, ("bad.parquet", "force"), all_commands=False)


def models() -> Iterator[Case]:
    """Model files."""
    bomb = "a: &a [x,x]\nb: &b [*a,*a]\nterms: [*b,*b]\n"
    own = "terms: [inertia, linear_stiffness, {{term: mine, force: {}}}]\n"
    held = "terms: [{{term: inertia, value: {}}}, linear_damping, linear_stiffness]\n"
    bad: dict[str, tuple[str | bytes, tuple[str, ...]]] = {
        "empty": ("", ("empty",)), "list": ("[1, 2]\n", ("mapping",)), "number": ("12\n", ("12",)),
        "no terms": ("name: rig\n", ("terms",)), "no list": ("terms: 3\n", ("3",)), "bomb": (bomb, ("'a'", "line 1")),
        "tag": ("terms: !!python/object/apply:os.system ['touch hacked']\n", ("tag",)), "deep": ("[" * 99, ("deep",)),
        "deeper": ("a: " + "{a: " * 5000, ("deep",)), "tab": ("terms:\n\t- inertia\n", ("YAML", "line 2")),
        "latin": ("name: Prüfstand\n".encode("latin-1") + MODEL.encode(), ("UTF-8", "0xfc")),
        "nul": (b"\0" + MODEL.encode(), ("YAML",)), "large": (b"#" * 1_000_001, ("1000000",)),
        "unknown": (MODEL + "  - cubic_stifness\n", ("cubic_stiffness",)),
        "twice": (MODEL + "  - inertia\n", ("twice",)),
        "key": (MODEL + "colour: red\n", ("colour",)), "many": ("terms: [" + "inertia," * 201 + "]", ("201",)),
        "no mass": ("terms: [linear_damping, linear_stiffness]\n", ("inertia",)), "mass 0": (held.format("0"), ("0",)),
        "mass -1": (held.format("-1"), ("-1",)), "mass 1e300": (held.format("1e300"), ("1e+300",)),
        "mass 1e-300": (held.format("1e-300"), ("1e-300",)), "mass inf": (held.format(".inf"), ("inf",)),
        "mass nan": (held.format(".nan"), ("nan",)), "mass text": (held.format("heavy"), ("heavy",)),
        "mass yes": (held.format("true"), ("True",)), "mass none": (held.format(""), ("empty",)),
        "mass of digits": (held.format("9" * 6000), ("digits",)), "mass list": (held.format("[1]"), ("[1]",)),
        "gap of 1e-300": (MODEL + "  - {term: dead_band, u_g: 1e-300}\n", ("u_g", "1e-300")),
        "gap of 0": (MODEL + "  - {term: dead_band, u_g: 0}\n", ("u_g", "0")),
        "code": (own.format("\"__import__('os').system('touch hacked')\""), ("__import__",)),
        "lambda": (own.format('"(lambda: 0)()"'), ("lambda",)), "attribute": (own.format('"u.__class__"'), ("u.__cl",)),
        "power": (own.format('"u**99"'), ("99",)), "no formula": (own.format('""'), ("''",)),
        "formula 3": (own.format("3"), ("3",)), "no channel": (own.format('"q*u"'), ("'q'",)),
        "root of -1": (own.format('"u*sqrt(-1)"'), ("sqrt(-1)",)), "log of 0": (own.format('"log(0)"'), ("log(0)",)),
        "log of u": (own.format('"log(u)"'), ("log(u)", "t = ")),
        "too large": (own.format('"u*1e299*t*1e99"'), ("1e299",)),
        "again": (own.format('"2*u"'), ("linear_stiffness",)), "nothing": (own.format('"0*u"'), ("zero",)),
        "thirty of a kind": (
            MODEL + "".join(f'  - {{term: own{i}, force: "sin({i + 1}*u)*v**2"}}\n' for i in range(30)),
            ("'own0'", "own1, own2, own3 and 26 others", "leave some"),
        ),
        "long": (own.format('"' + "u+" * 600 + 'u"'), ("characters",)),
        "negative damping": (MODEL.replace("- linear_damping", "- {term: linear_damping, value: -9}"), ("c = -9",)),
        "control": (f'name: "{CONTROL.encode("unicode_escape").decode()}"\n{MODEL[10:]}', ("name",)),
        "name": ('terms: [inertia, {term: "\\e[2Ju", force: u*v}]\n', ("name",)),
    }  # fmt: skip
    for name, (content, said) in bad.items():
        text = content if isinstance(content, bytes) else content.encode()
        fits = name in (
            "thirty of a kind",
            "no channel",
            "log of u",
            "too large",
            "negative damping",
            "root of -1",
            "log of 0",
        )
        if name != "no mass":  # which makes it a test of a component
            yield Case(f"model {name}", ("compare", "rig.csv", "--model", "bad.yaml", *READ), ("bad.yaml", *said),
                       {"bad.yaml": text})  # fmt: skip
        if fits:
            continue
        alone = [("simulate", "bad.yaml"), ("drop", "bad.yaml", "linear_damping", "--data", "rig.csv")]
        for words in alone:
            if name == "no mass" and words[0] == "drop":
                continue
            yield Case(f"{words[0]} of model {name}", words, ("bad.yaml",), {"bad.yaml": text})


def beside() -> Iterator[Case]:
    """What stands beside a record, in ``rig.record.yaml``."""
    bad = {
        "list": ("[]", "mapping"), "key": ("color: 1", "color"), "bomb": ("a: &a [1]\nunits: *a", "'a'"),
        "columns": ("columns: 3", "columns"), "column": ("columns: {force: [1]}", "force"), "units": ("units: x", "x"),
        "unit": ("units: {force: 3}", "3"), "rate": ("fs: fast", "fast"), "rate 0": ("fs: 0", "0"),
        "both": ("fs: 1\ndt: 1", "both"), "rate inf": ("fs: .inf", "inf"), "rate 1e300": ("dt: 1e300", "1e+300"),
        "samples": ("samples: [5]", "samples"), "range": ("samples: [9, 3]", "9"), "period": ("period: 1", "1"),
        "period text": ("period: long", "long"), "flag": ("accept_saturated: 1", "1"), "group": ("group: [a]", "group"),
        "faults": ("measurement: 3", "3"), "fault": ("measurement: {gremlins: off}", "gremlins"),
        "deep": ("[" * 50, "deep"), "digits": ("dt: " + "9" * 5000, "digits"), "tag": ("fs: !!binary aGk=", "tag"),
        "no column": ("columns: {force: nowhere}", "nowhere"), "beyond": ("samples: [0, 5000]", "5000"),
    }  # fmt: skip
    for name, (text, said) in bad.items():
        words = ("compare", "rig.csv", "--model", "rig.yaml")
        yield Case(f"beside {name}", words, ("rig", said), {"rig.record.yaml": text.encode()})


def options() -> Iterator[Case]:
    """Words of the command line."""
    long = "9" * 5000
    rows: list[tuple[str, ...]] = [
        ("--column", "force"), ("--column", "=x"), ("--column", f"force={long}"), ("--column", "force=nowhere"),
        ("--column", f"force={CONTROL}"), ("--column", "force=99"), ("--column", "force=0"), ("--unit", "force"),
        ("--unit", "force=parsec"), ("--unit", "q=N"), ("--unit", f"force={CONTROL}"), ("--fs", "0"), ("--fs", "-1"),
        ("--fs", "inf"), ("--fs", "nan"), ("--fs", "fast"), ("--fs", "1e300"), ("--fs", "1e-300"), ("--fs", long),
        ("--dt", "0"), ("--dt", "1e-320"), ("--dt", "1"), ("--period", "1"), ("--period", "x"), ("--period", long),
        ("--period", "4000"), ("--fit", "x"), ("--fit", "9:3"), ("--fit", ":"), ("--fit", "0:5000"), ("--fit", "0:9"),
        ("--fit", f"0:{long}"), ("--judge", "-5:9"), ("--judge", "0:1000"), ("--response", "velocity"),
        ("--response", "loudness"), ("--cutoff", "0"), ("--cutoff", "1e9"), ("--cutoff", "x"), ("--group", "g"),
        ("--out", "rig.csv"), ("--out", "rig.csv/deeper"), ("--out", "\0"), ("--out", "/proc/none"), ("--none", "x"),
        ("--estimator", "wishful"), ("--estimator", CONTROL),
    ]  # fmt: skip
    for row in rows:
        short = " ".join(row).encode("unicode_escape").decode()[:30]
        yield Case(f"compare {short}", ("compare", "rig.csv", "--model", "rig.yaml", *READ, *row), ())
        if row[0] != "--estimator":
            words = ("add", "rig.yaml", "cubic_stiffness", "--anyway", "--data", "rig.csv", *READ, *row)
            yield Case(f"add {short}", words, ())
    one = ("--column", "force=force", "--column", "displacement=force")
    yield Case("one column twice", ("compare", "rig.csv", "--model", "rig.yaml", *one), ("rig.csv", "'force'"))
    twice = ("--column", "force=force", "--column", "force=time")
    yield Case("one role twice", ("compare", "rig.csv", "--model", "rig.yaml", *twice), ("force",))
    for candidate, said in {
        "x": "x", "=u": "", "mine=": "mine", "mine=q*u": "'q'", "mine=u*sqrt(-1)": "sqrt(-1)", "mine=log(0)": "log(0)",
        "mine=2*u": "linear_stiffness", "inertia=u": "inertia", f"{CONTROL}=u": "",
        "mine=__import__('os')": "__import__",
        "mine=" + "(" * 2000: "300", "mine=u**1e9": "1e9",
    }.items():  # fmt: skip
        words = ("diagnose", "rig.csv", "--model", "rig.yaml", *READ, "--candidate", candidate)
        yield Case(f"candidate {candidate[:20]!r}", words, (said,))
    both = ("--candidate", "a=u*u", "--candidate", "a=u*v")
    yield Case("two of one name", ("diagnose", "rig.csv", "--model", "rig.yaml", *READ, *both), ("'a'",))
    for row, said in (
        (("--without", "friction"), "friction"), (("--without", CONTROL), ""), (("--candidate",), "--candidate"),
    ):  # fmt: skip
        yield Case(f"diagnose {row[0]} {said}", ("diagnose", "rig.csv", "--model", "rig.yaml", *READ, *row), (said,))


def other_commands() -> Iterator[Case]:
    """simulate, trial, terms, history, add and drop; paths that are no files; writing over what is read."""
    for row in (
        ("--level", "-1"), ("--level", "inf"), ("--level", "1e300"), ("--cutoff", "0"), ("--cutoff", "1e300"),
        ("--cutoff", "99"), ("--seed", "-1"), ("--seed", "9" * 5000), ("--samples", "1"), ("--samples", "1e9"),
        ("--samples", "99999999999"), ("--dt", "0"), ("--dt", "1e300"), ("--dt", "5"), ("--steps", "0"),
        ("--out", "true.yaml"), ("--out", "./true.yaml"), ("--out", "link.csv"), ("--out", "no/such/folder.csv"),
        ("--out", "."), ("--out", "\0"), ("--out", "x" * 300),
    ):  # fmt: skip
        name = " ".join(row).encode("unicode_escape").decode()[:30]
        yield Case(f"simulate {name}", ("simulate", "true.yaml", *row), (), prepare=_link)
    for row in (
        (), ("--seed", "x"), ("--seed", "-1"), ("--seed", "1", "--hidden", "ghost"), ("--seed", "1", "--noise", "2"),
        ("--seed", "1", "--noise", "nan"),
        ("--seed", "1", "--response", "smell"), ("--seed", "1", "--fault", "gremlin"),
        ("--seed", "1", "--out", "rig.csv"), ("--seed", "1", "--out", "\0"), ("--seed", "1", "--open", "x"),
        ("--open", "none.json"), ("--open", "."), ("--open", "rig.csv"), ("--seed", "1", "--hidden", CONTROL),
    ):  # fmt: skip
        name = " ".join(row).encode("unicode_escape").decode()[:40]
        yield Case(f"trial {name}", ("trial", *row), ())
    answer = {"hidden": ["hysteresis"], "shares": [0.1], "noise": 0.0, "fault": {}, "truth": "terms: []"}
    wrong: list[dict[str, Any]] = [
        {"hidden": 3}, {"hidden": [3]}, {"shares": "x"}, {"shares": [10**400]}, {"shares": [True]}, {"shares": []},
        {"noise": None}, {"noise": "x"}, {"noise": 10**400}, {"fault": []}, {"fault": {"fault": "delay"}}, {"truth": 5},
        {"fault": {"fault": 1, "unit": "s", "channel": "force", "value": 1}}, {"truth": None}, {"more": 1},
    ]  # fmt: skip
    sealed = [json.dumps({**answer, **change}) for change in wrong] + ["[]", "3", "[" * 9999, "9" * 6000, "{", ""]
    pages = [json.dumps({"answer": base64.b64encode(text.encode()).decode()}) for text in sealed]
    pages += ['{"answer": 3}', '{"answer": "%%"}', "[]", "{}", "9" * 6000, "[" * 99999, "\0", '{"answer": "é"}']
    for number, page in enumerate(pages):
        files = {"bad.answer.json": page.encode()}
        yield Case(f"answer {number}", ("trial", "--open", "bad.answer.json"), ("bad.answer.json",), files)
    for words in (
        ("terms", "zzz"), ("terms", CONTROL), ("terms", "x" * 5000), ("history", "none.yaml"), ("history", "."),
        ("history", "rig.csv"), ("add", "rig.yaml", "friction", "--data", "rig.csv"), ("nonsense",), (), (CONTROL,),
        ("add", "rig.yaml", "inertia", "--data", "rig.csv"), ("add", "rig.yaml", "x", "--data", "rig.csv"),
        ("add", "rig.yaml", "x", "--force", "u/0", "--data", "rig.csv"), ("add", "rig.yaml", "--data", "rig.csv"),
        ("add", "rig.yaml", "x", "--force", "log(u)", "--data", "rig.csv", *READ),
        ("add", "rig.yaml", "x", "--force", "q*v", "--data", "rig.csv", *READ),
        ("drop", "rig.yaml", "inertia", "--data", "rig.csv"), ("drop", "rig.yaml", CONTROL, "--data", "rig.csv"),
        ("explore", "rig.csv", "--model", "rig.yaml", "--port", "70000"), ("explore", "rig.csv"),
        ("explore", "rig.csv", "--model", "rig.yaml", "--no-browser", "--port", "0", "--out", "."),
    ):  # fmt: skip
        yield Case(" ".join(words).encode("unicode_escape").decode()[:60] or "nothing", words, ())
    yield from _paths()


def _link() -> None:
    Path("link.csv").symlink_to("true.yaml")


def _paths() -> Iterator[Case]:
    odd: dict[str, tuple[str, Callable[[], Any] | None]] = {
        "missing": ("none.csv", None), "folder": (".", None), "nul": ("a\0b.csv", None), "device": ("/dev/null", None),
        "endless": ("endless.csv", lambda: Path("endless.csv").symlink_to("/dev/zero")), "long": ("x" * 5000, None),
        "pipe of nobody": ("pipe.csv", lambda: os.mkfifo("pipe.csv")), "below a file": ("rig.csv/deeper.csv", None),
        "loop": ("loop.csv", lambda: Path("loop.csv").symlink_to("loop.csv")), "control": (f"a{CONTROL}.csv", None),
        "no UTF-8": (os.fsdecode(b"r\xffg.csv"), None), "empty": ("", None), "bracket": ("\u202egsc.csv", None),
    }  # fmt: skip
    for name, (path, prepare) in odd.items():
        yield Case(f"record: {name}", ("compare", path, "--model", "rig.yaml"), (), prepare=prepare)
        yield Case(f"model: {name}", ("compare", "rig.csv", "--model", path), (), prepare=prepare)
        yield Case(f"simulated: {name}", ("simulate", path), (), prepare=prepare)


def cases() -> list[Case]:
    """All of them; no two of one name."""
    found = [*texts(), *binaries(), *models(), *beside(), *options(), *other_commands()]
    count: dict[str, int] = {}
    for case in found:
        count[case.name] = count.get(case.name, 0) + 1
    doubled = [name for name, times in count.items() if times > 1]
    if doubled:
        raise ValueError(f"two cases have one name: {doubled}")
    return found
