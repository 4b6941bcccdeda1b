"""Two or three plain sentences, composed from the numbers of a comparison and saying no more than they do."""

from collections.abc import Sequence

import numpy as np

from study.compare.along_time import AlongTime
from study.compare.comparison import Comparison
from study.compare.fitted_coefficients import Level
from study.compare.growth import Growth, Growths
from study.compare.noise import SCATTER
from study.compare.varying_coefficients import varying_in_words
from study.equations.place import place_in_words
from study.equations.terms import LINEAR
from study.records.record import FORCE
from study.support.numbers import by_chance, percent
from study.support.thresholds import ALPHA, TOLERANCE

TOLD_APART = 2.0  # standard errors by which the best way must explain more than another
EXPLAINS = 0.5  # of what stands above the noise: what a power must explain to be named
SURE_POWER = 0.4  # standard error of a power, at most, for it to be called by a whole number
HOPELESS = 0.98  # of the rms response, above the noise: an error with which a model predicts nothing
POWER_NAMES = {0: "constant size", 2: "square", 3: "cube", 4: "fourth power", 5: "fifth power"}
PARITY = {"odd": "odd in it", "even": "even in it"}


def comparison_in_words(comparison: Comparison, diagnosed: bool = False) -> str:
    """What a user should know of one record, in two or three sentences; ``diagnosed`` if its reader has that too."""
    sentences = [_how_good(comparison, diagnosed)]
    if comparison.prediction.above_noise >= HOPELESS:
        sentences.append(_least(comparison))
    elif comparison.prediction.above_noise > TOLERANCE:
        sentences.append(_where(comparison))
    if comparison.model.named:
        sentences += _of_equations(comparison)
    sentences += [varying_in_words(one).removesuffix(".") for one in comparison.varying]
    if not comparison.fit.converged:
        sentences.append(f"The fit did not arrive at a minimum ({comparison.fit.message}), so the fit may be at fault")
    return ". ".join(s[0].upper() + s[1:] for s in sentences) + "."


def _least(comparison: Comparison) -> str:
    """What to look for when a model predicts nothing."""
    known = {entry.term.name for entry in comparison.model.terms}
    lacking = [name.replace("_", " ") for name in LINEAR if name not in known]
    if lacking:
        return f"mass, damping and stiffness are the least that a model needs; it lacks {' and '.join(lacking)}"
    held = ", ".join(comparison.model.held_keys)
    doubt = f"the values that it holds ({held}), " if held else ""
    return f"look at {doubt}the columns, their signs and units, and whether the force is all that drives the motion"


def _plain(number: float) -> str:
    """Two digits, never with an exponent."""
    return np.format_float_positional(float(f"{number:.2g}"), trim="-")


def _how_good(comparison: Comparison, diagnosed: bool) -> str:
    error, floor = percent(comparison.prediction.error), percent(comparison.prediction.floor)
    start = f"the model misses the response by {error} of its rms"
    if len(comparison.views) > 1:
        start += f", most at {comparison.worst.sensor} ({percent(comparison.worst.error)})"
    if comparison.prediction.above_noise >= HOPELESS:
        # more than that is more than no motion at all would leave
        like = "as a model" if comparison.prediction.error < 1.1 else "more than a model"
        return (
            f"{start}, {like} that never moves would: it cannot follow this record, and its fitted coefficients "
            "mean nothing"
        )
    noises = [view.noise for view in comparison.views]
    if all(noise.alone for noise in noises):
        source = " (from the scatter between periods)" if noises[0].source == SCATTER else ""
        doubt = "" if source or diagnosed else "; 'study diagnose' looks closer"
        if comparison.prediction.floor**2 > 0.5:
            doubt = ". Most of what is judged is noise, which no model explains (--judge A:B names another part)"
        return f"{start}, which looks like noise{source}: hardly any of it is above the noise floor of {floor}{doubt}"
    if comparison.prediction.above_noise <= TOLERANCE:
        # a sum over frequencies, it may come out larger than the error, which is one over time
        excess = percent(min(comparison.prediction.above_noise, comparison.prediction.error))
        return (
            f"{start}; what stands above the noise floor of {floor} is {excess} of the response, too little to say "
            "that anything is missing"
        )
    return f"{start}, where noise alone would leave {floor}"


def _where(comparison: Comparison) -> str:
    response = next((b for b in comparison.bands if b.of in ("response", str(comparison.worst.sensor))), None)
    band = ""
    if response is not None:
        band = (
            f"{percent(response.share)} of what is unexplained lies between "
            f"{_plain(response.low)} and {_plain(response.high)} Hz; "
        )
    at = f"{place_in_words(comparison.place)} " if comparison.model.named else ""
    return band + f"{at}{_grows(comparison.growths)}; {_along(comparison.time)}"


