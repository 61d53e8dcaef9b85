"""MotionWavelet: prediction of human motion by diffusion on wavelet coefficients, with guidance, control and baselines."""
