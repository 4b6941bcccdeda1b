"""The public records, where they are: beside the project, or in the folder that STUDY_DATA names (see the README)."""

import os
from pathlib import Path

import pytest

DATA = Path(os.environ.get("STUDY_DATA", Path(__file__).parents[2] / "shared" / "data"))


def needs(*folders: str) -> pytest.MarkDecorator:
    """Skip a test where one of these folders of public records is not there, and say so."""
    lacking = [name for name in folders if not (DATA / name).is_dir()]
    return pytest.mark.skipif(bool(lacking), reason=f"the public records of {', '.join(lacking)} are not in {DATA}")
