# SPDX-License-Identifier: GPL-3.0-or-later
"""What was computed once for a mesh and its handles, kept in memory; meshes also on disk.

Entries are found by their content (geometry, handle vertices and weights), so that a changed mesh,
an undo, a renamed object or another file can never meet a stale one.
"""

import hashlib
import threading
from collections import OrderedDict

import numpy as np

from . import native, space

# Each takes more than a kilobyte a vertex; more than a few would hardly be met again.
CAPACITY = 4


class _Cache:
    def __init__(self):
        self._lock = threading.Lock()
        self._entries = OrderedDict()

    def get(self, key):
        with self._lock:
            if key in self._entries:
                self._entries.move_to_end(key)
            return self._entries.get(key)

    def latest(self, fits):
        """Return the value used last whose key `fits`, or None."""
        with self._lock:
            return next((self._entries[key] for key in reversed(self._entries) if fits(key)), None)

    def put(self, key, value):
        with self._lock:
            self._entries[key] = value
            while len(self._entries) > CAPACITY:
                self._entries.popitem(last=False)

    def clear(self):
        with self._lock:
            self._entries.clear()


_meshes = _Cache()
_editors = _Cache()
# As the preferences say; here, because the thread that computes may not ask Blender.
_disk = {"use": True, "mebibytes": None}


def use_disk(use, mebibytes):
    """Keep prepared meshes on disk from now on, or do not; mebibytes: the most they may take."""
    _disk.update(use=use, mebibytes=mebibytes)


def _disk_cache():
    """Return what `supple.PreparedMesh` takes as its cache."""
    supple = native.supple()
    if not _disk["use"]:
        return False
    try:
        return supple.cache.default(_disk["mebibytes"])
    except supple.SuppleError:
        return True  # it finds the same and says so in a note, and the work goes on


def clear():
    """Forget everything that is in memory."""
    _meshes.clear()
    _editors.clear()


def mesh_if_ready(rest):
    """Return the `supple.PreparedMesh` of a RestMesh if it is kept, else None."""
    return _meshes.get(rest.digest)


def mesh(rest, stages, share=1.0):
    """Return the `supple.PreparedMesh` of a RestMesh, computed unless it is kept already."""
    found = _meshes.get(rest.digest)
    if found is None:
        progress = stages.begin("Preparing", share)
        found = native.supple().PreparedMesh(
            space.to_solve_points(rest.stretch, rest.positions),
            rest.triangles,
            progress=progress,
            cache=_disk_cache(),
        )
        _meshes.put(rest.digest, found)
    return found


def handles_key(handles):
    digest = hashlib.blake2b(digest_size=16)
    for handle in handles:
        digest.update(handle.name.encode() + b"\0")
        digest.update(np.int64(len(handle.vertices)).tobytes())
        digest.update(np.float64(handle.weight).tobytes())
        digest.update(np.ascontiguousarray(handle.vertices, dtype=np.int64).tobytes())
    return digest.hexdigest()


def editor(rest, prepared_mesh, handles, model, stages, share, from_scratch=False):
    """Return the `supple.Editor` bound to the handles' vertices, made unless it is kept already.

    model: what `supple.Editor` takes as a model, a name or a path (or None: without the network).
    from_scratch: not from one with other handles; the last bits are then those of any session.
    """
    key = (rest.digest, handles_key(handles), model, from_scratch)
    found = _editors.get(key)
    if found is None:
        progress = stages.begin("Binding handles", share)
        other = _editors.latest(lambda kept: (kept[0], kept[2]) == (rest.digest, model))
        if other is not None and not from_scratch:
            found = other.rebind(handles, progress=progress)
        else:
            found = native.supple().Editor(prepared_mesh, handles, model=model, progress=progress)
        _editors.put(key, found)
    return found
