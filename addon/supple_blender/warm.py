# SPDX-License-Identifier: GPL-3.0-or-later
"""A pose solver kept warm: made once for a mesh and its handles, then aimed again and again.

No bpy: making one takes as long as preparing does, and runs on a worker thread.
"""

from dataclasses import replace

from . import live_solver, pose, prepared


class Warm:
    """Made for a `pose.PoseInput`; its rest shape and its handles' vertices stay."""

    def __init__(self, pose_input, stages):
        self.rest = pose_input.rest
        self._input = pose_input
        self._vertices = None
        pose.guarded(self.rest.name, lambda: self._bind(stages))

    def _bind(self, stages):
        handles = pose.native_handles(self.rest, self._input.motions)
        self.mesh = prepared.mesh(self.rest, stages, share=0.8)
        self._editor = prepared.editor(self.rest, self.mesh, handles, pose.MODEL, stages, share=0.2)
        self._start()
        self._weigh()

    def _start(self):
        self._session = live_solver.session(self._editor, self._input.options)
        self._aim()

    def _aim(self):
        self._session.aim(pose.native_handles(self.rest, self._input.motions))
        self._vertices = None

    def _weigh(self):
        self._weights = pose.blend_weights(self.mesh, self._input.motions, self._input.blend)

    def _change(self, then, **fields):
        self._input = replace(self._input, **fields)
        pose.guarded(self.rest.name, then)

    def set_options(self, options):
        """Go on with other `live_solver.Options`."""
        self._change(self._start, options=options)

    def set_blend(self, blend, motions):
        """Take another part of the same pose; motions say which handles are moved."""
        self._change(self._weigh, blend=blend, motions=motions)

    def aim(self, motions):
        """Give the same handles, in the same order, new motions."""
        self._change(self._aim, motions=motions)

    def advance(self, milliseconds):
        """Work for about this long and return the pose so far, local positions (n, 3) float64."""
        if self._vertices is None or not self.settled:
            advance = self._session.advance
            self._vertices = pose.guarded(self.rest.name, lambda: advance(milliseconds))
        return pose.to_local(self.rest, self._vertices, self._input.blend.strength, self._weights)

    @property
    def settled(self):
        """Whether going on would change nothing that can be seen."""
        return self._session.settled
