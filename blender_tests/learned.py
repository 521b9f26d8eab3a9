# SPDX-License-Identifier: GPL-3.0-or-later
"""Features for tests: small and not trained, so that what they find is what adapting makes."""

import bodies
import bpy
import pairs

SMALL = {"inputs": 32, "width": 16, "outputs": 16, "blocks": 1, "eigenfunctions": 64}
LARGER = {"inputs": 64, "width": 64, "outputs": 64, "blocks": 2, "eigenfunctions": 64}


def save(supple, path, **options):
    """Write features to a file and return its path as text."""
    supple.untrained_match_model(**{**SMALL, "network": None, **options}).save(path)
    return str(path)


def triangle_pair():
    """As pairs.bare_pair, coarser and of triangles, so that both are cut in the same way."""
    uv, faces, _ = pairs.lump(12, 8)
    fans = [[face[0], *face[k : k + 2]] for face in faces for k in range(1, len(face) - 1)]
    body = bodies.add_mesh("Body", pairs.place(*uv.T), fans)
    return body, *pairs.add_shuffled(body)


def choose(source, target, model, **settings):
    """Set the panel, but for its start."""
    panel = bpy.context.scene.supple_match
    panel.source, panel.target, panel.model = source, target, model
    for name, value in settings.items():
        setattr(panel, name, value)


def find(source, target, model, **settings):
    """Set the panel and press the button."""
    choose(source, target, model, **settings)
    return bpy.ops.supple.find_correspondence()
