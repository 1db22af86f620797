# SPDX-License-Identifier: GPL-3.0-or-later
"""The colours of a person's skin, hair and clothes. Needs bpy."""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from ...solver import Body
from ...tools.render_sample.stage import add_person, make_material
from .people import Person

SKIN = "skin"
HAIR = "hair"
SUIT = "suit"
ACCENT = "suit_accent"
TROUSERS = "trousers"
# shares of the people
MANY_COLORS = 0.6
WITH_TROUSERS = 0.7
STRIPED = 0.3
TROUSERS_BELOW_M = 0.05  # over the pelvis, at rest
FABRIC_WAVES = 24
FABRIC_PER_M = 9.0
FABRIC_CONTRAST = 0.1
STRIPE_M = (0.05, 0.12)
STRIPE_DARK = 0.55


def dressed(body: Body, person: Person) -> bpy.types.Object:
    """Add a person with colours of its own; trousers differ from what is worn above in most."""
    mesh = add_person(body)
    rng = np.random.default_rng(person.seed)
    colors = {
        SKIN: np.array([0.62, 0.40, 0.30]) * rng.uniform(0.2, 1.0),
        HAIR: rng.uniform(0.01, 0.35) * np.array([1.0, 0.75, 0.5]),
        SUIT: rng.uniform(0.02, 0.7, 3)
        if rng.random() < MANY_COLORS
        else np.full(3, rng.uniform(0.02, 0.6)),
        ACCENT: rng.uniform(0.02, 0.7, 3),
    }
    for slot, name in enumerate(body.material_names):
        if name in colors:
            mesh.data.materials[slot] = _fabric(
                f"{name} of {mesh.name}", colors[name], patterned=name in (SUIT, HAIR)
            )
    if rng.random() < WITH_TROUSERS and body.face_material is not None:
        heights = (
            body.v_template[body.faces, 1].mean(axis=1) - body.rest_joints(np.zeros(body.P))[0, 1]
        )
        legs = (body.face_material == body.material_names.index(SUIT)) & (
            heights < TROUSERS_BELOW_M
        )
        mesh.data.materials.append(
            _fabric(f"{TROUSERS} of {mesh.name}", rng.uniform(0.02, 0.5, 3), patterned=True)
        )
        slots = np.where(legs, len(body.material_names), body.face_material).astype(np.int32)
        mesh.data.polygons.foreach_set("material_index", slots)
    shade = mesh.data.attributes.new("shade", "FLOAT", "POINT")
    shade.data.foreach_set("value", _shade(rng, body.v_template).astype(np.float32))
    return mesh


def _shade(rng: np.random.Generator, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the brightness (V,) of the fabric at points of the body at rest (V, 3), about 1."""
    waves = rng.normal(0.0, 2 * np.pi * FABRIC_PER_M, (FABRIC_WAVES, 3))
    noise = np.sin(points @ waves.T + rng.uniform(0, 2 * np.pi, FABRIC_WAVES)).sum(
        axis=1
    ) / np.sqrt(FABRIC_WAVES / 2)
    shade = np.clip(1.0 + FABRIC_CONTRAST * noise, 0.5, 1.5)
    width = rng.uniform(*STRIPE_M)
    striped = rng.random() < STRIPED
    return shade * np.where(striped & (points[:, 1] % width < width / 2), STRIPE_DARK, 1.0)


def _fabric(name: str, color: NDArray[np.float64], patterned: bool) -> bpy.types.Material:
    """Return a material of a linear colour (3,), multiplied by the mesh's attribute "shade" if it
    is patterned.
    """
    r, g, b = color.tolist()
    material = make_material(name, (r, g, b))
    nodes = material.node_tree.nodes
    links = material.node_tree.links
    surface = nodes["Principled BSDF"]
    surface.inputs["Roughness"].default_value = 0.6
    if patterned:
        shade = nodes.new("ShaderNodeAttribute")
        product = nodes.new("ShaderNodeVectorMath")
        shade.attribute_name = "shade"
        product.operation = "MULTIPLY"
        product.inputs[0].default_value = (r, g, b)
        links.new(shade.outputs["Fac"], product.inputs[1])
        links.new(product.outputs["Vector"], surface.inputs["Base Color"])
    return material
