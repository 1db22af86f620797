# SPDX-License-Identifier: GPL-3.0-or-later
"""The interface in other languages: one module per language, registered with
``bpy.app.translations``.

Each module has two tables from the English text to its translation: ``OPERATORS`` for the labels of
operators, which are buttons and menu entries, and ``TEXTS`` for everything else. The texts of a
capture's progress are in ``stages``. Error messages of the solver stay English.
"""

from __future__ import annotations

import bpy

from . import de, es, fr, ja, zh

# Blender's own translations come first. In this context it has none, so ours hold where the same
# English word means something else in Blender.
CONTEXT = "Scope"
# A code without a country holds for all of them: Blender asks for "de_DE" and takes "de". Not so
# "zh", which could be the traditional script as well; "zh_CN" is its name in other versions.
LANGUAGES = {"de": de, "fr": fr, "es": es, "ja": ja, "zh_HANS": zh, "zh_CN": zh}


def register() -> None:
    """Add the translations to Blender's."""
    contexts = bpy.app.translations.contexts
    messages = {
        code: {
            **{
                (contexts.default, text): translation
                for text, translation in language.TEXTS.items()
            },
            **{(CONTEXT, text): translation for text, translation in language.TEXTS.items()},
            **{
                (contexts.operator_default, text): label
                for text, label in language.OPERATORS.items()
            },
        }
        for code, language in LANGUAGES.items()
    }
    bpy.app.translations.register(__name__, messages)


def unregister() -> None:
    """Remove the translations."""
    bpy.app.translations.unregister(__name__)
