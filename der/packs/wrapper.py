"""What Python calls in a pack: LLVM code that takes arguments apart and hands them to a kernel.

Machine code does not ask what it is given, so each argument is checked first: its class, and of an
array the axes, type, byte order, and that it is contiguous, aligned and writable. What does not
fit, and a kernel that fails for want of memory, is answered by NotImplemented, and left to numba.
Offsets are those of public structures of CPython and NumPy: float, tuple, ndarray and its dtype.
Arrays are borrowed: the caller's arguments keep them alive.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.np import arrayobj

I8, I32, I64, DOUBLE = ir.IntType(8), ir.IntType(32), ir.IntType(64), ir.DoubleType()
OBJECT = I8.as_pointer()
TYPE, VALUE, SIZE, ITEMS = 8, 16, 16, 24  # offsets: of any object; a number; a tuple's
DATA, AXES, SHAPE, DTYPE, FLAGS = 16, 24, 32, 56, 64  # of an array
BYTE_ORDER, NUMBER = 26, 28  # of its dtype
PLAIN = 0x0001 | 0x0100 | 0x0400  # flags: C-contiguous, aligned, writable


def name_of(one: type) -> str:
    """Where a class is found."""
    return f"{one.__module__}:{one.__qualname__}"


class Wrapper:
    """A wrapper that is being written.

    Parameters
    ----------
    table : array of pointers in the module, to the objects that are compared with.
    known : their names; grows.
    """

    def __init__(self, context: Any, table: Any, known: list[str], name: str) -> None:
        self.context, self.table, self.known, self.module = context, table, known, table.parent
        kind = ir.FunctionType(OBJECT, [OBJECT, OBJECT.as_pointer(), I64])
        function = ir.Function(self.module, kind, name)
        self.args, self.count = function.args[1:]
        self.builder = ir.IRBuilder(function.append_basic_block())
        self.refused = function.append_basic_block("refused")

    def write(self, fndesc: Any) -> None:
        """Check, take apart, call, and hand back what is returned."""
        b = self.builder
        self._need(b.icmp_signed("==", self.count, I64(len(fndesc.argtypes))))
        objects = [b.load(b.gep(self.args, [I64(i)])) for i in range(len(fndesc.argtypes))]
        values = [self._value(*one) for one in zip(objects, fndesc.argtypes, strict=True)]
        callee = self.context.declare_function(self.module, fndesc)
        status, result = self.context.call_conv.call_function(
            b, callee, fndesc.restype, fndesc.argtypes, values
        )
        self._need(status.is_ok)
        b.ret(self._object(result, fndesc.restype))
        b.position_at_end(self.refused)
        self._python("PyErr_Clear", ir.VoidType())
        b.ret(self._kept("builtins:NotImplemented"))

    def _need(self, test: Any) -> None:
        """Refuse unless a test holds."""
        on = self.builder.function.append_basic_block()
        self.builder.cbranch(test, on, self.refused)
        self.builder.position_at_end(on)

    def _at(self, one: Any, offset: int, kind: Any) -> Any:
        """A field of an object."""
        place = self.builder.gep(one, [I64(offset)])
        return self.builder.load(self.builder.bitcast(place, kind.as_pointer()))

    def _known(self, name: str) -> Any:
        """An object by its name, from the table."""
        if name not in self.known:
            self.known.append(name)
        index = [I64(0), I64(self.known.index(name))]
        return self.builder.load(self.builder.gep(self.table, index))

    def _is(self, one: Any, *names: str) -> Any:
        """Whether an object is one of some."""
        found = [self.builder.icmp_unsigned("==", one, self._known(name)) for name in names]
        result = found[0]
        for other in found[1:]:
            result = self.builder.or_(result, other)
        return result

    def _python(self, name: str, returns: Any, *args: Any) -> Any:
        """Call a function of CPython."""
        kind = ir.FunctionType(returns, [one.type for one in args])
        return self.builder.call(cgutils.get_or_insert_function(self.module, kind, name), args)

    def _value(self, one: Any, kind: Any) -> Any:
        """A kernel's argument from an object of Python."""
        b, its_type = self.builder, self._at(one, TYPE, OBJECT)
        if kind == types.float64:
            self._need(self._is(its_type, "builtins:float", "numpy:float64"))
            return self._at(one, VALUE, DOUBLE)
        if kind == types.boolean:
            true = self._is(one, "builtins:True", "numpy:True_")
            self._need(b.or_(true, self._is(one, "builtins:False", "numpy:False_")))
            return true
        if kind == types.int64:
            self._need(self._is(its_type, "builtins:int"))
            value = self._python("PyLong_AsLongLong", I64, one)
            error = self._python("PyErr_Occurred", OBJECT)
            self._need(b.icmp_unsigned("==", error, ir.Constant(OBJECT, None)))
            return value
        if isinstance(kind, types.Array):
            return self._array(one, its_type, kind)
        if not isinstance(kind, types.NamedTuple):
            raise NotImplementedError(f"an argument of type {kind}")
        self._need(self._is(its_type, name_of(kind.instance_class)))
        self._need(b.icmp_signed("==", self._at(one, SIZE, I64), I64(len(kind))))
        items = [self._at(one, ITEMS + 8 * i, OBJECT) for i in range(len(kind))]
        values = [self._value(*pair) for pair in zip(items, kind.types, strict=True)]
        return self.context.make_tuple(b, kind, values)

    def _array(self, one: Any, its_type: Any, kind: Any) -> Any:
        """An array, borrowed."""
        if kind.layout != "C" or not (kind.mutable and kind.aligned):
            raise NotImplementedError(f"an argument of type {kind}")
        b, dtype = self.builder, self._at(one, DTYPE, OBJECT)
        native = np.dtype(str(kind.dtype))
        self._need(self._is(its_type, "numpy:ndarray"))
        self._need(b.icmp_signed("==", self._at(one, AXES, I32), I32(kind.ndim)))
        self._need(b.icmp_signed("==", self._at(dtype, NUMBER, I32), I32(native.num)))
        swapped = I8(ord(">" if sys.byteorder == "little" else "<"))
        self._need(b.icmp_signed("!=", self._at(dtype, BYTE_ORDER, I8), swapped))
        flags = b.and_(self._at(one, FLAGS, I32), I32(PLAIN))
        self._need(b.icmp_signed("==", flags, I32(PLAIN)))
        axes = self._at(one, SHAPE, I64.as_pointer())
        shape = [b.load(b.gep(axes, [I64(i)])) for i in range(kind.ndim)]
        strides = [I64(native.itemsize)]
        for length in shape[:0:-1]:
            strides.insert(0, b.mul(strides[0], length))
        array = self.context.make_array(kind)(self.context, b)
        data = self._at(one, DATA, OBJECT)
        arrayobj.populate_array(
            array, b.bitcast(data, array.data.type), shape, strides, I64(native.itemsize), None
        )
        return array._getvalue()

    def _object(self, value: Any, kind: Any) -> Any:
        """An object of Python from what a kernel returns."""
        kind = types.unliteral(kind)
        if kind == types.float64:
            return self._python("PyFloat_FromDouble", OBJECT, value)
        if kind == types.boolean:
            return self._python("PyBool_FromLong", OBJECT, self.builder.zext(value, I64))
        if kind == types.int64:
            return self._python("PyLong_FromLongLong", OBJECT, value)
        if kind == types.none:
            return self._kept("builtins:None")
        if not isinstance(kind, types.Tuple | types.UniTuple):
            raise NotImplementedError(f"a result of type {kind}")
        result = self._python("PyTuple_New", OBJECT, I64(len(kind)))
        for i, one in enumerate(kind):
            item = self._object(self.builder.extract_value(value, i), one)
            self._python("PyTuple_SetItem", I32, result, I64(i), item)
        return result

    def _kept(self, name: str) -> Any:
        """A known object, with a reference more."""
        one = self._known(name)
        self._python("Py_IncRef", ir.VoidType(), one)
        return one
