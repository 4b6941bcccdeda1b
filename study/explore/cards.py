"""What stands on a page, card by card: the panels, the words above them, and what draws them."""

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from typing import Any

from study.compare.comparison import Comparison
from study.explore import plots, theme
from study.explore.check_columns import DRIVEN, FREE, PRESCRIBED, kind_of


@dataclass(frozen=True)
class Panel:
    """A panel: its name, the words above it, and what they say to a mouse."""

    name: str
    heading: str
    about: str = ""


Card = tuple[Panel, ...]
SPECTRUM = Panel("spectrum", "Difference of the response")
FORCE_LEFT: Card = (
    Panel("force", "What is left of the force"),
    Panel("coherence", "Share of the force explained", "cumulative coherence: what each term, computed from the "
          "measured motion, adds"), SPECTRUM,
)  # fmt: skip
MISSING_FORCE: Card = (
    Panel("plane", "Missing force"), Panel("against_u", "… against displacement"),
    Panel("against_v", "… against velocity"),
)  # fmt: skip
BY_FREQUENCY: Card = (
    Panel("lacking", "Missing force by frequency"),
    Panel("stiffness", "Dynamic stiffness", "A(f) of the relative displacement by reverse MI/SO: real part"),
)
BY_SENSOR: Card = (Panel("sensors", "Error by sensor"), replace(SPECTRUM, about="of the selected sensor"))
PHASE = Panel("phase", "… its phase")
RESPONSE_FUNCTIONS: Card = (
    Panel("frf", "Frequency response", "H1 of the judged part, of the record and of the model's free run under the "
          "same force"), PHASE,
    Panel("linearity", "… coherence with the force", "below one in both: nonlinear; in the measured alone: noise, or "
          "something missing"),
)  # fmt: skip
STIFFNESS: Card = (
    Panel("frf", "Dynamic stiffness", "force over displacement, of the record and of the model under the same motion"),
    replace(PHASE, about="the loss angle"), replace(RESPONSE_FUNCTIONS[2], heading="… its coherence"),
)  # fmt: skip
LOOPS: Card = (
    Panel("loop_u", "Force over displacement", "the loops of the judged part"), Panel("loop_v", "… over velocity"),
    Panel("cycles", "… energy of a cycle", "the area of each loop, over its stroke"),
)  # fmt: skip
DECAY: Card = (
    Panel("decay_frequency", "Frequency over amplitude", "windows of the analytic signal, with 95 % intervals"),
    Panel("decay_damping", "… damping ratio"),
)  # fmt: skip
ITSELF = Panel("autocorrelation", "Difference with itself", "a right model in white noise leaves nothing outside of "
               "the band")  # fmt: skip
DRIVE = Panel("with_force", "… with the force", "a right model leaves nothing outside of the band, whatever the colour "
              "of the noise")  # fmt: skip
DISTRIBUTION = Panel("histogram", "… its distribution", "σ: the standard deviation of the difference")
CHECKS: dict[str, tuple[Card, ...]] = {
    DRIVEN: (RESPONSE_FUNCTIONS, (ITSELF, DRIVE, DISTRIBUTION)),
    PRESCRIBED: (LOOPS, STIFFNESS, (ITSELF, replace(DRIVE, heading="… with the displacement"), DISTRIBUTION)),
    FREE: (DECAY, (ITSELF, DISTRIBUTION)),
}  # of each kind of test


def cards_of(comparison: Comparison) -> tuple[tuple[Card, ...], tuple[Card, ...]]:
    """The cards of the place that is selected in a sketch, above the response, and those below it."""
    checks = CHECKS[kind_of(comparison)]
    if not comparison.model.named:
        return (), (FORCE_LEFT, MISSING_FORCE, *checks)
    return (MISSING_FORCE, BY_FREQUENCY), (BY_SENSOR, *((FORCE_LEFT[:2],) if comparison.forces else ()), *checks)


def history_height(steps: int) -> int:
    """Height of the history in pixels."""
    return 104 + 27 * max(steps, 2)


def drawn(names: Collection[str], s: plots.Sources) -> dict[str, Any]:
    """Panels by their names; ranges of time and frequency are shared, and set with the data."""
    time, frequency = theme.fixed("range_time", 0.0, 1.0), theme.fixed("range_frequency", 0.0, 1.0)
    draw: dict[str, Callable[[], Any]] = {
        "history": lambda: plots.history(s, history_height(len(s["history"].data["name"]))),
        "response": lambda: plots.response(s, time), "difference": lambda: plots.difference(s, time),
        "close": lambda: plots.close(s), "constancy": lambda: plots.constancy(s),
        "force": lambda: plots.force(s, frequency), "coherence": lambda: plots.coherence(s, frequency),
        "spectrum": lambda: plots.spectrum(s, frequency), "sensors": lambda: plots.sensors(s),
        "plane": lambda: plots.plane(s), "against_u": lambda: plots.against(s, "u"),
        "against_v": lambda: plots.against(s, "v"), "lacking": lambda: plots.lacking(s, frequency),
        "stiffness": lambda: plots.stiffness(s, frequency), "frf": lambda: plots.magnitude(s, frequency),
        "phase": lambda: plots.phase(s, frequency), "linearity": lambda: plots.linearity(s, frequency),
        "loop_u": lambda: plots.loop(s, "u"), "loop_v": lambda: plots.loop(s, "v"),
        "cycles": lambda: plots.cycles(s),
        "decay_frequency": lambda: plots.decay(s, "frequency", "frequency / Hz"),
        "decay_damping": lambda: plots.decay(s, "damping", "damping ratio / %"),
        "autocorrelation": lambda: plots.correlation(s, "autocorrelation", "autocorrelation / 1"),
        "with_force": lambda: plots.correlation(s, "with_force", "correlation / 1"),
        "histogram": lambda: plots.histogram(s),
    }  # fmt: skip
    return {name: draw[name]() for name in names}
