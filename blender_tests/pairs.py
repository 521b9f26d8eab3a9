# SPDX-License-Identifier: GPL-3.0-or-later
"""Pairs of meshes whose match is known, and layers to carry between them. No product code."""

import bodies
import bpy
import numpy as np


def place(u, v):
    """Return where (u, v) of the unit square lies on a lump that no turn or mirror takes to itself.

    v is 0 at the lower pole and 1 at the upper; u runs around once.
    """
    a, b = 2 * np.pi * np.asarray(u), np.pi * np.asarray(v)
    radius = 1 + 0.25 * np.sin(a) * np.sin(b) + 0.2 * np.cos(2 * a + 1) * np.sin(b) ** 2
    radius = radius + 0.15 * np.cos(b) * np.sin(b) * np.cos(a)
    x, y = np.sin(b) * np.cos(a), np.sin(b) * np.sin(a)
    return radius[..., None] * np.stack([x, 1.3 * y, -1.9 * np.cos(b)], axis=-1)


def lump(around=32, down=20):
    """Return uv (n, 2) of the vertices, faces, and uv of each face's corners, seam at u = 0."""
    uv = [(0.0, 0.0), (0.0, 1.0)]
    uv += [(i / around, j / down) for j in range(1, down) for i in range(around)]

    def vertex(i, j):
        return 0 if j == 0 else 1 if j == down else 2 + (j - 1) * around + i % around

    faces, corners = [], []
    for j in range(down):
        for i in range(around):
            at = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
            if j == 0:
                at = [(i + 0.5, 0), at[2], at[3]]
            elif j == down - 1:
                at = [at[0], at[1], (i + 0.5, down)]
            faces.append([vertex(int(p), q) for p, q in at])
            corners.append([(p / around, q / down) for p, q in at])
    return np.array(uv), faces, corners


def add_lump(name="Body", around=32, down=20):
    """Add a lump and return it; `place` says where its vertices are."""
    uv, faces, _ = lump(around, down)
    return bodies.add_mesh(name, place(*uv.T), faces)


def weights_at(uv):
    """Return weights (n, 2) that sum to 1."""
    up = np.clip(1.5 * uv[:, 1] - 0.25, 0, 1)
    return np.stack([up, 1 - up], axis=1)


def colours_at(uv):
    """Return smooth colours (n, 4) without a seam."""
    turn = 2 * np.pi * uv[:, 0]
    fade = np.sin(np.pi * uv[:, 1])
    rgb = [0.5 + 0.4 * fade * np.cos(turn), 0.5 + 0.4 * fade * np.sin(turn), uv[:, 1]]
    return np.stack([*rgb, np.ones(len(uv))], axis=1)


def bent_at(uv):
    """Return a deformed lump."""
    rest = place(*uv.T)
    return rest + 0.3 * np.sin(1.5 * rest[:, 2:]) * np.array([1.0, 0.4, 0.0])


def dress(obj, around=32, down=20):
    """Give a lump UVs, weights, two colour attributes and two shape keys."""
    uv, _, corners = lump(around, down)
    layer = obj.data.uv_layers.new(name="Map")
    flat = np.concatenate([np.array(face) for face in corners])
    for loop, value in zip(layer.data, flat.tolist(), strict=True):
        loop.uv = value
    for name, column in zip(("up.L", "down.R"), weights_at(uv).T, strict=True):
        group = obj.vertex_groups.new(name=name)
        for vertex in np.flatnonzero(column):
            group.add([int(vertex)], column[vertex], "REPLACE")
    attributes = obj.data.color_attributes
    attributes.new("Skin", "FLOAT_COLOR", "POINT")
    attributes["Skin"].data.foreach_set("color", colours_at(uv).astype(np.float32).ravel())
    attributes.new("Paint", "BYTE_COLOR", "CORNER")
    side = (flat[:, :1] < 0.5) * np.array([[0.8, 0.1, 0.0, 0]]) + np.array([[0.1, 0.1, 0.1, 1.0]])
    attributes["Paint"].data.foreach_set("color", side.astype(np.float32).ravel())
    obj.shape_key_add(name="Basis")
    for name, part in (("Bend", 1.0), ("Half", 0.5)):
        key = obj.shape_key_add(name=name)
        key.value = 0.25
        rest = place(*uv.T)
        moved = rest + part * (bent_at(uv) - rest)
        for point, co in zip(key.data, moved.tolist(), strict=True):
            point.co = co
    return obj


def add_shuffled(obj, name="Scan", seed=3):
    """Add obj's rest mesh in another order of vertices, faces and corners, without any layer.

    Returns it and the order: its vertex i is vertex order[i] of obj.
    """
    random = np.random.default_rng(seed)
    rest = bodies.rest(obj)
    order = random.permutation(len(rest))
    back = np.argsort(order)
    faces = [[int(back[v]) for v in polygon.vertices] for polygon in obj.data.polygons]
    faces = [faces[k] for k in random.permutation(len(faces))]
    faces = [np.roll(face, k % len(face)).tolist() for k, face in enumerate(faces)]
    return bodies.add_mesh(name, rest[order], faces), order


