"""The version, in one place; results and runs carry it."""

__version__ = "0.2.0"
