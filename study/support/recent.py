"""What was made last, kept as far as there is room."""

import math
from collections import OrderedDict
from collections.abc import Callable, Hashable
from threading import RLock
from typing import Any


class Recent:
    """Results by their keys; those asked for longest ago go first where they take more bytes than there is room for.

    The last one stays whatever its size, and before one is made it is made room for: of long arrays no two have to be
    there at once. What takes more than ``largest`` is made anew each time. Threads wait for each other: two fits of one
    record ask for the same.
    """

    def __init__(self, room: int = 1 << 26, most: int = 8, largest: float = math.inf) -> None:
        self.room, self.most, self.largest = room, most, largest  # bytes, results, bytes
        self._kept: OrderedDict[Hashable, tuple[int, Any]] = OrderedDict()
        self._one_at_a_time = RLock()

    def get(self, key: Hashable, size: int, make: Callable[[], Any]) -> Any:
        """The result of a key, of about so many bytes, made if it is not there."""
        if size > self.largest:
            return make()
        with self._one_at_a_time:
            if key not in self._kept:
                while self._kept and (self.size + size > self.room or len(self._kept) == self.most):
                    self._kept.popitem(last=False)
                self._kept[key] = size, make()
            self._kept.move_to_end(key)
            return self._kept[key][1]

    @property
    def size(self) -> int:
        """Bytes that are taken."""
        return sum(size for size, _ in self._kept.values())
