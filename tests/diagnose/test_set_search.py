"""The path of the search over sets of effects, on a table of what each set leaves: nothing is fitted here."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from study.diagnose import candidates, set_screening, set_search
from study.diagnose.set_screening import SetStart
from study.diagnose.set_search import SetSearch, gains, searched
from study.equations.model import ModelTerm
from study.equations.place import Place
from study.identify.time_domain import shape_search
from study.support import work
from study.support.arrays import Floats

N = 4800
NAMES = "abcdef"
UNKNOWNS = {"f": 3}  # an effect with a shape of its own; the others have one coefficient
RNG = np.random.default_rng(11)
NOISE = RNG.normal(size=2 * N)
SHAPES = {name: RNG.normal(size=2 * N) for name in NAMES}
Leaves = Callable[[frozenset[str]], Mapping[str, float]]


def left_by(amounts: Mapping[str, float]) -> Floats:
    return NOISE + sum((a * SHAPES[name] for name, a in amounts.items()), np.zeros(2 * N))


def effect(name: str) -> Any:
    """An effect with a coefficient, and so many shape parameters as are its unknowns more than that."""
    shapes = (0.0,) * (UNKNOWNS.get(name, 1) - 1)
    term = SimpleNamespace(name=name, variation=None, components=(name,), parameters=shapes)
    return ModelTerm(cast("Any", term), (None,), shapes)


def candidate(names: Iterable[str], amounts: Mapping[str, float], unphysical: str = "") -> Any:
    """A set as fitted, of which these amounts are left."""
    chosen, left = tuple(sorted(names)), left_by(amounts)
    unknowns = sum(UNKNOWNS.get(name, 1) for name in chosen)
    model = SimpleNamespace(
        terms=[effect(name) for name in chosen],
        modal=None,
        without_term=lambda name: SimpleNamespace(without=name),
    )
    record = SimpleNamespace(stretches=())
    return SimpleNamespace(
        names=chosen, name=" + ".join(chosen), entry=effect(chosen[0]), unknowns=unknowns,
        flexible=unknowns > len(chosen), unphysical=unphysical, power=float(np.mean(left**2)),
        fit=SimpleNamespace(model=model, residual=left[:N]),
        prediction=SimpleNamespace(residual=left[N:], prepared=SimpleNamespace(record=record, free=False)),
    )  # fmt: skip


class Bench:
    """A search whose fits come from a table, and whose screening proposes what a test says."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, leaves: Leaves):
        self.leaves = leaves
        self.fitted: list[tuple[str, str | None]] = []  # each set, and the smaller one that it began beside
        self.asked: list[tuple[str | None, int]] = []  # sets beside which others were asked for, and of which size
        self.screened: list[tuple[str, str]] = []  # the set beside which, and the effects whose promise was asked for
        self.proposed: Callable[[frozenset[str], int], Sequence[Iterable[str]]] = self.every
        monkeypatch.setattr(SetSearch, "fitted", lambda _, start: self.fit(start))
        monkeypatch.setattr(set_screening, "by_sensitivities", self.by_sensitivities)
        monkeypatch.setattr(set_screening, "by_the_reverse_system", lambda *_: {})
        monkeypatch.setattr(shape_search, "baseline", lambda fit, _: SimpleNamespace(fit=fit))
        monkeypatch.setattr(candidates, "screened", self.promising)

    def fit(self, start: SetStart) -> Any:
        beside = None if start.beside is None else start.beside.name
        self.fitted.append(("".join(sorted(start.names)), beside))
        return candidate(start.names, self.leaves(start.names))

    @staticmethod
    def every(_: frozenset[str], size: int) -> Sequence[Iterable[str]]:
        return list(combinations(NAMES, size))

    def by_sensitivities(
        self, parent: Any, offered: Any, _base: Any, sizes: Sequence[int], _most: int, **_: bool
    ) -> Any:
        names = frozenset[str]() if parent is None else frozenset(parent.names)
        self.asked += [(None if parent is None else parent.name, size) for size in sizes]
        model: Any = None
        return {
            n: [SetStart(frozenset(s), model, parent) for s in self.proposed(names, n) if set(s) <= set(offered)]
            for n in sizes
        }

    def promising(self, asked: Sequence[ModelTerm], beside: Any) -> list[shape_search.Screened]:
        names = "".join(entry.name for entry in beside.fit.model.terms)
        self.screened.append((names, "".join(sorted(entry.name for entry in asked))))
        points = [tuple(float(len(names)) for _ in entry.parameters) for entry in asked]
        return [
            shape_search.Screened(e, (shape_search.Start(p, (0.0,), 1.0),)) for e, p in zip(asked, points, strict=True)
        ]

    def search(
        self, *, done: bool = False, fewer_than: int | None = None, lost: str = "", progress: Any = None,
        from_above: bool = False, several: bool | None = None,
    ) -> SetSearch:  # fmt: skip
        """``lost`` are effects without a fit alone; of many places (``several``) no whole is asked for."""
        singles = [candidate(name, self.leaves(frozenset(name))) for name in NAMES if name not in lost]
        base: Any = SimpleNamespace(several=not from_above if several is None else several, prepared=None)
        asked = [effect(name) for name in NAMES]
        return searched(base, singles, [], asked, lambda _: done, fewer_than, progress, from_above=from_above)

    def sizes(self) -> set[int]:
        """Of the sets of several effects."""
        return {len(names) for names, _ in self.fitted if len(names) > 1}


