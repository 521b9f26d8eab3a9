# SPDX-License-Identifier: GPL-3.0-or-later
"""One contender at one size, in a process of its own, at the command of `runner.py`.

    python -m supple_training.compare.worker '{"task": ..., "contender": ..., "size": ..., ...}'

Sets up, says {"ready": ...}, then reads one command a line and answers with one line of JSON:

    warm        the first call: {"seconds", "peak_bytes"}
    run COUNT   COUNT calls: {"seconds"} a call
    facts       {"facts"} of the last call's result
    quit
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import json
import os
import resource
import sys
import time


def _status(name: str) -> int | None:
    """A line of /proc/self/status in bytes; None where there is none."""
    with contextlib.suppress(OSError), open("/proc/self/status") as file:
        for line in file:
            if line.startswith(name + ":"):
                return int(line.split()[1]) * 1024
    return None


class PeakMemory:
    """How much resident memory grew at most since this was made, in bytes."""

    def __init__(self) -> None:
        gc.collect()
        with contextlib.suppress(OSError, AttributeError):
            ctypes.CDLL(None).malloc_trim(0)  # what the set-up freed must not be lent out again
        try:
            with open("/proc/self/clear_refs", "w") as file:
                file.write("5")  # the high-water mark starts anew
            self._resident = _status("VmRSS")
        except OSError:
            self._resident = None
        self._mark = self._high()

    def _high(self) -> int:
        high = _status("VmHWM") if self._resident is not None else None
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 if high is None else high

    def grown(self) -> int:
        """0 where the system has no mark that starts anew and the set-up needed more."""
        start = self._mark if self._resident is None else self._resident
        return max(0, self._high() - start)


def serve(request: dict, commands, answer) -> None:
    """Set the contender up, then do what `commands` (an iterable of lines) asks."""
    from supple_training.compare import shapes, tasks
    from supple_training.compare.contender import NotAvailable

    threads = request["threads"]
    with contextlib.suppress(ImportError, AttributeError):
        import supple

        supple.set_thread_count(threads)  # older ones take OMP_NUM_THREADS alone
    file = request.get("file")
    case = shapes.load(file) if file else shapes.bumpy_torus(request["size"])
    try:
        ready = tasks.find(request["task"], request["contender"]).setup(case, threads)
    except NotAvailable as error:
        answer(status="not available in this build", message=str(error))
        return
    except ImportError as error:
        answer(status="not installed", message=str(error))
        return
    answer(ready=True, vertices=len(case.vertices), faces=len(case.faces))

    result = None
    for line in commands:
        command, *rest = line.split()
        if command == "warm":
            peak = PeakMemory()
            ready.before()
            start = time.perf_counter()
            result = ready.call()
            seconds = time.perf_counter() - start
            answer(seconds=seconds, peak_bytes=peak.grown())
        elif command == "run":
            result = None  # what the last call made is not part of this one
            total = 0.0
            for _ in range(int(rest[0])):
                ready.before()
                start = time.perf_counter()
                result = ready.call()
                total += time.perf_counter() - start
            answer(seconds=total / int(rest[0]))
        elif command == "facts":
            answer(facts=ready.facts(result))
        else:
            break
    ready.close()


def main() -> None:
    """The process: answers go to what was standard output, all other output to standard error."""
    replies = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)

    def answer(**values: object) -> None:
        replies.write(json.dumps(values) + "\n")
        replies.flush()

    serve(json.loads(sys.argv[1]), sys.stdin, answer)


if __name__ == "__main__":
    main()
