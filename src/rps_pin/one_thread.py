"""One thread at a time: objects with scratch memory refuse a second thread while a call runs.

Their calls write to the same memory, so two at a time would give wrong numbers in silence.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from operator import attrgetter
from threading import RLock, get_ident
from typing import Any, NoReturn, TypeVar

from rps_pin.errors import ThreadError

_Class = TypeVar("_Class", bound=type[Any])
_Method = TypeVar("_Method", bound=Callable[..., Any])

#: What a call holds while it runs; a thread that holds it may call further.
Guard = RLock


class TickGuard:
    """A guard that a tick takes in 10 ns, where a lock takes 80; see `Guard`.

    A tick sets `busy` where it finds it unset, and unsets it at its end. CPython changes threads at
    calls and at jumps back only: not between the two. An interruption leaves no guard behind.
    """

    __slots__ = ("_depth", "_owner", "busy")

    def __init__(self) -> None:
        self.busy, self._owner, self._depth = False, 0, 0

    def __reduce__(self) -> tuple[Any, ...]:
        """Give copies a guard that nobody holds."""
        return type(self), ()

    def acquire(self, blocking: bool = False) -> bool:
        """Take it, and return whether that was possible: to the thread that has it, always."""
        thread = get_ident()
        if self._owner != thread:
            if self.busy:
                return False
            self.busy = True
            self._owner = thread
        self._depth += 1
        return True

    def release(self) -> None:
        """Give it back."""
        self._depth -= 1
        if not self._depth:
            self._owner = 0
            self.busy = False


def refuse_second_thread(owner: object) -> NoReturn:
    """Raise `ThreadError`."""
    raise ThreadError(
        f"another thread is in a call of this {type(owner).__name__}, or of an object that shares "
        "its scratch memory: one object serves one thread at a time; give each thread its own, by "
        "copy.deepcopy()"
    )


def guarded(guard: str) -> Callable[[_Method], _Method]:
    """Return a decorator of a method: it holds a guard while it runs.

    Parameters
    ----------
    guard
        The attribute that is the guard, such as ``"system.guard"``.
    """
    guard_of = attrgetter(guard)

    def decorate(method: Any) -> Any:
        @wraps(method)
        def call(self: Any, *args: Any, **options: Any) -> Any:
            held = guard_of(self)
            if not held.acquire(False):
                refuse_second_thread(self)
            try:
                return method(self, *args, **options)
            finally:
                held.release()

        return call

    return decorate


def one_thread(
    guard: str, *, besides: tuple[str, ...] = (), properties: tuple[str, ...] = ()
) -> Callable[[_Class], _Class]:
    """Return a decorator of a class: its public methods hold a guard while they run.

    Parameters
    ----------
    guard
        As for `guarded`.
    besides
        Methods that hold it themselves, or have no use for it.
    properties
        Properties that hold it too.
    """
    holding = guarded(guard)

    def decorate(cls: _Class) -> _Class:
        for name, member in list(vars(cls).items()):
            if name in properties:
                setattr(cls, name, property(holding(member.fget), doc=member.__doc__))
            elif callable(member) and not name.startswith("_") and name not in besides:
                setattr(cls, name, holding(member))
        return cls

    return decorate
