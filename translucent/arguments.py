"""Types of the arguments of public functions and classes, checked against their annotations.

What range a number has to be in is for each function to check. That it is a number, or an array an array of numbers, is
checked here for all of them.
"""

from __future__ import annotations

import ast
import os
import reprlib
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import wraps
from inspect import signature
from pathlib import Path
from types import UnionType
from typing import Any, Literal, NamedTuple, TypeVar, Union, get_args, get_origin
from warnings import catch_warnings, simplefilter

import numpy as np
import numpy.typing as npt

from translucent.errors import InputError, TranslucentError
from translucent.units import metres_in

T = TypeVar("T")


class _Test(NamedTuple):
    """Test of a type: what is wrong with a value, what the user should give, and how to convert other values.

    A class converts objects of other libraries by its method `_adopted`, which returns None for what it does not know.
    """

    wrong: Callable[[Any], str]
    give: str
    adopted: Callable[[Any], Any] | None = None


def checked(thing: T) -> T:
    """Make a function, or the constructor of a class, refuse arguments of a wrong type by an `InputError`.

    A parameter whose annotation names what only type checkers import is let through.
    """
    if isinstance(thing, type):
        thing.__init__ = _checked(thing.__init__, thing.__name__, thing.__module__)  # type: ignore[misc]
        return thing
    return _checked(thing, thing.__name__, thing.__module__)  # type: ignore[attr-defined, no-any-return]


def checked_but(*names: str) -> Callable[[T], T]:
    """`checked` for all arguments except these names, which the function checks itself."""
    return lambda thing: _checked(thing, thing.__name__, thing.__module__, names)  # type: ignore[attr-defined]


def _checked(function: Any, title: str, module: str, but: tuple[str, ...] = ()) -> Any:
    annotations = {one.name: one.annotation for one in signature(function).parameters.values() if one.name not in but}
    names, tests = tuple(signature(function).parameters), dict[str, _Test | None]()

    def test_of(name: str) -> _Test | None:
        if name not in tests:
            tests[name] = _test_of(annotations.get(name), vars(sys.modules[module]))
        return tests[name]

    def refusal(args: tuple[Any, ...], kwargs: dict[str, Any]) -> InputError | None:
        for name, value in (*zip(names, args, strict=False), *kwargs.items()):
            test = test_of(name)
            if test is not None and (found := test.wrong(value)):
                do = f"give {test.give}"
                if (
                    isinstance(value, str)
                    and test.give.startswith("a number")
                    and (metres := metres_in(value)) is not None
                ):
                    do = f"give metres: {metres:g}"
                return InputError(f"{title} {name} {brief(value)}", found, do)
        return None

    def converted(name: str, value: Any) -> Any:
        test = test_of(name)
        if test is None or test.adopted is None or not test.wrong(value):
            return value
        made = test.adopted(value)
        return value if made is None else made

    @wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        refused = refusal(args, kwargs)
        if refused is not None:
            known = zip(names, args, strict=False)
            args = (*(converted(name, value) for name, value in known), *args[len(names) :])
            kwargs = {name: converted(name, value) for name, value in kwargs.items()}
            refused = refusal(args, kwargs)
        if refused is None:
            return function(*args, **kwargs)
        if function.__name__ == "__init__" or names[0] == "cls":
            # A value is made in no time and without a trace, and what its own checks say is more.
            try:
                with catch_warnings():
                    simplefilter("ignore")
                    function(*args, **kwargs)
            except TranslucentError:
                raise
            except Exception as error:
                raise refused from error
        raise refused

    return call


def brief(value: object) -> str:
    """Short text of any value."""
    try:
        return repr(value) if isinstance(value, type) else reprlib.repr(value)
    except Exception:  # noqa: BLE001 - a class of others, or a whole number of thousands of digits
        return f"of type {type(value).__name__}"


def require_path(what: str, value: object, give: str) -> None:
    """Raise `InputError` for a value that names no file."""
    if found := _path(value):
        raise InputError(f"{what} {brief(value)}", found, f"give {give}")


def vectors(what: str, value: npt.ArrayLike, width: int = 3, give: str = "points") -> npt.NDArray[np.float64]:
    """(..., width) float64; raises `InputError` where an array of numbers has another shape, or is not finite."""
    found = np.asarray(value, dtype=np.float64)
    if found.ndim == 0 or found.shape[-1] != width:
        raise InputError(
            f"{what} of shape {found.shape}",
            f"the last axis must have {width} numbers: (..., {width})",
            f"give {give} of {width} numbers each",
        )
    if not np.isfinite(found).all():
        raise InputError(what, "not finite", f"give {give} of finite numbers")
    return found


def _test_of(annotation: object, names: Mapping[str, Any]) -> _Test | None:
    """Test of an annotation, as it is written; None if there is none, or a name in it is not known."""
    if not isinstance(annotation, str):
        return None
    members, kinds = [ast.parse(annotation, mode="eval").body], list[Any]()
    while members:  # one by one, since `array_like` holds texts: Python drops them beside it
        member = members.pop(0)
        if isinstance(member, ast.BinOp):
            members[:0] = [member.left, member.right]
            continue
        if isinstance(member, ast.Name) and member.id == "ColorLike":
            kinds += [str, npt.ArrayLike]
            continue
        try:
            kinds.append(eval(ast.unparse(member), dict(names)))
        except NameError:
            return None
    return _any_of(kinds)


