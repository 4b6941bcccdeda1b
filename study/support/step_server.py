"""Steps of the workflow in processes that are forked from one that has their packages, since these load for a second.

Each step has a process of its own: what it leaves in memory, and how it fails, is no business of others.
"""

import ast
import multiprocessing
import runpy
from collections.abc import Iterable, Mapping
from multiprocessing import forkserver
from multiprocessing.connection import wait
from pathlib import Path
from threading import Lock
from types import SimpleNamespace
from typing import Any

from study.support.cores import share_cores
from study.support.errors import StudyError

FORKS, ASKING = multiprocessing.get_context("forkserver"), Lock()


def preload(scripts: Iterable[str], *modules: str) -> None:
    """Start the process that is forked: it loads what these scripts import, and modules, while this one goes on."""
    names = {"snakemake.cli", "snakemake.iocontainers", __name__, *modules}
    for script in scripts:
        imports = (node for node in ast.parse(Path(script).read_text()).body if isinstance(node, ast.ImportFrom))
        names |= {name for i in imports for name in (i.module, *(f"{i.module}.{a.name}" for a in i.names)) if name}
    FORKS.set_forkserver_preload(sorted(names))  # names of no module are passed over
    forkserver.ensure_running()


def run_forked(script: str, step: Mapping[str, Any], jobs: int) -> None:
    """Run a script that finds ``step``, plain data, as its ``snakemake``; it may be called from several threads.

    So many ``jobs`` may be at work at a time, this one included.

    Raises
    ------
    StudyError
        If the script ends with another exit code than 0; it has then said why.
    """
    process = FORKS.Process(target=run_here, args=(script, step, jobs))
    with ASKING:  # to start one also asks how others ended, and that is told once
        process.start()
    wait([process.sentinel])
    with ASKING:
        process.join()
    if process.exitcode:
        raise StudyError(f"{script} ended with exit code {process.exitcode}")


def run_here(script: str, step: Mapping[str, Any], jobs: int = 1) -> None:
    """Run a script in this process; a ``SystemExit`` passes."""
    share_cores(jobs)
    runpy.run_path(script, {"snakemake": SimpleNamespace(**step)})