def _of_equations(comparison: Comparison) -> list[str]:
    """Which equation of a structure is violated most, and where a force would explain most of it."""
    missing, said = comparison.missing, list[str]()
    if missing.lacking:
        lacking, shown = ", ".join(missing.lacking), comparison.prepared.response != FORCE
        why = "which no sensor shows" if shown else "where none was measured"
        said.append(f"the reverse system says no force of {lacking}, {why}")
    if len(missing.equations) > 1 and np.any(missing.rms > 0.0):
        i = int(np.argmax(missing.rms))
        name = missing.equations[i]
        left = f"{missing.rms[i]:.3g} {missing.units(name)['force']} rms of its forces remain"
        said.append(f"the equation of {name} is violated most: {left}")
    place, share = missing.aligned[0]
    if len(comparison.views) > 1 and share > 0.0:
        said.append(
            f"a single force {place_in_words(place)} could make {percent(share)} of what stands above the noise"
        )
    for spectrum in comparison.by_line:
        (mean, error), (imaginary, wrong), (trend, slope) = spectrum.mean, spectrum.imaginary, spectrum.trend
        said.append(
            f"line by line {spectrum.key} is {mean:.4g} +- {1.96 * error:.2g}, its imaginary part {imaginary:.2g} +- "
            f"{1.96 * wrong:.2g} and its rise over the band {trend:.2g} +- {1.96 * slope:.2g}, which are zero for a "
            "term that is the right one at the right place"
        )
    return said


def _grows(growths: Growths | None) -> str:
    """The best power, as far as it stands out."""
    if growths is not None and EXPLAINS <= growths.ways[0].share < TOLD_APART * growths.ways[0].share_error:
        return "no power of displacement or velocity surely explains it"
    if growths is None or growths.ways[0].share < EXPLAINS:
        best = "" if growths is None else f" (the best explains {percent(max(growths.ways[0].share, 0.0))})"
        return f"no power of displacement or velocity explains it{best}"
    best = growths.ways[0]
    rivals = [w for w, margin in zip(growths.ways[1:], growths.margins[1:], strict=True) if margin < TOLD_APART]
    rivals = [w for w in rivals if w.share > EXPLAINS]
    share = "" if best.share > 0.95 else f", which explains {percent(best.share)} of it"
    if not rivals:
        return f"it {_growth(best)}{share}"
    others = " or ".join(_short(w) for w in rivals)
    return f"it {_growth(best)}{share}, though {others} would do as well"


def _growth(way: Growth) -> str:
    whole = _whole(way)
    if way.of == "damping by displacement":
        return f"is a damping force that grows with {_power(way, whole)} of displacement"
    if whole == 0:
        return (
            f"is a force of constant size with the sign of {way.of}" if way.parity == "odd" else "is a constant force"
        )
    if way.power < 0.6:  # a power below this is a step that noise has rounded, or close to one
        return f"hardly grows with {way.of} (about the power {way.power:.1f}) and is {PARITY[way.parity]}"
    if whole == 1:
        one_sided = "" if way.parity == "odd" else ", whatever its sign"
        return f"grows in proportion to {way.of}{one_sided} and is {PARITY[way.parity]}"
    return f"grows with {_power(way, whole)} of {way.of} and is {PARITY[way.parity]}"


def _short(way: Growth) -> str:
    whole = _whole(way)
    if way.of == "damping by displacement":
        return f"a damping force with {_power(way, whole)} of displacement"
    if whole in (0, 1):
        amount = "a force of constant size with the sign" if whole == 0 else "an effect in proportion to the size"
        return f"{amount} of {way.of}" if way.parity == "odd" or whole else "a constant force"
    return f"{_power(way, whole)} of {way.of} ({way.parity})"


def _whole(way: Growth) -> int | None:
    """The whole number that a power is, if it is sure enough."""
    nearest = round(way.power)
    # a power is called by a whole number as near as this
    near = abs(way.power - nearest) <= max(0.25, TOLD_APART * way.power_error)
    return nearest if near and way.power_error <= SURE_POWER and nearest in (0, 1, *POWER_NAMES) else None


def _power(way: Growth, whole: int | None) -> str:
    if whole == 1:
        return "the size"
    if way.power >= 5.9:  # the powers that are tried end at six
        return "a power of six or more"
    return f"the {POWER_NAMES[whole]}" if whole in POWER_NAMES else f"about the power {way.power:.1f}"


def _along(along: AlongTime) -> str:
    if along.p_value >= ALPHA:
        return f"it does not change along the record ({by_chance(along.p_value)})"
    if along.confounded:
        return "it changes along the record, but so does the level, and the two cannot be told apart here"
    worst = max(along.stretches, key=lambda s: s.ratio)
    return (
        f"it changes along the record ({by_chance(along.p_value)}) and is largest from {worst.begin:.4g} to "
        f"{worst.end:.4g} s, {worst.ratio:.2g} times the power that is usual at that level"
    )


def says_of_all(comparisons: Sequence[Comparison], moving: Sequence[Level]) -> str:
    """The same of several records: the worst of them, and whether the coefficients move between levels."""
    if len(comparisons) == 1:
        return comparison_in_words(comparisons[0])
    worst = max(comparisons, key=lambda c: c.prediction.above_noise)
    moved = [level for level in moving if level.moves]
    names = ", ".join(f"{level.key} by {percent(level.change)}" for level in moved)
    levels = f"coefficients move with the level: {names}" if moved else "no coefficient moves with the level"
    if not moving:
        levels = "no coefficient was fitted"
    which = f"{worst.record.name} (the worst of {len(comparisons)})"
    return f"{which}: {comparison_in_words(worst)} {levels[0].upper() + levels[1:]}."