def hidden(names: str) -> Leaves:
    """What a set leaves where these effects are missing, all of one size."""
    return lambda found: dict.fromkeys(set(names) - found, 1.0)


def best(search: SetSearch, size: int) -> str:
    return "".join(search.sets(size)[0].names)


def test_a_set_grows_until_one_effect_more_gains_nothing(monkeypatch: pytest.MonkeyPatch):
    bench = Bench(monkeypatch, hidden("abd"))
    search = bench.search()
    assert best(search, 3) == "abd"
    assert bench.sizes() == {2, 3, 4}  # four are asked for, to see that they gain nothing
    assert not gains(search.sets(3)[0], search.sets(4)[0], 1)

    smaller = Bench(monkeypatch, hidden("ad"))
    assert best(smaller.search(), 2) == "ad"
    assert smaller.sizes() == {2, 3, 4}


def test_one_size_may_gain_nothing_but_not_two(monkeypatch: pytest.MonkeyPatch):
    def leaves(found: frozenset[str]) -> dict[str, float]:
        """Three effects that do something together alone."""
        return {} if {"a", "b", "c"} <= found else {"a": 1.0}

    assert best(Bench(monkeypatch, leaves).search(), 3) == "abc"
    nothing = Bench(monkeypatch, lambda _: {"a": 1.0})
    nothing.search()
    assert nothing.sizes() == {2, 3}


def test_an_effect_beside_which_alone_no_motion_is_finite_is_asked_for_in_sets(monkeypatch: pytest.MonkeyPatch):
    assert best(Bench(monkeypatch, hidden("abd")).search(lost="b"), 3) == "abd"


def test_an_effect_alone_is_fitted_again_from_where_a_set_with_it_ended(monkeypatch: pytest.MonkeyPatch):
    """Its first fit ended in a side valley, which another effect beside it led out of."""

    def leaves(found: frozenset[str]) -> dict[str, float]:
        return {"b": 1.0, "c": 0.5} if found == {"a"} else {} if "a" in found else {"a": 1.0}

    bench = Bench(monkeypatch, leaves)
    monkeypatch.setattr(
        bench, "fit", lambda start: candidate(start.names, {} if "a" in start.names else leaves(start.names))
    )
    search = bench.search()
    assert search.tried[frozenset("a")].power < 0.7 * candidate("a", leaves(frozenset("a"))).power


def test_what_the_user_ends_leaves_the_best_so_far(monkeypatch: pytest.MonkeyPatch):
    told: list[str] = []

    def progress(_done: int, _of: int, what: str) -> None:
        told.append(what)
        if what == "sets of 3":
            raise KeyboardInterrupt

    search = Bench(monkeypatch, hidden("abd")).search(progress=progress)
    assert search.ended == "by hand at sets of 3"
    assert search.sets(2)
    assert told[-1] == "sets of 3"
    assert "sets of 2" in told
    assert not Bench(monkeypatch, hidden("abd")).search().ended


def test_a_search_that_has_done_its_work_leaves_the_best_so_far(monkeypatch: pytest.MonkeyPatch):
    """Each fit counts as one operation here; a batch that has begun is made to its end."""
    bench = Bench(monkeypatch, hidden("abd"))
    bench.search()
    whole, bench.fitted = len(bench.fitted), []
    fit = bench.fit

    def counted(start: SetStart) -> Any:
        work.add(1)
        return fit(start)

    monkeypatch.setattr(bench, "fit", counted)
    with work.limited_to(8):
        search = bench.search()
    assert 8 <= len(bench.fitted) < whole
    assert search.ended == f"{work.ENDED} at sets of {max(map(len, search.tried))}"
    assert search.sets(2)


def test_exchanges_go_on_until_none_gains(monkeypatch: pytest.MonkeyPatch):
    """From a pair that is proposed first to one that shares no effect with it, one effect at a time."""
    order = ["ab", "ac", "cd"]
    bench = Bench(monkeypatch, lambda found: {"e": 0.3 * (3 - order.index("".join(sorted(found))))}
                  if "".join(sorted(found)) in order else {"e": 1.0})  # fmt: skip

    def proposed(parent: frozenset[str], size: int) -> list[frozenset[str]]:
        names = "".join(sorted(parent))
        following = order[order.index(names) + 1 :][:1] if names in order else ["ab"]
        return [frozenset(s) for s in following if len(s) == size]

    bench.proposed = proposed
    assert best(bench.search(), 2) == "cd"