def choose(source, target, start="NEAREST", **settings):
    """Set the panel."""
    panel = bpy.context.scene.supple_match
    panel.source, panel.target, panel.start = source, target, start
    for name, value in settings.items():
        setattr(panel, name, value)
    return panel


def attribute(obj, name):
    """Return an attribute's values as an array."""
    data = obj.data.attributes[name].data
    kind = obj.data.attributes[name].data_type
    part = {"FLOAT_VECTOR": "vector", "FLOAT_COLOR": "color", "BYTE_COLOR": "color"}
    return np.array([getattr(item, part.get(kind, "value")) for item in data])


def partners(target, source):
    """Return where the map kept on target sends its vertices, (n, 3) in source's coordinates."""
    source.data.calc_loop_triangles()
    triangles = np.array([t.vertices for t in source.data.loop_triangles])
    corners = bodies.rest(source)[triangles[attribute(target, "Supple Match Face")]]
    return np.einsum("nk,nkd->nd", attribute(target, "Supple Match Weights"), corners)


def uv_by_corner(obj, name="Map"):
    """Return {(polygon's vertices, vertex): uv}, whatever the order of faces and corners."""
    layer = obj.data.uv_layers[name].data
    found = {}
    for polygon in obj.data.polygons:
        for loop, vertex in zip(polygon.loop_indices, polygon.vertices, strict=True):
            found[frozenset(polygon.vertices), vertex] = np.array(layer[loop].uv)
    return found


def everything():
    """As `bodies.everything`, with all that matching and transferring may change."""
    state = bodies.everything()
    for obj in bpy.data.objects:
        if obj.type != "MESH":
            continue
        kept = obj.supple_map
        state[obj.name] += (
            obj.data.name,
            kept.source.name if kept.source else None,
            (kept.source_digest, kept.target_digest, kept.confidence),
            [(record.name, record.digest) for record in kept.made],
            [group.name for group in obj.vertex_groups],
            [[(g.group, g.weight) for g in v.groups] for v in obj.data.vertices],
            sorted((a.name, a.domain, a.data_type) for a in obj.data.attributes),
            [layer.name for layer in obj.data.uv_layers],
        )
        if obj.mode == "OBJECT":
            state[obj.name] += (
                [[tuple(loop.uv) for loop in layer.data] for layer in obj.data.uv_layers],
                [attribute(obj, a.name).tobytes() for a in obj.data.color_attributes],
            )
    panel = bpy.context.scene.supple_match
    rows = [(row.source_vertex, row.target_vertex) for row in panel.pairs]
    state["panel"] = (panel.source, panel.target, panel.start, rows, panel.overwrite)
    state["meshes"] = sorted(mesh.name for mesh in bpy.data.meshes)
    return state


def bare_pair():
    """Add a body and its copy in another order; return both and that order."""
    body = add_lump()
    return body, *add_shuffled(body)


def dressed_pair():
    """As bare_pair, with layers on the body, and matched exactly."""
    body = dress(add_lump())
    scan, order = add_shuffled(body)
    choose(body, scan, refine=False)
    bpy.ops.supple.match()
    return body, scan, order


def match_error(target, source, order):
    """Return the mean distance of the map kept on target from the truth; a lump is about 4 long."""
    truth = bodies.rest(source)[order]
    return float(np.linalg.norm(partners(target, source) - truth, axis=1).mean())


def error(pair):
    """match_error of what bare_pair returned."""
    body, scan, order = pair
    return match_error(scan, body, order)


def transfer(*parts, **settings):
    panel = bpy.context.scene.supple_match
    panel.transfer = set(parts)
    for name, value in settings.items():
        setattr(panel, name, value)
    return bpy.ops.supple.transfer()


def weights(obj):
    names = [group.name for group in obj.vertex_groups]
    found = np.zeros((len(obj.data.vertices), len(names)))
    for vertex in obj.data.vertices:
        for element in vertex.groups:
            found[vertex.index, element.group] = element.weight
    return names, found


def is_pole(body, face):
    """Return whether a face is one of a lump's fans, whose edges all are seams at the pole."""
    return len(body.data.vertices) == 610 and not {0, 1}.isdisjoint(face)


def assert_same_uvs(body, scan, order):
    truth = uv_by_corner(body)
    for (face, vertex), uv in uv_by_corner(scan).items():
        if is_pole(body, [int(order[v]) for v in face]):
            continue
        wanted = truth[frozenset(int(order[v]) for v in face), int(order[vertex])]
        assert np.abs(uv - wanted).max() < 2e-3, (face, vertex, uv, wanted)
