// The discrete wavelet transform of a list of numbers: Eq. 1 to 3, as PyWavelets has it. Filters: dec_lo, dec_hi, rec_lo, rec_hi.

const at = (x, i, mode) => { // beyond the ends: zeros, or a mirror image
  if (i >= 0 && i < x.length) return x[i];
  if (mode === "zero") return 0;
  const turn = ((i % (2 * x.length)) + 2 * x.length) % (2 * x.length);
  return x[turn < x.length ? turn : 2 * x.length - 1 - turn];
};

/** a[k] = sum_j h[j] x[2k+1-j] and d[k] with g: Eq. 3. */
export function dwt(x, { dec_lo, dec_hi }, mode) {
  const rows = Math.floor((x.length + dec_lo.length - 1) / 2);
  return [dec_lo, dec_hi].map((h) => Array.from({ length: rows }, (_, k) => h.reduce((sum, weight, j) => sum + weight * at(x, 2 * k + 1 - j, mode), 0)));
}

/** x[n] from the dual filters at even shifts: Eq. 1. */
export function idwt(a, d, { rec_lo, rec_hi }, length) {
  const x = Array(length).fill(0), taps = rec_lo.length;
  for (let k = 0; k < a.length; k++)
    for (let j = 0; j < taps; j++) {
      const n = 2 * k + j - (taps - 2);
      if (n >= 0 && n < length) x[n] += a[k] * rec_lo[j] + d[k] * rec_hi[j];
    }
  return x;
}

/** Bands [a_n, d_n, ..., d_1]. */
export function wavedec(x, filters, mode, level) {
  const [a, d] = dwt(x, filters, mode);
  return level > 1 ? [...wavedec(a, filters, mode, level - 1), d] : [a, d];
}

/** The signal of `length` samples that has these bands. */
export function waverec([a, ...details], filters, length) {
  const lengths = details.map(() => 0).reduce((all) => [Math.floor((all[0] + filters.dec_lo.length - 1) / 2), ...all], [length]);
  return details.reduce((x, d, i) => idwt(x, d, filters, lengths[i + 1]), a);
}