def test_no_set_is_larger_than_four(monkeypatch: pytest.MonkeyPatch):
    bench = Bench(monkeypatch, hidden("abcde"))
    bench.search()
    assert max(bench.sizes()) == set_search.MOST_EFFECTS == 4


def test_an_effect_of_the_smaller_set_changes_places_with_another(monkeypatch: pytest.MonkeyPatch):
    def leaves(found: frozenset[str]) -> dict[str, float]:
        """Effect a does part of what b and c do, and is first alone."""
        missing = dict.fromkeys({"b", "c"} - found, 1.0)
        return dict.fromkeys(missing, 0.3) if "a" in found else missing

    bench = Bench(monkeypatch, leaves)

    def near(parent: frozenset[str], size: int) -> list[frozenset[str]]:
        """Of what has the size, all that adds an effect to the parent or changes one of its."""
        return [frozenset(s) for s in combinations(NAMES, size) if len(parent & set(s)) >= min(len(parent), size - 1)]

    def proposed(parent: frozenset[str], size: int) -> list[frozenset[str]]:
        return near(parent, size) if parent else [frozenset("ab")]

    bench.proposed = proposed
    search = bench.search()
    assert best(search, 1) == "a"
    assert best(search, 2) == "bc"
    assert any(names == "bc" and beside is not None and "a" in beside for names, beside in bench.fitted)


def test_where_one_effect_leaves_nothing_only_simple_sets_with_fewer_unknowns_are_asked_for(
    monkeypatch: pytest.MonkeyPatch,
):
    def leaves(found: frozenset[str]) -> dict[str, float]:
        return {} if "f" in found else dict.fromkeys({"a", "b"} - found, 1.0)

    bench = Bench(monkeypatch, leaves)
    search = bench.search(fewer_than=UNKNOWNS["f"])
    assert best(search, 1) == "f"
    assert bench.sizes() == {2}
    beside = {parent for parent, _ in bench.asked if parent is not None}
    assert beside
    assert not any("f" in parent for parent in beside)
    assert not any("f" in names for names, _ in bench.fitted)  # nor is a set with it worth a fit
    assert frozenset("ab") in search.tried

    none = Bench(monkeypatch, leaves)
    none.search(fewer_than=2)
    assert not none.fitted


def test_simple_sets_grow_by_what_they_gain_themselves_though_a_flexible_effect_does_better_than_two(
    monkeypatch: pytest.MonkeyPatch,
):
    def leaves(found: frozenset[str]) -> dict[str, float]:
        return {"c": 0.3} if "f" in found else dict.fromkeys({"a", "b", "c"} - found, 1.0)

    search = Bench(monkeypatch, leaves).search(fewer_than=set_search.MOST_EFFECTS + 1)
    assert best(search, 1) == "f"
    assert search.sets(2, simple=True)[0].power > search.sets(1)[0].power > search.sets(3)[0].power
    assert best(search, 3) == "abc"


def test_a_flexible_set_that_leaves_nothing_ends_the_search_at_its_own_unknowns(monkeypatch: pytest.MonkeyPatch):
    def leaves(found: frozenset[str]) -> dict[str, float]:
        if {"e", "f"} <= found:
            return dict.fromkeys({"d"} - found, 0.3)
        return dict.fromkeys({"a", "b", "c"} - found, 0.6 if "f" in found else 1.0)

    bench = Bench(monkeypatch, leaves)
    search = bench.search(done=True)
    assert best(search, 2) == "ef"  # four unknowns
    assert frozenset("abc") in search.tried  # simple sets of three have fewer
    assert bench.sizes() == {2, 3}

    def flexible_at_three() -> bool:
        return any("f" in parent for parent, size in bench.asked if size == 3 and parent is not None)

    assert gains(search.sets(2)[0], search.sets(3)[0], 1)
    assert not flexible_at_three()
    bench.search(done=False)
    assert flexible_at_three()
    assert 4 in bench.sizes()


@pytest.mark.parametrize("missing", ["a", "ab", "abc", "abcd", "f", "abf"])
def test_no_set_is_fitted_twice_from_one_beginning(monkeypatch: pytest.MonkeyPatch, missing: str):
    bench = Bench(monkeypatch, hidden(missing))
    bench.search()
    assert bench.fitted
    assert len(bench.fitted) == len(set(bench.fitted))
    assert not any(beside is not None and names == beside.replace(" + ", "") for names, beside in bench.fitted)


