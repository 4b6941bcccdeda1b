"""Identify nonlinear equations of motion by reverse dynamic MI/SO analysis (Bendat, Palo, Coppolino, 1990).

``import study as st`` gives the Python interface; what stands in ``__all__`` is public and stable, all else is not.
"""

# Names are loaded when they are first used; __init__.pyi has their types.
# pyright: reportUnsupportedDunderAll=false

import sys
from importlib import import_module
from types import ModuleType
from typing import Any

__version__ = "0.1.0"

_HOMES = {  # loaded when it is first used: neither ``import study`` nor a command waits for what it does not need
    "data": ("Record", "read", "record"),
    "equation": ("Model", "Term", "library", "term"),
    "fitted": ("Fit",),
    "forces": ("Force", "gaussian", "multisine", "simulate", "sweep", "waves"),
    "found": ("Candidate", "Diagnosis"),
    "side_by_side": ("Across", "Ranking", "compare"),
    "planned": ("PlannedTest",),
    "paths": ("Identification", "identify"),
}
_PLACES = {name: f"study.interface.{home}" for home, names in _HOMES.items() for name in names}
_PLACES["StudyError"] = "study.support.errors"
_PACKAGES = ("compare", "identify")  # whose names are functions of the interface too

__all__ = [
    "Across", "Candidate", "Diagnosis", "Fit", "Force", "Identification", "Model", "PlannedTest", "Ranking",
    "Record", "StudyError", "Term", "__version__", "compare", "gaussian", "identify", "library", "multisine",
    "read", "record", "simulate", "sweep", "term", "waves",
]  # fmt: skip


class _Function:
    """A function of the interface that a package is called after: ``st.compare(fits)``, and all that is below it."""

    def __init__(self, package: ModuleType) -> None:
        self.__dict__["_package"] = package

    @property
    def __wrapped__(self) -> Any:
        name = self._package.__name__.rpartition(".")[2]
        return getattr(import_module(_PLACES[name]), name)

    @property
    def __doc__(self) -> str:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self.__wrapped__.__doc__

    @property
    def __signature__(self) -> Any:
        from inspect import signature  # which would make every command begin later

        return signature(self.__wrapped__)

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        return self.__wrapped__(*arguments, **options)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._package, name)

    def __setattr__(self, name: str, value: object) -> None:
        setattr(self._package, name, value)

    def __repr__(self) -> str:
        return f"<function {self._package.__name__}{self.__signature__}>"


class _Study(ModuleType):
    """The type of ``study`` itself: Python sets a package below as its attribute, and a function takes its place."""

    def __setattr__(self, name: str, value: object) -> None:
        if name in _PACKAGES and isinstance(value, ModuleType):
            value = _Function(value)
        super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Study


def __getattr__(name: str) -> Any:
    if name in _PACKAGES:
        import_module(f"study.{name}")
        return globals()[name]
    if name not in _PLACES:
        raise AttributeError(f"module 'study' has no attribute {name!r}; it offers {', '.join(sorted(_PLACES))}")
    return getattr(import_module(_PLACES[name]), name)


def __dir__() -> list[str]:
    return list(__all__)
