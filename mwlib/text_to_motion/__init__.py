"""The third system: motions from sentences, after Free-T2M."""
