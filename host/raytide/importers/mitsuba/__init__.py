"""Mitsuba 3 XML scenes: read, checked and turned into raytide's tables. See docs/mitsuba.md for what is mapped.

Source of the semantics: the documentation of Mitsuba 3.9 and its behaviour (parameter lists, defaults, order of
transforms, colour conversions), checked against the installed package.
"""

from raytide.importers.mitsuba.scene import Imported, read_scene

__all__ = ["Imported", "read_scene"]
