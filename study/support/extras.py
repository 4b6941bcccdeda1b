"""Packages that only some uses need: extras of the installation bring them."""

from importlib import import_module
from typing import Any

from study.support.errors import StudyError

DRAWING = ("matplotlib", "drawing pictures", "pictures")


def lacking(module: str, use: str, extra: str) -> str:
    """A sentence that says what is to be installed for a use; empty where all is there."""
    try:
        import_module(module)
    except ModuleNotFoundError:
        package = module.partition(".")[0]
        return f"{use} needs {package}; expected an installation with 'pip install reverse-miso-study[{extra}]'"
    return ""


def undrawn() -> str:
    """Why no picture can be drawn, in a sentence; empty where it can."""
    return lacking(*DRAWING)


def lacked(error: ModuleNotFoundError) -> str:
    """The same of a package that was missing where nothing does without it; empty if it is none of an extra."""
    package = (error.name or "").partition(".")[0]
    extra = {"matplotlib": "pictures", "pandas": "workflow", "pydantic": "workflow", "bokeh": "explore"}.get(package)
    return lacking(package, "this", extra) if extra else ""


def needed(module: str, use: str, extra: str) -> Any:
    """A module of a package that a plain installation lacks.

    Parameters
    ----------
    module : str
        Its name.
    use : str
        What cannot be done without it; the sentence begins with it.
    extra : str
        The extra of this project that brings the package.
    """
    if sentence := lacking(module, use, extra):
        raise StudyError(sentence)
    return import_module(module)
