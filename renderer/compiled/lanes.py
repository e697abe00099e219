"""Vectors of lanes in compiled loops: each lane computes for a ray of its own, all by the same instructions.

Loops use lanes like numbers: `a + b`, `a < b`, `a & b`, `-a`, `~a`, `abs(a)`, `max(a, b)`, `np.sqrt(a)` and
`fma(a, b, c)` apply to each lane. A number beside lanes is used in all of them. `where(mask, a, b)` replaces `if`.

The result in a lane depends neither on the number of lanes nor on what is in the others: every operation is one of
IEEE 754, and `fma` rounds once. Pictures are the same bytes on every machine, however wide its registers are.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np

from renderer.compiled.numba_inside import (
    binding,
    cgutils,
    cpu_target,
    extending,
    imputils,
    ir,
    make_array,
    templates,
    typeconv,
    types,
)

_I1, _I32, _I64 = ir.IntType(1), ir.IntType(32), ir.IntType(64)
_LLVM_TYPES = {
    types.boolean: _I1,
    types.int32: _I32,
    types.float32: ir.FloatType(),
    types.float64: ir.DoubleType(),
}


@cache
def num_lanes() -> int:
    """Return how many lanes of float32 or int32 a register has: 16 with AVX-512, 8 with AVX2, 4 otherwise.

    It has half as many of float64. In compiled loops the number is a constant.
    """
    triple, name, features = cpu_target.target_context.codegen().magic_tuple()
    machine = binding.Target.from_triple(triple).create_target_machine(cpu=name, features=features)
    module, wide = ir.Module(), ir.VectorType(_I32, 16)
    function = ir.Function(module, ir.FunctionType(wide, [wide, wide]), "sum")
    builder = ir.IRBuilder(function.append_basic_block())
    builder.ret(builder.add(*function.args))
    assembly = machine.emit_assembly(binding.parse_assembly(str(module)))
    return 16 if "zmm" in assembly else 8 if "ymm" in assembly else 4


@templates.infer_global(num_lanes)
class _NumLanes(templates.AbstractTemplate):  # type: ignore[misc]  # numba has no types
    def generic(self, _arguments: Any, _: Any) -> Any:
        return templates.signature(types.literal(num_lanes()))


imputils.lower_builtin(num_lanes)(lambda context, *_: context.get_constant(types.int64, num_lanes()))


class Lanes(types.Type):  # type: ignore[misc]  # numba has no types
    """A type of a vector: `dtype` in each of `count` lanes."""

    def __init__(self, dtype: Any, count: int) -> None:
        self.dtype, self.count = dtype, count
        super().__init__(f"Lanes({dtype}, {count})")

    @property
    def llvm(self) -> ir.VectorType:
        return ir.VectorType(_LLVM_TYPES[self.dtype], self.count)

    def can_convert_from(self, _: Any, other: Any) -> Any:
        """Return that a number can be used in all lanes."""
        return typeconv.Conversion.safe if isinstance(other, (types.Number, types.Boolean)) else None

    def unify(self, _: Any, other: Any) -> Any:
        return self if isinstance(other, (types.Number, types.Boolean)) else None


@extending.register_model(Lanes)
class _LanesModel(extending.models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: Lanes) -> None:
        super().__init__(manager, kind, kind.llvm)


def _cast_number(context: Any, builder: Any, before: Any, after: Lanes, value: Any) -> Any:
    value = context.cast(builder, value, before, after.dtype)
    return _in_all(builder, after, builder.trunc(value, _I1) if after.dtype == types.boolean else value)


for _number in (types.Number, types.Boolean):
    imputils.lower_cast(_number, Lanes)(_cast_number)


def _in_all(builder: Any, kind: Lanes, value: Any) -> Any:
    first = builder.insert_element(ir.Constant(kind.llvm, ir.Undefined), value, _I32(0))
    return _shuffle(builder, first, first, [0] * kind.count)


def _shuffle(builder: Any, one: Any, other: Any, lanes: Sequence[int]) -> Any:
    return builder.shuffle_vector(one, other, ir.Constant(ir.VectorType(_I32, len(lanes)), list(lanes)))


def lanes_among(arguments: Sequence[Any]) -> Lanes | None:
    """Return the type of the lanes among some arguments; None if there are none, or of two types."""
    kinds = {argument for argument in arguments if isinstance(argument, Lanes)}
    return kinds.pop() if len(kinds) == 1 else None


# Operators


def _define_operator(function: Any, names: dict[str, str], *, is_comparison: bool = False) -> None:
    """Define an operator on lanes. names: of a builder's method, LLVM's function or a comparison, by kind of lanes."""

    class _Template(templates.AbstractTemplate):  # type: ignore[misc]
        def generic(self, arguments: Any, _: Any) -> Any:
            kind = lanes_among(arguments)
            if kind is None or _kind_name(kind) not in names:
                return None
            result = Lanes(types.boolean, kind.count) if is_comparison else kind
            return templates.signature(result, *[kind] * len(arguments))

    templates.infer_global(function)(_Template)

    def lower(_: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        name = names[_kind_name(signature.args[0])]
        if name.startswith("llvm."):
            return _call_llvm(builder, name, signature.args[0], arguments)
        if not is_comparison:
            return getattr(builder, name)(*arguments)
        compare = builder.fcmp_ordered if _kind_name(signature.args[0]) == "float" else builder.icmp_signed
        return compare(name, *arguments)

    imputils.lower_builtin(function, Lanes)(lower)
    imputils.lower_builtin(function, Lanes, Lanes)(lower)


def _kind_name(kind: Lanes) -> str:
    return "mask" if kind.dtype == types.boolean else "float" if isinstance(kind.dtype, types.Float) else "int"


for _functions, _names in (
    ((operator.add, operator.iadd), {"float": "fadd", "int": "add"}),
    ((operator.sub,), {"float": "fsub", "int": "sub"}),
    ((operator.mul, operator.imul), {"float": "fmul", "int": "mul"}),
    ((operator.truediv,), {"float": "fdiv"}),
    ((operator.and_, operator.iand), {"int": "and_", "mask": "and_"}),
    ((operator.lshift,), {"int": "shl"}),
    ((operator.rshift,), {"int": "ashr"}),
    ((operator.neg,), {"float": "fneg", "int": "neg"}),
    ((operator.invert,), {"mask": "not_"}),
    ((abs,), {"float": "llvm.fabs"}),
    ((np.sqrt,), {"float": "llvm.sqrt"}),
):
    for _function in _functions:
        _define_operator(_function, _names)
for _function, _sign in (
    (operator.lt, "<"), (operator.le, "<="), (operator.gt, ">"), (operator.ge, ">="), (operator.eq, "=="),
):  # fmt: skip
    _define_operator(_function, {"float": _sign, "int": _sign}, is_comparison=True)


def intrinsic(define: Callable[..., Any]) -> Any:
    """Declare a function for compiled loops; integer constants among its arguments have types of their own."""
    return extending.intrinsic(prefer_literal=True)(define)


def _call_llvm(builder: Any, name: str, kind: Lanes, arguments: Sequence[Any]) -> Any:
    """Call the function of LLVM with this name for this type of lanes."""
    full_name = f"{name}.v{kind.count}f{kind.dtype.bitwidth}"
    function_type = ir.FunctionType(kind.llvm, [kind.llvm] * len(arguments))
    return builder.call(cgutils.get_or_insert_function(builder.module, function_type, full_name), arguments)


_overload: Callable[..., Callable[[Any], Any]] = extending.overload


@_overload(max, strict=False)
def _max(a: Any, b: Any) -> Any:
    """Return what Python's max does: `a` where the two are equal, or one of them is NaN."""
    return None if lanes_among((a, b)) is None else lambda a, b: where(b > a, b, a)


