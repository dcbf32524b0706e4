"""The Rust core; `coarsen.reference` offers the same functions in NumPy."""

__version__: str
