"""Spoilt files of every kind, each read under a limit of time and memory, and calls with spoilt arguments."""
