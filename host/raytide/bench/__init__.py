"""The device benchmark: a score only for right pictures. Nothing here runs in a render."""
