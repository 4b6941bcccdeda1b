"""The effects that a model may lack, and the places where it may lack them."""

from collections.abc import Container, Sequence

from study.equations.linear_part import connections
from study.equations.model import Model, ModelTerm, free
from study.equations.place import Place
from study.equations.term import Term
from study.equations.terms import effects_but, external, is_linear, one_sided


def candidate_entries(
    model: Model, extra: Sequence[Term] = (), without: Sequence[str] = (), turning: Container[str] = ()
) -> list[ModelTerm]:
    """Every effect at every place where the model does not have it: the library's, and the user's own.

    What depends on the sign of the motion alone, a stop on one side, is tried on either side of a place between two.
    What acts on an angle is asked for where the coordinates turn: ``turning`` are those of the record that do.
    Modes hold whatever is linear already, and a force from outside is no property of a place between sensors.
    """
    known = {entry.effect for entry in model.terms}
    found: list[ModelTerm] = []
    for term in effects_but(without, extra):
        outside = external(term)
        if model.modal and (outside or is_linear(term)):
            continue
        for place in [Place("at", (c,)) for c in model.coordinates] if outside else connections(model):
            straight = any(end not in turning for end in place.moving)
            if (term.name, place.path) not in known and not (term.angle and straight):
                found.append(free(term, place))
                if len(model.coordinates) > 1 and place.kind == "between" and not outside and one_sided(term):
                    found.append(free(term, Place("between", place.ends[::-1])))
    return found
