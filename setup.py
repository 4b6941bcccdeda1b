"""Compiles the loops in ``study/equations/c`` into one library that ctypes loads; all else stands in pyproject.toml."""

import importlib.util
import os
import shutil
import sys
import sysconfig
from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_ext import build_ext

SOURCES = Path("study/equations/c")
# A sum is rounded as it is written: contracted to one operation it would differ from processor to processor.
MICROSOFT = ["/O2", "/fp:precise"]
UNIX = ["-std=c99", "-O3", "-fno-gcse", "-ffp-contract=off", "-fvisibility=hidden"]


if os.name != "nt" and not os.environ.get("CC") and importlib.util.find_spec("ziglang"):
    own = (sysconfig.get_config_var("CC") or "cc").split()[0]
    if not shutil.which(own):
        os.environ["CC"] = f"{sys.executable} -m ziglang cc"


class SharedLibrary(build_ext):
    """A library of plain C: no module of Python, and so of no version of it."""

    def build_extension(self, ext):
        """Compile with the options of this compiler."""
        unix = self.compiler.compiler_type != "msvc"
        ext.extra_compile_args = UNIX if unix else MICROSOFT
        ext.libraries = ["m"] if unix else []
        super().build_extension(ext)

    def get_ext_filename(self, fullname):
        """Without the tag of a version of Python."""
        return str(Path(*fullname.split("."))) + (".dll" if os.name == "nt" else ".so")

    def get_export_symbols(self, ext):
        """Those that the sources say."""
        return ext.export_symbols

    def get_libraries(self, ext):
        """None of Python."""
        return ext.libraries


class OfAPlatform(bdist_wheel):
    """A wheel for any Python 3 of one platform."""

    def get_tag(self):
        """The tag of the platform alone."""
        return "py3", "none", super().get_tag()[2]


setup(
    ext_modules=[
        Extension(
            "study.equations._kernels",
            sources=sorted(str(path) for path in SOURCES.glob("*.c")),
            depends=sorted(str(path) for path in SOURCES.glob("*.h")),
        )
    ],
    cmdclass={"build_ext": SharedLibrary, "bdist_wheel": OfAPlatform},
)
