"""A program of slopes and sensitivities as machine code, made when a model is first run.

The kernels' loop over instructions looks each one up; straight-line code for the one program at hand takes a sixth of
the time, and making it a few milliseconds: as much as three free runs of 4,096 samples by the loop. Every number is the
same to the last bit: the same operations in the same order, none contracted (LLVM fuses none unless it is asked to).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, cast

import llvmlite.binding as llvm  # pyright: ignore[reportMissingTypeStubs]
import numba  # noqa: F401  # pyright: ignore[reportMissingTypeStubs, reportUnusedImport]  # which prepares LLVM

from study.equations.graph import Op, Program
from study.support.arrays import Ints

CACHED = 256  # pieces of machine code
OFTEN = 50_000  # steps in a run from which on optimised code, a fifth faster, has soon earned the time that it takes
TIME, DRIVE = 2, 3  # registers after those of displacement and velocity
PLAIN = {Op.ADD: "fadd", Op.SUB: "fsub", Op.MUL: "fmul", Op.DIV: "fdiv"}
FUNCTIONS = {
    Op.ABS: "@llvm.fabs.f64", Op.SIN: "@llvm.sin.f64", Op.COS: "@llvm.cos.f64", Op.EXP: "@llvm.exp.f64",
    Op.LOG: "@llvm.log.f64", Op.SQRT: "@llvm.sqrt.f64", Op.TANH: "@tanh",
}  # fmt: skip
COMPARED = {Op.MAX: "ogt", Op.MIN: "olt"}


@dataclass(frozen=True, eq=False)
class Variation:
    """A program of slopes and their partial derivatives, and where its results lie; compared by identity.

    Attributes
    ----------
    program : Program
        Slopes of the states, then their partial derivatives.
    slots : int array, shape (states - 1, 1 + states + keys)
        Registers of each slope (but velocity), of its partial derivatives by the states and by the keys.
    side : int
        Register that stands for sgn v, -1 if no force of the model jumps with it.
    channels : int
        Channels of the drive, the force among them.
    """

    program: Program
    slots: Ints
    side: int
    channels: int

    @property
    def states(self) -> int:
        """Displacement, velocity and the terms' own."""
        return len(self.slots) + 1


@dataclass(frozen=True, eq=False)
class MachineCode:
    """Addresses of two functions, which live as long as this does.

    ``step`` takes one Runge-Kutta step of a state beside its sensitivities, ``slope`` gives their derivatives (see
    ``kernels``, which calls them).
    """

    step: int
    slope: int
    engine: object  # owns the code

    @property
    def addresses(self) -> tuple[int, int]:
        """What the kernels take."""
        return self.step, self.slope


@lru_cache(maxsize=CACHED)
def machine_code(variation: Variation, columns: int, optimised: bool) -> MachineCode:
    """Machine code for a state and ``columns - 1`` sensitivities: those by the keys, then by the initial state."""
    binding, level = cast(Any, llvm), 2 if optimised else 0
    target = binding.Target.from_default_triple().create_target_machine(
        cpu=binding.get_host_cpu_name(), features=binding.get_host_cpu_features().flatten(), opt=level
    )
    module = binding.parse_assembly(assembly(variation, columns))
    module.triple = target.triple
    if optimised:
        passes = binding.create_pass_builder(target, binding.create_pipeline_tuning_options(speed_level=level))
        passes.getModulePassManager().run(module, passes)
    engine = binding.create_mcjit_compiler(module, target)
    engine.finalize_object()
    return MachineCode(engine.get_function_address("step"), engine.get_function_address("slope"), engine)


def assembly(variation: Variation, columns: int) -> str:
    """The two functions in LLVM's language."""
    functions = sorted({*FUNCTIONS.values()})
    return "\n".join(
        [
            *(f"declare double {name}(double)" for name in functions),
            "declare double @llvm.pow.f64(double, double)",
            *_Variations(variation, columns).function(),
            *_Step(variation, columns).function(),
        ]
    )


class _Code:
    """Instructions in single assignment: each result has a name of its own."""

    def __init__(self, variation: Variation, columns: int) -> None:
        self.variation = variation
        self.columns = columns
        self.states = variation.states
        self.row = f"<{columns} x double>"  # a state beside its sensitivities
        self.lines: list[str] = []

    def new(self, instruction: str) -> str:
        name = f"%v{len(self.lines)}"
        self.lines.append(f"  {name} = {instruction}")
        return name

    def at(self, pointer: str, place: int) -> str:
        return self.new(f"getelementptr double, ptr {pointer}, i64 {place}")

    def number(self, pointer: str, place: int) -> str:
        return self.new(f"load double, ptr {self.at(pointer, place)}, align 8")

    def load(self, pointer: str, place: int) -> str:
        return self.new(f"load {self.row}, ptr {self.at(pointer, place)}, align 8")

    def store(self, value: str, pointer: str, place: int) -> None:
        where = self.at(pointer, place)
        self.lines.append(f"  store {self.row} {value}, ptr {where}, align 8")

    def everywhere(self, number: str) -> str:
        first = self.new(f"insertelement {self.row} poison, double {number}, i32 0")
        places = f"<{self.columns} x i32> zeroinitializer"
        return self.new(f"shufflevector {self.row} {first}, {self.row} poison, {places}")

    def times(self, number: str, row: str) -> str:
        return self.new(f"fmul {self.row} {self.everywhere(number)}, {row}")

    def plus(self, one: str, other: str) -> str:
        return self.new(f"fadd {self.row} {one}, {other}")


