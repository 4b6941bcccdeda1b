"""The public records that docs, gallery and notebooks use: whose they are, what may be done with them, where they go.

None is part of the project. A checksum is that of the very file that was used here. Where that is the original, it
holds for a download, from an address that stays: of a file in one state of a repository. Where the original was
converted to CSV or thinned, it tells whether the same was made of it; no address has those bytes, and an entry says
where its page is. ``study data NAME --address`` fetches a file from an address that the user has.
"""

import hashlib
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from study.support.errors import StudyError, expect
from study.support.extras import needed

VARIABLE_OF_DATA = "STUDY_DATA"  # names the folder that holds the records


@dataclass(frozen=True)
class PublicFile:
    """A file of a record."""

    name: str
    size: int  # bytes
    sha256: str
    address: str = ""  # of the file as it is offered; none where it was converted from that


@dataclass(frozen=True)
class PublicRecord:
    """An entry of the list."""

    title: str
    source: str
    licence: str
    by_hand: str  # where to get it
    files: tuple[PublicFile, ...]

    @property
    def size(self) -> int:
        """Bytes of all files."""
        return sum(file.size for file in self.files)


BENCHMARKS = "https://www.nonlinearbenchmark.org"
UNLICENSED = "offered for free download, no licence stated"
RECORDS: Mapping[str, PublicRecord] = {
    "silverbox": PublicRecord(
        "Silverbox", "T. Wigren, J. Schoukens, ECC 2013", UNLICENSED, BENCHMARKS,
        (
            PublicFile(
                "SNLS80mV.mat", 2097520, "5c7413a52255af0cb4e2f93fb6903beb92b08965ba1e6ad0a6ffedfed8477ed4",
                "https://raw.githubusercontent.com/antonior92/sysid-neuralnet/8da23c9810f738aececa6058a53e40e9a621e5bc/"
                "data/SilverboxFiles/SNLS80mV.mat",
            ),
        ),
    ),
    "boucwen": PublicRecord(
        "Bouc-Wen benchmark", "J.-P. Noël, M. Schoukens, 2016", UNLICENSED, BENCHMARKS,
        (
            PublicFile("train.h5", 658344, "a4df68f6101a22f9fc5032e98b3e773fc108a291378ef9cf69d1b128c7ac44a4"),
            PublicFile("test.h5", 2585288, "822fe88df38cf41bffbebedb06af8d6c5eb2f808de0e2eefe6d78b215de53016"),
        ),
    ),
    "damper": PublicRecord(
        "Magnetorheological damper", "A. N. Vargas and others, UTFPR Labcontrol", "MIT",
        "the repository of UTFPR Labcontrol",
        (
            PublicFile("run_4.1.csv", 84883, "c177a3b1be3dc8c55fd8acb84196be8c47d91466779cb762b1b39319a39cecc9"),
            PublicFile("run_4.4.csv", 42039, "5be733ea2499c172c0553ba4148146450dfc58c8fac0328999098fd2cae35fd6"),
            PublicFile("run_A.1.csv", 37689, "adc9a4f37298a77381c76ff17d72cf1acd0bb0d5af874d25b095f512c0d096c7"),
            PublicFile("run_A.10.csv", 37984, "e3d6ed84bead2793a903741228f8bdfb96702360f09570b95a81eb7978e0aa4b"),
            PublicFile("validation_5.csv", 38334, "e11d89ed420da3fe3b4dfab1188b2a301add41c44ae001bc1df29d9fc5b678dd"),
        ),
    ),
    "pendulum": PublicRecord(
        "Pendulum", "K. Kaheman and others, arXiv 2205.06231", "MIT",
        "https://arxiv.org/abs/2205.06231, which names it",
        (PublicFile("single.csv", 309935, "4a44d60079f102cdf760e8c643986fcd4e3e0c2b67bd8fda425e321cd23aa898"),),
    ),
    "beam_ringdown": PublicRecord(
        "Ring-down of a beam", "T. Breunung, B. Balachandran", "MIT",
        "https://doi.org/10.1016/j.jsv.2024.118651, which names it",
        (PublicFile("decay.csv", 570471, "95255150e600e91ab0355af485acfded2f3c5df77fd2261c03360b5e5144158c"),),
    ),
    "wing": PublicRecord(
        "Wing in heave and pitch", "K. H. Lee, D. Barton and others, Bristol", "MIT",
        "the repository of D. Barton, Bristol",
        (
            PublicFile("model_1.csv", 277114, "d08ca900a4819df8e7e1919c26d3aee27bbe04d7197f7ed8d40bb64e0c66ee30"),
            PublicFile("model_2.csv", 270077, "f2380cbe94be5b9bad023fe75c1bda134d8aa64dc18a549fce63b4298530ca73"),
        ),
    ),
    "axis": PublicRecord(
        "Positioning axis", "A. Janot, M. Gautier, M. Brunot, 2019", "Apache-2.0", BENCHMARKS,
        (
            PublicFile(
                "position_control.csv", 959969, "8de108ed7706fbaa8af1b223eabfd91e02c5f7aaa162da0d15c32d3f67864a75"
            ),
        ),
    ),
    "roll": PublicRecord(
        "Ship in roll", "M. Alexandersson, 2020", "MIT", "the repository of M. Alexandersson",
        (PublicFile("decay_0_knots.csv", 179814, "491b8160acd77d907fab1bf87bae13d549476ca193af75e23c7b8c3784a77bd5"),),
    ),
    "friction_damper": PublicRecord(
        "Band brake", "ARTS-Laboratory", "CC BY-SA 4.0",
        "the repository of ARTS-Laboratory, banded rotary friction device",
        (
            PublicFile(
                "harmonic0.015forward.csv", 228956, "39a83eeb9890016fd381b7d174f659507d6dcd1684400d03d29d5f38f9b88bcd"
            ),
            PublicFile(
                "step0.015forward.csv", 228378, "6e3d6995d0422a141cafa0f8c89c5e4dc1dc44355e8ca1280424f5fb1b5ffe47"
            ),
        ),
    ),
    "movable_support": PublicRecord(
        "Beam on a moving support", "DROPBEAR, High-Rate SHM working group", "CC BY-SA 4.0",
        "the repository of the High-Rate SHM working group",
        (PublicFile("ten_steps.csv", 469319, "94b8ee9f93bb905426a3d2c2ba0edf3af00d31a5f0ad55661a4910836dfbc250"),),
    ),
}  # fmt: skip