def _any_of(kinds: Sequence[Any]) -> _Test | None:
    tests = [_test(kind) for kind in kinds if kind is not str or Path not in kinds]
    known = [test for test in tests if test is not None]
    if len(known) < len(tests):
        return None

    def wrong(value: Any) -> str:
        reasons = [test.wrong(value) for test in known]
        return "" if "" in reasons else reasons[0]

    adopted = next((test.adopted for test in known if test.adopted), None)
    return _Test(wrong, " or ".join(dict.fromkeys(test.give for test in known)), adopted)


def _test(kind: Any) -> _Test | None:
    """Test of one type, generic or not; None where every value is let through."""
    origin, inner = get_origin(kind), get_args(kind)
    if simple := _SIMPLE.get(kind) or (origin is not None and _SIMPLE.get(origin)):
        return simple
    if origin is Literal:
        return _Test(
            lambda value: _text(value) or ("" if value in inner else "not known"), f"one of {', '.join(inner)}"
        )
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return _instance(origin, "a mapping")
    if isinstance(origin, type) and issubclass(origin, Iterable):
        return _sequence(inner, many=origin is not tuple or inner[-1] is ...)
    if origin in (Union, UnionType):
        return _any_of(inner)
    if isinstance(kind, TypeVar):
        return None if kind.__bound__ is None else _test(kind.__bound__)
    if isinstance(kind, type) and kind is not Any and not getattr(kind, "_is_protocol", False):
        own = kind.__module__.startswith("translucent.")
        return _instance(kind, f"a tl.{kind.__name__}" if own else f"a {kind.__name__}")
    return None


def _instance(kind: type, give: str) -> _Test:
    return _Test(lambda value: "" if isinstance(value, kind) else _type(value), give, getattr(kind, "_adopted", None))


def _sequence(kinds: tuple[Any, ...], many: bool) -> _Test:
    """Test of many values of one type, or of one value of each type."""
    tests = [_any_of([kind]) for kind in (kinds[:1] if many else kinds)]
    gives = [test.give if test else "a value" for test in tests]

    def wrong(value: Any) -> str:
        if isinstance(value, (str, bytes, Mapping)) or not isinstance(value, Iterable):
            return _type(value)
        if isinstance(value, np.ndarray) and not value.ndim:
            return "it is an array of one number"
        if not isinstance(value, (list, tuple, np.ndarray)):
            return "" if many else _type(value)
        if not many and len(value) != len(tests):
            return f"it has {len(value)} values, not {len(tests)}"
        for test, item in zip(tests * len(value) if many else tests, value, strict=False):
            if test is not None and (found := test.wrong(item)):
                return f"in the element {brief(item)}: {found}"
        return ""

    return _Test(wrong, f"a sequence, each {gives[0]}" if many else f"({', '.join(gives)})")


def _type(value: object) -> str:
    return "it is None" if value is None else f"it is of type {type(value).__name__}"


def _number(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return "" if value.ndim == 0 and value.dtype.kind in "biuf" else _type(value)
    if not isinstance(value, (int, float, np.integer, np.floating, np.bool_)):
        return _type(value)
    try:
        float(value)
    except OverflowError:
        return "it is too large for float64"
    return ""


def _whole(value: Any) -> str:
    if found := _number(value):
        # Whole numbers have no range here: of too large ones it is for the function to say.
        return "" if isinstance(value, int) else found
    return "" if float(value).is_integer() else "it is not a whole number"


def _numbers(value: Any) -> str:
    """What is wrong with an array of real numbers."""
    try:
        array = np.asarray(value)
        if array.dtype.kind == "O" and all(isinstance(one, (int, float)) for one in array.ravel().tolist()):
            array = array.astype(np.float64)  # whole numbers beyond 64 bits
    except OverflowError:
        return "it contains a number that is too large for float64"
    except Exception:  # noqa: BLE001 - of NumPy, about lists of unequal lengths, and of classes of others
        return "it cannot be converted to an array"
    return "" if array.dtype.kind in "biuf" else {"c": "it is complex"}.get(array.dtype.kind, "it has no numbers")


def _text(value: Any) -> str:
    return "" if isinstance(value, str) else _type(value)


def _path(value: Any) -> str:
    if not isinstance(value, (str, os.PathLike)) or not isinstance(name := os.fspath(value), str):
        return _type(value)
    try:
        os.fsencode(name)
    except UnicodeEncodeError:
        return "this text cannot be a file name"
    return "a file name cannot contain a null character" if "\0" in name else ""


_SIMPLE: dict[Any, _Test] = {
    None: _Test(lambda value: "" if value is None else _type(value), "None"),
    bool: _Test(lambda value: "" if isinstance(value, (bool, np.bool_)) else _type(value), "True or False"),
    float: _Test(_number, "a number"),
    int: _Test(_whole, "a whole number"),
    str: _Test(_text, "a text"),
    Path: _Test(_path, "a path"),
    os.PathLike: _Test(_path, "a path"),
    npt.ArrayLike: _Test(_numbers, "an array of numbers"),
    np.ndarray: _Test(_numbers, "an array of numbers"),
    Callable: _Test(lambda value: "" if callable(value) else _type(value), "a function"),
}
