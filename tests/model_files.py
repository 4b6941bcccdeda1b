"""Model files changed in place, as 'study add' and 'study drop' change them."""

from pathlib import Path

from study.equations.model import Model, ModelTerm
from study.equations.model_file import read_model, text_with, text_without
from study.equations.term import Term
from study.support.files import replace_file


def add_term(path: Path, entry: Term | ModelTerm) -> Model:
    replace_file(path, text_with(path, entry).encode())
    return read_model(path)


def drop_term(path: Path, name: str) -> Model:
    replace_file(path, text_without(path, name).encode())
    return read_model(path)