def data_folder() -> Path:
    """Where records are looked for and put: what ``STUDY_DATA`` names, else a folder of the user's own."""
    if named := os.environ.get(VARIABLE_OF_DATA):
        return Path(named)
    pooch = needed("pooch", "'study data' without STUDY_DATA", "data")
    return Path(pooch.os_cache("study"))


def state_of(path: Path, file: PublicFile) -> str:
    """``missing``, ``there``, or ``differs`` where the bytes are not those of the checksum."""
    if not path.is_file():
        return "missing"
    return "there" if hashlib.sha256(path.read_bytes()).hexdigest() == file.sha256 else "differs"


def get_record(name: str) -> PublicRecord:
    """The record of this name."""
    expect(name in RECORDS, f"there is no public record {name!r}; known are {', '.join(RECORDS)}")
    return RECORDS[name]


def fetch(name: str, folder: Path, address: str = "") -> list[Path]:
    """The paths of a record's files below a folder; what is missing is fetched and its checksum verified.

    A file is in its place when all of it is there and its checksum is right, not before.

    Parameters
    ----------
    name : str
        Of ``RECORDS``.
    folder : Path
        That of all records.
    address : str
        Of the file, or of the folder that holds the files by their names; where that is left out, the public address of
        each file, if it has one.

    Raises
    ------
    StudyError
        If a file cannot be had, or is another; it says where to get it by hand.
    """
    record, paths = get_record(name), list[Path]()
    for file in record.files:
        path = folder / name / file.name
        state = state_of(path, file)
        if state != "there":
            expect(
                state != "differs",
                f"{path}: its checksum is not that of the file that is used here; expected sha256 {file.sha256}; "
                "move it away",
            )
            by_hand = f"get it by hand ({record.by_hand}) and put it at {path}"
            given = address if len(record.files) == 1 else address and f"{address.rstrip('/')}/{file.name}"
            expect(
                bool(given or file.address),
                f"no address has {file.name}, converted from what is offered (docs/reproduction.md); {by_hand}",
            )
            _retrieve(given or file.address, path, file, by_hand)
        paths.append(path)
    return paths


def _retrieve(address: str, path: Path, file: PublicFile, by_hand: str) -> None:
    pooch = needed("pooch", "fetching a public record", "data")
    pooch.get_logger().setLevel("WARNING")
    told: dict[str, Any] = {"known_hash": f"sha256:{file.sha256}", "fname": path.name, "path": path.parent}
    try:
        pooch.retrieve(address, **told)
    except ValueError as error:  # another checksum, or no address at all
        why = "its checksum is another" if "hash" in str(error).lower() else "that is no address of a file"
        raise StudyError(f"{address}: {why} (expected sha256 {file.sha256}); {by_hand}") from None
    except OSError as error:  # what the network says is one of these
        raise StudyError(f"{address} cannot be reached ({type(error).__name__}); {by_hand}") from None
