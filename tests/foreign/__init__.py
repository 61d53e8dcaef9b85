"""Chapters on other people's motions: small sets of every shape, and the real ones that are at hand."""
