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
        pose.guarded(self.rest.name, lambda: self._bind(stages))

    def _bind(self, stages):
        handles = pose.native_handles(self.rest, self._input.motions)
        self.mesh = prepared.mesh(self.rest, stages, share=0.8)
        self._editor = prepared.editor(self.rest, self.mesh, handles, pose.MODEL, stages, share=0.2)
        self._start(self._input)

    def _start(self, pose_input):
        self._session = live_solver.session(self._editor, pose_input.options)
        self._weigh(pose_input)

    def _weigh(self, pose_input):
        self._input = pose_input
        self._weights = pose.blend_weights(self.mesh, pose_input.motions, pose_input.blend)
        self._aim()

    def _aim(self):
        self._session.aim(pose.native_handles(self.rest, self._input.motions))

    def set(self, options, blend, motions):
        """Go on with other options, another blend, or handles held that were moved."""
        new = replace(self._input, options=options, blend=blend, motions=motions)
        start = self._weigh if options == self._input.options else self._start
        pose.guarded(self.rest.name, lambda: start(new))

    def aim(self, motions):
        """Give the same handles, in the same order, new motions."""
        self._input = replace(self._input, motions=motions)
        pose.guarded(self.rest.name, self._aim)

    def advance(self, milliseconds):
        """Work for about this long and return the pose so far, local positions (n, 3) float64."""
        vertices = pose.guarded(self.rest.name, lambda: self._session.advance(milliseconds))
        return pose.to_local(self.rest, vertices, self._input.blend.strength, self._weights)

    @property
    def settled(self):
        """Whether going on would change nothing that can be seen."""
        return self._session.settled