class _Variations(_Code):
    """``slope(r, w, time, drive)``: derivatives of plane 1 of ``w`` into plane 2.

    The variational equations are ``ds/dt = (df/dx) s + df/dp``; columns of s beyond the p's are those of the initial
    state. Registers that stand for a constant are read like any other: the compiler could else put its own arithmetic
    in place of the library's.
    """

    def function(self) -> list[str]:
        size = self.states * self.columns
        self.motion, self.rate = self.at("%w", size), self.at("%w", 2 * size)
        rows = [self.load(self.motion, i * self.columns) for i in range(self.states)]
        self.results = self._known(rows)
        self._instructions()
        self.store(rows[1], self.rate, 0)
        for i in range(1, self.states):
            self.store(self._slope(i, rows), self.rate, i * self.columns)
        arguments = "ptr noalias readonly %r, ptr noalias %w, double %time, ptr noalias readonly %drive"
        return [f"define void @slope({arguments}) {{", *self.lines, "  ret void", "}"]

    def _known(self, rows: Sequence[str]) -> dict[int, str]:
        """Registers whose value is an argument: displacement, velocity, time, drive, then the terms' own states."""
        values = [self.new(f"extractelement {self.row} {row}, i32 0") for row in rows]
        drive = [self.number("%drive", c) for c in range(self.variation.channels)]
        return dict(enumerate([*values[:TIME], "%time", *drive, *values[TIME:]]))

    def _register(self, register: int) -> str:
        if register not in self.results:
            self.results[register] = self.number("%r", register)
        return self.results[register]

    def _instructions(self) -> None:
        program = self.variation.program
        for i, (op, a, b) in enumerate(program.code.tolist()):
            self.results[program.first + i] = self._operation(Op(op), self._register(a), self._register(b))

    def _operation(self, op: Op, a: str, b: str) -> str:
        if op in PLAIN:
            return self.new(f"{PLAIN[op]} double {a}, {b}")
        if op in FUNCTIONS:
            return self.new(f"call double {FUNCTIONS[op]}(double {a})")
        if op in COMPARED:
            return self._chosen(COMPARED[op], a, b, a, b)
        match op:
            case Op.NEG:
                return self.new(f"fneg double {a}")
            case Op.SGN:
                return self._chosen("ogt", a, "0.0", "1.0", self._chosen("olt", a, "0.0", "-1.0", "0.0"))
            case Op.GT:
                return self._chosen("ogt", a, b, "1.0", "0.0")
            case _:  # POW
                return self.new(f"call double @llvm.pow.f64(double {a}, double {b})")

    def _chosen(self, comparison: str, a: str, b: str, yes: str, no: str) -> str:
        gate = self.new(f"fcmp {comparison} double {a}, {b}")
        return self.new(f"select i1 {gate}, double {yes}, double {no}")

    def _slope(self, i: int, rows: Sequence[str]) -> str:
        """Derivative of state i and of its sensitivities."""
        slots, side = self.variation.slots[i - 1].tolist(), self.variation.side
        total = "zeroinitializer"
        for c, register in enumerate(slots[1 + self.states : self.states + self.columns], start=1):
            if not self._is_zero(register):
                total = self.new(f"insertelement {self.row} {total}, double {self._register(register)}, i32 {c}")
        for register, row in zip(slots[1 : 1 + self.states], rows, strict=True):
            if not self._is_zero(register):
                total = self.plus(total, self.times(self._register(register), row))
        total = self.new(f"insertelement {self.row} {total}, double {self._register(slots[0])}, i32 0")
        if i > 1 or side < 0:
            return total
        held = self.new(f"fcmp oeq double {self.number('%r', side)}, 0.0")  # friction holds the mass
        return self.new(f"select i1 {held}, {self.row} zeroinitializer, {self.row} {total}")

    def _is_zero(self, register: int) -> bool:
        program = self.variation.program
        return len(program.inputs) <= register < program.first and program.registers[register] == 0.0


class _Step(_Code):
    """``step(r, w, time, h, drive)``: one classical Runge-Kutta step of plane 0 of ``w``, planes 1 and 2 for room.

    ``drive`` has three rows, half a step apart.
    """

    def function(self) -> list[str]:
        size, places = self.states * self.columns, [i * self.columns for i in range(self.states)]
        half, third, sixth = (
            self.new(f"{op} double %h, {by}") for op, by in (("fmul", "5.0e-1"), ("fdiv", "3.0"), ("fdiv", "6.0"))
        )
        times = ["%time", self.new(f"fadd double %time, {half}"), self.new("fadd double %time, %h")]
        begin = [self.load("%w", place) for place in places]
        total, trial = ["zeroinitializer"] * self.states, begin
        for stage in range(4):
            late = (stage + 1) // 2
            for value, place in zip(trial, places, strict=True):
                self.store(value, "%w", size + place)
            drive = self.at("%drive", late * self.variation.channels)
            self.lines.append(f"  call void @slope(ptr %r, ptr %w, double {times[late]}, ptr {drive})")
            slopes = [self.load("%w", 2 * size + place) for place in places]
            weight, ahead = third if late == 1 else sixth, "%h" if stage == 2 else half
            total = [self.plus(t, self.times(weight, s)) for t, s in zip(total, slopes, strict=True)]
            trial = [self.plus(x, self.times(ahead, s)) for x, s in zip(begin, slopes, strict=True)]
        for x, t, place in zip(begin, total, places, strict=True):
            self.store(self.plus(x, t), "%w", place)
        arguments = "ptr noalias %r, ptr noalias %w, double %time, double %h, ptr noalias %drive"
        return [f"define void @step({arguments}) {{", *self.lines, "  ret void", "}"]
