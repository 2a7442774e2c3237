"""Objects that own something of the library."""

from __future__ import annotations

from ctypes import c_void_p
from types import TracebackType
from typing import Self


class Closing:
    """Closed at the end of a ``with``, and at the latest when nobody holds it any more."""

    _handle: c_void_p

    def close(self) -> None:
        """Free everything; a second time does nothing."""
        self._free()

    def _free(self) -> None:
        raise NotImplementedError

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()

    def __del__(self) -> None:
        if getattr(self, "_handle", None):
            self._free()