@_overload(min, strict=False)
def _min(a: Any, b: Any) -> Any:
    return None if lanes_among((a, b)) is None else lambda a, b: where(b < a, b, a)


def multiply_add(builder: Any, kind: Any, arguments: Sequence[Any]) -> Any:
    """Generate x * y + z, rounded once, of numbers or lanes."""
    return _call_llvm(builder, "llvm.fma", kind, arguments) if isinstance(kind, Lanes) else builder.fma(*arguments)


# Functions for compiled loops only. Their docstrings say what they do in each lane.


@intrinsic
def where(_: Any, mask: Any, a: Any, b: Any) -> Any:
    """Return a where mask, else b."""
    kind = lanes_among((a, b)) or (Lanes(a, mask.count) if a == b else None)
    if kind is None:
        return None
    return kind(mask, kind, kind), lambda _context, builder, _signature, arguments: builder.select(*arguments)


@intrinsic
def any_of(_: Any, mask: Any) -> Any:
    """Return whether a mask is true in any lane."""

    def generate(_context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        number = ir.IntType(signature.args[0].count)
        return builder.icmp_unsigned("!=", builder.bitcast(arguments[0], number), number(0))

    return types.boolean(mask), generate


def _conversion(dtype: Any, instruction: Callable[[Any], str]) -> Any:
    """Return an intrinsic that converts lanes. instruction: gives the name of LLVM's, for the type before."""

    def define(_: Any, x: Any) -> Any:
        after = Lanes(dtype, x.count)
        return after(x), lambda _context, builder, _signature, arguments: getattr(builder, instruction(x.dtype))(
            arguments[0], after.llvm
        )

    return intrinsic(define)


to_int32 = _conversion(types.int32, lambda _: "fptosi")  # towards 0
to_float32 = _conversion(types.float32, lambda before: "fptrunc" if before == types.float64 else "sitofp")
to_float64 = _conversion(types.float64, lambda before: "fpext" if before == types.float32 else "sitofp")
bits_to_float32 = _conversion(types.float32, lambda _: "bitcast")  # of int32 lanes
float32_to_bits = _conversion(types.int32, lambda _: "bitcast")


@intrinsic
def broadcast(_: Any, number: Any, count: Any) -> Any:
    """Return a number."""
    kind = Lanes(types.unliteral(number), count.literal_value)
    return kind(kind.dtype, count), lambda _context, builder, _signature, arguments: _in_all(
        builder, kind, arguments[0]
    )


@intrinsic
def lane_numbers(_: Any, count: Any) -> Any:
    """Return 0, 1, 2, ... as int32."""
    kind = Lanes(types.int32, count.literal_value)
    return kind(count), lambda *_: ir.Constant(kind.llvm, list(range(kind.count)))


# Memory. Arrays must be contiguous. A place is the number of an element, and nothing checks it.


@intrinsic
def load(_: Any, array: Any, at: Any, count: Any) -> Any:
    """Return `array[at : at + count]`."""
    kind = Lanes(array.dtype, count.literal_value)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _load(builder, _data(context, builder, signature, arguments), arguments[1], kind.llvm)

    return kind(array, types.int64, count), generate


@intrinsic
def store(_: Any, array: Any, at: Any, lanes: Any) -> Any:
    """Set `array[at : at + count]`."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        _store(builder, _data(context, builder, signature, arguments), arguments[1], arguments[2])
        return context.get_dummy_value()

    return types.void(array, types.int64, lanes), generate


def _data(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """Return the address of the array that is the first argument."""
    return make_array(signature.args[0])(context, builder, arguments[0]).data


def _load(builder: Any, base: Any, place: Any, kind: Any) -> Any:
    value = builder.load(builder.bitcast(builder.gep(base, [place]), kind.as_pointer()))
    value.align = 1
    return value


def _store(builder: Any, base: Any, place: Any, value: Any) -> None:
    builder.store(value, builder.bitcast(builder.gep(base, [place]), value.type.as_pointer())).align = 1


def _elements(builder: Any, lanes: Any) -> list[Any]:
    """Return what is in lanes, one by one."""
    return [builder.extract_element(lanes, _I32(k)) for k in range(lanes.type.count)]


def _places(builder: Any, at: Any) -> list[Any]:
    """Return the numbers in lanes of int32, one by one, as they are needed for addresses."""
    return [builder.zext(element, _I64) for element in _elements(builder, at)]


def _join(builder: Any, vectors: Sequence[Any]) -> Any:
    """Join vectors, whose number is a power of two, to one."""
    while len(vectors) > 1:
        pairs = list(zip(vectors[::2], vectors[1::2], strict=True))
        vectors = [_shuffle(builder, *pair, range(2 * pair[0].type.count)) for pair in pairs]
    return vectors[0]


def _transpose(builder: Any, four: Sequence[Any]) -> list[Any]:
    """Transpose four vectors: of each four of their lanes, which hold 4 x 4 elements."""
    count = four[0].type.count

    def interleave(one: Any, other: Any, offsets: Sequence[int]) -> Any:
        return _shuffle(builder, one, other, [first + at for first in range(0, count, 4) for at in offsets])

    low_singles, high_singles = (0, count, 1, count + 1), (2, count + 2, 3, count + 3)
    low_pairs, high_pairs = (0, 1, count, count + 1), (2, 3, count + 2, count + 3)
    low = [interleave(four[k], four[k + 1], low_singles) for k in (0, 2)]
    high = [interleave(four[k], four[k + 1], high_singles) for k in (0, 2)]
    return [interleave(one, other, offsets) for one, other in (low, high) for offsets in (low_pairs, high_pairs)]


def _columns(builder: Any, rows: Sequence[Any]) -> list[Any]:
    """Return four vectors of all first, second, third and fourth elements of rows, which have four elements each."""
    return _transpose(builder, [_join(builder, rows[k::4]) for k in range(4)])


def _rows(builder: Any, columns: Sequence[Any]) -> list[Any]:
    """Return a row for each lane, of its elements in all vectors, whose number is a multiple of four."""
    count = columns[0].type.count
    fours = [_transpose(builder, columns[k : k + 4]) for k in range(0, len(columns), 4)]
    return [
        _join(builder, [_shuffle(builder, four[k % 4], four[k % 4], range(k - k % 4, k - k % 4 + 4)) for four in fours])
        for k in range(count)
    ]


@intrinsic
def gather(_: Any, array: Any, at: Any) -> Any:
    """Return `array[at]`."""
    kind = Lanes(array.dtype, at.count)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        base, lanes = _data(context, builder, signature, arguments), ir.Constant(kind.llvm, ir.Undefined)
        for k, place in enumerate(_places(builder, arguments[1])):
            lanes = builder.insert_element(lanes, builder.load(builder.gep(base, [place])), _I32(k))
        return lanes

    return kind(array, at), generate


# Permute all lanes of a register; LLVM does not find these instructions itself.
_PERMUTE_INSTRUCTIONS = {16: "llvm.x86.avx512.permvar.sf.512", 8: "llvm.x86.avx2.permps"}


@intrinsic
def permute(_: Any, table: Any, at: Any) -> Any:
    """Return `table[at]`, where both are float32 lanes and int32 lanes."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        name = _PERMUTE_INSTRUCTIONS.get(table.count)
        if name is not None and table.count <= num_lanes():
            function_type = ir.FunctionType(table.llvm, [table.llvm, at.llvm])
            return builder.call(cgutils.get_or_insert_function(builder.module, function_type, name), arguments)
        lanes = ir.Constant(table.llvm, ir.Undefined)
        for k in range(table.count):
            element = builder.extract_element(arguments[0], builder.extract_element(arguments[1], _I32(k)))
            lanes = builder.insert_element(lanes, element, _I32(k))
        return lanes

    return table(table, at), generate


@intrinsic
def load_rows(_: Any, array: Any, at: Any, num: Any) -> Any:
    """Return a tuple of `array[at]` and what follows, `num` elements in all, a multiple of four."""
    kind = Lanes(array.dtype, at.count)
    row = ir.VectorType(_LLVM_TYPES[array.dtype], 4)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        base, places = _data(context, builder, signature, arguments), _places(builder, arguments[1])
        columns = []
        for first in range(0, num.literal_value, 4):
            rows = [_load(builder, base, builder.add(place, _I64(first)), row) for place in places]
            columns += _columns(builder, rows)
        return context.make_tuple(builder, signature.return_type, columns)

    return types.UniTuple(kind, num.literal_value)(array, at, num), generate


@intrinsic
def load_corners(_: Any, array: Any, at: Any, along_y: Any, along_z: Any) -> Any:
    """Return a tuple of eight elements: `array[at]` and its neighbours, x before y before z.

    along_y, along_z: the distances of neighbours along these axes; along x it is 1.
    """
    kind = Lanes(array.dtype, at.count)
    pair = ir.VectorType(_LLVM_TYPES[array.dtype], 2)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        base, places = _data(context, builder, signature, arguments), _places(builder, arguments[1])
        corners = []
        for plane in (_I64(0), arguments[3]):
            second = builder.add(plane, arguments[2])
            rows = [
                _join(builder, [_load(builder, base, builder.add(place, offset), pair) for offset in (plane, second)])
                for place in places
            ]
            corners += _columns(builder, rows)
        return context.make_tuple(builder, signature.return_type, corners)

    return types.UniTuple(kind, 8)(array, at, types.int64, types.int64), generate


@intrinsic
def append(_: Any, array: Any, num: Any, mask: Any, lanes: Any) -> Any:
    """Append an element for each lane in which a mask is true, and return how many elements there are then.

    num: the elements in the array so far. lanes: a vector, or a tuple of columns, their number a multiple of four: then
    a row of as many elements is appended, and rows are counted. The array needs room for one more than are appended.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        base, place, appended = _data(context, builder, signature, arguments), arguments[1], arguments[3]
        is_row = isinstance(lanes, types.BaseTuple)
        rows = _rows(builder, cgutils.unpack_tuple(builder, appended)) if is_row else _elements(builder, appended)
        for row, is_appended in zip(rows, _places(builder, arguments[2]), strict=True):
            _store(builder, base, builder.mul(place, _I64(len(lanes) if is_row else 1)), row)
            place = builder.add(place, is_appended)
        return place

    return types.int64(array, types.int64, mask, lanes), generate


@intrinsic
def store_rows(_: Any, array: Any, columns: Any) -> Any:
    """Store four columns as the first rows of an array, one row for each lane."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        base = _data(context, builder, signature, arguments)
        for k, row in enumerate(_rows(builder, cgutils.unpack_tuple(builder, arguments[1]))):
            _store(builder, base, _I64(len(columns) * k), row)
        return context.get_dummy_value()

    return types.void(array, columns), generate
