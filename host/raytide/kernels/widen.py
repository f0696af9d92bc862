"""Functions of one word of 32 bits, turned into the same functions of eight: one text serves both."""

from __future__ import annotations

import re

WORDS = "base/words.cl"  # its functions are derived for eight words ...
WORDS_OF_EIGHT = "base/words8.cl"  # ... in this virtual file


def of_eight(text: str) -> str:
    """`text` with uint8 for uint and an 8 at the end of the name of every function that it defines, for CPUs.

    Only what works word by word may stand there: shifts, masks, sums, products, and calls of each other.
    """
    names = ["uint", *re.findall(r"^static uint (\w+)\(", text, re.MULTILINE)]
    wide = re.sub(rf"\b({'|'.join(names)})\b", r"\g<1>8", text)
    return f"#if DEVICE_CPU\n{wide}#endif\n"
