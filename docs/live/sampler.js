// Reverse processes in the papers' notation, as in mwlib/diffusion/samplers.py. They know nothing of networks, bodies or words.
// y is an array of floats; denoise(y_t, t) promises eps; alphaBar is the schedule, indices fall.

/** n numbers c * y + d * z. */
const mixed = (c, y, d, z) => y.map((value, i) => c * value + d * z[i]);

export const y0HatOf = (y, eps, a) => mixed(1 / Math.sqrt(a), y, -Math.sqrt((1 - a) / a), eps);
export const epsOf = (y, y0, a) => mixed(1 / Math.sqrt(1 - a), y, -Math.sqrt(a / (1 - a)), y0);
export const noised = (y0, eps, a) => mixed(Math.sqrt(a), y0, Math.sqrt(1 - a), eps);

/** Classifier-free guidance: (1+w) cond - w uncond ("eq7"), or uncond + w (cond - uncond) ("alg1"). */
export const classifierFree = (conditional, unconditional, w, form = "eq7") =>
  form === "eq7" ? mixed(1 + w, conditional, -w, unconditional) : mixed(w, conditional, 1 - w, unconditional);

/** The retained indices, falling: "leading" as HumanMAC, "trailing" from the last index on. */
export function ddimIndices(steps, subset, spacing) {
  const halfToEven = (x) => (x % 1 === 0.5 ? 2 * Math.round(x / 2) : Math.round(x)); // as Python rounds
  const leading = (i) => i * Math.floor(steps / subset) + (subset < steps ? 1 : 0);
  const trailing = (i) => halfToEven(((i + 1) * steps) / subset) - 1;
  return Array.from({ length: subset }, (_, i) => (spacing === "leading" ? leading : trailing)(subset - 1 - i));
}

/** Index, alpha_bar there, and that which the step goes to; after the last step it is 1. */
const levels = (alphaBar, indices) => indices.map((t, i) => [t, alphaBar[t], i + 1 < indices.length ? alphaBar[indices[i + 1]] : 1]);

/** DDIM (Song et al. 2021, Eq. 12); eta is the share of the posterior deviation that is drawn anew. */
export async function* ddim(denoise, y, alphaBar, indices, { eta = 0, noise } = {}) {
  for (const [t, a, aPrev] of levels(alphaBar, indices)) {
    const sigma = eta * Math.sqrt(((1 - aPrev) / (1 - a)) * (1 - a / aPrev));
    const eps = await denoise(y, t), y0 = y0HatOf(y, eps, a);
    y = mixed(Math.sqrt(aPrev), y0, Math.sqrt(Math.max(1 - aPrev - sigma ** 2, 0)), eps);
    if (sigma > 0) y = mixed(1, y, sigma, noise());
    yield { t, y, y0, eps };
  }
}

/** Eq. 6: the mean of DDPM's posterior, and with `noise` its spread, which makes it DDPM. */
export async function* posteriorMean(denoise, y, alphaBar, indices, { noise } = {}) {
  for (const [t, a, aPrev] of levels(alphaBar, indices)) {
    const alpha = a / aPrev, eps = await denoise(y, t), y0 = y0HatOf(y, eps, a);
    y = mixed(1 / Math.sqrt(alpha), y, -(1 - alpha) / Math.sqrt((1 - a) * alpha), eps);
    if (noise && aPrev < 1) y = mixed(1, y, Math.sqrt(((1 - aPrev) / (1 - a)) * (1 - alpha)), noise());
    yield { t, y, y0, eps };
  }
}

/** Draws of n normal numbers, the same for the same seed (mulberry32, Box and Muller). */
export function gaussian(seed, n) {
  let state = seed >>> 0;
  const uniform = () => {
    state = (state + 0x6d2b79f5) >>> 0;
    let x = Math.imul(state ^ (state >>> 15), state | 1);
    x ^= x + Math.imul(x ^ (x >>> 7), x | 61);
    return ((x ^ (x >>> 14)) >>> 0) / 2 ** 32;
  };
  return () => Float32Array.from({ length: n }, () => Math.sqrt(-2 * Math.log(1 - uniform())) * Math.cos(2 * Math.PI * uniform()));
}
