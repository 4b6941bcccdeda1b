"""Names that a case may not have, as its target or its folder would be another's."""

import re
from pathlib import Path

RULE = re.compile(r"^\s*(?:use rule \w+ as|rule) (\w+)(?: with)?:", re.MULTILINE)
FOLDERS = ("benchmarks",)  # of results/, beside those that are named after a rule


def rules(project: Path) -> set[str]:
    """Names of the rules of the Snakefile in a folder, and of what it includes from ``rules/``."""
    files = [path for path in (project / "Snakefile", *project.glob("rules/*.smk")) if path.is_file()]
    return {"all"}.union(*(RULE.findall(path.read_text(encoding="utf-8")) for path in files))


def taken(project: Path, many: int) -> dict[str, str]:
    """Each name that a case may not have, with what it is the name of.

    ``project`` is the folder of the Snakefile; ``many``, ``estimator_errors.many`` of the settings, names a folder.
    """
    folders = dict.fromkeys((*FOLDERS, f"estimators_{many}"), "a folder of results/")
    return folders | dict.fromkeys(rules(project), "a rule")