def test_sets_without_one_effect_of_the_best_are_there_to_ask(monkeypatch: pytest.MonkeyPatch):
    bench = Bench(monkeypatch, hidden("abc"))
    bench.proposed = lambda _, size: ["abcd"[:size]]
    search = bench.search()
    for name in "abc":
        assert frozenset("abc") - {name} in search.tried
    count = len(bench.fitted)
    assert search.without(frozenset("abc"), "b") is search.tried[frozenset("ac")]
    assert len(bench.fitted) == count
    assert search.without(frozenset("a"), "a") is None


def test_of_a_set_that_is_fitted_again_the_better_fit_stays_and_an_unphysical_one_comes_last():
    nothing: Any = None
    search = SetSearch(nothing, {}, {})
    ends = iter([candidate("ab", {"c": 0.5}), candidate("ab", {}), candidate("ab", {"c": 1.0})])
    start = SetStart(frozenset("ab"), nothing)
    object.__setattr__(search, "fitted", lambda _: next(ends))
    kept: list[float] = []
    for _ in range(3):
        search.fit([start])
        kept.append(search.tried[frozenset("ab")].power)
    assert kept[1] < kept[0]
    assert kept[2] == kept[1]
    search.tried[frozenset("ac")] = candidate("ac", {"b": 0.2})
    search.tried[frozenset("bc")] = candidate("bc", {}, unphysical="a mass is positive")
    assert ["".join(c.names) for c in search.sets(2)] == ["ab", "ac", "bc"]


def test_a_gain_is_judged_by_how_many_sets_were_asked_for():
    smaller, larger = candidate("a", {"b": 0.08}), candidate("ab", {})
    assert gains(smaller, larger, 1)
    assert not gains(smaller, larger, 10**9)
    assert not gains(larger, smaller, 1)


def test_what_grows_astray_is_found_from_above(monkeypatch: pytest.MonkeyPatch):
    """The smaller sets ask for wrong effects; beside all of them at once the right four show."""

    def astray(parent: frozenset[str], size: int) -> Sequence[Iterable[str]]:
        return ["abcd"[:size]] if parent == set(NAMES) else [s for s in combinations(NAMES, size) if "d" not in s]

    def found(*, from_above: bool, several: bool = False) -> tuple[str, list[str | None]]:
        bench = Bench(monkeypatch, hidden("abcd"))
        bench.proposed = astray
        search = bench.search(from_above=from_above, several=several)
        return best(search, 4), [beside for names, beside in bench.fitted if names == "abcd"]

    every = candidate(NAMES, {})
    monkeypatch.setattr(set_search, "_whole", lambda *_: every)
    monkeypatch.setattr(set_search, "_with_shapes", lambda *_: [])
    assert found(from_above=False)[0] != "abcd"
    assert found(from_above=True) == ("abcd", [every.name])
    assert found(from_above=True, several=True)[0] != "abcd"  # what is missing from the whole of many places


def test_what_was_not_fitted_alone_is_asked_for_beside_the_best_sets_and_each_shape_anew(
    monkeypatch: pytest.MonkeyPatch,
):
    bench = Bench(monkeypatch, hidden("abf"))
    search = bench.search(lost="b")
    assert best(search, 3) == "abf"
    assert bench.screened[0] == ("f", "b")  # the best alone has the only shape
    assert ("a", "f") in bench.screened
    assert search.offered["f"].parameters == (float(len(bench.screened[-1][0])),) * 2

    simple = Bench(monkeypatch, hidden("abf"))
    simple.search(lost="bf", fewer_than=set_search.MOST_EFFECTS)
    assert {asked for _, asked in simple.screened} == {"b"}  # and b no more once it is offered


def test_beside_modes_no_shape_is_asked_anew(monkeypatch: pytest.MonkeyPatch):
    bench = Bench(monkeypatch, hidden("abf"))
    nothing: Any = SimpleNamespace(several=True, prepared=None)
    parent = candidate("a", {})
    for parent.fit.model.modal in (None, "modes"):
        set_search.offer_beside(SetSearch(nothing, {n: effect(n) for n in "bf"}, {}), parent, simple=False)
    assert bench.screened == [("a", "bf"), ("a", "b")]


def test_the_other_side_of_a_place_is_not_asked_for(monkeypatch: pytest.MonkeyPatch):
    def between(*ends: str) -> ModelTerm:
        return replace(effect("b"), place=Place("between", ends))

    bench = Bench(monkeypatch, hidden("ab"))
    here, there = between("x", "y"), between("y", "x")
    nothing: Any = SimpleNamespace(several=True, prepared=None)
    entries = {here.name: here, there.name: there}
    for offered in ({here.name: here}, {}):
        search = SetSearch(nothing, entries, dict(offered))
        set_search.offer_beside(search, candidate("a", {}), simple=False)
        assert list(search.offered) == [here.name]
    assert len(bench.screened) == 1  # where one side was offered nothing is asked
