# SPDX-License-Identifier: GPL-3.0-or-later
"""The match as colours, and a vertex's partner."""

import bodies
import bpy
import numpy as np
import pairs
import pytest

ATTRIBUTE = "Supple Match"


@pytest.fixture
def pair():
    body = pairs.add_lump()
    scan, order = pairs.add_shuffled(body)
    pairs.choose(body, scan, refine=False)
    bpy.ops.supple.match()
    return body, scan, order


def test_partners_have_the_same_colour(pair):
    body, scan, order = pair
    assert bpy.ops.supple.match_show() == {"FINISHED"}
    of_body, of_scan = (pairs.attribute(obj, ATTRIBUTE) for obj in (body, scan))
    assert np.ptp(of_body[:, :3], axis=0).min() > 0.99  # the whole range of each axis
    assert np.abs(of_scan - of_body[order]).max() < 1e-3
    assert bpy.ops.supple.match_show(show=False) == {"FINISHED"}
    for obj in (body, scan):
        assert ATTRIBUTE not in obj.data.color_attributes


def test_least_confident_places_are_grey(pair, addon):
    _, scan, _ = pair
    confidence = np.ones(len(scan.data.vertices), np.float32)
    confidence[7] = 0.0
    scan.data.attributes["Supple Confidence"].data.foreach_set("value", confidence)
    bpy.ops.supple.match_show()
    assert np.allclose(pairs.attribute(scan, ATTRIBUTE)[7, :3], addon("match_show").GREY)


def test_colours_follow_a_new_match(pair):
    scan = pair[1]
    bpy.ops.supple.match_show()
    colours = pairs.attribute(scan, ATTRIBUTE)
    scan.location.x = 0.5
    bpy.ops.supple.match()
    assert np.abs(pairs.attribute(scan, ATTRIBUTE) - colours).max() > 0.05


def test_the_users_colours_stay_active(pair):
    scan = pair[1]
    scan.data.color_attributes.new("Mine", "FLOAT_COLOR", "POINT")
    scan.data.color_attributes.active_color = scan.data.color_attributes["Mine"]
    for show in (True, True, False, False):
        bpy.ops.supple.match_show(show=show)
        assert scan.data.color_attributes.active_color.name == "Mine"


def test_viewports_come_back(pair, addon):
    """As the button does it, with a 3D View at hand; here it is a stand-in."""

    class Shading:
        type, color_type = "MATERIAL", "RANDOM"

    class View:
        shading = Shading()

    body, scan, _ = pair
    colour_view = addon("colour_view")
    bpy.ops.supple.match_show()
    addon("match_show").view(body, scan, View)
    assert colour_view.is_viewed(scan, ATTRIBUTE, View) and colour_view.is_viewed(
        body, ATTRIBUTE, View
    )
    assert body.supple.shading_before == "RANDOM"
    bpy.ops.supple.match_show(show=False)
    assert body.supple.shading_before == "" and scan.supple.shading_before == ""


def test_the_cursor_goes_to_the_partner(pair):
    body, scan, order = pair
    body.matrix_world = bodies.rigid_motion()
    bpy.context.view_layer.update()
    assert bpy.ops.supple.match_partner(vertex=33) == {"FINISHED"}
    wanted = bodies.to_world(body, bodies.rest(body))[order[33]]
    assert np.allclose(bpy.context.scene.cursor.location, wanted, atol=1e-4)
    bpy.context.scene.cursor.location = (0, 0, 0)
    for index, vertex in enumerate(scan.data.vertices):
        vertex.select = index == 33
    for polygon in scan.data.polygons:
        polygon.select = False
    for edge in scan.data.edges:
        edge.select = False
    bpy.context.view_layer.objects.active = scan
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.supple.match_partner()
    assert np.allclose(bpy.context.scene.cursor.location, wanted, atol=1e-4)
    assert scan.mode == "EDIT"
    with pytest.raises(RuntimeError, match=r"Scan: it has no vertex 9999"):
        bpy.ops.supple.match_partner(vertex=9999)
