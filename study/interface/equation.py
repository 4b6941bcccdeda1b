"""Models: equations of motion made of terms."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal, cast

from study.equations import model as equations
from study.equations import model_file, terms
from study.equations.modal_part import ModalPart
from study.equations.model import ModelTerm
from study.equations.place import HERE, Kind, Place
from study.equations.redundancy import repeated_force
from study.interface.data import Record
from study.interface.showing import TABLES, html_table
from study.support.errors import StudyError, expect
from study.support.extras import needed
from study.support.files import replace_file

if TYPE_CHECKING:
    import pandas as pd

    from study.faults.fault import Given
    from study.interface.fitted import Fit
    from study.interface.found import Candidate

Samples = tuple[int, int | None]  # the first, and the one after the last
Times = tuple[float, float | None]  # seconds


def term(
    name: str, *, force: str | None = None, at: str | None = None, between: Sequence[str] | None = None,
    couples: Sequence[str] | None = None, varies_with: str | None = None, shape: str = "curve", only: str = "",
    knots: Sequence[float] = (), changes: Sequence[float] | float | None = None, **values: float,
) -> "Term":  # fmt: skip
    """A term with values that a fit holds.

    Parameters
    ----------
    name : str
        An effect of the library (:func:`library`), or a name of your own with ``force``.
    force : str, optional
        Formula of your own effect, such as ``"u*abs(u)"``: of u, v, t and further channels. Parsed, never evaluated.
    at, between, couples : str or pair of str, optional
        Of a structure: the coordinate on which it acts, the two between which it does (``ground`` may be one of them),
        or the two that an inertia couples.
    varies_with : str, optional
        ``"time"`` or a channel of the record: the term is then what the coefficients of that effect change by, beside
        the term itself.
    shape : str
        How they change: ``"curve"``, ``"line"`` or ``"step"``.
    only : str
        The side of the motion that has the change, such as ``"v > 0"``; all of it if left out.
    knots, changes : sequence of float
        Where the changes are given, and by how much the coefficient differs there, zero at the first; fitted if left
        out.
    **values : float
        ``value`` of its coefficient (``amplitude`` and ``phase`` of a periodic one) and shape parameters by name, in
        the units of the record. What is left out is fitted. ``held=False`` makes them the start of a fit.

    Raises
    ------
    StudyError
        If there is no such effect, or it has no such value.

    Examples
    --------
    >>> term("cubic_stiffness", value=2e7)
    <Term cubic_stiffness: u**3; k3 = 2e+07>
    >>> term("linear_stiffness", varies_with="time", shape="line", knots=[0.0, 60.0], changes=[0.0, -35.0])
    <Term linear_stiffness_over_time: (u) that changes evenly along time; k_time = -35>
    """
    given: dict[object, object] = {"term": name, **({} if force is None else {"force": force}), **values}
    if varies_with is not None:
        given |= {"varies_with": varies_with, "shape": shape} | ({"only": only} if only else {})
        given |= {"knots": [float(x) for x in knots]} if len(knots) else {}
        if changes is not None:
            given["changes"] = changes if isinstance(changes, int | float) else [float(x) for x in changes]
    else:
        expect(not (only or len(knots) or changes is not None), f"{name} has a change and no varies_with")
    return Term.of(replace(model_file.entry_from(given), place=_place(name, at, between, couples)))


def _place(
    name: str, at: str | None, between: Sequence[str] | None, couples: Sequence[str] | None = None
) -> Place:  # fmt: skip
    """Where a term acts; a single mass has one place, which nobody names."""
    given = {"at": None if at is None else (at,), "between": between, "couples": couples}
    said = [kind for kind, ends in given.items() if ends is not None]
    expect(len(said) < 2, f"{name} has {' and '.join(said)}; expected one of them")
    if not said:
        return HERE
    kind, ends = cast(Kind, said[0]), tuple(given[said[0]] or ())
    expect(kind == "at" or len(ends) == 2, f"{kind} of {name} is {list(ends)}; expected two coordinates")
    return Place(kind, ends)


@dataclass(frozen=True, repr=False)
class Term(ModelTerm):
    """A term in a model with what is known of it."""

    @classmethod
    def of(cls, entry: ModelTerm) -> "Term":
        """An entry of the packages below as one of this interface."""
        return cls(entry.term, entry.coefficients, entry.parameters, entry.place, entry.starts)

    def __repr__(self) -> str:
        """One line: name, formula and what is held."""
        known = [f"{key} = {value:g}" for key, value in self.values.items() if value is not None]
        known += [f"{key} from {value:g} on" for key, value in self.starts]
        return f"<Term {'; '.join([f'{self.name}: {self.term.formula}', *known])}>"


def library(word: str = "") -> "pd.DataFrame":
    """The effects a model may hold, one row each, indexed by name: those that a word finds, or all of them.

    Columns are formula, shape parameters, meaning and common cause. ``library("cubic")`` finds every effect with the
    word in its name, formula, meaning or cause.
    """
    needed(*TABLES)
    import pandas as pd

    found = terms.find_terms(word) if word else tuple(terms.LIBRARY.values())
    rows = [
        {"term": t.name, "formula": t.formula, "parameters": ", ".join(p.name for p in t.parameters),
         "meaning": t.meaning, "cause": t.cause} for t in found
    ]  # fmt: skip
    return pd.DataFrame(rows, columns=["term", "formula", "parameters", "meaning", "cause"]).set_index("term")


@dataclass(frozen=True, repr=False, init=False)
class Model:
    """An equation of motion: the sum of its terms is the force.

    Parameters
    ----------
    *terms : str or Term
        Names of effects of the library, or :func:`term` with values that a fit holds.
    name : str
        What it is called in tables.
    coordinates : sequence of str
        Of a structure: where sensors, forces and terms are. Each term then says where it acts.
    forces : mapping of str, optional
        Of a structure: name of each measured force to the coordinate on which it acts.
    modal : bool
        Whether a structure's linear part is a sum of modes, as many as a record shows; its terms are nonlinear alone.

    Attributes
    ----------
    equation : study.equations.model.Model
        What the packages below work with.

    Raises
    ------
    StudyError
        If an effect is not known, two of them are the same force, or the terms make no structure of the coordinates.

    Examples
    --------
    >>> Model("inertia", "linear_damping", "linear_stiffness", term("cubic_stiffness", value=2e7), name="rig")
    <Model rig: inertia, linear_damping, linear_stiffness, cubic_stiffness (k3 = 2e+07)>
    """

    equation: equations.Model

    def __init__(
        self, *terms: "str | ModelTerm", name: str = "model", coordinates: Sequence[str] = (),
        forces: Mapping[str, str] | None = None, modal: bool = False,
    ) -> None:  # fmt: skip
        entries = tuple(term(t) if isinstance(t, str) else t for t in terms)
        expect(entries or modal, "a model needs terms; expected some such as Model('inertia', 'linear_stiffness')")
        made = equations.Model(
            name, tuple(ModelTerm(e.term, e.coefficients, e.parameters, e.place, e.starts) for e in entries),
        )  # fmt: skip
        if coordinates:
            made = replace(made, coordinates=tuple(coordinates), forces=tuple((forces or {}).items()))
            made = replace(made, modal=ModalPart(made.coordinates) if modal else None)
            made = model_file.parse_model(model_file.format_model(made), Path(name))  # with the checks of a file
        else:
            expect(not modal, "modal=True is of a structure; expected coordinates=[...] beside it")
            placed = [e.name for e in entries if e.place != HERE] + list(forces or {})
            expect(not placed, f"{', '.join(placed)} has a place; expected coordinates=[...] beside it")
            fault = repeated_force(made)
            expect(fault is None, str(fault))
        object.__setattr__(self, "equation", made)

    @classmethod
    def of(cls, equation: equations.Model) -> "Model":
        """A model of the packages below as one of this interface."""
        made = object.__new__(cls)
        object.__setattr__(made, "equation", equation)
        return made

    @classmethod
    def load(cls, path: str | Path) -> "Model":
        """Read a model file (YAML); what it gives is held by a fit, the rest is fitted.

        Raises
        ------
        StudyError
            If the file cannot be read or is no model, naming the file, the value and what was expected.
        """
        return cls.of(model_file.read_model(Path(path)))

    def save(self, path: str | Path, *, values: bool = True) -> None:
        """Write a model file, with the values that are known or (``values=False``) without any.

        What was fitted is written as the start of another fit, what was held is held again.

        Raises
        ------
        StudyError
            If a value is not finite.
        OSError
            If the file cannot be written; one that was there survives.
        """
        kept = self if values else self.free()
        replace_file(Path(path), model_file.format_model(kept.equation).encode())

    def export(self, path: str | Path, *, step: float | None = None) -> None:
        """Write the model for another program: a Python function for ``solve_ivp``, an FMU, or a Modelica class.

        Its values count as in N, m and s: :meth:`Fit.export` knows the units of its record.

        Parameters
        ----------
        path : str or Path
            The file, whose suffix says which: ``.py``, ``.fmu`` or ``.mo``.
        step : float, optional
            Largest internal step of an FMU in seconds; by default from the fastest oscillation about rest.

        Raises
        ------
        StudyError
            If a value is not known, or something cannot be said in that way: only an FMU has friction that sticks.
        """
        from study.export.ways import exported_file, way_of

        replace_file(Path(path), exported_file(self.equation, way_of(Path(path)), step=step))

    @property
    def name(self) -> str:
        """What it is called in tables."""
        return self.equation.name

    @property
    def terms(self) -> tuple[str, ...]:
        """Names of its terms."""
        return tuple(t.name for t in self.equation.terms)

    @property
    def values(self) -> dict[str, float | None]:
        """Coefficients and shape parameters by key, held or the start of a fit; None where nothing is given."""
        return self.equation.values | self.equation.starts

    def hold(self, *keys: str | Mapping[str, float], **values: float) -> "Model":
        """The model with values that a fit then holds: ``hold("k")`` at its start, ``hold(k3=2e7)`` at another.

        A mapping says those whose keys have a dot: ``hold({"dead_band.u_g": 0.01})``. Without any, all that it has
        starts for.

        Raises
        ------
        StudyError
            If it has no such value, or no start for one that is named without a number.
        """
        named = [key for key in keys if isinstance(key, str)]
        self._check(tuple(named))
        known = {key: value for key, value in self.values.items() if value is not None}
        without = next((key for key in named if key not in known), None)
        expect(without is None, f"model {self.name!r} has no start for {without!r}; expected a number, {without}=...")
        given = {key: known[key] for key in named}
        for mapping in (*(key for key in keys if not isinstance(key, str)), values):
            given |= mapping
        self._check(tuple(given))
        return Model.of(self.equation.with_values(given or self.equation.starts))

    def free(self, *keys: str) -> "Model":
        """The model with these values left open, starts included, or all of them.

        Raises
        ------
        StudyError
            If it has no such value.
        """
        self._check(keys)
        gone = keys or tuple(self.values)
        opened = self.equation.with_values(dict.fromkeys(gone))
        kept = (replace(t, starts=tuple((k, v) for k, v in t.starts if k not in gone)) for t in opened.terms)
        return Model.of(replace(opened, terms=tuple(kept)))

    def _check(self, keys: tuple[str, ...]) -> None:
        for key in keys:
            expect(key in self.values, f"model {self.name!r} has no value {key!r}; expected {', '.join(self.values)}")

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Those of a structure; none of a single mass."""
        return self.equation.coordinates if self.equation.named else ()

    def add(
        self, added: "Candidate | str | ModelTerm | None", *, at: str | None = None,
        between: Sequence[str] | None = None,
    ) -> "Model":  # fmt: skip
        """The model with a term more, of a structure at its place; a ``StudyError`` if it has that force already.

        Of a candidate of a diagnosis every effect is added, at its place; a fit starts from the values found there.
        """
        from study.interface.found import Candidate

        if isinstance(added, Candidate):
            fitted = {t.name: t for t in added.ranked.fit.model.terms}
            return self._with_terms(*self.equation.terms, *(fitted[name].opened() for name in added.ranked.names))
        if added is None:
            raise StudyError("None is no effect; expected one by name, or of a diagnosis that names one (found.best)")
        entry = term(added) if isinstance(added, str) else added
        if at is not None or between is not None:
            entry = replace(entry, place=_place(entry.term.name, at, between))
        return self._with_terms(*self.equation.terms, entry)

    def drop(self, name: str, *, at: str | None = None, between: Sequence[str] | None = None) -> "Model":
        """The model without a term, of a structure that at its place or by its full name.

        A ``StudyError`` if it lacks it or has no other.
        """
        from study.diagnose.dropping import check_no_change, term_at

        place = _place(name, at, between)
        gone = term_at(self.equation, name, None if place == HERE else place) if self.equation.named else name
        expect(gone in self.terms, f"model {self.name!r} has no term {name!r}; expected {', '.join(self.terms)}")
        check_no_change(self.equation, gone)
        return self._with_terms(*(t for t in self.equation.terms if t.name != gone))

    def _with_terms(self, *entries: ModelTerm) -> "Model":
        modal = self.equation.modal is not None
        return Model(*entries, name=self.name, coordinates=self.coordinates, forces=self._forces, modal=modal)

    @property
    def _forces(self) -> dict[str, str] | None:
        return dict(self.equation.forces) if self.equation.named else None

    def fit(
        self, record: "Record | Sequence[Record]", *, fit: Samples | None = None,
        judge: 'Samples | Literal["every-other-block"] | None' = None, use: Sequence[Times] = (),
        response: str | None = None, cutoff: float | None = None, near: float | None = None,
        up_to: float | None = None, estimator: str = "output_error",
        measurement: "Given | bool | None" = None, as_sampled: bool = False,
        absolute: bool = False, each_record: Sequence[str] = (), horizon: float | None = None,
    ) -> "Fit":  # fmt: skip
        """Fit what the model leaves open to one part of a record, and judge it on the other.

        What kind of test it is follows from record and model, as on the command line: without a force it is a free
        decay, with a channel such as ``base_acceleration`` one on a moving base, and of a model without inertia a
        component test, whose force is predicted.

        Parameters
        ----------
        record : Record or sequence of Record
            What was measured; to several, one model is fitted.
        fit, judge : pair of int, optional
            First sample and the one after the last (None: the end) of the parts to fit and to judge; by default the
            halves, or the longer of what one leaves of the record. ``judge="every-other-block"`` fits and judges blocks
            in turn, as is done by default of free decays, components, several stretches, and sweeps whose halves have
            other frequencies.
        use : sequence of pairs of float
            Stretches in seconds of the record's time (None: its end) that alone are used, fitted and judged together,
            such as those between blows.
        response : str, optional
            The measured motion that free runs are held against; the first of displacement, velocity, acceleration.
        cutoff : float, optional
            Integrate measured accelerations above this frequency in hertz and judge nothing below.
        near : float, optional
            Of a record that shows several modes the frequency in hertz of the one that is meant: the fit of a single
            mass begins there.
        up_to : float, optional
            Use what lies below this frequency in hertz alone, where a record shows modes that the model does not have.
        estimator : str
            What finds the coefficients: the fit in free run, or one of :func:`identify`.
        measurement : mapping, or False
            Faults of the measurement: False to look for none; by name a value that is known, or values by channel, or
            None for one that is not to be looked for. If left out, what stands beside the record's file.
        as_sampled : bool
            Use all samples of a driven response, though its motion asks for fewer; they always are used of free
            decays, components, motions without a spring, and of stretches that are named.
        absolute : bool
            On a moving base, the response was measured absolutely: the base's motion is subtracted.
        each_record : sequence of str
            Terms or coefficients that may differ between the records: all others are shared (:meth:`Fit.by_record`).
        horizon : float, optional
            Seconds over which the motion of a mass without a spring, which drifts, is fitted and judged, each time from
            a state of its own; by default some periods of its motion.

        Raises
        ------
        StudyError
            If the model cannot be fitted to the record, or what is asked does not go together.
        """
        from study.interface.fitted import fitted

        return fitted(
            self, record, fit=fit, judge=judge, use=use, response=response, cutoff=cutoff, near=near, up_to=up_to,
            estimator=estimator,
            measurement=measurement, as_sampled=as_sampled, absolute=absolute, each_record=each_record,
            horizon=horizon,
        )  # fmt: skip

    def __repr__(self) -> str:
        """One line: name, terms and what is held."""
        shown: list[str] = []
        for entry in self.equation.terms:
            values = [f"{k} = {v:g}" for k, v in entry.values.items() if v is not None]
            known = ", ".join([*values, *(f"{k} from {v:g} on" for k, v in entry.starts)])
            shown.append(f"{entry.name} ({known})" if known else entry.name)
        return f"<Model {self.name}: {', '.join(shown)}>"

    def _repr_html_(self) -> str:
        rows = [
            [
                t.name,
                t.term.formula,
                ", ".join(f"{k} = {'fitted' if v is None else f'{v:.6g}'}" for k, v in t.values.items()),
            ]
            for t in self.equation.terms
        ]
        return html_table(f"Model {self.name}", ["term", "force", "values"], rows, self.equation.equation())
