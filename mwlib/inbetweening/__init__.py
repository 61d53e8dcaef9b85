"""FreqDiffusionBridge: motions between two poses, by diffusion of cosine coefficients."""
