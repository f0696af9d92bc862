"""`raytide cache`: what is kept on disk, and how to be rid of it."""

from __future__ import annotations

from cyclopts import App

from raytide.cli.parameters import Flag

app = App(name="cache", help="Show or clear the kernel cache.")


@app.command
def info(*, json: Flag = False) -> int:
    """Show folder, sizes and damaged entries.

    Parameters
    ----------
    json
        Print the same as JSON.
    """
    from raytide.device.failure import human
    from raytide.device.storage import cache_facts

    facts = cache_facts(verify=True)
    if json:
        import json as text

        print(text.dumps(facts.as_dict(), indent=2))
        return 0
    state = " (cannot be written)" if not facts.writable else " (its disk is full, or nearly)" if not facts.room else ""
    print(f"{facts.folder}{state}, at most {human(facts.cap_bytes)} a part")
    for part in facts.parts:
        damage = f", {part.damaged} damaged" if part.damaged else ""
        print(f"  {part.name:<8} {part.entries:>5} files  {human(part.size_bytes):>10}{damage}")
    return 0


@app.command
def clear() -> int:
    """Remove compiled kernels, probe results and leftovers; the next render compiles again."""
    from raytide.device.failure import human
    from raytide.device.storage import clear_cache

    print(f"removed {human(clear_cache())}")
    return 0
