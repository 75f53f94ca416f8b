"""Objects that one thread uses at a time; another one is refused in place of wrong states and images."""

from collections.abc import Callable
from functools import wraps
from threading import RLock
from typing import Any

from lerobot_bimanual.errors import BimanualError


def one_thread_at_a_time[Kind: type](*names: str) -> Callable[[Kind], Kind]:
    """Have the methods of a class with these names refuse a call while another thread is in one of them."""

    def guard(kind: Kind) -> Kind:
        for name in names:
            setattr(kind, name, _guarded(getattr(kind, name)))
        return kind

    return guard


def _guarded(method: Callable[..., Any]) -> Callable[..., Any]:
    @wraps(method)
    def guarded(self: Any, *args: Any, **keywords: Any) -> Any:
        lock = vars(self).setdefault("_in_use", RLock())
        if not lock.acquire(blocking=False):
            raise BimanualError(
                f"{type(self).__name__} is in use by another thread: make one for each thread"
            )
        try:
            return method(self, *args, **keywords)
        finally:
            lock.release()

    return guarded
