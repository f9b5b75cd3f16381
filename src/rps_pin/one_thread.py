"""One thread at a time: objects with scratch memory refuse a second thread while a call runs.

Their calls write to the same memory, so two at a time would give wrong numbers in silence.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from operator import attrgetter
from threading import RLock
from typing import Any, NoReturn, TypeVar

from rps_pin.errors import ThreadError

_Class = TypeVar("_Class", bound=type[Any])

#: What a call holds while it runs; a thread that holds it may call further.
Guard = RLock


def refuse_second_thread(owner: object) -> NoReturn:
    """Raise `ThreadError`."""
    raise ThreadError(
        f"another thread is in a call of this {type(owner).__name__}, or of an object that shares "
        "its scratch memory: one object serves one thread at a time; give each thread its own, by "
        "copy.deepcopy()"
    )


def one_thread(
    guard: str, *, besides: tuple[str, ...] = (), properties: tuple[str, ...] = ()
) -> Callable[[_Class], _Class]:
    """Return a decorator of a class: its public methods hold a guard while they run.

    Parameters
    ----------
    guard
        The attribute that is the guard, such as ``"system.guard"``.
    besides
        Methods that hold it themselves, or have no use for it.
    properties
        Properties that hold it too.
    """
    guard_of = attrgetter(guard)

    def guarded(method: Callable[..., Any]) -> Callable[..., Any]:
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

    def decorate(cls: _Class) -> _Class:
        for name, member in list(vars(cls).items()):
            if name in properties:
                setattr(cls, name, property(guarded(member.fget), doc=member.__doc__))
            elif callable(member) and not name.startswith("_") and name not in besides:
                setattr(cls, name, guarded(member))
        return cls

    return decorate
