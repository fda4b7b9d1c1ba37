"""Values that processes send each other, with their large arrays in files that all of them map into memory.

Such a file has no name. It ends with the last process that holds it, however that ends; and where memory is short, the
system writes its pages to disk, which shared memory would keep.
"""

from __future__ import annotations

import io
import mmap
import os
import pickle
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from multiprocessing import reduction
from multiprocessing.connection import Connection
from typing import Any

from translucent.errors import RenderError
from translucent.files.reading import size_text

#: Bytes of an array from which on it lies in a file.
LARGE = 1 << 20

#: Arrays in a file begin at multiples of so many bytes.
_ALIGNMENT = 64

#: Finds the token that stands for a value, or None if the value itself is to be sent.
Token = Callable[[object], int | None]


class File:
    """File without a name, closed with this object."""

    def __init__(self, descriptor: int) -> None:
        self.descriptor = descriptor

    def __del__(self) -> None:
        os.close(self.descriptor)


@dataclass(frozen=True, eq=False)
class Parcel:
    """Pickled value.

    Attributes
    ----------
    text : bytes
    spans : tuple of (begin, end)
        Of its large arrays in the file.
    file : File, optional
        None where there are none.
    """

    text: bytes
    spans: tuple[tuple[int, int], ...] = ()
    file: File | None = None

    @classmethod
    def of(cls, value: object, token: Token | None = None) -> Parcel:
        """Pack a value; others in it are left out for which there is a token.

        Raises
        ------
        RenderError
            If there is no room for its arrays.
        """
        stream, arrays = io.BytesIO(), list[memoryview]()
        _Pickler(stream, arrays, token).dump(value)
        if not arrays:
            return cls(stream.getvalue())
        spans = []
        try:
            with tempfile.TemporaryFile() as file:
                for array in arrays:
                    begin = file.seek(-(-file.tell() // _ALIGNMENT) * _ALIGNMENT)
                    file.write(array)
                    spans.append((begin, begin + array.nbytes))
                file.flush()
                return cls(stream.getvalue(), tuple(spans), File(os.dup(file.fileno())))
        except OSError as error:
            size = size_text(sum(array.nbytes for array in arrays))
            found = f"{tempfile.gettempdir()} has no room for {size} of meshes and pictures ({error.strerror})"
            raise RenderError("work of another process", found, "make room, or set TMPDIR to another folder") from error

    def open(self, known: Callable[[int], object] | None = None) -> Any:
        """Unpack the value, whose large arrays are read-only views of the file; `known` has the values for tokens."""
        views: list[memoryview] = []
        if self.file is not None:
            memory = memoryview(mmap.mmap(self.file.descriptor, 0, access=mmap.ACCESS_READ))
            views = [memory[begin:end] for begin, end in self.spans]
        return _Unpickler(io.BytesIO(self.text), views, known).load()


class _Pickler(pickle.Pickler):
    def __init__(self, stream: io.BytesIO, arrays: list[memoryview], token: Token | None) -> None:
        super().__init__(stream, protocol=5, buffer_callback=partial(_stays, arrays))
        self._token = token

    def persistent_id(self, value: object) -> int | None:
        return None if self._token is None else self._token(value)


def _stays(arrays: list[memoryview], array: pickle.PickleBuffer) -> bool:
    """True if an array stays in the text; if it is large, it is added to `arrays` instead."""
    raw = array.raw()
    if raw.nbytes >= LARGE:
        arrays.append(raw)
    return raw.nbytes < LARGE


class _Unpickler(pickle.Unpickler):
    def __init__(self, stream: io.BytesIO, views: list[memoryview], known: Callable[[int], object] | None) -> None:
        super().__init__(stream, buffers=views)
        self._known = known

    def persistent_load(self, token: Any) -> object:
        assert self._known is not None
        return self._known(token)


class Channel:
    """End of a pipe for parcels, which have a kind and a number.

    Parameters
    ----------
    pipe : Connection
    peer : int
        Number of the process at the other end.
    """

    def __init__(self, pipe: Connection, peer: int) -> None:
        self.pipe, self._peer = pipe, peer

    def send(self, kind: str, number: int, parcel: Parcel) -> None:
        """Send a parcel."""
        self.pipe.send((kind, number, parcel.text, parcel.spans))
        if parcel.file is not None:
            reduction.send_handle(self.pipe, _handle(parcel.file.descriptor), self._peer)

    def receive(self) -> tuple[str, int, Parcel]:
        """Kind, number and parcel that the other end has sent; waits for it."""
        kind, number, text, spans = self.pipe.recv()
        file = File(_descriptor(reduction.recv_handle(self.pipe))) if spans else None
        return kind, number, Parcel(text, spans, file)


if sys.platform == "win32":
    import msvcrt

    def _handle(descriptor: int) -> int:
        return msvcrt.get_osfhandle(descriptor)

    def _descriptor(handle: int) -> int:
        return msvcrt.open_osfhandle(handle, os.O_RDONLY)

else:

    def _handle(descriptor: int) -> int:
        return descriptor

    def _descriptor(handle: int) -> int:
        return handle
