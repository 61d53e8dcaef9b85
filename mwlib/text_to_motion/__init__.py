"""Free-T2M: motions from sentences, by diffusion with a loss on low frequencies and one on meaning."""
