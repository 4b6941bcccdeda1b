"""How much may run at once."""

import os


def cores() -> int:
    """Cores that this process may use, which a batch system or a container may hold below those of the machine."""
    if hasattr(os, "sched_getaffinity"):  # Linux alone tells
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
