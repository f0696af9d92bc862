"""Reading files that others wrote: bounded bytes, and geometry as plain arrays."""
