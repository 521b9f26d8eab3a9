# SPDX-License-Identifier: GPL-3.0-or-later
"""One source to many targets, and transfers without operators."""

import bodies
import bpy
import numpy as np
import pairs
import pytest


@pytest.fixture
def pair():
    return pairs.dressed_pair()


def select(*objects):
    for obj in bpy.data.objects:
        obj.select_set(obj in objects)


def test_to_many_with_a_bad_one(pair):
    body, scan, _ = pair
    other = pairs.add_lump("Other", 41, 23)
    wire = bodies.add_mesh("Wire", np.eye(3), [])
    mine = pairs.add_lump("Mine")
    mine.data.uv_layers.new(name="Map")
    select(body, scan, other, wire, mine)
    bpy.context.scene.supple_match.transfer = {"UVS", "WEIGHTS"}
    before = pairs.everything()
    assert bpy.ops.supple.match_transfer_many() == {"FINISHED"}
    pairs.assert_same_uvs(*pair)
    assert len(other.vertex_groups) == 2 and other.supple_map.source == body
    after = pairs.everything()
    assert after["Wire"] == before["Wire"] and after["Mine"] == before["Mine"]
    select(body, wire)
    with pytest.raises(RuntimeError, match=r"Wire: the mesh has no faces"):
        bpy.ops.supple.match_transfer_many()
    select(body)
    with pytest.raises(RuntimeError, match=r"Body: no other mesh is selected"):
        bpy.ops.supple.match_transfer_many()


def test_without_operators(addon):
    api = addon("api")
    body = pairs.dress(pairs.add_lump())
    scan, order = pairs.add_shuffled(body)
    found = api.match(body, scan, "NEAREST", refine=False)
    assert found.confidence.mean() > 0.9
    assert api.match(body, scan, "CURRENT").confidence.shape == (610,)
    api.match(body, scan, "NEAREST", refine=False)
    layers = api.transfer(body, scan, {"UVS", "KEYS"})
    assert list(layers.uvs) == ["Map"] and [key.name for key in layers.keys] == ["Bend", "Half"]
    pairs.assert_same_uvs(body, scan, order)
    with pytest.raises(api.UserError, match=r"There is no start 'LUCK'"):
        api.match(body, scan, "LUCK")
