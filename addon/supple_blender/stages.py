# SPDX-License-Identifier: GPL-3.0-or-later
"""Progress of a computation with several native calls, readable from another thread."""

import time
from dataclasses import dataclass, field

from . import native


@dataclass
class Learning:
    """What is learned during a computation: its thread writes, the window's reads.

    epochs: how many there will be. losses: of those that are done. is_previewed: somebody takes
    `point_map`, the newest of what the panel calls a match, (n,) or None.
    """

    epochs: int = 0
    losses: list = field(default_factory=list)
    is_previewed: bool = False
    point_map: object = None

    def begin(self, epochs):
        self.epochs, self.losses, self.point_map = epochs, [], None

    def take(self):
        """Return the newest point map, or None where it was taken before."""
        found, self.point_map = self.point_map, None
        return found


class Stages:
    """Shares of the whole (they sum to 1), each with the progress of the native call in it."""

    def __init__(self):
        self.label = ""
        self.learning = Learning()
        self._done = 0.0
        self._share = 0.0
        self._progress = None
        self._cancelled = False

    def begin(self, label, share):
        """Start the next stage and return the `supple.Progress` for its native call."""
        self._done += self._share
        progress = native.supple().Progress()
        if self._cancelled:
            progress.cancel()
        self.label, self._share, self._progress = label, share, progress
        return progress

    @property
    def fraction(self):
        """How much of the whole is done, 0..1."""
        inner = self._progress.fraction if self._progress else 0.0
        return min(1.0, self._done + self._share * inner)

    @property
    def seconds_left(self):
        """Seconds to go in this stage, or None while nobody knows."""
        return self._progress.seconds_left if self._progress else None

    @property
    def cancelled(self):
        return self._cancelled

    def cancel(self):
        """End the computation at its next check."""
        self._cancelled = True
        if self._progress:
            self._progress.cancel()

    def doing(self):
        """Return what is done and how far it is, such as 'Preparing 45%'."""
        return f"{self.label} {self.fraction:.0%}".strip()

    def left(self):
        """Return how long this stage will take, such as 'about 12 s left', or ''."""
        seconds = self.seconds_left
        return "" if seconds is None else f"about {seconds:.0f} s left"


class Part:
    """A share of another Stages, for work that is one of several."""

    def __init__(self, stages, share):
        self._stages, self._share = stages, share

    def begin(self, label, share):
        return self._stages.begin(label, share * self._share)

    @property
    def learning(self):
        return self._stages.learning

    @property
    def cancelled(self):
        return self._stages.cancelled


class FrameStages(Stages):
    """Progress of work on one frame after another, after what comes before the first.

    paused: the work waits as long as it is set.
    """

    def __init__(self, total=1, label="Baking"):
        super().__init__()
        self.paused = False
        self._total, self._frames = total, 0
        self._start = self._first = None
        self._label = label

    def watch(self):
        """Return a `supple.Progress` for native work on frames, which `cancel` ends."""
        progress = native.supple().Progress()
        self._progress = progress
        if self._cancelled:
            progress.cancel()
        return progress

    def count(self, frames):
        """Note how many frames are done; those of the first note took no time."""
        now = time.monotonic()
        if self._start is None:
            self._start, self._first = now, frames
        self._frames, self.label = frames, self._label
        self._took = now - self._start

    @property
    def fraction(self):
        return super().fraction if self._start is None else self._frames / self._total

    @property
    def seconds_left(self):
        if self._start is None:
            return super().seconds_left
        timed = self._frames - self._first
        return self._took / timed * (self._total - self._frames) if timed > 0 else None

    def doing(self):
        if self.paused:
            return f"Paused at {self.fraction:.0%}"
        if self._start is None:
            return super().doing()
        return f"{self.label} {self._frames} of {self._total}"
