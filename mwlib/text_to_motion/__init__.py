"""The third system: motions from words, Free-T2M, the two models it changes, and its theory."""
