"""Large pages for the big buffers of CPU devices: a tree of a million triangles lies on 25 000 pages of 4 KiB, more
than the processor keeps the places of, and on 50 of 2 MiB. A hint to the system (Linux: transparent huge pages)."""

from __future__ import annotations

import ctypes
import mmap
from typing import Any

LARGE = 1 << 21  # bytes of a large page
SMALLEST = 2 * LARGE  # of a buffer: it seldom begins where a page does, and less would seldom hold a whole one


def ask_for_large_pages(cl: Any, queue: Any, handle: Any, nbytes: int) -> bool:
    """Asks for large pages behind a buffer that nothing was written to yet; whether the system took the wish.

    `queue` waits. The driver keeps the memory, and whatever it does with it afterwards stays right.
    """
    if nbytes < SMALLEST or not hasattr(mmap, "MADV_HUGEPAGE"):
        return False
    try:
        mapped, _ = cl.enqueue_map_buffer(queue, handle, cl.map_flags.WRITE, 0, (nbytes,), "u1", is_blocking=True)
    except cl.Error:
        return False
    begin = mapped.ctypes.data // mmap.PAGESIZE * mmap.PAGESIZE
    end = mapped.ctypes.data + nbytes
    taken = ctypes.CDLL(None).madvise(ctypes.c_void_p(begin), ctypes.c_size_t(end - begin), mmap.MADV_HUGEPAGE) == 0
    mapped.base.release(queue)
    queue.finish()
    return taken
