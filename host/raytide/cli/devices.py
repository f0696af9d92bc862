"""`raytide devices`: every OpenCL device, and every driver that gives none."""

from __future__ import annotations

from raytide.cli.parameters import Flag


def devices(*, json: Flag = False) -> int:
    """List the OpenCL devices, the default first, and drivers that give none.

    Parameters
    ----------
    json
        Print everything that is known, as JSON.
    """
    from raytide.device import list_platforms
    from raytide.device.find import by_preference

    platforms = list_platforms()
    found = by_preference(platforms)
    if json:
        import json as text

        content = {"devices": [one.as_dict() for one in found], "platforms": [one.as_dict() for one in platforms]}
        print(text.dumps(content, indent=2))
    else:
        _print_table(found, platforms)
    return 0 if found else 3


def _print_table(found: list, platforms: list) -> None:
    import sys

    from raytide.device.failure import human

    rows = [("ID", "DEVICE", "UNITS", "MEMORY", "LARGEST BUFFER")]
    for one in found:
        memory, largest = human(one.global_mem_bytes), human(one.max_alloc_bytes)
        rows.append((one.id, one.name, str(one.compute_units), memory, largest))
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    for row in rows if found else []:
        print("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())
    for platform in platforms:
        if platform.problem:
            where = f" ({platform.icd_file})" if platform.icd_file else ""
            print(f"raytide: {platform.name}{where}: {platform.problem}", file=sys.stderr)
    if not found:
        from raytide.device.find import nothing_found

        print(f"raytide: {nothing_found()}", file=sys.stderr)
