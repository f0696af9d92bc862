"""Measurements of devices and of raytide itself. Nothing here runs in a render."""
